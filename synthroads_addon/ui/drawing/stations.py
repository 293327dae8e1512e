"""Places of a road that have a station to be dragged: ends of elements, vertical points, things. Free of Blender."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...base.errors import InputError
from ...base.schema import round_value
from ...road.crossfall import crossfall_points
from ...road.geometry import RoadGeometry, profile_of
from ...road.objects import LineObject, PointObject, Width
from ...road.other_roads.axis import HorizontalElement
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.section import Carriageway, Turnout
from ...road.things.thing import Thing

Kind = Literal["element", "vertical", "thing", "start", "end", "turnout", "turnout_end"]
KIND_NAMES: dict[Kind, str] = {
    "element": "End of an Element",
    "vertical": "Vertical Point",
    "thing": "Thing",
    "start": "Start of a Thing",
    "end": "End of a Thing",
    "turnout": "Exit or Bay",
    "turnout_end": "End of an Exit or Bay",
}
FIELDS: dict[Kind, str] = {"thing": "station", "start": "start_station", "end": "end_station"}
"""Field of a thing that each kind of dot sets."""
SHORTEST_LANE = 5.0
"""Least length of an exit's, entry's or bay's lane, m, in a parameter set."""
SHORTEST = 1.0
"""Least length of an element, and distance of two vertical points, m, that dragging leaves. Chosen."""


@dataclass(frozen=True)
class Dot:
    """A place on the road that can be dragged along it.

    Attributes:
        kind: what it is of.
        name: id of the thing; empty for the axis.
        number: of the element that begins there, or of the vertical point, counted from 0; 0 for things.
        station, offset: where it is, m.
        place: (x, y, z) in the road's own coordinates, m.
    """

    kind: Kind
    name: str
    number: int
    station: float
    offset: float
    place: tuple[float, float, float]

    @property
    def title(self) -> str:
        """Return what it is, for people."""
        if self.kind == "element":
            return f"End of element {self.number}"
        if self.kind == "vertical":
            return f"Vertical point {self.number + 1}"
        names = {"thing": self.name, "turnout": self.name, "start": f"Start of {self.name}"}
        return names.get(self.kind, f"End of {self.name}")


def road_dots(geometry: RoadGeometry, things: Mapping[str, Thing]) -> list[Dot]:
    """Return the dots of a road: inner ends of elements, inner vertical points, stations of things.

    Args:
        geometry: of the road.
        things: by their ids, as they are now.
    """
    return [
        *_axis_dots(geometry),
        *_turnout_dots(geometry),
        *(dot for name, thing in things.items() for dot in _thing_dots(geometry, name, thing)),
    ]


def _turnout_dots(geometry: RoadGeometry) -> Iterator[Dot]:
    """Yield two dots for each exit, entry or bay, at its outer edge: where it is moved, and where its length is set."""
    for name, turnout in geometry.parameters.of_type(Turnout).items():
        carriageway = geometry.parameters.objects[turnout.carriageway]
        assert isinstance(carriageway, Carriageway)
        section = geometry.sections[carriageway.side]
        ends: dict[Kind, float] = {"turnout": turnout.start_station, "turnout_end": turnout.end_station}
        for kind, station in ends.items():
            at = float(np.clip(station, 0.0, geometry.length))
            yield _dot(geometry, kind, name, 0, station, carriageway.sign * float(section.paved_edge(at)[0]))


def changed_turnout(turnout: Turnout, kind: Kind, station: float) -> dict[str, float]:
    """Return the fields of a turnout, as it is stated, that a dot at another station (m) sets.

    Its own dot moves it as it is; the dot at its end makes its lane longer or shorter.
    """
    if kind == "turnout":
        return {"station": max(station, 0.0)}
    length = round_value(turnout.lane_length + station - turnout.end_station, 2)
    return {"lane_length": max(length, SHORTEST_LANE)}


def _axis_dots(geometry: RoadGeometry) -> Iterator[Dot]:
    axis = geometry.parameters.alignment
    for number, station in enumerate(geometry.alignment.element_starts[1:-1].tolist(), 1):
        yield _dot(geometry, "element", "", number, station, 0.0)
    for number, point in enumerate(axis.vertical):
        if 0 < number < len(axis.vertical) - 1 and 0.0 < point.station < geometry.length:
            yield _dot(geometry, "vertical", "", number, point.station, 0.0)


def _thing_dots(geometry: RoadGeometry, name: str, thing: Thing) -> Iterator[Dot]:
    if isinstance(thing, PointObject):
        yield _dot(geometry, "thing", name, 0, thing.station, thing.offset)
    elif isinstance(thing, LineObject):
        offset = float(getattr(thing, "offset", 0.0))
        yield _dot(geometry, "start", name, 0, thing.start_station, offset)
        yield _dot(geometry, "end", name, 0, thing.end_station, offset)


def _dot(geometry: RoadGeometry, kind: Kind, name: str, number: int, station: float, offset: float) -> Dot:
    at = float(np.clip(station, 0.0, geometry.length))
    x, y, z = geometry.point(at, offset)[0].tolist()
    height = float(geometry.profile.elevation(at)) if np.isnan(z) else z
    return Dot(kind, name, number, station, offset, (x, y, height))


def station_at(geometry: RoadGeometry, dot: Dot, place: tuple[float, float]) -> float:
    """Return the station (m), to centimetres, that a dot has when it is dragged to a place (x, y) of the road's own.

    It stays on the road; a dot of the axis also stays between its neighbours.
    """
    station, _ = geometry.alignment.project(np.array([place], dtype=np.float64))
    low, high = allowed_stations(geometry.parameters.alignment, dot)
    return round_value(float(np.clip(station[0], low, high)), 2)


def allowed_stations(axis: AlignmentObject, dot: Dot) -> tuple[float, float]:
    """Return the lowest and the highest station (m) that a dot may be dragged to."""
    if dot.kind == "element":
        starts = np.concatenate(([0.0], np.cumsum([element.length for element in axis.horizontal])))
        return float(starts[dot.number - 1]) + SHORTEST, float(starts[dot.number + 1]) - SHORTEST
    if dot.kind == "vertical":
        points = axis.vertical
        return points[dot.number - 1].station + SHORTEST, points[dot.number + 1].station - SHORTEST
    return 0.0, axis.length


def moved_axis(axis: AlignmentObject, kind: Kind, number: int, station: float) -> AlignmentObject:
    """Return an alignment with an element's begin or a vertical point at another station (m).

    What an element gains the one beside it loses: curvatures and the road's length stay, and what lies behind turns.

    Args:
        axis: as it was.
        kind: "element" or "vertical".
        number: of the element that begins there, from 1, or of the vertical point, an inner one.
        station: where it is to be, m.

    Raises:
        InputError: there is no such place, its neighbours are in the way, or roundings overlap then.
    """
    count = len(axis.horizontal) if kind == "element" else len(axis.vertical) - 1
    if not 1 <= number < count:
        raise InputError("Number", number, f"this road has inner ones from 1 to {count - 1}" if count > 1 else "none")
    low, high = allowed_stations(axis, Dot(kind, "", number, station, 0.0, (0.0, 0.0, 0.0)))
    if not low <= station <= high:
        raise InputError("Station", station, f"must be from {low:.2f} to {high:.2f} m, between its neighbours")
    if kind == "element":
        return axis.model_copy(update={"horizontal": _moved_elements(axis, number, station)})
    points = list(axis.vertical)
    points[number] = points[number].model_copy(update={"station": round_value(station)})
    moved = axis.model_copy(update={"vertical": tuple(points)})
    profile_of(moved)
    return moved


def _moved_elements(axis: AlignmentObject, number: int, station: float) -> tuple[HorizontalElement, ...]:
    elements = list(axis.horizontal)
    start = sum(element.length for element in elements[:number])
    for index, change in ((number - 1, station - start), (number, start - station)):
        length = round_value(elements[index].length + change)
        elements[index] = elements[index].model_copy(update={"length": length})
    return tuple(elements)


def with_axis(parameters: RoadParameters, axis: AlignmentObject) -> RoadParameters:
    """Return a road with another alignment of the same length; crossfall that follows the rules follows them again."""
    name = next(iter(parameters.of_type(AlignmentObject)))
    objects: dict[str, Any] = dict(parameters.objects) | {name: axis}
    before = parameters.alignment.horizontal
    for key, carriageway in parameters.of_type(Carriageway).items():
        half_width = _paved_width(carriageway) / 2.0
        rule = (parameters.design_class, carriageway.side, half_width)
        if carriageway.crossfall == crossfall_points(*rule, before):
            objects[key] = carriageway.model_copy(update={"crossfall": crossfall_points(*rule, axis.horizontal)})
    return parameters.model_copy(update={"objects": objects})


def _paved_width(carriageway: Carriageway) -> float:
    """Return the width (m) of a carriageway's pavement with all of its lanes, as the rule of its crossfall takes it."""
    lanes = math.fsum(_full(lane.width) for lane in carriageway.lanes)
    edges = (carriageway.hard_shoulder_width, carriageway.outer_edge_strip_width, carriageway.inner_edge_strip_width)
    shoulder, outer, inner = (_full(width) for width in edges)
    return lanes + shoulder + outer + inner


def _full(width: Width) -> float:
    """Return the largest width (m) of one that may change along the road."""
    return width if isinstance(width, float) else max(point.width for point in width)
