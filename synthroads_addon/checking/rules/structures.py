"""Rules for bridges and tunnels of the road.

Of bridges: room, barriers, railings, kerbs, joints, and the height below them. Of tunnels: room, clear height,
walkways, emergency call points and exits, and that nothing else stands in them.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...base.arrays import Float
from ...road.objects import LineObject, width_at
from ...road.other_roads.parts import CrossingRoad
from ...road.section import Carriageway
from ...road.streets.street_side import StreetSide
from ...road.structures.bridge import Bridge
from ...road.structures.tunnel import Tunnel
from ...road.structures.tunnel_bodies import MIDDLE_WALL, SPRING, WIDE_MEDIAN
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.guardrail import Guardrail
from ...road.things.power_line import PowerLine
from ...road.things.thing import Block, Thing
from .rule import TOLERANCE, Finding, Road, Rule, at_least, at_most
from .side_roads import mouth_spans

RAILING = 1.0
"""Least height of railings on bridges, m: the usual height of recorded ones (B: figures of municipal bridges)."""
KERB = (0.05, 0.15)
"""Usual heights of kerbs on bridges, m (C; above 7.5 cm a kerb counts as high, SRBW)."""
NO_JOINT, ASPHALT_JOINT = 12.5, 50.0
"""Expansion lengths up to which a bridge needs no joint, and one of asphalt is enough, m (A: NW-B176, BASt-985)."""
TUNNEL_HEIGHT, WALKWAY = 4.5, 1.0
"""Least clear height over a tunnel's pavement, and least width of its walkways, m (B: a built example, GMP)."""
CALL_POINTS, EXITS, LONG_TUNNEL = 150.0, 300.0, 400.0
"""Largest distance of emergency call points (C), of emergency exits, and length from which these are needed, m (B)."""
CLEAR_HEIGHT = 2.0
"""Least height between ground and deck in a bridge's middle, m: people can pass below it. Chosen."""


def _structures(road: Road) -> dict[str, Bridge | Tunnel]:
    """Return the bridges and tunnels of a road by id."""
    return {**road.of(Bridge), **road.of(Tunnel)}


def _span(structure: Bridge | Tunnel) -> tuple[float, float]:
    """Return the stations (m) that a tunnel takes, or a bridge: its deck and its wing walls."""
    beside = structure.wing_length if isinstance(structure, Bridge) else 0.0
    return structure.start_station - beside, structure.end_station + beside


def _within(road: Road) -> Iterator[Finding]:
    """Yield a finding for each bridge or tunnel that reaches beyond the road's ends."""
    for name, structure in _structures(road).items():
        start, end = _span(structure)
        if start < -TOLERANCE:
            yield Finding(name, 0.0, -start, 0.0, f"{name} reaches {-start:.1f} m beyond the road's beginning.")
        over = end - road.length
        if over > TOLERANCE:
            yield Finding(name, road.length, over, 0.0, f"{name} reaches {over:.1f} m beyond the road's end.")


def _apart(road: Road) -> Iterator[Finding]:
    """Yield a finding for each structure that overlaps another one, a side road's mouth or a street side."""
    spans = sorted((*_span(structure), name) for name, structure in _structures(road).items())
    for (_, end, first), (start, _, second) in pairwise(spans):
        if start < end - TOLERANCE:
            text = f"{first} and {second} overlap by {end - start:.1f} m, wing walls included."
            yield Finding(second, start, end - start, 0.0, text)
    others = [(*span, "a side road's mouth") for side in road.sides for span in mouth_spans(road, side)]
    others += [(s.start_station, s.end_station, key) for key, s in road.of(StreetSide).items()]
    for start, end, name in spans:
        for low, high, other in others:
            overlap = min(end, high) - max(start, low)
            if overlap > TOLERANCE:
                text = f"{name} overlaps {other} by {overlap:.1f} m."
                yield Finding(name, max(start, low), overlap, 0.0, text)


def _barrier(road: Road) -> Iterator[Finding]:
    """Yield a finding for each edge of a bridge that barriers don't cover: its own, guardrails, others of concrete."""
    barriers = [item for kind in (Guardrail, ConcreteBarrier) for item in road.of(kind).values()]
    for name, bridge in road.of(Bridge).items():
        if bridge.barrier != "none":
            continue
        start, end = max(bridge.start_station, 0.0), min(bridge.end_station, road.length)
        for carriageway, side in road.sides.items():
            missing = _uncovered(start, end, [item for item in barriers if _is_outer(item, side.sign)])
            if missing > TOLERANCE * max(end - start, 1.0):
                text = (
                    f"Beside {carriageway} {missing:.1f} m of the bridge lack a barrier, which all of it needs (RPS)."
                )
                yield Finding(name, start, missing, 0.0, text)


def _is_outer(item: LineObject, sign: float) -> bool:
    """Return whether a barrier stands on a side of the road, away from its middle."""
    return sign * item.offset > 1.0


def _uncovered(start: float, end: float, items: list[LineObject]) -> float:
    """Return the length (m) between two stations at which none of some things runs."""
    reached, missing = start, 0.0
    for item in sorted(items, key=lambda item: item.start_station):
        if item.start_station > reached:
            missing += max(min(item.start_station, end) - reached, 0.0)
        reached = max(reached, min(item.end_station, end))
    return missing + max(end - reached, 0.0)


def _railing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each bridge whose railings are lower than `RAILING`, or that has none."""
    for name, bridge in road.of(Bridge).items():
        text = f"The bridge's railings are {bridge.railing_height:.2f} m high; they need {RAILING:.2f} m."
        yield from at_least(name, bridge.start_station, bridge.railing_height, RAILING, text)


def _kerb(road: Road) -> Iterator[Finding]:
    """Yield a finding for each bridge whose kerbs are lower or higher than usual."""
    low, high = KERB
    for name, bridge in road.of(Bridge).items():
        height = bridge.kerb_height
        if not low * (1.0 - TOLERANCE) <= height <= high * (1.0 + TOLERANCE):
            limit = low if height < low else high
            text = f"The bridge's kerbs are {100 * height:.1f} cm high; usual are {100 * low:g} to {100 * high:g} cm."
            yield Finding(name, bridge.start_station, height, limit, text)


def _joint(road: Road) -> Iterator[Finding]:
    """Yield a finding for each bridge that is too long for its kind of joint, or for none."""
    for name, bridge in road.of(Bridge).items():
        length = bridge.end_station - bridge.start_station
        limits = {"none": NO_JOINT, "asphalt": ASPHALT_JOINT}
        limit = limits.get(bridge.joint, np.inf)
        if length > limit * (1.0 + TOLERANCE):
            text = f"The bridge is {length:.1f} m long; joints of asphalt are enough up to {limit:g} m."
            if bridge.joint == "none":
                text = f"The bridge is {length:.1f} m long; without joints it may be {limit:g} m."
            yield Finding(name, bridge.start_station, length, limit, text)


def _clear_height(road: Road) -> Iterator[Finding]:
    """Yield a finding for each bridge whose deck is too near to the generated ground in its middle.

    Below one over a crossing road the ground is that road's.
    """
    if road.terrain is None or road.terrain.elevation_model is not None:
        return
    crossed = {crossing.bridge for crossing in road.of(CrossingRoad).values()}
    for name, bridge in road.of(Bridge).items():
        if name in crossed:
            continue
        height = bridge.valley_depth - bridge.deck_depth
        text = f"The bridge's deck lies {height:.2f} m above the ground in its middle; it needs {CLEAR_HEIGHT:.2f} m."
        middle = (bridge.start_station + bridge.end_station) / 2.0
        yield from at_least(name, middle, height, CLEAR_HEIGHT, text)


def _tunnel_clear_height(road: Road) -> Iterator[Finding]:
    """Yield a finding for each tunnel whose ceiling is too low anywhere over the pavement."""
    for name, tunnel in road.of(Tunnel).items():
        middle = np.array([(tunnel.start_station + tunnel.end_station) / 2.0])
        height = tunnel.height
        if tunnel.section == "vault":
            share = max(_pavement_share(road, middle), 0.0)
            height *= SPRING + (1.0 - SPRING) * float(np.sqrt(max(1.0 - share**2, 0.0)))
        text = f"The tunnel is {height:.2f} m high at the pavement's edge; it needs {TUNNEL_HEIGHT:.2f} m."
        yield from at_least(name, float(middle[0]), height, TUNNEL_HEIGHT, text)


def _pavement_share(road: Road, station: Float) -> float:
    """Return the distance of a tube's pavement's edge from the tube's middle as a share of its half width."""
    verges = {item.side: float(width_at(item.verge_width, station)[0]) for item in road.of(Carriageway).values()}
    sides = {edges.carriageway.side: edges for edges in road.sides.values()}
    outer = {side: float(edges.at(station).outer[0]) for side, edges in sides.items()}
    inner = {side: float(edges.inner(station)[0]) for side, edges in sides.items()}
    # (pavement, what lies beside it to either side) of each tube
    tubes = [(sum(outer.values()), tuple(verges.values()))]
    if sum(inner.values()) >= WIDE_MEDIAN:
        beside = (sum(inner.values()) - MIDDLE_WALL) / 2.0
        tubes = [(outer[side] - inner[side], (verges[side], beside)) for side in sides]
    halves = [((width + sum(verge)) / 2.0, verge) for width, verge in tubes]
    return max((half - width) / half for half, verge in halves for width in verge)


def _walkway(road: Road) -> Iterator[Finding]:
    """Yield a finding for each walkway of a tunnel, whose width is its verge's, that is too narrow."""
    for name, tunnel in road.of(Tunnel).items():
        station = np.linspace(tunnel.start_station, tunnel.end_station, 11)
        for item in road.of(Carriageway).values():
            width = float(width_at(item.verge_width, station).min())
            text = f"A walkway of the tunnel is {width:.2f} m wide; it needs {WALKWAY:.2f} m."
            yield from at_least(name, tunnel.start_station, width, WALKWAY, text)


def _call_points(road: Road) -> Iterator[Finding]:
    """Yield a finding for each tunnel whose emergency call points are too far from each other."""
    for name, tunnel in road.of(Tunnel).items():
        length = tunnel.end_station - tunnel.start_station
        distance = min(tunnel.phone_spacing or length, length)
        text = f"Emergency call points are {distance:.0f} m apart; they need to be {CALL_POINTS:g} m at most."
        yield from at_most(name, tunnel.start_station, distance, CALL_POINTS, text)


def _exits(road: Road) -> Iterator[Finding]:
    """Yield a finding for each long tunnel whose emergency exits are too far from each other."""
    for name, tunnel in road.of(Tunnel).items():
        length = tunnel.end_station - tunnel.start_station
        if length > LONG_TUNNEL:
            distance = min(tunnel.exit_spacing or length, length)
            text = f"Emergency exits are {distance:.0f} m apart; they need to be {EXITS:g} m at most."
            yield from at_most(name, tunnel.start_station, distance, EXITS, text)


def _in_tunnel(road: Road) -> Iterator[Finding]:
    """Yield a finding for each thing that stands in a tunnel."""
    tunnels = road.of(Tunnel)
    for name, thing in road.parameters.objects.items() if tunnels else ():
        if not isinstance(thing, Thing) or isinstance(thing, Bridge | Tunnel | PowerLine):
            continue
        for block in thing.footprint():
            inside = [key for key, tunnel in tunnels.items() if _is_in(road, tunnel, block)]
            if inside:
                yield Finding(name, block.start, 1.0, 0.0, f"{name} stands in {inside[0]}.")
                break


def _is_in(road: Road, tunnel: Tunnel, block: Block) -> bool:
    """Return whether a box reaches into a tunnel's tubes, onto its pavement or its walkways."""
    start, end = max(block.start, tunnel.start_station), min(block.end, tunnel.end_station)
    if end - start <= TOLERANCE or block.bottom > tunnel.height:
        return False
    station = np.array([start, (start + end) / 2.0, end])
    edges = [
        edges.sign * (edges.at(station).outer + width_at(edges.carriageway.verge_width, station))
        for edges in road.sides.values()
    ]
    left, right = np.max(edges, axis=0), np.min(edges, axis=0)
    return bool(((block.high > right) & (block.low < left)).any())


RULES = (
    Rule("structure-within-road", "Bridges and tunnels lie on the road", "m", "", "definition", _within),
    Rule("structure-apart", "Structures keep clear of junctions and each other", "m", "", "definition", _apart),
    Rule("bridge-barrier", "Bridges have barriers", "m", "RPS", "unconfirmed", _barrier),
    Rule("bridge-railing", "Least height of railings on bridges", "m", "", "unconfirmed", _railing),
    Rule("bridge-kerb", "Height of kerbs on bridges", "m", "", "unconfirmed", _kerb),
    Rule("bridge-joint", "Kind of joints by a bridge's length", "m", "ZTV-ING", "derived", _joint),
    Rule("bridge-clear-height", "Height between ground and deck", "m", "", "unconfirmed", _clear_height),
    Rule("tunnel-clear-height", "Clear height of tunnels", "m", "", "unconfirmed", _tunnel_clear_height),
    Rule("tunnel-walkway", "Narrowest walkways of tunnels", "m", "", "unconfirmed", _walkway),
    Rule("tunnel-call-points", "Emergency call points of tunnels", "m", "", "unconfirmed", _call_points),
    Rule("tunnel-exits", "Emergency exits of long tunnels", "m", "RABT", "unconfirmed", _exits),
    Rule("object-in-tunnel", "Nothing stands in tunnels", "1", "", "definition", _in_tunnel),
)
