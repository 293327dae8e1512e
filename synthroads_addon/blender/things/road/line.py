"""SR Line Marking: a solid or dashed line on the pavement."""

from __future__ import annotations

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.axis import rows_along
from ...nodes.backbone import last_station, look_up, station_ribbon
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import FAR, INSTANCES, Inputs, backbone_socket, instance_number, integer, material_of, metres
from ...nodes.solids import row_of_points
from ...nodes.strip import strip_group

_EDGES = ("edge_left", "edge_right", "edge_left_height", "edge_right_height")
"""Attributes of the backbone's rows: offsets and heights of the line's edges, m."""
SNAP = 1e-3
"""Distance (m) from a row of the backbone up to which an end of a dash is that row; chosen."""


class Dashes(Inputs):
    """Inputs of a line along the road: dashes, stations, film thickness, instances."""

    dash_length = metres(6.0, (0.0, 100.0), "Length of a dash; 0 for a solid line")
    gap_length = metres(12.0, (0.0, 100.0), "Length of a gap")
    start_station = metres(0.0, (0.0, 1e6), "Beginning of the first dash")
    end_station = metres(1e6, (0.0, 1e6), "End of the line")
    film_thickness = metres(0.003, (0.0005, 0.006), "Height above the pavement")
    instance = instance_number()
    first_dash_instance = integer(0, INSTANCES, "Instance number of the first dash; the others have those after it")


class LinePaint(Inputs):
    """Inputs of a line's class and material."""

    class_ = integer(class_id("road_marking"), (0, 255), "Semantic class of the faces")
    material = material_of("the line", "paint_white")


class _EdgeInputs(Inputs):
    backbone = backbone_socket()
    left_offset = metres(0.1, FAR, "Offset of the left edge, positive to the left")
    right_offset = metres(-0.1, FAR, "Offset of the right edge")
    left_height = metres(0.0, FAR, "Pavement at the left edge above the axis")
    right_height = metres(0.0, FAR, "Pavement at the right edge")


@makes_group("SR Line Marking", catalogue="Road")
def marking_group(tree: Tree) -> None:
    """A line between two offsets, dashed or solid, raised above the pavement by its film.

    Offsets and heights may be fields on the backbone's points.
    """
    edges, line, paint = _EdgeInputs(tree), Dashes(tree), LinePaint(tree)
    start, film = line.start_station, line.film_thickness

    with tree.frame("Dashes: a solid line is one dash"):
        backbone = rows_along(edges.backbone)
        end = op.minimum(line.end_station, last_station(backbone))
        is_dashed = line.dash_length > 0.0
        length = op.switch(is_dashed, end - start, line.dash_length)
        period = op.switch(is_dashed, (end - start) * 2.0, line.dash_length + line.gap_length)
        count = op.round_up(op.maximum((end - start) / period - 1e-6, 0.0))
    with tree.frame("Edges as attributes of the rows"):
        edge_values = (edges.left_offset, edges.right_offset, edges.left_height, edges.right_height)
        for name, value in zip(_EDGES, edge_values, strict=True):
            backbone = op.store(backbone, name, value)
    rows = _with_ends(tree, backbone, (start, end, length, period, count))
    with tree.frame("Instance number: the line's own, or one for each dash"):
        station = op.named_attribute(tree, "station")
        dash = tree.node("FunctionNodeFloatToInt", (station - start) / period, rounding_mode="FLOOR").value
        instance = op.switch(is_dashed, line.instance, line.first_dash_instance + dash)
    with tree.frame("Ribbon over all rows; the faces of the gaps are deleted"):
        ribbon = tree.call(
            strip_group(),
            backbone=rows,
            left_offset=op.named_attribute(tree, "edge_left"),
            right_offset=op.named_attribute(tree, "edge_right"),
            left_height=op.named_attribute(tree, "edge_left_height") + film,
            right_height=op.named_attribute(tree, "edge_right_height") + film,
            instance=instance,
            **paint.values,
        ).value
        is_painted = (station > start) & (station < end) & ((station - start) % period < length)
        tree.output("Mesh", op.delete_faces(ribbon, ~is_painted), description="Dashes whose faces look up")


def _with_ends(tree: Tree, backbone: Value, dashes: tuple[Value, Value, Value, Value, Value]) -> Value:
    """Add nodes that insert a row into the backbone at both ends of every dash; return it sorted by station.

    Args:
        tree: tree to add the nodes to.
        backbone: the backbone with the line's edges as attributes.
        dashes: stations of the line's start and end, length of a dash, distance between starts of dashes (m), number of
            dashes.
    """
    start, end, length, period, count = dashes
    ribbon = station_ribbon(backbone, _EDGES)
    with tree.frame("Ends of the dashes as rows of their own"):
        points = row_of_points(tree, count * 2)
        end_index = op.index(tree)
        # Points of even number are starts of dashes, the others are their ends.
        end_of_dash = op.minimum(start + (end_index // 2) * period + (end_index % 2) * length, end)
        nearest_row = tree.node("GeometryNodeSampleNearest", ribbon, op.vector(tree, end_of_dash), domain="POINT").value
        row_station = op.sample_index(ribbon, op.named_attribute(tree, "station"), nearest_row)
        # No row is inserted where the backbone has one already.
        distance = op.unary("ABSOLUTE", end_of_dash - row_station)
        points = op.delete_points(op.store(points, "station", end_of_dash), distance < SNAP)
        station = op.named_attribute(tree, "station")
        for name in ("curvature", *_EDGES):
            points = op.store(points, name, look_up(ribbon, name, station))
        points = op.store(points, "left", look_up(ribbon, "left", station))
        points = op.set_position(points, look_up(ribbon, "axis", station))
        rows = op.join(backbone, points)
        return tree.node(
            "GeometryNodeSortElements", rows, domain="POINT", sort_weight=op.named_attribute(tree, "station")
        ).value
