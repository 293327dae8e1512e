"""Furniture at random: the kinds that the rules place, at random stations and distances, and where they ask for none.

Nothing stands on the pavement or in another thing's place: barriers and delineators share one zone, small things the
next, as by the rules.
"""

from collections.abc import Iterator

import numpy as np

from ...base.schema import round_value
from ...road.guidelines import is_single
from ...road.objects import LineObject
from ...road.things.delineator import Delineator
from ...road.things.sign_catalogue import sign_catalogue, signs_of_country
from ...road.things.traffic_light import TrafficLight
from .barriers import TERMINAL, BarrierSystem
from .draw import pick
from .equipment import LARGEST_KILOMETRE, LIGHT_WIDTH, put_kilometre_board, put_phone
from .layout import BARRIER_AXIS, BarrierPiece, Layout, PlacementRequest, Roadside
from .ranges import Reservations, draw_start, draw_stretch, free_ranges
from .signs import destination_values, place_sign

SIGNS_PER_KM, BOARDS_PER_KM, PHONES_PER_KM, DELINEATORS_PER_KM, BARRIERS_PER_KM = 5.0, 2.0, 0.5, 20.0, 2.0
"""How many there are of each beside a carriageway on average, about as many as by the rules."""
BARRIER_LENGTHS = (8.0, 200.0)
"""Shortest and longest barrier, m."""
SHIFTS, BARRIER_SHIFTS = (0.0, 0.1, 0.2, 0.3, 0.4), (0.0, 0.05, 0.1, 0.15)
"""Distances by which small things, and barriers, stand farther out than they must, within their zones, m."""
DELINEATOR_DISTANCES = (0.2, 0.35, 0.5, 0.7, 0.9, 1.1)
"""From the paved edge to delineators, m."""
_HALF = 0.5  # m that a small thing takes to either side along the road
_DELINEATOR_HALF = 0.5  # m


def plan_random_signs(layout: Layout, rng: np.random.Generator) -> None:
    """Place signs of any kind at random stations and distances."""
    is_rural = is_single(layout.site.design_class)
    signs = sign_catalogue().signs
    codes = [c for c in signs_of_country(layout.site.guideline.country, rural=is_rural) if signs[c].anywhere]
    for roadside in layout.sides.values():
        for _ in range(_count(SIGNS_PER_KM, layout, rng) if codes else 0):
            station = layout.length * rng.random()
            place_sign(
                roadside,
                pick(rng, codes),
                station,
                layout.length,
                destination_values(rng, layout.site),
                pick(rng, SHIFTS),
            )


def plan_random_equipment(layout: Layout, rng: np.random.Generator) -> None:
    """Place kilometre boards of any kilometre, emergency phones and traffic lights at random stations."""
    furniture = layout.site.scenario.furniture
    for roadside in layout.sides.values():
        for station in _stations(roadside, BOARDS_PER_KM if furniture.kilometre_boards else 0.0, layout, rng):
            put_kilometre_board(roadside, station, int(rng.random() * 2 * LARGEST_KILOMETRE))
        for station in _stations(roadside, PHONES_PER_KM if furniture.emergency_phones else 0.0, layout, rng):
            put_phone(roadside, station)
        if rng.random() < furniture.traffic_lights:
            for station in _stations(roadside, PHONES_PER_KM, layout, rng):
                shift = pick(rng, SHIFTS)
                roadside.put(PlacementRequest("traffic-light", TrafficLight, station, _HALF, LIGHT_WIDTH, shift=shift))


def random_median_barrier(layout: Layout, rng: np.random.Generator) -> Iterator[tuple[str, LineObject]]:
    """Yield (id, barrier) of at most one guardrail somewhere in the median, where that is wide enough."""
    limits, median = layout.site.scenario.barriers, layout.median
    # The order of the draws decides which barrier a seed gives: system, stretch, offset.
    system = BarrierSystem.draw(rng, limits, limits.concrete_median)
    stretch = draw_stretch(rng, free_ranges(0.0, layout.length, median.taken), *BARRIER_LENGTHS)
    largest_offset = median.half_width - BARRIER_AXIS
    if limits.median and len(median.inner) > 1 and largest_offset >= 0.0 and stretch:
        start, end = stretch
        offset = largest_offset * pick(rng, (-1.0, -0.5, 0.0, 0.5, 1.0))
        # Half of a short rail at least stands at its full height.
        terminal = min(TERMINAL, (end - start) / 4.0)
        yield "guardrail-median", system.rail(stretch, offset, "both", terminal)


def random_front(
    layout: Layout, roadside: Roadside, rng: np.random.Generator
) -> Iterator[tuple[str, LineObject | Delineator]]:
    """Yield (id, object) of one side's barriers and delineators at random stations and distances."""
    limits, reservations = layout.site.scenario.barriers, Reservations()
    system = BarrierSystem.draw(rng, limits, limits.concrete_roadside)
    for _ in range(_count(BARRIERS_PER_KM, layout, rng) if limits.roadside else 0):
        segment = pick(rng, roadside.edge.segments)
        span = draw_stretch(rng, free_ranges(segment.start, segment.end, reservations), *BARRIER_LENGTHS)
        if span:
            reservations.add(*span)
            roadside.pieces.append(BarrierPiece(*span, segment.base, segment.ramp))
    for number, piece in enumerate(roadside.pieces, start=1):
        shifted_piece = piece._replace(base=piece.base + pick(rng, BARRIER_SHIFTS))
        yield f"{system.name}-{roadside.side}-{number}", system.beside(roadside, shifted_piece, TERMINAL)
    if layout.site.scenario.furniture.delineators:
        yield from _delineators(layout, roadside, reservations, rng)


def _delineators(
    layout: Layout, roadside: Roadside, reservations: Reservations, rng: np.random.Generator
) -> Iterator[tuple[str, Delineator]]:
    """Yield delineators with their names at random free stations of a roadside."""
    for number in range(1, _count(DELINEATORS_PER_KM, layout, rng) + 1):
        start = draw_start(rng, free_ranges(0.0, layout.length, reservations), 2.0 * _DELINEATOR_HALF)
        if start is None:
            return
        reservations.add(start, start + 2.0 * _DELINEATOR_HALF)
        station = start + _DELINEATOR_HALF
        edge = roadside.edge.line_beside(np.array([station]), _DELINEATOR_HALF)[0]
        offset = round_value(roadside.sign * (edge + pick(rng, DELINEATOR_DISTANCES)))
        post = Delineator(instance=1, station=round_value(station), offset=offset, rotation_deg=roadside.facing)
        yield f"delineator-{roadside.side}-{number:04d}", post


def _stations(roadside: Roadside, per_km: float, layout: Layout, rng: np.random.Generator) -> Iterator[float]:
    """Yield random stations (m) at which a small thing has room; each must be taken before the next is asked for."""
    for _ in range(_count(per_km, layout, rng)):
        start = draw_start(rng, free_ranges(0.0, layout.length, roadside.near), 2.0 * _HALF)
        if start is not None:
            yield start + _HALF


def _count(per_km: float, layout: Layout, rng: np.random.Generator) -> int:
    """Return a whole number of things along the road whose mean is the number per km times the length."""
    return int(per_km * layout.length / 1000.0 + rng.random())
