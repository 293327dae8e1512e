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
"""Distance, m, from the chord of its neighbours up to which a point is no corner (chosen)."""
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
    """Return a polyline within a tolerance of a function that is smooth between breaks (B,), m."""
    # Where the function jumps at a break, the polyline goes over to the new value within `STEP`.
    stations, values, jumps = list[float](), list[Float](), list[tuple[float, float]]()
    for stretch, (start, end) in enumerate(itertools.pairwise(breaks.tolist())):
        corner_stations = _corner_stations(function, stretch, (start, end), tolerance)
        corner_values = function(corner_stations, stretch)
        if stations:
            jump = float(np.abs(corner_values[0] - values[-1]).max())
            if jump > JUMP:
                jumps.append((start, jump))
                step_end = start + min(STEP, 0.5 * (end - start))
                is_behind_step = corner_stations > step_end + 1e-9
                corner_stations = np.concatenate([[step_end], corner_stations[is_behind_step]])
                corner_values = np.concatenate([function(np.array([step_end]), stretch), corner_values[is_behind_step]])
            else:
                values[-1] = 0.5 * (values[-1] + corner_values[0])
                corner_stations, corner_values = corner_stations[1:], corner_values[1:]
        stations += corner_stations.tolist()
        values += list(corner_values)
    return Polyline(np.array(stations), np.array(values), np.array(jumps).reshape(-1, 2))


def _corner_stations(function: Between, stretch_number: int, stretch: tuple[float, float], tolerance: float) -> Float:
    """Return stations (N,) of a stretch, m, between which chords keep within a tolerance, by halving."""
    start, end = stretch
    begin, length, stations = np.array([start]), np.array([end - start]), [np.array([start, end])]
    # In each round all intervals that still are off are halved together.
    while len(begin):
        samples = begin[:, None] + length[:, None] * _SHARES
        values = function(samples.ravel(), stretch_number).reshape(len(begin), len(_SHARES), -1)
        chord = values[:, :1] + _SHARES[:, None] * (values[:, -1:] - values[:, :1])
        is_off = (np.abs(values - chord).max(axis=(1, 2)) > tolerance) & (length > 2.0 * _SHORTEST)
        half_length = 0.5 * length[is_off]
        middle = begin[is_off] + half_length
        stations.append(middle)
        begin, length = np.concatenate([begin[is_off], middle]), np.concatenate([half_length, half_length])
    return np.unique(np.concatenate(stations))


def corners(stations: Float, values: Float, tolerance: float = STRAIGHT) -> list[tuple[float, float]]:
    """Return (station, value) of a polyline's corners; of a constant one its first point alone.

    Args:
        stations, values: (N,) of the polyline.
        tolerance: distance of a corner from the chord of its neighbours up to which it is none.
    """
    if np.ptp(values) <= tolerance:
        return [(float(stations[0]), float(np.median(values)))]
    corner_rows = [0]
    for n in range(1, len(stations) - 1):
        corner = corner_rows[-1]
        rows_between = np.arange(corner + 1, n + 1)
        share = (stations[rows_between] - stations[corner]) / (stations[n + 1] - stations[corner])
        chord = values[corner] + share * (values[n + 1] - values[corner])
        if np.abs(values[rows_between] - chord).max() > tolerance:
            corner_rows.append(n)
    corner_rows.append(len(stations) - 1)
    return [(float(stations[n]), float(values[n])) for n in corner_rows]


def rounded_points(points: Sequence[tuple[float, float]], digits: int = 9) -> list[tuple[float, float]]:
    """Return (station, value) with rounded stations, without points whose station isn't larger than the one before."""
    rows: list[tuple[float, float]] = []
    for station, value in points:
        rounded_station = round_value(station, digits)
        if not rows or rounded_station > rows[-1][0]:
            rows.append((rounded_station, value))
    return rows


def height_pieces(function: Callable[[Float, int], Float], breaks: Float, tolerance: float) -> list[HeightPiece]:
    """Return cubics (m) near heights (N,) at stations (N,) of a stretch, each as long as it keeps within a tolerance.

    Each begins where the one before ends, and with its grade where the heights have no kink there. Stretches are joined
    where one cubic holds for several.
    """
    stations = [np.linspace(a, b, _SAMPLES) for a, b in itertools.pairwise(breaks.tolist())]
    heights = [function(samples, number) for number, samples in enumerate(stations)]
    pieces: list[HeightPiece] = []

    def fitted(samples: Sequence[Float], height: Sequence[Float]) -> tuple[HeightPiece, float]:
        """Return a piece near heights at stations, smooth behind the last piece if it can be, and its deviation, m."""
        if pieces:
            previous_piece = pieces[-1]
            level, grade = previous_piece.elevation_at(previous_piece.end), previous_piece.grade_at(previous_piece.end)
            smooth_fit = _fitted(samples, height, level, grade, tolerance)
            return smooth_fit if smooth_fit[1] <= tolerance else _fitted(samples, height, level, None, tolerance)
        return _fitted(samples, height, float(heights[0][0]), None, tolerance)

    begin = 0
    while begin < len(stations):
        stop = begin + 1
        piece, deviation = fitted(stations[begin:stop], heights[begin:stop])
        if deviation > tolerance and breaks[stop] - breaks[begin] > 1.0:  # no cubic follows it: in parts
            part_ends = np.linspace(breaks[begin], breaks[stop], 2 + int(breaks[stop] - breaks[begin]) // 5)
            for start, end in itertools.pairwise(part_ends.tolist()):
                samples = np.linspace(start, end, _SAMPLES)
                pieces.append(fitted([samples], [function(samples, begin)])[0])
            begin = stop
            continue
        while stop < len(stations):
            longer_piece, deviation = fitted(stations[begin : stop + 1], heights[begin : stop + 1])
            if deviation > tolerance:
                break
            piece, stop = longer_piece, stop + 1
        pieces.append(piece)
        begin = stop
    return pieces


def _fitted(
    stations: Sequence[Float], heights: Sequence[Float], level: float, grade: float | None, tolerance: float
) -> tuple[HeightPiece, float]:
    """Return the polynomial of the lowest degree (1 to 3) within a tolerance of heights, and its largest deviation, m.

    The polynomial begins at a level (m) and, where `grade` (m/m) isn't None, with that grade.
    """
    station, height = np.concatenate(stations), np.concatenate(heights)
    length = float(station[-1] - station[0])
    u, deviation, coefficients = (station - station[0]) / length, np.inf, np.zeros(3)
    linear_term = np.zeros(0) if grade is None else np.array([grade * length])
    remainder = height - level - (0.0 if grade is None else grade * length * u)
    for degree in range(1, 4):
        powers = u[:, None] ** np.arange(1 + len(linear_term), degree + 1)
        solution = np.linalg.lstsq(powers, remainder, rcond=None)[0] if powers.shape[1] else np.zeros(0)
        deviation = float(np.abs(powers @ solution - remainder).max())
        coefficients = np.concatenate([linear_term, solution, np.zeros(3 - degree)])
        if deviation <= tolerance:
            break
    slope, square, cube = (coefficients / length ** np.arange(1, 4)).tolist()
    return HeightPiece(float(station[0]), float(station[-1]), level, slope, square, cube), deviation
