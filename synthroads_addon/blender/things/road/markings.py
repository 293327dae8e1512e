"""SR Left Markings, SR Right Markings: the line markings of one side, each on its boundary."""

from __future__ import annotations

import bpy

from ....base.classes import class_id
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, node_group
from .carriageway import carriageway_marking_group
from .layout import MarkingLayout, SideLayout, attribute_name
from .side import declare_instance, section_inputs, strips_of

_OUTWARDS = {"outer_edge": 0.5, "block": 0.5, "turnout_edge": 0.5, "inner_edge": -0.5, "gore_edge": -0.5}
"""Kind of line -> share of its width by which its middle lies outside of its boundary."""
_FAR = (0.0, 1000.0)


def markings_group(layout: SideLayout) -> bpy.types.NodeTree:
    """Return the group SR Left Markings or SR Right Markings for these lines."""
    return node_group(
        f"SR {layout.side} Markings",
        _build,
        layout,
        description="Line markings of one side, each on its boundary",
    )


def declare_marking(tree: Tree, marking: MarkingLayout) -> dict[str, Value]:
    """Declare the inputs of a line, by their names."""
    values: dict[str, Value] = {}

    def metres(name: str, default: float, limits: tuple[float, float], about: str) -> None:
        label = f"{marking.name} {name}"
        values[label] = tree.number(label, default, limits, unit="m", description=about)

    if marking.kind == "free":
        metres("Distance", 0.0, (0.0, 50.0), "Distance of the line's middle from the axis")
    metres("Width", 0.15, (0.05, 1.0), "Width of the line")
    metres("Dash", 0.0, (0.0, 100.0), "Length of a dash; 0 if solid")
    metres("Gap", 0.0, (0.0, 100.0), "Length of a gap")
    metres("Start Station", 0.0, (0.0, 1e6), "Beginning")
    metres("End Station", 1e6, (0.0, 1e6), "End of the line")
    metres("Film Thickness", 0.003, (0.0005, 0.006), "Height above the pavement")
    values[f"{marking.name} Instance"] = declare_instance(tree, f"{marking.name} Instance")
    return values


def _build(tree: Tree, layout: SideLayout) -> None:
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    about = "Distance of a boundary from the axis, counted from the median"
    distances = [
        tree.number(f"Distance {i}", 0.0, _FAR, unit="m", description=about) for i in range(len(strips_of(layout)) + 1)
    ]
    plane = tree.number("Plane Edge", 14.0, _FAR, unit="m", description="Where the pavement's plane ends")
    pivot = tree.number("Pivot", 8.0, _FAR, unit="m", description="Line that keeps the axis's height")
    slope = tree.number("Verge Slope", 0.08, (0.0, 0.15), description="Fall of the verge outwards (m/m)")
    white = tree.input("Material", "Material", description="Material of the lines")
    yellow = tree.input("Yellow Material", "Material", description="Material of temporary lines")
    inputs = {marking.name: declare_marking(tree, marking) for marking in layout.markings}
    lines = []
    with tree.frame("Lines"):
        section = section_inputs(tree, layout, plane, pivot, slope)
        for marking in layout.markings:
            values = {name.removeprefix(f"{marking.name} "): value for name, value in inputs[marking.name].items()}
            values["Distance"] = _middle(tree, layout, marking, distances, values)
            lines.append(tree.call(
                carriageway_marking_group(),
                backbone=backbone,
                **section,
                **{name.lower().replace(" ", "_"): value for name, value in values.items()},
                class_=class_id("road_marking"),
                material=yellow if marking.yellow else white,
            ).value)  # fmt: skip
        mesh = op.join(*lines)
    tree.output("Mesh", mesh, description="Lines whose faces look up")


def _middle(
    tree: Tree, layout: SideLayout, marking: MarkingLayout, distances: list[Value], values: dict[str, Value]
) -> Value:
    """Return the distance of a line's middle from the axis."""
    if marking.kind == "free":
        middle = values["Distance"]
        return middle * op.named_attribute(tree, attribute_name("marking", marking.name)) if marking.varies else middle
    if marking.kind in ("turnout_edge", "gore_edge"):
        boundary = strips_of(layout).index("Turnout Lane") + (marking.kind == "turnout_edge")
    else:
        # Boundaries count from lane 1's outer edge inwards, distances from the inner paved edge outwards.
        boundary = 1 + layout.lanes - marking.boundary
    outwards = _OUTWARDS.get(marking.kind)
    return distances[boundary] + values["Width"] * outwards if outwards else distances[boundary]
