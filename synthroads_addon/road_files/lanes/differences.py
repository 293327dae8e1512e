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
    before = {name: item for name, item in old.objects.items() if type(item).__name__ in types}
    after = {name: item for name, item in new.objects.items() if type(item).__name__ in types}
    result = list(_of_alignment(old, new))
    for name in sorted({*before, *after}, key=lambda name: (name not in before, list({**before, **after}).index(name))):
        if isinstance(before.get(name, after.get(name)), AlignmentObject):
            continue
        if name not in before or name not in after:
            shown = [type(items[name]).__name__ if name in items else None for items in (before, after)]
            result.append(Difference(f"objects.{name}", shown[0], shown[1]))
            continue
        result += _of_object(f"objects.{name}", before[name], after[name], new.alignment.length)
    return result


def _of_alignment(old: RoadParameters, new: RoadParameters) -> Iterator[Difference]:
    first, second = old.alignment, new.alignment
    for axis, name in enumerate(("start_x", "start_y")):
        values = [getattr(s.alignment, name) + s.transform.translate[axis] for s in (old, new)]
        if abs(values[1] - values[0]) > TOLERANCE:
            yield Difference(f"alignment.{name}", *(round(value, 6) for value in values))
    turn = (second.start_heading_deg - first.start_heading_deg + 180.0) % 360.0 - 180.0
    if abs(turn) > TOLERANCE / 100.0:
        yield Difference("alignment.start_heading_deg", first.start_heading_deg, second.start_heading_deg)
    for number, (a, b) in enumerate(itertools.zip_longest(first.horizontal, second.horizontal)):
        path = f"alignment.horizontal.{number}"
        if a is None or b is None:
            yield Difference(path, a and a.kind, b and b.kind)
            continue
        for name, least in (("length", TOLERANCE), ("curvature_start", _CURVATURE), ("curvature_end", _CURVATURE)):
            if abs(getattr(b, name) - getattr(a, name)) > least:
                yield Difference(f"{path}.{name}", getattr(a, name), getattr(b, name))
    station = np.linspace(0.0, min(first.length, second.length), 2 + int(first.length / _SPACING))
    heights = [profile_of(s.alignment).elevation(station) + s.transform.translate[2] for s in (old, new)]
    yield from _apart("alignment.vertical", station, *heights)


def _apart(path: str, station: np.ndarray, old: np.ndarray, new: np.ndarray) -> Iterator[Difference]:
    """Yield the place at which two functions of the station are farthest apart, if they aren't the same."""
    at = int(np.abs(new - old).argmax())
    if abs(new[at] - old[at]) > TOLERANCE:
        yield Difference(path, round(float(old[at]), 6), round(float(new[at]), 6), round(float(station[at]), 3))


def _of_object(path: str, old: RoadObject, new: RoadObject, length: float) -> Iterator[Difference]:
    if type(old) is not type(new):
        yield Difference(f"{path}.type", type(old).__name__, type(new).__name__)
        return
    station = np.linspace(0.0, length, 2 + int(length / _SPACING))
    for name in type(old).model_fields:
        a, b = getattr(old, name), getattr(new, name)
        if name in _LEFT_ASIDE:
            continue
        if name == "lanes":
            for number, (one, other) in enumerate(itertools.zip_longest(a, b)):
                if one is None or other is None:
                    yield Difference(f"{path}.lanes.{number}", one and one.kind, other and other.kind)
                else:
                    yield from _apart(
                        f"{path}.lanes.{number}.width",
                        station,
                        width_at(one.width, station),
                        width_at(other.width, station),
                    )
        elif _is_width(old, name, a) or _is_width(old, name, b):
            yield from _apart(f"{path}.{name}", station, width_at(a, station), width_at(b, station))
        elif isinstance(a, tuple) and a and isinstance(a[0], CrossfallPoint):
            yield from _apart(f"{path}.{name}", station, _crossfall(a, station), _crossfall(b, station))
        elif not _same(a, b, turns=name.endswith("_deg")):
            yield Difference(f"{path}.{name}", _shown(a), _shown(b))


def _crossfall(points: tuple[CrossfallPoint, ...], station: np.ndarray) -> np.ndarray:
    """Return the crossfall (N,), %, at stations (N,), m."""
    return np.interp(station, [p.station for p in points], [p.crossfall_percent for p in points])


def _is_width(item: RoadObject, name: str, value: Any) -> bool:
    by_station = (
        isinstance(value, tuple) and bool(value) and hasattr(value[0], "width") and hasattr(value[0], "station")
    )
    return by_station or (isinstance(item, Carriageway) and isinstance(value, float) and name != "verge_slope_percent")


def _same(a: Any, b: Any, turns: bool = False) -> bool:
    if isinstance(a, int | float) and isinstance(b, int | float) and not isinstance(a, bool):
        difference = abs((b - a + 180.0) % 360.0 - 180.0) if turns else abs(b - a)
        return difference <= TOLERANCE
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if hasattr(a, "to_dict") and type(a) is type(b):
        return all(_same(getattr(a, name), getattr(b, name)) for name in type(a).model_fields)
    return bool(a == b)


def _shown(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_shown(each) for each in value]
    return value.to_dict() if hasattr(value, "to_dict") else value
