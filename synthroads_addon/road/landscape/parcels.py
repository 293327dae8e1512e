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

    def of_points(self, xy: Float) -> Int:
        """Return the parcel (N,) that each of local points (N, 2) lies in; -1 outside of all."""
        parcel = np.full(len(xy), -1)
        lower, upper = self.corners.min(axis=1), self.corners.max(axis=1)
        order = np.argsort(xy[:, 0])
        sorted_x = xy[order, 0]
        for number in range(len(self)):
            begin, end = np.searchsorted(sorted_x, (lower[number, 0], upper[number, 0]))
            candidates = order[begin:end]
            is_inside = (xy[candidates, 1] >= lower[number, 1]) & (xy[candidates, 1] <= upper[number, 1])
            polygon = self.corners[number]
            for corner, next_corner in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
                edge, from_corner = next_corner - corner, xy[candidates] - corner
                is_inside &= edge[0] * from_corner[:, 1] - edge[1] * from_corner[:, 0] >= 0.0
            parcel[candidates[is_inside]] = number
        return parcel


def parcels_of(geometry: RoadGeometry, landscape: Landscape) -> Parcels:
    """Return the parcels of the land around a road, in a square of the landscape's reach around its middle.

    It is cut in two again and again, across the longer side and a little askew, until the pieces are small enough;
    near the road they are smaller. Forest and meadow gather where seeded waves are high.
    """
    middle = geometry.alignment.position(np.array([geometry.length / 2.0]))[0]
    heading = float(geometry.alignment.heading(np.array([geometry.length / 2.0]))[0])
    rotation = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * landscape.reach
    corners = np.array(_cut(square, landscape, stream(landscape.seed, "landscape", "parcels")))
    corners = corners @ rotation + middle
    kind = _land_use(corners, landscape)
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]], axis=1)
    side_lengths = np.linalg.norm(sides, axis=2)
    longer_side = np.argmax(side_lengths, axis=1)
    parcel_index = np.arange(len(corners))
    return Parcels(corners, kind, sides[parcel_index, longer_side] / side_lengths[parcel_index, longer_side][:, None])


def _cut(square: Float, landscape: Landscape, rng: np.random.Generator) -> list[Float]:
    """Return the pieces (4, 2), m, of a square around the origin: cut in two across the longer side until small enough.

    Small enough is a width of `parcel_size` (m), growing with the distance from the origin, and not too slender. The
    cut lies at a random share of the side and leans a little; the numbers of its distributions are chosen.
    """
    pieces, uncut_pieces = [], [square]
    while uncut_pieces:
        piece = uncut_pieces.pop()
        width_across = float(np.linalg.norm(piece[1] - piece[0] + piece[2] - piece[3]) / 2.0)
        depth = float(np.linalg.norm(piece[2] - piece[1] + piece[3] - piece[0]) / 2.0)
        largest_width = landscape.parcel_size * (1.0 + float(np.linalg.norm(piece.mean(axis=0))) / _GROWTH)
        share, skew = rng.uniform(0.38, 0.62), rng.normal(0.0, 0.025)
        if min(width_across, depth) <= largest_width and max(width_across, depth) <= _SLENDER * max(
            largest_width, min(width_across, depth)
        ):
            pieces.append(piece)
            continue
        turned_piece = piece if width_across >= depth else np.roll(piece, -1, axis=0)
        a, b, c, d = turned_piece
        rear_cut, front_cut = a + (b - a) * (share + skew), d + (c - d) * (share - skew)
        uncut_pieces += [np.array([a, rear_cut, front_cut, d]), np.array([rear_cut, b, c, front_cut])]
    return pieces


def _area(corners: Float) -> Float:
    """Return the signed areas (...) of polygons (..., K, 2) by the shoelace formula; positive if anticlockwise."""
    x, y = corners[..., 0], corners[..., 1]
    return np.asarray(0.5 * np.sum(x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1), axis=-1))


def _land_use(corners: Float, landscape: Landscape) -> Int:
    """Return the kinds (P,) of parcels: forest and meadow have their shares of the area, crops the rest."""
    middle, area = corners.mean(axis=1), _area(corners)
    rng = stream(landscape.seed, "landscape", "land use")
    weights = np.array(list(_CROPS.values()))
    kind = 2 + rng.choice(len(weights), size=len(corners), p=weights / weights.sum())
    is_free = np.ones(len(corners), dtype=np.bool_)
    for number, share in ((0, landscape.forest_share), (1, landscape.meadow_share)):
        scatter = rng.normal(0.0, 0.35, len(corners))
        order = np.argsort(-(plane_waves(middle, landscape.seed, KINDS[number], _CLUSTER) + scatter))
        order = order[is_free[order]]
        chosen_parcels = order[np.cumsum(area[order]) <= share * area.sum()]
        kind[chosen_parcels], is_free[chosen_parcels] = number, False
    return kind
