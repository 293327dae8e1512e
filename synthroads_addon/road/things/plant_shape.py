"""Shape of trees and shrubs: measures of a plant of height 1, its trunk and crown as closed bodies."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.files import PRESETS
from ...base.schema import read_json
from .body import circle

TRUNK_FOOT = 0.02
"""Depth of a trunk's foot in the ground, for a tree of height 1."""
TRUNK_TOP = 0.93
"""Height to which a trunk goes within the crown."""
TRUNK_TAPER = 0.2
"""Radius of a trunk at its top, of that at its foot."""
_SIDES, _TRUNK_SIDES, _ROWS = 10, 6, 7
_LEAST = 0.1
"""Radius of a crown's ends, of that where it is widest: the clusters of leaves there."""


@cache
def species_shapes() -> dict[str, dict[str, dict[str, float]]]:
    """Return kind of plant -> species -> measures of a plant of height 1 (inputs of its node group), read once."""
    shapes: dict[str, dict[str, dict[str, float]]] = read_json(PRESETS / "plants.json")
    return shapes


class PlantShape(NamedTuple):
    """Measures of a tree or shrub of height 1, m.

    Attributes:
        crown_radius: where the crown is widest.
        crown_bottom: height at which it begins.
        widest: share of the way from its bottom to its top at which it is widest.
        fullness: exponent of its outline.
        trunk_radius: at the foot; 0 for a shrub.
    """

    crown_radius: float
    crown_bottom: float
    widest: float
    fullness: float
    trunk_radius: float

    def trunk(self) -> Float | None:
        """Return the sections (2, K, 3) of its trunk, which ends in the crown; None for a shrub."""
        if not self.trunk_radius:
            return None
        top = self.crown_bottom + (1.0 - self.crown_bottom) * self.widest
        radius_share = 1.0 - (1.0 - TRUNK_TAPER) * (top + TRUNK_FOOT) / (TRUNK_TOP + TRUNK_FOOT)
        rows = ((self.trunk_radius, -TRUNK_FOOT), (self.trunk_radius * radius_share, top))
        return np.stack([_ring(radius, height, _TRUNK_SIDES) for radius, height in rows])

    def crown(self) -> Float:
        """Return the sections (R, K, 3) of its crown: the outline that its branches end on, revolved about its stem."""
        row_shares = np.linspace(0.0, 1.0, _ROWS)  # the middle one is where it is widest
        height_shares = row_shares ** (math.log(self.widest) / math.log(0.5))
        sine = np.sin(np.pi * row_shares)
        radius = self.crown_radius * np.maximum(np.maximum(sine, 0.0) ** self.fullness, _LEAST)
        height = self.crown_bottom + (1.0 - self.crown_bottom) * height_shares
        return np.stack([_ring(r, z, _SIDES) for r, z in zip(radius.tolist(), height.tolist(), strict=True)])


def _ring(radius: float, height: float, sides: int) -> Float:
    """Return the corners (K, 3) of a level regular polygon about the z axis at a height, m."""
    return np.column_stack([circle(2.0 * radius, sides), np.full(sides, height)])
