"""Height above the ground of points that nobody has classified."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Float = NDArray[np.float64]

CELL = 0.5
WINDOW = 9
"""Cells (m) whose lowest points make the ground, and the cells across which nothing that stands may fill: what is
narrower than ``CELL * WINDOW`` falls off the ground."""
_STEP = 0.15  # m: what rises more than this above the opened surface is no ground


_MOST_CELLS = 1 << 24
"""Cells of one grid; points over more are worked on tile by tile, of which only those with points in them are made."""
_TILE, _MARGIN = 1024, 128
"""Cells along an edge of a tile, and around it those whose points count for its ground as well."""


def above_ground(xyz: Float) -> Float:
    """Return the height (N,) of points (N, 3) above the ground below them, m.

    The ground is the lowest point of each cell, opened by a window (so that cars, barriers and bushes fall off),
    gaps filled from the nearest cell, and smoothed. Memory is bounded by the cells that hold points, not by what lies
    between them.
    """
    if not len(xyz):
        return np.zeros(0)
    span = np.ptp(np.floor(xyz[:, :2] / CELL), axis=0) + 1.0
    if span.prod() <= _MOST_CELLS:
        return _above_grid(xyz)
    result = np.empty(len(xyz))
    tile = np.floor(xyz[:, :2] / (CELL * _TILE)).astype(np.int64)
    order = np.lexsort(tile.T)
    starts = np.flatnonzero(np.r_[True, np.any(np.diff(tile[order], axis=0) != 0, axis=1)])
    groups = {(int(tile[part[0], 0]), int(tile[part[0], 1])): part for part in np.split(order, starts[1:])}
    for (column, row), own in groups.items():
        corner = np.array([column, row]) * CELL * _TILE
        beside = [groups.get((column + i, row + j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        around = np.concatenate([own, *(part for part in beside if part is not None)])
        reach = xyz[around, :2] - corner
        near = np.all((reach >= -_MARGIN * CELL) & (reach < (_TILE + _MARGIN) * CELL), axis=1)
        near[: len(own)] = True
        result[own] = _above_grid(xyz[around[near]])[: len(own)]
    return result


def _above_grid(xyz: Float) -> Float:
    """Return the height (N,) of points above the ground of one grid."""
    low = np.floor(xyz[:, :2].min(axis=0) / CELL)
    cell = (np.floor(xyz[:, :2] / CELL) - low).astype(np.int64)
    shape = tuple(cell.max(axis=0) + 1)
    lowest = np.full(shape, np.inf)
    np.minimum.at(lowest, (cell[:, 0], cell[:, 1]), xyz[:, 2])
    empty = ~np.isfinite(lowest)
    nearest = ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    filled = lowest[tuple(nearest)]
    opened = ndimage.grey_opening(filled, size=(WINDOW, WINDOW))
    ground = ndimage.uniform_filter(np.where(filled - opened > _STEP, opened, filled), 3)
    place = xyz[:, :2] / CELL - low - 0.5
    under = ndimage.map_coordinates(ground, place.T, order=1, mode="nearest")
    return xyz[:, 2] - np.asarray(under)
