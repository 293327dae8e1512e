"""Objects and signals of an OpenDRIVE road as things of a parameter set."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, get_args
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np
from pydantic import ValidationError

from ...base.schema import round_value
from ...road.objects import RoadObject, SignedWidthPoint
from ...road.section import Arrow, Hatching, LineMarking
from ...road.things.registry import THINGS
from ...road.things.thing import LengthwiseThing
from ..xml_text import child, children, local_name, number
from .corners import corners, rounded_points
from .kinds import Maker, Size, thing_of
from .loss import Loss
from .places import Places
from .signals import sign_of
from .strips import driven_sides

_PAINTED: dict[str, type[RoadObject]] = {"Arrow": Arrow, "Hatching": Hatching}
_PLACE = ("station", "start_station", "end_station")
_PLANTS = frozenset({"tree", "vegetation"})
_TELL = 0.05
_STRAIGHT = 2e-4
_CHANGED = 0.002
"""Distance, m, from which an element of our own file is elsewhere than what it says of itself: it was edited."""
_DIGITS = 6
_MOST_COPIES = 10_000
"""Copies that one repeat of an object may ask for."""


class _UnreadableError(Exception):
    """Raised where notes of our own file on an object can't be read; its text says why."""


@dataclass(frozen=True)
class Stretch:
    """Part of a road along which an object runs.

    Attributes:
        start, end: stations of the set, m.
        offset: in its middle, m.
        bow: how far its ends are from that, m.
    """

    start: float
    end: float
    offset: float
    bow: float


def things(roads: Sequence[Places], loss: Loss) -> dict[str, Any] | None:
    """Return the things that stand on and beside roads, and painted areas, by id; None where the file has none.

    Objects of our own files are read from what these say of each; others by a table of types and names.
    """
    things_by_id: dict[str, Any] = {}
    has_items = False
    for places in roads:
        road = places.surface.road.element
        objects, signals = child(road, "objects"), child(road, "signals")
        items = [] if objects is None else list(objects)
        for item in items:
            has_items = True
            for name, thing in _things_of(item, places, loss):
                _add(things_by_id, name, thing, loss)
        for item in [] if signals is None else list(signals):
            has_items = True
            if local_name(item) != "signal":
                loss.leave_out("signals", f"{local_name(item)} elements")
            elif "object_type" not in _notes(item):  # ours are faces of things that are objects as well
                for name, thing in sign_of(item, places, loss):
                    _add(things_by_id, name, thing, loss)
    return things_by_id if has_items else None


def _add(things_by_id: dict[str, Any], name: str, thing: RoadObject, loss: Loss) -> None:
    """Add a thing under its name, cleaned to an id, with a number behind it where that id is used, and count it."""
    clean_name = "".join(letter for letter in name if letter.isascii() and (letter.isalnum() or letter in "_.-"))[:56]
    stem = clean_name or type(thing).__name__.lower()
    name, count = stem, 1
    while name in things_by_id:
        count += 1
        name = f"{stem}-{count}"
    things_by_id[name] = thing
    loss.read[type(thing).__name__] += 1


def _notes(item: Element) -> dict[str, str]:
    """Return the values of an element's user data by their codes."""
    return {row.get("code", ""): row.get("value", "") for row in children(item, "userData")}


def _things_of(item: Element, places: Places, loss: Loss) -> Iterator[tuple[str, RoadObject]]:
    """Yield the names and things that an object of the file becomes; what it can't become is noted as left out."""
    kind = item.get("type", "none").strip()
    if local_name(item) != "object":
        _tell_structure(item, places, loss)
        return
    notes = _notes(item)
    name = notes.get("id") or item.get("name") or kind
    thing_class = THINGS.get(notes.get("object_type", "")) or _PAINTED.get(notes.get("object_type", ""))
    try:
        if thing_class is not None:
            yield name, _own_thing(thing_class, item, notes, places)
            return
        if kind in _PLANTS and "hedge" not in f"{item.get('subtype')} {name}".lower():
            loss.leave_out("plants", "no single plant is a thing of the set: its vegetation is drawn")
            return
        if notes.get("object_type") == "LineMarking":
            yield name, _loose_line(item, places)
            return
        if kind == "roadMark":
            loss.leave_out("painted objects", f"{item.get('subtype') or name}")
            return
        for count, thing in enumerate(_foreign(item, places, loss), 1):
            yield name if count == 1 else f"{name}-{count}", thing
    except _UnreadableError as error:
        loss.leave_out(f"{kind} objects", str(error))
    except ValidationError as error:
        _tell_fault(kind, error, loss)


def _tell_fault(kind: str, error: ValidationError, loss: Loss) -> None:
    """Note an object as left out by the first field whose value the set doesn't allow."""
    fault = error.errors(include_url=False)[0]
    loss.leave_out(f"{kind} objects", f"{'.'.join(map(str, fault['loc'])) or 'one'}: {fault['msg'].lower()}")


def _tell_structure(item: Element, places: Places, loss: Loss) -> None:
    """Note a bridge, a tunnel or another element that is no object as left out, with its stretch if it has one."""
    stretch = None
    if item.get("s") is not None and item.get("length") is not None:
        start = number(item, "s")
        start_station, end_station = places.along(np.array([start, start + number(item, "length")])).tolist()
        stretch = (start_station, end_station)
    loss.leave_out(f"{local_name(item)}s", "the set has none of their shape", stretch=stretch)


def _own_thing(model: type[RoadObject], item: Element, notes: dict[str, str], places: Places) -> RoadObject:
    """Return the object of a class that our own file describes in its notes, at the place where its element is now."""
    values: dict[str, Any] = {"instance": 1, "type": notes["object_type"]}
    for field, field_info in model.model_fields.items():
        code = "asset" if field == "name" else field
        if code not in notes or field in ("instance", "type", *_PLACE):
            continue
        text = notes[code]
        is_text = field_info.annotation is str or any(
            isinstance(value, str) for value in get_args(field_info.annotation)
        )
        values[field] = text if is_text else _note_value(code, text)
    if issubclass(model, LengthwiseThing):
        repeats = children(item, "repeat")
        if not repeats:
            raise _UnreadableError("one that runs along the road needs a repeat")
        end_places = (repeats[0], 0.0, "Start"), (repeats[-1], number(repeats[-1], "length"), "End")
        (start, offset), (end, _) = (
            places.at(
                np.array([number(row, "s") + distance]),
                np.array([number(row, f"t{end_name}")]),
                np.array([number(row, f"zOffset{end_name}")]),
            )
            for row, distance, end_name in end_places
        )
        values |= {"start_station": _one(start), "end_station": _one(end)}
        if "height" in values and abs(number(item, "height", 0.0) - values["height"]) > _CHANGED:
            values["height"] = number(item, "height")
        thing = model.from_dict(values)
        right_reach, left_reach = thing.reach()
        return _moved(thing, float(offset[0]) - 0.5 * (left_reach - right_reach))
    if "station" not in model.model_fields:
        return model.from_dict(values)
    station, offset = places.at(*_place(item))
    values = {"rotation_deg": _degrees(number(item, "hdg", 0.0)), **values, "station": _one(station)}
    return _moved(model.from_dict(values), float(offset[0]))


def _note_value(code: str, text: str) -> Any:
    """Return the value of a note of our own file."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise _UnreadableError(f"the value of their {code} must be JSON") from None


def _moved(item: Any, offset: float) -> RoadObject:
    """Return an object at an offset (m): another program may have moved its element from where its notes say it is."""
    if abs(offset - item.offset) <= _CHANGED:
        return item
    return type(item).from_dict(item.to_dict() | {"offset": round_value(offset, _DIGITS)})


def _loose_line(item: Element, places: Places) -> LineMarking:
    """Return a line of our own file that follows no lane: an object along corners."""
    corner_rows = [
        (number(c, "s"), number(c, "t"), number(c, "dz", 0.0)) for c in item.iter() if local_name(c) == "cornerRoad"
    ]
    mark = next((one for one in item.iter() if local_name(one) == "marking"), None)
    if mark is None or len(corner_rows) < 2:
        raise _UnreadableError("a line needs two corners along the road and a marking")
    station, offset = places.at(*np.array(corner_rows).T)
    sides = driven_sides(places.surface.road.sections)
    sign = sides[0] if len(sides) == 1 else 1 if offset.mean() > 0.0 else -1
    points = corners(station, sign * offset, _STRAIGHT)
    gap = number(mark, "spaceLength", 0.0)
    start = float(station[0]) + (number(mark, "startOffset", 0.0) if gap else 0.0)
    line_offset: Any = tuple(
        SignedWidthPoint(station=s, width=round_value(w, _DIGITS)) for s, w in rounded_points(points, _DIGITS)
    )
    return LineMarking(
        instance=1,
        carriageway=f"carriageway-{'left' if sign > 0 else 'right'}",
        kind="free",
        color="yellow" if mark.get("color") == "yellow" else "white",
        film_thickness=number(mark, "zOffset", 0.003),
        offset=line_offset if len(points) > 1 else line_offset[0].width,
        width=number(mark, "width"),
        dash_length=number(mark, "lineLength") if gap else 0.0,
        gap_length=gap,
        start_station=round_value(start, _DIGITS),
        end_station=round_value(float(station[-1]), _DIGITS),
    )


def _place(item: Element) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return s, t and height of an object, each as an array (1,), m."""
    return tuple(np.array([number(item, name, 0.0)]) for name in ("s", "t", "zOffset"))  # type: ignore[return-value]


def _one(values: np.ndarray) -> float:
    """Return the single value of an array (1,), m, not below 0, rounded as the set's fields are."""
    return round_value(max(float(values[0]), 0.0), _DIGITS)


def _degrees(angle: float) -> float:
    """Return an angle (rad) in degrees, rounded as the set's fields are."""
    return round_value(math.degrees(angle), _DIGITS)


def _foreign(item: Element, places: Places, loss: Loss) -> Iterator[RoadObject]:
    """Yield the things that an object of another program becomes: one for each place, or stretch along the road."""
    description = f"{item.get('type', '')} {item.get('subtype', '')} {item.get('name', '')}".lower()
    maker = thing_of(description)
    if maker.why:
        loss.leave_out(f"{item.get('type', 'none')} objects", maker.why)
        return
    if maker.approximated:
        loss.approximate(f"{item.get('type', 'none')} objects", maker.approximated)
    sizes = {name: number(item, name, 0.0) for name in ("width", "length", "height", "radius")}
    repeats = children(item, "repeat")
    for row in repeats:
        sizes["height"] = sizes["height"] or number(row, "heightStart", 0.0)
        sizes["width"] = sizes["width"] or number(row, "widthStart", 0.0)
    size = Size(sizes)
    yield from _made(item, maker, size, repeats, places, loss)
    for name, deviation in size.limited.items():
        loss.approximate(f"{maker.name}s", f"their {name} is limited", deviation)


def _made(
    item: Element, maker: Maker, size: Size, repeats: Sequence[Element], places: Places, loss: Loss
) -> Iterator[RoadObject]:
    """Yield the things of an object, one for each stretch or each copy, by the functions of a maker."""
    if maker.along:
        for stretch in _stretches(item, repeats, places, size["length"]):
            if stretch.bow > _TELL:
                middle = 0.5 * (stretch.start + stretch.end)
                loss.approximate(f"{maker.name}s", "they run at one distance from the line", stretch.bow, middle)
            yield maker.along(stretch, size)
        return
    assert maker.standing is not None
    rotation_deg = _degrees(number(item, "hdg", 0.0))
    for s, t, z in _repeated(item, repeats, places.surface.road.length, loss):
        station, offset = places.at(np.array([s]), np.array([t]), np.array([z]))
        place = {"instance": 1, "station": _one(station), "offset": round_value(float(offset[0]), _DIGITS)}
        try:
            yield maker.standing(place | {"rotation_deg": rotation_deg}, size)
        except ValidationError as error:  # each copy stands elsewhere
            _tell_fault(item.get("type", "none"), error, loss)


def _repeated(
    item: Element, repeats: Sequence[Element], end: float, loss: Loss
) -> Iterator[tuple[float, float, float]]:
    """Yield s, t and height (m) of each copy of an object up to a road's end (m); its own place without repeats."""
    if not repeats:
        yield number(item, "s"), number(item, "t"), number(item, "zOffset", 0.0)
        return
    kind = f"{item.get('type', 'none')} objects"
    for row in repeats:
        start, length = number(row, "s"), number(row, "length", 0.0)
        usable_length = min(length, end - start)
        step = number(row, "distance", 0.0) or usable_length or 1.0
        if usable_length < 0.0 or step < 0.0:
            loss.leave_out(kind, "a repeat begins behind the road's end, or runs back")
            continue
        if usable_length > _MOST_COPIES * step:
            loss.leave_out(kind, f"a repeat asks for more than {_MOST_COPIES:,} copies")
            continue
        start_t, end_t = number(row, "tStart", number(item, "t", 0.0)), number(row, "tEnd", number(item, "t", 0.0))
        start_height, end_height = number(row, "zOffsetStart", 0.0), number(row, "zOffsetEnd", 0.0)
        for n in range(int(usable_length / step + 1e-6) + 1):
            share = n * step / length if length else 0.0
            yield (
                start + n * step,
                start_t + share * (end_t - start_t),
                start_height + share * (end_height - start_height),
            )


def _stretches(item: Element, repeats: Sequence[Element], places: Places, length: float) -> Iterator[Stretch]:
    """Yield the stretches along which an object runs; those that go on at the same offset are joined."""
    rows: list[tuple[float, float, float, float]] = []
    for row in repeats:
        t = number(item, "t", 0.0)
        start, repeat_length = number(row, "s"), number(row, "length")
        rows.append((start, start + repeat_length, number(row, "tStart", t), number(row, "tEnd", t)))
    corners = [
        c for outline in item.iter() if local_name(outline) == "outline" for c in children(outline, "cornerRoad")
    ]
    if not rows and corners:
        s, t = np.array([(number(corner, "s"), number(corner, "t")) for corner in corners]).T
        rows.append((float(s.min()), float(s.max()), float(t.min()), float(t.max())))
    if not rows and length > 0.0:
        s, t = number(item, "s"), number(item, "t")
        rows.append((s - 0.5 * length, s + 0.5 * length, t, t))
    stretches: list[Stretch] = []
    end = places.surface.road.length
    for start, stop, start_t, end_t in rows:
        span = np.clip(np.array([start, stop]), 0.0, end)
        station, offset = places.at(span, np.array([start_t, end_t]), np.zeros(2))
        if station[1] - station[0] < _TELL:
            continue
        bow = 0.5 * abs(float(offset[1] - offset[0]))
        stretch = Stretch(_one(station[:1]), _one(station[1:]), round_value(float(offset.mean()), _DIGITS), bow)
        if (
            stretches
            and abs(stretches[-1].end - stretch.start) < _TELL
            and abs(stretches[-1].offset - stretch.offset) < _TELL
        ):
            previous = stretches.pop()
            bow_of_both = max(previous.bow, abs(previous.offset - stretch.offset) + stretch.bow)
            stretch = Stretch(previous.start, stretch.end, previous.offset, bow_of_both)
        stretches.append(stretch)
    yield from stretches
