"""Rules for the centreline: radii, clothoids, straights, grades and roundings (RAA, RAL)."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np

from .rule import (
    STRAIGHT,
    TOLERANCE,
    CurvatureRun,
    Finding,
    Road,
    Rule,
    at_least,
    at_most,
    out_of_order,
    same_curvature,
)

#: Where the smaller of two neighbouring radii is below this (m), their ratio is limited (RAA).
RADIUS_RATIO_BELOW = 1500.0
#: Curvature (1/m) whose jumps are rounding in a file, and felt by nobody: 0.13 mm/s² at 130 km/h (chosen).
_LEAST_JUMP = 1e-7
#: Grades that differ by less than this (m/m) need no rounding: 0.1 mm on 100 m.
SAME_GRADE = 1e-6


def _element_length(road: Road) -> Iterator[Finding]:
    """Yield a finding for each element without a length above 0."""
    for i in np.flatnonzero(~(road.lengths > 0.0)):
        text = f"Element {i + 1} is {road.lengths[i]:g} m long; above 0 is needed."
        yield Finding(road.axis, road.starts[i], road.lengths[i], 0.0, text)


def _radius(road: Road) -> Iterator[Finding]:
    """Yield a finding for each arc, or sharp end of a clothoid, below the smallest radius of the design class."""
    least_radius = road.limits.radius
    curves = [(run.start, run.radius) for run in road.runs if not run.straight]
    curves += [(station, 1.0 / curvature) for station, curvature in _sharp_clothoid_ends(road)]
    for station, radius in sorted(curves):
        text = f"The radius of {radius:.1f} m is below {least_radius:.0f} m ({road.cite('radius', True)})."
        yield from at_least(road.axis, station, radius, least_radius, text)


def _sharp_clothoid_ends(road: Road) -> Iterator[tuple[float, float]]:
    """Yield (station m, |curvature| 1/m) of clothoids' sharper ends beside which no neighbour is as sharp."""
    k0, k1 = np.abs(road.k0), np.abs(road.k1)
    last_element = len(k0) - 1
    for i in np.flatnonzero(~road.constant).tolist():
        if k1[i] >= k0[i]:
            has_sharper_neighbour = i < last_element and (road.constant[i + 1] or k1[i + 1] > k0[i + 1])
            neighbour_curvature = k0[i + 1] * (1.0 + 1e-6) if has_sharper_neighbour else 0.0
            station, curvature = road.starts[i + 1], k1[i]
        else:
            neighbour_curvature = k1[i - 1] * (1.0 + 1e-6) if i > 0 else 0.0
            station, curvature = road.starts[i], k0[i]
        if curvature > neighbour_curvature:
            yield float(station), float(curvature)


def _clothoids(road: Road) -> Iterator[tuple[int, float, float, float]]:
    """Yield (index, A, smallest radius, largest radius that it must suit), lengths in m, of every clothoid.

    A clothoid that passes through zero curvature is two, of the same A: it must suit both radii. Any other, an egg's
    too, must suit the smaller radius. The largest is 0 where the road's begin or end cuts the clothoid's sharper end:
    the radius that it leads to is then unknown (and smaller).
    """
    last_element = len(road.lengths) - 1
    for i in np.flatnonzero(~road.constant).tolist():
        k0, k1 = road.k0[i], road.k1[i]
        parameter = float(np.sqrt(road.lengths[i] / np.abs(k1 - k0)))
        ends = [k for k, is_cut in ((k0, i == 0), (k1, i == last_element)) if not is_cut]
        largest_curvature = max(abs(k0), abs(k1))
        if k0 * k1 >= 0.0:
            ends = [k for k in ends if abs(k) == largest_curvature]
        radii = [1.0 / abs(k) for k in ends if abs(k) > STRAIGHT]
        yield i, parameter, float(1.0 / largest_curvature), float(max(radii, default=0.0))


def _clothoid_minimum(road: Road) -> Iterator[Finding]:
    """Yield a finding for each clothoid whose parameter A is below the class's smallest."""
    least_parameter = road.limits.clothoid
    if not road.binds("clothoid"):
        return
    for i, parameter, _, _ in _clothoids(road):
        text = f"The clothoid's A = {parameter:.1f} m is below {least_parameter:.0f} m ({road.guideline})."
        yield from at_least(road.axis, road.starts[i], parameter, least_parameter, text)


def _clothoid_short(road: Road) -> Iterator[Finding]:
    """Yield a finding for each clothoid whose A is below a third of the largest radius that it must suit."""
    for i, parameter, _, radius in _clothoids(road):
        text = (
            f"The clothoid's A = {parameter:.1f} m is below R/3 = {radius / 3.0:.1f} m "
            f"({road.guideline_name}: R/3 <= A <= R)."
        )
        yield from at_least(road.axis, road.starts[i], parameter, radius / 3.0, text)


def _clothoid_long(road: Road) -> Iterator[Finding]:
    """Yield a finding for each clothoid whose A is above the smallest radius at its ends."""
    for i, parameter, radius, _ in _clothoids(road):
        text = (
            f"The clothoid's A = {parameter:.1f} m is above R = {radius:.1f} m ({road.guideline_name}: R/3 <= A <= R)."
        )
        yield from at_most(road.axis, road.starts[i], parameter, radius, text)


def _clothoid_ratio(road: Road) -> Iterator[Finding]:
    """Yield a finding for each S-curve whose two clothoids' parameters differ by too much."""
    if not road.binds("clothoid_ratio"):
        return
    largest_ratio = road.limits.clothoid_ratio
    parameters = {i: parameter for i, parameter, _, _ in _clothoids(road)}
    for i, parameter_before in parameters.items():
        parameter_after = parameters.get(i + 1)
        if (
            parameter_after is None
            or max(abs(road.k1[i]), abs(road.k0[i + 1])) > STRAIGHT
            or road.k0[i] * road.k1[i + 1] >= 0.0
        ):
            continue
        ratio = _ratio(parameter_before, parameter_after)
        text = (
            f"The S-curve's clothoids, A = {parameter_before:.1f} m and {parameter_after:.1f} m, "
            f"are as 1 : {ratio:.2f}; 1 : {largest_ratio} is allowed (RAA)."
        )
        yield from at_most(road.axis, road.starts[i + 1], ratio, largest_ratio, text)


def _ratio(length: float, other_length: float) -> float:
    """Return the larger of two lengths over the smaller; infinite or NaN where the smaller is 0."""
    shorter, longer = sorted((np.float64(length), np.float64(other_length)))
    return float(longer / shorter)


def _curvature_jump(road: Road) -> Iterator[Finding]:
    """Yield a finding for each border of elements at which the curvature jumps."""
    for i in np.flatnonzero(~same_curvature(road.k1[:-1], road.k0[1:])):
        jump = abs(road.k0[i + 1] - road.k1[i])
        if jump < _LEAST_JUMP or max(abs(road.k0[i + 1]), abs(road.k1[i])) * road.limits.curvature_jump_radius < 1.0:
            continue
        source = road.cite("curvature_jump_radius") if road.binds("curvature_jump_radius") else road.guideline_name
        text = f"The curvature jumps by {jump:.2e} 1/m: a transition curve is missing ({source})."
        yield Finding(road.axis, road.starts[i + 1], jump, 0.0, text)


def _straight_longest(road: Road) -> Iterator[Finding]:
    """Yield a finding for each straight longer than the RAA allow."""
    longest_straight = road.limits.straight_longest
    for run in road.runs if road.binds("straight_longest") else ():
        if run.straight:
            text = f"The straight is {run.length:.0f} m long; {longest_straight:.0f} m are allowed (RAA)."
            yield from at_most(road.axis, run.start, run.length, longest_straight, text)


def _straight_between(road: Road) -> Iterator[Finding]:
    """Yield a finding for each short straight between two curves of the same direction."""
    quantity = "straight_same_hand" if road.binds("straight_same_hand") else "straight_same_hand_radii"
    for run in road.runs:
        if not run.straight or road.is_cut(run):
            continue
        direction_before = _direction(road.k1[run.first - 1], road.k0[run.first - 1])
        direction_after = _direction(road.k0[run.last + 1], road.k1[run.last + 1])
        if direction_before * direction_after > 0.0:
            least_length = road.limits.straight_between(
                min(_radius_beside(road, run.first - 1, -1), _radius_beside(road, run.last + 1, 1))
            )
            text = (
                f"The straight between two curves of the same direction is {run.length:.1f} m long; it must be absent "
                f"or {least_length:.0f} m and more ({road.cite(quantity)})."
            )
            yield from at_least(road.axis, run.start, run.length, least_length, text)


def _radius_beside(road: Road, index: int, step: int) -> float:
    """Return the smallest radius (m) of the curve beside a straight, from an element on, forwards (1) or back (-1)."""
    largest_curvature = 0.0
    while 0 <= index < len(road.lengths):
        near, far = abs(road.k0[index]), abs(road.k1[index])
        if max(near, far) < largest_curvature * (1.0 - TOLERANCE):
            break
        largest_curvature = max(largest_curvature, near, far)
        index += step
    return 1.0 / max(largest_curvature, STRAIGHT)


def _direction(near_curvature: float, far_curvature: float) -> float:
    """Return the sign (1 left, -1 right) of an element beside a straight: of its curvature there or at its far end."""
    return float(np.sign(near_curvature if abs(near_curvature) > STRAIGHT else far_curvature))


def _arcs(road: Road) -> list[CurvatureRun]:
    """Return the arcs in order; where two clothoids meet at their sharper ends an arc of length 0 is added."""
    arcs = [run for run in road.runs if not run.straight]
    k0, k1 = road.k0, road.k1
    for i, (is_clothoid, is_next_clothoid) in enumerate(pairwise(~road.constant)):
        if (
            is_clothoid
            and is_next_clothoid
            and abs(k0[i]) < abs(k1[i])
            and abs(k1[i + 1]) < abs(k0[i + 1])
            and k1[i] * k0[i + 1] > 0.0
        ):
            station = float(road.starts[i + 1])
            arcs.append(CurvatureRun(station, station, float(k1[i]), i, i + 1))
    return sorted(arcs, key=lambda arc: (arc.start, arc.end))


def _radius_ratio(road: Road) -> Iterator[Finding]:
    """Yield a finding for neighbouring arcs, hardly apart, whose radii differ by too much; not in every class."""
    largest_ratio = road.limits.radius_ratio
    if not road.binds("radius_ratio") or np.isinf(largest_ratio):
        return
    straights = [run for run in road.runs if run.straight]
    starts = np.array([run.start for run in straights])
    lengths = np.concatenate(([0.0], np.cumsum([run.end - run.start for run in straights])))
    for arc_before, arc_after in pairwise(_arcs(road)):
        span = np.searchsorted(starts, [arc_before.end, arc_after.start])
        straight_length = lengths[span[1]] - lengths[span[0]]
        ratio = _ratio(arc_before.radius, arc_after.radius)
        if straight_length < road.two_seconds and min(arc_before.radius, arc_after.radius) < RADIUS_RATIO_BELOW:
            text = (
                f"The neighbouring radii {arc_before.radius:.0f} m and {arc_after.radius:.0f} m "
                f"are as 1 : {ratio:.2f}; 1 : {largest_ratio} is allowed below {RADIUS_RATIO_BELOW:.0f} m (RAA)."
            )
            yield from at_most(road.axis, arc_after.start, ratio, largest_ratio, text)


def _arc_length(road: Road) -> Iterator[Finding]:
    """Yield a finding for each arc that is too short: on motorways one that is passed in less than two seconds.

    Arcs that an end of the road cuts aren't judged: they go on beyond it. One of length 0 lies between two clothoids,
    which an end of the road can't cut.
    """
    needed_length = road.limits.shortest_arc
    if road.binds("arc_seconds"):
        needed_text = f"two seconds of travel are {needed_length:.1f} m (RAA)"
    else:
        needed_text = f"{needed_length:.0f} m are needed ({road.cite('arc_length', True)})"
    for arc in _arcs(road):
        is_between_clothoids = arc.length == 0.0
        if is_between_clothoids or not road.is_cut(arc):
            text = f"The arc is {arc.length:.1f} m long; {needed_text}."
            yield from at_least(road.axis, arc.start, arc.length, needed_length, text)


def _vertical_order(road: Road) -> Iterator[Finding]:
    """Yield a finding for each point of vertical intersection that doesn't follow those before it."""
    for number, station, largest_before in out_of_order(point.station for point in road.parameters.alignment.vertical):
        text = (
            f"Point of vertical intersection {number} at {station:.3f} m "
            f"does not follow the one at {largest_before:.3f} m."
        )
        yield Finding(road.axis, station, station, largest_before, text)


def _grade(road: Road) -> Iterator[Finding]:
    """Yield a finding for each grade, also within a cut rounding, that is steeper than the class allows."""
    profile, steepest_grade = road.vertical, road.limits.grade_percent
    grade_begins = np.concatenate(([-np.inf], profile.station + profile.tangents))
    grade_ends = np.concatenate((profile.station - profile.tangents, [np.inf]))
    grades = [
        (max(float(grade_begins[i]), 0.0), float(grade))
        for i, grade in enumerate(profile.grades)
        if grade_begins[i] < road.length and grade_ends[i] > 0.0 and grade_begins[i] <= grade_ends[i]
    ]
    # A rounding that the road's begin or end cuts: the steepest grade is that of the cut.
    for road_end in (0.0, road.length):
        for i in np.flatnonzero(np.abs(profile.station - road_end) < profile.tangents).tolist():
            share = (road_end - grade_ends[i]) / (2.0 * profile.tangents[i])
            grades.append((road_end, float(profile.grades[i] + share * (profile.grades[i + 1] - profile.grades[i]))))
    for station, grade in dict.fromkeys(grades):
        source = road.cite("grade_percent", True)
        text = f"The grade of {100.0 * grade:.2f} % is steeper than {steepest_grade} % ({source})."
        yield from at_most(road.axis, station, 100.0 * abs(grade), steepest_grade, text)


def _rounding(road: Road, kind: Literal["crest", "sag"]) -> Iterator[Finding]:
    """Yield a finding for each crest or sag on the road whose radius is below the class's smallest."""
    profile = road.vertical
    least_radius = road.limits.crest if kind == "crest" else road.limits.sag
    grade_change = np.diff(profile.grades) * (-1.0 if kind == "crest" else 1.0)
    on_road = (profile.station + profile.tangents > 0.0) & (profile.station - profile.tangents < road.length)
    for i in np.flatnonzero((grade_change > SAME_GRADE) & on_road):
        radius = profile.radius[i]
        radius_text = f"radius of {radius:.0f} m" if radius else "missing rounding"
        text = f"The {kind}'s {radius_text} is below {least_radius:.0f} m ({road.cite(kind, True)})."
        yield from at_least(road.axis, profile.station[i], radius, least_radius, text)


def _vertical_tangent(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crest or sag, wholly on the road, whose tangents are too short."""
    profile, least_length = road.vertical, road.limits.vertical_tangent
    on_road = (profile.station - profile.tangents > 0.0) & (profile.station + profile.tangents < road.length)
    is_rounded = np.abs(np.diff(profile.grades)) > SAME_GRADE
    for i in np.flatnonzero(is_rounded & on_road) if road.binds("vertical_tangent") else ():
        text = (
            f"The rounding's tangents are {profile.tangents[i]:.1f} m long; {least_length:.0f} m are needed "
            f"({road.cite('vertical_tangent', True)})."
        )
        yield from at_least(road.axis, profile.station[i], profile.tangents[i], least_length, text)


def _rounding_overlap(road: Road) -> Iterator[Finding]:
    """Yield a finding for neighbouring roundings whose tangents need more than the distance between them."""
    profile = road.vertical
    available = np.diff(profile.station)
    needed = profile.tangents[:-1] + profile.tangents[1:]
    for i in np.flatnonzero(needed > available * (1.0 + 1e-6)):
        text = (
            f"The tangents of two roundings need {needed[i]:.2f} m and have {available[i]:.2f} m between their points."
        )
        yield Finding(road.axis, profile.station[i + 1] - profile.tangents[i + 1], needed[i], available[i], text)


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
    Rule("vertical-tangent", "Shortest tangents of crests and sags", "m", "RAL", "confirmed", _vertical_tangent),
    Rule("rounding-overlap", "Roundings don't overlap", "m", "", "definition", _rounding_overlap),
)
