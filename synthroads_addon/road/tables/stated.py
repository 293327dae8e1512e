"""A road's axis and carriageways as stated in its tables, after edits of the road that was built."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

from ...base.errors import InputError
from ..objects import RoadObject
from ..parameters import AlignmentObject, RoadParameters
from ..section import Carriageway, Hatching, LineMarking, Turnout
from ..surroundings import LONGEST
from .elements import ElementsEdit
from .points import SAME, carried_carriageway, carried_equations
from .stations import StationMap, same_stations

_STATIONS = ("station", "start_station", "end_station")


@dataclass(frozen=True)
class StatedRoad:
    """Alignment and carriageways of a road as its tables state them.

    Attributes:
        alignment: elements and vertical points.
        carriageways: by their ids, with crossfall and widths.
        stations: from the road as it was built to the stated one.
    """

    alignment: AlignmentObject
    carriageways: dict[str, Carriageway]
    stations: StationMap

    @classmethod
    def of(cls, parameters: RoadParameters) -> StatedRoad:
        """Return what a parameter set states."""
        alignment = parameters.alignment
        return cls(alignment, parameters.of_type(Carriageway), same_stations(alignment.length))

    @classmethod
    def from_json(cls, text: str) -> StatedRoad:
        """Return what `to_json` wrote; InputError if it is damaged."""
        try:
            data = json.loads(text)
            carriageways = {name: Carriageway.from_dict(item) for name, item in data["carriageways"].items()}
            stations = StationMap(*(tuple(map(float, column)) for column in data["stations"]))
            return cls(AlignmentObject.from_dict(data["alignment"]), carriageways, stations)
        except (AttributeError, KeyError, TypeError, ValueError):
            raise InputError("Alignment", None, "its table in the file is damaged: build the road again") from None

    def to_json(self) -> str:
        """Return the stated road as a JSON text."""
        data: dict[str, Any] = {
            "alignment": self.alignment.to_dict(),
            "carriageways": {name: item.to_dict() for name, item in self.carriageways.items()},
            "stations": [list(self.stations.before), list(self.stations.after)],
        }
        return json.dumps(data)

    def with_elements(self, edit: ElementsEdit) -> StatedRoad:
        """Return the road with edited elements: crossfall and widths move along with their places.

        Vertical points keep their stations, as the profile is designed by them: grades and roundings stay.
        """
        update = {"horizontal": edit.elements, "equations": carried_equations(self.alignment, edit.stations)}
        return StatedRoad(
            self.alignment.model_copy(update=update),
            {name: carried_carriageway(item, edit.stations) for name, item in self.carriageways.items()},
            self.stations.then(edit.stations),
        )

    def with_alignment(self, alignment: AlignmentObject) -> StatedRoad:
        """Return the road with another profile."""
        return replace(self, alignment=alignment)

    def with_carriageway(self, name: str, carriageway: Carriageway) -> StatedRoad:
        """Return the road with another carriageway of an id."""
        return replace(self, carriageways=self.carriageways | {name: carriageway})

    def with_stated_surface(self, parameters: RoadParameters) -> RoadParameters:
        """Return a parameter set of the road as built with the stated carriageways, and their line markings.

        The stations of these lines are those along the stated road; lines of deleted stretches are gone.
        """
        objects: dict[str, RoadObject] = {}
        for name, item in parameters.objects.items():
            if isinstance(item, LineMarking):
                if not self._is_deleted(item):
                    objects[name] = self._carried(item)
            else:
                objects[name] = self.carriageways.get(name, item)
        return parameters.model_copy(update={"objects": objects})

    def with_built_lines(self, parameters: RoadParameters, built: RoadParameters) -> RoadParameters:
        """Return a parameter set that `with_stated_surface` gave, and that was edited, with the road's lines as built.

        Edits of the lines stay; the stations are those of the road as built.

        Args:
            parameters: with the stated surface.
            built: the road as built.
        """
        objects: dict[str, RoadObject] = {}
        for name, item in built.objects.items():
            shown_item = parameters.objects.get(name, item)  # a deleted line isn't there
            is_shown_line = isinstance(shown_item, LineMarking) and name in parameters.objects
            objects[name] = self._line_as_built(shown_item, item) if is_shown_line else shown_item
        return parameters.model_copy(update={"objects": objects})

    def _line_as_built(self, line: RoadObject, built_line: RoadObject) -> RoadObject:
        """Return a line with the stations of the road as built: its own ones where they weren't edited."""
        carried_line = self._carried(built_line)
        stations = {}
        for name in ("start_station", "end_station"):
            station = getattr(line, name)
            is_edited = station != getattr(carried_line, name)
            stations[name] = round(self.stations.place_before(station), 6) if is_edited else getattr(built_line, name)
        return line.model_copy(update=stations)

    def applied(self, parameters: RoadParameters, keeps_carriageways: bool = False) -> RoadParameters:
        """Return a parameter set of the road as built with what is stated; all else moves along with its place.

        What stood only on deleted stretches is gone.

        Args:
            parameters: with the stations of the road as it was built, but in its carriageways if these are kept.
            keeps_carriageways: whether its own carriageways count.

        Raises:
            InputError: what is stated doesn't fit the rest of the road.
        """
        deleted_ids = {name for name, item in parameters.objects.items() if self._is_deleted(item)}
        deleted_ids |= {
            name
            for name, item in parameters.objects.items()
            if isinstance(item, LineMarking | Hatching) and item.turnout in deleted_ids
        }
        objects: dict[str, RoadObject] = {}
        for name, item in parameters.objects.items():
            if name in deleted_ids:
                continue
            if isinstance(item, AlignmentObject):
                objects[name] = self.alignment
            elif isinstance(item, Carriageway):
                objects[name] = item if keeps_carriageways else self.carriageways.get(name, item)
            else:
                objects[name] = self._carried(item)
        new_parameters = parameters.model_copy(update={"objects": objects})
        return RoadParameters.from_dict(new_parameters.to_dict())

    def _is_deleted(self, item: RoadObject) -> bool:
        """Return whether an object stands only on stretches that were deleted."""
        station = getattr(item, "station", None)
        if station is None and isinstance(item, Turnout):
            station = item.start_station
        if station is not None:
            return self.stations.is_deleted(station)
        start, end = getattr(item, "start_station", None), getattr(item, "end_station", None)
        return start is not None and end is not None and start < end and self.stations(start) == self.stations(end)

    def _carried(self, item: RoadObject) -> RoadObject:
        """Return an object at its place along the stated road; unchanged objects are returned themselves."""
        data = item.to_dict()
        carry_stations(data, self.stations, self.alignment.length)
        return type(item).from_dict(data) if data != item.to_dict() else item


def carry_stations(data: Any, stations: Any, length: float) -> None:
    """Map all stations in an object's JSON data to another axis, in place; positive ones never become negative.

    Args:
        data: the object's data.
        stations: function from a station to the one on the other axis, m.
        length: of the other axis, m.
    """
    if isinstance(data, list):
        for part in data:
            carry_stations(part, stations, length)
    if not isinstance(data, dict):
        return
    for key, value in data.items():
        if key in _STATIONS and isinstance(value, int | float):
            if value >= LONGEST:  # all along, however long the road is
                continue
            exact_station = stations(float(value))
            if abs(exact_station - value) < SAME:
                continue
            new_station = round(exact_station, 6)
            data[key] = max(new_station, 0.0) if value >= 0 else new_station
        else:
            carry_stations(value, stations, length)
