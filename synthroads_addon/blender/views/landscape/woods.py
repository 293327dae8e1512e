"""The landscape's trees: instances of a few crowns, so that a file has only the places of a forest's trees.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np

from ....road.landscape.trees import LandTrees
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, node_group
from ...nodes.solids import paint_faces, picked_material
from ...things.meshes import attribute, fill

_BROADLEAVES, _CONIFERS = 4, 2
"""Numbers of different crowns; chosen."""
_TWIGS = 420
"""Twigs of a crown; chosen."""
_CORES = {"maple_leaves": (0.42, 0.40, 0.57), "spruce_leaves": (0.34, 0.46, 0.54)}
"""Core of a crown by its leaves: radius, half its height, height of its centre, for a tree 1 m high and broad."""


def trees_mesh(trees: LandTrees) -> bpy.types.Mesh:
    """Create a mesh with a vertex per tree, with its size, turn and kind of crown as attributes."""
    mesh = bpy.data.meshes.new("SR Landscape Woods")
    fill(mesh, trees.foot)
    tree_index = np.arange(len(trees.foot))
    crown = np.where(
        trees.conifer, _BROADLEAVES + tree_index % _CONIFERS, (tree_index * 7 + tree_index // 5) % _BROADLEAVES
    )
    breadth = np.where(trees.conifer, 0.75 * trees.breadth, trees.breadth)
    attribute(mesh, "size", np.column_stack([breadth, breadth, trees.height]))
    attribute(mesh, "turn", trees.turn)
    attribute(mesh, "crown", crown)
    return mesh


def woods_group(material: Callable[[str], bpy.types.Material], leafless: bool) -> bpy.types.NodeTree:
    """Return the node group that shows a crown on each vertex of `trees_mesh`, with the materials of a road.

    Args:
        material: returns the road's material of a name.
        leafless: whether broadleaved trees have lost their leaves.
    """
    names = ("maple_leaves", "birch_leaves", "spruce_leaves", "maple_bark")
    material_names = {name: material(name).name for name in names}
    return node_group(
        "SR Landscape Woods", _build, tuple(sorted(material_names.items())), leafless, description="Trees on points"
    )


def _build(tree: Tree, materials: tuple[tuple[str, str], ...], leafless: bool) -> None:
    """Build the node group of the woods: one of several trees on each point."""
    names = dict(materials)
    points = tree.input("Points", "Geometry", description="A point per tree: size (m), turn (rad), crown")
    crowns = []
    for number in range(_BROADLEAVES + _CONIFERS):
        with tree.frame(f"Crown {number}"):
            is_conifer = number >= _BROADLEAVES
            leaves = "spruce_leaves" if is_conifer else ("maple_leaves", "birch_leaves")[number % 2]
            leaves = "maple_bark" if leafless and not is_conifer else leaves
            crown = _crown(tree, "spruce_leaves" if is_conifer else "maple_leaves", number, leafless and not is_conifer)
            crown = paint_faces(crown, picked_material(tree, names[leaves]))
            crowns.append(tree.node("GeometryNodeGeometryToInstance", op.join(crown, _trunk(tree, names))).value)
    with tree.frame("On the points"):
        woods = op.one_on_each(points, op.join(*crowns), "crown")
    tree.output("Instances", woods, description="Trees")


def _trunk(tree: Tree, names: dict[str, str]) -> Value:
    """Add nodes for the trunk of a tree 1 m high."""
    trunk = tree.node("GeometryNodeMeshCone", vertices=5, radius_bottom=0.03, radius_top=0.015, depth=0.5).value
    return paint_faces(trunk, picked_material(tree, names["maple_bark"]))


def _crown(tree: Tree, leaves: str, seed: int, leafless: bool) -> Value:
    """Add nodes for a crown of a tree 1 m high and 1 m broad: a lumpy core within twigs; twigs alone if leafless."""
    radius, half_height, centre_height = _CORES[leaves]
    core = tree.node("GeometryNodeMeshIcoSphere", subdivisions=3, radius=1.0).value
    core = op.set_position(core, _shaped(tree, op.position(tree), leaves, seed, 0.9))
    twig_points = tree.node("GeometryNodePoints", count=_TWIGS).value
    direction = op.normalize(op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), 10 * seed))
    radius_share = op.random(tree, 0.4 if leafless else 0.95, 1.0, 10 * seed + 3)
    twig_points = op.set_position(twig_points, _shaped(tree, direction, leaves, seed, 1.0) * radius_share)
    disc = tree.node("GeometryNodeMeshCircle", vertices=3, radius=0.085, fill_type="NGON").value
    stretch = radius / half_height
    disc = op.transform(disc, scale=(0.12 if leafless else 1.0, 1.8 if leafless else 1.0, stretch))
    rotation = op.random_turn(tree, (-math.pi, -math.pi, 0.0), (math.pi, math.pi, 2.0 * math.pi), 10 * seed + 1)
    twigs = tree.node(
        "GeometryNodeInstanceOnPoints",
        twig_points,
        instance=disc,
        rotation=rotation,
        scale=op.random(tree, 0.6, 1.25, 10 * seed + 2),
    ).value
    crown = op.realize(twigs) if leafless else op.join(core, op.realize(twigs))
    place = op.position(tree) * (radius, radius, half_height)
    return op.set_position(crown, place + (0.0, 0.0, centre_height))


def _shaped(tree: Tree, direction: Value, leaves: str, seed: int, size: float) -> Value:
    """Add nodes for a crown's surface point in a direction (unit vector): of a lumpy ball, or a cone for needles."""
    noise = tree.node(
        "ShaderNodeTexNoise", direction, noise_dimensions="4D", w=float(seed) * 3.7, scale=2.3, detail=2.0
    ).value
    radius = (0.68 + 0.62 * noise) * size
    if leaves == "maple_leaves":
        return direction * radius
    z = op.component(direction, "Z")
    cone_radius = op.maximum(0.5 - 0.5 * z, 0.02)
    cone_place = op.vector(
        tree,
        op.component(direction, "X") * cone_radius * 2.4,
        op.component(direction, "Y") * cone_radius * 2.4,
        z * 1.15,
    )
    return cone_place * radius
