"""Fixes of rules that rows of a road's tables break: the smallest change of a row which keeps the rule."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.schema import round_value
from ...checking.rules.rule import Violation
from ...road.crossfall import crossfall_points
from ...road.guidelines import LIMITS
from ...road.objects import nominal_width
from ...road.other_roads.axis import VerticalPoint
from ...road.section import Carriageway, CrossfallPoint
from ...road.tables.elements import (
    Elements,
    ElementsEdit,
    clothoid_parameter,
    with_clothoid_between,
    with_end_radius,
    with_length,
    with_parameter,
    with_radius,
)
from ...road.tables.points import strip_names, strip_width, with_vertical_point, with_width
from ...road.tables.stated import StatedRoad

_STEP, _STEPS = 1.05, 60
"""Factor by which clothoids are lengthened until a run-off fits, and how often at most: up to 18 times."""
_SPARE = 1e-3
"""Distance of a fixed value from its limit, m: the tables' numbers are rounded."""


@dataclass(frozen=True)
class Fix:
    """A change of a road that mends a broken rule.

    Attributes:
        text: what is done, with its value: ``Set Radius to 900 m``.
        change: function from the stated road to the mended one.
    """

    text: str
    change: Callable[[StatedRoad], StatedRoad]


def element_fix(road: StatedRoad, design_class: str, number: int, violation: Violation) -> Fix | None:
    """Return what mends a broken rule of an element, by its number from 0; None if there is nothing so simple."""
    elements, limits = road.alignment.horizontal, LIMITS[design_class]
    element, rule = elements[number], violation.rule
    if rule == "curvature-jump" and number:
        beside = {elements[number - 1].kind, element.kind}
        text = "Fit Clothoid to Its Neighbour" if "clothoid" in beside else "Insert Clothoid Before It"
        return _of_elements(text, lambda now: with_clothoid_between(now, number, design_class))
    if rule == "straight-longest":
        return _length_fix(number, limits.straight_longest)
    if rule in ("straight-between", "arc-length") and element.kind != "clothoid":
        return _length_fix(number, math.ceil(1e3 * violation.limit) / 1e3)
    if rule == "radius-minimum":
        if element.kind == "arc":
            return _radius_fix(elements, number, limits.radius)
        return _end_fix(elements, number, limits.radius)
    if rule == "radius-ratio":
        return _ratio_fix(elements, number, limits.radius_ratio)
    if rule == "clothoid-minimum":
        return _parameter_fix(number, limits.clothoid)
    if rule in ("clothoid-short", "clothoid-long"):
        return _parameter_fix(number, violation.limit)
    if rule == "clothoid-ratio" and number:
        parameters = [clothoid_parameter(elements[i]) for i in (number - 1, number)]
        smaller = number - 1 + parameters.index(min(parameters))
        return _parameter_fix(smaller, max(parameters) / limits.clothoid_ratio)
    return None


def vertical_fix(road: StatedRoad, design_class: str, number: int, violation: Violation) -> Fix | None:
    """Return what mends a broken rule of a vertical point, by its number from 0; None if there is nothing so simple."""
    points = road.alignment.vertical
    if violation.rule in ("crest-radius", "sag-radius"):
        return _vertical_fix(f"Set Radius to {violation.limit:,.0f} m", number, radius=violation.limit)
    if violation.rule == "grade-maximum" and number + 1 < len(points):
        here, there = points[number], points[number + 1]
        steepest = LIMITS[design_class].grade_percent / 100.0
        rise = steepest * (there.station - here.station) * (1.0 if there.elevation > here.elevation else -1.0)
        elevation = round_value(here.elevation + rise, 6)
        return _vertical_fix(f"Set Height of Point {number + 2} to {elevation:.2f} m", number + 1, elevation=elevation)
    if violation.rule == "rounding-overlap":
        radius = round_value(points[number].radius * violation.limit / violation.value - _SPARE, 3)
        return _vertical_fix(f"Set Radius to {radius:,.0f} m", number, radius=max(radius, 0.0))
    if violation.rule == "vertical-order":
        return Fix("Sort Points by Station", _sorted)
    return None


def crossfall_fix(road: StatedRoad, design_class: str, name: str, violation: Violation) -> Fix:
    """Return what mends a broken rule of a carriageway's crossfall, by its id.

    That is the crossfall as the rules derive it from the elements. Where it is so already and its run-off is too steep,
    the clothoids along which it runs off are too short, and are lengthened.
    """
    derived = with_crossfall_by_rule(road, design_class, name)
    is_by_rule = derived.carriageways[name].crossfall == road.carriageways[name].crossfall
    numbers = _clothoids_of_run_off(road, name, violation.station) if is_by_rule else ()
    if violation.rule != "run-off-steepest" or not numbers:
        return Fix("Crossfall by Rule", lambda now: with_crossfall_by_rule(now, design_class, name))
    mended = _with_longer_clothoids(road, design_class, name, numbers, violation)
    longest = max(mended.alignment.horizontal[number].length for number in numbers)
    elements = {number: mended.alignment.horizontal[number].length for number in numbers}
    return Fix(f"Lengthen Clothoids to {longest:,.1f} m", lambda now: _with_lengths(now, design_class, elements))


def _with_longer_clothoids(
    road: StatedRoad, design_class: str, name: str, numbers: Sequence[int], violation: Violation
) -> StatedRoad:
    """Return a road with clothoids so long that a carriageway's edge runs off no steeper than is allowed.

    Args:
        road: whose crossfall is by rule.
        design_class: of the road.
        name: of the carriageway.
        numbers: of the clothoids, from 0.
        violation: of the run-off.
    """
    points = road.carriageways[name].crossfall
    first = next(row for row, point in enumerate(points) if abs(point.station - violation.station) < _SPARE)
    lever = violation.value / _slope(points, first)
    flat = LIMITS[design_class].least_crossfall_percent * (1.0 + _SPARE)
    lengths = {number: road.alignment.horizontal[number].length for number in numbers}
    longer = road
    for _ in range(_STEPS):
        lengths = {number: round_value(_STEP * length, 3) for number, length in lengths.items()}
        longer = _with_lengths(road, design_class, lengths)
        starts = np.cumsum([0.0, *(element.length for element in longer.alignment.horizontal)])
        points = longer.carriageways[name].crossfall
        pieces = [
            row
            for row in range(len(points) - 1)
            if starts[min(numbers)] - _SPARE <= points[row].station < starts[max(numbers) + 1] - _SPARE
            and max(abs(point.crossfall_percent) for point in points[row : row + 2]) > flat
        ]
        if all(lever * _slope(points, row) <= violation.limit for row in pieces):
            break
    return longer


def _slope(points: Sequence[CrossfallPoint], row: int) -> float:
    """Return the change of crossfall behind a point, % per m."""
    here, there = points[row], points[row + 1]
    return abs(there.crossfall_percent - here.crossfall_percent) / (there.station - here.station)


def _with_lengths(road: StatedRoad, design_class: str, lengths: Mapping[int, float]) -> StatedRoad:
    """Return a road with elements of other lengths, m, by number, and the crossfall by rule on all carriageways."""
    for number, length in lengths.items():
        road = road.with_elements(with_length(road.alignment.horizontal, number, length))
    for name in road.carriageways:
        road = with_crossfall_by_rule(road, design_class, name)
    return road


def _clothoids_of_run_off(road: StatedRoad, name: str, station: float) -> tuple[int, ...]:
    """Return the numbers of the clothoids along which a carriageway's crossfall runs off from a station (m) on."""
    stations = [point.station for point in road.carriageways[name].crossfall]
    end = min((other for other in stations if other > station + _SPARE), default=station)
    starts = np.cumsum([0.0, *(element.length for element in road.alignment.horizontal)])
    return tuple(
        number
        for number, element in enumerate(road.alignment.horizontal)
        if element.kind == "clothoid" and starts[number] < end - _SPARE and starts[number + 1] > station + _SPARE
    )


def with_crossfall_by_rule(road: StatedRoad, design_class: str, name: str) -> StatedRoad:
    """Return a road with a carriageway's crossfall as the RAA have it for its elements: run-offs along clothoids."""
    carriageway = road.carriageways[name]
    # The pavement turns about its middle, its inner edge or the centreline: the farther edge's distance from there.
    width = paved_width(carriageway)
    half_width = {
        "carriageway_axis": width / 2.0,
        "inner_edge": width,
        "centreline": nominal_width(carriageway.inner_offset) + width,
    }[carriageway.rotation_axis]
    points = crossfall_points(design_class, carriageway.side, half_width, road.alignment.horizontal)
    return road.with_carriageway(name, carriageway.model_copy(update={"crossfall": points}))


def paved_width(carriageway: Carriageway) -> float:
    """Return the largest width of a carriageway's pavement, m, without turnouts."""
    names = [name for name in strip_names(carriageway) if name not in ("Inner Offset", "Verge")]
    return sum(nominal_width(strip_width(carriageway, name)) for name in names)


def width_fix(name: str, strip: str, number: int, violation: Violation) -> Fix | None:
    """Return what mends a strip that is too narrow, by its carriageway's id, its name and its row; None else."""
    if violation.rule in ("lane-taper", "width-order"):
        return None
    missing = violation.limit - violation.value
    if violation.rule == "median-width":

        def widened(now: StatedRoad) -> StatedRoad:
            offset = nominal_width(now.carriageways[name].inner_offset) + missing
            return _with_width(now, name, strip, number, round_value(offset, 6))

        return Fix(f"Move Pavement {missing:.2f} m Outwards", widened)
    text = f"Set Width to {violation.limit:.2f} m"
    return Fix(text, lambda now: _with_width(now, name, strip, number, violation.limit))


def _with_width(road: StatedRoad, name: str, strip: str, number: int, width: float) -> StatedRoad:
    """Return a road with a width, m, in a row of a carriageway's strip."""
    return road.with_carriageway(name, with_width(road.carriageways[name], strip, number, width=width))


def _of_elements(text: str, change: Callable[[Elements], ElementsEdit]) -> Fix:
    """Return a fix that edits the elements."""
    return Fix(text, lambda road: road.with_elements(change(road.alignment.horizontal)))


def _length_fix(number: int, length: float) -> Fix:
    """Return the fix that gives an element a length, m."""
    return _of_elements(f"Set Length to {length:,.1f} m", lambda now: with_length(now, number, length))


def _parameter_fix(number: int, parameter: float) -> Fix:
    """Return the fix that gives a clothoid a parameter, m."""
    parameter = round_value(parameter, 6)
    return _of_elements(
        f"Set A of Element {number + 1} to {parameter:,.1f} m", lambda now: with_parameter(now, number, parameter)
    )


def _radius_fix(elements: Elements, number: int, radius: float) -> Fix:
    """Return the fix that gives an arc a radius, m, turning as it does."""
    signed = round_value(radius if elements[number].curvature_start > 0.0 else -radius, 6)
    return _of_elements(
        f"Set Radius of Element {number + 1} to {abs(signed):,.0f} m", lambda now: with_radius(now, number, signed)
    )


def _end_fix(elements: Elements, number: int, radius: float) -> Fix | None:
    """Return the fix that gives the sharper end of a clothoid a radius, m; None where an element beside decides it."""
    element = elements[number]
    at_end = abs(element.curvature_end) > abs(element.curvature_start)
    curvature = element.curvature_end if at_end else element.curvature_start
    signed = radius if curvature > 0.0 else -radius
    try:
        with_end_radius(elements, number, signed, at_end)
    except InputError:
        return None
    text = f"Set Radius at Its {'End' if at_end else 'Beginning'} to {radius:,.0f} m"
    return _of_elements(text, lambda now: with_end_radius(now, number, signed, at_end))


def _ratio_fix(elements: Elements, number: int, largest_ratio: float) -> Fix | None:
    """Return the fix that widens the sharper one of an arc and the arc before it; None where there are none."""
    arcs = [i for i in range(number + 1) if elements[i].kind == "arc"][-2:]
    if len(arcs) < 2:
        return None
    radii = [1.0 / abs(elements[i].curvature_start) for i in arcs]
    # Rounded up, so that the ratio stays within its limit.
    return _radius_fix(elements, arcs[radii.index(min(radii))], max(radii) / largest_ratio + _SPARE)


def _vertical_fix(text: str, number: int, **values: float) -> Fix:
    """Return the fix that gives a vertical point other values."""
    return Fix(text, lambda road: road.with_alignment(with_vertical_point(road.alignment, number, **values)))


def _sorted(road: StatedRoad) -> StatedRoad:
    """Return a road with its vertical points in the order of their stations, the first one of each station kept."""
    points: dict[float, VerticalPoint] = {}
    for point in road.alignment.vertical:
        points.setdefault(point.station, point)
    ordered = tuple(points[station] for station in sorted(points))
    return road.with_alignment(road.alignment.model_copy(update={"vertical": ordered}))
