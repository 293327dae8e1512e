"""Obstacles on the road as boxes along station, offset and height, and where they stand beside the carriageways."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...road.parameters import RoadParameters
from ...road.things import body_shapes as shapes
from ...road.things.furniture import (
    Asset,
    Cabinet,
    ConcreteBarrier,
    ConstructionBeacon,
    Delineator,
    Gantry,
    Guardrail,
    KilometreBoard,
    NoiseBarrier,
    Overpass,
    Pole,
    TrafficLight,
    TrafficSign,
)
from .edges import Edges, Float

#: What is longer than this (m) along the road is looked at at its ends as well.
LONG = 1.5
#: How far abutments reach, m: their embankments go on to the ground.
FAR = 1000.0


Bool = NDArray[np.bool_]
Spans = list[tuple[float, float]]
"""Stretches of the road, m."""


class Body(NamedTuple):
    """A box.

    Attributes:
        name: id of its object.
        part: ``foot``, ``face``, ``beam``, ``barrier`` or ``wall``.
        start, end: stations, m.
        low, high: offsets, m.
        bottom, top: heights above the surface, m.
    """

    name: str
    part: str
    start: float
    end: float
    low: float
    high: float
    bottom: float
    top: float


class Bodies:
    """All boxes of a road.

    Attributes:
        items: the boxes.
        start, end, low, high, bottom, top: (N,) their borders, m.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self.items: list[Body] = []
        self._of: dict[type, list[int]] = {}
        for name, item in parameters.objects.items():
            make = _MAKERS.get(type(item))
            if make is not None:
                first = len(self.items)
                self.items += make(name, item)
                self._of.setdefault(type(item), []).extend(range(first, len(self.items)))
        numbers = np.array([body[2:] for body in self.items], dtype=np.float64).reshape(-1, 6)
        self.start, self.end, self.low, self.high, self.bottom, self.top = numbers.T

    def of(self, *kinds: type, part: str) -> list[int]:
        """Return the indices of the boxes of some classes of objects that are one part of them."""
        return [i for kind in kinds for i in self._of.get(kind, ()) if self.items[i].part == part]

    @property
    def station(self) -> Float:
        """Return the stations (N,) of their middles, m."""
        return 0.5 * self.start + 0.5 * self.end


class Around:
    """Where the bodies are in relation to the carriageways.

    Posts and faces are looked at in their middle, what is long at its ends and at the stations of `marks` as well: the
    pavement's edge is straight, or hollow beside a ramp, from one to the next.

    Attributes:
        nearest, where: (N,) distance from the nearest pavement (m, negative over it), and at which station.
        clearance: by carriageway, (N,) distance from its pavement.
        bare: by carriageway, (N,) whether the middle of a body lies between the main road and a ramp.
        outer: by carriageway, (N,) whether a body lies outwards of the middle of its main road's pavement.
    """

    def __init__(self, bodies: Bodies, sides: dict[str, Edges], marks: Float) -> None:
        count, middle = len(bodies.items), bodies.station
        first = np.searchsorted(marks, bodies.start, side="right")
        inside = np.maximum(np.searchsorted(marks, bodies.end, side="left") - first, 0)
        long = np.flatnonzero(bodies.end - bodies.start > LONG)
        between = [marks[first[i] : first[i] + inside[i]] for i in long.tolist()]
        station = np.concatenate((middle, bodies.start[long], bodies.end[long], *between))
        index = np.concatenate((np.arange(count), long, long, np.repeat(long, inside[long])))
        low, high = bodies.low[index], bodies.high[index]
        self.clearance: dict[str, Float] = {}
        self.outer: dict[str, Bool] = {}
        self.bare: dict[str, Bool] = {}
        distance = np.full(len(station), np.inf)
        for name, edges in sides.items():
            across, span = edges.at(station), edges.distances(low, high)
            clearance = across.clearance(*span)
            self.clearance[name] = _least(clearance, index, count)
            at = 0.5 * (span[0] + span[1])[:count]
            self.outer[name] = at > across.middle[:count]
            self.bare[name] = (at > across.gap_low[:count]) & (at < across.gap_high[:count])
            distance = np.minimum(distance, clearance)
        self.nearest = _least(distance, index, count)
        order = np.argsort(-station, kind="stable")
        order = order[distance[order] <= self.nearest[index[order]]]
        self.where = np.zeros(count)
        self.where[index[order]] = station[order]


def _least(values: Float, index: NDArray[np.intp], count: int) -> Float:
    """Return the smallest (count,) of the values of each index."""
    least = np.full(count, np.inf)
    np.minimum.at(least, index, values)
    return least


class Barriers:
    """The guardrails and concrete barriers as arrays.

    Attributes:
        names: their ids.
        start, end, offset: (B,) m.
        faces: (B, 2) whether one has a face to the left, and to the right.
        clearance, where: (B,) distance from the pavement (m, negative over it), and at which station.
        outer: by carriageway, (B,) whether one stands outside of its middle.
    """

    def __init__(self, parameters: RoadParameters, bodies: Bodies, around: Around) -> None:
        index = bodies.of(Guardrail, ConcreteBarrier, part="barrier")
        self.names = [bodies.items[i].name for i in index]
        items: list[Any] = [parameters.objects[name] for name in self.names]
        numbers = [(item.start_station, item.end_station, item.offset) for item in items]
        self.start, self.end, self.offset = np.array(numbers, dtype=np.float64).reshape(-1, 3).T
        sides = [item.faces if isinstance(item, Guardrail) else "both" for item in items]
        self.faces = np.array([(side != "right", side != "left") for side in sides], dtype=bool).reshape(-1, 2)
        self.clearance, self.where = around.nearest[index], around.where[index]
        self.outer = {name: outer[index] for name, outer in around.outer.items()}

    def spans(self, which: Bool) -> Spans:
        """Return the stations that the barriers of a mask (B,) stand along."""
        return list(zip(self.start[which].tolist(), self.end[which].tolist(), strict=True))


class Beside:
    """Which barriers protect the traffic of a carriageway: they have a face to it and stand off all pavement.

    Attributes:
        distance: (B,) of their axes from the centreline, outwards.
        outer, inner: (B,) whether they do so outside of the carriageway, or inside.
    """

    def __init__(self, barriers: Barriers, name: str, edges: Edges) -> None:
        self.distance = edges.sign * barriers.offset
        outside = barriers.outer[name]
        to_left, to_right = barriers.faces.T
        outwards, inwards = (to_left, to_right) if edges.sign > 0 else (to_right, to_left)
        off = barriers.clearance >= 0.0
        self.outer, self.inner = off & outside & inwards, off & ~outside & outwards


class Signs:
    """Traffic signs, kilometre boards and traffic lights as arrays.

    Attributes:
        names, codes: their ids, and the traffic signs' codes.
        station: (S,) m.
        turned: (S,) by how much they are turned away from traffic with the stations, degrees from 0 to 180.
        of: by carriageway, (S,) whether one stands on its outer side, or on no carriageway's.
        bare: by carriageway, (S,) whether one stands between the main road and a ramp.
    """

    def __init__(self, parameters: RoadParameters, bodies: Bodies, around: Around) -> None:
        index = bodies.of(TrafficSign, KilometreBoard, part="face") + bodies.of(TrafficLight, part="foot")
        self.names = [bodies.items[i].name for i in index]
        items: list[Any] = [parameters.objects[name] for name in self.names]
        self.codes = [item.code if isinstance(item, TrafficSign) else "" for item in items]
        numbers = [(item.station, item.rotation_deg) for item in items]
        self.station, rotation = np.array(numbers, dtype=np.float64).reshape(-1, 2).T
        self.turned = np.abs((rotation + 180.0) % 360.0 - 180.0)
        outer = {name: values[index] for name, values in around.outer.items()}
        anyone = np.any(list(outer.values()), axis=0)
        self.of: dict[str, Bool] = {name: values | ~anyone for name, values in outer.items()}
        self.bare = {name: values[index] for name, values in around.bare.items()}

    def away(self, edges: Edges) -> Float:
        """Return by how much (S,) the signs are turned away from a carriageway's traffic, degrees."""
        return self.turned if edges.traffic > 0 else 180.0 - self.turned

    def seen(self, edges: Edges, code: str, room: float) -> NDArray[np.intp]:
        """Return the indices of the signs of a code that a carriageway's traffic sees, turned by `room` at most."""
        seen = self.of[edges.name] & (self.away(edges) <= room)
        return np.array([i for i, sign_code in enumerate(self.codes) if sign_code == code and seen[i]], dtype=np.intp)


def _upright(name: str, item: Any, half: float, top: float) -> Body:
    """Return what stands upright on its foot, `half` (m) its half width both ways."""
    s, d, z = item.station, item.offset, item.elevation
    return Body(name, "foot", s - half, s + half, d - half, d + half, z, z + top)


def _beacon(name: str, item: ConstructionBeacon) -> Iterator[Body]:
    body = _upright(name, item, item.width / 2.0, item.height)
    yield body._replace(start=item.station - shapes.BEACON_REACH, end=item.station + shapes.BEACON_REACH)


def _face(name: str, item: TrafficSign | KilometreBoard) -> Body:
    """Return the face of a sign or board, turned as it stands."""
    turn = np.radians(item.rotation_deg)
    across = float(abs(np.cos(turn))) * item.width / 2.0 + shapes.FACE_REACH * float(abs(np.sin(turn)))
    along = float(abs(np.sin(turn))) * item.width / 2.0 + shapes.FACE_REACH * float(abs(np.cos(turn)))
    s, d, z = item.station, item.offset, item.elevation + item.lower_edge
    return Body(name, "face", s - along, s + along, d - across, d + across, z, z + item.height)


def _sign(name: str, item: TrafficSign) -> Iterator[Body]:
    face = _face(name, item)
    half = item.post_diameter / 2.0
    for i in range(item.posts):
        share = (i + 0.5) / item.posts
        s = face.start + (face.end - face.start) * share
        d = face.low + (face.high - face.low) * share
        yield Body(name, "foot", s - half, s + half, d - half, d + half, item.elevation, face.top)
    yield face


def _board(name: str, item: KilometreBoard) -> Iterator[Body]:
    face = _face(name, item)
    yield _upright(name, item, shapes.BOARD_POST_REACH, item.lower_edge + item.height)
    yield face


def _gantry(name: str, item: Gantry) -> Iterator[Body]:
    posts = {"left": [item.left_offset], "right": [item.right_offset]}[item.post_side]
    if item.kind != "cantilever":
        posts = [item.left_offset, item.right_offset] + ([0.0] if item.kind == "two_sided" else [])
    half, s, top = item.post_width / 2.0, item.station, item.clearance + item.beam_height
    for d in posts:
        yield Body(name, "foot", s - half, s + half, d - half, d + half, 0.0, top)
    deep = item.beam_depth / 2.0
    yield Body(name, "beam", s - deep, s + deep, item.right_offset, item.left_offset, item.clearance, top)


def _overpass(name: str, item: Overpass) -> Iterator[Body]:
    half, s, top = item.width / 2.0, item.station, item.clearance + item.deck_thickness
    for d in item.pier_offsets:
        yield Body(
            name, "foot", s - half, s + half, d - item.pier_width / 2.0, d + item.pier_width / 2.0, 0.0, item.clearance
        )
    left, right = item.left_abutment, item.right_abutment
    yield Body(name, "beam", s - half, s + half, right, left, item.clearance, top)
    yield Body(name, "wall", s - half, s + half, left, FAR, 0.0, top)
    yield Body(name, "wall", s - half, s + half, -FAR, right, 0.0, top)


def _guardrail(name: str, item: Guardrail) -> Iterator[Body]:
    left = shapes.BEAM_REACH if item.faces in ("left", "both") else shapes.POST_REACH
    right = shapes.BEAM_REACH if item.faces in ("right", "both") else shapes.POST_REACH
    yield _along(name, item, right, left)


def _along(name: str, item: Any, right: float, left: float) -> Body:
    start, end = sorted((item.start_station, item.end_station))
    return Body(name, "barrier", start, end, item.offset - right, item.offset + left, 0.0, item.height)


def _on_foot(half_width: Callable[[Any], float]) -> Callable[[str, Any], list[Body]]:
    return lambda name, item: [_upright(name, item, half_width(item), item.height)]


def _symmetric(half_width: Callable[[Any], float]) -> Callable[[str, Any], list[Body]]:
    return lambda name, item: [_along(name, item, half_width(item), half_width(item))]


_MAKERS: dict[type, Callable[[str, Any], Iterable[Body]]] = {
    Asset: lambda name, item: [_upright(name, item, 0.0, 0.0)],
    Cabinet: _on_foot(lambda item: max(item.width, item.depth) / 2.0),
    ConcreteBarrier: _symmetric(lambda item: item.base_width / 2.0),
    ConstructionBeacon: _beacon,
    Delineator: _on_foot(lambda _: shapes.DELINEATOR_REACH),
    Gantry: _gantry,
    Guardrail: _guardrail,
    KilometreBoard: _board,
    NoiseBarrier: _symmetric(lambda item: max(item.thickness, item.post_width) / 2.0),
    Overpass: _overpass,
    Pole: _on_foot(lambda item: item.diameter / 2.0),
    TrafficLight: _on_foot(lambda item: item.light_diameter / 2.0),
    TrafficSign: _sign,
}
