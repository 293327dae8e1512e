"""Rules for signs, and for the clearance under what spans the pavement."""

from collections.abc import Iterator

import numpy as np

from ...road.guidelines import CLEARANCE, EXIT_SEQUENCE, EXIT_SIGN_ROOM, GORE_SIGN, SIGN_DISTANCE, SIGN_LOWER_EDGE
from ...road.things.gantry import Gantry
from ...road.things.overpass import Overpass
from ...road.things.sign import TrafficSign
from .edges import Edges, TurnoutEdges
from .rule import TOLERANCE, Finding, Road, Rule, at_least, at_most, below
from .side_roads import is_at_mouth

#: Signs may be turned away from their traffic by this angle, degrees.
TURNED = 45.0
#: Beacons before exits and boards in curves stand low.
LOW_SIGNS = ("450", "625")
#: Lower edge of signs on traffic islands, m (VwV-StVO on sections 39 to 43, from memory).
ISLAND_LOWER_EDGE = 0.6
#: Boards in curves and signposts at mouths are for the traffic of both directions of one carriageway.
FOR_BOTH = ("415", "418", "625")


def _sign_distance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each sign's face, lower than the clearance, too near to the paved edge."""
    clearance = road.positions.nearest
    for i in np.flatnonzero((clearance >= 0.0) & (clearance < SIGN_DISTANCE)):
        body, name, distance = road.bodies.items[i], road.bodies.names[i], clearance[i]
        if body.part == "face" and below(body.bottom, CLEARANCE):
            text = f"The sign stands {distance:.2f} m from the paved edge; {SIGN_DISTANCE} m are needed (VwV-StVO)."
            yield from at_least(name, 0.5 * (body.start + body.end), distance, SIGN_DISTANCE, text)


def _sign_lower_edge(road: Road) -> Iterator[Finding]:
    """Yield a finding for each traffic sign that hangs too low, beacons before exits left out."""
    for name, sign in road.of(TrafficSign).items():
        if not sign.code.startswith(LOW_SIGNS):
            limit = ISLAND_LOWER_EDGE if name in road.on_islands else SIGN_LOWER_EDGE
            text = f"The sign's lower edge is {sign.lower_edge:.2f} m high; {limit} m are needed (VwV-StVO)."
            yield from at_least(name, sign.station, sign.lower_edge, limit, text)


def _sign_facing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each sign that no carriageway's traffic sees from the front."""
    signs = road.signs
    angles = np.full(len(signs.names), np.inf)
    is_for_both = np.array([road.single and code.startswith(FOR_BOTH) for code in signs.codes], dtype=bool)
    for name, edges in road.sides.items():
        angles = np.where(signs.of[name] | is_for_both, np.minimum(angles, signs.away(edges)), angles)
    signs_by_name = road.of(TrafficSign)
    for i in np.flatnonzero(angles > TURNED):
        sign = signs_by_name.get(signs.names[i])
        if signs.names[i] in road.beside_others or (sign is not None and is_at_mouth(road, sign)):
            continue
        text = f"It is turned {angles[i]:.0f} degrees away from its traffic; {TURNED:.0f} are allowed."
        yield Finding(signs.names[i], signs.station[i], angles[i], TURNED, text)


def _exits(road: Road) -> list[tuple[Edges, TurnoutEdges]]:
    """Return the exits of all carriageways, with the carriageway's edges."""
    return [(edges, turnout) for edges, turnout in road.turnouts if turnout.turnout.kind == "exit"]


def _exit_sign_missing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each sign of the sequence before an exit that is missing at its place."""
    for edges, turnout in _exits(road):
        signs, begin = road.signs, turnout.station(0.0)
        for distance_before, code in EXIT_SEQUENCE.items():
            place = begin - edges.traffic * distance_before
            if 0.0 <= place <= road.length:
                stations = signs.station[signs.seen_by(edges, code, TURNED)]
                distance = np.abs(stations - place).min(initial=road.length)
                text = (
                    f"The nearest sign {code} is {distance:.0f} m from its place {distance_before:.0f} m before "
                    f"the exit; {EXIT_SIGN_ROOM:.0f} m are allowed (StVO)."
                )
                yield from at_most(turnout.name, place, distance, EXIT_SIGN_ROOM, text)


def _exit_sign_place(road: Road) -> Iterator[Finding]:
    """Yield a finding for each sign of the sequence that stands away from its place before an exit."""
    exits, signs = _exits(road), road.signs
    for side in {edges.name: edges for edges, _ in exits}.values():
        begins = np.array([turnout.station(0.0) for edges, turnout in exits if edges is side])
        for distance_before, code in EXIT_SEQUENCE.items():
            for i in signs.seen_by(side, code, TURNED):
                distance_ahead = side.traffic * (begins - signs.station[i])
                distance = np.abs(distance_ahead - distance_before).min()
                if np.any((distance_ahead >= 0.0) & (distance_ahead <= max(EXIT_SEQUENCE) + EXIT_SIGN_ROOM)):
                    text = (
                        f"The sign {code} stands {distance:.0f} m from where it belongs, "
                        f"{distance_before:.0f} m before an exit; {EXIT_SIGN_ROOM:.0f} m are allowed (StVO)."
                    )
                    yield from at_most(signs.names[i], signs.station[i], distance, EXIT_SIGN_ROOM, text)


def _gore_sign(road: Road) -> Iterator[Finding]:
    """Yield a finding for each exit without an exit board in its gore."""
    for edges, turnout in _exits(road):
        signs = road.signs
        start, end = turnout.span(turnout.nose, turnout.end)
        is_in_gore = signs.bare[edges.name] & (signs.station >= start) & (signs.station <= end)
        if not any(signs.codes[i].split("-")[0] == GORE_SIGN for i in np.flatnonzero(is_in_gore)):
            text = f"No sign {GORE_SIGN} stands in the exit's gore, behind its nose (StVO)."
            yield Finding(turnout.name, turnout.station(turnout.nose), 0.0, 1.0, text)


def _clearance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each gantry, overpass or sign too low over the pavement."""
    spans = [(name, item.station, item.clearance) for name, item in road.each(Gantry, Overpass)]
    for i in np.flatnonzero(road.positions.nearest < 0.0):
        body = road.bodies.items[i]
        # What stands on a traffic island has no traffic below it.
        if body.part == "face" and road.bodies.names[i] not in road.on_islands:
            spans.append((road.bodies.names[i], 0.5 * (body.start + body.end), body.bottom))
    for name, station, value in spans:
        text = f"{value:.2f} m are clear below it; {CLEARANCE:.2f} m are needed over the pavement (RAA)."
        yield from at_least(name, station, value, CLEARANCE, text)


def _gantry_sign(road: Road) -> Iterator[Finding]:
    """Yield a finding for each sign that reaches beyond its gantry's beam."""
    for name, gantry in road.of(Gantry).items():
        for sign in gantry.signs:
            half_width = sign.width / 2.0
            overshoot = max(
                sign.offset + half_width - gantry.left_offset, gantry.right_offset - sign.offset + half_width
            )
            if overshoot > TOLERANCE:
                text = f"A sign reaches {overshoot:.2f} m beyond the gantry's beam."
                yield Finding(name, gantry.station, overshoot, 0.0, text)


RULES = (
    Rule("sign-distance", "Signs keep off the pavement", "m", "VwV-StVO", "unconfirmed", _sign_distance),
    Rule("sign-lower-edge", "Lower edge of signs", "m", "VwV-StVO", "unconfirmed", _sign_lower_edge),
    Rule("sign-facing", "Signs face their traffic", "deg", "", "definition", _sign_facing),
    Rule("exit-sign-missing", "Exits are announced", "m", "StVO", "confirmed", _exit_sign_missing),
    Rule("exit-sign-place", "Exit signs stand in their order", "m", "StVO", "confirmed", _exit_sign_place),
    Rule("gore-sign", "An exit board stands in the gore", "1", "StVO", "confirmed", _gore_sign),
    Rule("gantry-sign", "Gantries' signs hang on their beams", "m", "", "definition", _gantry_sign),
    Rule("clearance", "Clearance over the pavement", "m", "RAA", "confirmed", _clearance),
)
