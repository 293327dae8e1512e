"""SR Left Carriageway, SR Right Carriageway: the strips of one side from its widths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import bpy

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.builder import Operand, Tree, Value, node_group
from ...nodes.inputs import INSTANCES
from ...nodes.strip import strip_group
from .carriageway import height_group
from .layout import TURNOUT_NAMES, SideLayout, attribute_name, input_name

_UNPAVED = ("Verge", "Island")
_WIDTHS = {"Inner Edge Strip": 0.5, "Outer Edge Strip": 0.5, "Hard Shoulder": 2.5, "Verge": 1.5}
_LANE = 3.5


def side_group(layout: SideLayout) -> bpy.types.NodeTree:
    """Return the group SR Left Carriageway or SR Right Carriageway for these lanes and turnouts."""
    return node_group(
        f"SR {layout.side} Carriageway",
        _build,
        layout,
        description="Pavement and verge of one side, live from their widths",
    )


def strips_of(layout: SideLayout) -> list[str]:
    """Return the names of a side's strips, from the median outwards."""
    lanes = [f"Lane {i}" for i in range(layout.lanes, 0, -1)]
    turnouts = TURNOUT_NAMES if layout.turnouts else ()
    return ["Inner Edge Strip", *lanes, "Outer Edge Strip", "Hard Shoulder", *turnouts, "Verge"]


def declare_side(tree: Tree, layout: SideLayout) -> dict[str, Value]:
    """Declare the inputs of a side, by their names."""
    values: dict[str, Value] = {}

    def width(strip: str, default: float, largest: float, about: str) -> None:
        name = input_name(layout.side, strip)
        if strip in layout.varying:
            about += "; the backbone says where there is less of it"
        values[name] = tree.number(name, default, (0.0, largest), unit="m", description=about)

    width("Inner Offset", 2.0, 50.0, "Distance of the inner paved edge from the axis")
    for strip in strips_of(layout):
        if strip not in TURNOUT_NAMES:
            counted = "; 1 is the outermost lane" if strip.startswith("Lane") else ""
            width(strip, _WIDTHS.get(strip, _LANE), 6.0, f"Width of the {strip.lower()}{counted}")
    name = f"{layout.side} Verge Slope"
    values[name] = tree.number(name, 0.08, (0.0, 0.15), description="Fall of the verge away from the pavement (m/m)")
    name = f"{layout.side} Turns About Inner Edge"
    about = "The inner edge keeps the axis's height while the crossfall changes, else the middle of the pavement"
    values[name] = tree.boolean(name, False, description=about)
    name = f"{layout.side} Instance"
    values[name] = declare_instance(tree, name)
    name = f"{layout.side} Pavement Material"
    values[name] = tree.input(name, "Material", description="Material of the pavement")
    for strip in layout.detailed:
        name = f"{layout.side} {strip} Detail"
        values[name] = tree.input(name, "Object", description="Grid of the damage of this strip, see SR Strip")
    for turnout in layout.turnouts:
        for end, about in {"Start": "Beginning of the turnout", "End": "End of the turnout"}.items():
            name = f"{turnout} {end} Station"
            values[name] = tree.number(name, 0.0, (-1e6, 1e6), unit="m", description=about)
        values[f"{turnout} Instance"] = declare_instance(tree, f"{turnout} Instance")
    return values


def declare_instance(tree: Tree, name: str) -> Value:
    """Declare an instance number."""
    return tree.integer(name, 0, INSTANCES, description="Instance number of the faces")


@dataclass
class _Side:
    """Inputs by name, and boundaries (innermost first) of one carriageway."""

    tree: Tree
    layout: SideLayout
    inputs: dict[str, Value]
    distances: list[Value] = field(default_factory=list)
    offsets: list[Value] = field(default_factory=list)
    heights: list[Value] = field(default_factory=list)

    def input(self, name: str) -> Value:
        return self.inputs[f"{self.layout.side} {name}"]

    def width(self, strip: str, share: str | None = None) -> Value:
        """Return a strip's width (or the inner offset), a field on the backbone where it changes along the road."""
        if strip in TURNOUT_NAMES:
            return self.attribute(strip)
        width = self.inputs[input_name(self.layout.side, strip)]
        if strip in self.layout.varying:
            width = width * self.attribute(share or strip)
        if strip == "Verge" and self.layout.turnouts:
            width = width + self.attribute("Verge Extra")
        return width

    def attribute(self, name: str) -> Value:
        return op.named_attribute(self.tree, attribute_name(self.layout.side, name))


def _build(tree: Tree, layout: SideLayout) -> None:
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    side = _Side(tree, layout, declare_side(tree, layout))
    verge = tree.input("Verge Material", "Material", description="Material of the verge")
    with tree.frame("Boundaries: distance from the axis, offset and height"):
        plane, pivot = _boundaries(side)
    with tree.frame("Pavement and verge"):
        mesh = op.join(*_surfaces(side, backbone, verge))
    tree.output("Mesh", mesh, description="Pavement and verge; every face has class_id and instance_id")
    for number, distance in enumerate(side.distances):
        about = "Distance of a boundary from the axis, per row; counted from the median (m)"
        tree.output(f"Distance {number}", distance, description=about)
    tree.output("Plane Edge", plane, description="Where the pavement's plane ends, per row (m)")
    tree.output("Pivot", pivot, description="Line that keeps the axis's height, per row (m)")
    tree.output("Inner Height", side.heights[0], description="Inner edge above the axis, per row (m)")
    tree.output("Outer Height", side.heights[-1], description="Outer edge above the axis, per row (m)")


def _boundaries(side: _Side) -> tuple[Value, Value]:
    """Work out the boundaries, innermost first; return where the pavement's plane ends, and what it turns about."""
    distance = inner = main = side.width("Inner Offset")
    side.distances = [distance]
    for strip in strips_of(side.layout):
        distance = distance + side.width(strip)
        side.distances.append(distance)
        if strip != "Verge" and strip not in TURNOUT_NAMES:
            # Beside turnouts, too, the crossfall turns about the middle of the whole main road.
            whole = "Hard Shoulder Main" if strip == "Hard Shoulder" and side.layout.turnouts else None
            main = main + side.width(strip, whole)
    plane = side.distances[-2]
    if side.layout.turnouts:
        plane = plane + side.attribute("Verge Extra")
    pivot = op.switch(side.input("Turns About Inner Edge"), (inner + main) * 0.5, inner)
    section = section_inputs(side.tree, side.layout, plane, pivot, side.input("Verge Slope"))
    for distance in side.distances:
        boundary = side.tree.call(height_group(), distance=distance, **section)
        side.offsets.append(boundary["Offset"])
        side.heights.append(boundary["Height"])
    return plane, pivot


def section_inputs(
    tree: Tree, layout: SideLayout, plane: Value, pivot: Value, verge_slope: Value
) -> dict[str, Operand]:
    """Return the inputs of SR Carriageway Height and SR Carriageway Marking that are the same all over a side."""
    return {
        "side": layout.sign,
        "paved_edge": plane,
        "pivot": pivot,
        "crossfall": op.named_attribute(tree, f"crossfall_{layout.side.lower()}"),
        "verge_slope": verge_slope,
    }


def _surfaces(side: _Side, backbone: Value, verge: Value) -> Iterator[Value]:
    for number, strip in enumerate(strips_of(side.layout)):
        left, right = (number + 1, number) if side.layout.sign > 0 else (number, number + 1)
        detailed = strip in side.layout.detailed
        detail = {"detail": op.object_geometry(side.input(f"{strip} Detail"))} if detailed else {}
        mesh = side.tree.call(
            strip_group(),
            backbone=backbone,
            left_offset=side.offsets[left],
            right_offset=side.offsets[right],
            left_height=side.heights[left],
            right_height=side.heights[right],
            class_=class_id("roadside" if strip in _UNPAVED else "road"),
            instance=_turnout_instance(side) if strip in TURNOUT_NAMES else side.input("Instance"),
            material=verge if strip in _UNPAVED else side.input("Pavement Material"),
            **detail,
        ).value
        if strip == "Verge":
            at_row = op.sample_index(backbone, side.distances[-1], op.named_attribute(side.tree, "row", "INT"))
            mesh = op.store(mesh, "distance", op.unary("ABSOLUTE", op.named_attribute(side.tree, "offset")) - at_row)
        yield mesh


def _turnout_instance(side: _Side) -> Value:
    """Return the instance number of the turnout that a face of the strips beside the main road belongs to."""
    station, result = op.named_attribute(side.tree, "station"), side.input("Instance")
    for name in side.layout.turnouts:
        inside = (station >= side.inputs[f"{name} Start Station"]) & (station <= side.inputs[f"{name} End Station"])
        result = op.switch(inside, result, side.inputs[f"{name} Instance"])
    return result
