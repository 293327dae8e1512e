"""SR Tree: trees with a tapered trunk, and a crown of branches and leaves."""

from __future__ import annotations

from ....base.classes import class_id
from ....road.things.plant_shape import TRUNK_FOOT, TRUNK_TAPER, TRUNK_TOP
from ....road.vegetation.plants import BOTTOMS, KINDS
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import metres
from ...nodes.solids import paint_faces
from .crown import Crown, Plant, PlantMaterials, bend_stems, crown_group
from .plants import PlantStand, decided_places, own_numbers, plant_points, points_in_band, sizes

_KINDS = tuple(zip((11, 23, 37), BOTTOMS["tree"], KINDS["tree"], strict=True))
"""Kinds of one species: seed, and factors of the crown's bottom and radius."""
_SIDES, _ROWS = 7, 5
"""Sides of a trunk, and pieces along it; chosen."""
_LEAN = 0.04
"""Largest lean of a tree, rad; chosen."""


_STAND = {"density": 0.005, "smallest_height": 5.0, "largest_height": 14.0, "band_start": 12.0, "band_end": 60.0}


class _TreeInputs(Crown):
    trunk_radius = metres(0.02, (0.001, 0.2), "Radius of the trunk at its foot")


@makes_group("SR Tree")
def tree_group(tree: Tree) -> None:
    """Trees of one species in a band beside the road, of three kinds, with gaps between their leaves."""
    places, stand = decided_places(tree), PlantStand(tree, defaults=_STAND)
    with tree.panel("Shape at height 1"):
        shape = _TreeInputs(tree)
    with tree.panel("Materials"):
        materials = PlantMaterials(tree)
    with tree.frame("Places"):
        points = points_in_band(tree, stand, stand.density, places)
    with tree.frame("Kinds of trees"):
        kinds = [_kind(tree, {**shape.values, **materials.values, "detail": stand.detail}, *kind) for kind in _KINDS]
    with tree.frame("Trees"):
        scale, number = sizes(tree, stand, "tree"), own_numbers(tree, stand)
        mesh = plant_points(tree, points, kinds, scale, _LEAN, stand.seed, number)
        mesh = op.store(mesh, "class_id", class_id("vegetation"), "FACE")
    tree.output("Mesh", mesh, description="Trees")


def _kind(tree: Tree, inputs: dict[str, Value], seed: int, bottom_factor: float, radius_factor: float) -> Value:
    """Add nodes for one kind of tree: the species' shape with another seed, crown's bottom and radius."""
    crown_inputs = {
        "crown_bottom": inputs["crown_bottom"] * bottom_factor,
        "crown_radius": inputs["crown_radius"] * radius_factor,
    }
    return tree.call(shape_group(), **inputs | crown_inputs, seed=seed).value


@makes_group("SR Tree Shape", catalogue="Plants")
def shape_group(tree: Tree) -> None:
    """One tree of height 1: trunk, branches and leaves."""
    shape, plant = _TreeInputs(tree), Plant(tree)
    radius = shape.trunk_radius
    with tree.frame("Trunk, with a wider foot"):
        trunk = _trunk(tree, radius)
        trunk = paint_faces(trunk, plant.bark_material)
    with tree.frame("Crown"):
        crown = tree.call(crown_group(), **shape.crown(), **plant.values, branch_radius=radius * 0.4).value
    with tree.frame("Crooked, and 1 high"):
        unit_tree = bend_stems(tree, op.join(trunk, crown), plant.seed)
    tree.output("Mesh", unit_tree, description="The tree, upright on the origin")


def _trunk(tree: Tree, radius: Value) -> Value:
    """Add nodes for a tapered trunk, wider near the ground, of a tree 1 m high."""
    trunk = tree.node(
        "GeometryNodeMeshCone",
        fill_type="NONE",
        vertices=_SIDES,
        side_segments=_ROWS,
        radius_bottom=radius,
        radius_top=radius * TRUNK_TAPER,
        depth=TRUNK_TOP + TRUNK_FOOT,
    ).value
    place = op.position(tree)
    height = op.component(place, "Z")
    foot_factor = 1.0 + 0.45 * op.maximum(1.0 - height * 12.0, 0.0)
    size = op.vector(tree, foot_factor, foot_factor, 1.0)
    place = place * size
    return op.set_position(trunk, place - (0.0, 0.0, TRUNK_FOOT))
