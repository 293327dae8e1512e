"""Trees of the landscape: forests, and rows along the borders of fields. The farther, the fewer and the broader."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.arrays import Bool, Float
from ...base.random_streams import stream
from ..geometry import RoadGeometry
from ..surroundings import Landscape
from .parcels import Parcels
from .relief import LandRelief

SPACING, GROWTH = 6.5, 0.010
"""Distance between trees of a forest near the road, and by how much it grows with the distance from it, m and m/m."""
HEIGHTS = (15.0, 27.0)
"""Smallest and largest trees of a forest, m."""
_ROWS, _ROW_SPACING, _ROW_HEIGHTS, _ROW_REACH = 0.16, 8.0, (4.0, 13.0), 1500.0
_CLEAR = 6.0
"""Trees keep so far (m) from the terrain that is built of its own, and from the road's prolongation."""


class LandTrees(NamedTuple):
    """Trees of a landscape.

    Attributes:
        foot: (N, 3) local coordinates, m.
        height, breadth: (N,) m; the breadth is the crown's diameter.
        conifer: (N,) whether each is one.
        turn: (N,) about the vertical, rad.
    """

    foot: Float
    height: Float
    breadth: Float
    conifer: Bool
    turn: Float


def land_trees(geometry: RoadGeometry, landscape: Landscape, parcels: Parcels, relief: LandRelief) -> LandTrees:
    """Return the trees of the landscape's forests and field borders."""
    rng = stream(landscape.seed, "landscape", "trees")
    centre = geometry.alignment.position(np.array([geometry.length / 2.0]))[0]
    forests = [_forest(rng, ring, centre) for ring in parcels.corners[parcels.kind == 0]]
    forest = np.concatenate([np.empty((0, 3)), *forests])
    row = np.concatenate([np.empty((0, 2)), *_rows(rng, parcels, centre)])
    plan = np.concatenate([forest[:, :2], row])
    spread = np.concatenate([forest[:, 2], np.full(len(row), _ROW_SPACING)])
    low = np.where(np.arange(len(plan)) < len(forest), HEIGHTS[0], _ROW_HEIGHTS[0])
    high = np.where(np.arange(len(plan)) < len(forest), HEIGHTS[1], _ROW_HEIGHTS[1])
    # Stands have their own mean height, whose trees differ a little.
    height = low + (high - low) * np.clip(0.5 + 0.2 * rng.normal(size=len(plan)), 0.0, 1.0)
    breadth = np.maximum(0.42 * height, 1.35 * spread) * rng.uniform(0.85, 1.2, len(plan))
    conifer = (rng.random(len(plan)) < 0.3) & (low == HEIGHTS[0])
    turn = rng.uniform(0.0, 2.0 * np.pi, len(plan))
    station, offset = geometry.alignment.project(plan) if len(plan) else (np.empty(0), np.empty(0))
    stays = np.flatnonzero(_clear_of_road(geometry, relief, station, offset) & ~_in_villages(landscape, plan))
    z = relief.elevation_beside(plan[stays], station[stays], offset[stays])
    foot = np.column_stack([plan[stays], z])
    return LandTrees(foot, height[stays], breadth[stays], conifer[stays], turn[stays])


def _forest(rng: np.random.Generator, ring: Float, centre: Float) -> Float:
    """Return x, y and spacing (N, 3), m, of the trees of one forest parcel: a jittered grid."""
    away = float(np.linalg.norm(ring.mean(axis=0) - centre))
    spacing = SPACING + GROWTH * max(away - 250.0, 0.0)
    a, b, c, d = ring
    counts = [max(1, int(np.linalg.norm(side) / spacing)) for side in ((b - a + c - d) / 2.0, (d - a + c - b) / 2.0)]
    u, v = ((np.arange(n) + 0.5) / n for n in counts)
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    grid += rng.uniform(-0.42, 0.42, grid.shape) / counts
    u, v = grid[:, :1], grid[:, 1:]
    plan = (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v
    return np.column_stack([plan, np.full(len(plan), spacing)])


def _rows(rng: np.random.Generator, parcels: Parcels, centre: Float) -> list[Float]:
    """Return x and y (N, 2), m, of the trees along some borders of the parcels near the road."""
    rows = []
    near = np.linalg.norm(parcels.middle - centre, axis=1) < _ROW_REACH
    for ring in parcels.corners[near & (parcels.kind != 0)]:
        for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if rng.random() < _ROWS:
                count = max(1, int(np.linalg.norm(end - start) / _ROW_SPACING))
                share = np.sort(rng.random(count))[:, None]
                rows.append(start + (end - start) * share + rng.normal(0.0, 1.2, (count, 2)))
    return rows


def _clear_of_road(geometry: RoadGeometry, relief: LandRelief, station: Float, offset: Float) -> Bool:
    """Return whether places (N,) lie clear of the terrain and of the road's prolongation."""
    built = (station >= 0.0) & (station <= geometry.length)
    edge = float(np.abs(geometry.offsets([0.0, geometry.length])).max()) + 2.0 * _CLEAR
    return np.abs(offset) > np.where(built, relief.half_width + _CLEAR, edge)


def _in_villages(landscape: Landscape, plan: Float) -> Bool:
    inside = np.zeros(len(plan), dtype=np.bool_)
    for village in landscape.villages:
        inside |= np.linalg.norm(plan - (village.x, village.y), axis=1) < village.radius + 15.0
    return inside
