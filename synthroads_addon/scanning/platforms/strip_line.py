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
        turning_point = np.round(2.0 * phase - 0.5)  # the nearest one: even ones to the left, odd ones to the right
        side = np.where(np.mod(turning_point, 2.0) == 0.0, 1.0, -1.0)
        # From the turning point, in lengths of its rounding, which reaches from -1/2 to 1/2.
        distance = (phase - (turning_point + 0.5) / 2.0) / self.ROUNDED
        distance_in_rounding = np.clip(distance, -0.5, 0.5)
        # By how much less than the amplitude the offset is, in wavelengths of the straight legs' slope: the integral
        # of the rounding's sine, then a straight leg.
        rounded_fall = self.ROUNDED * (1.0 - np.cos(np.pi * distance_in_rounding)) / np.pi
        fall = rounded_fall + self.ROUNDED * (np.abs(distance) - np.abs(distance_in_rounding))
        offset = side * (self.amplitude - self.slope * self.wavelength * fall)
        return offset, -side * self.slope * np.sin(np.pi * distance_in_rounding)


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
        table_distance = distance if self.forward else self.length - distance
        cell = np.clip(np.searchsorted(table.distance, table_distance, side="right") - 1, 0, len(table.rate) - 1)
        size = table.distance[cell + 1] - table.distance[cell]
        # Cubic Hermite interpolation: p0 + t (m0 + t (3 d - 2 m0 - m1 + t (m0 + m1 - 2 d))), d = p1 - p0.
        t = (table_distance - table.distance[cell]) / size
        p0, p1 = table.station[cell], table.station[cell + 1]
        (m0, m1), d = table.rate[cell].T * size, p1 - p0
        return np.asarray(p0 + t * (m0 + t * (3.0 * d - 2.0 * m0 - m1 + t * (m0 + m1 - 2.0 * d))))

    def place(self, distance: Float) -> tuple[Float, Float, Float, Float]:
        """Return plan position (K, 2), course (K,) rad, station (K,) and offset (K,) at distances 0 to `length`.

        The course is the direction of travel; it isn't wrapped, but may differ by whole turns between calls.
        """
        station = self.stations(distance)
        plan, heading, advance, sideways, offset = self._frame(station)
        leftward = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        course = heading + np.arctan2(sideways, advance) + (0.0 if self.forward else np.pi)
        return plan + offset[:, None] * leftward, course, station, offset

    @cached_property
    def bend(self) -> tuple[float, float]:
        """Return the largest curvature, 1/m, and the largest jump of the course, rad; computed once."""
        table = self._table
        turn = np.abs(wrap_angle(table.course[:, 1] - table.course[:, 0])) / np.diff(table.distance)
        jump = np.abs(wrap_angle(table.course[1:, 0] - table.course[:-1, 1]))
        return float(turn.max()), float(jump.max(initial=0.0))

    def _frame(self, station: Float) -> tuple[Float, Float, Float, Float, Float]:
        """Return the guide's plan position (K, 2) and heading (K,), and the track's advance, slope and offset (K,).

        Advance and slope are what the track goes along the guide and to its left, m per m of station; the offset is in
        m.
        """
        plan, heading, curvature, stretch = self.guide.frame(station)
        offset, slope = self.offsets(station)
        # A line at an offset n beside curvature kappa is (1 - kappa n) times as long.
        lever = 1.0 - curvature * offset
        self._refuse_fold(station, offset, curvature, lever)
        return plan, heading, stretch * lever, slope, offset

    def _refuse_fold(self, station: Float, offset: Float, curvature: Float, lever: Float) -> None:
        """Raise `InputError` if the track turns back on itself, where a bend's radius is hardly larger than its offset.

        Args:
            station, offset: (K,) m.
            curvature: (K,) of the guide, 1/m.
            lever: (K,) length of the track by that of the guide.
        """
        if not len(lever) or lever.min() >= 1.0 - FOLD:
            return
        worst_row = int(lever.argmin())
        side = "left" if curvature[worst_row] > 0.0 else "right"
        radius = 1.0 / abs(float(curvature[worst_row]))
        requirement = (
            f"at most {FOLD * radius:.2f} m to the {side} are possible at station {station[worst_row]:.1f} m, where the"
            f" radius is {radius:.2f} m: beyond it the path would turn back; with path=smoothed and polynomial_degree=1"
            " it leads straight over the road"
        )
        raise InputError(self._field, float(offset[worst_row]), requirement)

    def _build(self) -> _Table:
        """Return the table of the track's cells; lengths by Gauss and Legendre's rule."""
        station = self._borders()
        # The cell ends just before a break: there the curvature is still that of the element before.
        cell_begin, cell_end = station[:-1], np.nextafter(station[1:], -np.inf)
        cell_count = len(cell_begin)
        distance, rate, course = np.zeros(len(station)), np.empty((cell_count, 2)), np.empty((cell_count, 2))
        for start in range(0, cell_count, _BLOCK):
            cells = slice(start, start + _BLOCK)
            half_length = np.diff(station)[cells] / 2.0
            node_station = (cell_begin[cells] + half_length) + half_length * _NODES[:, None]
            _, _, advance, sideways, _ = self._frame(node_station.ravel())
            speed = np.hypot(advance, sideways).reshape(node_station.shape)  # metres of track per metre of station
            distance[1:][cells] = half_length * (_WEIGHTS @ speed)
            for end, border in enumerate((cell_begin[cells], cell_end[cells])):
                _, heading, advance, sideways, _ = self._frame(border)
                rate[cells, end] = 1.0 / np.hypot(advance, sideways)
                course[cells, end] = heading + np.arctan2(sideways, advance)
        return _Table(station, np.cumsum(distance), rate, course)

    def _borders(self) -> Float:
        """Return the stations of the cells' borders: evenly spaced, and at the guide's breaks."""
        size = min(_CELL, self.sway.wavelength / 100.0) if self.sway else _CELL
        length = self.guide.length
        count = int(np.ceil(length / size))
        even_borders = np.arange(count + 1) * (length / count)
        even_borders[-1] = length
        # Breaks at the ends, and such as repeat the one before, make no cell.
        breaks = self.guide.breaks
        breaks = breaks[(breaks > 1e-6) & (breaks < length - 1e-6)]
        breaks = breaks[np.concatenate(([True], np.diff(breaks) > 1e-9))[: len(breaks)]]
        if len(breaks):
            # Even borders next to a break are left out.
            next_break = np.minimum(np.searchsorted(breaks, even_borders), len(breaks) - 1)
            distance_to_next = np.abs(breaks[next_break] - even_borders)
            distance_to_last = np.abs(breaks[np.maximum(next_break - 1, 0)] - even_borders)
            even_borders = even_borders[np.minimum(distance_to_next, distance_to_last) > 1e-6]
        return np.sort(np.concatenate((even_borders, breaks)))


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
        row = np.searchsorted(numbers, cell - 1.0)
        # The four nodes around each distance, p1 and p2 at the ends of its cell; angles without whole turns.
        p0, p1, p2, p3 = (self._without_turns(nodes[row + 1], nodes[row + k]) for k in range(4))
        # Catmull and Rom 1974: slopes at nodes are half the difference of their neighbours.
        t = (distance / self.step - cell)[:, None]
        m1, m2, d = (p2 - p0) / 2.0, (p3 - p1) / 2.0, p2 - p1
        return p1 + t * (m1 + t * (3.0 * d - 2.0 * m1 - m2 + t * (m1 + m2 - 2.0 * d)))

    def bends(self) -> tuple[Float, Float]:
        """Return upper bounds (C,) of the function's absolute first and second derivatives by the distance."""
        last_node = int(np.floor(self._length / self.step)) + 1
        first_bound: Float = np.zeros(1)
        second_bound: Float = np.zeros(1)
        # Cells -1 to last_node + 1 are looked at: the cubics also bend in the cells just beyond the ends. A node on
        # either side is needed for the slopes.
        for first_cell in range(-1, last_node + 1, _BLOCK):
            last_cell = min(first_cell + _BLOCK, last_node + 1)
            values = self._at_nodes(np.arange(first_cell - 1, last_cell + 3, dtype=np.float64))
            all_rises = self._without_turns(np.zeros(1), np.diff(values, axis=0)) / self.step
            slopes, rise = (all_rises[1:] + all_rises[:-1]) / 2.0, all_rises[1:-1]
            m1, m2 = slopes[:-1], slopes[1:]  # at the ends of each cell, as in `__call__`
            # The second derivative of a cubic is linear, so that it is largest at an end of its cell:
            # (6 d - 4 m1 - 2 m2) / step at the first, (-6 d + 2 m1 + 4 m2) / step at the last, with the rise d.
            second_steps = np.maximum(
                np.abs(6.0 * rise - 4.0 * m1 - 2.0 * m2), np.abs(-6.0 * rise + 2.0 * m1 + 4.0 * m2)
            )
            second_bound = np.maximum(second_bound, second_steps.max(axis=0) / self.step)
            # The first derivative is a sum of the rises of three cells, whose weights' absolute values add up to 1.5 at
            # most, in the middle of a cell.
            first_bound = np.maximum(
                first_bound, np.maximum(np.abs(slopes).max(axis=0), 1.5 * np.abs(rise).max(axis=0))
            )
        return first_bound, second_bound

    def _without_turns(self, centre: Float, values: Float) -> Float:
        """Return values, angles less the whole turns by which they differ from a centre."""
        return centre + wrap_angle(values - centre) if self._angles else values

    def _at_nodes(self, numbers: Float) -> Float:
        """Return the function's values (K, C) at nodes, continued beyond the ends with the slope of a parabola there.

        Args:
            numbers: (K,) of the nodes, which lie a step apart.
        """
        distance = numbers * self.step
        inside_distance = np.clip(distance, 0.0, self._length)
        values = self._function(inside_distance)
        spacing = min(0.5, self._length / 4.0)
        for is_outside, end, inwards in (
            (distance < 0.0, 0.0, spacing),
            (distance > self._length, self._length, -spacing),
        ):
            if is_outside.any():
                # The parabola through the end and two places inside has the slope (4 f1 - 3 f0 - f2) / (2 h) there.
                f0, f1, f2 = self._function(end + inwards * np.arange(3.0))
                f1, f2 = self._without_turns(f0, f1), self._without_turns(f0, f2)
                slope = (4.0 * f1 - 3.0 * f0 - f2) / (2.0 * inwards)
                values[is_outside] += (distance - inside_distance)[is_outside, None] * slope
        return values
