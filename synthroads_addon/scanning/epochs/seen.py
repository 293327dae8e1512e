"""`SeenPlaces`: where an epoch's scan could see, as cells with its points or its free lines of sight."""

from __future__ import annotations

from itertools import product
from threading import Lock

import numpy as np

from ...base.arrays import Bool, Float, Int
from ..scene.target import Target

CELL = 0.5
"""Edge of a cell, m: what is nearer than that to a return of the earlier scan was within its sight; chosen."""
_MOST_POSES = 16
"""Places of the scanner from which a cell is looked at; chosen: the nearest, and others at steps along the path."""
_SHIFT, _OFFSET = 21, 1 << 20
"""Bits of a cell's number along each axis, and what is added so that it isn't negative: 524 km to either side."""
_PENDING = 64
"""Blocks of points after which their cells are put together."""


def cells_of(points: Float) -> Int:
    """Return the numbers (N,) of the cells that points (N, 3), m, are in."""
    return cell_numbers(np.floor(points / CELL).astype(np.int64))


def cell_numbers(place: Int) -> Int:
    """Return the numbers (N,) of cells by their places (N, 3) along the axes."""
    place = place + _OFFSET
    return np.asarray((place[:, 0] << (2 * _SHIFT)) | (place[:, 1] << _SHIFT) | place[:, 2])


class SeenPlaces:
    """Cells of space in which a scan has returns, or through which it looked; local coordinates."""

    def __init__(self) -> None:
        self._cells = np.empty(0, np.int64)
        self._pending: list[Int] = []
        self._poses: list[Float] = []
        self._range = 0.0
        self._lock = Lock()

    def add(self, points: Float, pose: Float, maximum_range: float) -> None:
        """Note a block's points (N, 3) and a place (3,) of the scanner meanwhile, m; from any thread."""
        cells = np.unique(cells_of(points))
        with self._lock:
            self._pending.append(cells)
            self._poses.append(pose)
            self._range = max(self._range, maximum_range)
            if len(self._pending) > _PENDING:
                self._join()

    def _join(self) -> None:
        """Put the cells of the blocks that were noted together."""
        pending, self._pending = self._pending, []
        self._cells = np.unique(np.concatenate([self._cells, *pending]))

    def look(self, cells: Int, target: Target, shift: Float) -> None:
        """Add those cells (K, 3), by their places along the axes, that the scanner looked into from any of its places.

        Args:
            cells: that the next epoch has something in.
            target: the scene as it stands.
            shift: (3,) from these local coordinates to the scene's, m.
        """
        self._join()
        if not len(cells) or not self._poses:
            return
        poses = np.array(self._poses)
        centres = (cells + 0.5) * CELL
        seen = np.isin(cell_numbers(cells), self._cells)
        for number in range(min(_MOST_POSES, len(poses))):
            rows = np.flatnonzero(~seen)
            if not len(rows):
                break
            origin = poses[_nearest_poses(poses, centres[rows], number)]
            way = centres[rows] - origin
            distance = np.linalg.norm(way, axis=1)
            direction = way / np.maximum(distance, 1e-9)[:, None]
            length = np.maximum(distance - CELL, 0.0).astype(np.float32)
            blocked = target.caster.occluded(
                np.ascontiguousarray(origin + shift, np.float32), np.ascontiguousarray(direction, np.float32), length
            )
            seen[rows] = ~blocked & (distance <= self._range)
        self._cells = np.unique(np.concatenate([self._cells, cell_numbers(cells[seen])]))

    def has(self, points: Float) -> Bool:
        """Return which points (N, 3), m, lie in a cell that was seen, or beside one."""
        if self._pending:
            self._join()
        place = np.floor(points / CELL).astype(np.int64)
        result = self._contains(cell_numbers(place))
        rows = np.flatnonzero(~result)
        for step in product((-1, 0, 1), repeat=3):
            if not len(rows) or step == (0, 0, 0):
                continue
            result[rows] = self._contains(cell_numbers(place[rows] + np.array(step)))
            rows = rows[~result[rows]]
        return result

    def _contains(self, numbers: Int) -> Bool:
        """Return which numbers (N,) are those of cells that were seen."""
        if not len(self._cells):
            return np.zeros(len(numbers), bool)
        place = np.minimum(np.searchsorted(self._cells, numbers), len(self._cells) - 1)
        return np.asarray(self._cells[place] == numbers)


def _nearest_poses(poses: Float, centres: Float, number: int) -> Int:
    """Return the index (K,) of the pose that is looked from in a round: about the nearest, then others farther off."""
    step = max(1, len(poses) // 200)
    chosen = np.arange(0, len(poses), step)
    far = np.linalg.norm(poses[chosen][None] - centres[:, None], axis=2)
    rank = min(number * max(1, len(chosen) // _MOST_POSES), len(chosen) - 1)
    return np.asarray(chosen[np.argpartition(far, rank, axis=1)[:, rank]])


def cells_around(corners: Float) -> Int:
    """Return the distinct cells (K, 3), by their places along the axes, that triangles (T, 3, 3), m, lie in."""
    if not len(corners):
        return np.empty((0, 3), np.int64)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    steps = int(np.clip(np.ceil(longest / CELL), 1, 24))
    shares = [(i / steps, j / steps) for i in range(steps + 1) for j in range(steps + 1 - i)]
    places = [corners[:, 0] * (1.0 - u - v) + corners[:, 1] * u + corners[:, 2] * v for u, v in shares]
    return np.unique(np.concatenate([np.unique(np.floor(p / CELL).astype(np.int64), axis=0) for p in places]), axis=0)
