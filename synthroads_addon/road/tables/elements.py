"""The horizontal alignment as a table: a row for each straight, clothoid and arc, with length, radius and A.

Elements are chained from the road's beginning, so that what follows an edited element moves along. A clothoid takes the
curvatures of the straights and arcs beside it. Where that changes them it keeps its parameter A, and its length
follows: with the curvatures k0 and k1 at its ends, ``L = A^2 |k1 - k0|``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ...base.errors import InputError
from ..guidelines import LIMITS
from ..other_roads.axis import LONGEST_ROAD, HorizontalElement
from .stations import StationMap, same_stations, stretched, with_insertion, without_element

Elements = tuple[HorizontalElement, ...]
Kind = Literal["line", "arc", "clothoid"]
KIND_NAMES = {"line": "Straight", "clothoid": "Clothoid", "arc": "Arc"}
"""Kinds of elements as they are shown."""
DIGITS = 6
"""Decimals of the metres in a table: a micrometre, beyond which a radius' reciprocal isn't reproduced."""
SHORTEST = 0.01
"""Shortest element, m, that can be stated here. Chosen: below it a slip of the keys is likelier than an element."""
SMALLEST_RADIUS, LARGEST_RADIUS = 10.0, 1e6
"""Smallest radius of a parameter set (curvature 0.1 1/m), and the largest that is told from a straight, m."""


@dataclass(frozen=True)
class ElementRow:
    """Row of an element in the table.

    Attributes:
        kind: of the element.
        station: of its beginning, m.
        length: m.
        radius_start, radius_end: at its ends, m, positive in a left curve; 0 where it is straight.
        parameter: A of a clothoid, m; 0 of others.
    """

    kind: Kind
    station: float
    length: float
    radius_start: float
    radius_end: float
    parameter: float

    @property
    def radius(self) -> float:
        """Return the sharper one of the radii at its ends, m; 0 on a straight."""
        radii = [radius for radius in (self.radius_start, self.radius_end) if radius]
        return min(radii, key=abs, default=0.0)


@dataclass(frozen=True)
class ElementsEdit:
    """Elements after an edit, and where the stations of before are now."""

    elements: Elements
    stations: StationMap


def element_rows(elements: Sequence[HorizontalElement]) -> list[ElementRow]:
    """Return the table's rows of elements.

    Example:
        >>> arc = HorizontalElement.between(150.0, 1 / 450, 1 / 450)
        >>> [(row.kind, row.station, row.radius) for row in element_rows([arc, arc])]
        [('arc', 0.0, 450.0), ('arc', 150.0, 450.0)]
    """
    rows, station = [], 0.0
    for element in elements:
        rows.append(
            ElementRow(
                element.kind,
                round(station, DIGITS),
                round(element.length, DIGITS),
                _radius(element.curvature_start),
                _radius(element.curvature_end),
                round(clothoid_parameter(element), DIGITS),
            )
        )
        station += element.length
    return rows


def elements_of(rows: Sequence[ElementRow]) -> Elements:
    """Return the elements that a table states: of a clothoid A counts, or its length where A is 0.

    Raises:
        InputError: a length, radius or parameter isn't allowed.
    """
    elements = []
    for number, row in enumerate(rows):
        start, end = (_curvature(number, radius) for radius in (row.radius_start, row.radius_end))
        length = row.length
        if row.kind == "clothoid" and row.parameter:
            length = row.parameter**2 * abs(end - start)
        elements.append(_element(number, length, start, end))
    return tuple(elements)


def clothoid_parameter(element: HorizontalElement) -> float:
    """Return the parameter A of a clothoid, m; 0 of a straight or an arc."""
    change = abs(element.curvature_end - element.curvature_start)
    return math.sqrt(element.length / change) if change else 0.0


def with_length(elements: Elements, number: int, length: float) -> ElementsEdit:
    """Return elements of which one has another length, m; a clothoid's A follows.

    Args:
        elements: as they are.
        number: of the element, from 0.
        length: m.

    Raises:
        InputError: the length isn't allowed.
    """
    element = elements[number]
    changed = _element(number, length, element.curvature_start, element.curvature_end)
    return _edit(elements, _replaced(elements, {number: changed}))


def with_parameter(elements: Elements, number: int, parameter: float) -> ElementsEdit:
    """Return elements of which a clothoid has another A, m; its length follows. InputError as `with_length`."""
    element = elements[number]
    change = abs(element.curvature_end - element.curvature_start)
    if not change:
        raise InputError(f"A of Element {number + 1}", parameter, "only a clothoid has one: choose Clothoid first")
    return with_length(elements, number, parameter**2 * change)


def with_radius(elements: Elements, number: int, radius: float) -> ElementsEdit:
    """Return elements of which one is an arc of another radius; clothoids beside it follow, with their A.

    Args:
        elements: as they are.
        number: of the arc, from 0.
        radius: m, positive in a left curve.

    Raises:
        InputError: the radius isn't allowed, or a clothoid beside it would be longer than any road.
    """
    if not radius:
        raise InputError(f"Radius of Element {number + 1}", radius, "an arc needs one: choose Straight for none")
    curvature = _curvature(number, radius)
    changed = _element(number, elements[number].length, curvature, curvature)
    return _edit(elements, _joined(_replaced(elements, {number: changed}), elements, number))


def with_end_radius(elements: Elements, number: int, radius: float, at_end: bool) -> ElementsEdit:
    """Return elements of which a clothoid has another radius at one end, as has a clothoid that meets it there.

    Args:
        elements: as they are.
        number: of the clothoid, from 0.
        radius: m, positive in a left curve; 0 where it is straight.
        at_end: whether it is that at the end, else at the beginning.

    Raises:
        InputError: a straight or an arc beside it decides that radius, or it isn't allowed.
    """
    element, beside = elements[number], number + (1 if at_end else -1)
    words = f"Radius at {'End' if at_end else 'Beginning'} of Element {number + 1}"
    has_neighbour = 0 <= beside < len(elements)
    if element.kind != "clothoid" or (has_neighbour and elements[beside].kind != "clothoid"):
        raise InputError(words, radius, "the element beside it decides it: change the radius there")
    curvature, changes = _curvature(number, radius), {}
    changes[number] = _with_ends(number, element, **{"end" if at_end else "start": curvature})
    if has_neighbour:
        changes[beside] = _with_ends(beside, elements[beside], **{"start" if at_end else "end": curvature})
    return _edit(elements, _replaced(elements, changes))


def with_kind(elements: Elements, number: int, kind: Kind, design_class: str) -> ElementsEdit:
    """Return elements of which one is of another kind; clothoids beside it follow.

    An arc gets the curvature that the element has where it is sharpest, else the smallest radius of the design class.

    Raises:
        InputError: a clothoid would have the same radius at both ends.
    """
    element = elements[number]
    if kind == element.kind:
        return _edit(elements, elements)
    if kind == "clothoid":
        start, end = _neighbour_curvatures(elements, number)
        if start == end:
            raise InputError(
                f"Kind of Element {number + 1}", "Clothoid", "both neighbours have the same radius: change one first"
            )
        parameter = _usual_parameter(design_class, start, end)
        changed = _element(number, parameter**2 * abs(end - start), start, end)
        return _edit(elements, _replaced(elements, {number: changed}))
    curvature = 0.0
    if kind == "arc":
        curvature = max((element.curvature_start, element.curvature_end), key=abs)
        curvature = curvature or 1.0 / LIMITS[design_class].radius
    changed = _element(number, element.length, curvature, curvature)
    return _edit(elements, _joined(_replaced(elements, {number: changed}), elements, number))


def with_inserted(elements: Elements, number: int, kind: Kind, design_class: str) -> ElementsEdit:
    """Return elements with a new one as the element of a number, from 0 to their count; what follows moves along.

    A straight and an arc last two seconds of travel, an arc has the smallest radius of the design class; a clothoid
    leads from the element before to the one after it (a straight at the road's ends), with the smallest A for them.

    Raises:
        InputError: a clothoid would have the same radius at both ends.
    """
    limits = LIMITS[design_class]
    length, start, end = math.ceil(1e3 * limits.speed / 3.6 * 2.0) / 1e3, 0.0, 0.0
    if kind == "arc":
        start = end = 1.0 / limits.radius
    elif kind == "clothoid":
        start = elements[number - 1].curvature_end if number else 0.0
        end = elements[number].curvature_start if number < len(elements) else 0.0
        if start == end:
            raise InputError(
                "Insert Clothoid", None, "both neighbours have the same radius there: insert an arc or straight first"
            )
        length = _usual_parameter(design_class, start, end) ** 2 * abs(end - start)
    new = _element(number, length, start, end)
    inserted = (*elements[:number], new, *elements[number:])
    _check_length(inserted)
    return ElementsEdit(inserted, with_insertion([e.length for e in elements], number, new.length))


def without(elements: Elements, number: int) -> ElementsEdit:
    """Return elements without one, and what stood on it is gone; what follows moves up. InputError for the only one."""
    if len(elements) < 2:
        raise InputError("Delete Element", None, "a road needs one element at least")
    rest = (*elements[:number], *elements[number + 1 :])
    return ElementsEdit(rest, without_element([e.length for e in elements], number))


def with_split(elements: Elements, number: int, distance: float) -> ElementsEdit:
    """Return elements of which one is two, divided at a distance, m, from its beginning; the road stays the same.

    Raises:
        InputError: the distance isn't within the element.
    """
    element = elements[number]
    if not SHORTEST <= distance <= element.length - SHORTEST:
        raise InputError(
            f"Distance in Element {number + 1}",
            distance,
            f"must be from {SHORTEST:g} to {element.length - SHORTEST:.6g} m, within its length",
        )
    # Curvature is linear along the element.
    share = distance / element.length
    middle = element.curvature_start + share * (element.curvature_end - element.curvature_start)
    first = _element(number, distance, element.curvature_start, middle)
    second = _element(number, element.length - distance, middle, element.curvature_end)
    split = (*elements[:number], first, second, *elements[number + 1 :])
    return ElementsEdit(split, same_stations(math.fsum(e.length for e in elements)))


def with_clothoid_between(elements: Elements, number: int, design_class: str) -> ElementsEdit:
    """Return elements whose curvature doesn't jump before one of them: a clothoid there is fitted, else inserted.

    Args:
        elements: as they are.
        number: of the element at whose beginning the curvature jumps, from 1.
        design_class: of the road.
    """
    before, after = elements[number - 1], elements[number]
    if after.kind == "clothoid":
        changed = _with_ends(number, after, start=before.curvature_end)
        return _edit(elements, _replaced(elements, {number: changed}))
    if before.kind == "clothoid":
        changed = _with_ends(number - 1, before, end=after.curvature_start)
        return _edit(elements, _replaced(elements, {number - 1: changed}))
    return with_inserted(elements, number, "clothoid", design_class)


def _usual_parameter(design_class: str, start: float, end: float) -> float:
    """Return the smallest A (m) that the class allows between two curvatures (1/m): R/3 to R, of whole 10 m."""
    radius = 1.0 / max(abs(start), abs(end))
    least = max(LIMITS[design_class].clothoid, radius / 3.0)
    return min(10.0 * math.ceil(least / 10.0 - 1e-9), radius) if radius >= least else radius


def _neighbour_curvatures(elements: Elements, number: int) -> tuple[float, float]:
    """Return the curvatures (1/m) with which the elements before and after one end and begin; 0 beyond the road."""
    start = elements[number - 1].curvature_end if number else 0.0
    end = elements[number + 1].curvature_start if number + 1 < len(elements) else 0.0
    return start, end


def _joined(elements: Elements, before: Elements, number: int) -> Elements:
    """Return elements with the clothoids beside one fitted to it; they keep the parameter that they had before."""
    element, changes = elements[number], {}
    if number and before[number - 1].kind == "clothoid":
        changes[number - 1] = _with_ends(number - 1, before[number - 1], end=element.curvature_start)
    if number + 1 < len(elements) and before[number + 1].kind == "clothoid":
        changes[number + 1] = _with_ends(number + 1, before[number + 1], start=element.curvature_end)
    return _replaced(elements, changes)


def _with_ends(
    number: int, element: HorizontalElement, start: float | None = None, end: float | None = None
) -> HorizontalElement:
    """Return a clothoid with other curvatures (1/m) at its ends and the same A; of equal ones its length counts."""
    start = element.curvature_start if start is None else start
    end = element.curvature_end if end is None else end
    if (start, end) == (element.curvature_start, element.curvature_end):
        return element
    length = element.length
    if start != end:
        length = clothoid_parameter(element) ** 2 * abs(end - start)
    return _element(number, length, start, end)


def _edit(before: Elements, after: Elements) -> ElementsEdit:
    """Return an edit that changes no number of elements."""
    _check_length(after)
    return ElementsEdit(after, stretched([e.length for e in before], [e.length for e in after]))


def _check_length(elements: Elements) -> None:
    """Raise `InputError` if a road of these elements is too long."""
    length = math.fsum(element.length for element in elements)
    if length > LONGEST_ROAD:
        raise InputError("Length of the Road", round(length, 3), f"must be at most {LONGEST_ROAD:,.0f} m")


def _replaced(elements: Elements, changes: dict[int, HorizontalElement]) -> Elements:
    """Return elements of which some, by number from 0, are replaced."""
    return tuple(changes.get(number, element) for number, element in enumerate(elements))


def _element(number: int, length: float, start: float, end: float) -> HorizontalElement:
    """Return an element of a length (m) and curvatures (1/m); `InputError` names its row and what is allowed."""
    if not SHORTEST <= length <= LONGEST_ROAD:
        raise InputError(
            f"Length of Element {number + 1}",
            round(length, DIGITS),
            f"must be from {SHORTEST:g} to {LONGEST_ROAD:,.0f} m",
        )
    return HorizontalElement.between(length, start, end)


def _radius(curvature: float) -> float:
    """Return the radius (m, with the curvature's sign) of a curvature (1/m); 0 on a straight."""
    return round(1.0 / curvature, DIGITS) if curvature else 0.0


def _curvature(number: int, radius: float) -> float:
    """Return the curvature (1/m) of a signed radius (m), 0 for 0; `InputError` names the row and what is allowed."""
    if not radius:
        return 0.0
    if not SMALLEST_RADIUS <= abs(radius) <= LARGEST_RADIUS:
        raise InputError(
            f"Radius of Element {number + 1}",
            radius,
            f"must be from {SMALLEST_RADIUS:g} to {LARGEST_RADIUS:,.0f} m, negative in a right curve",
        )
    return 1.0 / radius
