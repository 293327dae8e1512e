"""The overpass. It is planned first and built when the barriers stand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, radians, sin, tan

import numpy as np

from ...base.schema import round_value
from ...road.things.overpass import Overpass
from .draw import draw, pick
from .layout import SMALL_ZONE, Layout
from .ranges import draw_start, free_ranges

LARGEST_SKEW = 30.0
"""It crosses at most this much aslant, degrees."""
PIER_WIDTHS, LEAST_PIER_WIDTH = (0.8, 1.0, 1.2), 0.5
"""Widths of piers, and the least of one in a narrow median, m."""
DECK_THICKNESSES = (1.0, 1.2, 1.5)
ABUTMENT_DISTANCE = 1.5
"""From the verge's outer edge, and from piers beside the carriageways, to an abutment, m at least."""
ABUTMENT_SPANS = (0.0, 2.0, 4.0, 8.0)
"""Distance by which the abutments stand farther out than they must, m."""
FARTHEST_ABUTMENT = 16.0
"""From the main road's paved edge to the farthest abutment of a bridge at right angles, m."""
_SMALL_THINGS = 2.0  # m across the road, for what stands before an abutment


@dataclass(frozen=True)
class OverpassPlan:
    """An overpass whose place along the road is reserved.

    Attributes:
        station: m.
        half: what it takes to either side along the road, m.
        width: of its deck along the road, m.
        skew: rotation, degrees.
        pier: width of its piers, m.
        in_median, beside: where piers stand.
    """

    station: float
    half: float
    width: float
    skew: float
    pier: float
    in_median: bool
    beside: bool

    @property
    def corner(self) -> float:
        """Return how much nearer to the road than its middle a corner of an abutment square to the deck stands, m."""
        return self.width / 2.0 * abs(sin(radians(self.skew)))


def plan_overpass(layout: Layout, rng: np.random.Generator) -> OverpassPlan | None:
    """Return the overpass, if the road gets one and has room, its stretch reserved and barriers asked for."""
    limits = layout.site.scenario.furniture
    if rng.random() >= limits.overpass:
        return None
    width, skew = draw(rng, limits.overpass_width), round_value(LARGEST_SKEW * (2.0 * rng.random() - 1.0))
    room = 2.0 * layout.median.obstacle_half
    in_median = bool(rng.random() < 0.67) and room >= LEAST_PIER_WIDTH
    beside = bool(rng.random() < 0.5) and in_median
    pier = min(pick(rng, PIER_WIDTHS), room) if in_median else pick(rng, PIER_WIDTHS)
    plan = OverpassPlan(0.0, 0.0, width, skew, pier, in_median, beside)
    outermost = max(side.edge.largest_main(0.0, layout.length) for side in layout.sides.values())
    reach = outermost + FARTHEST_ABUTMENT + plan.corner
    half = width / 2.0 / cos(radians(skew)) + reach * abs(tan(radians(skew)))
    taken = [layout.median.taken] if in_median else []
    for roadside in layout.sides.values():
        taken += [roadside.far, roadside.restless, *([roadside.near] if beside else [])]
    start = draw_start(rng, free_ranges(0.0, layout.length, *taken), 2.0 * half)
    if start is None:
        return None
    zones = ("far", "crossed", "near") if beside else ("far", "crossed")
    layout.reserve(start, start + 2.0 * half, layout.sides, zones, in_median)
    return replace(plan, station=start + half, half=half)


def overpass(layout: Layout, plan: OverpassPlan, rng: np.random.Generator) -> Overpass:
    """Return a planned overpass: its piers behind the barriers, its abutments behind verge and piers."""
    offsets, abutments = [0.0] if plan.in_median else [], {"left": 5.0, "right": -5.0}
    span = pick(rng, ABUTMENT_SPANS)
    low, high = plan.station - plan.half, plan.station + plan.half
    for side, roadside in layout.sides.items():
        front = roadside.front_of_obstacle(low, high, 0.0)
        road_edge = float(layout.site.sections[side].road_edge(np.linspace(low, high, 9)).max())
        nearest = max(road_edge + ABUTMENT_DISTANCE, front + SMALL_ZONE + _SMALL_THINGS)
        if plan.beside:
            axis = front + SMALL_ZONE + plan.pier / 2.0
            offsets.append(round_value(roadside.sign * axis))
            nearest = max(nearest, axis + plan.pier / 2.0 + ABUTMENT_DISTANCE)
        abutments[side] = round_value(roadside.sign * (nearest + plan.corner + span))
    limits = layout.site.scenario.furniture
    return Overpass(
        instance=1,
        station=round_value(plan.station),
        offset=0.0,
        rotation_deg=plan.skew,
        width=plan.width,
        left_abutment=abutments["left"],
        right_abutment=abutments["right"],
        clearance=draw(rng, limits.overpass_clearance),
        deck_thickness=pick(rng, DECK_THICKNESSES),
        pier_offsets=tuple(sorted(offsets)),
        pier_width=round_value(plan.pier),
    )
