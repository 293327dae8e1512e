"""SR Line Marking: a solid or dashed line on the pavement."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.backbone import last_station, look_up, station_ribbon
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.solids import row_of_points
from ...nodes.strip import FAR, INSTANCES, strip_group

_EDGES = ("edge_left", "edge_right", "edge_left_height", "edge_right_height")
SNAP = 1e-3
"""End of a dash this near (m) to a row of the backbone: it is that row."""


@makes_group("SR Line Marking")
def marking_group(tree: Tree) -> None:
    """A line between two offsets, dashed or solid, raised above the pavement by its film.

    Offsets and heights may be fields on the backbone's points.
    """
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    left = tree.number("Left Offset", 0.1, FAR, unit="m", description="Offset of the left edge, positive to the left")
    right = tree.number("Right Offset", -0.1, FAR, unit="m", description="Offset of the right edge")
    left_height = tree.number("Left Height", 0.0, FAR, unit="m", description="Pavement at the left edge above the axis")
    right_height = tree.number("Right Height", 0.0, FAR, unit="m", description="Pavement at the right edge")
    given = declare_marking(tree)
    first, last = given["start_station"], given["end_station"]
    dash, gap, film = given["dash"], given["gap"], given["film_thickness"]

    with tree.frame("Dashes: a solid line is one dash"):
        end = op.minimum(last, last_station(backbone))
        dashed = dash > 0.0
        length = op.switch(dashed, end - first, dash)
        period = op.switch(dashed, (end - first) * 2.0, dash + gap)
        count = op.rounded_up(op.maximum((end - first) / period - 1e-6, 0.0))
    with tree.frame("Edges as attributes of the rows"):
        edges = dict(zip(_EDGES, (left, right, left_height, right_height), strict=True))
        for name, value in edges.items():
            backbone = op.store(backbone, name, value)
    rows = _with_ends(tree, backbone, (first, end, length, period, count))
    with tree.frame("Ribbon over all rows; the faces of the gaps are deleted"):
        ribbon = tree.call(
            strip_group(),
            backbone=rows,
            left_offset=op.named_attribute(tree, "edge_left"),
            right_offset=op.named_attribute(tree, "edge_right"),
            left_height=op.named_attribute(tree, "edge_left_height") + film,
            right_height=op.named_attribute(tree, "edge_right_height") + film,
            class_=given["class_"],
            instance=given["instance"],
            material=given["material"],
        ).value
        station = op.named_attribute(tree, "station")
        painted = (station > first) & (station < end) & ((station - first) % period < length)
        tree.output("Mesh", op.delete_faces(ribbon, ~painted), description="Dashes whose faces look up")


def declare_marking(tree: Tree) -> dict[str, Value]:
    """Declare the inputs of a line that don't say where it lies across the road."""
    stations, lengths = (0.0, 1e6), (0.0, 100.0)
    return {
        "start_station": tree.number(
            "Start Station", 0.0, stations, unit="m", description="Beginning of the first dash"
        ),
        "end_station": tree.number("End Station", 1e6, stations, unit="m", description="End of the line"),
        "dash": tree.number("Dash", 6.0, lengths, unit="m", description="Length of a dash; 0 for a solid line"),
        "gap": tree.number("Gap", 12.0, lengths, unit="m", description="Length of a gap"),
        "film_thickness": tree.number(
            "Film Thickness", 0.003, (0.0, 0.01), unit="m", description="Height above the pavement"
        ),
        "class_": tree.integer("Class", 2, (0, 255), description="Semantic class of the faces"),
        "instance": tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces"),
        "material": tree.input("Material", "Material", description="Material of the faces"),
    }


def _with_ends(tree: Tree, backbone: Value, dashes: tuple[Value, Value, Value, Value, Value]) -> Value:
    """Return the backbone with a row more at both ends of every dash."""
    first, end, length, period, count = dashes
    ribbon = station_ribbon(backbone, _EDGES)
    with tree.frame("Ends of the dashes as rows of their own"):
        points = row_of_points(tree, count * 2)
        number = op.index(tree)
        wanted = op.minimum(first + (number // 2) * period + (number % 2) * length, end)
        near = tree.node("GeometryNodeSampleNearest", ribbon, op.vector(tree, wanted), domain="POINT").value
        snapped = op.sample_index(ribbon, op.named_attribute(tree, "station"), near)
        distance = op.unary("ABSOLUTE", wanted - snapped)
        points = op.delete_points(op.store(points, "station", wanted), distance < SNAP)
        station = op.named_attribute(tree, "station")
        for name in ("curvature", *_EDGES):
            points = op.store(points, name, look_up(ribbon, name, station))
        points = op.store(points, "left", look_up(ribbon, "left", station))
        points = op.set_position(points, look_up(ribbon, "axis", station))
        both = op.join(backbone, points)
        return tree.node(
            "GeometryNodeSortElements", both, domain="POINT", sort_weight=op.named_attribute(tree, "station")
        ).value
