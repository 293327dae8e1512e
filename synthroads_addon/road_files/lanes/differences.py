"""In which fields two parameter sets of one road differ."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from typing import Any, NamedTuple

import numpy as np

from ...road.geometry import profile_of
from ...road.objects import RoadObject, width_at
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.section import Carriageway, CrossfallPoint

TOLERANCE = 1e-3
"""Lengths (m), percents and degrees that differ by less are the same."""
_CURVATURE = 1e-9
_SPACING = 5.0
_LEFT_ASIDE = frozenset({"instance", "pavement"})


class Difference(NamedTuple):
    """A field that differs.

    Attributes:
        field: its path, or an object's id where one of the sets has no such object.
        old, new: values, None where there is none.
        station: where the two differ most, m, of values by station; else None.
    """

    field: str
    old: Any
    new: Any
    station: float | None = None


def differences(old: RoadParameters, new: RoadParameters, types: Collection[str]) -> list[Difference]:
    """Return the differences of the objects of some types, by their ids, and of where the road lies.

    Values along the road are compared as functions of the station, whatever points they are given by. Instance numbers
    and pavements are left aside.
    """
    old_items = {name: item for name, item in old.objects.items() if type(item).__name__ in types}
    new_items = {name: item for name, item in new.objects.items() if type(item).__name__ in types}
    rows = list(_of_alignment(old, new))
    for name in sorted(
        {*old_items, *new_items}, key=lambda name: (name not in old_items, list({**old_items, **new_items}).index(name))
    ):
        if isinstance(old_items.get(name, new_items.get(name)), AlignmentObject):
            continue
        if name not in old_items or name not in new_items:
            types_of_both = [type(items[name]).__name__ if name in items else None for items in (old_items, new_items)]
            rows.append(Difference(f"objects.{name}", types_of_both[0], types_of_both[1]))
            continue
        rows += _of_object(f"objects.{name}", old_items[name], new_items[name], new.alignment.length)
    return rows


def _of_alignment(old: RoadParameters, new: RoadParameters) -> Iterator[Difference]:
    """Yield the differences of start, elements in plan and heights of two sets' alignments."""
    old_alignment, new_alignment = old.alignment, new.alignment
    for axis, name in enumerate(("start_x", "start_y")):
        values = [getattr(s.alignment, name) + s.transform.translate[axis] for s in (old, new)]
        if abs(values[1] - values[0]) > TOLERANCE:
            yield Difference(f"alignment.{name}", *(round(value, 6) for value in values))
    turn_deg = (new_alignment.start_heading_deg - old_alignment.start_heading_deg + 180.0) % 360.0 - 180.0
    if abs(turn_deg) > TOLERANCE / 100.0:
        yield Difference(
            "alignment.start_heading_deg", old_alignment.start_heading_deg, new_alignment.start_heading_deg
        )
    for number, (old_element, new_element) in enumerate(
        itertools.zip_longest(old_alignment.horizontal, new_alignment.horizontal)
    ):
        path = f"alignment.horizontal.{number}"
        if old_element is None or new_element is None:
            yield Difference(path, old_element and old_element.kind, new_element and new_element.kind)
            continue
        for name, tolerance in (("length", TOLERANCE), ("curvature_start", _CURVATURE), ("curvature_end", _CURVATURE)):
            if abs(getattr(new_element, name) - getattr(old_element, name)) > tolerance:
                yield Difference(f"{path}.{name}", getattr(old_element, name), getattr(new_element, name))
    station = np.linspace(
        0.0, min(old_alignment.length, new_alignment.length), 2 + int(old_alignment.length / _SPACING)
    )
    heights = [profile_of(s.alignment).elevation(station) + s.transform.translate[2] for s in (old, new)]
    yield from _largest_difference("alignment.vertical", station, *heights)


def _largest_difference(
    path: str, station: np.ndarray, old_values: np.ndarray, new_values: np.ndarray
) -> Iterator[Difference]:
    """Yield the place at which two functions of the station (N,) differ most, unless they are the same."""
    row = int(np.abs(new_values - old_values).argmax())
    if abs(new_values[row] - old_values[row]) > TOLERANCE:
        yield Difference(
            path, round(float(old_values[row]), 6), round(float(new_values[row]), 6), round(float(station[row]), 3)
        )


def _of_object(path: str, old: RoadObject, new: RoadObject, length: float) -> Iterator[Difference]:
    """Yield the differences of two objects of one id by field; widths are compared at stations up to a length."""
    if type(old) is not type(new):
        yield Difference(f"{path}.type", type(old).__name__, type(new).__name__)
        return
    station = np.linspace(0.0, length, 2 + int(length / _SPACING))
    for name in type(old).model_fields:
        old_value, new_value = getattr(old, name), getattr(new, name)
        if name in _LEFT_ASIDE:
            continue
        if name == "lanes":
            for number, (old_lane, new_lane) in enumerate(itertools.zip_longest(old_value, new_value)):
                if old_lane is None or new_lane is None:
                    yield Difference(f"{path}.lanes.{number}", old_lane and old_lane.kind, new_lane and new_lane.kind)
                else:
                    yield from _largest_difference(
                        f"{path}.lanes.{number}.width",
                        station,
                        width_at(old_lane.width, station),
                        width_at(new_lane.width, station),
                    )
        elif _is_width(old, name, old_value) or _is_width(old, name, new_value):
            yield from _largest_difference(
                f"{path}.{name}", station, width_at(old_value, station), width_at(new_value, station)
            )
        elif isinstance(old_value, tuple) and old_value and isinstance(old_value[0], CrossfallPoint):
            yield from _largest_difference(
                f"{path}.{name}", station, _crossfall(old_value, station), _crossfall(new_value, station)
            )
        elif not _same(old_value, new_value, turns=name.endswith("_deg")):
            yield Difference(f"{path}.{name}", _shown(old_value), _shown(new_value))


def _crossfall(points: tuple[CrossfallPoint, ...], station: np.ndarray) -> np.ndarray:
    """Return the crossfall (N,), %, at stations (N,), m."""
    return np.interp(station, [p.station for p in points], [p.crossfall_percent for p in points])


def _is_width(item: RoadObject, name: str, value: Any) -> bool:
    """Return whether a field's value is a width: one number of a carriageway, or points with station and width."""
    by_station = (
        isinstance(value, tuple) and bool(value) and hasattr(value[0], "width") and hasattr(value[0], "station")
    )
    return by_station or (isinstance(item, Carriageway) and isinstance(value, float) and name != "verge_slope_percent")


def _same(a: Any, b: Any, turns: bool = False) -> bool:
    """Return whether two values are the same within `TOLERANCE`; `turns` are angles in degrees, compared modulo 360."""
    if isinstance(a, int | float) and isinstance(b, int | float) and not isinstance(a, bool):
        difference = abs((b - a + 180.0) % 360.0 - 180.0) if turns else abs(b - a)
        return difference <= TOLERANCE
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if hasattr(a, "to_dict") and type(a) is type(b):  # models, such as points by station
        return all(_same(getattr(a, name), getattr(b, name)) for name in type(a).model_fields)
    return bool(a == b)


def _shown(value: Any) -> Any:
    """Return a field's value as JSON data."""
    if isinstance(value, tuple):
        return [_shown(each) for each in value]
    return value.to_dict() if hasattr(value, "to_dict") else value
