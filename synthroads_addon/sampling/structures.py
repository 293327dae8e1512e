"""Bridges and tunnels drawn along a road, where there is room for them and for the valleys and hills around."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import numpy as np

from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.objects import Side, WidthPoint, nominal_width, width_kinks
from ..road.parameters import AlignmentObject
from ..road.section import Carriageway
from ..road.section_geometry import CarriagewaySection
from ..road.structures.bridge import Bridge
from ..road.structures.relief import relief_range
from ..road.structures.tunnel import Tunnel
from ..road.structures.tunnel_bodies import MIDDLE_WALL, SPRING, WIDE_MEDIAN
from ..road.things.limits import Interval
from ..scenario.road import RoadScenario
from .placing.draw import draw, pick
from .placing.ranges import Range, Reservations, draw_start, free_ranges

_BESIDE = 10.0
"""Length between a bridge's valley and what else changes the road, m at least; chosen."""
_TAPER, _FULL = 8.0, 1.0
CAP_TAPER = _TAPER + _FULL
"""Length over which a verge comes to its caps' width, and how far before them it has it, m; chosen."""
_LONGEST_ASPHALT_JOINT = 50.0
"""Expansion length up to which joints are of asphalt, m (A: NW-B176, BASt-985)."""
_Draw = Callable[[RoadScenario, np.random.Generator], Bridge | Tunnel]
Superstructure = Literal["slab", "beams", "box"]
_SLENDERNESS: tuple[tuple[Superstructure, float, float], ...] = (
    ("slab", 25.0, 20.0),
    ("beams", 42.0, 16.0),
    ("box", math.inf, 21.0),
)
"""Kind of superstructure, longest span that it is taken for (m), and that span's ratio to its depth (C: usual
figures; no guideline's were found)."""
_LEAST_DEPTH = 0.6
_BEGIN = 1000.0
"""Station at which structures are drawn before they are moved to their place, m."""
_FANS = 90.0
"""Distance of jet fans, m; chosen."""
_DIRECTIONS = 2
_CLEAR_HEIGHT = 4.6
"""Height of a vault above the pavement's edge, m at least: 10 cm more than is asked for (B: 4.50 m, GMP). Chosen."""
_PIER_SHARE = 0.7
"""Thickness of piers as a share of the deck's depth, and at least (m): chosen."""
_THINNEST_PIER = 0.8


def sample_structures(
    scenario: RoadScenario,
    seed: int,
    axis: AlignmentObject,
    carriageways: Mapping[Side, Carriageway],
    taken: Iterable[Range],
) -> dict[str, Bridge | Tunnel]:
    """Return the bridges and tunnels of a road by id, all of instance 1; none where the scenario asks for none.

    They, their valleys and hills keep clear of the road's ends, of each other, and of places where its width changes.

    Args:
        scenario, seed: limits, and the seed of everything drawn.
        axis, carriageways: the road.
        taken: stations (m) between which there is a bay, a side road or a village.
    """
    if len(carriageways) < _DIRECTIONS:
        return {}
    free = Reservations((start - _BESIDE, end + _BESIDE) for start, end in taken)
    for carriageway in carriageways.values():
        for station in CarriagewaySection(carriageway).kinks():
            free.add(station - _BESIDE, station + _BESIDE)
    drawn: dict[str, Bridge | Tunnel] = {}
    kinds: tuple[tuple[str, Interval, _Draw], ...] = (
        ("bridge", scenario.bridges.per_km, _draw_bridge),
        ("tunnel", scenario.tunnels.per_km, _draw_tunnel),
    )
    for word, per_km, draw_one in kinds:
        if per_km.maximum <= 0.0:
            continue
        rng, number = stream(seed, f"{word}s"), 0
        for _ in range(int(draw(rng, per_km) * axis.length / 1000.0 + rng.random())):
            structure = draw_one(scenario, rng)
            if isinstance(structure, Tunnel):
                structure = _with_clear_height(structure, carriageways, scenario.tunnels.walkway_width.maximum)
            low, high = relief_range(structure)
            low, high = min(low, structure.cap_start - _TAPER - _FULL), max(high, structure.cap_end + _TAPER + _FULL)
            begin = draw_start(rng, free_ranges(0.0, axis.length, free), high - low)
            if begin is None:
                continue
            number += 1
            free.add(begin - _BESIDE, begin + high - low + _BESIDE)
            drawn[f"{word}-{number}"] = _moved(structure, begin - low)
    return drawn


def fit_verges(
    carriageway: Carriageway, structures: Iterable[Bridge | Tunnel], cap_width: float, walkway_width: float
) -> Carriageway:
    """Return a carriageway whose verge is as wide as caps or walkways (m) in structures; elsewhere as before."""
    ordered = sorted(structures, key=lambda structure: structure.start_station)
    if not ordered or width_kinks(carriageway.verge_width):
        return carriageway
    usual = nominal_width(carriageway.verge_width)
    points = []
    for structure in ordered:
        width = cap_width if isinstance(structure, Bridge) else walkway_width
        first, last = structure.cap_start - _FULL, structure.cap_end + _FULL
        for station, value in ((first - _TAPER, usual), (first, width), (last, width), (last + _TAPER, usual)):
            points.append(WidthPoint(station=round_value(station), width=value))
    return carriageway.model_copy(update={"verge_width": tuple(points)})


def superstructure_of(span: float) -> tuple[Superstructure, float]:
    """Return the cross-section of a deck of a span (m), and its depth, m."""
    kind, _, slenderness = next(row for row in _SLENDERNESS if span <= row[1])
    return kind, max(round_value(span / slenderness, 2), _LEAST_DEPTH)


def joint_of(length: float) -> tuple[Literal["asphalt", "lamella"], float]:
    """Return the kind and the width (m) of the joints of a bridge of a length, m."""
    return ("asphalt", 0.5) if length <= _LONGEST_ASPHALT_JOINT else ("lamella", 0.4)


def _draw_bridge(scenario: RoadScenario, rng: np.random.Generator) -> Bridge:
    """Return a drawn bridge that begins at a station that is far enough from 0; all its numbers are drawn."""
    limits = scenario.bridges
    length, largest_span = draw(rng, limits.length), draw(rng, limits.span)
    kerb, depth, wing = draw(rng, limits.kerb_height), draw(rng, limits.valley_depth), draw(rng, limits.wing_length)
    clearance = draw(rng, limits.clearance)
    railing = pick(rng, (1.0, 1.3)) if rng.random() < limits.high_railings else 1.0
    spans = max(1, math.ceil(length / largest_span - 1e-9))
    span = length / spans
    kind, deck_depth = superstructure_of(span)
    joint, joint_width = joint_of(length)
    return Bridge(
        instance=1,
        start_station=_BEGIN,
        end_station=_BEGIN + length,
        superstructure=kind,
        deck_depth=deck_depth,
        pier_stations=tuple(round_value(_BEGIN + number * span) for number in range(1, spans)),
        pier_width=max(round_value(_PIER_SHARE * deck_depth, 2), _THINNEST_PIER),
        kerb_height=kerb,
        railing_height=railing,
        barrier="none" if scenario.barriers.roadside else "h4b" if rng.random() < limits.h4b else "h2",
        joint=joint,
        joint_width=joint_width,
        wing_length=max(wing, round_value((deck_depth + 1.0) * scenario.batter_slope.maximum)),
        valley_depth=max(depth, round_value(deck_depth + clearance)),
    )


def _draw_tunnel(scenario: RoadScenario, rng: np.random.Generator) -> Tunnel:
    """Return a drawn tunnel that begins at a station that is far enough from 0; all its numbers are drawn."""
    limits = scenario.tunnels
    length, height, cover = draw(rng, limits.length), draw(rng, limits.height), draw(rng, limits.cover)
    is_vault, has_fans = rng.random() < limits.vaults, rng.random() < limits.fans
    return Tunnel(
        instance=1,
        start_station=_BEGIN,
        end_station=_BEGIN + length,
        section="vault" if is_vault else "rectangle",
        height=height,
        cover=cover,
        fan_spacing=_FANS if has_fans else 0.0,
    )


def _with_clear_height(tunnel: Tunnel, carriageways: Mapping[Side, Carriageway], walkway: float) -> Tunnel:
    """Return a tunnel that is high enough above the pavements' edges: a vault's crown is higher, the wider it is.

    Args:
        tunnel: as drawn.
        carriageways: the road.
        walkway: largest width of a walkway, m.
    """
    if tunnel.section == "rectangle":
        return tunnel
    edges = [
        (item.inner_offset, CarriagewaySection(item).paved_edge([0.0])[0])
        for item in carriageways.values()
        if not isinstance(item.inner_offset, tuple)
    ]
    if len(edges) < _DIRECTIONS:
        return tunnel.model_copy(update={"section": "rectangle"})
    (left_inner, left_outer), (right_inner, right_outer) = edges
    tubes = [(left_outer + right_outer, walkway, walkway)]
    if left_inner + right_inner >= WIDE_MEDIAN:
        inside = (left_inner + right_inner - MIDDLE_WALL) / 2.0
        tubes = [(outer - inner, walkway, inside) for inner, outer in edges]
    share = 0.0
    for paved, *beside in tubes:
        half = (paved + sum(beside)) / 2.0
        share = max(share, *((half - width) / half for width in beside))
    factor = SPRING + (1.0 - SPRING) * math.sqrt(1.0 - share**2)
    return tunnel.model_copy(update={"height": max(tunnel.height, round_value(_CLEAR_HEIGHT / factor, 2))})


def _moved(structure: Bridge | Tunnel, distance: float) -> Bridge | Tunnel:
    """Return a structure moved along the road by a distance, m."""
    moved: dict[str, Any] = {
        name: round_value(getattr(structure, name) + distance) for name in ("start_station", "end_station")
    }
    if isinstance(structure, Bridge):
        moved["pier_stations"] = tuple(round_value(station + distance) for station in structure.pier_stations)
    return structure.model_copy(update=moved)
