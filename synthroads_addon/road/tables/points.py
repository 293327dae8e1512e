"""Vertical points, crossfall and widths as tables: rows by station, and edits of one row.

Every edit returns new objects of the parameter set. What isn't allowed raises `InputError`, with the row's number from
1 and the range that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from ...base.errors import InputError
from ...base.schema import Model, round_value
from ..objects import AnyWidth, WidthPoint, width_at
from ..other_roads.axis import VerticalPoint
from ..parameters import AlignmentObject, StationEquation
from ..profile import TOUCH, IntersectionPoint, Profile
from ..section import Carriageway, CrossfallPoint
from .stations import StationMap

PointT = TypeVar("PointT", bound=Model)
STEP = 100.0
"""Distance, m, of a new row behind the last one. Chosen."""
_STRIPS = {
    "Inner Offset": "inner_offset",
    "Inner Edge Strip": "inner_edge_strip_width",
    "Outer Edge Strip": "outer_edge_strip_width",
    "Hard Shoulder": "hard_shoulder_width",
    "Verge": "verge_width",
}
"""Strips of a carriageway that aren't lanes, and the fields of their widths."""


def with_vertical_point(alignment: AlignmentObject, number: int, **values: float) -> AlignmentObject:
    """Return an alignment of which a vertical point has another station, elevation or radius, m.

    Raises:
        InputError: the station isn't between its neighbours', the roundings overlap, or a value isn't allowed.
    """
    points = list(alignment.vertical)
    words = f"Vertical Point {number + 1}"
    points[number] = _changed(points, number, values, words)
    field, value = next(iter(values.items()))
    return _with_vertical(alignment, points, f"{_LABELS[field]} of {words}", value)


def with_vertical_point_inserted(alignment: AlignmentObject, number: int) -> AlignmentObject:
    """Return an alignment with one more vertical point, as that of a number from 0: on the tangent, without rounding.

    The profile stays the same until the new point is moved. Beyond the ends it is `STEP` away.
    """
    points = list(alignment.vertical)
    reaches = _reaches(points)
    begins = [point.station - reach for point, reach in zip(points, reaches, strict=True)]
    ends = [point.station + reach for point, reach in zip(points, reaches, strict=True)]
    # Halfway between the roundings beside it, on the tangent that is left of them.
    is_inner = 0 < number < len(points)
    free = [ends[number - 1], begins[number]] if is_inner else [begins[0]] if number <= 0 else [ends[-1]]
    if is_inner and free[1] - free[0] <= TOUCH:
        raise InputError(
            "Insert Vertical Point",
            None,
            f"the roundings of points {number} and {number + 1} leave no room: choose smaller radii there first",
        )
    station = _station_between(free, min(number, 1))
    elevation = _tangent_elevation(points, station)
    points.insert(number, VerticalPoint(station=station, elevation=round_value(elevation), radius=0.0))
    return _with_vertical(alignment, points, "Insert Vertical Point")


def without_vertical_point(alignment: AlignmentObject, number: int) -> AlignmentObject:
    """Return an alignment without one of its vertical points; InputError for the only one."""
    if len(alignment.vertical) < 2:
        raise InputError("Delete Vertical Point", None, "a road needs one vertical point at least")
    points = [point for i, point in enumerate(alignment.vertical) if i != number]
    return _with_vertical(alignment, points, f"Delete Vertical Point {number + 1}")


def grades_percent(alignment: AlignmentObject) -> list[float]:
    """Return the grade behind each vertical point, %, rising positive; behind the last one that before it."""
    profile = Profile([IntersectionPoint(p.station, p.elevation) for p in alignment.vertical])
    return [100.0 * float(grade) for grade in profile.grades[1:]]


def with_crossfall_point(carriageway: Carriageway, number: int, **values: float) -> Carriageway:
    """Return a carriageway of which a crossfall point has another station (m) or crossfall (%); else InputError."""
    points = list(carriageway.crossfall)
    points[number] = _changed(points, number, values, f"Crossfall Point {number + 1}")
    return carriageway.model_copy(update={"crossfall": tuple(points)})


def with_crossfall_point_inserted(carriageway: Carriageway, number: int) -> Carriageway:
    """Return a carriageway with one more crossfall point, as that of a number from 0, of the crossfall there."""
    points = list(carriageway.crossfall)
    stations = [point.station for point in points]
    station = _station_between(stations, number)
    # Linear between the points, as the surface is.
    course = tuple(WidthPoint.model_construct(station=p.station, width=p.crossfall_percent) for p in points)
    percent = round_value(float(width_at(course, station)))
    points.insert(number, CrossfallPoint(station=station, crossfall_percent=percent))
    return carriageway.model_copy(update={"crossfall": tuple(points)})


def without_crossfall_point(carriageway: Carriageway, number: int) -> Carriageway:
    """Return a carriageway without one of its crossfall points; InputError for the only one."""
    if len(carriageway.crossfall) < 2:
        raise InputError("Delete Crossfall Point", None, "a carriageway needs one crossfall point at least")
    return carriageway.model_copy(update={"crossfall": _without(carriageway.crossfall, number)})


def strip_names(carriageway: Carriageway) -> list[str]:
    """Return the names of a carriageway's widths from the inside out; lanes are counted from outside, as in its set.

    Example:
        >>> from synthroads_addon import load_scenario, sample_road
        >>> road = sample_road(load_scenario("rq31-600m").road, seed=7)
        >>> strip_names(road.carriageway("right"))[:4]
        ['Inner Offset', 'Inner Edge Strip', 'Lane 2', 'Lane 1']
    """
    lanes = [f"Lane {number}" for number in range(len(carriageway.lanes), 0, -1)]
    return ["Inner Offset", "Inner Edge Strip", *lanes, "Outer Edge Strip", "Hard Shoulder", "Verge"]


def strip_width(carriageway: Carriageway, strip: str) -> AnyWidth:
    """Return the width (m), or points of it along the road, of a strip by its name, see `strip_names`."""
    if strip in _STRIPS:
        width: AnyWidth = getattr(carriageway, _STRIPS[strip])
        return width
    return carriageway.lanes[int(strip.removeprefix("Lane ")) - 1].width


def width_rows(carriageway: Carriageway, strip: str) -> list[tuple[float, float]]:
    """Return the rows (station, width) of a strip, m; one row at station 0 where its width is the same everywhere."""
    width = strip_width(carriageway, strip)
    return [(p.station, p.width) for p in width] if isinstance(width, tuple) else [(0.0, width)]


def with_width(carriageway: Carriageway, strip: str, number: int, **values: float) -> Carriageway:
    """Return a carriageway of which a row of a strip has another station or width, m.

    Raises:
        InputError: the station isn't between its neighbours', or the width isn't allowed.
    """
    width = strip_width(carriageway, strip)
    if not isinstance(width, tuple):
        if "station" in values:
            raise InputError(f"Station of {strip}", values["station"], "its width is the same everywhere: insert a row")
        return _with_strip(carriageway, strip, values["width"])
    points = list(width)
    points[number] = _changed(points, number, values, f"Row {number + 1} of {strip}")
    return _with_strip(carriageway, strip, tuple(points))


def with_width_inserted(carriageway: Carriageway, strip: str, number: int) -> Carriageway:
    """Return a carriageway with one more row of a strip's width, as that of a number from 0, of the width there."""
    rows = width_rows(carriageway, strip)
    station = _station_between([row[0] for row in rows], number)
    value = round_value(float(width_at(strip_width(carriageway, strip), station)))
    rows.insert(number, (station, value))
    return _with_strip(carriageway, strip, _width_points(rows))


def without_width(carriageway: Carriageway, strip: str, number: int) -> Carriageway:
    """Return a carriageway without a row of a strip's width; of two, the other one's width counts everywhere."""
    rows = width_rows(carriageway, strip)
    if len(rows) < 2:
        raise InputError(f"Delete Row of {strip}", None, "a strip needs one width at least")
    rows = [row for i, row in enumerate(rows) if i != number]
    return _with_strip(carriageway, strip, _width_points(rows) if len(rows) > 1 else rows[0][1])


def carried_equations(alignment: AlignmentObject, stations: StationMap) -> tuple[StationEquation, ...]:
    """Return an alignment's station equations, moved along by a map."""
    return _carried(alignment.equations, stations)


def carried_carriageway(carriageway: Carriageway, stations: StationMap) -> Carriageway:
    """Return a carriageway with all of its stations, its damage's too, moved along by a map."""
    update: dict[str, Any] = {"crossfall": _carried(carriageway.crossfall, stations) or carriageway.crossfall[:1]}
    for strip in strip_names(carriageway):
        width = strip_width(carriageway, strip)
        if isinstance(width, tuple):
            points = _carried(width, stations)
            carriageway = _with_strip(carriageway, strip, points if len(points) > 1 else float(width[0].width))
    pavement = carriageway.pavement
    ruts = [
        rut.model_copy(update={name: _moved(getattr(rut, name), stations) for name in _RANGE}) for rut in pavement.ruts
    ]
    holes = [
        hole.model_copy(update={"station": _moved(hole.station, stations)})
        for hole in pavement.potholes
        if not stations.is_deleted(hole.station)
    ]
    damage = {"ruts": tuple(rut for rut in ruts if rut.start_station < rut.end_station), "potholes": tuple(holes)}
    update["pavement"] = pavement.model_copy(update=damage)
    return carriageway.model_copy(update=update)


SAME = 1e-9
"""Stations nearer than this (m) are the same: what isn't moved keeps all of its digits."""
_RANGE = ("start_station", "end_station")
_LABELS = {
    "station": "Station",
    "elevation": "Height",
    "radius": "Radius",
    "crossfall_percent": "Crossfall",
    "width": "Width",
}
"""Fields of rows as the table calls them."""


def _carried(points: Sequence[PointT], stations: StationMap) -> tuple[PointT, ...]:
    """Return points moved along by a map of stations, without those of deleted stretches; stations increase."""
    moved: list[PointT] = []
    for point in points:
        station: float = point.station  # type: ignore[attr-defined]
        if stations.is_deleted(station):
            continue
        there = _moved(station, stations)
        if not moved or there > moved[-1].station:  # type: ignore[attr-defined]
            moved.append(point if there == station else point.model_copy(update={"station": there}))
    return tuple(moved)


def _moved(station: float, stations: StationMap) -> float:
    """Return a station, m, moved along by a map, to the micrometre."""
    there = stations(station)
    return station if abs(there - station) < SAME else round_value(there, 6)


def _with_vertical(
    alignment: AlignmentObject, points: list[VerticalPoint], words: str, value: float | None = None
) -> AlignmentObject:
    """Return an alignment with other vertical points.

    Args:
        alignment: before.
        points: in the order of their stations.
        words: what is edited, for the message.
        value: that was given, for the message.

    Raises:
        InputError: the roundings of two neighbours overlap.
    """
    reaches = _reaches(points)
    for number, (here, there) in enumerate(pairwise(points)):
        needed, distance = reaches[number] + reaches[number + 1], there.station - here.station
        if needed > distance + TOUCH:
            raise InputError(
                words,
                value,
                f"the roundings of points {number + 1} and {number + 2} would overlap (they need {needed:,.1f} m, and "
                f"their stations are {distance:,.1f} m apart): give them smaller radii or more distance first",
            )
    return alignment.model_copy(update={"vertical": tuple(points)})


def _reaches(points: Sequence[VerticalPoint]) -> list[float]:
    """Return how far the rounding of each vertical point reaches to either side, m: T = H |g2 - g1| / 2."""
    changes = np.diff(Profile([IntersectionPoint(p.station, p.elevation) for p in points]).grades)
    return [0.5 * point.radius * abs(float(change)) for point, change in zip(points, changes, strict=True)]


def _changed(points: Sequence[PointT], number: int, values: dict[str, float], words: str) -> PointT:
    """Return a point with other values; `InputError` unless its station is between those beside it."""
    point = points[number]
    if "station" in values:
        stations = [item.station for item in points]  # type: ignore[attr-defined]
        low = stations[number - 1] if number else None
        high = stations[number + 1] if number + 1 < len(points) else None
        station = values["station"]
        if (low is not None and station <= low) or (high is not None and station >= high):
            ends = [f"above {low:g}" if low is not None else "", f"below {high:g}" if high is not None else ""]
            raise InputError(f"Station of {words}", station, f"must be {' and '.join(filter(None, ends))} m")
    try:
        return type(point).from_dict(point.to_dict() | values)
    except InputError as error:
        raise InputError(f"{_LABELS[error.field]} of {words}", error.value, error.allowed) from None


def _station_between(stations: Sequence[float], number: int) -> float:
    """Return the station, m, of a new row of a number, from 0: halfway between its neighbours, or `STEP` beyond."""
    if number <= 0:
        return round_value(stations[0] - STEP, 3)
    if number >= len(stations):
        return round_value(stations[-1] + STEP, 3)
    return round_value(0.5 * (stations[number - 1] + stations[number]), 6)


def _tangent_elevation(points: Sequence[VerticalPoint], station: float) -> float:
    """Return the elevation, m, of the tangents through vertical points at a station; the outer ones go on."""
    return float(Profile([IntersectionPoint(p.station, p.elevation) for p in points]).elevation(station))


def _without(points: Sequence[PointT], number: int) -> tuple[PointT, ...]:
    """Return points without one, by its number from 0."""
    return tuple(point for i, point in enumerate(points) if i != number)


def _width_points(rows: Sequence[tuple[float, float]]) -> tuple[WidthPoint, ...]:
    """Return rows (station, width), m, as points of a width."""
    return tuple(WidthPoint.model_construct(station=station, width=width) for station, width in rows)


def _with_strip(carriageway: Carriageway, strip: str, width: AnyWidth) -> Carriageway:
    """Return a carriageway with another width of a strip; `InputError` names the strip and what is allowed."""
    value: Any = width
    if isinstance(width, tuple):
        value = [{"station": point.station, "width": point.width} for point in width]
    data = carriageway.to_dict()
    if strip in _STRIPS:
        data[_STRIPS[strip]] = value
    else:
        data["lanes"][int(strip.removeprefix("Lane ")) - 1]["width"] = value
    try:
        return Carriageway.from_dict(data)
    except InputError as error:
        raise InputError(f"Width of {strip}", error.value, error.allowed) from None
