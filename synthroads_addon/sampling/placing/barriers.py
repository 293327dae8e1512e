"""Barriers: in the median, beside the road by the safety rules (RPS) and elsewhere, and noise barriers."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from ...base.schema import round_value
from ...road.guidelines import BARRIER_DISTANCE, EMBANKMENT_HEIGHT, EMBANKMENT_RUN, OBSTACLE_LEAD, SHORTEST_BARRIER
from ...road.objects import LineObject, Side
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.guardrail import Guardrail
from ...road.things.noise_barrier import NoiseBarrier
from ...scenario.road import BarrierLimits
from .draw import draw, pick
from .edge import STEP_OF_BARRIERS, Segment
from .layout import BARRIER_AXIS, FAR_ZONE, BarrierPiece, Layout, Roadside
from .ranges import Range, Reservations, draw_start, draw_stretch, free_ranges, lengthen_range, merge_ranges

POST_SPACINGS = (4.0, 2.0, 1.33)
"""Distances between posts of the guardrail systems, m."""
TERMINAL, SHORT_TERMINAL = 12.0, 4.0
"""Lengths over which guardrails are ramped down: at their free ends, and where another line of barriers goes on, m."""
Profile = tuple[Literal["new_jersey", "step"], float, float]
CONCRETE_PROFILES: tuple[Profile, ...] = (("step", 0.9, 0.54), ("new_jersey", 0.8, 0.56))
"""Profile, height and width of the foot of concrete barriers, m."""
PANELS: tuple[tuple[Literal["aluminium", "concrete", "wood", "glass"], float], ...] = (
    ("aluminium", 0.12),
    ("concrete", 0.2),
    ("wood", 0.14),
    ("glass", 0.06),
)
"""Kinds of noise barriers' panels and their thickness, m."""
NOISE_POST_WIDTH = 0.16
_BEAM_REACH = 0.2  # m, from the posts' axis to the face of a beam
_NARROWEST_FOOT = 0.3  # m, of a concrete barrier
JOIN = 2.0 * TERMINAL
"""Barriers nearer than this along the road become one, m."""
_FROM_BORDER = OBSTACLE_LEAD + 5.0  # m
_SLOT = 1500.0  # m: at random, a barrier more or none in each


@dataclass(frozen=True)
class BarrierSystem:
    """Make of one side's barriers: concrete of one profile, or steel guardrails of one system.

    Attributes:
        concrete: profile, height and width of its foot (m); None for guardrails.
        height, post_spacing: of guardrails, m.
    """

    concrete: Profile | None
    height: float
    post_spacing: float

    @classmethod
    def draw(cls, rng: np.random.Generator, limits: BarrierLimits, concrete_share: float) -> Self:
        """Return a drawn system for a side or the median, of concrete with the probability ``concrete_share``."""
        profile = pick(rng, CONCRETE_PROFILES)
        concrete = profile if rng.random() < concrete_share else None
        return cls(concrete, draw(rng, limits.guardrail_height), pick(rng, POST_SPACINGS))

    @property
    def name(self) -> str:
        """Return the first part of its barriers' ids: "concrete-barrier" or "guardrail"."""
        return "concrete-barrier" if self.concrete else "guardrail"

    def beside(self, roadside: Roadside, piece: BarrierPiece, terminal: float) -> LineObject:
        """Return the barrier of a piece on the road's side; its nearest part stands 0.5 m from the piece's base."""
        terminal = min(terminal, (piece.end - piece.start) / 4.0)
        if self.concrete:
            axis = piece.base + BARRIER_DISTANCE + self.concrete[2] / 2.0
            return _concrete(self.concrete, piece[:2], roadside.sign * axis, terminal)
        return self.rail(piece[:2], roadside.sign * (piece.base + BARRIER_AXIS), roadside.towards_road, terminal)

    def rail(self, span: Range, offset: float, faces: Side | Literal["both"], terminal: float = 0.0) -> Guardrail:
        """Return a guardrail between two stations, its posts' axis at an offset, its ends ramped; all m."""
        return Guardrail(
            instance=1,
            start_station=round_value(span[0]),
            end_station=round_value(span[1]),
            offset=round_value(offset),
            faces=faces,
            height=self.height,
            post_spacing=self.post_spacing,
            terminal_length=round_value(terminal),
        )


def median_barriers(layout: Layout, rng: np.random.Generator) -> Iterator[tuple[str, LineObject]]:
    """Yield (id, barrier) of the median, all along the road; none where 0.5 m from the pavement can't be kept."""
    limits, median = layout.site.scenario.barriers, layout.median
    system = BarrierSystem.draw(rng, limits, limits.concrete_median)
    if not limits.median or len(median.inner) < 2:
        return
    spans = free_ranges(0.0, round_value(layout.length), Reservations(layout.site.tunnelled))
    for number, span in enumerate(spans, start=1):
        for name, barrier in _median_barriers_between(layout, system, span):
            yield name if len(spans) == 1 else f"{name}-{number}", barrier


def _median_barriers_between(layout: Layout, system: BarrierSystem, span: Range) -> Iterator[tuple[str, LineObject]]:
    """Yield (id, barrier) of the median between two stations (m)."""
    median = layout.median
    if median.has_obstacles:
        for side, inner_edge in median.inner.items():
            sign = layout.sides[side].sign
            yield f"guardrail-median-{side}", system.rail(span, sign * (inner_edge - BARRIER_AXIS), side)
        return
    profile, height, foot_width = system.concrete or CONCRETE_PROFILES[0]
    foot_width = min(foot_width, 2.0 * (median.half_width - BARRIER_DISTANCE))
    steel_fits = median.half_width >= _BEAM_REACH + BARRIER_DISTANCE
    if foot_width >= _NARROWEST_FOOT and (system.concrete or not steel_fits):
        yield "concrete-barrier-median", _concrete((profile, height, foot_width), span, 0.0, 0.0)
    elif steel_fits:
        yield "guardrail-median", system.rail(span, 0.0, "both")


def roadside_barriers(layout: Layout, roadside: Roadside, rng: np.random.Generator) -> Iterator[tuple[str, LineObject]]:
    """Yield (id, barrier) of one side: where something needs one, and at random elsewhere."""
    limits, length = layout.site.scenario.barriers, roadside.length
    system = BarrierSystem.draw(rng, limits, limits.concrete_roadside)
    if not limits.roadside:
        return
    at_random = _stretches_at_random(roadside, rng, limits.unneeded)
    stretches = [*roadside.protected, *_stretches_by_rules(layout, roadside), *at_random]
    pieces = barrier_pieces(roadside, merge_ranges(stretches, JOIN))
    roadside.pieces = [part for piece in pieces for part in _beside_mouths(roadside, piece)]
    borders = {segment.end for segment in roadside.edge.segments[:-1]}
    for number, piece in enumerate(roadside.pieces, start=1):
        terminal = SHORT_TERMINAL if borders & {piece.start, piece.end} else TERMINAL
        if piece.start <= 0.0 and piece.end >= length:
            terminal = 0.0
        yield f"{system.name}-{roadside.side}-{number}", system.beside(roadside, piece, terminal)


def plan_noise_barrier(layout: Layout, roadside: Roadside, rng: np.random.Generator) -> NoiseBarrier | None:
    """Return a side's drawn noise barrier, its place reserved and a barrier before it asked for; None without.

    It stands where the edge runs straight on for long enough, away from turnouts, large boards and overpasses.
    """
    limits = layout.site.scenario.barriers
    if rng.random() >= limits.noise_barrier:
        return None
    free_stretches = [
        stretch
        for segment in roadside.edge.segments
        for stretch in free_ranges(*_free_part(roadside, segment), roadside.far, roadside.crossed, roadside.restless)
    ]
    longest_stretch = max((end - start for start, end in free_stretches), default=0.0)
    least_length, largest_length = (
        limits.noise_barrier_length.minimum,
        min(limits.noise_barrier_length.maximum, longest_stretch),
    )
    length = round_value(least_length + max(0.0, largest_length - least_length) * rng.random())
    panel, thickness = pick(rng, PANELS)
    start = draw_start(rng, free_stretches, length)
    if start is None:
        return None
    roadside.far.add(start, start + length)
    roadside.protect(start, start + length)
    base = roadside.edge.base_at(start + length)
    return NoiseBarrier(
        instance=1,
        start_station=round_value(start),
        end_station=round_value(start + length),
        offset=round_value(roadside.sign * (base + FAR_ZONE + max(thickness, NOISE_POST_WIDTH) / 2.0)),
        height=draw(rng, limits.noise_barrier_height),
        panel=panel,
        thickness=thickness,
        post_width=NOISE_POST_WIDTH,
    )


def _stretches_by_rules(layout: Layout, roadside: Roadside) -> Iterator[Range]:
    """Yield the stretches that need a barrier because of the embankment or tight curves."""
    terrain = layout.site.terrain
    if terrain.embankment_height > EMBANKMENT_HEIGHT and terrain.batter_slope < EMBANKMENT_RUN:
        yield 0.0, roadside.length
    for start, end, curvature in layout.tight_arcs:
        # A left curve's outer side is the right one, whose sign is -1.
        if curvature * roadside.sign < 0.0:
            yield start, end


def _stretches_at_random(roadside: Roadside, rng: np.random.Generator, share: float) -> Iterator[Range]:
    """Yield random stretches for barriers that no rule asks for, away from turnouts: a share of the slots has one."""
    slots = math.ceil(roadside.length / _SLOT)
    for slot in range(slots):
        if rng.random() >= share:
            continue
        slot_start, slot_end = roadside.length * slot / slots, roadside.length * (slot + 1) / slots
        if stretch := draw_stretch(rng, free_ranges(slot_start, slot_end, roadside.restless), SHORTEST_BARRIER):
            yield stretch


def _free_part(roadside: Roadside, segment: Segment) -> Range:
    """Return the part of a segment that neither a neighbour's barriers nor what stands behind those reach."""
    start = segment.start + _FROM_BORDER if segment.start > 0.0 else 0.0
    return start, segment.end - _FROM_BORDER if segment.end < roadside.length else segment.end


def barrier_pieces(roadside: Roadside, stretches: list[Range]) -> Iterator[BarrierPiece]:
    """Yield the barriers on stretches: one in each segment of the edge, lengthened to the least where there is room."""
    for segment in roadside.edge.segments:
        segment_start, segment_end = segment.start, segment.end
        clipped = [
            lengthen_range(
                max(start, segment_start), min(end, segment_end), SHORTEST_BARRIER, segment_start, segment_end
            )
            for start, end in stretches
            if start < segment_end and end > segment_start
        ]
        for start, end in merge_ranges(clipped, JOIN):
            piece = _prolong_piece(roadside, segment, BarrierPiece(start, end, segment.base, segment.ramp))
            # Beside a gore no rule asks for a barrier: rather none than a stump.
            if not segment.ramp or piece.end - piece.start >= SHORTEST_BARRIER:
                yield piece


def _beside_mouths(roadside: Roadside, piece: BarrierPiece) -> Iterator[BarrierPiece]:
    """Yield what is left of a barrier beside the mouths of side roads, as far as it is long enough."""
    if not roadside.mouths.within(piece.start, piece.end):
        yield piece
        return
    for start, end in free_ranges(piece.start, piece.end, roadside.mouths):
        if end - start >= SHORTEST_BARRIER:
            yield piece._replace(start=start, end=end)


def _prolong_piece(roadside: Roadside, segment: Segment, piece: BarrierPiece) -> BarrierPiece:
    """Return a barrier too short for its segment made longer beside a neighbour that stands nearer to the road."""
    missing_length = SHORTEST_BARRIER - (piece.end - piece.start)
    if missing_length <= 0.0:
        return piece
    for prolonged in (
        piece._replace(start=max(0.0, piece.start - missing_length)),
        piece._replace(end=piece.end + missing_length),
    ):
        neighbours = [
            s for s in roadside.edge.segments if s != segment and s.start < prolonged.end and s.end > prolonged.start
        ]
        added_stretch = (prolonged.start, piece.start) if prolonged.start < piece.start else (piece.end, prolonged.end)
        is_clear = roadside.edge.largest_paved(*added_stretch) <= segment.base
        if is_clear and all(s.base <= segment.base - STEP_OF_BARRIERS for s in neighbours):
            return prolonged._replace(end=min(prolonged.end, roadside.length))
    return piece


def _concrete(shape: Profile, span: Range, offset: float, terminal: float) -> ConcreteBarrier:
    """Return a concrete barrier of a profile between two stations, its ends ramped over a length; all m."""
    profile, height, foot = shape
    return ConcreteBarrier(
        instance=1,
        start_station=round_value(span[0]),
        end_station=round_value(span[1]),
        offset=round_value(offset),
        profile=profile,
        height=height,
        base_width=round_value(foot),
        terminal_length=round_value(terminal),
    )
