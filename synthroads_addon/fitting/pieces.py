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
        first, last: their indices, both included.
        degree: of the polynomial.
        centre: station that its coefficients count from, m.
        coefficients: (degree + 1,) of the powers 0, 1, ...
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


def unrolled(points: Float) -> tuple[Float, Float]:
    """Return the arc length (N,) along points (N, 2) and the integral of the heading over it (N,), both in m.

    Between two points the line is taken for the arc that turns by the mean of the angles at both.

    Example:
        >>> import numpy as np
        >>> length, _ = unrolled(np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]]))
        >>> length.tolist()
        [0.0, 5.0, 10.0]
    """
    move = np.diff(points, axis=0)
    chord = np.hypot(*move.T)
    heading = np.unwrap(np.arctan2(move[:, 1], move[:, 0]))
    turn = np.diff(heading)
    share = chord[:-1] / (chord[:-1] + chord[1:])
    around = np.zeros(len(chord))  # turn along each chord
    if len(turn):
        around[:-1] += turn * share
        around[1:] += turn * (1.0 - share)
        around[[0, -1]] = 2.0 * around[[0, -1]] if len(chord) > 1 else 0.0
    half = np.clip(0.5 * around, -1.0, 1.0)
    length = chord / np.sinc(half / np.pi)
    station = np.concatenate([[0.0], np.cumsum(length)])
    return station, np.concatenate([[0.0], np.cumsum((heading - heading[0]) * length)])


def noise_of(station: Float, values: Float, degree: int) -> float:
    """Return the standard deviation (m) of white noise in values (N,) of polynomials of a degree, piece by piece.

    It is told by the least quarter of the divided differences of the next degree: those over a border of two pieces
    are larger. 0 with too few points.

    Example:
        >>> import numpy as np
        >>> station = np.arange(0.0, 400.0, 2.0)
        >>> noise = np.random.default_rng(1).normal(0.0, 0.02, len(station))
        >>> round(noise_of(station, 1e-4 * station**2 + noise, degree=2), 2)
        0.02
    """
    order = degree + 1
    if len(values) < 2 * order:
        return 0.0
    window = np.lib.stride_tricks.sliding_window_view
    places = window(station, order + 1)
    gaps = places[:, :, None] - places[:, None, :]
    gaps[:, np.arange(order + 1), np.arange(order + 1)] = 1.0
    weights = 1.0 / gaps.prod(axis=2)  # of a divided difference
    weights /= np.sqrt((weights**2).sum(axis=1))[:, None]
    difference = np.abs((weights * window(values, order + 1)).sum(axis=1))
    return float(np.quantile(difference, 0.25)) / _QUARTER


def cut_into_pieces(station: Float, values: Float, degrees: Sequence[int], tolerance: float) -> list[Piece]:
    """Return the cheapest pieces that values (N,) lie on within a tolerance, each point in one of them.

    Args:
        station: (N,) increasing, m.
        values: (N,) m.
        degrees: allowed, increasing.
        tolerance: largest distance of a value from its piece's polynomial, m.
    """
    count = len(values)
    reach = {degree: _reach(station, values, degree, tolerance) for degree in degrees}
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    origin, kind = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    for first in range(count):
        for degree in degrees:
            end = int(reach[degree][first]) + 1
            part = slice(first + 1, end + 1)
            cost = best[first] + _COSTS[degree]
            better = best[part] > cost + 1e-9
            best[part][better] = cost
            origin[part][better] = first
            kind[part][better] = degree
    pieces: list[Piece] = []
    end = count
    while end > 0:
        first = int(origin[end])
        pieces.append(_piece(station, values, first, end - 1, int(kind[end])))
        end = first
    return pieces[::-1]


def _reach(station: Float, values: Float, degree: int, tolerance: float) -> Int:
    """Return for each point (N,) the last one up to which all lie on one polynomial within a tolerance."""
    count = len(values)
    ends = np.empty(count, np.int64)
    last = 0
    for first in range(count):
        last = max(last, min(first + degree, count - 1))
        step = 1
        while last < count - 1:
            trial = min(last + step, count - 1)
            if _fits(station[first : trial + 1], values[first : trial + 1], degree, tolerance):
                last, step = trial, 2 * step
            elif step == 1:
                break
            else:
                step = max(1, step // 4)
        ends[first] = last
    return ends


def _fits(station: Float, values: Float, degree: int, tolerance: float) -> bool:
    matrix = _powers(station, degree)
    q, _ = np.linalg.qr(matrix)
    rest = values - values[0]
    rest = rest - q @ (q.T @ rest)
    return bool(np.abs(rest).max() <= tolerance)


def _powers(station: Float, degree: int) -> Float:
    """Return powers (N, degree + 1) of stations scaled to -1 to 1."""
    half = 0.5 * (station[-1] - station[0])
    scaled = (station - station[0]) / half - 1.0 if half > 0.0 else np.zeros(len(station))
    return np.vander(scaled, degree + 1, increasing=True)


def _piece(station: Float, values: Float, first: int, last: int, degree: int) -> Piece:
    spare = int(_CORE * (last - first + 1)) if last - first + 1 > 3 * (degree + 1) else 0
    part = slice(first + spare, last + 1 - spare)
    place, there = station[part], values[part]
    half = max(0.5 * float(place[-1] - place[0]), 1e-9)
    centre = 0.5 * float(place[-1] + place[0])
    matrix = np.vander((place - centre) / half, degree + 1, increasing=True)
    scaled = np.linalg.lstsq(matrix, there, rcond=None)[0]
    return Piece(first, last, degree, centre, scaled / half ** np.arange(degree + 1))


def border_between(before: Piece, after: Piece, low: float, high: float) -> float:
    """Return the station (m) between low and high at which two pieces meet: where they bend alike, else run alike.

    Polynomials that first differ in their highest derivative have one less at their border in common.
    """
    middle = 0.5 * (low + high)
    for order in range(max(before.degree, after.degree) - 1, -1, -1):
        slope = before.at(middle, order + 1) - after.at(middle, order + 1)
        if slope != 0.0:
            station = middle - (before.at(middle, order) - after.at(middle, order)) / slope
            if low <= station <= high:
                return station
    return middle
