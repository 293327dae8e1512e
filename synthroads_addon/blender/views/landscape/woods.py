"""The landscape's trees: instances of a few crowns, so that a forest costs a file its places alone."""

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
"""Kinds of crowns."""
_CARDS = 420
"""Twigs of a crown."""
_CORES = {"maple_leaves": (0.42, 0.40, 0.57), "spruce_leaves": (0.34, 0.46, 0.54)}
"""Leaves of a crown -> radius of its core, half its height, height of its middle, for a tree 1 m high and broad."""


def trees_mesh(trees: LandTrees) -> bpy.types.Mesh:
    """Create a mesh with a vertex per tree, with its size, turn and kind of crown as attributes."""
    mesh = bpy.data.meshes.new("SR Landscape Woods")
    fill(mesh, trees.foot)
    number = np.arange(len(trees.foot))
    crown = np.where(trees.conifer, _BROADLEAVES + number % _CONIFERS, (number * 7 + number // 5) % _BROADLEAVES)
    breadth = np.where(trees.conifer, 0.75 * trees.breadth, trees.breadth)
    attribute(mesh, "size", np.column_stack([breadth, breadth, trees.height]))
    attribute(mesh, "turn", trees.turn)
    attribute(mesh, "crown", crown)
    return mesh


def woods_group(material: Callable[[str], bpy.types.Material], bare: bool) -> bpy.types.NodeTree:
    """Return the node group that shows a crown on each vertex of `trees_mesh`, with the materials of a road.

    Args:
        material: returns the road's material of a name.
        bare: whether broadleaved trees have lost their leaves.
    """
    names = ("maple_leaves", "birch_leaves", "spruce_leaves", "maple_bark")
    made = {name: material(name).name for name in names}
    return node_group("SR Landscape Woods", _build, tuple(sorted(made.items())), bare, description="Trees on points")


def _build(tree: Tree, materials: tuple[tuple[str, str], ...], bare: bool) -> None:
    names = dict(materials)
    points = tree.input("Points", "Geometry", description="A point per tree: size (m), turn (rad), crown")
    crowns = []
    for number in range(_BROADLEAVES + _CONIFERS):
        with tree.frame(f"Crown {number}"):
            conifer = number >= _BROADLEAVES
            leaves = "spruce_leaves" if conifer else ("maple_leaves", "birch_leaves")[number % 2]
            leaves = "maple_bark" if bare and not conifer else leaves
            made = _crown(tree, "spruce_leaves" if conifer else "maple_leaves", number, bare and not conifer)
            made = paint_faces(made, picked_material(tree, names[leaves]))
            crowns.append(tree.node("GeometryNodeGeometryToInstance", op.join(made, _trunk(tree, names))).value)
    with tree.frame("On the points"):
        woods = op.one_on_each(points, op.join(*crowns), "crown")
    tree.output("Instances", woods, description="Trees")


def _trunk(tree: Tree, names: dict[str, str]) -> Value:
    trunk = tree.node("GeometryNodeMeshCone", vertices=5, radius_bottom=0.03, radius_top=0.015, depth=0.5).value
    return paint_faces(trunk, picked_material(tree, names["maple_bark"]))


def _crown(tree: Tree, leaves: str, seed: int, bare: bool) -> Value:
    """Add nodes for a crown of a tree 1 m high and 1 m broad: a lumpy core within twigs; in winter twigs alone."""
    radius, half, middle = _CORES[leaves]
    core = tree.node("GeometryNodeMeshIcoSphere", subdivisions=3, radius=1.0).value
    core = op.set_position(core, _shaped(tree, op.position(tree), leaves, seed, 0.9))
    cards = tree.node("GeometryNodePoints", count=_CARDS).value
    way = op.normalize(op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), 10 * seed))
    inwards = op.random(tree, 0.4 if bare else 0.95, 1.0, 10 * seed + 3)
    cards = op.set_position(cards, _shaped(tree, way, leaves, seed, 1.0) * inwards)
    disc = tree.node("GeometryNodeMeshCircle", vertices=3, radius=0.085, fill_type="NGON").value
    high = radius / half
    disc = op.transform(disc, scale=(0.12 if bare else 1.0, 1.8 if bare else 1.0, high))
    turn = op.random_turn(tree, (-math.pi, -math.pi, 0.0), (math.pi, math.pi, 2.0 * math.pi), 10 * seed + 1)
    twigs = tree.node(
        "GeometryNodeInstanceOnPoints",
        cards,
        instance=disc,
        rotation=turn,
        scale=op.random(tree, 0.6, 1.25, 10 * seed + 2),
    ).value
    crown = op.realize(twigs) if bare else op.join(core, op.realize(twigs))
    place = op.position(tree) * (radius, radius, half)
    return op.set_position(crown, place + (0.0, 0.0, middle))


def _shaped(tree: Tree, way: Value, leaves: str, seed: int, size: float) -> Value:
    """Add nodes for the crown's surface in a direction (unit vector): a lumpy ball, or a cone for needles."""
    noise = tree.node(
        "ShaderNodeTexNoise", way, noise_dimensions="4D", w=float(seed) * 3.7, scale=2.3, detail=2.0
    ).value
    radius = (0.68 + 0.62 * noise) * size
    if leaves == "maple_leaves":
        return way * radius
    z = op.component(way, "Z")
    tip = op.maximum(0.5 - 0.5 * z, 0.02)
    slim = op.vector(tree, op.component(way, "X") * tip * 2.4, op.component(way, "Y") * tip * 2.4, z * 1.15)
    return slim * radius
