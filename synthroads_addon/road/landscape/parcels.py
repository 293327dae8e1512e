"""Parcels of land: fields, meadows and forest blocks, as convex quadrilaterals that cover the land without gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float, Int
from ...base.random_streams import stream
from ..geometry import RoadGeometry
from ..surroundings import Landscape
from .relief import plane_waves

KINDS = ("forest", "meadow", "wheat", "crop", "rapeseed", "soil")
"""Uses of land, by number."""
_CROPS = {"wheat": 0.4, "crop": 0.35, "rapeseed": 0.1, "soil": 0.15}
"""Share of the fields."""
_GROWTH = 900.0
"""Parcels are twice as large at this distance (m) from the road's middle as on it."""
_SLENDER = 1.8
"""Longer parcels than this (for their width) are cut across."""
_CLUSTER = 700.0
"""Shortest wavelength (m) of where forests and meadows gather."""


@dataclass(frozen=True)
class Parcels:
    """Parcels of land.

    Attributes:
        corners: (P, 4, 2) local coordinates, m, anticlockwise.
        kind: (P,) numbers in `KINDS`.
        rows: (P, 2) unit vectors along its longer sides: those of the rows of its crop.
    """

    corners: Float
    kind: Int
    rows: Float

    def __len__(self) -> int:
        """Return the number of parcels, P."""
        return len(self.kind)

    @property
    def middle(self) -> Float:
        """Return the parcels' middles (P, 2), m."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def area(self) -> Float:
        """Return the parcels' areas (P,), m2."""
        return _area(self.corners)

    def of_points(self, plan: Float) -> Int:
        """Return the parcel (N,) that each of local points (N, 2) lies in; -1 outside of all."""
        parcel = np.full(len(plan), -1)
        low, high = self.corners.min(axis=1), self.corners.max(axis=1)
        order = np.argsort(plan[:, 0])
        sorted_x = plan[order, 0]
        for number in range(len(self)):
            first, last = np.searchsorted(sorted_x, (low[number, 0], high[number, 0]))
            near = order[first:last]
            inside = (plan[near, 1] >= low[number, 1]) & (plan[near, 1] <= high[number, 1])
            ring = self.corners[number]
            for corner, after in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                along, away = after - corner, plan[near] - corner
                inside &= along[0] * away[:, 1] - along[1] * away[:, 0] >= 0.0
            parcel[near[inside]] = number
        return parcel


def parcels_of(geometry: RoadGeometry, landscape: Landscape) -> Parcels:
    """Return the parcels of the land around a road, in a square of the landscape's reach around its middle.

    It is cut in two again and again, across the longer side and a little askew, until the pieces are small enough;
    near the road they are smaller. Forest and meadow gather where seeded waves are high.
    """
    middle = geometry.alignment.position(np.array([geometry.length / 2.0]))[0]
    heading = float(geometry.alignment.heading(np.array([geometry.length / 2.0]))[0])
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * landscape.reach
    corners = np.array(_cut(square, landscape, stream(landscape.seed, "landscape", "parcels")))
    corners = corners @ turn + middle
    kind = _land_use(corners, landscape)
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]], axis=1)
    length = np.linalg.norm(sides, axis=2)
    longer = np.argmax(length, axis=1)
    each = np.arange(len(corners))
    return Parcels(corners, kind, sides[each, longer] / length[each, longer][:, None])


def _cut(square: Float, landscape: Landscape, rng: np.random.Generator) -> list[Float]:
    """Return the pieces (4, 2) of a square around the origin."""
    done, left = [], [square]
    while left:
        piece = left.pop()
        across = float(np.linalg.norm(piece[1] - piece[0] + piece[2] - piece[3]) / 2.0)
        deep = float(np.linalg.norm(piece[2] - piece[1] + piece[3] - piece[0]) / 2.0)
        width = landscape.parcel_size * (1.0 + float(np.linalg.norm(piece.mean(axis=0))) / _GROWTH)
        share, skew = rng.uniform(0.38, 0.62), rng.normal(0.0, 0.025)
        if min(across, deep) <= width and max(across, deep) <= _SLENDER * max(width, min(across, deep)):
            done.append(piece)
            continue
        ring = piece if across >= deep else np.roll(piece, -1, axis=0)
        a, b, c, d = ring
        first, second = a + (b - a) * (share + skew), d + (c - d) * (share - skew)
        left += [np.array([a, first, second, d]), np.array([first, b, c, second])]
    return done


def _area(corners: Float) -> Float:
    x, y = corners[..., 0], corners[..., 1]
    return np.asarray(0.5 * np.sum(x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1), axis=-1))


def _land_use(corners: Float, landscape: Landscape) -> Int:
    """Return the kinds (P,) of parcels: forest and meadow have their shares of the area, crops the rest."""
    middle, area = corners.mean(axis=1), _area(corners)
    rng = stream(landscape.seed, "landscape", "land use")
    weights = np.array(list(_CROPS.values()))
    kind = 2 + rng.choice(len(weights), size=len(corners), p=weights / weights.sum())
    free = np.ones(len(corners), dtype=np.bool_)
    for number, share in ((0, landscape.forest_share), (1, landscape.meadow_share)):
        scatter = rng.normal(0.0, 0.35, len(corners))
        order = np.argsort(-(plane_waves(middle, landscape.seed, KINDS[number], _CLUSTER) + scatter))
        order = order[free[order]]
        taken = order[np.cumsum(area[order]) <= share * area.sum()]
        kind[taken], free[taken] = number, False
    return kind
