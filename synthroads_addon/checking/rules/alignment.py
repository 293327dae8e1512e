"""Rules for the centreline: radii, clothoids, straights, grades and roundings (RAA)."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np

from ...road.guidelines import LONGEST_STRAIGHT
from .rule import STRAIGHT, CurvatureRun, Finding, Road, Rule, at_least, at_most, out_of_order, same_curvature

#: Shortest straight between two curves of the same direction, m (RAA, after a textbook).
SHORTEST_STRAIGHT_SAME_DIRECTION = 400.0
#: The larger of two neighbouring radii over the smaller, at most, where the smaller is below the radius beside (RAA).
RADIUS_RATIO = 1.5
RADIUS_RATIO_BELOW = 1500.0
#: The larger parameter of an S-curve's two clothoids over the smaller, at most (RAA).
CLOTHOID_RATIO = 1.5
#: Curvature (1/m) whose jumps are rounding in a file, and felt by nobody: 0.13 mm/s² at 130 km/h (chosen).
_LEAST_JUMP = 1e-7
#: Grades that differ by less than this (m/m) need no rounding: 0.1 mm on 100 m.
SAME_GRADE = 1e-6


def _element_length(road: Road) -> Iterator[Finding]:
    for i in np.flatnonzero(~(road.lengths > 0.0)):
        text = f"Element {i + 1} is {road.lengths[i]:g} m long; above 0 is needed."
        yield Finding(road.axis, road.starts[i], road.lengths[i], 0.0, text)


def _radius(road: Road) -> Iterator[Finding]:
    least = road.limits.radius
    sharp = [(run.start, run.radius) for run in road.runs if not run.straight]
    sharp += [(station, 1.0 / curvature) for station, curvature in _sharp_clothoid_ends(road)]
    for station, radius in sorted(sharp):
        text = f"The radius of {radius:.1f} m is below {least:.0f} m ({road.guideline})."
        yield from at_least(road.axis, station, radius, least, text)


def _sharp_clothoid_ends(road: Road) -> Iterator[tuple[float, float]]:
    """Yield (station m, |curvature| 1/m) of clothoids' sharper ends beside which no neighbour is as sharp."""
    k0, k1 = np.abs(road.k0), np.abs(road.k1)
    last = len(k0) - 1
    for i in np.flatnonzero(~road.constant).tolist():
        if k1[i] >= k0[i]:
            stands = i < last and (road.constant[i + 1] or k1[i + 1] > k0[i + 1])
            beside = k0[i + 1] * (1.0 + 1e-6) if stands else 0.0
            at, curvature = road.starts[i + 1], k1[i]
        else:
            beside = k1[i - 1] * (1.0 + 1e-6) if i > 0 else 0.0
            at, curvature = road.starts[i], k0[i]
        if curvature > beside:
            yield float(at), float(curvature)


def _clothoids(road: Road) -> Iterator[tuple[int, float, float, float]]:
    """Yield (index, A, smallest radius, largest radius that it must suit), lengths in m, of every clothoid.

    A clothoid that passes through zero curvature is two, of the same A: it must suit both radii. Any other, an egg's
    too, must suit the smaller radius. The largest is 0 where the road's begin or end cuts the clothoid's sharper end:
    the radius that it leads to is then unknown (and smaller).
    """
    last = len(road.lengths) - 1
    for i in np.flatnonzero(~road.constant).tolist():
        k0, k1 = road.k0[i], road.k1[i]
        parameter = float(np.sqrt(road.lengths[i] / np.abs(k1 - k0)))
        ends = [k for k, cut in ((k0, i == 0), (k1, i == last)) if not cut]
        sharper = max(abs(k0), abs(k1))
        if k0 * k1 >= 0.0:
            ends = [k for k in ends if abs(k) == sharper]
        known = [1.0 / abs(k) for k in ends if abs(k) > STRAIGHT]
        yield i, parameter, float(1.0 / sharper), float(max(known, default=0.0))


def _clothoid_minimum(road: Road) -> Iterator[Finding]:
    least = road.limits.clothoid
    for i, parameter, _, _ in _clothoids(road):
        text = f"The clothoid's A = {parameter:.1f} m is below {least:.0f} m ({road.guideline})."
        yield from at_least(road.axis, road.starts[i], parameter, least, text)


def _clothoid_short(road: Road) -> Iterator[Finding]:
    for i, parameter, _, radius in _clothoids(road):
        text = f"The clothoid's A = {parameter:.1f} m is below R/3 = {radius / 3.0:.1f} m (RAA: R/3 <= A <= R)."
        yield from at_least(road.axis, road.starts[i], parameter, radius / 3.0, text)


def _clothoid_long(road: Road) -> Iterator[Finding]:
    for i, parameter, radius, _ in _clothoids(road):
        text = f"The clothoid's A = {parameter:.1f} m is above R = {radius:.1f} m (RAA: R/3 <= A <= R)."
        yield from at_most(road.axis, road.starts[i], parameter, radius, text)


def _clothoid_ratio(road: Road) -> Iterator[Finding]:
    parameters = {i: parameter for i, parameter, _, _ in _clothoids(road)}
    for i, before in parameters.items():
        after = parameters.get(i + 1)
        if after is None or max(abs(road.k1[i]), abs(road.k0[i + 1])) > STRAIGHT or road.k0[i] * road.k1[i + 1] >= 0.0:
            continue
        ratio = _ratio(before, after)
        text = (
            f"The S-curve's clothoids, A = {before:.1f} m and {after:.1f} m, are as 1 : {ratio:.2f}; "
            f"1 : {CLOTHOID_RATIO} is allowed (RAA)."
        )
        yield from at_most(road.axis, road.starts[i + 1], ratio, CLOTHOID_RATIO, text)


def _ratio(one: float, other: float) -> float:
    """Return the larger of two lengths over the smaller; infinite or NaN where the smaller is 0."""
    small, large = sorted((np.float64(one), np.float64(other)))
    return float(large / small)


def _curvature_jump(road: Road) -> Iterator[Finding]:
    for i in np.flatnonzero(~same_curvature(road.k1[:-1], road.k0[1:])):
        jump = abs(road.k0[i + 1] - road.k1[i])
        if jump < _LEAST_JUMP:
            continue
        text = f"The curvature jumps by {jump:.2e} 1/m: a transition curve is missing (RAA)."
        yield Finding(road.axis, road.starts[i + 1], jump, 0.0, text)


def _straight_longest(road: Road) -> Iterator[Finding]:
    for run in road.runs:
        if run.straight:
            text = f"The straight is {run.length:.0f} m long; {LONGEST_STRAIGHT:.0f} m are allowed (RAA)."
            yield from at_most(road.axis, run.start, run.length, LONGEST_STRAIGHT, text)


def _straight_between(road: Road) -> Iterator[Finding]:
    least = SHORTEST_STRAIGHT_SAME_DIRECTION
    for run in road.runs:
        if not run.straight or road.is_cut(run):
            continue
        before = _direction(road.k1[run.first - 1], road.k0[run.first - 1])
        after = _direction(road.k0[run.last + 1], road.k1[run.last + 1])
        if before * after > 0.0:
            text = (
                f"The straight between two curves of the same direction is {run.length:.1f} m long; it must be absent "
                f"or {least:.0f} m and more (RAA)."
            )
            yield from at_least(road.axis, run.start, run.length, least, text)


def _direction(near: float, far: float) -> float:
    """Return the sign (1 left, -1 right) of an element beside a straight: of its curvature there or at its far end."""
    return float(np.sign(near if abs(near) > STRAIGHT else far))


def _arcs(road: Road) -> list[CurvatureRun]:
    """Return the arcs in order; where two clothoids meet at their sharper ends an arc of length 0 is added."""
    arcs = [run for run in road.runs if not run.straight]
    k0, k1 = road.k0, road.k1
    for i, (a, b) in enumerate(pairwise(~road.constant)):
        if a and b and abs(k0[i]) < abs(k1[i]) and abs(k1[i + 1]) < abs(k0[i + 1]) and k1[i] * k0[i + 1] > 0.0:
            at = float(road.starts[i + 1])
            arcs.append(CurvatureRun(at, at, float(k1[i]), i, i + 1))
    return sorted(arcs, key=lambda arc: (arc.start, arc.end))


def _radius_ratio(road: Road) -> Iterator[Finding]:
    if road.design_class == "EKA3":
        return
    straights = [run for run in road.runs if run.straight]
    starts = np.array([run.start for run in straights])
    lengths = np.concatenate(([0.0], np.cumsum([run.end - run.start for run in straights])))
    for before, after in pairwise(_arcs(road)):
        span = np.searchsorted(starts, [before.end, after.start])
        straight = lengths[span[1]] - lengths[span[0]]
        ratio = _ratio(before.radius, after.radius)
        if straight < road.two_seconds and min(before.radius, after.radius) < RADIUS_RATIO_BELOW:
            text = (
                f"The neighbouring radii {before.radius:.0f} m and {after.radius:.0f} m are as 1 : {ratio:.2f}; "
                f"1 : {RADIUS_RATIO} is allowed below {RADIUS_RATIO_BELOW:.0f} m (RAA)."
            )
            yield from at_most(road.axis, after.start, ratio, RADIUS_RATIO, text)


def _arc_length(road: Road) -> Iterator[Finding]:
    for arc in _arcs(road):
        if arc.length == 0.0 or not road.is_cut(arc):
            text = f"The arc is {arc.length:.1f} m long; two seconds of travel are {road.two_seconds:.1f} m (RAA)."
            yield from at_least(road.axis, arc.start, arc.length, road.two_seconds, text)


def _vertical_order(road: Road) -> Iterator[Finding]:
    for number, at, past in out_of_order(point.station for point in road.parameters.alignment.vertical):
        text = f"Point of vertical intersection {number} at {at:.3f} m does not follow the one at {past:.3f} m."
        yield Finding(road.axis, at, at, past, text)


def _grade(road: Road) -> Iterator[Finding]:
    profile, steepest = road.vertical, road.limits.grade_percent
    begin = np.concatenate(([-np.inf], profile.station + profile.tangents))
    end = np.concatenate((profile.station - profile.tangents, [np.inf]))
    grades = [
        (max(float(begin[i]), 0.0), float(grade))
        for i, grade in enumerate(profile.grades)
        if begin[i] < road.length and end[i] > 0.0 and begin[i] <= end[i]
    ]
    # A rounding that the road's begin or end cuts: the steepest grade is that of the cut.
    for at in (0.0, road.length):
        for i in np.flatnonzero(np.abs(profile.station - at) < profile.tangents).tolist():
            share = (at - end[i]) / (2.0 * profile.tangents[i])
            grades.append((at, float(profile.grades[i] + share * (profile.grades[i + 1] - profile.grades[i]))))
    for station, grade in dict.fromkeys(grades):
        text = f"The grade of {100.0 * grade:.2f} % is steeper than {steepest} % ({road.guideline})."
        yield from at_most(road.axis, station, 100.0 * abs(grade), steepest, text)


def _rounding(road: Road, kind: Literal["crest", "sag"]) -> Iterator[Finding]:
    profile = road.vertical
    least = road.limits.crest if kind == "crest" else road.limits.sag
    change = np.diff(profile.grades) * (-1.0 if kind == "crest" else 1.0)
    on_road = (profile.station + profile.tangents > 0.0) & (profile.station - profile.tangents < road.length)
    for i in np.flatnonzero((change > SAME_GRADE) & on_road):
        radius = profile.radius[i]
        has = f"radius of {radius:.0f} m" if radius else "missing rounding"
        text = f"The {kind}'s {has} is below {least:.0f} m ({road.guideline})."
        yield from at_least(road.axis, profile.station[i], radius, least, text)


def _rounding_overlap(road: Road) -> Iterator[Finding]:
    profile = road.vertical
    room = np.diff(profile.station)
    need = profile.tangents[:-1] + profile.tangents[1:]
    for i in np.flatnonzero(need > room * (1.0 + 1e-6)):
        text = f"The tangents of two roundings need {need[i]:.2f} m and have {room[i]:.2f} m between their points."
        yield Finding(road.axis, profile.station[i + 1] - profile.tangents[i + 1], need[i], room[i], text)


RULES = (
    Rule("element-length", "Elements have a length above 0", "m", "", "definition", _element_length),
    Rule("radius-minimum", "Smallest radius", "m", "RAA", "confirmed", _radius),
    Rule("clothoid-minimum", "Smallest clothoid parameter A", "m", "RAA", "confirmed", _clothoid_minimum),
    Rule("clothoid-short", "A is at least R/3", "m", "RAA", "unconfirmed", _clothoid_short),
    Rule("clothoid-long", "A is at most R", "m", "RAA", "unconfirmed", _clothoid_long),
    Rule("clothoid-ratio", "Parameters of an S-curve's clothoids", "1", "RAA", "unconfirmed", _clothoid_ratio),
    Rule("curvature-jump", "Curvature doesn't jump between elements", "1/m", "RAA", "unconfirmed", _curvature_jump),
    Rule("straight-longest", "Longest straight", "m", "RAA", "confirmed", _straight_longest),
    Rule("straight-between", "Straight between curves of one direction", "m", "RAA", "confirmed", _straight_between),
    Rule("radius-ratio", "Ratio of neighbouring radii", "1", "RAA", "unconfirmed", _radius_ratio),
    Rule("arc-length", "Arcs last two seconds of travel", "m", "RAA", "derived", _arc_length),
    Rule("vertical-order", "Points of the profile are in order", "m", "", "definition", _vertical_order),
    Rule("grade-maximum", "Steepest grade", "%", "RAA", "confirmed", _grade),
    Rule("crest-radius", "Smallest crest radius", "m", "RAA", "confirmed", partial(_rounding, kind="crest")),
    Rule("sag-radius", "Smallest sag radius", "m", "RAA", "confirmed", partial(_rounding, kind="sag")),
    Rule("rounding-overlap", "Roundings don't overlap", "m", "", "definition", _rounding_overlap),
)
