"""The carriageways from a seed: their cross-section, lanes that begin or end, turnouts, pavement and its damage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.crossfall import crossfall_points
from ..road.guidelines import STANDARD_CROSS_SECTIONS, StandardCrossSection
from ..road.objects import Side, WidthPoint, nominal_width, width_at
from ..road.parameters import AlignmentObject
from ..road.section import Carriageway, Lane, Pavement, Pothole, Rut, Turnout
from ..scenario.road import FreeCrossSection, RoadScenario
from .turnouts import (
    BESIDE_LANE_CHANGE,
    RampLimits,
    TurnoutPlace,
    arrange,
    bounds,
    draw,
    features_of,
    lowest_station,
    sample_turnout,
)

SIDES: tuple[Side, ...] = ("right", "left")
_WHEEL_TRACK = 1.8  # distance of the two wheel tracks, m
_RUT_RAMP = 10.0  # length over which ruts begin and end, m
_SHORTEST_RUT = 0.3  # share of the road that is rutted, at least


def cross_section_of(scenario: RoadScenario) -> StandardCrossSection:
    """Return the cross-section of one direction: the standard one or the one by hand, with what the scenario changes.

    Lanes beyond the cross-section's own are as wide as its innermost one.
    """
    section = _unchanged_cross_section(scenario.cross_section)
    lanes = section.lanes
    if scenario.lanes is not None:
        lanes = (lanes + lanes[-1:] * scenario.lanes)[: scenario.lanes]
    if scenario.lane_width is not None:
        lanes = (scenario.lane_width,) * len(lanes)
    median = section.median if scenario.median_width is None else scenario.median_width
    return replace(section, lanes=lanes, median=median)


def _unchanged_cross_section(cross_section: str | FreeCrossSection) -> StandardCrossSection:
    if isinstance(cross_section, str):
        return STANDARD_CROSS_SECTIONS[cross_section]
    return StandardCrossSection(**{name: getattr(cross_section, name) for name in FreeCrossSection.model_fields})


class CarriagewaySampler:
    """Draws the carriageways of one road, each from its own random streams."""

    def __init__(self, scenario: RoadScenario, seed: int, axis: AlignmentObject) -> None:
        self.scenario, self.seed, self.axis = scenario, seed, axis
        self.length = axis.length
        self.section = cross_section_of(scenario)
        curvature = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in axis.horizontal)
        self.ramps = RampLimits(scenario, self.section, 1.0 / max(curvature, 1e-9))
        self.features = features_of(scenario, self.section, self.ramps)
        self.concrete = stream(seed, "pavement").random() < scenario.pavement.concrete

    def draw(self, side: Side) -> tuple[Carriageway, dict[str, Turnout]]:
        """Return a carriageway and its turnouts by id, all with instance 1."""
        rng = stream(self.seed, "section", side)
        turnouts: dict[str, Turnout] = {}
        lanes = tuple(Lane(width=width) for width in self.section.lanes)
        for place in arrange(self.features, self.length, rng):
            if place.kind == "lane_change":
                lanes = self._change_lane(lanes, place, side, rng)
                continue
            name = f"{place.kind.replace('_', '-')}-{side}"
            number = sum(other.startswith(name) for other in turnouts) + 1
            turnout = sample_turnout(self.scenario, self.ramps, place, side, self.length, rng)
            turnouts[name if number == 1 else f"{name}-{number}"] = turnout
        return self._carriageway(side, lanes, rng), turnouts

    def _change_lane(
        self, lanes: tuple[Lane, ...], place: TurnoutPlace, side: Side, rng: np.random.Generator
    ) -> tuple[Lane, ...]:
        """Return the lanes with the outermost or innermost one ending, or beginning, over the taper of a place."""
        index = 0 if rng.random() < 0.5 else len(lanes) - 1
        drops = rng.random() < 0.5
        (taper,) = place.lengths
        start = lowest_station(side, self.length, place.begin + BESIDE_LANE_CHANGE, taper)
        full = self.section.lanes[index]
        low, high = (full, 0.0) if drops == (side == "right") else (0.0, full)
        stations = (0.0, start, round_value(start + taper), round_value(self.length))
        points = zip(stations, (low, low, high, high), strict=True)
        changed = Lane(width=tuple(WidthPoint(station=station, width=width) for station, width in points))
        return tuple(changed if i == index else lane for i, lane in enumerate(lanes))

    def _carriageway(self, side: Side, lanes: tuple[Lane, ...], rng: np.random.Generator) -> Carriageway:
        section, axis = self.section, self.axis.horizontal
        return Carriageway(
            instance=1,
            side=side,
            inner_offset=section.median / 2.0,
            hard_shoulder_width=section.hard_shoulder,
            outer_edge_strip_width=section.outer_edge_strip,
            lanes=lanes,
            inner_edge_strip_width=section.inner_edge_strip,
            verge_width=section.verge,
            crossfall=crossfall_points(self.scenario.design_class, side, section.paved_width / 2.0, axis),
            pavement=Pavement(
                kind="concrete" if self.concrete else "asphalt",
                ruts=self._ruts(lanes, rng),
                potholes=self._potholes(side, lanes, rng),
            ),
        )

    def _ruts(self, lanes: tuple[Lane, ...], rng: np.random.Generator) -> tuple[Rut, ...]:
        """Return the ruts of the outermost lane that is there all along, on a part of the road."""
        limits = self.scenario.pavement
        if rng.random() >= limits.rutted:
            return ()
        length = self.length * draw(rng, (_SHORTEST_RUT, 1.0))
        start = round_value((self.length - length) * rng.random())
        lane = next(i for i, lane in enumerate(lanes) if isinstance(lane.width, float))
        width = draw(rng, bounds(limits.rut_width))
        rut = Rut(
            lane=lane,
            start_station=start,
            end_station=round_value(min(start + length, self.length)),
            depth=draw(rng, bounds(limits.rut_depth)),
            width=width,
            track=round_value(min(_WHEEL_TRACK, self.section.lanes[lane] - width)),
            ramp_length=round_value(min(_RUT_RAMP, length / 3.0)),
        )
        return (rut,)

    def _potholes(self, side: Side, lanes: tuple[Lane, ...], rng: np.random.Generator) -> tuple[Pothole, ...]:
        """Return potholes that lie wholly on the pavement, anywhere on it."""
        limits, sign = self.scenario.pavement, 1.0 if side == "left" else -1.0
        count = int(draw(rng, bounds(limits.potholes_per_km)) * self.length / 1000.0 + rng.random())
        inner, (smallest, largest) = self.section.median / 2.0, bounds(limits.pothole_size)
        potholes = []
        for _ in range(count if smallest <= self.length else 0):
            length = draw(rng, (smallest, min(largest, self.length)))
            station = draw(rng, (length / 2.0, self.length - length / 2.0))
            # A lane only grows or only shrinks: one of the ends is the narrowest place.
            paved = min(self._paved_width(lanes, station + half) for half in (-length / 2.0, length / 2.0))
            width = min(draw(rng, (smallest, largest)), paved)
            offset = sign * draw(rng, (inner + width / 2.0, inner + paved - width / 2.0))
            depth = draw(rng, bounds(limits.pothole_depth))
            potholes.append(Pothole(station=station, offset=offset, length=length, width=width, depth=depth))
        return tuple(potholes)

    def _paved_width(self, lanes: tuple[Lane, ...], station: float) -> float:
        """Return the width (m) of the main road's pavement at a station."""
        full = self.section.paved_width
        for lane in lanes:
            if isinstance(lane.width, tuple):
                full += float(width_at(lane.width, station)) - nominal_width(lane.width)
        return full
