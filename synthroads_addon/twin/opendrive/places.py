"""Where objects stand: how high the surface below them lies above the reference line."""

from typing import Any

import numpy as np

from ...base.errors import InputError
from ...road.geometry import RoadGeometry
from ...road.objects import PointObject, RoadObject, Side
from ...road.section import Carriageway, Hatching, Turnout
from ...road.terrain import known_elevation
from ...road.things.thing import LengthwiseThing
from .pieces import CLOSE, Float, chord_stations, merged_stations
from .surface import RoadFrame


def side_of(geometry: RoadGeometry, item: RoadObject) -> Side:
    """Return the side of the carriageway that an object is written with: by its offset, a hatching's by its turnout.

    What is painted belongs to the carriageway whose pavement it is on.
    """
    if isinstance(item, Hatching):
        turnout = geometry.parameters.objects[item.turnout]
        assert isinstance(turnout, Turnout)
        carriageway = geometry.parameters.objects[turnout.carriageway]
        assert isinstance(carriageway, Carriageway)
        return carriageway.side
    return side_at(geometry, getattr(item, "offset", 0.0))


def side_at(geometry: RoadGeometry, offset: float) -> Side:
    """Return `left` or `right` by the sign of an offset, or the side of the road's only carriageway."""
    if len(geometry.sections) == 1:
        return next(iter(geometry.sections))
    return "left" if offset > 0.0 else "right"


class Ground:
    """Heights of road and ground, on which objects stand, above the profile's elevation at the same station.

    Attributes:
        geometry: the road.
        tolerance: largest distance (m) of what runs along the road from the surface below it.
    """

    def __init__(self, geometry: RoadGeometry, tolerance: float) -> None:
        self.geometry = geometry
        self.tolerance = tolerance
        points = geometry.parameters.of_type(PointObject)
        for name, item in points.items():
            if item.station > geometry.length + CLOSE:
                allowed = f"OpenDRIVE has nothing beyond the road's end, {geometry.length:.9g} m"
                raise InputError(f"objects.{name}.station", item.station, allowed)
        places = np.array([(item.station, item.offset) for item in points.values()]).reshape(-1, 2)
        heights = self.height(places[:, 0], places[:, 1])
        feet = heights + np.array([item.elevation for item in points.values()])
        self._feet = dict(zip(points, feet.tolist(), strict=True))

    def foot(self, name: str) -> float:
        """Return the height of a point object's foot above the profile, m, by the object's id."""
        return self._feet[name]

    def height(self, station: Float, offset: Float) -> Float:
        """Return the heights (N,) of road or ground above the profile, m; the road edge's without terrain data."""
        clipped = np.clip(station, 0.0, self.geometry.length)
        return known_elevation(self.geometry, clipped, offset) - self.geometry.profile.elevation(clipped)

    def sample_along(self, item: LengthwiseThing, frame: RoadFrame, middle_offset: float) -> Float:
        """Return rows (N, 4) of s, t, h and object height (m) along a lengthwise thing, linear in between.

        Between two rows all four are linear within the tolerance.

        Args:
            item: the object; it stands on the ground below its axis.
            frame: the carriageway that is its road.
            middle_offset: how far its middle lies to the left of its axis, m.
        """
        start, end = item.start_station, min(item.end_station, self.geometry.length)
        if end - start <= CLOSE:
            return np.empty((0, 4))
        sections = self.geometry.sections.values()
        bends = [s for section in sections for s in section.kinks()]
        bends += [point.station for section in sections for point in section.carriageway.crossfall]
        bends += [start + item.ramp_length(end), end - item.ramp_length(end)]
        full_height: Any = getattr(item, "height", 0.0)

        def rows(station: Float) -> Float:
            """Return s minus station, t, h and height (N, 4) at stations, m: functions that are nearly linear."""
            offset = item.offset_at(station)
            place = frame.road_coordinates(station, offset + middle_offset, self.height(station, offset))
            share = item.height_share(end, station)
            return np.column_stack([place.s - station, place.t, place.h, full_height * share])

        stations = chord_stations(rows, merged_stations(bends, start, end), self.tolerance, shortest=0.05)
        samples = rows(stations)
        samples[:, 0] += stations
        return samples
