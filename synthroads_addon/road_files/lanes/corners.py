"""Polylines by station that keep near functions which are smooth between breaks and may jump there."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.turnout_geometry import STEP
from ..heights import HeightPiece

JUMP = 2e-4
"""Values that differ by more than this, m, on both sides of a break jump there."""
_SHARES = np.array([0.0, 0.21, 0.5, 0.77, 1.0])
_SHORTEST = 0.05
STRAIGHT = 1e-5
"""Distance, m, of a corner from the chord of its neighbours up to which it is none."""
_SAMPLES = 9
Between = Callable[[Float, int], Float]
"""Values (N, K) at stations (N,) of the stretch with a number."""


@dataclass(frozen=True)
class Polyline:
    """Values by station, linear in between.

    Attributes:
        stations: (N,) increasing, m.
        values: (N, K).
        jumps: (J, 2) stations at which they jump, and the largest jump there, m.
    """

    stations: Float
    values: Float
    jumps: Float

    def at(self, station: Float) -> Float:
        """Return the values (N, K) at stations (N,), m."""
        columns = [np.interp(station, self.stations, column) for column in self.values.T]
        return np.stack(columns, axis=-1)


def polyline(function: Between, breaks: Float, tolerance: float) -> Polyline:
    """Return a polyline that keeps within a tolerance of a function; where that jumps it does so over `STEP`."""
    stations, values, jumps = list[float](), list[Float](), list[tuple[float, float]]()
    for number, (start, end) in enumerate(itertools.pairwise(breaks.tolist())):
        at = _corner_stations(function, number, (start, end), tolerance)
        samples = function(at, number)
        if stations:
            jump = float(np.abs(samples[0] - values[-1]).max())
            if jump > JUMP:
                jumps.append((start, jump))
                begin = start + min(STEP, 0.5 * (end - start))
                kept = at > begin + 1e-9
                at = np.concatenate([[begin], at[kept]])
                samples = np.concatenate([function(np.array([begin]), number), samples[kept]])
            else:
                values[-1] = 0.5 * (values[-1] + samples[0])
                at, samples = at[1:], samples[1:]
        stations += at.tolist()
        values += list(samples)
    return Polyline(np.array(stations), np.array(values), np.array(jumps).reshape(-1, 2))


def _corner_stations(function: Between, number: int, stretch: tuple[float, float], tolerance: float) -> Float:
    start, end = stretch
    begin, length, stations = np.array([start]), np.array([end - start]), [np.array([start, end])]
    while len(begin):
        at = begin[:, None] + length[:, None] * _SHARES
        values = function(at.ravel(), number).reshape(len(begin), len(_SHARES), -1)
        chord = values[:, :1] + _SHARES[:, None] * (values[:, -1:] - values[:, :1])
        wrong = (np.abs(values - chord).max(axis=(1, 2)) > tolerance) & (length > 2.0 * _SHORTEST)
        half = 0.5 * length[wrong]
        middle = begin[wrong] + half
        stations.append(middle)
        begin, length = np.concatenate([begin[wrong], middle]), np.concatenate([half, half])
    return np.unique(np.concatenate(stations))


def corners(stations: Float, values: Float, straight: float = STRAIGHT) -> list[tuple[float, float]]:
    """Return (station, value) of a polyline's corners; of a constant one its first point alone.

    Args:
        stations, values: (N,) of the polyline.
        straight: distance of a corner from the chord of its neighbours up to which it is none.
    """
    if np.ptp(values) <= straight:
        return [(float(stations[0]), float(np.median(values)))]
    kept = [0]
    for n in range(1, len(stations) - 1):
        first = kept[-1]
        inner = np.arange(first + 1, n + 1)
        share = (stations[inner] - stations[first]) / (stations[n + 1] - stations[first])
        chord = values[first] + share * (values[n + 1] - values[first])
        if np.abs(values[inner] - chord).max() > straight:
            kept.append(n)
    kept.append(len(stations) - 1)
    return [(float(stations[n]), float(values[n])) for n in kept]


def rounded_points(points: Sequence[tuple[float, float]], digits: int = 9) -> list[tuple[float, float]]:
    """Return (station, value) with rounded stations, without those that fall on the one before so."""
    rows: list[tuple[float, float]] = []
    for station, value in points:
        at = round_value(station, digits)
        if not rows or at > rows[-1][0]:
            rows.append((at, value))
    return rows


def height_pieces(function: Callable[[Float, int], Float], breaks: Float, tolerance: float) -> list[HeightPiece]:
    """Return cubics (m) near heights (N,) at stations (N,) of a stretch, each as long as it keeps within a tolerance.

    Each begins where the one before ends, and with its grade where the heights have no kink there. Stretches are joined
    where one cubic holds for several.
    """
    stations = [np.linspace(a, b, _SAMPLES) for a, b in itertools.pairwise(breaks.tolist())]
    heights = [function(at, number) for number, at in enumerate(stations)]
    pieces: list[HeightPiece] = []

    def fitted(at: Sequence[Float], height: Sequence[Float]) -> tuple[HeightPiece, float]:
        if pieces:
            before = pieces[-1]
            level, grade = before.elevation_at(before.end), before.grade_at(before.end)
            smooth = _fitted(at, height, level, grade, tolerance)
            return smooth if smooth[1] <= tolerance else _fitted(at, height, level, None, tolerance)
        return _fitted(at, height, float(heights[0][0]), None, tolerance)

    first = 0
    while first < len(stations):
        last = first + 1
        piece, off = fitted(stations[first:last], heights[first:last])
        if off > tolerance and breaks[last] - breaks[first] > 1.0:  # no cubic follows it: in parts
            parts = np.linspace(breaks[first], breaks[last], 2 + int(breaks[last] - breaks[first]) // 5)
            for start, end in itertools.pairwise(parts.tolist()):
                at = np.linspace(start, end, _SAMPLES)
                pieces.append(fitted([at], [function(at, first)])[0])
            first = last
            continue
        while last < len(stations):
            longer, off = fitted(stations[first : last + 1], heights[first : last + 1])
            if off > tolerance:
                break
            piece, last = longer, last + 1
        pieces.append(piece)
        first = last
    return pieces


def _fitted(
    stations: Sequence[Float], heights: Sequence[Float], level: float, grade: float | None, tolerance: float
) -> tuple[HeightPiece, float]:
    """Return the polynomial of the lowest degree near heights (m), and how far it is off, m.

    It begins at a level (m), and with a grade (m/m) if one is given.
    """
    at, height = np.concatenate(stations), np.concatenate(heights)
    length = float(at[-1] - at[0])
    u, worst, best = (at - at[0]) / length, np.inf, np.zeros(3)
    given = np.zeros(0) if grade is None else np.array([grade * length])
    rest = height - level - (0.0 if grade is None else grade * length * u)
    for degree in range(1, 4):
        powers = u[:, None] ** np.arange(1 + len(given), degree + 1)
        solved = np.linalg.lstsq(powers, rest, rcond=None)[0] if powers.shape[1] else np.zeros(0)
        worst = float(np.abs(powers @ solved - rest).max())
        best = np.concatenate([given, solved, np.zeros(3 - degree)])
        if worst <= tolerance:
            break
    rise, square, cube = (best / length ** np.arange(1, 4)).tolist()
    return HeightPiece(float(at[0]), float(at[-1]), level, rise, square, cube), worst
