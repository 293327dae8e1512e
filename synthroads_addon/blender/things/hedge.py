"""Hedges: leaves within an outline, denser towards its surface (SR Hedge).

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.things.hedge import Hedge
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import Lengthwise, foot_at
from ..nodes.inputs import instance_number, integer, material_of, metres, share
from .model_builder import ModelBuilder
from .registry import model_part

_LEAF = [(0.0, -0.5, 0.0), (0.5, 0.3, 0.0), (-0.42, 0.5, 0.0)]
"""Triangle that represents a twig's leaves, in widths and lengths; chosen."""
_SIZE = (0.20, 0.30)
"""Width and length of such a triangle, m; chosen."""
_BARE = 0.1
"""Width of a bare twig in winter, as a share of the triangle's width; chosen."""
_HOLLOW = 0.5
"""Share of the way from the middle to the surface within which a hedge has no leaves; chosen."""


class _Hedge(Lengthwise):
    height = metres(1.8, (0.3, 8.0), "Top above the surface")
    width = metres(1.2, (0.3, 5.0), "Width where it is widest")
    leaves_per_metre = integer(200, (1, 100_000), "Leaves in each metre of its length, at full detail")
    leaf_width = metres(_SIZE[0], (0.002, 0.5), "Width of a triangle that stands for a twig's leaves")
    zero = integer(0, (0, 2**20), "Whole metre of the road that the stations count from")
    seed = integer(0, (0, 2**31 - 1), "Seed of the leaves")
    detail = share(1.0, (0.0, 1.0), "Share of the leaves' triangles")
    instance = instance_number()
    material = material_of("the leaves", "leaves")


@makes_group("SR Hedge", catalogue="Plants")
def hedge_group(tree: Tree) -> None:
    """A hedge along the road; a leaf's place follows from its number, so that a stretch has the whole hedge's."""
    hedge = _Hedge(tree)
    axis, surfaces = hedge.geometry()
    with tree.frame("Numbers of the leaves, counted from the road's begin"):
        density = op.round_up(hedge.leaves_per_metre * op.maximum(hedge.detail, 0.04))
        first_number = op.round_up(hedge.start_station * density) + hedge.zero * density
        count = op.maximum((hedge.end_station - hedge.start_station) * density, 0.0)
        points = tree.node("GeometryNodePoints", count=op.round_up(count)).value
        points = op.store(points, "id", op.index(tree) + first_number)
        leaf_number = op.named_attribute(tree, "id", "INT")
    with tree.frame("Places: around the middle, from the hollow to the outline"):
        station = (leaf_number - hedge.zero * density) / (density * 1.0)
        angle = op.random(tree, -0.12 * math.pi, 1.12 * math.pi, hedge.seed + 1, leaf_number)
        radius = op.power(op.random(tree, _HOLLOW**2, 1.0, hedge.seed + 2, leaf_number), 0.5)
        x = op.unary("COSINE", angle) * radius
        z = op.clip(op.unary("SINE", angle) * radius, -0.3, 1.0)
        # A rounded box: steep sides and a nearly level top; numbers here are chosen.
        x, z = _boxed(x), op.clip(_boxed(z) * 0.62 + 0.38, 0.03, 1.0)
        offset = hedge.offset + x * (hedge.width * 0.5)
        foot, _ = foot_at(axis, surfaces, station, offset)
        place = foot + op.vector(tree, 0.0, 0.0, z * (hedge.height - _SIZE[1] * 0.4))
        is_outside = (station < first_station(axis)) | (station > last_station(axis)) | (station > hedge.end_station)
        points = op.delete_points(op.set_position(points, place), is_outside)
    with tree.frame("Leaves"):
        face = tree.node("GeometryNodeMeshCircle", vertices=3, fill_type="NGON").value
        size = op.vector(tree, hedge.leaf_width, _SIZE[1], 1.0)
        leaf = op.set_position(face, op.choose(op.index(tree), _LEAF) * size)
        leaves = tree.node(
            "GeometryNodeInstanceOnPoints",
            points,
            instance=leaf,
            rotation=op.random_turn(tree, (-math.pi, -1.2, 0.0), (math.pi, 1.2, 2.0 * math.pi), hedge.seed + 3),
            scale=op.random(tree, 0.7, 1.3, hedge.seed + 4) / op.unary("SQRT", op.maximum(hedge.detail, 0.04)),
        ).value
    with tree.frame("Labels"):
        mesh = op.label(op.realize(leaves), class_id(Hedge.points_class), hedge.instance, hedge.material)
        mesh = tree.node("GeometryNodeRemoveAttribute", mesh, name="id").value
    tree.output("Mesh", mesh, description="The hedge's leaves")


def _boxed(value: Value) -> Value:
    """Add nodes for sign(v) |v|^0.55 of a number from -1 to 1: they turn a circle into a rounded square."""
    size = op.power(op.unary("ABSOLUTE", value), 0.55)
    return op.switch(value < 0.0, size, size * -1.0)


@model_part("hedges", 66)
def build_hedges(builder: ModelBuilder) -> None:
    """Add one object per hedge to the model; none at detail 0."""
    if builder.detail == 0.0:
        return
    leafless = builder.parameters.environment.season == "winter"
    looks = {"material": "bark" if leafless else "leaves", "leaf_width": _SIZE[0] * (_BARE if leafless else 1.0)}
    for name, hedge in builder.parameters.of_type(Hedge).items():
        builder.add_thing(
            name,
            hedge,
            hedge_group(),
            end_station=builder.along(min(hedge.end_station, builder.geometry.length)),
            leaves_per_metre=hedge.leaves_per_metre(),
            zero=builder.zero,
            detail=builder.detail,
            **looks,
        )
