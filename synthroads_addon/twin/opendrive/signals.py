"""Signals along a road: traffic signs, the signs of gantries, traffic lights and kilometre boards."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...road.objects import PointObject
from ...road.parameters import RoadParameters
from ...road.things.gantry import Gantry, GantrySign
from ...road.things.kilometre_board import KilometreBoard
from ...road.things.sign import TrafficSign
from ...road.things.traffic_light import TrafficLight
from .numbers import Numbers
from .objects import gantry_levels
from .places import Ground, side_of
from .surface import RoadFrame
from .xml import Element, Value, element, notes

SPEED_LIMIT = "274"
"""Number of the sign whose subtype is a speed, km/h."""
TRAFFIC_LIGHT = "1000001"
"""OpenDRIVE's number of a traffic light with its lights one above the other."""
_HEAD, _LIGHT = 1.3, 1.25
"""Width of a traffic light's head, and height per light, in diameters of a light."""


@dataclass(frozen=True)
class Signals:
    """The signals of one road, and all that is needed to write them.

    Attributes:
        parent: the element that they are added to.
        ground: what they stand on.
        frame: the carriageway that is the road.
        hung: numbers of the signs on gantries, by the gantry's id and the sign's place on it, from 1 on.
    """

    parent: Element
    ground: Ground
    frame: RoadFrame
    hung: Mapping[tuple[str, int], int]

    def write(self) -> None:
        """Add the road's signals in the order of the parameter set; each stands at the lower edge of its face."""
        for name, item in self.ground.geometry.parameters.objects.items():
            make = _MAKERS.get(type(item))
            if make and (isinstance(item, Gantry) or side_of(self.ground.geometry, item) == self.frame.side):
                make(self, name, item)


def number_hung(parameters: RoadParameters, numbers: Numbers) -> dict[tuple[str, int], int]:
    """Return a number for each sign on a gantry, by the gantry's id and the sign's place on it."""
    gantries = parameters.of_type(Gantry).items()
    return {(name, place): numbers.next() for name, item in gantries for place in range(1, len(item.signs) + 1)}


def _sign(to: Signals, name: str, item: TrafficSign) -> None:
    kind, _, subtype = item.code.partition("-")
    attributes: dict[str, Value] = {"country": "DE", "type": kind, "subtype": subtype or "-1"}
    if kind == SPEED_LIMIT and subtype.isdigit():
        attributes |= {"value": float(subtype), "unit": "km/h"}
    if item.text:
        attributes["text"] = "\n".join(item.text)
    face = (item.lower_edge, item.width, item.height)
    made = _signal(to, (name, item), face, attributes)
    notes(made, name, item.instance, object_type="TrafficSign", code=item.code, shape=item.shape)


def _board(to: Signals, name: str, item: KilometreBoard) -> None:
    attributes: dict[str, Value] = {"country": "DE", "type": "kilometreBoard", "subtype": "-1", "text": item.text}
    made = _signal(to, (name, item), (item.lower_edge, item.width, item.height), attributes)
    notes(made, name, item.instance, object_type="KilometreBoard")


def _light(to: Signals, name: str, item: TrafficLight) -> None:
    attributes: dict[str, Value] = {"country": "OpenDRIVE", "type": TRAFFIC_LIGHT, "subtype": "-1", "dynamic": "yes"}
    tall = _LIGHT * item.light_diameter * item.lights
    face = (item.height - tall, _HEAD * item.light_diameter, tall)
    made = _signal(to, (name, item), face, attributes)
    notes(made, name, item.instance, object_type="TrafficLight", lights=item.lights)


def _signal(
    to: Signals,
    named: tuple[str, Any],
    face: tuple[float, float, float],
    attributes: dict[str, Value],
) -> Element:
    """Add the signal of an object: its face's lower edge above the foot, width and height (m)."""
    name, item = named
    low, width, height = face
    about = {"id": item.instance, "name": name, **_place(to, item, item.offset, to.ground.foot(name) + low)}
    about |= {"dynamic": "no", "width": width, "height": height, **attributes}
    made = element(to.parent, "signal", about)
    element(made, "reference", {"elementType": "object", "elementId": item.instance, "type": "posts"})
    return made


def _gantry(to: Signals, name: str, item: Gantry) -> None:
    low, bottom = gantry_levels(to.ground, item)
    for number, sign in enumerate(item.signs, 1):
        if side_of(to.ground.geometry, sign) == to.frame.side:
            _hung(to, (name, item), (number, sign), (low, bottom))


def _hung(
    to: Signals, named: tuple[str, Gantry], numbered: tuple[int, GantrySign], levels: tuple[float, float]
) -> None:
    """Add a sign on a gantry; it faces the traffic that drives below it, and hangs before its beam."""
    (name, item), (number, sign), (low, bottom) = named, numbered, levels
    lower = bottom + (item.beam_height - sign.height) / 2.0 if item.ends_in_beam(sign, low) else low
    turned = item.model_copy(update={"rotation_deg": item.rotation_deg + (180.0 if sign.offset > 0.0 else 0.0)})
    about: dict[str, Value] = {"id": to.hung[name, number], "name": f"{name}-{number}"}
    about |= _place(to, turned, sign.offset, lower)
    about |= {"dynamic": "yes" if sign.kind == "display" else "no", "country": "DE", "type": sign.kind, "subtype": "-1"}
    about |= {"width": sign.width, "height": sign.height, "text": "\n".join(sign.text) if sign.text else None}
    made = element(to.parent, "signal", about)
    element(made, "reference", {"elementType": "object", "elementId": item.instance, "type": "gantry"})
    notes(made, name, item.instance, object_type="GantrySign")


def _place(to: Signals, item: PointObject, offset: float, height: float) -> dict[str, Value]:
    """Return where a signal is and which traffic it is for: + drives with the stations."""
    turn = (item.rotation_deg + 180.0) % 360.0 - 180.0
    with_stations = abs(turn) <= 90.0
    rest = turn if with_stations else (turn + 360.0) % 360.0 - 180.0
    place = to.frame.place(np.array([item.station]), np.array([offset]), np.array([height]))
    return {
        "s": float(place.s[0]),
        "t": float(place.t[0]),
        "zOffset": round(float(place.h[0]), 6),
        "hOffset": math.radians(rest),
        "orientation": "+" if with_stations else "-",
    }


_MAKERS: dict[type, Callable[[Signals, str, Any], None]] = {
    TrafficSign: _sign,
    KilometreBoard: _board,
    TrafficLight: _light,
    Gantry: _gantry,
}
