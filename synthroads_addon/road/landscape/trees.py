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
    forest_trees = np.concatenate([np.empty((0, 3)), *forests])
    row_trees = np.concatenate([np.empty((0, 2)), *_rows(rng, parcels, centre)])
    xy = np.concatenate([forest_trees[:, :2], row_trees])
    spacing = np.concatenate([forest_trees[:, 2], np.full(len(row_trees), _ROW_SPACING)])
    least_height = np.where(np.arange(len(xy)) < len(forest_trees), HEIGHTS[0], _ROW_HEIGHTS[0])
    largest_height = np.where(np.arange(len(xy)) < len(forest_trees), HEIGHTS[1], _ROW_HEIGHTS[1])
    # Stands have their own mean height, whose trees differ a little.
    height = least_height + (largest_height - least_height) * np.clip(0.5 + 0.2 * rng.normal(size=len(xy)), 0.0, 1.0)
    breadth = np.maximum(0.42 * height, 1.35 * spacing) * rng.uniform(0.85, 1.2, len(xy))
    conifer = (rng.random(len(xy)) < 0.3) & (least_height == HEIGHTS[0])
    turn = rng.uniform(0.0, 2.0 * np.pi, len(xy))
    station, offset = geometry.alignment.project(xy) if len(xy) else (np.empty(0), np.empty(0))
    standing = np.flatnonzero(_clear_of_road(geometry, relief, station, offset) & ~_in_villages(landscape, xy))
    z = relief.elevation_beside(xy[standing], station[standing], offset[standing])
    foot = np.column_stack([xy[standing], z])
    return LandTrees(foot, height[standing], breadth[standing], conifer[standing], turn[standing])


def _forest(rng: np.random.Generator, polygon: Float, centre: Float) -> Float:
    """Return x, y and spacing (N, 3), m, of the trees of one forest parcel: a jittered grid."""
    distance = float(np.linalg.norm(polygon.mean(axis=0) - centre))
    spacing = SPACING + GROWTH * max(distance - 250.0, 0.0)
    a, b, c, d = polygon
    counts = [max(1, int(np.linalg.norm(side) / spacing)) for side in ((b - a + c - d) / 2.0, (d - a + c - b) / 2.0)]
    u, v = ((np.arange(n) + 0.5) / n for n in counts)
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    grid += rng.uniform(-0.42, 0.42, grid.shape) / counts
    u, v = grid[:, :1], grid[:, 1:]
    xy = (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v
    return np.column_stack([xy, np.full(len(xy), spacing)])


def _rows(rng: np.random.Generator, parcels: Parcels, centre: Float) -> list[Float]:
    """Return x and y (N, 2), m, of the trees along some borders of the parcels near the road."""
    rows = []
    is_near = np.linalg.norm(parcels.middle - centre, axis=1) < _ROW_REACH
    for polygon in parcels.corners[is_near & (parcels.kind != 0)]:
        for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            if rng.random() < _ROWS:
                count = max(1, int(np.linalg.norm(end - start) / _ROW_SPACING))
                share = np.sort(rng.random(count))[:, None]
                rows.append(start + (end - start) * share + rng.normal(0.0, 1.2, (count, 2)))
    return rows


def _clear_of_road(geometry: RoadGeometry, relief: LandRelief, station: Float, offset: Float) -> Bool:
    """Return whether places (N,) lie clear of the terrain and of the road's prolongation."""
    is_beside_road = (station >= 0.0) & (station <= geometry.length)
    edge = float(np.abs(geometry.offsets([0.0, geometry.length])).max()) + 2.0 * _CLEAR
    return np.abs(offset) > np.where(is_beside_road, relief.half_width + _CLEAR, edge)


def _in_villages(landscape: Landscape, xy: Float) -> Bool:
    """Return whether points (N, 2) lie within 15 m (chosen) of a village's circle."""
    is_inside = np.zeros(len(xy), dtype=np.bool_)
    for village in landscape.villages:
        is_inside |= np.linalg.norm(xy - (village.x, village.y), axis=1) < village.radius + 15.0
    return is_inside
