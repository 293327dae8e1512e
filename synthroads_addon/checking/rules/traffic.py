"""Rules for construction zones, and for vehicles."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...road.guidelines import BEACON_SPACING, BEACON_SPACING_TAPER, CONSTRUCTION_LANE_WIDTH
from ...road.surroundings import RampVehicle, Vehicle
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
        first_beacon = 0
        for i, (beacon, next_beacon) in enumerate(pairwise(beacons), start=1):
            if next_beacon.station - beacon.station > ZONES_APART:
                yield edges, beacons[first_beacon:i]
                first_beacon = i
        yield edges, beacons[first_beacon:]


def _is_passed_outside(edges: Edges, place: _Beacon) -> bool:
    """Return whether traffic passes a beacon on its side away from the centreline."""
    return (place.beacon.pass_side == "left") == (edges.sign > 0)


def _beacon_spacing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each gap between beacons that is too long, in tapers or along a zone."""
    for _, beacons in _construction_zones(road):
        for beacon, next_beacon in pairwise(beacons):
            gap = next_beacon.station - beacon.station
            is_taper = abs(next_beacon.distance - beacon.distance) > TAPER_SLOPE * gap
            limit = BEACON_SPACING_TAPER if is_taper else BEACON_SPACING
            if gap > limit + SPACING_ROOM:
                place_text = "in a taper" if is_taper else "along a construction zone"
                text = f"The next beacon stands {gap:.1f} m on; {limit:.0f} m are allowed {place_text} (RSA)."
                yield Finding(beacon.name, beacon.station, gap, limit, text)


def _open_lane(road: Road) -> Iterator[Finding]:
    """Yield a finding for each beacon or movable barrier beside which too little of the lanes is left open."""
    for edges, beacons in _beacon_rows(road):
        station = np.array([place.station for place in beacons])
        distance = np.array([place.distance for place in beacons])
        inner_widths, outer_widths = _open_widths(
            edges, station, distance, np.array([b.beacon.width for b in beacons]) / 2.0
        )
        is_passed_outside = np.array([_is_passed_outside(edges, place) for place in beacons])
        for place, width in zip(beacons, np.where(is_passed_outside, outer_widths, inner_widths), strict=True):
            yield from _find_narrow(place.name, place.station, width)
    for name, barrier in road.of(TemporaryBarrier).items():
        side = _carriageway_at(road, barrier.offset)
        if side is None:
            continue
        station = np.array([barrier.start_station, barrier.end_station])
        distance = side.sign * np.array([barrier.offset, barrier.end_offset], dtype=np.float64)
        open_widths = np.maximum(*_open_widths(side, station, distance, barrier.base_width / 2.0))
        worst_end = np.argmin(open_widths)
        yield from _find_narrow(name, station[worst_end], open_widths[worst_end])


def _open_widths(edges: Edges, station: Float, distance: Float, half_width: Float | float) -> tuple[Float, Float]:
    """Return the widths (N,), (N,) of the lanes left open inwards and outwards of what stands at N distances, m."""
    lanes = edges.at(station).lanes
    outer_boundary, inner_boundary = lanes[:, 0], lanes[:, -1]
    inner_width = np.minimum(distance - half_width, outer_boundary) - inner_boundary
    return inner_width, outer_boundary - np.maximum(distance + half_width, inner_boundary)


def _find_narrow(name: str, station: float, open_width: float) -> Iterator[Finding]:
    """Yield a finding if less than the least width (m) of the lanes is open beside an object."""
    text = f"{open_width:.2f} m of the lanes are left open beside it; {CONSTRUCTION_LANE_WIDTH} m are needed (RSA)."
    return at_least(name, station, open_width, CONSTRUCTION_LANE_WIDTH, text)


def _vehicle_lane(road: Road) -> Iterator[Finding]:
    """Yield a finding for each vehicle whose lane is narrower than itself."""
    for name, vehicle in road.of(Vehicle).items():
        edges = road.sides[vehicle.carriageway]
        length, needed_width = VEHICLE_SIZES[vehicle.model]
        lane = edges.lane_widths[vehicle.lane]
        start, end = vehicle.station - length / 2.0, vehicle.station + length / 2.0
        width = lane.width[0] if lane.constant else lane(edges.between(start, end)).min()
        text = f"Lane {vehicle.lane + 1} is {width:.2f} m wide there; the {vehicle.model} takes {needed_width} m."
        yield from at_least(name, vehicle.station, width, needed_width, text)


def _vehicle_overlap(road: Road) -> Iterator[Finding]:
    """Yield a finding for each vehicle that reaches into the one before it in its lane."""
    lanes: dict[tuple[str, int], list[tuple[float, float, str]]] = {}
    for name, vehicle in road.each(Vehicle, RampVehicle):
        half_length = VEHICLE_SIZES[vehicle.model][0] / 2.0
        lanes.setdefault((vehicle.carriageway, vehicle.lane), []).append((vehicle.station, half_length, name))
    for vehicles in lanes.values():
        end_so_far, vehicle_before = -np.inf, ""
        for station, half_length, name in sorted(vehicles):
            gap = station - half_length - end_so_far
            if gap < -TOLERANCE:
                text = f"The vehicle and {vehicle_before} reach {-gap:.2f} m into each other."
                yield Finding(name, station, gap, 0.0, text)
            if station + half_length > end_so_far:
                end_so_far, vehicle_before = station + half_length, name


def _vehicles_beside(road: Road, edges: Edges, row: Float) -> Iterator[tuple[str, float, float, float]]:
    """Yield (id, station, distance of its middle, distance of the row), m, of vehicles beside a row (R, 2)."""
    for name, vehicle in road.of(Vehicle).items():
        if vehicle.carriageway == edges.name and row[0, 0] <= vehicle.station <= row[-1, 0]:
            lanes = edges.at(np.array([vehicle.station])).lanes[0]
            middle_distance = 0.5 * float(lanes[vehicle.lane] + lanes[vehicle.lane + 1])
            yield name, vehicle.station, middle_distance, float(np.interp(vehicle.station, row[:, 0], row[:, 1]))


def _vehicle_closed(road: Road) -> Iterator[Finding]:
    """Yield a finding for each vehicle that reaches over the beacons or barriers that close its lane."""
    vehicles = road.of(Vehicle)
    overlaps: list[tuple[str, float, float]] = []
    for edges, beacons in _construction_zones(road):
        row = np.array([(place.station, place.distance) for place in beacons])
        for name, station, vehicle_distance, line in _vehicles_beside(road, edges, row):
            free_width = vehicle_distance - line if _is_passed_outside(edges, beacons[0]) else line - vehicle_distance
            overlaps.append((name, station, VEHICLE_SIZES[vehicles[name].model][1] / 2.0 - free_width))
    for barrier in road.of(TemporaryBarrier).values():
        side = _carriageway_at(road, barrier.offset)
        places = [(barrier.start_station, barrier.offset), (barrier.end_station, barrier.end_offset)]
        if side is None:
            continue
        row = np.array([(station, side.sign * offset) for station, offset in places])
        for name, station, vehicle_distance, line in _vehicles_beside(road, side, row):
            reach = VEHICLE_SIZES[vehicles[name].model][1] / 2.0 + barrier.base_width / 2.0
            overlaps.append((name, station, reach - abs(vehicle_distance - line)))
    for name, station, overshoot in overlaps:
        if overshoot > TOLERANCE:
            text = f"The vehicle reaches {overshoot:.2f} m over the beacons or barriers that close its lane."
            yield Finding(name, station, overshoot, 0.0, text)


RULES = (
    Rule("beacon-spacing", "Spacing of a construction zone's beacons", "m", "RSA", "unconfirmed", _beacon_spacing),
    Rule("open-lane", "Lane left open beside a construction zone", "m", "RSA", "confirmed", _open_lane),
    Rule("vehicle-lane", "Vehicles drive on lanes that are there", "m", "", "definition", _vehicle_lane),
    Rule("vehicle-closed", "Vehicles keep out of closed lanes", "m", "", "definition", _vehicle_closed),
    Rule("vehicle-overlap", "Vehicles keep apart", "m", "", "definition", _vehicle_overlap),
)
