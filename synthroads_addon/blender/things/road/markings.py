"""SR Carriageway Marking: a line at a distance from the axis; SR Markings: all lines of one side."""

from __future__ import annotations

import bpy

from ....road.pavement.field import CODES, PAINT_BESIDE, PAINT_CROSSED
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group, node_group
from ...nodes.inputs import Inputs, backbone_socket, inputs_class, metres
from .layout import MarkingLayout, strips_of
from .line import Dashes, LinePaint, marking_group
from .section import Section, height_group

_OUTWARDS = {"outer_edge": 0.5, "block": 0.5, "turnout_edge": 0.5, "inner_edge": -0.5, "gore_edge": -0.5}
"""Distance of a line's middle outwards from its boundary, as a share of its width, by its kind; else 0."""
_FAR = (-1000.0, 1000.0)


class _Width(Inputs):
    width = metres(0.15, (0.05, 1.0), "Width of the line")


class LineInputs(Dashes, _Width):
    """Inputs of a line on a boundary: its dashes and width."""


LINE_FIELDS = tuple(field.name for field in LineInputs.fields() if not field.name.endswith("instance"))
"""Inputs of a line that correspond to fields of `LineMarking`."""


class Distance(Inputs):
    """Input for a line's distance from the axis."""

    distance = metres(5.0, _FAR, "Distance of the line's middle from the axis, which may be a field")


class _Backbone(Inputs):
    backbone = backbone_socket()


@makes_group("SR Carriageway Marking", catalogue="Road")
def carriageway_marking_group(tree: Tree) -> None:
    """A line marking centred on a line at a distance from the axis."""
    backbone, middle, line = _Backbone(tree).backbone, Distance(tree).distance, LineInputs(tree)
    paint, section = LinePaint(tree), Section(tree)
    with tree.frame("Both edges of the line"):
        half_width = line.width * (op.switch(section.left_side, -1.0, 1.0) * 0.5)
        # Left is outwards on the left carriageway and inwards on the right one.
        left_edge = tree.call(height_group(), **section.values, distance=middle + half_width)
        right_edge = tree.call(height_group(), **section.values, distance=middle - half_width)
    with tree.frame("Line"):
        values = {name: value for name, value in line.values.items() if name != "width"}
        mesh = tree.call(
            marking_group(),
            backbone=backbone,
            left_offset=left_edge["Offset"],
            right_offset=right_edge["Offset"],
            left_height=left_edge["Height"],
            right_height=right_edge["Height"],
            **values,
            **paint.values,
        ).value
    tree.output("Mesh", mesh, description="Dashes whose faces look up")


def markings_group(lanes: int, turnouts: bool, lines: tuple[MarkingLayout, ...]) -> bpy.types.NodeTree:
    """Return the node group SR Markings for a carriageway's lanes, turnouts and lines."""
    description = "Line markings of one side, each on its boundary"
    return node_group("SR Markings", _build, lanes, turnouts, lines, description=description)


def declare_line(tree: Tree, line: MarkingLayout, words: str) -> dict[str, Value]:
    """Declare the inputs of a line in a panel of its own; return their values by field."""
    kind = LineOnItsOwn if line.kind == "free" else LineInputs
    defaults = {} if line.kind == "lane" else {"dash_length": 0.0, "gap_length": 0.0}
    return kind(tree, words, words, defaults).values


class LineOnItsOwn(LineInputs, Distance):
    """Inputs of a free line, which follows no boundary, with its distance from the axis."""


def _build(tree: Tree, lanes: int, turnouts: bool, lines: tuple[MarkingLayout, ...]) -> None:
    """Build the node group of one side's lines: a carriageway marking for each line, on its boundary."""
    backbone = _Backbone(tree).backbone
    section = Section(tree)
    text = "Distance of a boundary from the axis, counted from the median"
    strips = strips_of(lanes, turnouts)
    boundaries = inputs_class(
        "Boundaries", {f"boundary_{number}": metres(0.0, _FAR, text) for number in range(len(strips) + 1)}
    )(tree)
    white_material = tree.material("Material", "paint_white", description="Material of the lines")
    yellow_material = tree.material("Yellow Material", "paint_yellow", description="Material of temporary lines")
    station_field = metres(0.0, (-1e6, 1e6), "Station that the backbone's stations count from")
    first_station = inputs_class("Stations", {"first_station": station_field})(tree).values["first_station"]
    inputs = [declare_line(tree, line, line.name) for line in lines]
    # A quarter is added, so that rounding can't change the code's whole part.
    side_code = op.switch(section.left_side, 0.25, 0.25 + CODES)
    parts = []
    with tree.frame("Lines"):
        for line, values in zip(lines, inputs, strict=True):
            boundary = boundaries.values.get(f"boundary_{_boundary(line, lanes, strips)}")
            values |= {"distance": _middle(line, values, boundary)}
            material = yellow_material if line.yellow else white_material
            meshes = [
                tree.call(carriageway_marking_group(), backbone=backbone, **part, material=material).value
                for part in (_halves(tree, section, values) if line.between else [section.values | values])
            ]
            mesh = op.join(*meshes) if len(meshes) > 1 else meshes[0]
            wear = PAINT_CROSSED if line.kind in ("lane", "block") else PAINT_BESIDE
            place = op.vector(
                tree,
                op.named_attribute(tree, "station") + first_station,
                0.0,
                side_code + float(wear + 2 * CODES * line.boundary),
            )
            parts.append(op.store(mesh, "pavement", place))
        mesh = op.join(*parts)
    tree.output("Mesh", mesh, description="Lines whose faces look up")


def _boundary(line: MarkingLayout, lanes: int, strips: list[str]) -> int:
    """Return the index, from the median, of the strip boundary that a line lies on; -1 for a free line."""
    if line.kind == "free":
        return -1
    if line.kind in ("turnout_edge", "gore_edge"):
        return strips.index("Turnout Lane") + (line.kind == "turnout_edge")
    # Boundaries of lanes count from lane 1's outer edge inwards.
    return 1 + lanes - line.boundary


def _halves(tree: Tree, section: Section, values: dict[str, Value]) -> list[dict[str, Value]]:
    """Add nodes for the inputs of both halves of a line between the directions, each in its carriageway's plane."""
    half = values | {"width": values["width"] * 0.5, "distance": values["width"] * 0.25}
    crossfalls = [op.named_attribute(tree, f"crossfall_{side}") for side in ("left", "right")]
    other = section.values | {
        "left_side": ~section.left_side,
        "crossfall": op.switch(section.left_side, *crossfalls),
        "pivot": section.pivot * 0.0,
    }
    return [section.values | half, other | half]


def _middle(line: MarkingLayout, values: dict[str, Value], boundary: Value | None) -> Value:
    """Add nodes for the distance (m) of a line's middle from the axis."""
    if boundary is None:
        return values["distance"]
    share = _OUTWARDS.get(line.kind)
    return boundary + values["width"] * share if share else boundary
