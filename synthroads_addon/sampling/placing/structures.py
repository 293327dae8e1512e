"""Shield gantries and the overpass. They are planned first and built when the barriers stand."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import cos, radians, sin, tan
from typing import Literal

import numpy as np

from ...base.schema import round_value
from ...road.objects import Side
from ...road.things.gantry import Gantry, GantrySign
from ...road.things.overpass import Overpass
from ...road.things.sign_catalogue import sign_catalogue
from .draw import draw, pick
from .layout import SMALL_ZONE, Layout, Roadside
from .ranges import Reservations, draw_start, free_ranges
from .signs import motorway_number

Kind = Literal["one_sided", "two_sided", "cantilever"]
BEAMS: tuple[tuple[Literal["box", "truss", "tube"], float, float], ...] = (
    ("box", 0.8, 0.6),
    ("box", 1.1, 0.8),
    ("truss", 1.4, 1.0),
    ("tube", 0.6, 0.6),
)
"""Shapes of beams with their height and depth, m."""
SHADES = (0.15, 0.3, 0.45, 0.6, 0.75)
"""Base colours of the steel, from dark paint to bright zinc."""
POST_WIDTHS, LEAST_POST_WIDTH = (0.4, 0.5, 0.6), 0.3
"""Widths of posts, and the least of one in a narrow median, m."""
DISPLAY_SIZE, DISPLAY_TEXTS = 1.35, ("60", "80", "100", "120", "")
"""Side of a variable display (m), and what it may show."""
DESTINATION_HEIGHTS = (2.0, 2.5, 3.0)
"""Heights of destination signs, m."""
LANES_OF_CANTILEVER = 2
"""A cantilever reaches over so many lanes."""
_HALF = 0.75  # m that a gantry takes to either side along the road
_BESIDE_SIGN = 0.15  # m between a sign and its lane's boundaries
_NARROWEST_LANE = 2.0  # m; what is narrower is a lane that begins or ends
LARGEST_SKEW = 30.0
"""An overpass crosses at most this much aslant, degrees."""
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
class GantryPlan:
    """A gantry whose place along the road is reserved.

    Attributes:
        kind: as in `Gantry`.
        station: m.
        sides: carriageways that it spans.
    """

    kind: Kind
    station: float
    sides: tuple[Side, ...]


def plan_gantries(layout: Layout, rng: np.random.Generator) -> list[GantryPlan]:
    """Return drawn gantries, their places reserved: all along at a given spacing, else one or none."""
    limits = layout.site.scenario.furniture
    spacing = limits.gantry_spacing
    if spacing is not None:
        stations = spacing * (0.5 + np.arange(int(layout.length / spacing + 0.5)))
        half_length = min(_HALF, spacing / 2.0)
        plans = (_gantry_at(layout, rng, station, half_length) for station in stations.tolist())
        return [plan for plan in plans if plan]
    if rng.random() >= limits.gantries:
        return []
    kind, sides = _kind(layout, rng)
    start = draw_start(rng, free_ranges(0.0, layout.length, *_obstructions(layout, kind, sides)), 2.0 * _HALF)
    return [] if start is None else [_reserve_place(layout, GantryPlan(kind, start + _HALF, sides), _HALF)]


def gantries(layout: Layout, plans: list[GantryPlan], rng: np.random.Generator) -> Iterator[tuple[str, Gantry]]:
    """Yield (id, gantry) of planned gantries, with their signs and instance 1.

    The order of the draws (beam, post, displays, clearance, shade, signs) decides which gantry a seed gives. A post
    that isn't a cantilever's may stand in the median and is no wider than that allows.

    Args:
        layout: the road, its barriers built: posts stand behind them.
        plans: the gantries' places.
        rng: of the structures.
    """
    limits = layout.site.scenario.furniture
    for number, plan in enumerate(plans, start=1):
        beam, height, depth = pick(rng, BEAMS)
        post_width = pick(rng, POST_WIDTHS)
        if plan.kind != "cantilever":
            post_width = min(post_width, layout.median.obstacle_half)
        reaches = {side: _beam_reach(layout, plan, layout.sides[side], post_width) for side in plan.sides}
        end_offsets = [layout.sides[side].sign * distance for side in plan.sides for distance in reaches[side]]
        has_displays = bool(rng.random() < 0.5)
        left_end, right_end = round_value(max(end_offsets)), round_value(min(end_offsets))
        gantry = Gantry(
            instance=1,
            station=round_value(plan.station),
            offset=round_value((left_end + right_end) / 2.0),
            kind=plan.kind,
            left_offset=left_end,
            right_offset=right_end,
            post_side=plan.sides[0],
            clearance=draw(rng, limits.gantry_clearance),
            beam=beam,
            beam_height=height,
            beam_depth=round_value(min(depth, 0.6 * (limits.gantry_spacing or 10.0))),
            post_width=round_value(post_width),
            shade=pick(rng, SHADES),
            signs=tuple(s for side in plan.sides for s in _signs(layout, plan, side, reaches[side], has_displays, rng)),
        )
        yield f"gantry-{number}", gantry


def _kind(layout: Layout, rng: np.random.Generator) -> tuple[Kind, tuple[Side, ...]]:
    """Return a drawn kind of gantry that the road has room for, and the carriageways that it spans."""
    sides: tuple[Side, ...] = tuple(layout.sides)
    kinds: tuple[Kind, ...] = ("cantilever", "one_sided", "two_sided")
    if layout.median.obstacle_half < LEAST_POST_WIDTH:
        kinds = ("cantilever",)
    kind, side = pick(rng, kinds), pick(rng, sides)
    return kind, sides if kind == "two_sided" else (side,)


def _obstructions(layout: Layout, kind: Kind, sides: tuple[Side, ...]) -> list[Reservations]:
    """Return the reservations that a gantry has to keep clear of."""
    obstacles = [] if kind == "cantilever" else [layout.median.taken]
    for roadside in (layout.sides[side] for side in sides):
        obstacles += [roadside.near, roadside.crossed, roadside.restless]
    return obstacles


def _gantry_at(layout: Layout, rng: np.random.Generator, station: float, half_length: float) -> GantryPlan | None:
    """Return the gantry at a station (m), its place reserved, or None where something is in the way."""
    kind, sides = _kind(layout, rng)
    if all(item.is_free(station - half_length, station + half_length) for item in _obstructions(layout, kind, sides)):
        return _reserve_place(layout, GantryPlan(kind, station, sides), half_length)
    return None


def _reserve_place(layout: Layout, plan: GantryPlan, half_length: float) -> GantryPlan:
    """Reserve a gantry's stretch of the road, ask for barriers before its posts, and return its plan."""
    layout.reserve(
        plan.station - half_length, plan.station + half_length, plan.sides, ("near",), plan.kind != "cantilever"
    )
    return plan


def _beam_reach(layout: Layout, plan: GantryPlan, roadside: Roadside, post_width: float) -> tuple[float, float]:
    """Return the distances (m) from the centreline between which the beam hangs over a carriageway."""
    front = roadside.front_of_obstacle(plan.station - _HALF, plan.station + _HALF, SMALL_ZONE + post_width)
    outer_distance = front + SMALL_ZONE + post_width
    if plan.kind != "cantilever":
        return 0.0, outer_distance
    lanes = _lanes(layout, plan, roadside.side)[:LANES_OF_CANTILEVER]
    return lanes[-1][0], outer_distance


def _lanes(layout: Layout, plan: GantryPlan, side: Side) -> list[tuple[float, float]]:
    """Return the inner and outer distances (m) of a carriageway's lanes, outermost first, without very narrow ones."""
    boundaries = layout.site.sections[side].lane_boundaries(plan.station)[0].tolist()
    lanes = list(zip(boundaries[1:], boundaries[:-1], strict=True))
    return [lane for lane in lanes if lane[1] - lane[0] >= _NARROWEST_LANE] or lanes


def _signs(
    layout: Layout,
    plan: GantryPlan,
    side: Side,
    reach: tuple[float, float],
    has_displays: bool,
    rng: np.random.Generator,
) -> Iterator[GantrySign]:
    """Yield a drawn display or destination sign over each lane below the beam."""
    names = sign_catalogue().destinations
    for inner, outer in _lanes(layout, plan, side):
        if inner < reach[0]:
            continue
        width = min(DISPLAY_SIZE, outer - inner) if has_displays else outer - inner - 2.0 * _BESIDE_SIGN
        yield GantrySign(
            offset=round_value(layout.sides[side].sign * (inner + outer) / 2.0),
            width=round_value(width),
            height=DISPLAY_SIZE if has_displays else pick(rng, DESTINATION_HEIGHTS),
            kind="display" if has_displays else "destination",
            text=(pick(rng, DISPLAY_TEXTS),)
            if has_displays
            else (motorway_number(layout.site), pick(rng, names), pick(rng, names)),
            traffic_side=layout.site.carriageways[side].traffic_side,
        )


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
        """Return how much nearer to the road than its middle an abutment's corner, square to the deck, stands, m."""
        return self.width / 2.0 * abs(sin(radians(self.skew)))


def plan_overpass(layout: Layout, rng: np.random.Generator) -> OverpassPlan | None:
    """Return a drawn overpass, its stretch reserved and barriers asked for; None where there is none, or no room."""
    limits = layout.site.scenario.furniture
    if layout.site.interchange is not None:
        above = layout.site.interchange.overpass
        return None if above is None else _plan_crossing(layout, above)
    if rng.random() >= limits.overpass:
        return None
    width, skew = draw(rng, limits.overpass_width), round_value(LARGEST_SKEW * (2.0 * rng.random() - 1.0))
    room = 2.0 * layout.median.obstacle_half
    in_median = bool(rng.random() < 0.67) and room >= LEAST_PIER_WIDTH
    has_outer_piers = bool(rng.random() < 0.5) and in_median
    pier_width = min(pick(rng, PIER_WIDTHS), room) if in_median else pick(rng, PIER_WIDTHS)
    plan = OverpassPlan(0.0, 0.0, width, skew, pier_width, in_median, has_outer_piers)
    outermost_edge = max(side.edge.largest_main(0.0, layout.length) for side in layout.sides.values())
    reach = outermost_edge + FARTHEST_ABUTMENT + plan.corner
    half_length = width / 2.0 / cos(radians(skew)) + reach * abs(tan(radians(skew)))
    reservations = [layout.median.taken] if in_median else []
    for roadside in layout.sides.values():
        reservations += [roadside.far, roadside.restless, *([roadside.near] if has_outer_piers else [])]
    start = draw_start(rng, free_ranges(0.0, layout.length, *reservations), 2.0 * half_length)
    if start is None:
        return None
    zones = ("far", "crossed", "near") if has_outer_piers else ("far", "crossed")
    layout.reserve(start, start + 2.0 * half_length, layout.sides, zones, in_median)
    return replace(plan, station=start + half_length, half=half_length)


def _plan_crossing(layout: Layout, bridge: Overpass) -> OverpassPlan:
    """Return the plan of an interchange's bridge: its stretch reserved and barriers asked for before its pier."""
    in_median, half = bool(bridge.pier_offsets), bridge.width / 2.0
    start, end = bridge.station - half, bridge.station + half
    layout.reserve(start, end, layout.sides, ("far", "crossed"), in_median)
    return OverpassPlan(bridge.station, half, bridge.width, 0.0, bridge.pier_width, in_median, False)


def overpass(layout: Layout, plan: OverpassPlan, rng: np.random.Generator) -> Overpass:
    """Return a planned overpass as an object: piers behind the barriers, abutments behind verge and piers."""
    offsets, abutments = [0.0] if plan.in_median else [], {"left": 5.0, "right": -5.0}
    span = pick(rng, ABUTMENT_SPANS)
    start, end = plan.station - plan.half, plan.station + plan.half
    for side, roadside in layout.sides.items():
        front = roadside.front_of_obstacle(start, end, 0.0)
        road_edge = float(layout.site.sections[side].road_edge(np.linspace(start, end, 9)).max())
        abutment_distance = max(road_edge + ABUTMENT_DISTANCE, front + SMALL_ZONE + _SMALL_THINGS)
        if plan.beside:
            axis = front + SMALL_ZONE + plan.pier / 2.0
            offsets.append(round_value(roadside.sign * axis))
            abutment_distance = max(abutment_distance, axis + plan.pier / 2.0 + ABUTMENT_DISTANCE)
        abutments[side] = round_value(roadside.sign * (abutment_distance + plan.corner + span))
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
