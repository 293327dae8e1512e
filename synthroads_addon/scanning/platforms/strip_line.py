"""One strip's line in plan, by the distance travelled, and functions of that distance without jerks."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.rotations import wrap_angle
from .guides import Guide

FOLD = 0.98
"""An offset may use up to this share of the radius: beyond it the offset line would turn back on itself. Chosen: beyond
it the path hardly moves while the guide goes on."""

_CELL = 1.0
"""Length of a cell of a track's table, m. Chosen: the offset line's length is smooth within."""
_BLOCK = 65_536
"""Cells, or places, that are evaluated at a time. Chosen: bounds memory."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
"""Gauss and Legendre's rule of four nodes on -1 to 1, exact for polynomials of degree 7."""


@dataclass(frozen=True)
class Sway:
    """A zigzag by station: a triangular wave with rounded turning points; 0 and rising to the left at station 0.

    Around a turning point the slope goes over from one leg's to the other's as a sine, along `ROUNDED` of the
    wavelength, so that slope and curvature are continuous.

    Attributes:
        amplitude: to either side, m, which the rounded turning points reach.
        wavelength: along the guide, m.
    """

    amplitude: float
    wavelength: float

    ROUNDED: ClassVar[float] = 0.2

    @property
    def slope(self) -> float:
        """Return the slope of the zigzag's straight legs, offset over station, m/m."""
        return self.amplitude / self.wavelength / (0.25 - self.ROUNDED * (0.5 - 1.0 / np.pi))

    def at(self, station: Float) -> tuple[Float, Float]:
        """Return the zigzag's offset (K,), m, and slope (K,), m/m, at stations (K,), m."""
        phase = station / self.wavelength
        nearest = np.round(2.0 * phase - 0.5)  # turning point: even ones to the left, odd ones to the right
        side = np.where(np.mod(nearest, 2.0) == 0.0, 1.0, -1.0)
        before = (phase - (nearest + 0.5) / 2.0) / self.ROUNDED  # from the turning point, in lengths of its rounding
        within = np.clip(before, -0.5, 0.5)
        fall = self.ROUNDED * (1.0 - np.cos(np.pi * within)) / np.pi + self.ROUNDED * (np.abs(before) - np.abs(within))
        offset = side * (self.amplitude - self.slope * self.wavelength * fall)
        return offset, -side * self.slope * np.sin(np.pi * within)


@dataclass(frozen=True)
class _Table:
    """Stations, distances, rates and courses at the borders of C cells along a track, to look up and interpolate.

    Attributes:
        station, distance: (C + 1,) of the cells' borders, m.
        rate: (C, 2) stations per distance at a cell's beginning and end.
        course: (C, 2) direction at a cell's beginning and end, rad.
    """

    station: Float
    distance: Float
    rate: Float
    course: Float


class StripTrack:
    """A line at an offset beside a guide, parametrised by the distance travelled along it.

    Every place lies exactly beside the guide. The station at a distance is interpolated by cubics in a table whose
    distances come from Gauss-Legendre quadrature.

    Attributes:
        length: of the track, m.

    Args:
        guide: what it follows.
        offset: from the guide, m, positive to the left.
        sway: added to the offset, if any.
        forward: with the stations, or against them.
        field: name of the offset, for messages.

    Raises:
        InputError: the track would turn back on itself at a bend.
    """

    def __init__(self, guide: Guide, offset: float, sway: Sway | None, forward: bool, field: str) -> None:
        self.guide, self.offset, self.sway, self.forward = guide, offset, sway, forward
        self._field = field
        self._table = self._build()
        self.length = float(self._table.distance[-1])

    def offsets(self, station: Float) -> tuple[Float, Float]:
        """Return offsets (K,) from the guide, m, and their slopes (K,) at stations (K,)."""
        if self.sway is None:
            return np.full(station.shape, self.offset), np.zeros(station.shape)
        sway, slope = self.sway.at(station)
        return self.offset + sway, slope

    def stations(self, distance: Float) -> Float:
        """Return the guide's stations (K,), m, at distances travelled (K,), m, from 0 to `length`."""
        table = self._table
        run = distance if self.forward else self.length - distance
        cell = np.clip(np.searchsorted(table.distance, run, side="right") - 1, 0, len(table.rate) - 1)
        size = table.distance[cell + 1] - table.distance[cell]
        # Cubic Hermite interpolation: p0 + t (m0 + t (3 d - 2 m0 - m1 + t (m0 + m1 - 2 d))), d = p1 - p0.
        t = (run - table.distance[cell]) / size
        before, after = table.station[cell], table.station[cell + 1]
        (start, end), rise = table.rate[cell].T * size, after - before
        return np.asarray(before + t * (start + t * (3.0 * rise - 2.0 * start - end + t * (start + end - 2.0 * rise))))

    def place(self, distance: Float) -> tuple[Float, Float, Float, Float]:
        """Return plan position (K, 2), course (K,) rad, station (K,) and offset (K,) at distances 0 to `length`.

        The course is the direction of travel; it isn't wrapped, but may differ by whole turns between calls.
        """
        station = self.stations(distance)
        plan, heading, along, across, offset = self._frame(station)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        course = heading + np.arctan2(across, along) + (0.0 if self.forward else np.pi)
        return plan + offset[:, None] * left, course, station, offset

    @cached_property
    def bend(self) -> tuple[float, float]:
        """Return the largest curvature, 1/m, and the largest jump of the course, rad; computed once."""
        table = self._table
        turn = np.abs(wrap_angle(table.course[:, 1] - table.course[:, 0])) / np.diff(table.distance)
        jump = np.abs(wrap_angle(table.course[1:, 0] - table.course[:-1, 1]))
        return float(turn.max()), float(jump.max(initial=0.0))

    def _frame(self, station: Float) -> tuple[Float, Float, Float, Float, Float]:
        """Return plan and heading of the guide, the track's advance along and across it by station, and its offset."""
        plan, heading, curvature, stretch = self.guide.frame(station)
        offset, slope = self.offsets(station)
        # A line at an offset n beside curvature kappa is (1 - kappa n) times as long.
        lever = 1.0 - curvature * offset
        self._refuse_fold(station, offset, curvature, lever)
        return plan, heading, stretch * lever, slope, offset

    def _refuse_fold(self, station: Float, offset: Float, curvature: Float, lever: Float) -> None:
        if not len(lever) or lever.min() >= 1.0 - FOLD:
            return
        worst = int(lever.argmin())
        side = "left" if curvature[worst] > 0.0 else "right"
        radius = 1.0 / abs(float(curvature[worst]))
        allowed = (
            f"at most {FOLD * radius:.2f} m to the {side} are possible at station {station[worst]:.1f} m, where the"
            f" radius is {radius:.2f} m: beyond it the path would turn back"
        )
        raise InputError(self._field, float(offset[worst]), allowed)

    def _build(self) -> _Table:
        station = self._borders()
        # The cell ends just before a break: there the curvature is still that of the element before.
        before, after = station[:-1], np.nextafter(station[1:], -np.inf)  # curvature on this side of a break
        distance, rate, course = np.zeros(len(station)), np.empty((len(before), 2)), np.empty((len(before), 2))
        for start in range(0, len(before), _BLOCK):
            cells = slice(start, start + _BLOCK)
            half = np.diff(station)[cells] / 2.0
            at = (before[cells] + half) + half * _NODES[:, None]
            _, _, along, across, _ = self._frame(at.ravel())
            distance[1:][cells] = half * (_WEIGHTS @ np.hypot(along, across).reshape(at.shape))
            for end, border in enumerate((before[cells], after[cells])):
                _, heading, along, across, _ = self._frame(border)
                rate[cells, end] = 1.0 / np.hypot(along, across)
                course[cells, end] = heading + np.arctan2(across, along)
        return _Table(station, np.cumsum(distance), rate, course)

    def _borders(self) -> Float:
        """Return the stations of the cells' borders: evenly spaced, and at the guide's breaks."""
        size = min(_CELL, self.sway.wavelength / 100.0) if self.sway else _CELL
        length = self.guide.length
        count = int(np.ceil(length / size))
        even = np.arange(count + 1) * (length / count)
        even[-1] = length
        breaks = self.guide.breaks
        breaks = breaks[(breaks > 1e-6) & (breaks < length - 1e-6)]
        breaks = breaks[np.concatenate(([True], np.diff(breaks) > 1e-9))[: len(breaks)]]
        if len(breaks):
            after = np.minimum(np.searchsorted(breaks, even), len(breaks) - 1)
            near = np.minimum(np.abs(breaks[after] - even), np.abs(breaks[np.maximum(after - 1, 0)] - even))
            even = even[near > 1e-6]
        return np.sort(np.concatenate((even, breaks)))


Function = Callable[[Float], Float]
"""Of distances (K,) from 0 to the length: values (K, C)."""


class EasedFunction:
    """A function of the distance, sampled at even steps and interpolated smoothly by Catmull-Rom cubics.

    What is quadratic in the distance (grades, parabolas, the heading along straights, arcs and clothoids) is kept
    exactly; where slope or curvature jump, the jump is spread over two steps to either side. So rates are continuous
    and accelerations bounded. Beyond the ends a function goes on straight.

    Args:
        function: what to ease.
        length: largest distance, m.
        step: m.
        angles: whether values are angles, whose whole turns don't matter.
    """

    def __init__(self, function: Function, length: float, step: float, angles: bool) -> None:
        self._function, self._length, self.step, self._angles = function, length, step, angles

    def __call__(self, distance: Float) -> Float:
        """Return the interpolated values (K, C) at distances (K,), m."""
        cell = np.floor(distance / self.step)
        numbers = np.unique(cell[:, None] + np.arange(-1.0, 3.0))
        nodes = self._at_nodes(numbers)
        first = np.searchsorted(numbers, cell - 1.0)
        before, start, end, after = (self._near(nodes[first + 1], nodes[first + k]) for k in range(4))
        # Catmull and Rom 1974: slopes at nodes are half the difference of their neighbours.
        t = (distance / self.step - cell)[:, None]
        m0, m1, rise = (end - before) / 2.0, (after - start) / 2.0, end - start
        return start + t * (m0 + t * (3.0 * rise - 2.0 * m0 - m1 + t * (m0 + m1 - 2.0 * rise)))

    def bends(self) -> tuple[Float, Float]:
        """Return the largest absolute first and second derivatives (C,) by the distance."""
        last = int(np.floor(self._length / self.step)) + 1
        rate: Float = np.zeros(1)
        bend: Float = np.zeros(1)
        for start in range(-1, last + 1, _BLOCK):
            numbers = np.arange(start - 1, min(start + _BLOCK, last + 1) + 3, dtype=np.float64)
            values = self._at_nodes(numbers)
            rises = self._near(np.zeros(1), np.diff(values, axis=0)) / self.step
            slopes, rise = (rises[1:] + rises[:-1]) / 2.0, rises[1:-1]
            m0, m1 = slopes[:-1], slopes[1:]
            # A cubic's second derivative is largest at an end; its first there or, at most 1.5 times the rise, within.
            ends = np.maximum(np.abs(6.0 * rise - 4.0 * m0 - 2.0 * m1), np.abs(-6.0 * rise + 2.0 * m0 + 4.0 * m1))
            bend = np.maximum(bend, ends.max(axis=0) / self.step)
            rate = np.maximum(rate, np.maximum(np.abs(slopes).max(axis=0), 1.5 * np.abs(rise).max(axis=0)))
        return rate, bend

    def _near(self, centre: Float, values: Float) -> Float:
        return centre + wrap_angle(values - centre) if self._angles else values

    def _at_nodes(self, numbers: Float) -> Float:
        """Return the function's values at nodes, continued beyond the ends with the slope of a parabola there."""
        distance = numbers * self.step
        within = np.clip(distance, 0.0, self._length)
        values = self._function(within)
        reach = min(0.5, self._length / 4.0)
        for outside, end, inwards in ((distance < 0.0, 0.0, reach), (distance > self._length, self._length, -reach)):
            if outside.any():
                last, middle, first = self._function(end + inwards * np.arange(3.0))
                middle, first = self._near(last, middle), self._near(last, first)
                slope = (4.0 * middle - 3.0 * last - first) / (2.0 * inwards)
                values[outside] += (distance - within)[outside, None] * slope
        return values
