"""The crossing road of an interchange: the bridge that carries it, or that it passes below, and its profile."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.geometry import RoadGeometry
from ...road.ground.main_surface import highest_pavement
from ...road.network.network import bridge_span
from ...road.other_roads.axis import HorizontalElement, VerticalPoint
from ...road.other_roads.parts import CrossingRoad
from ...road.structures.bridge import Bridge
from ...road.structures.bridge_bodies import SEAT
from ...road.things.overpass import EDGE, Overpass
from ...scenario.road import RoadScenario
from ..placing.draw import draw, pick
from ..structures import joint_of, superstructure_of

BRIDGE_ID, CROSSING_ID = "interchange-bridge", "crossing-road"
"""Ids of the bridge and the crossing road of an interchange."""
CROSSING_LANE, CROSSING_EDGE_STRIP = 3.5, 0.5
"""Lane and edge strip of the crossing road, m: those of RQ 11."""
_HALF = CROSSING_LANE + CROSSING_EDGE_STRIP
ABOVE_DECK = 0.01
"""By how much the crossing road's edges lie above the deck, m; chosen."""
PIER_WIDTH = 1.0
"""Width of the bridge's piers, m; less in a narrow median."""
DECK = 1.2
"""Height of the bridge's deck, m."""
_BESIDE_ROAD = 3.5
"""Distance of the abutments of a bridge over the motorway from its verges, m; chosen."""
_OPEN = 0.6
"""Height of the slope below a bridge's deck at its abutments, m; chosen."""
_LEVEL = 1.0
"""Length of the crossing road's level stretch beyond a bridge or a road above it, m; chosen."""


@dataclass(frozen=True)
class CrossingValues:
    """Values drawn for a crossing road: clearance, m, grade, m/m, and radius of its crests or sags, m."""

    clearance: float
    grade: float
    radius: float


def straight_across(geometry: RoadGeometry, station: float) -> CrossingRoad:
    """Return a road across the main one at a station, to the terrain's edges, level at height 0."""
    terrain = geometry.terrain
    assert terrain is not None
    at = np.array([station])
    heading = float(geometry.alignment.heading(at)[0])
    left = np.array([-np.sin(heading), np.cos(heading)])
    start = geometry.alignment.position(at)[0] - terrain.half_width * left
    return CrossingRoad(
        instance=1,
        station=station,
        bridge=BRIDGE_ID,
        start_x=float(start[0]),
        start_y=float(start[1]),
        start_heading_deg=float(np.rad2deg(heading)) + 90.0,
        horizontal=(HorizontalElement.between(2.0 * terrain.half_width, 0.0, 0.0),),
        vertical=(VerticalPoint(station=terrain.half_width, elevation=0.0),),
        lane_width=CROSSING_LANE,
        edge_strip_width=CROSSING_EDGE_STRIP,
    )


def deck_width() -> float:
    """Return the width of the deck of a bridge that carries a crossing road, m."""
    return 2.0 * _HALF / (1.0 - 2.0 * EDGE)


def road_above(geometry: RoadGeometry, station: float, values: CrossingValues) -> tuple[Overpass, CrossingRoad]:
    """Return the bridge over a main road at a station (m), and the crossing road on it."""
    width = deck_width()
    along = np.linspace(station - width / 2.0, station + width / 2.0, 9)
    edges = {side: float(section.road_edge(along).max()) for side, section in geometry.sections.items()}
    paved = {side: float(section.paved_edge(along).max()) for side, section in geometry.sections.items()}
    inner = {side: float(section.distances(along)[:, 0].min()) for side, section in geometry.sections.items()}
    pier = min(PIER_WIDTH, 2.0 * (min(inner.values()) - 0.7))
    stations, offsets = _grid(along, np.linspace(-paved["right"], paved["left"], 81))
    highest = highest_pavement(geometry, stations, offsets)
    assert highest is not None
    bridge = Overpass(
        instance=1,
        station=station,
        offset=0.0,
        width=round_value(width),
        left_abutment=round_value(edges["left"] + _BESIDE_ROAD),
        right_abutment=round_value(-edges["right"] - _BESIDE_ROAD),
        clearance=values.clearance,
        deck_thickness=DECK,
        pier_offsets=(0.0,) if pier >= 0.5 else (),
        pier_width=round_value(pier) if pier >= 0.5 else PIER_WIDTH,
    )
    level = highest + values.clearance + DECK + ABOVE_DECK + _HALF * 0.025
    draft = straight_across(geometry, station)
    level_draft = draft.model_copy(update={"vertical": (draft.vertical[0].model_copy(update={"elevation": level}),)})
    span = bridge_span(geometry, level_draft, bridge)
    assert span is not None
    return bridge, _with_profile(draft, values, span, level, -1.0)


def bridge_above(
    scenario: RoadScenario, rng: np.random.Generator, station: float, slope: float, clearance: float
) -> Bridge:
    """Return the bridge of a main road over a crossing road at a station (m): one span between slopes.

    Args:
        scenario: limits of bridges.
        rng: of its kerbs, wing walls, railings and barriers.
        station: of the crossing road's axis, m.
        slope: run of the ground's batters per metre of height.
        clearance: height below its deck, m.
    """
    limits = scenario.bridges
    road = CrossingRoad.model_fields
    half = _HALF + float(road["verge_width"].default) + SEAT + slope * (clearance - _OPEN)
    start, end = round_value(station - half, 3), round_value(station + half, 3)
    kind, depth = superstructure_of(end - start)
    joint, joint_width = joint_of(end - start)
    kerb, wing = draw(rng, limits.kerb_height), draw(rng, limits.wing_length)
    railing = pick(rng, (1.0, 1.3)) if rng.random() < limits.high_railings else 1.0
    is_h4b = rng.random() < limits.h4b
    return Bridge(
        instance=1,
        start_station=start,
        end_station=end,
        superstructure=kind,
        deck_depth=depth,
        kerb_height=kerb,
        railing_height=railing,
        barrier="none" if scenario.barriers.roadside else "h4b" if is_h4b else "h2",
        joint=joint,
        joint_width=joint_width,
        wing_length=max(wing, round_value((depth + 1.0) * slope)),
        valley_depth=round_value(depth + clearance),
    )


def road_below(geometry: RoadGeometry, station: float, bridge: Bridge, values: CrossingValues) -> CrossingRoad:
    """Return the crossing road below a bridge of the main road at a station (m)."""
    along = np.linspace(station - _HALF, station + _HALF, 9)
    edges = geometry.offsets(along)[:, [-1, 0]]
    right, left = float(edges[:, 0].min()), float(edges[:, 1].max())
    stations, offsets = _grid(along, np.linspace(right, left, 81))
    lowest = float(geometry.uncapped_elevation(stations, offsets).min()) - bridge.deck_depth
    draft = straight_across(geometry, station)
    middle = draft.length / 2.0
    # Its own stations run from the main road's right to its left.
    return _with_profile(draft, values, (middle + right, middle + left), lowest - values.clearance, 1.0)


def _grid(along: Float, across: Float) -> tuple[Float, Float]:
    """Return stations and offsets (N * M,) of all pairs of stations (N,) and offsets (M,)."""
    stations, offsets = np.meshgrid(along, across, indexing="ij")
    return stations.ravel(), offsets.ravel()


def _with_profile(
    road: CrossingRoad, values: CrossingValues, span: tuple[float, float], level: float, rise: float
) -> CrossingRoad:
    """Return a crossing road level between own stations (m); beside them it rises (1) or falls (-1)."""
    tangent = values.radius * values.grade / 2.0
    low, high = span[0] - tangent - _LEVEL, span[1] + tangent + _LEVEL
    change = math.copysign(values.grade, rise)
    points = [
        VerticalPoint(station=0.0, elevation=level + change * low),
        VerticalPoint(station=low, elevation=level, radius=values.radius),
        VerticalPoint(station=high, elevation=level, radius=values.radius),
        VerticalPoint(station=road.length, elevation=level + change * (road.length - high)),
    ]
    return road.model_copy(update={"vertical": tuple(points)})
