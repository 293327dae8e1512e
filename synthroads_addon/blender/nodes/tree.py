"""SR Tree: trees with a tapered trunk, branches and a crown of leaves."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.cloud.labels import class_id
from . import operations as op
from .builder import Operand, Tree, Value, node_group
from .plants import declare_stand, planted, points_in_band

_TWIGS = 1350
_CLUSTERS = 30
_BRANCHES = 9
# A twig with its leaves is a kite, for a tree of height 1.
_TWIG = [(0.0, -0.03, 0.0), (-0.018, 0.0, 0.0), (0.018, 0.0, 0.0), (0.0, 0.03, 0.0)]


# Shapes of height 1: bottom and radius of the crown, radius of the trunk.
_SHAPES: tuple[dict[str, Any], ...] = (
    {"crown_bottom": 0.22, "crown_radius": 0.30, "trunk_radius": 0.022, "seed": 11},
    {"crown_bottom": 0.16, "crown_radius": 0.24, "trunk_radius": 0.018, "seed": 23},
    {"crown_bottom": 0.28, "crown_radius": 0.36, "trunk_radius": 0.026, "seed": 37},
)


def tree_group() -> bpy.types.NodeTree:
    """Return the group SR Tree."""
    return node_group("SR Tree", _build)


def _build(tree: Tree) -> None:
    """Trees in a band beside the road, of three shapes, whose leaves let light and laser through."""
    stand = declare_stand(tree, 0.005, (5.0, 14.0), (12.0, 60.0))
    bark = tree.input("Bark Material", "Material", description="Material of trunk and branches")
    foliage = tree.input("Leaves Material", "Material", description="Material of the leaves")
    with tree.frame("Places"):
        points = points_in_band(tree, stand, op.object_geometry(stand.terrain), stand.density)
    with tree.frame("Kinds of trees"):
        shapes = [
            tree.call(
                shape_group(), **shape, detail=stand.detail, bark_material=bark, leaves_material=foliage
            ).value
            for shape in _SHAPES
        ]
    with tree.frame("Trees"):
        tall = op.random(tree, stand.lowest, stand.tallest, stand.seed + 3)
        slender = op.random(tree, 0.85, 1.2, stand.seed + 4)
        scale = op.vector(tree, tall * slender, tall * slender, tall)
        mesh = planted(tree, stand, points, shapes, scale, 0.04)
        mesh = op.store(mesh, "class_id", class_id("vegetation"), "FACE")
        mesh = op.store(mesh, "instance_id", stand.instance, "FACE")
    tree.output("Mesh", mesh, description="Trees")


def shape_group() -> bpy.types.NodeTree:
    """Return the group SR Tree Shape."""
    return node_group("SR Tree Shape", _build_shape)


def _build_shape(tree: Tree) -> None:
    """One tree of height 1: trunk, branches and leaves."""
    bottom = tree.number(
        "Crown Bottom", 0.2, (0.0, 0.9), unit="m", description="Height at which the crown begins"
    )
    radius = tree.number("Crown Radius", 0.3, (0.05, 1.0), unit="m", description="Radius of the crown")
    trunk = tree.number(
        "Trunk Radius", 0.02, (0.001, 0.2), unit="m", description="Radius of the trunk at its foot"
    )
    seed = tree.integer("Seed", 0, (0, 2**30), description="Seed of branches and leaves")
    detail = tree.number(
        "Detail", 1.0, (0.0, 1.0), unit="share", description="Share of the leaves' triangles"
    )
    bark = tree.input("Bark Material", "Material", description="Material of trunk and branches")
    foliage = tree.input("Leaves Material", "Material", description="Material of the leaves")
    with tree.frame("Trunk"):
        wood = _cone(tree, 7, 6, trunk, 0.25, 0.92)
    with tree.frame("Branches: lower ones spread wide, upper ones rise"):
        wood = op.join(wood, _branches(tree, bottom, radius, trunk, seed))
    with tree.frame("Crooked"):
        wood = tree.node("GeometryNodeSetMaterial", _crooked(tree, wood, seed), material=bark).value
    with tree.frame("Leaves: twigs as kites in clusters that fill a spheroid"):
        leaves = tree.node(
            "GeometryNodeSetMaterial", _leaves(tree, bottom, radius, seed, detail), material=foliage
        ).value
    tree.output("Mesh", op.join(wood, leaves), description="The tree, upright on the origin")


def _cone(tree: Tree, sides: int, segments: int, radius: Value, taper: float, length: Operand) -> Value:
    return tree.node(
        "GeometryNodeMeshCone",
        fill_type="NONE",
        vertices=sides,
        side_segments=segments,
        radius_bottom=radius,
        radius_top=radius * taper,
        depth=length,
    ).value


def _branches(tree: Tree, bottom: Value, radius: Value, trunk: Value, seed: Value) -> Value:
    points = tree.node("GeometryNodeMeshLine", count=_BRANCHES, offset=(0.0, 0.0, 0.0)).value
    share = op.index(tree) / float(_BRANCHES)
    height = bottom + (0.85 - bottom) * (share + 0.05)
    points = op.set_position(points, op.vector(tree, 0.0, 0.0, height))
    around = op.index(tree) * 2.4 + op.random(tree, -0.4, 0.4, seed)
    branches = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=_cone(tree, 4, 2, trunk * 0.45, 0.2, radius * 0.85),
        rotation=op.turn(tree, y=1.15 - share * 0.6, z=around),
        scale=1.0 - share * 0.55,
    ).value
    return op.realize(branches)


def _crooked(tree: Tree, wood: Value, seed: Value) -> Value:
    place = op.position(tree)
    bent = tree.node("ShaderNodeTexNoise", place, noise_dimensions="4D", w=seed, scale=2.5, detail=1.0)
    aside = (bent["Color"] - (0.5, 0.5, 0.5)) * (op.minimum(op.component(place, "Z") * 4.0, 1.0) * 0.09)
    flat = tree.node("ShaderNodeVectorMath", aside, (1.0, 1.0, 0.0), operation="MULTIPLY").value
    return tree.node("GeometryNodeSetPosition", wood, offset=flat).value


def _leaves(tree: Tree, bottom: Value, radius: Value, seed: Value, detail: Value) -> Value:
    share = op.maximum(detail, 0.04)
    points = tree.node("GeometryNodePoints", count=share * float(_TWIGS)).value
    cluster = op.index(tree) % _CLUSTERS
    middle = _in_ball(tree, seed + 1, cluster) * 0.80
    spread = _in_ball(tree, seed + 2, op.index(tree)) * op.random(tree, 0.26, 0.46, seed + 3, cluster)
    half = (1.0 - bottom) * 0.5
    size = op.vector(tree, radius, radius, half)
    place = tree.node("ShaderNodeVectorMath", middle + spread, size, operation="MULTIPLY").value
    points = op.set_position(points, place + op.vector(tree, 0.0, 0.0, bottom + half))
    twig = tree.node("GeometryNodeMeshGrid", vertices_x=2, vertices_y=2).value
    twigs = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=op.set_position(twig, op.choose(op.index(tree), _TWIG)),
        rotation=op.random_turn(tree, (-0.9, -0.9, 0.0), (0.9, 0.9, 6.2832), seed + 5),
        # Fewer twigs are larger, so that the crown lets as much through.
        scale=op.random(tree, 0.6, 1.3, seed + 4) / op.unary("SQRT", share),
    ).value
    return op.realize(twigs)


def _in_ball(tree: Tree, seed: Value, identifier: Value) -> Value:
    """Return a random point of the unit ball, rather on its outside."""
    direction = op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), seed, identifier)
    direction = tree.node("ShaderNodeVectorMath", direction, operation="NORMALIZE").value
    return direction * op.power(op.random(tree, 0.0, 1.0, seed + 100, identifier), 0.4)
