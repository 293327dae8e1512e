"""Overtaking lanes of roads of three lanes that change sides along the road (2+1), and the markings of a change.

A change is critical where two overtaking lanes end towards each other, and uncritical where two begin. On a pavement
of one width the middle moves from one direction's lanes to the other's; else the pavement is wider beside each lane.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Float
from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.guidelines import StandardCrossSection
from ..road.objects import Side, SignedWidthPoint, WidthPoint
from ..road.section import Carriageway, Lane
from ..road.section_geometry import CarriagewaySection
from ..scenario.road import RoadScenario
from .placing.draw import draw

_ALONG = 2.5
"""Distance of two stripes of the barred area along the road, m. Chosen."""
_STRIPE_SHARE, _WIDEST_STRIPE = 0.35, 0.5
"""Width of a stripe across the road, as a share of the barred area's, and at most, m. Chosen."""
_NARROWEST_BAR = 0.9
"""The area is barred where it is as wide as this, m, or wider. Chosen."""
_FROM_LINE = 0.25
"""Distance of the stripes from the middles of the lines beside them, m. Chosen."""


class _Stretch(NamedTuple):
    """A stretch with an overtaking lane: whether traffic with the stations has it, and between which stations, m."""

    forward: bool
    start: float
    end: float


@dataclass(frozen=True)
class OvertakingPlan:
    """Where either direction has its overtaking lane.

    Attributes:
        section: the road's standard cross-section.
        forward: the side whose traffic goes with the stations.
        stations: (K,) m, at which a width bends.
        shares: by whether the traffic goes with the stations: (K,) how much of its overtaking lane is there, 0 to 1.
        middle: (K,) 0 where the middle lies as with two lanes forward, 1 where it has moved for two backward.
    """

    section: StandardCrossSection
    forward: Side
    stations: Float
    shares: dict[bool, Float]
    middle: Float

    @property
    def is_shifting(self) -> bool:
        """Return whether the middle moves on a pavement of one width."""
        return bool(self.section.oncoming_lanes)

    @property
    def _full(self) -> StandardCrossSection:
        """Return the widths of a direction that has its overtaking lane."""
        return self.section.of_side("right")

    @property
    def _usual(self) -> StandardCrossSection:
        """Return the widths of a direction without one."""
        return self.section.of_side("left") if self.is_shifting else self.section

    def steady_edges(self, side: Side) -> tuple[float, float]:
        """Return the distances (m) of the outer lane's outer edge from the centreline where it is nearest, and of the
        inner edge of what is its pavement all along.
        """
        usual = self._usual
        if not self.is_shifting:
            return usual.inner_edge_strip + usual.lanes[0], usual.inner_edge_strip
        outer = self._outer_edge(side) - usual.outer_edge_strip
        return outer, outer - min(self._full.lanes[0], usual.lanes[0])

    def _outer_edge(self, side: Side) -> float:
        """Return the distance (m) of a side's paved edge from the centreline on a pavement of one width."""
        return self._full.paved_width if side == "right" else self._usual.paved_width

    def apply(self, carriageway: Carriageway) -> Carriageway:
        """Return a carriageway of the section with its overtaking lane where it is there."""
        side = carriageway.side
        share = self.shares[carriageway.traffic > 0]
        overtaking = self._full.lanes[-1] if self.is_shifting else self.section.overtaking_lane
        inner_lane = share * overtaking
        if not self.is_shifting:
            lanes = (carriageway.lanes[0], Lane(width=self._points(inner_lane)))
            return carriageway.model_copy(update={"lanes": lanes})
        alone = self.middle if side == self.forward else 1.0 - self.middle
        full_width, usual_width = self._full.lanes[0], self._usual.lanes[0]
        outer_lane = full_width + alone * (usual_width - full_width)
        moved = self._full.paved_width - self._usual.paved_width
        # The section as it is drawn has its middle on the centreline and two lanes on the right.
        to_left = self.middle if self.forward == "right" else 1.0 - self.middle
        inner_offset = moved * to_left * (1.0 if side == "right" else -1.0)
        strip = self._outer_edge(side) - inner_offset - self._full.outer_edge_strip - outer_lane - inner_lane
        update: dict[str, Any] = {
            "inner_offset": tuple(
                SignedWidthPoint(station=s, width=round_value(w))
                for s, w in zip(self.stations.tolist(), inner_offset.tolist(), strict=True)
            ),
            "lanes": (Lane(width=self._points(outer_lane)), Lane(width=self._points(inner_lane))),
            "inner_edge_strip_width": self._points(strip),
        }
        return carriageway.model_copy(update=update)

    def tapers(self, carriageway: Carriageway) -> list[tuple[float, float]]:
        """Return the stretches (m) between two stations along which a carriageway's lanes begin or end."""
        moving = np.flatnonzero(np.diff(self.shares[carriageway.traffic > 0]))
        return [(float(self.stations[i]), float(self.stations[i + 1])) for i in moving]

    def _points(self, width: Float) -> tuple[WidthPoint, ...]:
        """Return widths (K,) as points along the road."""
        rows = zip(self.stations.tolist(), width.tolist(), strict=True)
        return tuple(WidthPoint(station=s, width=round_value(w)) for s, w in rows)


def overtaking_plan(
    scenario: RoadScenario, seed: int, section: StandardCrossSection, length: float, forward: Side
) -> OvertakingPlan | None:
    """Return where a road of a length (m) has overtaking lanes that change sides; None where it is as its section.

    Args:
        scenario: limits.
        seed: of everything drawn.
        section: the road's cross-section.
        length: m.
        forward: side whose traffic goes with the stations.
    """
    limits, rng = scenario.overtaking, stream(seed, "overtaking lanes")
    if not has_overtaking_lanes(section) or rng.random() >= limits.share:
        return None
    stretches = list(_stretches(scenario, rng, length, is_shifting=bool(section.oncoming_lanes)))
    closing, opening = limits.critical_length / 2.0, limits.uncritical_length
    points: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    middle: list[tuple[float, float]] = []
    for forward_has, start, end in stretches:
        # On a shifting middle a lane opens while the other one closes; half of that lies before the border.
        lead = opening / 2.0 if section.oncoming_lanes else 0.0
        first, last = (start - lead, start - lead + opening), (end - closing, end)
        if not forward_has:
            first, last = (start, start + closing), (end + lead - opening, end + lead)
        points[forward_has] += [(first[0], 0.0), (first[1], 1.0), (last[0], 1.0), (last[1], 0.0)]
        value = 0.0 if forward_has else 1.0
        middle += [(first[1], value), (last[0], value)]
    marks = {round_value(s) for rows in (*points.values(), middle) for s, _ in rows}
    stations = np.array(sorted({0.0, round_value(length)} | marks))
    shares = {with_stations: _values(rows, stations) for with_stations, rows in points.items()}
    return OvertakingPlan(section, forward, stations, shares, _values(middle, stations))


def _values(rows: list[tuple[float, float]], stations: Float) -> Float:
    """Return the values (K,) at stations (K,) between rows of station and value; 0 without any."""
    return np.interp(stations, [s for s, _ in rows], [value for _, value in rows]) if rows else np.zeros(stations.shape)


def has_overtaking_lanes(section: StandardCrossSection) -> bool:
    """Return whether a cross-section is one of three lanes whose middle one either direction may have."""
    return section.single and (bool(section.oncoming_lanes) or section.overtaking_lane > 0.0)


def _stretches(
    scenario: RoadScenario, rng: np.random.Generator, length: float, *, is_shifting: bool
) -> Iterator[_Stretch]:
    """Yield the stretches with an overtaking lane, which begin before the road and end behind it.

    With a middle that moves they follow each other; else there is a stretch without one between two.
    """
    forward = bool(rng.random() < 0.5)
    first = draw(rng, scenario.overtaking.section_length)
    station, number = -first * rng.random(), 0
    end = station + first
    while True:
        if is_shifting or number % 2 == 0:
            yield _Stretch(forward, station, end)
            forward = not forward
        if station > length:
            return
        number += 1
        station, end = end, end + draw(rng, scenario.overtaking.section_length)


class Stripe(NamedTuple):
    """A stripe of a barred area: stations of its ends, their distances from the centreline, and its width, m."""

    stations: tuple[float, float]
    distances: tuple[float, float]
    width: float


def barred_stripes(
    plan: OvertakingPlan, carriageway: Carriageway, section: CarriagewaySection, length: float
) -> Iterator[Stripe]:
    """Yield the stripes on one side of the barred areas between the directions of a road of a length (m)."""
    if plan.is_shifting:
        yield from area_stripes(carriageway, section, [(0.0, length)])


def area_stripes(
    carriageway: Carriageway,
    section: CarriagewaySection,
    stretches: Iterable[tuple[float, float]],
    narrowest: float = _NARROWEST_BAR,
) -> Iterator[Stripe]:
    """Yield the stripes on the strip between the directions that a carriageway has.

    They run outwards in the direction of the traffic beside them, so that those of both sides go on in each other.

    Args:
        carriageway: with the strip.
        section: its strips by station.
        stretches: stations (m) between which stripes may lie.
        narrowest: width of the strip from which on it has stripes, m.
    """
    for start, end in stretches:
        for station in np.arange(start + _ALONG, end - _ALONG, _ALONG).tolist():
            inner, outer = _area(section, station)
            width = round_value(min(_WIDEST_STRIPE, _STRIPE_SHARE * (outer - inner)))
            other = station + carriageway.traffic * (outer - inner - width - _FROM_LINE)
            if outer - inner < narrowest or not start < other < end:
                continue
            reach = _area(section, other)
            if reach[1] - reach[0] < narrowest:
                continue
            ends = sorted([(station, inner + width / 2.0), (other, reach[1] - _FROM_LINE - width / 2.0)])
            first, last = ends
            yield Stripe(
                (round_value(first[0]), round_value(last[0])), (round_value(first[1]), round_value(last[1])), width
            )


def _area(section: CarriagewaySection, station: float) -> tuple[float, float]:
    """Return the distances (m) from the centreline between which a side's part of a barred area lies at a station."""
    if "inner_edge_strip" not in section.kinds:
        return 0.0, 0.0
    inner, outer = section.boundaries_of("inner_edge_strip", [station])
    return float(inner[0]), float(outer[0])
