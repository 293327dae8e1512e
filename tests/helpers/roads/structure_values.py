"""Values of bridges and tunnels that were drawn from intervals of a scenario, read off the road's objects."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from synthroads_addon.road.objects import width_at
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.roads.drawn_values import Extractor, Objects, _field


def _lengths(kind: str) -> Extractor:
    return lambda objects, _: (item.end_station - item.start_station for item in objects[kind])


def _spans(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for item in objects["Bridge"]:
        yield from (b - a for a, b in pairwise([item.start_station, *item.pier_stations, item.end_station]))


def _verges(kind: str) -> Extractor:
    def values(objects: Objects, _: RoadParameters) -> Iterator[float]:
        for item in objects[kind]:
            middle = np.array([(item.start_station + item.end_station) / 2.0])
            yield from (float(width_at(road.verge_width, middle)[0]) for road in objects["Carriageway"])

    return values


STRUCTURE_EXTRACTORS: dict[str, Extractor] = {
    "bridges.per_km": lambda o, parameters: [1000.0 * len(o["Bridge"]) / parameters.alignment.length],
    "bridges.length": _lengths("Bridge"),
    "bridges.span": _spans,
    "bridges.valley_depth": _field("Bridge", "valley_depth"),
    "bridges.clearance": lambda o, _: (item.valley_depth - item.deck_depth for item in o["Bridge"]),
    "bridges.cap_width": _verges("Bridge"),
    "bridges.kerb_height": _field("Bridge", "kerb_height"),
    "bridges.wing_length": _field("Bridge", "wing_length"),
    "tunnels.per_km": lambda o, parameters: [1000.0 * len(o["Tunnel"]) / parameters.alignment.length],
    "tunnels.length": _lengths("Tunnel"),
    "tunnels.height": _field("Tunnel", "height"),
    "tunnels.cover": _field("Tunnel", "cover"),
    "tunnels.walkway_width": _verges("Tunnel"),
}
"""Path of an interval that only bridges and tunnels draw from -> the values of a road that were drawn from it."""
FEWER = {"bridges.per_km", "tunnels.per_km", "bridges.span"}
"""Intervals of which a road may have less than was drawn: where there is no room for more, or spans are alike."""
MORE = {"bridges.valley_depth", "bridges.clearance", "bridges.wing_length", "tunnels.height"}
"""Intervals of which a road may have more than was drawn: where the deck is deep, or a vault has to be high."""
