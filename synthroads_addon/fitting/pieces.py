"""Points of a design cut into pieces: the fewest stretches on which a polynomial of low degree passes through them.

A line of points is unrolled first: over the arc length the heading's integral is, near any place, the distance across
from a straight. A line is a polynomial of degree 1 of it, an arc one of degree 2, a clothoid one of degree 3; an error
of a point across the line is the same error there and none elsewhere. Heights over stations need no unrolling: a grade
is of degree 1, a parabola of degree 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.arrays import Float, Int

_QUARTER = 0.3186
"""Quantile of |x| below which a quarter of a normal distribution with standard deviation 1 lies."""
_COSTS = {1: 2.0, 2: 3.0, 3: 3.5}
"""Cost of a piece by its degree: fewer and simpler pieces are preferred. Chosen: about the numbers of their
coefficients."""
_CORE = 0.1
"""Share of a piece's points at either end that its polynomial is not taken from, if enough are left. Chosen: borders
aren't known yet; points near them may be the next piece's."""


class Piece(NamedTuple):
    """Consecutive points on one polynomial.

    Attributes:
        first, last: indices of the first and the last point, both included.
        degree: degree of the polynomial.
        centre: station from which the polynomial's argument counts, m.
        coefficients: (degree + 1,) coefficients of the powers 0, 1, ...
    """

    first: int
    last: int
    degree: int
    centre: float
    coefficients: Float

    def derivative(self, order: int) -> np.polynomial.Polynomial:
        """Return the polynomial (0), or a derivative of it, of the station less the centre."""
        return (
            np.polynomial.Polynomial(self.coefficients).deriv(order)
            if order
            else np.polynomial.Polynomial(self.coefficients)
        )

    def at(self, station: float, order: int = 0) -> float:
        """Return the polynomial, or a derivative of it, at a station (m)."""
        return float(self.derivative(order)(station - self.centre)) if order <= self.degree else 0.0


def unroll_points(points: Float) -> tuple[Float, Float]:
    """Return the arc length (N,) along points (N, 2) and the integral of the heading over it (N,), both in m.

    Between two points the line is taken for the arc that turns by the mean of the angles at both.

    Example:
        >>> import numpy as np
        >>> length, _ = unroll_points(np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]]))
        >>> length.tolist()
        [0.0, 5.0, 10.0]
    """
    chord_vectors = np.diff(points, axis=0)
    chord = np.hypot(*chord_vectors.T)
    heading = np.unwrap(np.arctan2(chord_vectors[:, 1], chord_vectors[:, 0]))
    turn = np.diff(heading)
    share = chord[:-1] / (chord[:-1] + chord[1:])
    chord_turns = np.zeros(len(chord))  # turn along each chord
    if len(turn):
        chord_turns[:-1] += turn * share
        chord_turns[1:] += turn * (1.0 - share)
        chord_turns[[0, -1]] = 2.0 * chord_turns[[0, -1]] if len(chord) > 1 else 0.0
    half_turn = np.clip(0.5 * chord_turns, -1.0, 1.0)
    length = chord / np.sinc(half_turn / np.pi)
    station = np.concatenate([[0.0], np.cumsum(length)])
    return station, np.concatenate([[0.0], np.cumsum((heading - heading[0]) * length)])


def noise_std(station: Float, values: Float, degree: int) -> float:
    """Return the standard deviation (m) of white noise in values (N,) that lie on polynomials of a degree, piecewise.

    It is estimated from the lower quartile of the divided differences of the next degree: those over a border of two
    pieces are larger. 0 with too few points.

    Example:
        >>> import numpy as np
        >>> station = np.arange(0.0, 400.0, 2.0)
        >>> noise = np.random.default_rng(1).normal(0.0, 0.02, len(station))
        >>> round(noise_std(station, 1e-4 * station**2 + noise, degree=2), 2)
        0.02
    """
    order = degree + 1
    if len(values) < 2 * order:
        return 0.0
    window = np.lib.stride_tricks.sliding_window_view
    window_stations = window(station, order + 1)
    gaps = window_stations[:, :, None] - window_stations[:, None, :]
    gaps[:, np.arange(order + 1), np.arange(order + 1)] = 1.0
    # Divided difference of order n: sum of y_i / prod_{j != i} (s_i - s_j), here with weights of unit norm.
    weights = 1.0 / gaps.prod(axis=2)
    weights /= np.sqrt((weights**2).sum(axis=1))[:, None]
    difference = np.abs((weights * window(values, order + 1)).sum(axis=1))
    return float(np.quantile(difference, 0.25)) / _QUARTER


def cut_into_pieces(station: Float, values: Float, degrees: Sequence[int], tolerance: float) -> list[Piece]:
    """Return the cheapest pieces that values (N,) lie on within a tolerance, each point in one of them.

    Args:
        station: (N,) increasing, m.
        values: (N,) m.
        degrees: degrees of polynomials that are allowed, increasing.
        tolerance: largest distance of a value from its piece's polynomial, m.
    """
    count = len(values)
    reach = {degree: _reach(station, values, degree, tolerance) for degree in degrees}
    least_cost = np.full(count + 1, np.inf)
    least_cost[0] = 0.0
    origin, kind = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    for first_point in range(count):
        for degree in degrees:
            end = int(reach[degree][first_point]) + 1
            end_points = slice(first_point + 1, end + 1)
            cost = least_cost[first_point] + _COSTS[degree]
            is_cheaper = least_cost[end_points] > cost + 1e-9
            least_cost[end_points][is_cheaper] = cost
            origin[end_points][is_cheaper] = first_point
            kind[end_points][is_cheaper] = degree
    pieces: list[Piece] = []
    end = count
    while end > 0:
        first_point = int(origin[end])
        pieces.append(_piece(station, values, first_point, end - 1, int(kind[end])))
        end = first_point
    return pieces[::-1]


def _reach(station: Float, values: Float, degree: int, tolerance: float) -> Int:
    """Return for each point (N,) the index of the last one up to which all lie on one polynomial within a tolerance, m.

    The step of the search doubles while points fit and is quartered where they don't.
    """
    count = len(values)
    ends = np.empty(count, np.int64)
    last_point = 0
    for first_point in range(count):
        last_point = max(last_point, min(first_point + degree, count - 1))
        step = 1
        while last_point < count - 1:
            trial = min(last_point + step, count - 1)
            if _fits(station[first_point : trial + 1], values[first_point : trial + 1], degree, tolerance):
                last_point, step = trial, 2 * step
            elif step == 1:
                break
            else:
                step = max(1, step // 4)
        ends[first_point] = last_point
    return ends


def _fits(station: Float, values: Float, degree: int, tolerance: float) -> bool:
    """Return whether values (N,) lie within a tolerance, m, of their least-squares polynomial of a degree."""
    matrix = _powers(station, degree)
    q, _ = np.linalg.qr(matrix)
    residuals = values - values[0]
    residuals = residuals - q @ (q.T @ residuals)
    return bool(np.abs(residuals).max() <= tolerance)


def _powers(station: Float, degree: int) -> Float:
    """Return powers (N, degree + 1) of stations scaled to -1 to 1."""
    half_length = 0.5 * (station[-1] - station[0])
    scaled_stations = (station - station[0]) / half_length - 1.0 if half_length > 0.0 else np.zeros(len(station))
    return np.vander(scaled_stations, degree + 1, increasing=True)


def _piece(station: Float, values: Float, first_point: int, last_point: int, degree: int) -> Piece:
    """Return the piece of a degree over points from a first to a last one, fitted to those away from its ends."""
    trim = int(_CORE * (last_point - first_point + 1)) if last_point - first_point + 1 > 3 * (degree + 1) else 0
    part = slice(first_point + trim, last_point + 1 - trim)
    inner_stations, inner_values = station[part], values[part]
    half_length = max(0.5 * float(inner_stations[-1] - inner_stations[0]), 1e-9)
    centre = 0.5 * float(inner_stations[-1] + inner_stations[0])
    matrix = np.vander((inner_stations - centre) / half_length, degree + 1, increasing=True)
    scaled_coefficients = np.linalg.lstsq(matrix, inner_values, rcond=None)[0]
    return Piece(first_point, last_point, degree, centre, scaled_coefficients / half_length ** np.arange(degree + 1))


def border_between(piece_before: Piece, piece_after: Piece, earliest: float, latest: float) -> float:
    """Return the station (m), between two limits, at which two pieces meet: where their highest derivatives agree.

    At a border one derivative less than the degree agrees; if no such station lies between the limits the next lower
    derivative decides, and at last the middle is taken.
    """
    middle = 0.5 * (earliest + latest)
    for order in range(max(piece_before.degree, piece_after.degree) - 1, -1, -1):
        slope = piece_before.at(middle, order + 1) - piece_after.at(middle, order + 1)
        if slope != 0.0:
            station = middle - (piece_before.at(middle, order) - piece_after.at(middle, order)) / slope
            if earliest <= station <= latest:
                return station
    return middle
