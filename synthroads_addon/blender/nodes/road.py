"""SR Road: verges, pavement, median and markings, live from widths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import bpy

from ...core.cloud.labels import class_id
from ...core.parameters.model import Carriageway, LineMarking, Median, RoadParameters
from . import operations as op
from .backbone import row
from .builder import Operand, Tree, Value, node_group
from .carriageway import carriageway_marking_group, height_group
from .strip import INSTANCES, strip_group

MATERIALS = {"Pavement": "asphalt", "Marking": "paint_white", "Verge": "verge", "Median": "median"}
"""Material inputs of the group (their names go on with "Material"), and what the model puts there."""

_SHIFT = {"outer_edge": 0.5, "lane": 0.0, "inner_edge": -0.5}


@dataclass(frozen=True)
class SideLayout:
    """What the nodes of one carriageway depend on: lanes, and markings as (id, kind, boundary)."""

    side: str
    lanes: int
    markings: tuple[tuple[str, str, int], ...]

    @property
    def sign(self) -> float:
        """Return the sign of the side's offsets."""
        return 1.0 if self.side == "Left" else -1.0


@dataclass
class Side:
    """Inputs and boundaries (innermost first) of one carriageway."""

    layout: SideLayout
    numbers: dict[str, Value] = field(default_factory=dict)
    instance: Value | None = None
    at_inner_edge: Value | None = None
    markings: dict[str, dict[str, Value]] = field(default_factory=dict)
    strips: list[str] = field(default_factory=list)
    distances: list[Value] = field(default_factory=list)
    offsets: list[Value] = field(default_factory=list)
    heights: list[Value] = field(default_factory=list)
    section: dict[str, Operand] = field(default_factory=dict)


def road_layout(parameters: RoadParameters) -> tuple[SideLayout, ...]:
    """Return what the group's nodes depend on, left side first."""
    sides = []
    for name, carriageway in sorted(parameters.of_type(Carriageway).items(), key=lambda item: -item[1].sign):
        lines = parameters.of_type(LineMarking).items()
        markings = tuple((key, line.kind, line.boundary) for key, line in lines if line.carriageway == name)
        sides.append(SideLayout(carriageway.side.title(), len(carriageway.lanes), markings))
    return tuple(sides)


def road_inputs(parameters: RoadParameters) -> dict[str, float | int | bool]:
    """Return the values of the group's inputs, without objects and materials."""
    inputs: dict[str, float | int | bool] = {}
    for carriageway in parameters.of_type(Carriageway).values():
        side = carriageway.side.title()
        inputs[f"{side} Inner Offset"] = carriageway.inner_offset
        inputs[f"{side} Inner Edge Strip Width"] = carriageway.inner_edge_strip_width
        for number, lane in enumerate(carriageway.lanes, 1):
            inputs[f"{side} Lane {number} Width"] = lane.width
        inputs[f"{side} Outer Edge Strip Width"] = carriageway.outer_edge_strip_width
        inputs[f"{side} Hard Shoulder Width"] = carriageway.hard_shoulder_width
        inputs[f"{side} Verge Width"] = carriageway.verge_width
        inputs[f"{side} Verge Slope"] = carriageway.verge_slope_percent / 100.0
        inputs[f"{side} Turns About Inner Edge"] = carriageway.rotation_axis == "inner_edge"
        inputs[f"{side} Instance"] = carriageway.instance
    for median in parameters.of_type(Median).values():
        if len(road_layout(parameters)) == 2:
            inputs["Median Instance"] = median.instance
    for name, line in parameters.of_type(LineMarking).items():
        inputs[f"{name} Width"] = line.width
        inputs[f"{name} Dash"] = line.dash_length
        inputs[f"{name} Gap"] = line.gap_length
        inputs[f"{name} Start Station"] = line.start_station
        inputs[f"{name} End Station"] = line.end_station
        inputs[f"{name} Film Thickness"] = line.film_thickness
        inputs[f"{name} Instance"] = line.instance
    return inputs


def road_group(layout: tuple[SideLayout, ...]) -> bpy.types.NodeTree:
    """Return the group SR Road for these lanes and markings."""
    return node_group(
        "SR Road",
        lambda tree: _build(tree, layout),
        layout,
        description="The road's surface, live from its widths",
    )


def _build(tree: Tree, layout: tuple[SideLayout, ...]) -> None:
    item = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    sides = []
    for side_layout in layout:
        with tree.panel(f"{side_layout.side} Carriageway"):
            sides.append(_declare_side(tree, side_layout))
    median_instance = None
    if len(sides) == 2:
        with tree.panel("Median"):
            median_instance = _instance(tree, "Median")
    for side in sides:
        for name, _, _ in side.layout.markings:
            with tree.panel(f"Marking {name}"):
                side.markings[name] = _declare_marking(tree, name)
    with tree.panel("Materials"):
        materials = {
            name: tree.input(f"{name} Material", "Material", description=f"Material of the {name.lower()}")
            for name in MATERIALS
        }
    with tree.frame("Backbone"):
        backbone = op.object_geometry(item)
    for side in sides:
        with tree.frame(f"{side.layout.side} boundaries: distance, offset and height"):
            _boundaries(tree, side)
    parts: list[Value] = []
    if median_instance is not None:
        with tree.frame("Median: straight from one inner edge to the other"):
            parts.append(_median(tree, backbone, sides, median_instance, materials["Median"]))
    for side in sides:
        with tree.frame(f"{side.layout.side} verge and pavement"):
            parts += _surfaces(tree, backbone, side, materials)
        with tree.frame(f"{side.layout.side} markings"):
            parts += _markings(tree, backbone, side, materials["Marking"])
    with tree.frame("Outermost edges, where the terrain begins"):
        parts += _edges(tree, backbone, sides)
    tree.output("Mesh", op.join(*parts), description="The road; every face has class_id and instance_id")


def _instance(tree: Tree, name: str) -> Value:
    return tree.integer(f"{name} Instance", 0, INSTANCES, description="Instance number of the faces")


def _declare_side(tree: Tree, layout: SideLayout) -> Side:
    side = Side(layout)
    names = ["Inner Edge Strip", *(f"Lane {i}" for i in range(layout.lanes, 0, -1))]
    side.strips = [*names, "Outer Edge Strip", "Hard Shoulder", "Verge"]
    defaults = {"Inner Edge Strip": 0.5, "Outer Edge Strip": 0.5, "Hard Shoulder": 2.5, "Verge": 1.5}

    def width(name: str, default: float, largest: float, description: str) -> None:
        label = f"{layout.side} {name}"
        side.numbers[name] = tree.number(label, default, (0.0, largest), unit="m", description=description)

    width("Inner Offset", 2.0, 50.0, "Distance of the inner paved edge from the axis")
    for name in side.strips:
        counted = "; 1 is the outermost lane" if name.startswith("Lane") else ""
        width(f"{name} Width", defaults.get(name, 3.5), 6.0, f"Width of the {name.lower()}{counted}")
    slope = "Fall of the verge away from the pavement (m/m)"
    side.numbers["slope"] = tree.number(f"{layout.side} Verge Slope", 0.08, (0.0, 0.15), description=slope)
    about = (
        "The inner edge keeps the axis's height while the crossfall changes, else the middle of the pavement"
    )
    side.at_inner_edge = tree.boolean(f"{layout.side} Turns About Inner Edge", False, description=about)
    side.instance = _instance(tree, layout.side)
    return side


def _declare_marking(tree: Tree, name: str) -> dict[str, Value]:
    return {
        "width": tree.number(f"{name} Width", 0.15, (0.05, 1.0), unit="m", description="Width of the line"),
        "dash": tree.number(
            f"{name} Dash", 0.0, (0.0, 100.0), unit="m", description="Length of a dash; 0 if solid"
        ),
        "gap": tree.number(f"{name} Gap", 0.0, (0.0, 100.0), unit="m", description="Length of a gap"),
        "start_station": tree.number(
            f"{name} Start Station", 0.0, (0.0, 1e6), unit="m", description="Beginning"
        ),
        "end_station": tree.number(
            f"{name} End Station", 1e6, (0.0, 1e6), unit="m", description="End of the line"
        ),
        "film_thickness": tree.number(
            f"{name} Film Thickness",
            0.003,
            (0.0005, 0.006),
            unit="m",
            description="Height above the pavement",
        ),
        "instance": _instance(tree, name),
    }


def _boundaries(tree: Tree, side: Side) -> None:
    """Work out the boundaries, innermost first: distance from the axis, offset, and height above the axis."""
    assert side.at_inner_edge is not None
    distance = side.numbers["Inner Offset"]
    side.distances = [distance]
    for name in side.strips:
        distance = distance + side.numbers[f"{name} Width"]
        side.distances.append(distance)
    inner, paved = side.distances[0], side.distances[-2]
    side.section = {
        "side": side.layout.sign,
        "paved_edge": paved,
        "pivot": op.switch(side.at_inner_edge, (inner + paved) * 0.5, inner),
        "crossfall": op.named(tree, f"crossfall_{side.layout.side.lower()}"),
        "verge_slope": side.numbers["slope"],
    }
    for distance in side.distances:
        boundary = tree.call(height_group(), distance=distance, **side.section)
        side.offsets.append(boundary["Offset"])
        side.heights.append(boundary["Height"])


def _surfaces(tree: Tree, backbone: Value, side: Side, materials: dict[str, Value]) -> Iterator[Value]:
    assert side.instance is not None
    for number, name in enumerate(side.strips):
        verge = name == "Verge"
        left, right = (number + 1, number) if side.layout.sign > 0 else (number, number + 1)
        mesh = tree.call(
            strip_group(),
            backbone=backbone,
            left_offset=side.offsets[left],
            right_offset=side.offsets[right],
            left_height=side.heights[left],
            right_height=side.heights[right],
            class_=class_id("roadside" if verge else "road"),
            instance=side.instance,
            material=materials["Verge" if verge else "Pavement"],
        ).value
        if verge:
            beside = op.unary("ABSOLUTE", op.named(tree, "offset")) - side.distances[-1]
            mesh = op.store(mesh, "distance", beside)
        yield mesh


def _median(tree: Tree, backbone: Value, sides: list[Side], instance: Value, material: Value) -> Value:
    left, right = sides
    return tree.call(
        strip_group(),
        backbone=backbone,
        left_offset=left.offsets[0],
        left_height=left.heights[0],
        right_offset=right.offsets[0],
        right_height=right.heights[0],
        class_=class_id("roadside"),
        instance=instance,
        material=material,
    ).value


def _markings(tree: Tree, backbone: Value, side: Side, material: Value) -> Iterator[Value]:
    lanes = side.layout.lanes
    for name, kind, boundary in side.layout.markings:
        # Boundaries count from lane 1's outer edge inwards, distances from the inner paved edge outwards.
        middle = side.distances[1 + lanes - boundary]
        if _SHIFT[kind]:
            middle = middle + side.markings[name]["width"] * _SHIFT[kind]
        yield tree.call(
            carriageway_marking_group(),
            backbone=backbone,
            distance=middle,
            **side.section,
            **side.markings[name],
            class_=class_id("road_marking"),
            material=material,
        ).value


def _edges(tree: Tree, backbone: Value, sides: list[Side]) -> Iterator[Value]:
    """Return the left-most and the right-most edge as points with the attribute ``edge`` = +1 and -1."""
    for sign in (1.0, -1.0):
        side = sides[0] if sign > 0 else sides[-1]
        at = -1 if side.layout.sign == sign else 0
        points = tree.node("GeometryNodeMeshLine", count=op.point_count(backbone)).value
        number = op.index(tree)
        axis, left, _ = row(backbone, number)
        height = op.sample_index(backbone, side.heights[at], number)
        place = axis + left * side.offsets[at] + op.vector(tree, 0.0, 0.0, height)
        points = op.store(op.set_position(points, place), "edge", sign)
        # A mesh line has edges; only its points are wanted.
        yield tree.node("GeometryNodeDeleteGeometry", points, domain="EDGE", mode="EDGE_FACE").value
