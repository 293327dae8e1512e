"""Rules for construction zones, and for vehicles."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...road.guidelines import BEACON_SPACING, BEACON_SPACING_TAPER, CONSTRUCTION_LANE_WIDTH
from ...road.surroundings import Vehicle
from ...road.things.beacon import ConstructionBeacon
from ...road.things.temporary_barrier import TemporaryBarrier
from .edges import Edges, Float
from .rule import TOLERANCE, Finding, Road, Rule, at_least

#: Beacons farther apart than this (m) are of two construction zones.
ZONES_APART = 100.0
#: A row of beacons that moves sideways by more than this per metre closes or opens a lane.
TAPER_SLOPE = 1.0 / 50.0
#: Length and width of a vehicle, m: rather short and narrow ones of their kind.
VEHICLE_SIZES = {
    "car": (3.8, 1.6),
    "estate": (4.2, 1.6),
    "van": (4.8, 1.8),
    "truck": (7.0, 2.3),
    "semitrailer": (13.5, 2.4),
    "bus": (10.5, 2.4),
    "motorcycle": (1.8, 0.6),
}
#: Beacons may stand this much (m) farther apart: stations are rounded.
SPACING_ROOM = 1e-3


class _Beacon(NamedTuple):
    station: float
    distance: float
    name: str
    beacon: ConstructionBeacon


def _carriageway_at(road: Road, offset: float) -> Edges | None:
    """Return the carriageway on an offset's side of the centreline, or None if there is none."""
    return next((edges for edges in road.sides.values() if edges.sign * offset > 0.0), None)


def _beacon_rows(road: Road) -> Iterator[tuple[Edges, list[_Beacon]]]:
    """Yield (carriageway, beacons by station) for the beacons that traffic passes on the same side."""
    rows: dict[tuple[str, str], list[_Beacon]] = {}
    for name, beacon in road.of(ConstructionBeacon).items():
        edges = _carriageway_at(road, beacon.offset)
        if edges is not None:
            place = _Beacon(beacon.station, edges.sign * beacon.offset, name, beacon)
            rows.setdefault((edges.name, beacon.pass_side), []).append(place)
    for (side, _), beacons in rows.items():
        yield road.sides[side], sorted(beacons)


def _construction_zones(road: Road) -> Iterator[tuple[Edges, list[_Beacon]]]:
    """Yield (carriageway, beacons by station) for each construction zone."""
    for edges, beacons in _beacon_rows(road):
        first = 0
        for i, (here, there) in enumerate(pairwise(beacons), start=1):
            if there.station - here.station > ZONES_APART:
                yield edges, beacons[first:i]
                first = i
        yield edges, beacons[first:]


def _is_passed_outside(edges: Edges, place: _Beacon) -> bool:
    """Return whether traffic passes a beacon on its side away from the centreline."""
    return (place.beacon.pass_side == "left") == (edges.sign > 0)


def _beacon_spacing(road: Road) -> Iterator[Finding]:
    for _, beacons in _construction_zones(road):
        for here, there in pairwise(beacons):
            gap = there.station - here.station
            sideways = abs(there.distance - here.distance) > TAPER_SLOPE * gap
            limit = BEACON_SPACING_TAPER if sideways else BEACON_SPACING
            if gap > limit + SPACING_ROOM:
                where = "in a taper" if sideways else "along a construction zone"
                text = f"The next beacon stands {gap:.1f} m on; {limit:.0f} m are allowed {where} (RSA)."
                yield Finding(here.name, here.station, gap, limit, text)


def _open_lane(road: Road) -> Iterator[Finding]:
    for edges, beacons in _beacon_rows(road):
        station = np.array([place.station for place in beacons])
        distance = np.array([place.distance for place in beacons])
        inwards, outwards = _open_widths(edges, station, distance, np.array([b.beacon.width for b in beacons]) / 2.0)
        beyond = np.array([_is_passed_outside(edges, place) for place in beacons])
        for place, width in zip(beacons, np.where(beyond, outwards, inwards), strict=True):
            yield from _find_narrow(place.name, place.station, width)
    for name, barrier in road.of(TemporaryBarrier).items():
        side = _carriageway_at(road, barrier.offset)
        if side is None:
            continue
        station = np.array([barrier.start_station, barrier.end_station])
        distance = side.sign * np.array([barrier.offset, barrier.end_offset], dtype=np.float64)
        widest = np.maximum(*_open_widths(side, station, distance, barrier.base_width / 2.0))
        worst = np.argmin(widest)
        yield from _find_narrow(name, station[worst], widest[worst])


def _open_widths(edges: Edges, station: Float, distance: Float, half: Float | float) -> tuple[Float, Float]:
    """Return the widths (N,), (N,) of the lanes left open inwards and outwards of what stands at N distances, m."""
    lanes = edges.at(station).lanes
    outermost, innermost = lanes[:, 0], lanes[:, -1]
    inwards = np.minimum(distance - half, outermost) - innermost
    return inwards, outermost - np.maximum(distance + half, innermost)


def _find_narrow(name: str, station: float, open_width: float) -> Iterator[Finding]:
    text = f"{open_width:.2f} m of the lanes are left open beside it; {CONSTRUCTION_LANE_WIDTH} m are needed (RSA)."
    return at_least(name, station, open_width, CONSTRUCTION_LANE_WIDTH, text)


def _vehicle_lane(road: Road) -> Iterator[Finding]:
    for name, vehicle in road.of(Vehicle).items():
        edges = road.sides[vehicle.carriageway]
        length, needed = VEHICLE_SIZES[vehicle.model]
        lane = edges.lane_widths[vehicle.lane]
        low, high = vehicle.station - length / 2.0, vehicle.station + length / 2.0
        width = lane.width[0] if lane.constant else lane(edges.between(low, high)).min()
        text = f"Lane {vehicle.lane + 1} is {width:.2f} m wide there; the {vehicle.model} takes {needed} m."
        yield from at_least(name, vehicle.station, width, needed, text)


def _vehicle_overlap(road: Road) -> Iterator[Finding]:
    lanes: dict[tuple[str, int], list[tuple[float, float, str]]] = {}
    for name, vehicle in road.of(Vehicle).items():
        half = VEHICLE_SIZES[vehicle.model][0] / 2.0
        lanes.setdefault((vehicle.carriageway, vehicle.lane), []).append((vehicle.station, half, name))
    for vehicles in lanes.values():
        reached, before = -np.inf, ""
        for station, half, name in sorted(vehicles):
            gap = station - half - reached
            if gap < -TOLERANCE:
                text = f"The vehicle and {before} reach {-gap:.2f} m into each other."
                yield Finding(name, station, gap, 0.0, text)
            if station + half > reached:
                reached, before = station + half, name


def _vehicles_beside(road: Road, edges: Edges, row: Float) -> Iterator[tuple[str, float, float, float]]:
    """Yield (id, station, distance of its middle, distance of the row), m, of vehicles beside a row (R, 2)."""
    for name, vehicle in road.of(Vehicle).items():
        if vehicle.carriageway == edges.name and row[0, 0] <= vehicle.station <= row[-1, 0]:
            lanes = edges.at(np.array([vehicle.station])).lanes[0]
            middle = 0.5 * float(lanes[vehicle.lane] + lanes[vehicle.lane + 1])
            yield name, vehicle.station, middle, float(np.interp(vehicle.station, row[:, 0], row[:, 1]))


def _vehicle_closed(road: Road) -> Iterator[Finding]:
    vehicles = road.of(Vehicle)
    overlaps: list[tuple[str, float, float]] = []
    for edges, beacons in _construction_zones(road):
        row = np.array([(place.station, place.distance) for place in beacons])
        for name, station, middle, line in _vehicles_beside(road, edges, row):
            free = middle - line if _is_passed_outside(edges, beacons[0]) else line - middle
            overlaps.append((name, station, VEHICLE_SIZES[vehicles[name].model][1] / 2.0 - free))
    for barrier in road.of(TemporaryBarrier).values():
        side = _carriageway_at(road, barrier.offset)
        places = [(barrier.start_station, barrier.offset), (barrier.end_station, barrier.end_offset)]
        if side is None:
            continue
        row = np.array([(station, side.sign * offset) for station, offset in places])
        for name, station, middle, line in _vehicles_beside(road, side, row):
            reach = VEHICLE_SIZES[vehicles[name].model][1] / 2.0 + barrier.base_width / 2.0
            overlaps.append((name, station, reach - abs(middle - line)))
    for name, station, over in overlaps:
        if over > TOLERANCE:
            text = f"The vehicle reaches {over:.2f} m over the beacons or barriers that close its lane."
            yield Finding(name, station, over, 0.0, text)


RULES = (
    Rule("beacon-spacing", "Spacing of a construction zone's beacons", "m", "RSA", "unconfirmed", _beacon_spacing),
    Rule("open-lane", "Lane left open beside a construction zone", "m", "RSA", "confirmed", _open_lane),
    Rule("vehicle-lane", "Vehicles drive on lanes that are there", "m", "", "definition", _vehicle_lane),
    Rule("vehicle-closed", "Vehicles keep out of closed lanes", "m", "", "definition", _vehicle_closed),
    Rule("vehicle-overlap", "Vehicles keep apart", "m", "", "definition", _vehicle_overlap),
)
