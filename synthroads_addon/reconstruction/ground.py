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


def above_ground(xyz: Float) -> Float:
    """Return the height (N,) of points (N, 3) above the ground below them, m.

    The ground is the lowest point of each cell, opened by a window (so that cars, barriers and bushes fall off),
    gaps filled from the nearest cell, and smoothed.
    """
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
