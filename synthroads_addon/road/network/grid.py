"""Surfaces of roads as grids of points: rows across the road, columns along it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Bool, Float, Int
from ..alignment import Alignment

FILM = 0.003
"""Thickness of markings, m; as of a parameter set's other markings where nothing else is said."""
_NEWTON = 12
"""Rounds in which a place beside an axis is looked for; each leaves about the square of the last one's error."""


@dataclass(frozen=True)
class SurfaceGrid:
    """A road's pavement and verges as a grid.

    Attributes:
        points: (R, C, 3) local, m; columns from left to right.
        station: (R, C) along the road's own axis, m.
        offset: (R, C) from it, positive to the left, m.
        kinds: of the C - 1 strips between two columns: ``pavement`` or ``verge``.
        built: (R - 1, C - 1) whether a cell has a surface.
        paint: (R - 1, C - 1) whether it is painted.
    """

    points: Float
    station: Float
    offset: Float
    kinds: tuple[str, ...]
    built: Bool
    paint: Bool

    def quads(self, kind: str) -> Int:
        """Return the corners (Q, 4) of the cells of a kind, or ``paint``, anticlockwise from above."""
        rows, columns = self.station.shape
        mask = self.paint if kind == "paint" else self.built & (np.array(self.kinds) == kind)[None, :]
        first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1))[mask]
        return np.stack([first, first + 1, first + columns + 1, first + columns], axis=1)

    def outline(self) -> Float:
        """Return the points (N, 3) around the grid, anticlockwise, where every cell of it has a surface."""
        p = self.points
        return np.concatenate([p[0, :-1], p[:-1, -1], p[-1, :0:-1], p[:0:-1, 0]])


def axis_coordinates(axis: Alignment, points: Float, near: Float) -> tuple[Float, Float]:
    """Return stations and offsets (N,) of points (N, 2) from stations (N,) near them, also beyond the axis's ends."""
    station, across = near.astype(np.float64).copy(), np.zeros(near.shape)
    for _ in range(_NEWTON):
        position, heading, curvature = axis.frame(station)
        vector = points - position
        along = vector[:, 0] * np.cos(heading) + vector[:, 1] * np.sin(heading)
        across = -vector[:, 0] * np.sin(heading) + vector[:, 1] * np.cos(heading)
        station = station + along / np.maximum(1.0 - curvature * across, 0.2)
    return station, across


def smooth_share(value: Float) -> Float:
    """Return a share (N,) that grows from 0 to 1 without kinks as values (N,) do."""
    value = np.clip(value, 0.0, 1.0)
    return value * value * (3.0 - 2.0 * value)


def spans_mask(station: Float, spans: list[tuple[float, float]]) -> Bool:
    """Return whether the middles between neighbouring stations (N,) lie in any of the spans (m): (N - 1,)."""
    middle = (station[1:] + station[:-1]) / 2.0
    result = np.zeros(middle.shape, dtype=bool)
    for start, end in spans:
        result |= (middle > start) & (middle < end)
    return result


def dashes(start: float, end: float, dash: float, gap: float) -> Iterator[tuple[float, float]]:
    """Yield the begin and the end of each dash (m) of a line between two stations (m)."""
    begin = start
    while begin < end - 1e-6:
        yield begin, min(begin + dash, end)
        begin += dash + gap
