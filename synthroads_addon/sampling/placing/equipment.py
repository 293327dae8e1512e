"""Equipment beside the road: kilometre boards, emergency phones, cabinets, traffic lights and poles."""

from typing import Any

import numpy as np

from ...road.guidelines import EMERGENCY_PHONE_SPACING, KILOMETRE_BOARD_SPACING
from ...road.things.cabinet import Cabinet
from ...road.things.kilometre_board import KilometreBoard
from ...road.things.pole import Pole
from ...road.things.traffic_light import TrafficLight
from .draw import draw, pick
from .edge import ramp_station
from .layout import Layout, PlacementRequest, Roadside
from .ranges import draw_start, free_ranges, nearest_free
from .registry import small_thing

UTILITY_SIZES = ((0.8, 0.35, 1.1), (1.2, 0.4, 1.3), (0.6, 0.3, 0.9))
"""Width, depth and height of utility cabinets, m."""
PAD_MARGIN = 0.25
"""Reach of the levelled pad around a utility cabinet, m: the widest one fits before `FAR_ZONE`."""
LARGEST_KILOMETRE = 800
"""Kilometre of the road's first board at most."""
BESIDE_BOARD = 10.0
"""Phones stand at least so far from kilometre boards along the road, m."""
LIGHT_BEFORE_NOSE = 10.0
"""From an entry's traffic light to the nose ahead of it, m."""
LIGHTING_ARMS, SURVEILLANCE_ARMS = (1.0, 1.5, 2.0), (0.0, 0.5, 1.0)
"""Lengths of poles' arms, m."""
LIGHTING_DIAMETER, SURVEILLANCE_DIAMETER = 0.18, 0.25
"""Diameters of poles at their foot, m."""
_BOARD_WIDTH, _PHONE_WIDTH = 0.55, 0.3  # m across the road
LIGHT_WIDTH = 0.4
"""Room that a traffic light takes across the road, m."""
_HALF = 0.5  # m that a thing takes to either side along the road
_CABINET_HALF = 1.0  # m


def plan_periodic(layout: Layout, rng: np.random.Generator) -> None:
    """Place kilometre boards every half kilometre and emergency phones every 2 km, in pairs on both sides.

    The kilometres rise or fall with the stations, or are those that the road has; boards then stand at its half ones.
    Phones keep away from boards: their spacing is a multiple of theirs.
    """
    furniture = layout.site.scenario.furniture
    board = KILOMETRE_BOARD_SPACING * rng.random()
    count = int(layout.length / KILOMETRE_BOARD_SPACING) + 1
    first_number = count + int(rng.random() * 2 * LARGEST_KILOMETRE)
    step = pick(rng, (-1, 1))
    phone_shift = BESIDE_BOARD + (KILOMETRE_BOARD_SPACING - 2.0 * BESIDE_BOARD) * rng.random()
    phone = (board + phone_shift + pick(rng, range(4)) * KILOMETRE_BOARD_SPACING) % EMERGENCY_PHONE_SPACING
    if furniture.kilometre_boards:
        stations = (board + KILOMETRE_BOARD_SPACING * np.arange(count)).tolist()
        boards = [(station, first_number + step * number) for number, station in enumerate(stations)]
        if layout.site.alignment.first_station is not None:
            boards = [row for row in layout.site.alignment.counts(KILOMETRE_BOARD_SPACING) if row[1] >= 0]
        for station, halves in boards:
            for roadside in layout.sides.values() if station <= layout.length else ():
                put_kilometre_board(roadside, station, halves)
    if furniture.emergency_phones:
        count = int(layout.length / EMERGENCY_PHONE_SPACING) + 1
        for station in (phone + EMERGENCY_PHONE_SPACING * np.arange(count)).tolist():
            for roadside in layout.sides.values() if station <= layout.length else ():
                put_phone(roadside, station)


def put_kilometre_board(roadside: Roadside, station: float, halves: int) -> None:
    """Place a kilometre board, its text given in half kilometres, at a station of a roadside."""
    fields = {"text": f"{halves // 2},{5 * (halves % 2)}"}
    must_be_outside = _gore_is_taken(roadside, station)
    roadside.put(
        PlacementRequest("kilometre-board", KilometreBoard, station, _HALF, _BOARD_WIDTH, fields, outer=must_be_outside)
    )


def put_phone(roadside: Roadside, station: float) -> None:
    """Place an emergency phone at a station of a roadside."""
    must_be_outside = _gore_is_taken(roadside, station)
    fields = {"kind": "emergency_phone"}
    roadside.put(
        PlacementRequest("emergency-phone", Cabinet, station, _HALF, _PHONE_WIDTH, fields, outer=must_be_outside)
    )


def _gore_is_taken(roadside: Roadside, station: float) -> bool:
    """Return whether what belongs at a station must stand outside of a ramp, as the exit board stands in the gore."""
    return not roadside.near.is_free(station - _HALF, station + _HALF)


def plan_traffic_lights(layout: Layout, rng: np.random.Generator) -> None:
    """Place traffic lights beside entry ramps, at random, on their outer side before the gore."""
    for side, roadside in layout.sides.items():
        for turnout in layout.site.turnouts_of_kind(side, "entry"):
            if rng.random() >= layout.site.scenario.furniture.traffic_lights or turnout.ramp is None:
                continue
            shape = layout.site.shape(turnout)
            station = ramp_station(shape, min(shape.nose + LIGHT_BEFORE_NOSE, turnout.ramp.length))
            place = nearest_free(station, _HALF, LIGHT_BEFORE_NOSE, layout.length, roadside.near)
            if 0.0 <= station <= layout.length and place is not None:
                roadside.put(PlacementRequest("traffic-light", TrafficLight, place, _HALF, LIGHT_WIDTH, outer=True))


@small_thing("equipment", 20)
def plan_lighting(layout: Layout, rng: np.random.Generator) -> None:
    """Place lighting poles, at random, all along one side or both, but not beside turnouts."""
    limits = layout.site.scenario.furniture
    if rng.random() >= limits.lighting:
        return
    spacing, height = draw(rng, limits.lighting_spacing), draw(rng, limits.lighting_height)
    arm = pick(rng, LIGHTING_ARMS)
    sides = list(layout.sides.values())
    first_station = spacing * rng.random()
    for roadside in pick(rng, [sides, sides[:1], sides[-1:]]):
        for station in (first_station + spacing * np.arange(int(layout.length / spacing) + 1)).tolist():
            reservations = (roadside.near, roadside.crossed, roadside.restless)
            if station > layout.length or not all(t.is_free(station - _HALF, station + _HALF) for t in reservations):
                continue
            _put_pole(roadside, "lighting", station, height, LIGHTING_DIAMETER, arm)


@small_thing("equipment", 10)
def plan_surveillance(layout: Layout, rng: np.random.Generator) -> None:
    """Place at most one surveillance pole, at random, beside the road."""
    limits = layout.site.scenario.furniture
    if rng.random() >= limits.surveillance:
        return
    roadside = pick(rng, list(layout.sides.values()))
    free_stretches = free_ranges(0.0, layout.length, roadside.near, roadside.crossed, roadside.restless)
    start = draw_start(rng, free_stretches, 2.0 * _HALF)
    height, arm = draw(rng, limits.surveillance_height), pick(rng, SURVEILLANCE_ARMS)
    if start is not None:
        _put_pole(roadside, "surveillance", start + _HALF, height, SURVEILLANCE_DIAMETER, arm)


@small_thing("equipment", 30)
def plan_cabinets(layout: Layout, rng: np.random.Generator) -> None:
    """Place utility cabinets at random stations, as many per km as drawn."""
    sides = list(layout.sides.values())
    number = draw(rng, layout.site.scenario.furniture.cabinets_per_km) * layout.length / 1000.0
    for _ in range(int(number + rng.random())):
        roadside = pick(rng, sides)
        width, depth, height = pick(rng, UTILITY_SIZES)
        start = draw_start(rng, free_ranges(0.0, layout.length, roadside.near), 2.0 * _CABINET_HALF)
        if start is not None:
            fields = {"kind": "utility", "width": width, "depth": depth, "height": height, "pad_margin": PAD_MARGIN}
            room = width + 2.0 * PAD_MARGIN
            roadside.put(PlacementRequest("cabinet", Cabinet, start + _CABINET_HALF, _CABINET_HALF, room, fields))


def _put_pole(roadside: Roadside, kind: str, station: float, height: float, diameter: float, arm: float) -> None:
    """Request a pole of a kind at a station of a roadside."""
    fields: dict[str, Any] = {"kind": kind, "height": height, "diameter": diameter, "arm_length": arm}
    fields["rotation_deg"] = roadside.along_right  # its arm reaches over the road
    roadside.put(PlacementRequest(f"pole-{kind}", Pole, station, _HALF, diameter, fields, obstacle=True))
