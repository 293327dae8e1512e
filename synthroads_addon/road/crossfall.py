"""Crossfall along the road: which it must be, and how it runs off from one to the next (RAA)."""

import math

from ..base.schema import round_value
from .guidelines import LEAST_CROSSFALL_PERCENT, LIMITS, curve_crossfall_percent
from .parameters import HorizontalElement
from .section import CrossfallPoint

LEAST_RUN_OFF = 0.1
"""Least slope (%) of the pavement's edge per metre of its distance from the rotation axis, while water could stand."""
NARROW, NARROW_RUN_OFF = 4.0, 0.225
"""Where the edge is nearer than this (m) to the rotation axis, its largest slope (%) per metre of that distance."""


def run_off_length(design_class: str, half_width: float, start: float, end: float) -> float:
    """Return the least length (m) in which both carriageways' crossfall can change between two curvatures (1/m).

    Example:
        >>> round(run_off_length("EKA1A", half_width=12.0, start=0.0, end=1 / 1000), 1)
        96.7
    """
    lengths = []
    largest_rate = steepest_percent(design_class, half_width)
    for side in ("left", "right"):
        start_percent, end_percent = wanted_percent(design_class, side, start), wanted_percent(design_class, side, end)
        if start_percent * end_percent >= 0.0:
            lengths.append(half_width * abs(end_percent - start_percent) / largest_rate)
        else:
            percent_outside = abs(start_percent) + abs(end_percent) - 2.0 * LEAST_CROSSFALL_PERCENT
            lengths.append(crossing_length(design_class, half_width) + half_width * percent_outside / largest_rate)
    return max(lengths)


def steepest_percent(design_class: str, half_width: float) -> float:
    """Return the largest slope (%) of the pavement's edge, ``half_width`` (m) from its rotation axis, in a run-off."""
    return LIMITS[design_class].run_off_percent if half_width >= NARROW else NARROW_RUN_OFF * half_width


def crossing_length(design_class: str, half_width: float) -> float:
    """Return the length (m) in which the crossfall goes from 2.5 % one way to 2.5 % the other way.

    Not so short that the edge is steeper than allowed, not so long that water stands; where both can't be had (more
    than 9 m from the axis to the edge) the latter decides.
    """
    change = 2.0 * LEAST_CROSSFALL_PERCENT
    longest_length = change / LEAST_RUN_OFF
    return 0.5 * (
        longest_length + min(longest_length, half_width * change / steepest_percent(design_class, half_width))
    )


def wanted_percent(design_class: str, side: str, curvature: float) -> float:
    """Return the crossfall (%, positive where it falls to the right) that a carriageway needs at a curvature (1/m).

    Outwards on straights and in curves wide enough for it, else to the inside of the curve.

    Example:
        >>> wanted_percent("EKA1A", "right", curvature=0.0), wanted_percent("EKA1A", "right", curvature=1 / 1000)
        (2.5, -6.0)
    """
    if abs(curvature) * LIMITS[design_class].radius_outwards < 1.0:
        return LEAST_CROSSFALL_PERCENT if side == "right" else -LEAST_CROSSFALL_PERCENT
    return -math.copysign(curve_crossfall_percent(design_class, curvature), curvature)


def crossfall_points(
    design_class: str, side: str, half_width: float, elements: tuple[HorizontalElement, ...]
) -> tuple[CrossfallPoint, ...]:
    """Return a carriageway's crossfall by station: constant on lines and arcs, changing along the clothoids.

    Where it changes its sign it does so in `crossing_length`, so that the part without enough crossfall is short.
    """
    corners: list[tuple[float, float]] = []
    station, from_station, from_percent = 0.0, 0.0, wanted_percent(design_class, side, elements[0].curvature_start)
    corners.append((station, from_percent))
    for element in elements:
        end = station + element.length
        if element.kind != "clothoid":
            percent = wanted_percent(design_class, side, element.curvature_start)
            corners += _run_off_corners(design_class, half_width, (from_station, from_percent), (station, percent))
            corners.append((end, percent))
            from_station, from_percent = end, percent
        station = end
    if from_station < station:
        percent = wanted_percent(design_class, side, elements[-1].curvature_end)
        corners += _run_off_corners(design_class, half_width, (from_station, from_percent), (station, percent))
    points: list[CrossfallPoint] = []
    for corner_station, percent in corners:
        if not points or round_value(corner_station) > points[-1].station:
            points.append(CrossfallPoint(station=round_value(corner_station), crossfall_percent=round_value(percent)))
    return tuple(points)


def _run_off_corners(
    design_class: str, half_width: float, begin: tuple[float, float], end: tuple[float, float]
) -> list[tuple[float, float]]:
    """Return (station m, crossfall %) at the corners of a crossfall transition after ``begin`` up to ``end``.

    Without a change of sign that is its end alone: the transition is linear. Else the part between 2.5 % one way and
    2.5 % the other has `crossing_length`, and the rest is shared out before and after it by the change needed there.
    """
    (s0, start_percent), (s1, end_percent) = begin, end
    if start_percent * end_percent >= 0.0 or s1 <= s0:
        return [end]
    length = min(s1 - s0, crossing_length(design_class, half_width))
    change_before, change_after = (
        abs(start_percent) - LEAST_CROSSFALL_PERCENT,
        abs(end_percent) - LEAST_CROSSFALL_PERCENT,
    )
    share = change_before / (change_before + change_after) if change_before + change_after > 0.0 else 0.5
    crossing_start = s0 + (s1 - s0 - length) * share
    return [
        (crossing_start, math.copysign(LEAST_CROSSFALL_PERCENT, start_percent)),
        (crossing_start + length, math.copysign(LEAST_CROSSFALL_PERCENT, end_percent)),
        end,
    ]
