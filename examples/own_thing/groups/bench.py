"""Benches as a node group (SR Bench) and as objects of a model."""

from __future__ import annotations

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.nodes import operations as op
from synthroads_addon.blender.nodes.builder import Tree, makes_group
from synthroads_addon.blender.nodes.inputs import material_of, metres
from synthroads_addon.blender.nodes.solids import box, paint_faces
from synthroads_addon.blender.nodes.standing import Standing
from synthroads_addon.blender.things.model_builder import ModelBuilder
from synthroads_addon.blender.things.registry import model_part
from synthroads_addon.road.things.bench import LEG, SEAT, Bench


class _Bench(Standing):
    width = metres(1.8, (0.1, 5.0), "Width of the seat")
    depth = metres(0.5, (0.1, 5.0), "Depth of the seat")
    height = metres(0.5, (0.1, 5.0), "Top above the surface")
    seat_material = material_of("the seat", "noise_wood")
    leg_material = material_of("the legs", "concrete")


@makes_group("SR Bench")
def bench_group(tree: Tree) -> None:
    """A seat on two legs; points carry ``heading`` (rad) and ``elevation`` (m)."""
    bench = _Bench(tree)
    low, side = bench.height - SEAT, (bench.width - LEG) * 0.5
    with tree.frame("Seat and legs"):
        size = op.vector(tree, bench.width, bench.depth, SEAT)
        seat = box(tree, size, op.vector(tree, 0.0, 0.0, bench.height - SEAT / 2.0))
        parts = [paint_faces(seat, bench.seat_material)]
        for x in (side * -1.0, side):
            leg = box(tree, op.vector(tree, LEG, bench.depth, low), op.vector(tree, x, 0.0, low * 0.5))
            parts.append(paint_faces(leg, bench.leg_material))
    with tree.frame("Put onto the points"):
        mesh = bench.put_labelled(parts, class_id(Bench.points_class))
    tree.output("Mesh", mesh, description="Bench")


@model_part("benches")
def build_benches(builder: ModelBuilder) -> None:
    """Make one object per bench."""
    for name, bench in builder.parameters.of_type(Bench).items():
        builder.add_thing(name, bench, bench_group())
