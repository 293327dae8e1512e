"""Crossfall along the road: which it must be, and how it runs off from one to the next (RAA, RAL)."""

import math

from ..base.schema import round_value
from .guidelines import LIMITS, curve_crossfall_percent, is_single
from .other_roads.axis import HorizontalElement
from .section import CrossfallPoint


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
            percent_outside = abs(start_percent) + abs(end_percent) - 2.0 * LIMITS[design_class].least_crossfall_percent
            lengths.append(crossing_length(design_class, half_width) + half_width * percent_outside / largest_rate)
    return max(lengths)


def steepest_percent(design_class: str, half_width: float) -> float:
    """Return the largest slope (%) of the pavement's edge, ``half_width`` (m) from its rotation axis, in a run-off."""
    limits = LIMITS[design_class]
    return min(limits.run_off_percent, limits.run_off_percent_per_metre * half_width)


def crossing_length(design_class: str, half_width: float) -> float:
    """Return the length (m) in which the crossfall goes from the least one way to the least the other way.

    Not so short that the edge is steeper than allowed, not so long that water stands; where both can't be had (more
    than 9 m from the axis to the edge) the latter decides.
    """
    limits = LIMITS[design_class]
    change = 2.0 * limits.least_crossfall_percent
    longest_length = change / limits.run_off_least_per_metre
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
    limits = LIMITS[design_class]
    if abs(curvature) * limits.radius_outwards < 1.0:
        return limits.least_crossfall_percent if side == "right" else -limits.least_crossfall_percent
    return -math.copysign(curve_crossfall_percent(design_class, curvature), curvature)


def crossfall_points(
    design_class: str, side: str, half_width: float, elements: tuple[HorizontalElement, ...]
) -> tuple[CrossfallPoint, ...]:
    """Return a carriageway's crossfall by station: constant on lines and arcs, changing along the clothoids.

    Where it changes its sign it does so in `crossing_length`, so that the part without enough crossfall is short. On a
    single carriageway one side waits until the other has come to its crossfall: from there on both are one plane.
    """
    corners: list[tuple[float, float]] = []
    station, from_station, from_curvature = 0.0, 0.0, elements[0].curvature_start

    def run_off(to_station: float, to_curvature: float) -> list[tuple[float, float]]:
        """Return the corners (station m, crossfall %) of the transition from the last line or arc to a curvature."""
        begin, end = (
            (place, wanted_percent(design_class, side, curvature))
            for place, curvature in ((from_station, from_curvature), (to_station, to_curvature))
        )
        if is_single(design_class):
            other_side = "left" if side == "right" else "right"
            other_begin, other_end = (
                (place, wanted_percent(design_class, other_side, curvature))
                for place, curvature in ((from_station, from_curvature), (to_station, to_curvature))
            )
            return _shared_run_off_corners(design_class, half_width, (begin, end), (other_begin, other_end))
        return _run_off_corners(design_class, half_width, begin, end)

    corners.append((station, wanted_percent(design_class, side, from_curvature)))
    for element in elements:
        end = station + element.length
        if element.kind != "clothoid":
            corners += run_off(station, element.curvature_start)
            corners.append((end, wanted_percent(design_class, side, element.curvature_start)))
            from_station, from_curvature = end, element.curvature_start
        station = end
    if from_station < station:
        corners += run_off(station, elements[-1].curvature_end)
    points: list[CrossfallPoint] = []
    for corner_station, percent in corners:
        if not points or round_value(corner_station) > points[-1].station:
            points.append(CrossfallPoint(station=round_value(corner_station), crossfall_percent=round_value(percent)))
    return tuple(points)


def _shared_run_off_corners(
    design_class: str,
    half_width: float,
    transition: tuple[tuple[float, float], tuple[float, float]],
    other_transition: tuple[tuple[float, float], tuple[float, float]],
) -> list[tuple[float, float]]:
    """Return the corners of one side's transition (begin, end) beside that of the other side of a single carriageway.

    Where only the other side's crossfall changes its sign, this one's stays as it is, but for the part in which both
    are one plane.
    """
    (begin, end), (other_begin, other_end) = transition, other_transition
    if begin[1] * end[1] < 0.0 or other_begin[1] * other_end[1] >= 0.0:
        return _run_off_corners(design_class, half_width, begin, end)
    crossing = _run_off_corners(design_class, half_width, other_begin, other_end)[:-1]
    # Towards a curve both are one plane behind the crossing, out of it before.
    is_plane_behind = other_end[1] * end[1] > 0.0
    return [(place, begin[1] if is_plane_behind else end[1]) for place, _ in crossing] + [end]


def _run_off_corners(
    design_class: str, half_width: float, begin: tuple[float, float], end: tuple[float, float]
) -> list[tuple[float, float]]:
    """Return (station m, crossfall %) at the corners of a crossfall transition after ``begin`` up to ``end``.

    Without a change of sign that is its end alone: the transition is linear. Else the part between the least crossfall
    one way and the other has `crossing_length`, and the rest is shared out before and after it by the change needed.
    """
    least_percent = LIMITS[design_class].least_crossfall_percent
    (s0, start_percent), (s1, end_percent) = begin, end
    if start_percent * end_percent >= 0.0 or s1 <= s0:
        return [end]
    length = min(s1 - s0, crossing_length(design_class, half_width))
    change_before, change_after = abs(start_percent) - least_percent, abs(end_percent) - least_percent
    share = change_before / (change_before + change_after) if change_before + change_after > 0.0 else 0.5
    crossing_start = s0 + (s1 - s0 - length) * share
    return [
        (crossing_start, math.copysign(least_percent, start_percent)),
        (crossing_start + length, math.copysign(least_percent, end_percent)),
        end,
    ]
