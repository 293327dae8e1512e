"""Fixes of rules that rows of a road's tables break: the smallest change of a row which keeps the rule."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ...base.errors import InputError
from ...base.schema import round_value
from ...checking.rules.rule import Violation
from ...road.crossfall import crossfall_points
from ...road.guidelines import LIMITS
from ...road.objects import nominal_width
from ...road.other_roads.axis import VerticalPoint
from ...road.section import Carriageway
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


def crossfall_fix(road: StatedRoad, design_class: str, name: str) -> Fix:
    """Return the crossfall of a carriageway, by its id, as the rules derive it from the elements."""
    return Fix("Crossfall by Rule", lambda now: with_crossfall_by_rule(now, design_class, name))


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
