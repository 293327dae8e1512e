"""`SurveyErrors`: how far a scan's measured places are from the true ones, and how well those of two epochs agree.

A scan is placed by a trajectory with errors: offsets and drifts of strips, boresight, lever arm. They move whole pieces
of a cloud, so no averaging over neighbours takes them away, as it takes the noise of ranges; a comparison of two clouds
has to know them as its registration error. Here they are known exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from ...base.arrays import Float, Int

CELL = 5.0
"""Edge of the cells, m, of which the mean displacement is taken: small beside the wavelength of a trajectory's errors;
chosen."""
_SHARE = 8
"""Of a block's points each of this number is looked at; chosen."""
_SHIFT, _OFFSET = 31, 1 << 30
"""Bits of a cell's number along each axis, and what is added so that it isn't negative."""
_PENDING = 64
"""Blocks of points after which their sums are put together."""
_PLACE_UNIT, _SHIFT_UNIT = 1e-6, 1e-9
"""Units, m, in whole numbers of which places and displacements are summed: in any order the sum is the same."""
_DIGITS = 7


@dataclass(frozen=True)
class Displacement:
    """Mean displacement of the points of K cells, in the road's local coordinates.

    Attributes:
        cells: (K,) numbers of the cells, ascending.
        place: (K, 3) mean of the true places, m.
        shift: (K, 3) mean of the measured places less the true ones, m.
    """

    cells: Int
    place: Float
    shift: Float

    def since(self, before: Displacement) -> Displacement:
        """Return how much farther these cells are displaced than those of another survey, where both have any."""
        cells, own, other = np.intersect1d(self.cells, before.cells, assume_unique=True, return_indices=True)
        return Displacement(cells, self.place[own], self.shift[own] - before.shift[other])

    def report(self) -> dict[str, Any]:
        """Return the displacement as JSON data: its rigid part, and what no rigid motion takes away; m, degrees.

        ``shift`` is that of the cells' centroid, ``rotation_deg`` is about the axes through it (east, north, up),
        ``rest`` the root mean square along each axis of what is left, ``along_axes`` that of the whole.
        """
        if not len(self.cells):
            return {"cells": 0}
        arm = self.place - self.place.mean(axis=0)
        turns = _turns(arm)
        mean = self.shift.mean(axis=0)
        # A road of one cell or of one line of them leaves turns open: the smallest ones are taken.
        angles = np.linalg.lstsq(turns.reshape(-1, 3), (self.shift - mean).ravel(), rcond=1e-9)[0]
        rest = self.shift - mean - turns @ angles
        return {
            "cells": len(self.cells),
            "centroid": _rounded(self.place.mean(axis=0)),
            "shift": _rounded(mean),
            "rotation_deg": _rounded(np.rad2deg(angles)),
            "rest": _rounded(np.sqrt((rest**2).mean(axis=0))),
            "along_axes": _rounded(np.sqrt((self.shift**2).mean(axis=0))),
        }

    @property
    def registration_error(self) -> float:
        """Return the standard deviation, m, to give to a comparison of two clouds.

        That is the root mean square of the displacement along the direction in which it is largest: surfaces have all
        directions. NaN where there are no cells.
        """
        if not len(self.cells):
            return float("nan")
        return float(np.sqrt(np.linalg.eigvalsh(self.shift.T @ self.shift / len(self.cells))[-1]))


class SurveyErrors:
    """Mean displacement, by cells in plan, of a scan's points by the errors of its trajectory."""

    def __init__(self) -> None:
        self._parts: list[tuple[Int, Float]] = []
        self._lock = Lock()

    def add(self, place: Float, measured: Float) -> None:
        """Note a block's points: true and measured places (N, 3), local, m, without the range's noise; any thread."""
        place, shift = place[::_SHARE], (measured - place)[::_SHARE]
        part = _sums(_numbers(place), np.rint(np.hstack([place / _PLACE_UNIT, shift / _SHIFT_UNIT])))
        with self._lock:
            self._parts.append(part)
            if len(self._parts) > _PENDING:
                self._join()

    def displacement(self) -> Displacement:
        """Return the mean displacement of each cell that has points."""
        with self._lock:
            self._join()
            cells, sums = self._parts[0]
        means = sums[:, 1:] / sums[:, :1]
        return Displacement(cells, means[:, :3] * _PLACE_UNIT, means[:, 3:] * _SHIFT_UNIT)

    def _join(self) -> None:
        """Put the sums of the blocks that were noted together."""
        cells, sums = zip(*self._parts, strict=True) if self._parts else ((np.empty(0, np.int64),), (np.empty((0, 7)),))
        numbers, place = np.unique(np.concatenate(cells), return_inverse=True)
        joined = np.zeros((len(numbers), 7))
        np.add.at(joined, place.ravel(), np.concatenate(sums))
        self._parts = [(numbers, joined)]


def _numbers(place: Float) -> Int:
    """Return the numbers (N,) of the cells in plan that places (N, 3), m, are in."""
    cell = np.floor(place[:, :2] / CELL).astype(np.int64) + _OFFSET
    return np.asarray((cell[:, 0] << _SHIFT) | cell[:, 1])


def _sums(numbers: Int, values: Float) -> tuple[Int, Float]:
    """Return the distinct numbers (K,) of N cells, and for each the count and the sums (K, 7) of values (N, 6)."""
    cells, place = np.unique(numbers, return_inverse=True)
    sums = np.empty((len(cells), 7))
    sums[:, 0] = np.bincount(place, minlength=len(cells))
    for column in range(6):
        sums[:, column + 1] = np.bincount(place, values[:, column], len(cells))
    return cells, sums


def _turns(arm: Float) -> Float:
    """Return the displacements (K, 3, 3) of places at arms (K, 3), m, by a small turn about each axis, m/rad."""
    result = np.zeros((len(arm), 3, 3))
    x, y, z = arm.T
    result[:, 1, 0], result[:, 2, 0] = -z, y
    result[:, 0, 1], result[:, 2, 1] = z, -x
    result[:, 0, 2], result[:, 1, 2] = -y, x
    return result


def _rounded(values: Float) -> list[float]:
    """Return values as a list of numbers with 7 digits after the point."""
    return [round(float(value), _DIGITS) for value in values]
