"""Base of the things of a road: what stands at one place, and what runs along it. Each is one file beside this one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, NamedTuple

import numpy as np

from ..objects import LineObject, PointObject, RoadObject

_FACE_REACH = 0.03
"""Half the depth that a sign's or a board's face is given room for, m."""
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


class Thing(RoadObject):
    """Base of everything that stands on and beside a road.

    Attributes:
        order: place among the things in lists of them; those without one come last.
        obstacle: what its foot is called for people, where a barrier must stand before it; empty if none must.
    """

    order: ClassVar[int] = 1000
    obstacle: ClassVar[str] = ""

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes in which nothing else may stand."""
        raise NotImplementedError


class StandingThing(Thing, PointObject):
    """Base of what stands at one place."""

    def upright(self, half: float, top: float) -> Block:
        """Return what stands upright on its foot, half (m) its half width both ways."""
        s, d, z = self.station, self.offset, self.elevation
        return Block("foot", s - half, s + half, d - half, d + half, z, z + top)

    def face(self, width: float, lower_edge: float, height: float) -> Block:
        """Return an upright face of a width and height (m), turned as the thing stands."""
        turn = np.radians(self.rotation_deg)
        sine, cosine = float(abs(np.sin(turn))), float(abs(np.cos(turn)))
        across, along = cosine * width / 2.0 + _FACE_REACH * sine, sine * width / 2.0 + _FACE_REACH * cosine
        s, d, z = self.station, self.offset, self.elevation + lower_edge
        return Block("face", s - along, s + along, d - across, d + across, z, z + height)


class LengthwiseThing(Thing, LineObject):
    """Base of what runs along the road."""

    def strip(self, right: float, left: float, height: float) -> Block:
        """Return what is as high (m) all along, and reaches so far (m) to the right and to the left of its axis."""
        start, end = sorted((self.start_station, self.end_station))
        return Block("barrier", start, end, self.offset - right, self.offset + left, 0.0, height)
