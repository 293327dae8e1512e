"""Where a change is, and how large: worked out from its edits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal

from ...base.schema import round_value
from .change import UNITS, Edit, Extent, Kind
from .kinds import stretch_of

Unit = Literal["m", "m2", "deg", "1"]
Box = tuple[float, float, float | None, float | None]
"""Start and end station, lowest and highest offset, m; offsets None across the whole road."""
_DIGITS = 6
_PAVEMENT = "pavement."


def describe(
    kind: Kind, detail: str, edits: Sequence[Edit], objects: Mapping[str, Any], length: float
) -> tuple[Extent, float, Unit]:
    """Return where a change is, its size and the size's unit.

    Args:
        kind, detail: of the change.
        edits: of the change.
        objects: data of the objects of both sets by id, those of the second first.
        length: of the road, m.
    """
    states = _states(edits, objects)
    boxes = [box for edit in edits for box in _boxes(edit, objects, states, length)]
    starts, ends, lows, highs = zip(*boxes, strict=True)
    has_offsets = None not in lows and None not in highs
    extent = Extent(
        start_station=round_value(max(min(starts), 0.0), _DIGITS),
        end_station=round_value(min(max(ends), length), _DIGITS),
        low_offset=round_value(min(lows), _DIGITS) if has_offsets else None,
        high_offset=round_value(max(highs), _DIGITS) if has_offsets else None,
    )
    size, unit = _size(kind, detail, edits, extent)
    return extent, round_value(size, _DIGITS), unit


def _states(edits: Sequence[Edit], objects: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return the data of each thing before and after edits of its fields, by its id."""
    result = {}
    for name in {edit.thing for edit in edits if edit.thing}:
        fields = [edit for edit in edits if edit.thing == name and edit.path and "." not in edit.path]
        result[name] = [
            {**objects[name], **{edit.path: getattr(edit, state) for edit in fields}} for state in ("before", "after")
        ]
    return result


def _boxes(
    edit: Edit, objects: Mapping[str, Any], states: Mapping[str, Sequence[Mapping[str, Any]]], length: float
) -> Iterator[Box]:
    """Yield the stations and offsets (m) that an edit is about: of both values, offsets None across the whole road."""
    if edit.thing == "":
        yield 0.0, length, None, None
        return
    if edit.path.startswith(_PAVEMENT):
        yield from _pavement_boxes(edit, objects[edit.thing], length)
    elif edit.path == "":
        yield from (_place(value, length) for value in (edit.before, edit.after) if value is not None)
    elif edit.path.startswith("dents.") or edit.path == "missing_panels":
        yield from _damage_boxes(edit, objects[edit.thing], length)
    else:
        yield from (_place(state, length) for state in states[edit.thing])


def _pavement_boxes(edit: Edit, carriageway: Mapping[str, Any], length: float) -> Iterator[Box]:
    """Yield the stations and offsets (m) of an edit of a carriageway's pavement."""
    name = edit.path.split(".")[1]
    values = [value for value in (edit.before, edit.after) if isinstance(value, dict)]
    for value in values:
        yield (*stretch_of(name, value), *_offsets(name, value, carriageway))
    if not values:
        yield 0.0, length, None, None


def _damage_boxes(edit: Edit, item: Mapping[str, Any], length: float) -> Iterator[Box]:
    """Yield the stations and offsets (m) of an edit of a rail's dents or of a noise barrier's missing panels."""
    offset = item["offset"]
    if edit.path == "missing_panels":
        start, step = item["start_station"], item["post_spacing"]
        for bay in sorted(set(edit.before or ()) ^ set(edit.after or ())):
            yield start + bay * step, min(start + (bay + 1) * step, length), offset, offset
        return
    for value in (edit.before, edit.after):
        if value is not None:
            half = value["length"] / 2.0
            yield value["station"] - half, value["station"] + half, offset, offset


def _place(item: Mapping[str, Any], length: float) -> Box:
    """Return the stations and offsets (m) of an object, by its JSON data."""
    # A marking's offset is its distance from the centreline, and only free lines have one.
    offset = item.get("offset") if item["type"] != "LineMarking" else None
    low = high = offset if isinstance(offset, int | float) else None
    if low is not None and isinstance(item.get("end_offset"), int | float):
        low, high = min(low, item["end_offset"]), max(low, item["end_offset"])
    if "station" in item:
        return item["station"], item["station"], low, high
    if "start_station" in item:
        return item["start_station"], min(item.get("end_station", length), length), low, high
    return 0.0, length, None, None


def _offsets(name: str, value: Mapping[str, Any], carriageway: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Return the offsets (m) between which an element of a pavement's list lies; None across the carriageway."""
    sign = 1.0 if carriageway["side"] == "left" else -1.0
    if name == "patches":
        offsets = [corner[1] for corner in value["outline"]]
    elif name == "cracks":
        offsets = [corner[1] for line in value["lines"] for corner in line]
    elif name == "overlays":
        offsets = [sign * value["inner"], sign * value["outer"]]
    elif "offset" in value:
        half = value["width"] / 2.0
        offsets = [value["offset"] - half, value["offset"] + half]
    else:
        return None, None
    return min(offsets), max(offsets)


def _size(kind: Kind, detail: str, edits: Sequence[Edit], extent: Extent) -> tuple[float, Unit]:
    """Return a change's size and its unit."""
    unit: Unit = UNITS[kind]  # type: ignore[assignment]
    if kind == "moved":
        return _moved(edits)
    if kind == "damaged":
        return _damaged(detail, edits)
    if kind in ("grown", "cut_back"):
        steps = [_number(edit.after) - _number(edit.before) for edit in edits if "height" in edit.path]
        return max(map(abs, steps), default=0.0), unit
    if kind in ("rutted", "settled", "overlaid"):
        field = {"rutted": "depth", "settled": "depth", "overlaid": "thickness"}[kind]
        return sum(_field(edit.after, field) - _field(edit.before, field) for edit in edits), unit
    if kind == "cracked":
        return sum(_crack_length(edit.after) - _crack_length(edit.before) for edit in edits), unit
    if kind == "patched":
        return sum(_area(edit.after) - _area(edit.before) for edit in edits), unit
    if kind == "worn":
        return max(map(_worn_share, edits), default=0.0), unit
    if kind in ("marked_anew", "construction_zone"):
        return extent.end_station - extent.start_station, unit
    return float(len(edits)), unit


def _worn_share(edit: Edit) -> float:
    """Return the share of the film that an edit takes: of all markings, or of one whose film (m) gets thinner."""
    before, after = _number(edit.before), _number(edit.after)
    return abs(after - before) / before if edit.path == "film_thickness" and before else abs(after - before)


def _moved(edits: Sequence[Edit]) -> tuple[float, Unit]:
    """Return how far something was moved, m; where it was turned only, by how much, deg."""
    steps = {edit.path: _number(edit.after) - _number(edit.before) for edit in edits}
    turn = abs(steps.pop("rotation_deg", 0.0))
    if not any(steps.values()):
        return turn, "deg"
    ends = [steps.pop(name, 0.0) for name in ("start_station", "end_station")]
    along = steps.pop("station", 0.0) or max(ends, key=abs)
    return math.hypot(along, *steps.values()), "m"


def _damaged(detail: str, edits: Sequence[Edit]) -> tuple[float, Unit]:
    """Return how much something was damaged: depth (m), angle (deg), or the number of missing panels."""
    if detail == "panel_missing":
        return sum(_count(edit.after) - _count(edit.before) for edit in edits), "1"
    if detail in ("turned", "leaning"):
        angles = [_number(edit.after) - _number(edit.before) for edit in edits if edit.path != "lean_direction_deg"]
        return max(map(abs, angles), default=0.0), "deg"
    return max(abs(_field(edit.after, "depth") - _field(edit.before, "depth")) for edit in edits), "m"


def _number(value: Any) -> float:
    """Return a value that is a number, 0 for any other."""
    return float(value) if isinstance(value, int | float) else 0.0


def _count(value: Any) -> float:
    """Return the length of a list, 0 for anything else."""
    return float(len(value)) if isinstance(value, list) else 0.0


def _field(value: Any, name: str) -> float:
    """Return a numeric field of JSON data, 0 where there is none."""
    return _number(value.get(name)) if isinstance(value, dict) else 0.0


def _crack_length(value: Any) -> float:
    """Return the length (m) of all lines of a crack's JSON data; 0 without one."""
    if not isinstance(value, dict):
        return 0.0
    return sum(math.hypot(b[0] - a[0], b[1] - a[1]) for line in value["lines"] for a, b in pairwise(line))


def _area(value: Any) -> float:
    """Return the area (m2) of a patch's outline in stations and offsets; 0 without one."""
    if not isinstance(value, dict) or "outline" not in value:
        return 0.0
    corners = value["outline"]
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2.0
