"""Roads with changes planted at several sizes, and the roads before: for the studies of changes.

A road of 80 m with two carriageways has each of its kinds of change at up to six stations, one size each, on both
sides. Kinds that share a road are apart across it, or half a step apart along it.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any, NamedTuple

from synthroads_addon import load_scenario, sample_road
from synthroads_addon.road.changes.change import Change, ChangeList
from synthroads_addon.road.changes.diff import diff_roads
from synthroads_addon.road.parameters import RoadParameters

LENGTH = 80.0
"""Of the roads, m."""
STATIONS = (7.0, 20.0, 33.0, 46.0, 59.0, 72.0)
"""Where the sizes of a series are planted, m."""
_HALF = 6.5
"""Half the step from one station to the next, m."""
_SIDES = ("right", "left")
_LANE, _INNER_LANE, _SHOULDER = 8.375, 4.625, 12.5
"""Middles of the two lanes and of the hard shoulder, distances from the centreline, m."""
_POST, _RAIL, _HEDGE, _TREE, _WALL = 15.0, 14.7, 18.0, 21.0, 19.0
"""Where things stand, distances from the centreline, m."""
_KEPT = ("Alignment", "Median", "Carriageway", "LineMarking", "Terrain", "Vegetation")
"""Types of objects that stay on the sampled road."""
_SETTINGS = (
    f"road.length={LENGTH:g}",
    "road.half_width=30",
    "road.trees_per_hectare=0",
    'road.vehicles.per_km={"minimum": 0, "maximum": 0}',
)


class Place(NamedTuple):
    """A place at which something is planted.

    Attributes:
        side: of the road.
        sign: of offsets on that side.
        station: m.
        name: id of what is planted there.
    """

    side: str
    sign: float
    station: float
    name: str


Data = dict[str, Any]
Planter = Callable[[Data, Data, Place, float], None]
"""Plants a change of a size at a place: gets the data of the sets before and after, and alters both."""


@dataclass(frozen=True)
class Series:
    """A kind of change at several sizes.

    Attributes:
        kind: of the change, as the lists call it; of damages their detail.
        what: what the size is of, for people.
        unit: of the size, for people.
        factor: from the data's unit to that one.
        sizes: in the data's unit, the smallest first; a single one of what is there or not.
        plant: plants one of them.
        shift: of its stations, m.
    """

    kind: str
    what: str
    unit: str
    factor: float
    sizes: tuple[float, ...]
    plant: Planter
    shift: float = 0.0


@dataclass(frozen=True)
class PlantedPair:
    """A road before and after planted changes.

    Attributes:
        before, after: the road.
        changes: from the one to the other.
        planted: kind, as a series calls it, and size of each change, in their order.
    """

    before: RoadParameters
    after: RoadParameters
    changes: ChangeList
    planted: tuple[tuple[str, float], ...]


@cache
def _base() -> RoadParameters:
    """Return a motorway without things, in a slight curve."""
    return sample_road(load_scenario("rq31-600m", list(_SETTINGS)).road, 3)


def planted_pair(name: str, many: Sequence[Series]) -> PlantedPair:
    """Return a road, by a name, before and after the changes of some series: on both sides at a station for each."""
    before: Data = _base().to_dict()
    before["objects"] = {key: item for key, item in before["objects"].items() if item["type"] in _KEPT}
    after = copy.deepcopy(before)
    for series in many:
        for side in _SIDES:
            sign = -1.0 if side == "right" else 1.0
            for number, size in enumerate(series.sizes):
                station = STATIONS[number] + series.shift
                series.plant(before, after, Place(side, sign, station, f"{series.kind}-{side}-{number}"), size)
    numbers = count(1 + max(item.get("instance", 0) for item in before["objects"].values()))
    given: dict[str, int] = {}
    roads = []
    for data, epoch in ((before, "before"), (after, "after")):
        for key, item in data["objects"].items():
            if "instance" not in item:
                item["instance"] = given[key] if key in given else given.setdefault(key, next(numbers))
        data["metadata"]["identifier"] = f"{name}-{epoch}"
        roads.append(RoadParameters.from_dict(data, name))
    changes = diff_roads(roads[0], roads[1])
    series_of = {series.kind: series for series in many}
    planted = []
    for change in changes.changes:
        series = series_of.get(change.detail) or series_of[change.kind]
        planted.append((series.kind, _size_of(change, series)))
    return PlantedPair(roads[0], roads[1], changes, tuple(planted))


def still_pair() -> PlantedPair:
    """Return a road with things of all kinds on which nothing changes."""
    before = planted_pair("still", STILL).before
    return PlantedPair(before, before, diff_roads(before, before), ())


def _size_of(change: Change, series: Series) -> float:
    """Return the size that was planted where a change is."""
    middle = (change.extent.start_station + change.extent.end_station) / 2.0 - series.shift
    nearest = min(range(len(series.sizes)), key=lambda number: abs(STATIONS[number] - middle))
    return series.sizes[nearest]


# --- pavement -----------------------------------------------------------------------------------------------------


def _lay(data: Data, place: Place, name: str, item: Data) -> None:
    """Add an element to a list of the pavement of a place's carriageway."""
    data["objects"][f"carriageway-{place.side}"]["pavement"].setdefault(name, []).append(item)


def _rut(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant ruts of a depth (m), 10 m long."""
    stretch = {"start_station": place.station - 5.0, "end_station": place.station + 5.0, "ramp_length": 1.0}
    _lay(after, place, "ruts", {"lane": 0, "depth": size, **stretch})


def _basin(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a settlement of a depth (m), 12 m long and 8 m wide."""
    basin = {"station": place.station, "offset": place.sign * _LANE, "length": 12.0, "width": 8.0, "depth": size}
    _lay(after, place, "settlements", basin)


def _rectangle(place: Place, middle: float, length: float, width: float) -> list[list[float]]:
    """Return the corners of a rectangle around a place, whose middle is so far from the centreline (m)."""
    start, end = place.station - length / 2.0, place.station + length / 2.0
    low, high = sorted(place.sign * (middle + step) for step in (-width / 2.0, width / 2.0))
    return [[start, low], [end, low], [end, high], [start, high]]


def _course(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a new course of a thickness (m), 10 m long and 3.6 m wide."""
    inner, outer = _INNER_LANE - 1.8, _INNER_LANE + 1.8
    stretch = {"start_station": place.station - 5.0, "end_station": place.station + 5.0, "ramp_length": 0.5}
    _lay(after, place, "overlays", {**stretch, "inner": inner, "outer": outer, "thickness": size})
    outline = _rectangle(place, _INNER_LANE, 10.0, 3.6)
    _lay(after, place, "patches", {"outline": outline, "age": 0.0, "height": 0.0})


def _patch(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a patch of a height (m), 2 m by 1.5 m."""
    outline = _rectangle(place, _INNER_LANE, 2.0, 1.5)
    _lay(after, place, "patches", {"outline": outline, "age": 0.0, "height": size})


def _hole(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a pothole of a depth (m), 0.6 m across."""
    hole = {"station": place.station, "offset": place.sign * _LANE, "length": 0.6, "width": 0.6, "depth": size}
    _lay(after, place, "potholes", hole)


def _crack(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a crack of a width (m), 6 m long and as deep as wide."""
    line = [[place.station + step, place.sign * _SHOULDER] for step in (-3.0, 3.0)]
    _lay(after, place, "cracks", {"kind": "longitudinal", "width": size, "depth": size, "lines": [line]})


def _wear(before: Data, after: Data, _: Place, size: float) -> None:
    """Wear a share of the film of all markings further."""
    after["materials"]["paint_wear"] = before["materials"]["paint_wear"] + size


def _anew(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a broken line's new dashes so far (m) from the old ones, which were ground off."""
    line = after["objects"][f"carriageway-{place.side}-line-1"]
    keys = ("width", "dash_length", "gap_length", "start_station", "end_station")
    boundary = place.sign * (_LANE + _INNER_LANE) / 2.0
    _lay(after, place, "removed_markings", {"offset": boundary, **{key: line[key] for key in keys}})
    line["start_station"] = size


# --- things -------------------------------------------------------------------------------------------------------


def _post(place: Place, height: float = 1.0) -> Data:
    """Return a delineator of a height (m) at a place."""
    turn = 0.0 if place.side == "right" else 180.0
    where = {"station": place.station, "offset": place.sign * _POST, "rotation_deg": turn}
    return {"type": "Delineator", "height": height, **where}


def _sign(place: Place) -> Data:
    """Return a round sign of 0.6 m at a place."""
    face = {"code": "274-120", "shape": "round", "width": 0.6, "height": 0.6}
    return {**_post(place), **face, "type": "TrafficSign"}


def _added(_: Data, after: Data, place: Place, size: float) -> None:
    """Plant a post of a height (m)."""
    after["objects"][place.name] = _post(place, size)


def _removed(before: Data, _: Data, place: Place, size: float) -> None:
    """Let a post of a height (m) stand there before."""
    before["objects"][place.name] = _post(place, size)


def _moved(before: Data, after: Data, place: Place, size: float) -> None:
    """Move a post along the road by a distance (m)."""
    before["objects"][place.name] = _post(place)
    after["objects"][place.name] = {**_post(place), "station": place.station + size}


def _bent(before: Data, after: Data, place: Place, size: float) -> None:
    """Bend a rail of 12 m by a depth (m) over 5 m."""
    faces = "left" if place.side == "right" else "right"
    stretch = {"start_station": place.station - 6.0, "end_station": place.station + 6.0, "terminal_length": 0.0}
    rail = {"type": "Guardrail", "offset": place.sign * _RAIL, "faces": faces, **stretch}
    before["objects"][place.name] = rail
    after["objects"][place.name] = {
        **rail,
        "dents": [{"station": place.station, "length": 5.0, "depth": place.sign * size}],
    }


def _leaning(before: Data, after: Data, place: Place, size: float) -> None:
    """Let a sign lean along the road by an angle (deg)."""
    before["objects"][place.name] = _sign(place)
    after["objects"][place.name] = {**_sign(place), "lean_deg": size, "lean_direction_deg": 0.0}


def _turned(before: Data, after: Data, place: Place, size: float) -> None:
    """Turn a sign by an angle (deg)."""
    before["objects"][place.name] = _sign(place)
    after["objects"][place.name] = {**_sign(place), "rotation_deg": _sign(place)["rotation_deg"] + place.sign * size}


def _panel(before: Data, after: Data, place: Place, _: float) -> None:
    """Take a panel of 4 m out of a noise barrier of 20 m."""
    stretch = {"start_station": place.station - 5.0, "end_station": place.station + 15.0}
    wall = {"type": "NoiseBarrier", "offset": place.sign * _WALL, "height": 3.0, **stretch}
    before["objects"][place.name] = wall
    after["objects"][place.name] = {**wall, "missing_panels": [2]}


def _grown(before: Data, after: Data, place: Place, size: float) -> None:
    """Let a tree of 6 m grow by a height (m)."""
    where = {"station": place.station, "offset": place.sign * _TREE, "rotation_deg": 0.0}
    tree = {"type": "Tree", "height": 6.0, "crown_diameter": 3.0, "crown_bottom": 1.5, "trunk_diameter": 0.15, **where}
    before["objects"][place.name] = tree
    after["objects"][place.name] = {**tree, "height": 6.0 + size}


def _cut(before: Data, after: Data, place: Place, size: float) -> None:
    """Cut a hedge of 2 m and 8 m length back by a height (m)."""
    stretch = {"start_station": place.station - 4.0, "end_station": place.station + 4.0}
    hedge = {"type": "Hedge", "offset": place.sign * _HEDGE, "height": 2.0, **stretch}
    before["objects"][place.name] = hedge
    after["objects"][place.name] = {**hedge, "height": 2.0 - size}


def _parked(_: Data, after: Data, place: Place, __: float) -> None:
    """Park a car on the hard shoulder."""
    where = {**_post(place), "offset": place.sign * _SHOULDER}
    del where["height"]
    after["objects"][place.name] = {**where, "type": "ParkedVehicle", "model": "car"}


def _zone(_: Data, after: Data, place: Place, __: float) -> None:
    """Set a beacon up between shoulder and lane."""
    beacon = {**_post(place), "type": "ConstructionBeacon", "pass_side": place.side}
    after["objects"][place.name] = {**beacon, "offset": place.sign * (_SHOULDER - 1.0)}


_WORN = tuple(
    Series("worn", "share of the film, worn further", "%", 100.0, (share,), _wear) for share in (0.1, 0.2, 0.4)
)
ONE_EACH = (
    Series("added", "height of a post", "m", 1.0, (0.3, 0.5, 0.75, 1.0, 1.5), _added),
    Series("removed", "height of a post", "m", 1.0, (0.3, 0.5, 0.75, 1.0, 1.5), _removed),
    Series("moved", "way of a post of 1 m", "m", 1.0, (0.05, 0.1, 0.2, 0.4, 0.8, 1.6), _moved),
    Series("bent", "depth of a rail's dent", "m", 1.0, (0.02, 0.05, 0.1, 0.2, 0.4, 0.8), _bent),
    Series("leaning", "lean of a sign", "deg", 1.0, (1.0, 2.0, 4.0, 8.0, 16.0, 32.0), _leaning, _HALF),
    Series("turned", "turn of a sign of 0.6 m", "deg", 1.0, (5.0, 10.0, 20.0, 30.0, 45.0, 60.0), _turned, _HALF),
    Series("panel_missing", "panel of 4 m by 3 m", "", 1.0, (1.0,), _panel),
    Series("spalled", "depth of a hole of 0.6 m", "mm", 1e3, (0.005, 0.01, 0.02, 0.04, 0.08, 0.15), _hole),
    Series("grown", "growth of a tree of 6 m", "m", 1.0, (0.1, 0.2, 0.4, 0.8, 1.6, 3.2), _grown),
    Series("cut_back", "off a hedge of 2 m", "m", 1.0, (0.05, 0.1, 0.2, 0.4, 0.8, 1.4), _cut),
    Series("rutted", "depth of ruts", "mm", 1e3, (0.001, 0.002, 0.004, 0.008, 0.016, 0.04), _rut),
    Series("settled", "depth of a basin of 12 m by 8 m", "mm", 1e3, (0.002, 0.005, 0.01, 0.02, 0.04, 0.08), _basin),
    Series("cracked", "width of a crack", "mm", 1e3, (0.002, 0.005, 0.01, 0.02, 0.04, 0.08), _crack),
    Series("patched", "height of a patch of 3 m²", "mm", 1e3, (0.001, 0.002, 0.004, 0.008, 0.015, 0.03), _patch),
    Series("overlaid", "thickness of a course", "mm", 1e3, (0.002, 0.005, 0.01, 0.02, 0.04, 0.08), _course),
    Series("marked_anew", "dashes half a period further", "", 1.0, (9.0,), _anew),
    Series("construction_zone", "beacons of 1 m", "", 1.0, (1.0,), _zone),
    Series("parked", "car", "", 1.0, (1.0,), _parked, _HALF),
)
_ROADS = {
    "course": ("added", "grown", "cut_back", "rutted", "overlaid"),
    "basin": ("removed", "turned", "panel_missing", "settled"),
    "patch": ("bent", "spalled", "cracked", "patched", "parked"),
    "paint": ("moved", "leaning", "marked_anew", "construction_zone"),
}
"""Kinds that share a road, by its name."""
ROADS: dict[str, tuple[Series, ...]] = {
    **{name: tuple(series for series in ONE_EACH if series.kind in kinds) for name, kinds in _ROADS.items()},
    **{f"worn-{100.0 * series.sizes[0]:g}": (series,) for series in _WORN},
}
"""Roads by name, with the series that are planted in each. Paint wears everywhere: each share has its own road."""
STILL = tuple(series for series in ONE_EACH if series.kind in ("moved", "leaning", "bent", "grown", "cut_back"))
"""Series whose things stand on a road on which nothing changes."""
KINDS = (*(series.kind for series in ONE_EACH[:8]), "worn", *(series.kind for series in ONE_EACH[8:]))
"""Kinds of changes that are drawn, and a damage that isn't (`spalled`), in the order of their codes."""
