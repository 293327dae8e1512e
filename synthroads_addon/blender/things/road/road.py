"""SR Road: verges, pavement, median and markings, live from widths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.backbone import row
from ...nodes.builder import Node, Tree, Value, node_group
from ...nodes.solids import row_of_points
from ...nodes.strip import strip_group
from .layout import SideLayout
from .markings import declare_marking, markings_group
from .side import declare_instance, declare_side, side_group, strips_of


@dataclass
class _SideInputs:
    """One side's inputs by name, and the node of its surface."""

    layout: SideLayout
    inputs: dict[str, Value]
    markings: dict[str, Value]
    surface: Node | None = None

    def edge(self, outer: bool) -> tuple[Value, Value]:
        """Return offset and height of the inner or outer edge, fields on the backbone."""
        assert self.surface is not None
        last = len(strips_of(self.layout))
        distance = self.surface[f"Distance {last if outer else 0}"]
        return distance * self.layout.sign, self.surface["Outer Height" if outer else "Inner Height"]


def road_group(layout: tuple[SideLayout, ...]) -> bpy.types.NodeTree:
    """Return the group SR Road for these lanes, turnouts and markings."""
    return node_group(
        "SR Road",
        _build,
        layout,
        description="The road's surface, live from its widths",
    )


def _build(tree: Tree, layout: tuple[SideLayout, ...]) -> None:
    item = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    sides, median = _declare(tree, layout)
    with tree.panel("Materials"):
        names = ("Marking", "Yellow Marking", "Verge", "Median")
        materials = {
            name: tree.input(f"{name} Material", "Material", description=f"Material of the {name.lower()}")
            for name in names
        }
    with tree.frame("Backbone"):
        backbone = op.object_geometry(item)
    parts: list[Value] = []
    for side in sides:
        with tree.frame(f"{side.layout.side} verge and pavement"):
            inputs = {**side.inputs, "Backbone": backbone, "Verge Material": materials["Verge"]}
            side.surface = tree.call(side_group(side.layout), **_snake(inputs))
    if median is not None:
        with tree.frame("Median: straight from one inner edge to the other"):
            parts.append(_median(tree, backbone, sides, median, materials["Median"]))
    for side in sides:
        assert side.surface is not None
        parts.append(side.surface["Mesh"])
        if side.layout.markings:
            with tree.frame(f"{side.layout.side} markings"):
                parts.append(_markings(tree, backbone, side, materials))
    with tree.frame("Outermost edges, where the terrain begins"):
        parts += _edges(tree, backbone, sides)
        mesh = op.join(*parts)
    tree.output("Mesh", mesh, description="The road; every face has class_id and instance_id")


def _declare(tree: Tree, layout: tuple[SideLayout, ...]) -> tuple[list[_SideInputs], Value | None]:
    sides = []
    for side_layout in layout:
        with tree.panel(f"{side_layout.side} Carriageway"):
            sides.append(_SideInputs(side_layout, declare_side(tree, side_layout), {}))
    median = None
    if len(sides) == 2:
        with tree.panel("Median"):
            median = declare_instance(tree, "Median Instance")
    for side in sides:
        for marking in side.layout.markings:
            with tree.panel(f"Marking {marking.name}"):
                side.markings |= declare_marking(tree, marking)
    return sides, median


def _markings(tree: Tree, backbone: Value, side: _SideInputs, materials: dict[str, Value]) -> Value:
    assert side.surface is not None
    across = [f"Distance {i}" for i in range(len(strips_of(side.layout)) + 1)]
    values = {name: side.surface[name] for name in (*across, "Plane Edge", "Pivot")}
    values |= {"Backbone": backbone, "Verge Slope": side.inputs[f"{side.layout.side} Verge Slope"]}
    values |= {"Material": materials["Marking"], "Yellow Material": materials["Yellow Marking"]}
    return tree.call(markings_group(side.layout), **_snake(values | side.markings)).value


def _median(tree: Tree, backbone: Value, sides: list[_SideInputs], instance: Value, material: Value) -> Value:
    (left_offset, left_height), (right_offset, right_height) = (side.edge(outer=False) for side in sides)
    return tree.call(
        strip_group(),
        backbone=backbone,
        left_offset=left_offset,
        left_height=left_height,
        right_offset=right_offset,
        right_height=right_height,
        class_=class_id("roadside"),
        instance=instance,
        material=material,
    ).value


def _edges(tree: Tree, backbone: Value, sides: list[_SideInputs]) -> Iterator[Value]:
    """Return the left-most and the right-most edge as points with the attribute ``edge`` = +1 and -1."""
    for sign in (1.0, -1.0):
        side = sides[0] if sign > 0 else sides[-1]
        offset, height = side.edge(outer=side.layout.sign == sign)
        points = row_of_points(tree, op.point_count(backbone))
        number = op.index(tree)
        axis, left, _ = row(backbone, number)
        offset, height = (op.sample_index(backbone, value, number) for value in (offset, height))
        place = axis + left * offset + op.vector(tree, 0.0, 0.0, height)
        points = op.store(op.set_position(points, place), "edge", sign)
        # A mesh line has edges; only its points are wanted.
        yield tree.node("GeometryNodeDeleteGeometry", points, domain="EDGE", mode="EDGE_FACE").value


def _snake(values: dict[str, Value]) -> dict[str, Value]:
    return {name.lower().replace(" ", "_"): value for name, value in values.items()}
