"""Concrete barriers of step or New Jersey profile, ramped down at their ends (SR Concrete Barrier)."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...base.classes import class_id
from ...road.parameters import ConcreteBarrier
from ...road.things.body_shapes import CONCRETE_FLANKS, CONCRETE_TIP
from ..materials import material
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import foot_at
from ..nodes.solids import loft, row_of_points
from ..nodes.strip import INSTANCES
from .model_builder import ModelBuilder

BURIED = 0.1
"""Depth of the foot below the surface, m."""


def _outline(profile: str) -> list[tuple[float, float, float]]:
    """Return a profile, clockwise as seen along the road: x to the left, y 0, z; the two buried points have z = -1."""
    left = [(1.0, -1.0), *CONCRETE_FLANKS[profile]]
    return [(x, 0.0, z) for x, z in left] + [(-x, 0.0, z) for x, z in reversed(left)]


@dataclass(frozen=True)
class _Barrier:
    first: Value
    last: Value
    offset: Value
    new_jersey: Value
    height: Value
    width: Value
    terminal: Value
    step: Value


def _declare(tree: Tree) -> _Barrier:
    def metres(name: str, default: float, limits: tuple[float, float], description: str) -> Value:
        return tree.number(name, default, limits, unit="m", description=description)

    return _Barrier(
        first=metres("Start Station", 0.0, (0.0, 1e6), "Beginning, terminal included"),
        last=metres("End Station", 100.0, (0.0, 1e6), "End, terminal included"),
        offset=metres("Offset", 0.0, (-100.0, 100.0), "Offset of its axis"),
        new_jersey=tree.boolean("New Jersey", False, description="New Jersey profile, else the step profile"),
        height=metres("Height", 0.9, (0.4, 2.0), "Top above the surface"),
        width=metres("Base Width", 0.54, (0.3, 1.2), "Width of its foot"),
        terminal=metres("Terminal Length", 8.0, (0.0, 50.0), "Length of the ramp at each end"),
        step=metres("Step", 2.0, (0.1, 8.0), "Largest length of a straight piece"),
    )


@makes_group("SR Concrete Barrier")
def concrete_barrier_group(tree: Tree) -> None:
    """A concrete barrier along the road, symmetric about its axis, with ramped ends."""
    backbone = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    road = tree.input("Road", "Object", description="Surface that the barrier stands on")
    terrain = tree.input("Terrain", "Object", description="Surface beside the road")
    barrier = _declare(tree)
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")
    concrete = tree.input("Material", "Material", description="Material of the barrier")

    with tree.frame("Geometry"):
        axis = op.object_geometry(backbone)
        surfaces = op.object_geometry(road), op.object_geometry(terrain)
    with tree.frame("Rows on the backbone, two of them where the ramps end"):
        begin = op.maximum(barrier.first, first_station(axis))
        end = op.minimum(barrier.last, last_station(axis))
        ramp = op.minimum(barrier.terminal, (barrier.last - barrier.first) * 0.5)
        line = _rows(tree, barrier, begin, end, ramp)
    with tree.frame("Foot and top"):
        station = op.named_attribute(tree, "station")
        foot, left = foot_at(axis, surfaces, station, barrier.offset)
        line = op.store(op.store(line, "left", left), "foot", foot)
        inside = op.minimum(station - barrier.first, barrier.last - station)
        share = op.switch(ramp > 1e-3, 1.0, op.minimum(inside / op.maximum(ramp, 1e-3), 1.0))
        line = op.store(line, "tall", op.maximum(barrier.height * share, CONCRETE_TIP))
    with tree.frame("Profile swept along the rows"):
        mesh = op.without_degenerate(_swept(tree, line, barrier))
    with tree.frame("Labels"):
        mesh = op.label(mesh, class_id("barrier"), instance, concrete)
    tree.output("Mesh", op.only_if(end - begin > 0.01, mesh), description="Barrier; its points carry their station")


def _rows(tree: Tree, barrier: _Barrier, begin: Value, end: Value, ramp: Value) -> Value:
    """Return points with their station, evenly spaced from its start on but for the two at the ends of the ramps.

    Those beyond the backbone's ends collapse there.
    """
    first, last = barrier.first, barrier.last
    count = op.rounded_up(op.maximum(last - first, 0.01) / barrier.step - 1e-4) + 1
    line = row_of_points(tree, count)
    station = op.minimum(first + op.index(tree) * barrier.step, last)
    for kink in (first + ramp, last - ramp):
        near = op.unary("ABSOLUTE", station - kink) < barrier.step * 0.499
        inside = (op.index(tree) > 0) & (op.index(tree) < count - 1)
        station = op.switch(near & inside, station, kink)
    return op.store(line, "station", op.minimum(op.maximum(station, begin), end))


def _swept(tree: Tree, line: Value, barrier: _Barrier) -> Value:
    def outline(number: Value) -> Value:
        step, jersey = (op.choose(number, _outline(name)) for name in ("step", "new_jersey"))
        return op.switch(barrier.new_jersey, step, jersey)

    def place(point: Value, row: Value) -> Value:
        foot = op.sample_index(line, op.named_attribute(tree, "foot", "FLOAT_VECTOR"), row)
        left = op.sample_index(line, op.named_attribute(tree, "left", "FLOAT_VECTOR"), row)
        tall = op.sample_index(line, op.named_attribute(tree, "tall"), row)
        share = op.component(point, "Z")
        z = op.switch(share < 0.0, tall * share, -BURIED)
        return foot + left * (op.component(point, "X") * barrier.width * 0.5) + op.vector(tree, 0.0, 0.0, z)

    def station(row: Value) -> Value:
        return op.sample_index(line, op.named_attribute(tree, "station"), row)

    return loft(tree, outline, len(_outline("step")), op.point_count(line), place, {"station": station})


def build_concrete_barriers(builder: ModelBuilder) -> None:
    """Make one object per concrete barrier."""
    for name, barrier in builder.parameters.of_type(ConcreteBarrier).items():
        inputs = {
            **builder.surfaces("Backbone"),
            "Start Station": builder.along(barrier.start_station),
            "End Station": builder.along(min(barrier.end_station, builder.geometry.length)),
            "Offset": barrier.offset,
            "New Jersey": barrier.profile == "new_jersey",
            "Height": barrier.height,
            "Base Width": barrier.base_width,
            "Terminal Length": barrier.terminal_length,
            "Step": builder.step,
            "Instance": barrier.instance,
            "Material": material("barrier_concrete"),
        }
        builder.add(name, bpy.data.meshes.new("SR Concrete Barrier"), concrete_barrier_group(), inputs)
