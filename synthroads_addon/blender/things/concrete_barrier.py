"""Concrete barriers of step or New Jersey profile, ramped down at their ends (SR Concrete Barrier)."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import concrete_barrier as sizes
from ...road.things.concrete_barrier import ConcreteBarrier
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import Lengthwise, foot_at
from ..nodes.inputs import boolean, instance_number, material_of, metres
from ..nodes.solids import loft, row_of_points
from .model_builder import ModelBuilder
from .registry import model_part


def _outline(profile: str) -> list[tuple[float, float, float]]:
    """Return a profile's points (x, 0, z), clockwise along the road, in half widths and heights; z = -1 is buried."""
    left_half = [(1.0, -1.0), *sizes.FLANKS[profile]]
    return [(x, 0.0, z) for x, z in left_half] + [(-x, 0.0, z) for x, z in reversed(left_half)]


class _Barrier(Lengthwise):
    new_jersey = boolean(False, "New Jersey profile, else the step profile")
    height = metres(0.9, (0.4, 2.0), "Top above the surface")
    base_width = metres(0.54, (0.3, 1.2), "Width of its foot")
    terminal_length = metres(8.0, (0.0, 50.0), "Length of the ramp at each end")
    step = metres(2.0, (0.1, 8.0), "Largest length of a straight piece")
    instance = instance_number()
    material = material_of("the barrier", "barrier_concrete")


@makes_group("SR Concrete Barrier", catalogue="Barriers")
def concrete_barrier_group(tree: Tree) -> None:
    """A concrete barrier along the road, symmetric about its axis, with ramped ends."""
    barrier = _Barrier(tree)
    axis, surfaces = barrier.geometry()
    with tree.frame("Rows on the backbone, two of them where the ramps end"):
        start = op.maximum(barrier.start_station, first_station(axis))
        end = op.minimum(barrier.end_station, last_station(axis))
        ramp = op.minimum(barrier.terminal_length, (barrier.end_station - barrier.start_station) * 0.5)
        line = _rows(tree, barrier, start, end, ramp)
    with tree.frame("Foot and top"):
        station = op.named_attribute(tree, "station")
        foot, left_vector = foot_at(axis, surfaces, station, barrier.offset)
        line = op.store(op.store(line, "left", left_vector), "foot", foot)
        end_distance = op.minimum(station - barrier.start_station, barrier.end_station - station)
        height_share = op.switch(ramp > 1e-3, 1.0, op.minimum(end_distance / op.maximum(ramp, 1e-3), 1.0))
        line = op.store(line, "tall", op.maximum(barrier.height * height_share, sizes.TIP))
    with tree.frame("Profile swept along the rows"):
        mesh = op.delete_degenerate(_sweep_profile(tree, line, barrier))
    with tree.frame("Labels"):
        mesh = op.label(mesh, class_id(ConcreteBarrier.points_class), barrier.instance, barrier.material)
    tree.output("Mesh", op.only_if(end - start > 0.01, mesh), description="Barrier; its points carry their station")


def _rows(tree: Tree, barrier: _Barrier, backbone_start: Value, backbone_end: Value, ramp: Value) -> Value:
    """Add nodes for points with their station, evenly spaced along the barrier, two of them moved to the ramps' ends.

    Points beyond an end of the backbone collapse onto that end.
    """
    start_station, end_station = barrier.start_station, barrier.end_station
    count = op.round_up(op.maximum(end_station - start_station, 0.01) / barrier.step - 1e-4) + 1
    line = row_of_points(tree, count)
    station = op.minimum(start_station + op.index(tree) * barrier.step, end_station)
    for kink in (start_station + ramp, end_station - ramp):
        is_nearest = op.unary("ABSOLUTE", station - kink) < barrier.step * 0.499
        is_inner = (op.index(tree) > 0) & (op.index(tree) < count - 1)
        station = op.switch(is_nearest & is_inner, station, kink)
    return op.store(line, "station", op.minimum(op.maximum(station, backbone_start), backbone_end))


def _sweep_profile(tree: Tree, line: Value, barrier: _Barrier) -> Value:
    """Add nodes for the solid along the rows of `line`, with the height ``tall`` of each row."""

    def outline(number: Value) -> Value:
        step, jersey = (op.choose(number, _outline(name)) for name in ("step", "new_jersey"))
        return op.switch(barrier.new_jersey, step, jersey)

    def place(point: Value, row: Value) -> Value:
        foot = op.sample_index(line, op.named_attribute(tree, "foot", "FLOAT_VECTOR"), row)
        left_vector = op.sample_index(line, op.named_attribute(tree, "left", "FLOAT_VECTOR"), row)
        height = op.sample_index(line, op.named_attribute(tree, "tall"), row)
        share = op.component(point, "Z")
        z = op.switch(share < 0.0, height * share, -sizes.BURIED)
        return foot + left_vector * (op.component(point, "X") * barrier.base_width * 0.5) + op.vector(tree, 0.0, 0.0, z)

    def station(row: Value) -> Value:
        return op.sample_index(line, op.named_attribute(tree, "station"), row)

    return loft(tree, outline, len(_outline("step")), op.point_count(line), place, {"station": station})


@model_part("concrete_barriers", 50)
def build_concrete_barriers(builder: ModelBuilder) -> None:
    """Add one object per concrete barrier to the model."""
    for name, barrier in builder.parameters.of_type(ConcreteBarrier).items():
        builder.add_thing(
            name,
            barrier,
            concrete_barrier_group(),
            end_station=builder.along(min(barrier.end_station, builder.geometry.length)),
            new_jersey=barrier.profile == "new_jersey",
            step=builder.step,
        )
