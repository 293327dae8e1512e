"""SR Tree: trees with a tapered trunk, branches and a crown of leaves."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...core.cloud.labels import class_id
from . import operations as op
from .builder import Tree, Value, node_group
from .plants import declare_stand, planted, points_in_band

_LEAVES = 1300
_BRANCHES = 9


@dataclass(frozen=True)
class Shape:
    """Shape of one variant, of height 1: bottom and radius of the crown, radius of the trunk, seed."""

    crown_bottom: float
    crown_radius: float
    trunk_radius: float
    seed: int


_SHAPES = (Shape(0.22, 0.30, 0.022, 11), Shape(0.16, 0.24, 0.018, 23), Shape(0.28, 0.36, 0.026, 37))


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
    variants = []
    for number, shape in enumerate(_SHAPES, 1):
        with tree.frame(f"Wood of shape {number}"):
            wood = _wood(tree, shape, bark)
        with tree.frame(f"Leaves of shape {number}"):
            variants.append(op.join(wood, _leaves(tree, shape, stand.detail, foliage)))
    with tree.frame("Trees"):
        tall = op.random(tree, stand.lowest, stand.tallest, stand.seed + 3)
        slender = op.random(tree, 0.85, 1.2, stand.seed + 4)
        scale = op.vector(tree, tall * slender, tall * slender, tall)
        mesh = planted(tree, stand, points, variants, scale, 0.04)
        mesh = op.store(mesh, "class_id", class_id("vegetation"), "FACE")
        mesh = op.store(mesh, "instance_id", stand.instance, "FACE")
    tree.output("Mesh", mesh, description="Trees")


def _wood(tree: Tree, shape: Shape, material: Value) -> Value:
    """Return trunk and branches, slightly crooked."""
    trunk = tree.node(
        "GeometryNodeMeshCone",
        fill_type="NONE",
        vertices=7,
        side_segments=6,
        radius_bottom=shape.trunk_radius,
        radius_top=shape.trunk_radius * 0.25,
        depth=0.92,
    ).value
    points = tree.node("GeometryNodeMeshLine", count=_BRANCHES, offset=(0.0, 0.0, 0.0)).value
    number = op.index(tree)
    height = shape.crown_bottom + (0.85 - shape.crown_bottom) * (number + 0.5) / float(_BRANCHES)
    points = op.set_position(points, op.vector(tree, 0.0, 0.0, height))
    branch = tree.node(
        "GeometryNodeMeshCone",
        fill_type="NONE",
        vertices=4,
        side_segments=2,
        radius_bottom=shape.trunk_radius * 0.45,
        radius_top=shape.trunk_radius * 0.08,
        depth=shape.crown_radius * 0.85,
    ).value
    around = number * 2.4 + op.random(tree, -0.4, 0.4, shape.seed)
    # Lower branches spread wide, upper ones rise; none is longer than the crown is wide there.
    rise = 1.15 - 0.6 * (number / float(_BRANCHES))
    length = 1.0 - 0.55 * (number / float(_BRANCHES))
    branches = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=branch,
        rotation=op.turn(tree, y=rise, z=around),
        scale=op.vector(tree, 1.0, 1.0, 1.0) * length,
    ).value
    wood = op.join(trunk, op.realize(branches))
    place = op.position(tree)
    bent = tree.node("ShaderNodeTexNoise", place, noise_dimensions="4D", w=float(shape.seed), scale=2.5, detail=1.0)
    crooked = (bent["Color"] - (0.5, 0.5, 0.5)) * 0.09
    share = op.minimum(op.component(place, "Z") * 4.0, 1.0)
    flat = tree.node("ShaderNodeVectorMath", crooked * share, (1.0, 1.0, 0.0), operation="MULTIPLY").value
    wood = tree.node("GeometryNodeSetPosition", wood, offset=flat).value
    return tree.node("GeometryNodeSetMaterial", wood, material=material).value


def _leaves(tree: Tree, shape: Shape, detail: Value, material: Value) -> Value:
    """Return the crown: leaf clusters as quads, scattered in a lumpy ellipsoid and denser towards its outside."""
    share = op.maximum(detail, 0.04)
    count = tree.node("FunctionNodeFloatToInt", share * float(_LEAVES)).value
    points = tree.node("GeometryNodePoints", count=count).value
    direction = op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), shape.seed + 1)
    direction = tree.node("ShaderNodeVectorMath", direction, operation="NORMALIZE").value
    lumps = tree.node("ShaderNodeTexNoise", direction, noise_dimensions="4D", w=float(shape.seed), scale=2.2, detail=1.0)
    radius = op.power(op.random(tree, 0.12, 1.0, shape.seed + 2), 0.45) * (0.55 + 0.8 * lumps.value)
    half = (1.0 - shape.crown_bottom) / 2.0
    size = (shape.crown_radius, shape.crown_radius, half)
    place = tree.node("ShaderNodeVectorMath", direction * radius, size, operation="MULTIPLY").value
    points = op.set_position(points, place + (0.0, 0.0, shape.crown_bottom + half * 0.98))
    leaf = tree.node("GeometryNodeMeshGrid", vertices_x=2, vertices_y=2, size_x=0.042, size_y=0.042).value
    broad = op.random(tree, 0.6, 1.3, shape.seed + 3) / op.unary("SQRT", share)
    turn = op.random(tree, (-0.9, -0.9, 0.0), (0.9, 0.9, 6.2832), shape.seed + 4)
    leaves = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=leaf,
        rotation=tree.node("FunctionNodeEulerToRotation", turn).value,
        scale=op.vector(tree, 1.0, 1.0, 1.0) * broad,
    ).value
    leaves = op.realize(leaves)
    return tree.node("GeometryNodeSetMaterial", leaves, material=material).value
