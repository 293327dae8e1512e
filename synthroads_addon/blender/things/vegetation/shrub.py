"""SR Shrub: shrubs of many stems that grow from the ground."""

from __future__ import annotations

from ....base.classes import class_id
from ....road.vegetation.plants import KINDS
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import metres
from .crown import Crown, Plant, PlantMaterials, bend_stems, crown_group
from .plants import PlantStand, decided_places, own_numbers, plant_points, points_in_band, sizes

_KINDS = tuple(zip((5, 17, 29), KINDS["shrub"], strict=True))
"""Kinds of one species: seed, and a factor of the crown's radius."""
_LEAN = 0.06
"""Largest lean of a shrub, rad; chosen."""
_DEFAULTS = {
    "crown_bottom": 0.05,
    "crown_radius": 0.5,
    "crown_fullness": 0.5,
    "cluster_radius": 0.2,
    "leafy_share": 0.5,
    "leaf_length": 0.09,
    "leaf_width": 0.09,
    "branches": 14,
    "leaves": 700,
}


_STAND = {"density": 0.006, "smallest_height": 0.5, "largest_height": 3.0, "band_start": 2.0, "band_end": 60.0}


class _ShrubInputs(Crown):
    stem_radius = metres(0.015, (0.0005, 0.2), "Radius of the thickest stem")


@makes_group("SR Shrub")
def shrub_group(tree: Tree) -> None:
    """Shrubs of one species in a band beside the road, of three kinds, with gaps between their leaves."""
    places, stand = decided_places(tree), PlantStand(tree, defaults=_STAND)
    with tree.panel("Shape at height 1"):
        shape = _ShrubInputs(tree, defaults=_DEFAULTS)
    with tree.panel("Materials"):
        materials = PlantMaterials(tree)
    with tree.frame("Places"):
        points = points_in_band(tree, stand, stand.density, places)
    with tree.frame("Kinds of shrubs"):
        kinds = [_kind(tree, {**shape.values, **materials.values, "detail": stand.detail}, *kind) for kind in _KINDS]
    with tree.frame("Shrubs"):
        scale, number = sizes(tree, stand, "shrub"), own_numbers(tree, stand)
        mesh = plant_points(tree, points, kinds, scale, _LEAN, stand.seed, number)
        mesh = op.store(mesh, "class_id", class_id("vegetation"), "FACE")
    tree.output("Mesh", mesh, description="Shrubs")


def _kind(tree: Tree, inputs: dict[str, Value], seed: int, radius_factor: float) -> Value:
    """Add nodes for one kind of shrub: the species' shape with another seed and radius."""
    return tree.call(
        shape_group(), **inputs | {"crown_radius": inputs["crown_radius"] * radius_factor}, seed=seed
    ).value


@makes_group("SR Shrub Shape", catalogue="Plants")
def shape_group(tree: Tree) -> None:
    """One shrub of height 1: stems and leaves."""
    shape, plant = _ShrubInputs(tree, defaults=_DEFAULTS), Plant(tree)
    with tree.frame("Stems and leaves"):
        shrub = tree.call(
            crown_group(), **shape.crown(), **plant.values, branch_radius=shape.stem_radius, from_ground=True
        ).value
    with tree.frame("Crooked, and 1 high"):
        unit_shrub = bend_stems(tree, shrub, plant.seed)
    tree.output("Mesh", unit_shrub, description="The shrub, upright on the origin")
