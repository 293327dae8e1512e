"""Base of the things of a road: what stands at one place, and what runs along it. Each is one file beside this one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import ClassVar, NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.schema import Model, quantity
from ..objects import LineObject, PointObject, RoadObject
from .body import Body, Course, Place
from .limits import Limits

_FACE_REACH = 0.03
"""Half the depth that a sign's or a board's face is given room for, m."""
_SHORTEST, _SHORTEST_RAMP = 0.01, 1e-3
"""Length from which there is something along the road, and from which its ends are ramped, m."""
SHORTEST_ELEMENT = 0.1
"""A rest of this share of an element (of a bay of a noise barrier) makes the last one longer instead of one more."""


class Block(NamedTuple):
    """A box around a part of a thing, in road coordinates.

    Attributes:
        part: ``foot``, ``face``, ``beam``, ``barrier`` or ``wall``.
        start, end: stations, m.
        low, high: offsets, m.
        bottom, top: heights above the surface, m.
    """

    part: str
    start: float
    end: float
    low: float
    high: float
    bottom: float
    top: float


class TwinTypes(NamedTuple):
    """Names of a thing's types in the twin formats: IFC, OpenDRIVE and CityJSON.

    Attributes:
        ifc: entity, predefined type, and of an assembly where it is put together, with dots between them.
        opendrive: type and subtype of the object, with a dot between them.
        cityjson: type of the city object.
        cityjson_part: type of the city objects that its parts are; empty where it is one body.
        kind: its object type in IFC; its class's name if empty.
        reference: number or text that says which one of its kind it is.
        temporary: whether it is there for a time only.
    """

    ifc: str = "IfcBuildingElementProxy.ELEMENT"
    opendrive: str = "obstacle.none"
    cityjson: str = "CityFurniture"
    cityjson_part: str = ""
    kind: str = ""
    reference: str = ""
    temporary: bool = False


class Signal(NamedTuple):
    """Message of a face to drivers, in OpenDRIVE's words.

    Attributes:
        type, subtype: numbers in the country's catalogue of signs.
        country: two letters, or OpenDRIVE.
        speed: a limit's speed.
        speed_unit: its unit, km/h or mph.
        text: what is written on it.
        dynamic: whether it changes.
        facing: 1 if it faces the traffic that the thing faces, -1 if the opposite one.
    """

    type: str
    subtype: str = "-1"
    country: str = "DE"
    speed: float | None = None
    speed_unit: str = "km/h"
    text: str = ""
    dynamic: bool = False
    facing: float = 1.0


class Thing(RoadObject):
    """Base of everything that stands on and beside a road.

    Attributes:
        order: place among the things in lists of them; those without one come last.
        limits: what a scenario says of how it is sampled; None where that has no fields for it.
        obstacle: what its foot is called for people, where a barrier must stand before it; empty if none must.
        left_out: what of it isn't among its bodies, for people.
        clearing: distance (m) around it within which no shrubs and trees grow; None where they may.
    """

    order: ClassVar[int] = 1000
    limits: ClassVar[type[Limits] | None] = None
    obstacle: ClassVar[str] = ""
    left_out: ClassVar[str] = ""
    clearing: ClassVar[float | None] = None

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes, in stations, offsets and heights, in which nothing else may stand."""
        raise NotImplementedError

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: IFC, OpenDRIVE and CityJSON."""
        return TwinTypes()

    def part_models(self) -> Mapping[str, Model]:
        """Return the parameters of its named parts, by name; empty where it has none."""
        return {}


class StandingThing(Thing, PointObject):
    """Base of what stands at one place. Where it leans, it is turned about its foot."""

    lean_deg: float | None = quantity(
        None, gt=0, le=80, unit="deg", description="Angle by which it leans from the vertical; none if not given."
    )
    lean_direction_deg: float | None = quantity(
        None,
        ge=-360,
        le=360,
        unit="deg",
        description="Where it leans to, counter-clockwise from the traffic that it faces; ahead if not given.",
    )

    def bodies(self, place: Place) -> list[Body]:
        """Return its closed solids in its frame; none if its shape isn't known here."""
        raise NotImplementedError

    def signals(self) -> Mapping[str, Signal]:
        """Return the messages of its faces to drivers, by the name of the part; empty where it has none."""
        return {}

    @property
    def turn(self) -> float:
        """Return the rotation of its frame about the vertical, rad; 0 where it faces traffic with the stations."""
        return math.radians(self.rotation_deg)

    @property
    def foot_offset(self) -> float:
        """Return the offset at which it has its foot, m."""
        return self.offset

    def upright(self, radius: float, top: float) -> Block:
        """Return the box of what stands on its foot: ``radius`` (m) is half its width both ways, ``top`` its height."""
        s, d, z = self.station, self.offset, self.elevation
        return Block("foot", s - radius, s + radius, d - radius, d + radius, z, z + top)

    def face(self, width: float, lower_edge: float, height: float) -> Block:
        """Return the box around an upright face of a width and height (m), turned as the thing stands."""
        turn = np.radians(self.rotation_deg)
        sine, cosine = float(abs(np.sin(turn))), float(abs(np.cos(turn)))
        half_width, half_length = cosine * width / 2.0 + _FACE_REACH * sine, sine * width / 2.0 + _FACE_REACH * cosine
        s, d, z = self.station, self.offset, self.elevation + lower_edge
        return Block("face", s - half_length, s + half_length, d - half_width, d + half_width, z, z + height)


class LengthwiseThing(Thing, LineObject):
    """Base of what runs along the road."""

    def bodies(self, course: Course) -> list[Body]:
        """Return its closed solids on the road, in local coordinates."""
        raise NotImplementedError

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m."""
        raise NotImplementedError

    def strip(self, right_reach: float, left_reach: float, height: float) -> Block:
        """Return the box of its whole length, so wide (m) to the right and left of its axis and so high (m)."""
        start, end = sorted((self.start_station, self.end_station))
        return Block("barrier", start, end, self.offset - right_reach, self.offset + left_reach, 0.0, height)

    def end_on(self, length: float) -> float | None:
        """Return the station of its end on a road of a length (m); None if nothing of it is on the road."""
        end = min(self.end_station, length)
        return end if end - self.start_station >= _SHORTEST else None

    def line(self, course: Course) -> tuple[Float, Float] | None:
        """Return the points (N, 3) below its axis and the unit vectors (N, 3) to its left there; None off the road."""
        end = self.end_on(course.length)
        if end is None:
            return None
        station = course.rows(self.offset_at, self.start_station, end, ())
        return course.feet(station, self.offset_at(station)), course.left(station)

    def ramp_length(self, end: float) -> float:
        """Return the length (m) over which either end is ramped down if it ends at a station (m); 0 if none is."""
        ramp = min(float(getattr(self, "terminal_length", 0.0)), (end - self.start_station) / 2.0)
        return ramp if ramp > _SHORTEST_RAMP else 0.0

    def height_share(self, end: float, station: Float) -> Float:
        """Return the share (N,) of its full height at stations (N,), ramped at its ends, if it ends at ``end`` (m)."""
        ramp = self.ramp_length(end)
        if not ramp:
            return np.ones(station.shape)
        return np.clip(np.minimum(station - self.start_station, end - station) / ramp, 0.0, 1.0)

    def element_ends(self, step: float, length: float) -> Float:
        """Return the end stations (E, 2), m, of its elements of ``step`` (m) each; the last one takes the rest."""
        count = max(1.0, math.ceil((self.end_station - self.start_station) / step - SHORTEST_ELEMENT))
        border = np.arange(min(count, max(math.ceil((length - self.start_station) / step), 0.0)) + 1.0)
        station = np.where(border < count, self.start_station + border * step, self.end_station)
        return np.column_stack([station[:-1], station[1:]])
