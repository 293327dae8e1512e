"""Species of plants: which are bare in winter, and the shapes of the kinds that each of them has."""

from __future__ import annotations

from ..things.plant_shape import PlantShape, species_shapes
from .plants import BOTTOMS, KINDS

NEEDLES = ("spruce", "pine")
"""Species of trees with needles."""
BARE_TWIGS = {"leaf_length": 1.6, "leaf_width": 0.06}
"""Factors on a leaf's triangle that make it the twigs that are left of it in winter."""


def is_bare(species: str, season: str) -> bool:
    """Return whether plants of a species have lost their leaves in a season.

    Example:
        >>> is_bare("maple", "winter"), is_bare("spruce", "winter")
        (True, False)
    """
    return season == "winter" and species not in NEEDLES


def plant_shape(kind: str, species: str, variant: int) -> PlantShape:
    """Return the measures of a tree or shrub of height 1: one of the variants that each species has."""
    shape = species_shapes()[kind][species]
    radius = shape["crown_radius"] * KINDS[kind][variant]
    bottom = shape["crown_bottom"] * BOTTOMS[kind][variant]
    widest, fullness = shape["crown_widest"], shape["crown_fullness"]
    return PlantShape(radius, bottom, widest, fullness, shape.get("trunk_radius", 0.0) if kind == "tree" else 0.0)
