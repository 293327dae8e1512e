"""Signals along a road: faces that things show to drivers, such as signs, boards on gantries, and traffic lights."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...road.things.thing import Signal, StandingThing
from ..things import PlacedThing
from .numbers import FreeIds
from .places import Ground, side_at
from .surface import RoadFrame
from .xml import Element, Value, add_object_data, element


@dataclass(frozen=True)
class Face:
    """A face of a thing that is written as a signal, such as a sign's plate.

    Attributes:
        placed: the thing that shows it.
        number, name: its id, and its name.
        signal: what it tells.
        middle: (3,) local coordinates of the middle of its lower edge, before the thing's foot.
        width, height: m.
    """

    placed: PlacedThing
    number: int
    name: str
    signal: Signal
    middle: Float
    width: float
    height: float


def signal_faces(standing: Iterable[PlacedThing], numbers: FreeIds) -> list[Face]:
    """Return the signal faces of standing things; a face that is a separate part gets an id of its own."""
    faces = []
    for placed in standing:
        assert isinstance(placed.thing, StandingThing)
        assert placed.frame
        for place, (part, signal) in enumerate(placed.thing.signals().items(), 1):
            bodies = [body for body in placed.bodies if body.part == part and not body.detail]
            corners = np.concatenate([body.sections.reshape(-1, 3) for body in bodies])
            lower, size = corners.min(axis=0), np.ptp(corners, axis=0)
            separate_number = bool(bodies[0].ifc)
            number, name = (
                (numbers.take(), f"{placed.name}-{place}") if separate_number else (placed.thing.instance, placed.name)
            )
            middle = placed.frame.to_local(np.array([lower[0] + size[0] / 2.0, 0.0, lower[2]]))
            faces.append(Face(placed, number, name, signal, middle, float(size[0]), float(size[2])))
    return faces


def write_signals(parent: Element, ground: Ground, frame: RoadFrame, faces: Iterable[Face]) -> None:
    """Add a `signal` element for each face on this carriageway's side of the centreline.

    Args:
        parent: the element that they are added to.
        ground: what they stand on.
        frame: the carriageway that is the road.
        faces: all faces.
    """
    for face in faces:
        station, offset = (float(value[0]) for value in ground.geometry.alignment.project(face.middle[None, :2]))
        if side_at(ground.geometry, offset) in frame.sides:
            _signal(parent, ground, frame, (face, min(max(station, 0.0), ground.geometry.length), offset))


def _signal(parent: Element, ground: Ground, frame: RoadFrame, face_and_place: tuple[Face, float, float]) -> None:
    """Add one `signal` element with a reference to its thing, placed at the lower edge of its face."""
    face, station, offset = face_and_place
    signal, thing = face.signal, face.placed.thing
    assert isinstance(thing, StandingThing)
    turn = math.remainder(thing.turn + (0.0 if signal.facing > 0.0 else math.pi), math.tau)
    with_stations = abs(turn) <= math.pi / 2.0 + 1e-12
    height = float(face.middle[2]) - float(ground.geometry.profile.elevation(np.array([station]))[0])
    place = frame.road_coordinates(np.array([station]), np.array([offset]), np.array([height]))
    attributes: dict[str, Value] = {
        "id": face.number,
        "name": face.name,
        "s": float(place.s[0]),
        "t": float(place.t[0]),
        "zOffset": round(float(place.h[0]), 6),
        "hOffset": turn if with_stations else math.remainder(turn + math.pi, math.tau),
        "orientation": "+" if with_stations else "-",
        "dynamic": "yes" if signal.dynamic else "no",
        "width": face.width,
        "height": face.height,
        "country": signal.country,
        "type": signal.type,
        "subtype": signal.subtype,
    }
    if signal.speed is not None:
        attributes |= {"value": signal.speed, "unit": signal.speed_unit}
    entry = element(parent, "signal", attributes | ({"text": signal.text} if signal.text else {}))
    kind = thing.twin().opendrive.partition(".")[0]
    element(entry, "reference", {"elementType": "object", "elementId": thing.instance, "type": kind})
    add_object_data(entry, face.placed.name, thing.instance, object_type=type(thing).__name__)
