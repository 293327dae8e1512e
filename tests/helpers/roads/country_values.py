"""Values of a sampled country road for the scenario's intervals that only such roads draw from."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.building import OVERHANG
from synthroads_addon.road.things.limits import Interval
from synthroads_addon.sampling.placing.country.avenues import _HIGHEST, _JITTER, _LOWEST, _STEMS
from synthroads_addon.sampling.placing.village_plan import CROSSING_LENGTH, LOWERED
from synthroads_addon.scenario.changes import ChangeLimits
from tests.helpers.roads.drawn_values import Extractor, Objects, _field


def _per_km(kind: str, sides: int) -> Extractor:
    """Return what gives how many things of a type there are in a km, of each side or of the whole road."""

    def count(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
        if objects[kind]:
            yield len(objects[kind]) / sides / parameters.alignment.length * 1000.0

    return count


def _avenue(objects: Objects, sign: int) -> list[Any]:
    return sorted((tree for tree in objects["Tree"] if tree.offset * sign > 0.0), key=lambda tree: tree.station)


def _avenue_lengths(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for row in (_avenue(objects, sign) for sign in (1, -1)):
        if len(row) > 1:
            yield row[-1].station - row[0].station


def _avenue_spacings(objects: Objects, _: RoadParameters) -> Iterator[float]:
    """Yield the least distance of two neighbours: others were felled, or something stands in their place."""
    for row in (_avenue(objects, sign) for sign in (1, -1)):
        if len(row) > 8:
            yield min(b.station - a.station for a, b in pairwise(row))


def _avenue_distances(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    sections = RoadGeometry(parameters).sections
    for tree in objects["Tree"]:
        edge = sections["left" if tree.offset > 0.0 else "right"].paved_edge(np.array([tree.station]))[0]
        yield abs(tree.offset) - tree.trunk_diameter / 2.0 - edge


def _hedge_distances(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    """Yield the distances of hedges on roads without a village, whose gardens have hedges of their own."""
    if objects["StreetSide"]:
        return
    roads = {item.side: item for item in objects["Carriageway"]}
    sections = RoadGeometry(parameters).sections
    for hedge in objects["Hedge"]:
        side = "left" if hedge.offset > 0.0 else "right"
        middle = np.array([(hedge.start_station + hedge.end_station) / 2.0])
        verge = sections[side].paved_edge(middle)[0] + roads[side].verge_width
        yield abs(hedge.offset) - hedge.width / 2.0 - verge


def _bays(kind: str) -> Extractor:
    return lambda objects, _: (item.lane_length for item in objects["Turnout"] if item.kind == kind)


def _bay_tapers(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for item in objects["Turnout"]:
        yield from (item.taper_in_length, item.taper_out_length)


def _side_roads(lanes: int, name: str) -> Extractor:
    return lambda objects, _: (getattr(item, name) for item in objects["SideRoad"] if item.lanes == lanes)


def _footways(objects: Objects, _: RoadParameters) -> Iterator[float]:
    for street in objects["StreetSide"]:
        yield street.footway_width - (street.bays[0].width if street.bays else 0.0)


def _house_distances(objects: Objects, parameters: RoadParameters) -> Iterator[float]:
    streets = {parameters.carriageway_of(item).side: item for item in objects["StreetSide"]}
    sections = RoadGeometry(parameters).sections
    for house in objects["Building"]:
        side = "left" if house.offset > 0.0 else "right"
        if house.at_street:
            street = streets[side]
            edge = sections[side].main_edge([street.start_station])[0]
            widths = street.gutter_width + street.kerb_width + street.footway_width + street.verge_width
            yield abs(house.offset) - house.depth / 2.0 - OVERHANG - edge - widths


def _plot_lengths(objects: Objects, _: RoadParameters) -> Iterator[float]:
    """Yield the least distance of the beginnings of two drives of each side: some plots have none."""
    for street in objects["StreetSide"]:
        lowered = [level for level in street.kerb_levels if level.height == LOWERED]
        drives = [level for level in lowered if level.length != CROSSING_LENGTH]
        begins = [level.station - level.length / 2.0 for level in drives]
        if len(begins) > 4:
            yield min(b - a for a, b in pairwise(begins))


def _light_spacings(objects: Objects, _: RoadParameters) -> Iterator[float]:
    stations = sorted(item.station for item in objects["Pole"])
    if len(stations) > 3:
        yield float(np.median(np.diff(stations)))


def _island_tapers(objects: Objects, _: Any) -> Iterator[float]:
    """Yield over how many metres a lane moves by one beside each traffic island."""
    for road in objects["Carriageway"]:
        points = road.inner_edge_strip_width
        for first, last in pairwise(points) if isinstance(points, tuple) else ():
            if last.width != first.width:
                yield (last.station - first.station) / abs(last.width - first.width)


COUNTRY_EXTRACTORS: dict[str, Extractor] = {
    **{f"furniture.entrance_{name}": _field("FieldEntrance", name) for name in ("width", "radius", "depth")},
    "furniture.entrance_pipe": lambda o, _: (i.pipe_diameter for i in o["FieldEntrance"] if i.pipe_diameter),
    "furniture.entrances_per_km": _per_km("FieldEntrance", 2),
    "roadside.avenue_length": _avenue_lengths,
    "roadside.avenue_spacing": _avenue_spacings,
    "roadside.avenue_distance": _avenue_distances,
    "roadside.avenue_height": _field("Tree", "height"),
    "roadside.avenue_trunk": _field("Tree", "trunk_diameter"),
    "roadside.hedge_distance": _hedge_distances,
    **{
        f"side_roads.{name}": _field("SideRoad", name)
        for name in ("angle_deg", "length", "grade_percent", "blend_length")
    },
    "side_roads.per_km": _per_km("SideRoad", 1),
    "side_roads.radius": _field("SideRoad", "near_radius", "far_radius"),
    "side_roads.lane_width": _side_roads(2, "lane_width"),
    "side_roads.track_width": _side_roads(1, "lane_width"),
    "turnouts.bus_bay_length": _bays("bus_bay"),
    "turnouts.layby_length": _bays("layby"),
    "turnouts.side_bay_taper_length": _bay_tapers,
    "villages.length": lambda o, _: (item.end_station - item.start_station for item in o["StreetSide"]),
    "villages.kerb_height": _field("StreetSide", "kerb_height"),
    "villages.bay_width": lambda o, _: (bay.width for item in o["StreetSide"] for bay in item.bays),
    "villages.footway_width": _footways,
    "villages.house_distance": _house_distances,
    "villages.plot_length": _plot_lengths,
    "villages.island_width": _field("TrafficIsland", "width"),
    "villages.island_length": _field("TrafficIsland", "length"),
    "villages.island_taper": _island_tapers,
    "villages.light_height": _field("Pole", "height", kind="lighting"),
    "villages.light_spacing": _light_spacings,
}
"""Path of an interval that only country roads draw from -> the values of a road that were drawn from it."""
AT_MOST = {"furniture.entrance_pipe", "furniture.entrances_per_km", "roadside.avenue_length", "side_roads.per_km"}
"""Intervals of which a road may have less than was drawn: where there is no room for more."""
SPREAD = {
    "roadside.avenue_height": (_LOWEST, _HIGHEST, 0.0),
    "roadside.avenue_trunk": (*_STEMS, 0.0),
    "roadside.avenue_spacing": (1.0, 1.0, 2.0 * _JITTER),
    "villages.light_spacing": (1.0, 1.0, 7.0),
}
"""Intervals whose value each of several things has varied: least and largest factor, and m to either side.

Street lights are moved beside drives.
"""
INTERCHANGES = {
    f"interchange.{name}"
    for name in (
        *("design_speed", "radius", "grade", "crest_radius", "distance", "lane_width", "corner_radius", "clearance"),
        *("loop_radius", "loop_crossfall", "curve_crossfall", "edge_strip_width", "ramp_spacing", "vehicles_per_km"),
    )
}
"""Intervals of interchanges: `tests/sampling/test_interchanges.py` looks at them."""
UNSEEN = {
    *("roadside.avenue_gaps", "overtaking.section_length"),
    *INTERCHANGES,
    *(f"changes.{name}" for name, info in ChangeLimits.model_fields.items() if info.annotation is Interval),
}
"""Intervals that can't be read off one road."""
