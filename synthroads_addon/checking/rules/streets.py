"""Rules for villages: parking bays, pedestrian crossings, bus stops, traffic islands."""

from collections.abc import Iterator

import numpy as np

from ...road.guidelines import SignRole
from ...road.streets.street_side import StreetSide
from ...road.things.pole import Pole
from ...road.things.sign import TrafficSign
from ...road.things.sign_catalogue import KILOMETRES_PER_HOUR
from ...road.things.traffic_island import TrafficIsland
from .edges import Edges
from .rule import Finding, Road, Rule, at_least, at_most, below

_PLACE = "R-FGUE, as Landesverkehrswacht tells"
#: Most lanes per direction at a pedestrian crossing (Landesverkehrswacht).
CROSSING_LANES = 1
#: A pedestrian crossing counts as lit where a street light stands so near (m); derived: lights are up to 40 m apart.
LIT_WITHIN = 20.0
#: A sign faces traffic if it is turned away by less than this, degrees.
FACING = 45.0


def _streets_at(road: Road, station: float) -> dict[str, StreetSide]:
    """Return the street sides at a station (m) by the carriageway that they lie beside."""
    streets = road.of(StreetSide).values()
    return {street.carriageway: street for street in streets if street.start_station <= station <= street.end_station}


def _signs(road: Road, role: SignRole) -> Iterator[tuple[str, TrafficSign]]:
    """Yield the signs, with their ids, that serve a purpose in the road's country, whatever their subtype."""
    code = road.sign_of(role)
    if code is not None:
        number = code.partition("-")[0]
        yield from ((n, sign) for n, sign in road.of(TrafficSign).items() if sign.code.partition("-")[0] == number)


def _crossings(road: Road) -> Iterator[tuple[str, TrafficSign]]:
    """Yield the signs of pedestrian crossings, with their ids, where the guideline has rules for these."""
    if road.limits.crossing_speed:
        yield from _signs(road, "crossing")


def _speed(sign: TrafficSign) -> float | None:
    """Return the speed limit that a sign sets, km/h, or None."""
    signal = sign.signals()["face"]
    return None if signal.speed is None else signal.speed * KILOMETRES_PER_HOUR[signal.speed_unit]


def _bay_width(road: Road) -> Iterator[Finding]:
    """Yield a finding for each parking bay that is too narrow."""
    limit = road.limits.parking_width
    for name, street in road.of(StreetSide).items():
        for bay in street.bays:
            text = (
                f"The parking bay is {bay.width:.2f} m wide; {limit:.2f} m are needed ({road.cite('parking_width')})."
            )
            yield from at_least(name, bay.start_station, bay.width, limit, text)


def _crossing_footways(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossing's sign that doesn't stand between two footways."""
    for name, sign in _crossings(road):
        sides = len(_streets_at(road, sign.station))
        text = f"The pedestrian crossing has a footway on {sides} of {len(road.sides)} sides ({_PLACE}; confirmed)."
        yield from at_least(name, sign.station, sides, len(road.sides), text)


def _crossing_lanes(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossing's sign beside a carriageway with more than one lane per direction."""
    most_lanes = max((len(edges.carriageway.lanes) for edges in road.sides.values()), default=0)
    for name, sign in _crossings(road):
        text = (
            f"The pedestrian crossing leads over {most_lanes} lanes of one direction; one is allowed "
            f"({_PLACE}; confirmed)."
        )
        yield from at_most(name, sign.station, most_lanes, CROSSING_LANES, text)


def _crossing_speed(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossing where a sign before it allows more than 50 km/h."""
    for name, sign in _crossings(road):
        # Signs that traffic of the same direction meets before this one, nearest last.
        ahead = 1.0 if abs((sign.rotation_deg + 180.0) % 360.0 - 180.0) < 90.0 else -1.0
        before = [
            (ahead * other.station, speed)
            for other in road.of(TrafficSign).values()
            if (speed := _speed(other)) is not None
            and ahead * other.station <= ahead * sign.station
            and abs((other.rotation_deg - sign.rotation_deg + 180.0) % 360.0 - 180.0) < 90.0
            and _streets_at(road, other.station)
        ]
        if before:
            speed, limit = max(before)[1], road.limits.crossing_speed
            source = road.cite("crossing_speed")
            text = f"The limit at the pedestrian crossing is {speed:g} km/h; {limit:g} are allowed ({source})."
            yield from at_most(name, sign.station, speed, limit, text)


def _crossing_lit(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossing without a street light near it."""
    lights = np.array([pole.station for pole in road.of(Pole).values() if pole.kind == "lighting"])
    for name, sign in _crossings(road):
        distance = float(np.abs(lights - sign.station).min(initial=road.length))
        text = (
            f"The next street light stands {distance:.1f} m from the pedestrian crossing, which has to be lit "
            f"({_PLACE}; the distance is derived)."
        )
        yield from at_most(name, sign.station, distance, LIT_WITHIN, text)


def _bus_street(road: Road) -> Iterator[Finding]:
    """Yield a finding for each bus stop in a village whose carriageway is too narrow for buses."""
    limit = road.limits.bus_carriageway
    for name, sign in _signs(road, "bus_stop"):
        if road.single and limit and _streets_at(road, sign.station):
            width = sum(_paved_width(edges, sign.station) for edges in road.sides.values())
            if below(width, limit):
                text = (
                    f"The carriageway at the bus stop is {width:.2f} m wide; {limit:.2f} m are needed "
                    f"({road.cite('bus_carriageway')})."
                )
                yield Finding(name, sign.station, width, limit, text)


def _paved_width(edges: Edges, station: float) -> float:
    """Return the width of one direction's pavement at a station, m, gutters and bays left out."""
    there = edges.at(np.array([station]))
    return float(there.main[0] - there.inner[0])


def _island_lane(road: Road) -> Iterator[Finding]:
    """Yield a finding for each traffic island, or sign on one, that reaches into a lane."""
    islands, signs = road.of(TrafficIsland), road.of(TrafficSign)
    items: dict[str, TrafficIsland | TrafficSign] = {**islands, **{name: signs[name] for name in road.on_islands}}
    for name, item in items.items():
        for block in item.footprint():
            for edges in road.sides.values():
                stations = edges.between(block.start, block.end)
                reach = edges.distances(np.array([block.low]), np.array([block.high]))[1][0]
                overlap = reach - edges.at(stations).lanes[:, -1]
                worst = int(np.argmax(overlap))
                text = f"The {'island' if name in islands else 'sign'} reaches {overlap[worst]:.2f} m into a lane."
                yield from at_most(name, float(stations[worst]), float(overlap[worst]), 0.0, text)


def _island_sign(road: Road) -> Iterator[Finding]:
    """Yield a finding for each traffic island without a sign on it for one of the directions that pass it."""
    code = road.sign_of("island")
    if code is None:
        return
    for name, island in road.of(TrafficIsland).items():
        on_it = [road.of(TrafficSign)[sign] for sign, owner in road.on_islands.items() if owner == name]
        for edges in road.sides.values():
            turn = 0.0 if edges.traffic > 0 else 180.0
            facing = [
                sign
                for sign in on_it
                if sign.code == code and abs((sign.rotation_deg - turn + 180.0) % 360.0 - 180.0) < FACING
            ]
            text = (
                f"No sign {code} on the island faces the traffic of {edges.name} "
                "(StVO, annex 2, as common knowledge; unconfirmed)."
            )
            yield from at_least(name, island.station, len(facing), 1, text)


RULES = (
    Rule("parking-width", "Narrowest parking bay along the road", "m", "RASt", "confirmed", _bay_width),
    Rule(
        "crossing-footways",
        "Pedestrian crossings lead from footway to footway",
        "1",
        _PLACE,
        "confirmed",
        _crossing_footways,
    ),
    Rule(
        "crossing-lanes",
        "Pedestrian crossings lead over one lane per direction",
        "1",
        _PLACE,
        "confirmed",
        _crossing_lanes,
    ),
    Rule("crossing-speed", "Speed limit at pedestrian crossings", "km/h", _PLACE, "confirmed", _crossing_speed),
    Rule("crossing-light", "Pedestrian crossings are lit", "m", _PLACE, "derived", _crossing_lit),
    Rule("island-lane", "Traffic islands keep out of lanes", "m", "", "definition", _island_lane),
    Rule("island-sign", "Traffic islands have signs for both directions", "1", "StVO", "unconfirmed", _island_sign),
    Rule("bus-carriageway", "Carriageway at bus stops in villages", "m", "RASt", "confirmed", _bus_street),
)
