"""Rules for interchanges: radii and grades of ramps, their joins, their distance, and what stands on them.

Of crossing roads below the motorway also the room below its bridge.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ...road.guidelines import BARRIER_DISTANCE, CLEARANCE
from ...road.objects import PointObject
from ...road.other_roads.guardrail import RampGuardrail
from ...road.other_roads.parts import ConnectingRamp, CrossingRoad, OwnAxis
from ...road.structures.bridge import Bridge
from ...road.structures.bridge_bodies import SEAT
from ...road.things.overpass import Overpass
from .edges import EdgeDistances, Float
from .lines import line_of, places_of, whole_line
from .rule import TOLERANCE, Finding, Road, Rule, above, at_least, at_most, below

SIDE_FRICTION = 0.22
"""Share of side friction that curves of ramps use at their design speed. Chosen: RAA's table of radii wasn't found."""
_GRAVITY = 127.0
"""9.81 m/s2 times 3.6^2, by which v^2 in km/h over a radius in m is a share of gravity."""
STEEPEST_RAMP, STEEPEST_CROSSING = 6.0, 6.5
"""Steepest grades, %: of ramps (common knowledge, not found in print), of country roads of class EKL 3 (textbook)."""
_JOIN = 1e-3
"""Largest step and gap where roads join, m."""
_RAIL_FACE = 0.2
"""From the axis of a guardrail's posts to its face, m."""
_EVERY = 4
"""Every so many places of an axis is looked at for its distance from others."""
_CAP = 2.5
"""Width of a bridge's caps at most, m: what stands there stands above what is below."""
_BLEND = 12.0
"""Longest stretch over which a mouth's surface turns to its own, m: as the program builds it."""


def _height(road: OwnAxis, station: float) -> float:
    """Return the height (m) of a road's profile at its own station (m): tangents rounded by parabolas."""
    points = road.vertical
    if len(points) == 1:
        return points[0].elevation
    s, z = np.array([p.station for p in points]), np.array([p.elevation for p in points])
    grades = np.diff(z) / np.where(np.diff(s) == 0.0, 1e-9, np.diff(s))
    piece = int(np.clip(np.searchsorted(s, station, side="right") - 1, 0, len(grades) - 1))
    height = float(z[piece] + grades[piece] * (station - s[piece]))
    for number in range(1, len(points) - 1):
        change = grades[number] - grades[number - 1]
        tangent = points[number].radius * abs(change) / 2.0
        distance = abs(station - s[number])
        if distance < tangent:
            height += float(np.sign(change)) * (tangent - distance) ** 2 / (2.0 * points[number].radius)
    return height


def _radius(road: Road) -> Iterator[Finding]:
    """Yield a finding for each ramp that curves more sharply than its design speed allows."""
    for name, ramp in road.of(ConnectingRamp).items():
        fall = max((abs(p.crossfall_percent) for p in ramp.crossfall), default=0.0) / 100.0
        least = ramp.design_speed**2 / (_GRAVITY * (SIDE_FRICTION + fall))
        sharpest = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in ramp.horizontal)
        radius = 1.0 / max(sharpest, 1e-9)
        if below(radius, least):
            text = f"The ramp's radius is {radius:.0f} m; {ramp.design_speed:.0f} km/h need {least:.0f} m."
            yield Finding(name, road_station(road, ramp), radius, least, text)


def road_station(road: Road, ramp: ConnectingRamp) -> float:
    """Return the station (m) of the main road at which a ramp's turnout begins."""
    turnout: Any = road.parameters.objects[ramp.turnout]
    return float(turnout.start_station)


def _grade(road: Road) -> Iterator[Finding]:
    """Yield a finding for each ramp and crossing road that is too steep between two points of its profile."""
    roads = [(name, item, STEEPEST_RAMP, road_station(road, item)) for name, item in road.of(ConnectingRamp).items()]
    every = [*roads, *((name, item, STEEPEST_CROSSING, item.station) for name, item in road.of(CrossingRoad).items())]
    for name, item, limit, station in every:
        points = item.vertical
        # Its first tangent is the turnout's, in the main road's plane.
        first_tangent = 1 if isinstance(item, ConnectingRamp) else 0
        for first, second in pairwise(points[first_tangent:]):
            run = second.station - first.station
            grade = 100.0 * abs(second.elevation - first.elevation) / max(run, 1e-9)
            text = f"Its grade is {grade:.1f} %; {limit:g} % are allowed."
            yield from at_most(name, station, grade, limit, text)


def _mouth(ramp: ConnectingRamp, crossing: CrossingRoad) -> tuple[Float, float]:
    """Return the place (2,) and the height (m) at which a ramp must end: where its mouth's straight stretch begins."""
    heading = np.deg2rad(crossing.start_heading_deg)
    along = np.array([np.cos(heading), np.sin(heading)])
    sign = 1.0 if ramp.mouth_side == "left" else -1.0
    out = sign * np.array([-along[1], along[0]])
    half = crossing.lane_width + crossing.edge_strip_width
    place = np.array([crossing.start_x, crossing.start_y]) + ramp.mouth_station * along
    place = place + (half + ramp.mouth_length) * out
    fall, grade = -crossing.crossfall_percent / 100.0, ramp.mouth_grade_percent / 100.0
    blend = min(_BLEND, ramp.mouth_length - 5.0)
    edge = _height(crossing, ramp.mouth_station) + fall * half
    return place, edge + (fall + grade) * blend / 2.0 + grade * (ramp.mouth_length - blend)


def _joins(road: Road) -> Iterator[Finding]:
    """Yield a finding for each ramp whose end lies beside or above the mouth that it leads to."""
    for name, ramp in road.of(ConnectingRamp).items():
        crossing = road.parameters.objects[ramp.crossing_road]
        assert isinstance(crossing, CrossingRoad)
        place, height = _mouth(ramp, crossing)
        end = line_of(ramp).place[-1]
        gap, step = float(np.hypot(*(end - place))), abs(_height(ramp, ramp.length) - height)
        station = road_station(road, ramp)
        if gap > _JOIN:
            yield Finding(name, station, gap, _JOIN, f"The ramp ends {gap:.3f} m from its mouth.")
        if step > _JOIN:
            yield Finding(name, station, step, _JOIN, f"The ramp ends {step:.3f} m above or below its mouth.")


def _profiles(road: Road) -> Iterator[Finding]:
    """Yield a finding for each rounding of a ramp or crossing road that overlaps the next one."""
    for name, item in road.each(ConnectingRamp, CrossingRoad):
        points = item.vertical
        station = road_station(road, item) if isinstance(item, ConnectingRamp) else item.station
        s, z = np.array([p.station for p in points]), np.array([p.elevation for p in points])
        grades = np.diff(z) / np.maximum(np.diff(s), 1e-9)
        tangents = np.zeros(len(points))
        tangents[1:-1] = [p.radius * abs(c) / 2.0 for p, c in zip(points[1:-1], np.diff(grades).tolist(), strict=True)]
        for run, need in zip(np.diff(s).tolist(), (tangents[1:] + tangents[:-1]).tolist(), strict=True):
            if above(need, run):
                text = f"Two roundings of its profile need {need:.1f} m and have {run:.1f} m."
                yield Finding(name, station, need, run, text)


def _things(road: Road) -> Iterator[Finding]:
    """Yield a finding for each thing that stands on the pavement of a ramp or of a crossing road."""
    lines = [(name, item, whole_line(item)) for name, item in road.each(ConnectingRamp, CrossingRoad)]
    if not lines:
        return
    main = line_of(road.parameters.alignment)
    things = {name: item for name, item in road.each(PointObject) if not isinstance(item, Overpass)}
    for (thing_name, thing), place in zip(things.items(), places_of(main, list(things.values())), strict=True):
        for name, item, line in lines:
            distance = float(np.hypot(*(line.place - place).T).min())
            is_beside = isinstance(item, CrossingRoad) and _is_on_other_level(road, item, thing)
            if not is_beside and distance < item.half_width * (1.0 - TOLERANCE):
                text = f"{thing_name} stands {distance:.2f} m from the axis of {name}, on its pavement."
                yield Finding(thing_name, thing.station, distance, item.half_width, text)


def _rails(road: Road) -> Iterator[Finding]:
    """Yield a finding for each guardrail too near to the pavement of its road, or on another one's.

    Of its own road that is its offset; of all other ramps and crossing roads it is measured along it.
    """
    rails = road.of(RampGuardrail)
    if not rails:
        return
    others: dict[str, Any] = dict(road.each(ConnectingRamp, CrossingRoad))
    lines = {name: whole_line(item) for name, item in others.items()}
    for name, rail in rails.items():
        own, line = others[rail.road], lines[rail.road]
        station = road_station(road, own) if isinstance(own, ConnectingRamp) else own.station
        face = abs(rail.offset) - _RAIL_FACE - own.half_width
        if below(face, BARRIER_DISTANCE):
            text = (
                f"The guardrail stands {face:.2f} m from the pavement's edge of {rail.road}; {BARRIER_DISTANCE} m are "
                "needed (RPS)."
            )
            yield Finding(name, station, face, BARRIER_DISTANCE, text)
        at = np.arange(rail.start_station, rail.end_station, 1.0)
        x, y, heading = (np.interp(at, line.station, v) for v in (line.place[:, 0], line.place[:, 1], line.heading))
        places = np.stack([x - rail.offset * np.sin(heading), y + rail.offset * np.cos(heading)], axis=1)
        for other_name, other in others.items():
            if other_name != rail.road:
                away = cKDTree(lines[other_name].place).query(places)[0].min(initial=np.inf) - other.half_width
                if below(away, 0.0):
                    text = f"The guardrail reaches {-away:.2f} m over the pavement of {other_name}."
                    yield Finding(name, station, away, 0.0, text)


def _is_on_other_level(road: Road, crossing: CrossingRoad, thing: PointObject) -> bool:
    """Return whether a thing stands below the bridge that carries a crossing road, or on that which it passes below."""
    bridge = road.parameters.objects[crossing.bridge]
    if isinstance(bridge, Overpass):
        return abs(thing.offset) < max(bridge.left_abutment, -bridge.right_abutment)
    return abs(thing.offset) < max(float(item.outer[0]) for item in _edges_at(road, thing.station)) + _CAP


def _edges_at(road: Road, station: float) -> list[EdgeDistances]:
    """Return the distances of each carriageway's edges at a station, m."""
    return [edges.at(np.array([station])) for edges in road.sides.values()]


def _apart(road: Road) -> Iterator[Finding]:
    """Yield a finding for each pair of ramps whose pavements and verges overlap; their mouths may face each other."""
    lines = [(name, ramp, line_of(ramp).place[::_EVERY]) for name, ramp in road.of(ConnectingRamp).items()]
    for (name, ramp, places), (other_name, other, others) in combinations(lines, 2):
        need = sum(item.half_width + item.verge_width for item in (ramp, other))
        distance = float(np.linalg.norm(places[:, None] - others[None], axis=2).min())
        text = (
            f"Its axis comes as near as {distance:.1f} m to that of {other_name}; with verges they need {need:.1f} m."
        )
        yield from at_least(name, road_station(road, ramp), distance, need, text)


def _crossings_below(road: Road) -> Iterator[tuple[str, CrossingRoad, Bridge]]:
    """Yield id and object of each crossing road below a bridge of the road, and that bridge."""
    for name, crossing in road.of(CrossingRoad).items():
        bridge = road.parameters.objects[crossing.bridge]
        if isinstance(bridge, Bridge):
            yield name, crossing, bridge


def _clearance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossing road that the deck of the bridge above it is too near to."""
    alignment: Any = road.parameters.alignment
    for name, crossing, bridge in _crossings_below(road):
        highest = max(_height(crossing, s) for s in _below(road, crossing))
        lowest = np.inf
        for station in (crossing.station + share * crossing.half_width for share in (-1.0, 0.0, 1.0)):
            height = _height(alignment, station)
            for edges in road.sides.values():
                carriageway, at = edges.carriageway, edges.at(np.array([station]))
                inner, outer = float(edges.inner(np.array([station]))[0]), float(at.outer[0])
                axes = {"centreline": 0.0, "inner_edge": inner, "carriageway_axis": (inner + outer) / 2.0}
                points = carriageway.crossfall
                fall = np.interp(station, [p.station for p in points], [p.crossfall_percent for p in points]) / 100.0
                for distance in (inner, outer):
                    raised = float(fall) * edges.sign * (distance - axes[carriageway.rotation_axis])
                    lowest = min(lowest, height + raised - bridge.deck_depth)
        text = f"{lowest - highest:.2f} m are clear below {crossing.bridge}; {CLEARANCE:.2f} m are needed (RAA)."
        yield from at_least(name, crossing.station, lowest - highest, CLEARANCE, text)


def _below(road: Road, crossing: CrossingRoad) -> Float:
    """Return own stations (N,) of a crossing road below the main road's pavements, m."""
    outer = max(float(item.outer[0]) for item in _edges_at(road, crossing.station))
    return crossing.length / 2.0 + np.linspace(-outer, outer, 9)


def _room_below(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossing road whose pavement and verges have no room between the abutments above it."""
    for name, crossing, bridge in _crossings_below(road):
        need = crossing.half_width + crossing.verge_width
        room = min(crossing.station - bridge.start_station, bridge.end_station - crossing.station) - SEAT
        text = f"The nearer abutment of {crossing.bridge} is {room:.1f} m from its axis; it needs {need:.1f} m."
        yield from at_least(name, crossing.station, room, need, text)


RULES = (
    Rule("ramp-radius", "Smallest radius of connecting ramps", "m", "", "unconfirmed", _radius),
    Rule("ramp-grade", "Steepest ramps and crossing roads", "%", "", "unconfirmed", _grade),
    Rule("ramp-rounding", "Roundings of ramps' profiles have room", "m", "", "definition", _profiles),
    Rule("ramp-apart", "Ramps and their verges don't overlap", "m", "", "definition", _apart),
    Rule(
        "crossing-clearance",
        "Clearance below the road's bridge over a crossing road",
        "m",
        "RAA",
        "unconfirmed",
        _clearance,
    ),
    Rule("crossing-room", "Room between the abutments over a crossing road", "m", "", "definition", _room_below),
    Rule("ramp-join", "Ramps meet their mouths", "m", "", "definition", _joins),
    Rule("ramp-guardrail", "Guardrails keep clear of ramps and crossing roads", "m", "RPS", "unconfirmed", _rails),
    Rule("object-on-ramp", "Nothing stands on ramps and crossing roads", "m", "", "definition", _things),
)
