"""SR Road: verges, pavement, median and markings, live from widths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import bpy

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.axis import AxisInputs
from ...nodes.backbone import row
from ...nodes.builder import Node, Tree, Value, node_group, offer_group
from ...nodes.inputs import Input, Inputs, input_name, inputs_class, instance_number, material_of, metres, socket
from ...nodes.solids import row_of_points
from ...nodes.strip import strip_group
from .carriageway import SideInputs, age_fields, carriageway_group, width_fields
from .layout import (
    STREET_NAMES,
    TURNOUT_NAMES,
    MarkingLayout,
    SideLayout,
    attribute_name,
    detail_field,
    strips_of,
    width_field,
)
from .markings import declare_line, markings_group
from .section import RAMP_FIELDS
from .streets import street_fields

OPEN = 0.99
"""Share from which a face lies between two rows that both are of an opening."""
MARKINGS = "Markings"
"""Heading of the inputs of all lines."""


@dataclass
class _Side:
    """One carriageway in the road's node group.

    Attributes:
        layout: its layout.
        widths: inputs of the strips' widths.
        inputs: other inputs of the carriageway.
        ages: inputs of the strips' brightness by age.
        details: inputs of details and turnouts.
        lines: inputs of each line, by field.
        surface: the carriageway's node, once it is added.
    """

    layout: SideLayout
    widths: Inputs
    inputs: SideInputs
    ages: Inputs
    details: Inputs
    lines: list[dict[str, Value]]
    surface: Node | None = None

    def output(self, name: str) -> Value:
        """Return the surface node's output of a name."""
        assert self.surface is not None
        return self.surface[name]

    def attribute(self, name: str) -> Value:
        """Add a node for this side's backbone attribute of a strip or line, a field."""
        return op.named_attribute(self.inputs.tree, attribute_name(self.layout.side, name))

    def width(self, strip: str) -> Value:
        """Return the value of a strip's width or the inner offset (m), a field on the backbone where it varies."""
        if strip in (*TURNOUT_NAMES, *STREET_NAMES):
            return self.attribute(strip)
        width = self.widths.values[width_field(strip)]
        return width * self.attribute(strip) if strip in self.layout.varying else width


class _Caps(Inputs):
    bridge_caps = socket("Object", "Caps of bridges, whose tops are the road's surface there")


class _RoadMaterials(Inputs):
    marking_material = material_of("the lines", "paint_white")
    yellow_marking_material = material_of("temporary lines", "paint_yellow")
    verge_material = material_of("the verges", "verge")
    median_material = material_of("the median", "median")


def road_group(layout: tuple[SideLayout, ...]) -> bpy.types.NodeTree:
    """Return the node group SR Road for a layout of lanes, turnouts and markings."""
    return node_group(
        "SR Road",
        _build,
        layout,
        description="The road's surface, live from its widths",
    )


def _build(tree: Tree, layout: tuple[SideLayout, ...]) -> None:
    """Build the node group of the road: inputs of both sides, their surfaces, the median, markings, outermost edges."""
    road = AxisInputs(tree)
    sides = [_declare_side(tree, side) for side in layout]
    median = None
    if len(sides) == 2:
        with tree.panel("Median"):
            median = inputs_class("Median", {"instance": instance_number()})(tree, "Median").values["instance"]
    caps = _Caps(tree) if any(side.layout.caps for side in sides) else None
    with tree.panel(MARKINGS):
        for side in sides:
            words = side.layout.side
            side.lines = [declare_line(tree, line, f"{words} {line.name}") for line in side.layout.markings]
    with tree.panel("Materials"):
        materials = _RoadMaterials(tree)
    with tree.frame("Backbone"):
        backbone = road.axis()
    parts: list[Value] = []
    for side in sides:
        with tree.frame(f"{side.layout.side} verge and pavement"):
            side.surface = _surface(tree, side, backbone, materials.verge_material)
    if median is not None:
        with tree.frame("Median: straight from one inner edge to the other"):
            surface = _median(tree, backbone, sides, median, materials.median_material)
            parts.append(_open_median(tree, backbone, surface) if caps else surface)
    if caps is not None:
        with tree.frame("Caps of bridges in place of verges and median"):
            parts.append(_caps(tree, caps))
    for side in sides:
        parts.append(_open_verge(tree, backbone, side) if side.layout.openings else side.output("Mesh"))
        if side.layout.markings:
            with tree.frame(f"{side.layout.side} markings"):
                parts.append(_markings(tree, backbone, side, materials))
    with tree.frame("Outermost edges, where the terrain begins"):
        parts += _edges(tree, backbone, sides)
        mesh = op.join(*parts)
    tree.output("Mesh", mesh, description="The road; every face has class_id and instance_id")


def _declare_side(tree: Tree, layout: SideLayout) -> _Side:
    """Declare the inputs of a carriageway in a panel; return it as a side without its surface's node."""
    words = layout.side
    text = "Points that make this strip finer, see SR Strip"
    detail_fields = {detail_field(strip): socket("Object", text) for strip in layout.detailed}
    for turnout in layout.turnouts:
        detail_fields |= turnout_fields(turnout)
    for street in layout.streets:
        detail_fields |= street_fields(street)
    with tree.panel(f"{words} Carriageway"):
        return _Side(
            layout,
            inputs_class("Widths", width_fields(layout.lanes, varying=layout.varying))(tree, words),
            SideInputs(tree, words),
            inputs_class("Ages", age_fields(layout.lanes))(tree, words),
            inputs_class("Further", detail_fields)(tree, words),
            [],
        )


def turnout_fields(turnout: str) -> dict[str, Input]:
    """Return the input fields of a turnout by name: start station, end station, instance number."""
    field = turnout.lower().replace(" ", "_")
    return {
        f"{field}_start_station": metres(0.0, (-1e6, 1e6), "Beginning of the turnout"),
        f"{field}_end_station": metres(0.0, (-1e6, 1e6), "End of the turnout"),
        f"{field}_instance": instance_number(),
    }


def turnout_instance_field(turnout: str) -> str:
    """Return the input field of a turnout's instance number."""
    return f"{turnout.lower().replace(' ', '_')}_instance"


def _surface(tree: Tree, side: _Side, backbone: Value, verge: Value) -> Node:
    """Add the carriageway node of a side to the tree; return it."""
    layout = side.layout
    turnouts = bool(layout.turnouts)
    strips = ["Inner Offset", *strips_of(layout.lanes, turnouts, bool(layout.streets))]
    values = {width_field(strip): side.width(strip) for strip in strips}
    for strip in layout.detailed:
        field = detail_field(strip)
        values[field] = op.object_geometry(side.details.values[field])
    if turnouts:
        shoulder_width = side.widths.values[width_field("Hard Shoulder")] * side.attribute("Hard Shoulder Main")
        values |= {"whole_hard_shoulder_width": shoulder_width, "verge_extra_width": side.attribute("Verge Extra")}
        values["turnout_instance"] = _turnout_instance(side)
        values |= _ramps(side)
    if layout.streets:
        values |= _streets(side)
    return tree.call(
        carriageway_group(layout.lanes, turnouts, len(layout.streets)),
        backbone=backbone,
        left_side=layout.left,
        crossfall=op.named_attribute(tree, f"crossfall_{layout.side.lower()}"),
        **values,
        **side.inputs.values,
        **side.ages.values,
        verge_material=verge,
    )


def _ramps(side: _Side) -> dict[str, Value]:
    """Add nodes for the inputs of ramps that leave the pavement's plane, by input field."""
    return {field: side.attribute(field) for field in RAMP_FIELDS}


def _streets(side: _Side) -> dict[str, Value]:
    """Add nodes for the inputs of street sides: lifts and the verge's change by station, and those of each."""
    values = {f"{width_field(strip)[:-6]}_lift": side.attribute(f"{strip} Lift") for strip in STREET_NAMES[1:]}
    values["verge_extra_width"] = side.attribute("Verge Extra")
    for number, street in enumerate(side.layout.streets, 1):
        inputs = zip(street_fields(f"Side {number}"), street_fields(street), strict=True)
        values |= {field: side.details.values[of_road] for field, of_road in inputs}
    return values


def _turnout_instance(side: _Side) -> Value:
    """Add nodes for the instance number, by station, of the turnout that a face beside the main road belongs to."""
    station, result = op.named_attribute(side.inputs.tree, "station"), side.inputs.instance
    for turnout in side.layout.turnouts:
        start, end, instance = (side.details.values[field] for field in turnout_fields(turnout))
        result = op.switch((station >= start) & (station <= end), result, instance)
    return result


def _markings(tree: Tree, backbone: Value, side: _Side, materials: _RoadMaterials) -> Value:
    """Add nodes for the line markings of a side."""
    layout = side.layout
    turnouts = bool(layout.turnouts)
    names = [f"Boundary {number}" for number in range(len(strips_of(layout.lanes, turnouts)) + 1)]
    # Beyond the pavement of a side with street sides there are more boundaries, which no line lies on.
    values = {name: side.output(name) for name in (*names, "Paved Edge", "Pivot")}
    for line, inputs in zip(layout.markings, side.lines, strict=True):
        values |= {input_name(field, line.name): value for field, value in inputs.items()}
        if line.varies:
            name = input_name("distance", line.name)
            values[name] = values[name] * side.attribute(line.name)
    return tree.call(
        markings_group(layout.lanes, turnouts, layout.markings),
        backbone=backbone,
        left_side=layout.left,
        crossfall=op.named_attribute(tree, f"crossfall_{layout.side.lower()}"),
        verge_slope=side.inputs.verge_slope,
        first_station=side.inputs.first_station,
        **(_ramps(side) if turnouts else {}),
        material=materials.marking_material,
        yellow_material=materials.yellow_marking_material,
        **{name.lower().replace(" ", "_"): value for name, value in values.items()},
    ).value


def _open_verge(tree: Tree, backbone: Value, side: _Side) -> Value:
    """Add nodes that delete the verge of a side where side roads join; return the side's surface."""
    with tree.frame(f"{side.layout.side} verge, open where side roads join"):
        name = f"opening_{side.layout.side.lower()}"
        row_number = op.named_attribute(tree, "row", "INT")
        mesh = op.store(
            side.output("Mesh"), "opening", op.sample_index(backbone, op.named_attribute(tree, name), row_number)
        )
        name = f"step_{side.layout.side.lower()}"
        mesh = op.store(mesh, "step", op.sample_index(backbone, op.named_attribute(tree, name), row_number))
        is_verge = op.named_attribute(tree, "class_id", "INT").equals(class_id("roadside"))
        opening = op.named_attribute(tree, "opening")
        closed = is_verge & (opening > OPEN)
        step = op.named_attribute(tree, "step")
        number = op.named_attribute(tree, "instance_id", "INT")
        # Where a ramp goes on as a road of its own the few centimetres of its step are that road's.
        for turnout in side.layout.turnouts:
            instance = side.details.values[turnout_instance_field(turnout)]
            closed = closed | (number.equals(instance) & (step > OPEN))
        return op.delete_faces(mesh, closed)


def _open_median(tree: Tree, backbone: Value, surface: Value) -> Value:
    """Add nodes that delete the median where bridges have a cap in its place; return what is left."""
    row_number = op.named_attribute(tree, "row", "INT")
    opening = op.sample_index(backbone, op.named_attribute(tree, "opening_median"), row_number)
    return op.delete_faces(op.store(surface, "opening", opening), op.named_attribute(tree, "opening") > OPEN)


def _caps(tree: Tree, caps: _Caps) -> Value:
    """Add nodes for the caps of bridges, whose faces carry their bridge's number."""
    instance = op.named_attribute(tree, "cap_instance", "INT")
    return op.label(op.object_geometry(caps.bridge_caps), class_id("bridge"), instance)


def _median(tree: Tree, backbone: Value, sides: list[_Side], instance: Value, material: Value) -> Value:
    """Add nodes for the median: a strip between both carriageways' inner edges."""
    left_side, right_side = sides
    return tree.call(
        strip_group(),
        backbone=backbone,
        left_offset=left_side.output("Inner Edge Offset"),
        left_height=left_side.output("Inner Edge Height"),
        right_offset=right_side.output("Inner Edge Offset"),
        right_height=right_side.output("Inner Edge Height"),
        class_=class_id("roadside"),
        instance=instance,
        material=material,
    ).value


def _edges(tree: Tree, backbone: Value, sides: list[_Side]) -> Iterator[Value]:
    """Add nodes for the leftmost and the rightmost edge; yield each as points with ``edge`` = +1 or -1."""
    for sign in (1.0, -1.0):
        side = sides[0] if sign > 0 else sides[-1]
        edge_name = "Outer" if side.layout.left == (sign > 0) else "Inner"
        points = row_of_points(tree, op.point_count(backbone))
        row_number = op.index(tree)
        axis, left_vector, _ = row(backbone, row_number)
        offset = op.sample_index(backbone, side.output(f"{edge_name} Edge Offset"), row_number)
        height = op.sample_index(backbone, side.output(f"{edge_name} Edge Height"), row_number)
        place = axis + left_vector * offset + op.vector(tree, 0.0, 0.0, height)
        points = op.store(op.set_position(points, place), "edge", sign)
        # A mesh line has edges: only its points are kept.
        yield tree.node("GeometryNodeDeleteGeometry", points, domain="EDGE", mode="EDGE_FACE").value


_LINES = (
    MarkingLayout("Outer Edge Line", "outer_edge"),
    MarkingLayout("Lane Line", "lane", 1),
    MarkingLayout("Inner Edge Line", "inner_edge", 2),
)
BY_HAND = (SideLayout("Left", 2, _LINES), SideLayout("Right", 2, _LINES))
"""The road that users find in the asset library."""

offer_group("Road", "SR Road", partial(road_group, BY_HAND))
