"""Rules for the centreline: radii, clothoids, straights, grades and roundings (RAA)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...road.guidelines import LONGEST_STRAIGHT
from .rule import STRAIGHT, CurvatureRun, Finding, Road, Rule, above, below, out_of_order, same_curvature

#: Shortest straight between two curves of the same direction, m (RAA, after a textbook).
SHORTEST_STRAIGHT_SAME_DIRECTION = 400.0
#: The larger of two neighbouring radii over the smaller, at most, where the smaller is below the radius beside (RAA).
RADIUS_RATIO = 1.5
RADIUS_RATIO_BELOW = 1500.0
#: The larger parameter of an S-curve's two clothoids over the smaller, at most (RAA).
CLOTHOID_RATIO = 1.5
#: Grades that differ by less than this (m/m) need no rounding: 0.1 mm on 100 m.
SAME_GRADE = 1e-6


def _element_length(road: Road) -> Iterator[Finding]:
    for i in np.flatnonzero(~(road.lengths > 0.0)).tolist():
        length = float(road.lengths[i])
        yield Finding(
            road.axis, float(road.starts[i]), length, 0.0, f"Element {i + 1} is {length:g} m long; above 0 is needed."
        )


def _radius(road: Road) -> Iterator[Finding]:
    least = road.limits.radius
    sharp = [(run.start, run.radius) for run in road.runs if not run.straight]
    sharp += [(station, 1.0 / curvature) for station, curvature in _clothoids_own_ends(road)]
    for station, radius in sorted(sharp):
        if below(radius, least):
            text = f"The radius of {radius:.1f} m is below {least:.0f} m ({road.guideline})."
            yield Finding(road.axis, station, radius, least, text)


def _clothoids_own_ends(road: Road) -> Iterator[tuple[float, float]]:
    """Yield (station, |curvature|) of clothoids' sharper ends where no neighbour is as sharp or stands for it."""
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
    """Yield (index, A, smallest radius, largest radius it must suit) of every clothoid.

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
        if below(parameter, least):
            text = f"The clothoid's A = {parameter:.1f} m is below {least:.0f} m ({road.guideline})."
            yield Finding(road.axis, float(road.starts[i]), parameter, least, text)


def _clothoid_short(road: Road) -> Iterator[Finding]:
    for i, parameter, _, radius in _clothoids(road):
        if below(parameter, radius / 3.0):
            text = f"The clothoid's A = {parameter:.1f} m is below R/3 = {radius / 3.0:.1f} m (RAA: R/3 <= A <= R)."
            yield Finding(road.axis, float(road.starts[i]), parameter, radius / 3.0, text)


def _clothoid_long(road: Road) -> Iterator[Finding]:
    for i, parameter, radius, _ in _clothoids(road):
        if above(parameter, radius):
            text = f"The clothoid's A = {parameter:.1f} m is above R = {radius:.1f} m (RAA: R/3 <= A <= R)."
            yield Finding(road.axis, float(road.starts[i]), parameter, radius, text)


def _clothoid_ratio(road: Road) -> Iterator[Finding]:
    parameters = {i: parameter for i, parameter, _, _ in _clothoids(road)}
    for i, before in parameters.items():
        after = parameters.get(i + 1)
        if after is None or max(abs(road.k1[i]), abs(road.k0[i + 1])) > STRAIGHT or road.k0[i] * road.k1[i + 1] >= 0.0:
            continue
        small, large = sorted((np.float64(before), np.float64(after)))
        ratio = float(large / small)
        if above(ratio, CLOTHOID_RATIO):
            text = (
                f"The S-curve's clothoids, A = {before:.1f} m and {after:.1f} m, are as 1 : {ratio:.2f}; "
                f"1 : {CLOTHOID_RATIO} is allowed (RAA)."
            )
            yield Finding(road.axis, float(road.starts[i + 1]), ratio, CLOTHOID_RATIO, text)


def _curvature_jump(road: Road) -> Iterator[Finding]:
    same = same_curvature(road.k1[:-1], road.k0[1:])
    for i in np.flatnonzero(~same).tolist():
        jump = float(abs(road.k0[i + 1] - road.k1[i]))
        text = f"The curvature jumps by {jump:.2e} 1/m: a transition curve is missing (RAA)."
        yield Finding(road.axis, float(road.starts[i + 1]), jump, 0.0, text)


def _straight_longest(road: Road) -> Iterator[Finding]:
    for run in road.runs:
        length = run.end - run.start
        if run.straight and above(length, LONGEST_STRAIGHT):
            text = f"The straight is {length:.0f} m long; {LONGEST_STRAIGHT:.0f} m are allowed (RAA)."
            yield Finding(road.axis, run.start, length, LONGEST_STRAIGHT, text)


def _straight_between(road: Road) -> Iterator[Finding]:
    least = SHORTEST_STRAIGHT_SAME_DIRECTION
    for run in road.runs:
        length = run.end - run.start
        if not run.straight or road.cut(run) or not below(length, least):
            continue
        before = _direction(road.k1[run.first - 1], road.k0[run.first - 1])
        after = _direction(road.k0[run.last + 1], road.k1[run.last + 1])
        if before * after > 0.0:
            text = (
                f"The straight between two curves of the same direction is {length:.1f} m long; it must be absent or "
                f"{least:.0f} m and more (RAA)."
            )
            yield Finding(road.axis, run.start, length, least, text)


def _direction(near: float, far: float) -> float:
    """Return the sign of an element beside a straight: of its curvature there, or else at its other end."""
    return float(np.sign(near if abs(near) > STRAIGHT else far))


def _arcs(road: Road) -> list[CurvatureRun]:
    """Return the arcs in order; where two clothoids meet at their sharper ends is an arc without length."""
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
        straight = float(lengths[span[1]] - lengths[span[0]])
        small, large = sorted((before.radius, after.radius))
        ratio = float(large / small)
        if straight < road.two_seconds and small < RADIUS_RATIO_BELOW and above(ratio, RADIUS_RATIO):
            text = (
                f"The neighbouring radii {before.radius:.0f} m and {after.radius:.0f} m are as 1 : {ratio:.2f}; "
                f"1 : {RADIUS_RATIO} is allowed below {RADIUS_RATIO_BELOW:.0f} m (RAA)."
            )
            yield Finding(road.axis, after.start, ratio, RADIUS_RATIO, text)


def _arc_length(road: Road) -> Iterator[Finding]:
    for arc in _arcs(road):
        length = arc.end - arc.start
        if below(length, road.two_seconds) and (arc.start == arc.end or not road.cut(arc)):
            text = f"The arc is {length:.1f} m long; two seconds of travel are {road.two_seconds:.1f} m (RAA)."
            yield Finding(road.axis, arc.start, length, road.two_seconds, text)


def _vertical_order(road: Road) -> Iterator[Finding]:
    stations = np.array([p.station for p in road.parameters.alignment.vertical])
    for i in out_of_order(stations):
        past = float(stations[:i].max())
        at = float(stations[i])
        text = f"Point of vertical intersection {i + 1} at {at:.3f} m does not follow the one at {past:.3f} m."
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
    reported = set()
    for station, grade in grades:
        if above(100.0 * abs(grade), steepest) and (station, grade) not in reported:
            reported.add((station, grade))
            text = f"The grade of {100.0 * grade:.2f} % is steeper than {steepest} % ({road.guideline})."
            yield Finding(road.axis, station, 100.0 * abs(grade), steepest, text)


def _rounding(road: Road, crest: bool) -> Iterator[Finding]:
    profile = road.vertical
    least = road.limits.crest if crest else road.limits.sag
    change = np.diff(profile.grades)
    concerned = (change < -SAME_GRADE) if crest else (change > SAME_GRADE)
    on_road = (profile.station + profile.tangents > 0.0) & (profile.station - profile.tangents < road.length)
    for i in np.flatnonzero(concerned & on_road).tolist():
        radius = float(profile.radius[i])
        if below(radius, least):
            kind = "crest" if crest else "sag"
            has = f"radius of {radius:.0f} m" if radius else "missing rounding"
            text = f"The {kind}'s {has} is below {least:.0f} m ({road.guideline})."
            yield Finding(road.axis, float(profile.station[i]), radius, least, text)


def _crest(road: Road) -> Iterator[Finding]:
    yield from _rounding(road, crest=True)


def _sag(road: Road) -> Iterator[Finding]:
    yield from _rounding(road, crest=False)


def _rounding_overlap(road: Road) -> Iterator[Finding]:
    profile = road.vertical
    room = np.diff(profile.station)
    need = profile.tangents[:-1] + profile.tangents[1:]
    for i in np.flatnonzero(need > room * (1.0 + 1e-6)).tolist():
        text = f"The tangents of two roundings need {need[i]:.2f} m and have {room[i]:.2f} m between their points."
        station = float(profile.station[i + 1] - profile.tangents[i + 1])
        yield Finding(road.axis, station, float(need[i]), float(room[i]), text)


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
    Rule("crest-radius", "Smallest crest radius", "m", "RAA", "confirmed", _crest),
    Rule("sag-radius", "Smallest sag radius", "m", "RAA", "confirmed", _sag),
    Rule("rounding-overlap", "Roundings don't overlap", "m", "", "definition", _rounding_overlap),
)
