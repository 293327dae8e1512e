"""The carriageways from a seed: cross-section, lanes that begin or end, turnouts, pavement and its damage.

Turnouts and lane changes are put in a random order along the carriageway as close as they may be, as long as they fit;
the length that is left is then shared out among them. Nothing is drawn and rejected. Distances along a carriageway
count in the direction of its traffic until they become stations.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.crossfall import crossfall_points
from ..road.guidelines import (
    EMERGENCY_BAY_LENGTH,
    EMERGENCY_BAY_TAPER,
    EMERGENCY_BAY_WIDTH,
    GUIDELINE_OF_CLASS,
    LIMITS,
    STANDARD_CROSS_SECTIONS,
    TURNOUT_GAP,
    TURNOUT_LANE_WIDTH,
    TURNOUT_TAPER,
    StandardCrossSection,
)
from ..road.objects import Side, WidthPoint, nominal_width, width_at
from ..road.parameters import AlignmentObject
from ..road.section import BAYS, Carriageway, CrossfallPoint, Lane, Pavement, Pothole, Ramp, Rut, Turnout
from ..road.things.limits import Interval
from ..road.turnout_geometry import BLEND, NOSE_BEFORE_END, NOSE_WIDTH, STEP, TurnoutShape
from ..scenario.road import FreeCrossSection, RoadScenario, StatedTurnout, TurnoutLimits
from .overtaking_lanes import overtaking_plan
from .pavement_damage import PavementDamage
from .placing.draw import draw, draw_between
from .surface_course import SurfaceCourses

FeatureKind = Literal["exit", "entry", "emergency_bay", "bus_bay", "layby", "lane_change"]

RAMP_LANE, RAMP_EDGE_STRIP = 4.5, 0.75
"""Widths of a ramp's lane and of either edge strip, m."""
SHARPEST_RIDGE = 5.0
"""Largest difference of the crossfalls of ramp and main road, %."""
TURNOUT_EDGE_STRIP = 0.5
"""Width of the edge strip outside a deceleration or acceleration lane, m."""
FARTHEST_REACH = 90.0
"""A ramp reaches at most this far from the centreline, so that what stands beside it has an offset below 100 m."""
USUAL_RAMP = 85.0
"""Length of a stated exit's or entry's ramp that says none, m, where it fits. Chosen: as a parameter set has it."""
BESIDE_LANE_CHANGE = 10.0
"""Before it begins to close, and behind, a lane is there, and gone, for at least this far, m."""
_LEAST_CLOTHOID, _LARGEST_CLOTHOID = 30.0, 500.0  # m, of a parameter set's ramps
_BESIDE_ROAD = 2.0  # ground beside the road's edge that is left within the terrain, m
_INTERCHANGE_EVERY, _BAY_EVERY = 3000.0, 1000.0  # a long road may have another one after this length, m
SIDES: tuple[Side, ...] = ("right", "left")
_WHEEL_TRACK = 1.8  # distance of the two wheel tracks, m
_RUT_RAMP = 10.0  # length over which ruts begin and end, m
_WITH_OVERTAKING = 2  # lanes of a direction with an overtaking lane
_SHORTEST_RUT = 0.3  # share of the road that is rutted, at least


@dataclass(frozen=True)
class Feature:
    """Kind of turnout, or lane change, that a carriageway may have, with the room that it needs.

    Attributes:
        kind: what it is.
        share: probability that a carriageway has it.
        lengths: least and largest length of each part that is drawn, m.
        fixed_length: what it needs besides, m.
        spacing: least distance between two of its kind, m.
        length_of_another: a road may have another one for each such length, m.
    """

    kind: FeatureKind
    share: float
    lengths: tuple[tuple[float, float], ...]
    fixed_length: float = 0.0
    spacing: float = 0.0
    length_of_another: float = math.inf

    @property
    def least(self) -> float:
        """Return the shortest length that it takes along the carriageway, m."""
        return self.fixed_length + math.fsum(least_length for least_length, _ in self.lengths)


@dataclass(frozen=True)
class TurnoutPlace:
    """A turnout or lane change on its stretch of a carriageway.

    Attributes:
        kind: what it is.
        begin: where its stretch begins, m from where the carriageway's traffic comes from.
        lengths: of its parts, m.
    """

    kind: FeatureKind
    begin: float
    lengths: tuple[float, ...]


class RampLimits:
    """Limits of ramps so that they lie within the terrain and go on for at least 10 m behind their nose.

    Attributes:
        shortest: length of the shortest ramp, m.
        lengths: least and largest length, m; the least is the larger one where no ramp is possible.
        room_for_bay: whether an emergency bay lies within the terrain.
    """

    def __init__(
        self, scenario: RoadScenario, section: StandardCrossSection, tightest_radius: float = math.inf
    ) -> None:
        """Work them out from a scenario's limits, the cross-section and the road's tightest radius (m)."""
        limits = scenario.turnouts
        # Inside the terrain, and well clear of the centre of a curve.
        reach = min(scenario.half_width - _BESIDE_ROAD, FARTHEST_REACH, 0.5 * tightest_radius)
        self.clothoids = limits.ramp_clothoid
        self.nose_wedge = section.hard_shoulder + NOSE_WIDTH
        edge = section.median / 2.0 + section.paved_width + section.verge
        self.room_for_bay = edge + limits.bay_width.maximum <= reach
        self.shortest = self.nose(self.clothoids.minimum) + NOSE_BEFORE_END
        self.widest_wedge = reach - edge + section.hard_shoulder - RAMP_LANE - 2.0 * RAMP_EDGE_STRIP
        widest_lane = limits.lane_width.maximum + TURNOUT_EDGE_STRIP + limits.shoulder_width.maximum
        if self.widest_wedge <= max(self.nose_wedge, widest_lane - RAMP_LANE - 2.0 * RAMP_EDGE_STRIP):
            self.lengths = math.inf, 0.0
            return
        ratio = (self.widest_wedge / self.nose_wedge) ** (1.0 / 3.0)  # of the ramp's length to the nose's, at most
        least_length = max(self.shortest, NOSE_BEFORE_END * ratio / (ratio - 1.0))
        largest_length = (6.0 * self.clothoids.maximum**2 * self.widest_wedge) ** (1.0 / 3.0)
        self.lengths = max(limits.ramp_length.minimum, least_length), min(limits.ramp_length.maximum, largest_length)

    def nose(self, clothoid: float) -> float:
        """Return the distance (m) from the gore's tip to the nose for a clothoid parameter A (m)."""
        return (6.0 * clothoid**2 * self.nose_wedge) ** (1.0 / 3.0)

    def clothoid(self, length: float, share: float) -> float:
        """Return the clothoid parameter A (m) at a share (0 to 1) of those that a ramp of this length (m) may have."""
        smallest = max(self.clothoids.minimum, math.sqrt(length**3 / (6.0 * self.widest_wedge)))
        largest = min(self.clothoids.maximum, math.sqrt((length - NOSE_BEFORE_END) ** 3 / (6.0 * self.nose_wedge)))
        return round_value(smallest + max(0.0, largest - smallest) * share)

    def usual_clothoid(self, length: float) -> float:
        """Return the clothoid parameter A (m) in the middle of those that a ramp of this length (m) may have.

        Where none is possible it is the least one of the limits.
        """
        if length <= NOSE_BEFORE_END or self.lengths[0] > self.lengths[1]:
            return self.clothoids.minimum
        return min(max(self.clothoid(length, 0.5), _LEAST_CLOTHOID), _LARGEST_CLOTHOID)


def bounds(limits: Interval, least: float = -math.inf) -> tuple[float, float]:
    """Return an interval as (low, high), low raised to the least that the guidelines ask for."""
    return max(limits.minimum, least), limits.maximum


def features_of(scenario: RoadScenario, section: StandardCrossSection, ramps: RampLimits) -> tuple[Feature, ...]:
    """Return the turnouts and lane changes that a carriageway may have; those that can't fit are left out."""
    limits, class_limits = scenario.turnouts, LIMITS[scenario.design_class]
    if section.single:
        taper = bounds(limits.side_bay_taper_length)
        bays = (
            Feature("bus_bay", limits.bus_bays, (taper, bounds(limits.bus_bay_length), taper), 0.0, _BAY_EVERY, 2e3),
            Feature("layby", limits.laybys, (taper, bounds(limits.layby_length), taper), 0.0, _BAY_EVERY, 2e3),
        )
        return tuple(bay for bay in bays if bay.share > 0.0) if ramps.room_for_bay else ()
    lane_lengths = bounds(limits.lane_length, class_limits.turnout_lane_length)
    with_ramp = (bounds(limits.taper_length, TURNOUT_TAPER), lane_lengths, ramps.lengths)
    spacing = class_limits.interchange_spacing
    length_of_another = spacing or _INTERCHANGE_EVERY
    features = [
        Feature("exit", limits.exits, with_ramp, BLEND + STEP, spacing, length_of_another),
        Feature("entry", limits.entries, with_ramp, BLEND + STEP, spacing, length_of_another),
    ]
    if ramps.room_for_bay:
        bay_tapers = bounds(limits.bay_taper_length, EMERGENCY_BAY_TAPER)
        bay_lengths = (bay_tapers, bounds(limits.bay_length, EMERGENCY_BAY_LENGTH), bay_tapers)
        features.append(Feature("emergency_bay", limits.emergency_bays, bay_lengths, length_of_another=_BAY_EVERY))
    if may_change_lanes(scenario, section):
        lane_changes = scenario.lane_changes
        tapers = (bounds(lane_changes.taper_length, class_limits.lane_taper_length),)
        features.append(Feature("lane_change", lane_changes.share, tapers, 2.0 * BESIDE_LANE_CHANGE))
    return tuple(f for f in features if f.share > 0.0 and all(least <= largest for least, largest in f.lengths))


def may_change_lanes(scenario: RoadScenario, section: StandardCrossSection) -> bool:
    """Return whether a carriageway has lanes enough to drop or gain one: three, or two of a section by hand."""
    by_hand = isinstance(scenario.cross_section, FreeCrossSection) or scenario.lanes is not None
    return len(section.lanes) >= (2 if by_hand else 3)


def arrange_features(features: tuple[Feature, ...], length: float, rng: np.random.Generator) -> list[TurnoutPlace]:
    """Return drawn turnouts and lane changes of a carriageway of a length (m), in the order of traffic.

    Where they don't all fit, the certain ones (of share 1) come first.
    """
    candidates = [
        (feature.share < 1.0, slot, rng.random(), feature)
        for feature in features
        for slot in range(1 + int(length / feature.length_of_another))
        if rng.random() < feature.share
    ]
    order: list[tuple[float, Feature]] = []
    for *_, feature in sorted(candidates, key=lambda item: item[:3]):
        extended = sorted([*order, (rng.random(), feature)], key=lambda item: item[0])
        if pack_features([(chosen_features, chosen_features.least) for _, chosen_features in extended])[-1] <= length:
            order = extended
    chosen_features = [feature for _, feature in order]
    spare_length = length - pack_features([(feature, feature.least) for feature in chosen_features])[-1]
    extras = [[(largest - least) * rng.random() for least, largest in feature.lengths] for feature in chosen_features]
    granted_share = min(1.0, spare_length / max(math.fsum(map(math.fsum, extras)), 1e-9))
    lengths = [
        tuple(
            round_value(least + extra * granted_share) for (least, _), extra in zip(feature.lengths, parts, strict=True)
        )
        for feature, parts in zip(chosen_features, extras, strict=True)
    ]
    begins = pack_features(
        [(f, f.fixed_length + math.fsum(parts)) for f, parts in zip(chosen_features, lengths, strict=True)]
    )
    spare_length = max(0.0, length - begins.pop())
    shifts = sorted(spare_length * rng.random() for _ in chosen_features)
    return [
        TurnoutPlace(feature.kind, begin + shift, parts)
        for feature, begin, shift, parts in zip(chosen_features, begins, shifts, lengths, strict=True)
    ]


def pack_features(stretches: Sequence[tuple[Feature, float]]) -> list[float]:
    """Return where features of given lengths (m) begin, each as early as allowed, and, last, where all end."""
    begins: list[float] = []
    end_so_far, ends = -TURNOUT_GAP, dict[FeatureKind, float]()
    for feature, length in stretches:
        begins.append(max(end_so_far + TURNOUT_GAP, ends.get(feature.kind, -math.inf) + feature.spacing))
        end_so_far = ends[feature.kind] = begins[-1] + length
    return [*begins, max(end_so_far, 0.0)]


def lowest_station(with_stations: bool, road_length: float, begin: float, length: float) -> float:
    """Return the lowest station (m) of a stretch that begins at a distance along the traffic and has a length (m)."""
    return max(0.0, round_value(begin if with_stations else road_length - begin - length))


def runs_with_stations(scenario: RoadScenario, side: Side) -> bool:
    """Return whether the traffic of one side of a road runs with the stations."""
    return side == traffic_side_of(scenario)


def traffic_side_of(scenario: RoadScenario) -> Side:
    """Return the side that traffic keeps to: the scenario's, else that of the design class's guideline."""
    return scenario.traffic_side or GUIDELINE_OF_CLASS[scenario.design_class].traffic.side


def sample_turnout(
    scenario: RoadScenario, ramps: RampLimits, place: TurnoutPlace, side: Side, length: float, rng: np.random.Generator
) -> Turnout:
    """Return a drawn turnout at a place beside a road of a length (m), with instance 1."""
    limits = scenario.turnouts
    begin = place.begin + BLEND + STEP if place.kind == "entry" else place.begin
    common_fields: dict[str, Any] = {
        "instance": 1,
        "carriageway": f"carriageway-{side}",
        "kind": place.kind,
        "start_station": lowest_station(runs_with_stations(scenario, side), length, begin, math.fsum(place.lengths)),
    }
    if place.kind in BAYS:
        narrowest = EMERGENCY_BAY_WIDTH if place.kind == "emergency_bay" else 0.0
        return Turnout(
            **common_fields,
            taper_in_length=place.lengths[0],
            lane_length=place.lengths[1],
            taper_out_length=place.lengths[2],
            lane_width=draw_between(rng, bounds(limits.bay_width, narrowest)),
            edge_strip_width=0.0,
        )
    taper, lane, ramp = place.lengths
    is_exit = place.kind == "exit"
    return Turnout(
        **common_fields,
        taper_in_length=taper if is_exit else 0.0,
        lane_length=lane,
        taper_out_length=0.0 if is_exit else taper,
        lane_width=draw_between(rng, bounds(limits.lane_width, TURNOUT_LANE_WIDTH)),
        edge_strip_width=TURNOUT_EDGE_STRIP,
        shoulder_width=draw_between(rng, bounds(limits.shoulder_width)),
        ramp=Ramp(
            length=ramp,
            clothoid_parameter=ramps.clothoid(ramp, rng.random()),
            lane_width=RAMP_LANE,
            edge_strip_width=RAMP_EDGE_STRIP,
        ),
    )


def stated_turnout(scenario: RoadScenario, ramps: RampLimits, place: StatedTurnout) -> Turnout:
    """Return a turnout at its stated station, with instance 1; sizes that it doesn't state are the least allowed ones.

    The least are those of the limits and of the guidelines (RAA). A ramp may be impossible, see `ramps`.
    """
    limits, class_limits, is_exit = scenario.turnouts, LIMITS[scenario.design_class], place.kind == "exit"

    def stated(value: float | None, interval: Interval, least: float) -> float:
        return bounds(interval, least)[0] if value is None else value

    common_fields: dict[str, Any] = {
        "instance": 1,
        "carriageway": f"carriageway-{place.side}",
        "kind": place.kind,
        "start_station": place.station,
    }
    if place.kind == "emergency_bay":
        taper = stated(place.taper_length, limits.bay_taper_length, EMERGENCY_BAY_TAPER)
        return Turnout(
            **common_fields,
            taper_in_length=taper,
            lane_length=stated(place.lane_length, limits.bay_length, EMERGENCY_BAY_LENGTH),
            taper_out_length=taper,
            lane_width=stated(place.lane_width, limits.bay_width, EMERGENCY_BAY_WIDTH),
            edge_strip_width=0.0,
        )
    taper = stated(place.taper_length, limits.taper_length, TURNOUT_TAPER)
    length = place.ramp_length or round_value(min(max(USUAL_RAMP, ramps.lengths[0]), ramps.lengths[1]) or USUAL_RAMP)
    return Turnout(
        **common_fields,
        taper_in_length=taper if is_exit else 0.0,
        lane_length=stated(place.lane_length, limits.lane_length, class_limits.turnout_lane_length),
        taper_out_length=0.0 if is_exit else taper,
        lane_width=stated(place.lane_width, limits.lane_width, TURNOUT_LANE_WIDTH),
        edge_strip_width=TURNOUT_EDGE_STRIP,
        shoulder_width=limits.shoulder_width.minimum,
        ramp=Ramp(
            length=length,
            clothoid_parameter=place.ramp_clothoid or ramps.usual_clothoid(length),
            lane_width=RAMP_LANE,
            edge_strip_width=RAMP_EDGE_STRIP,
        ),
    )


def lay_ramp(limits: TurnoutLimits, turnout: Turnout, road: Carriageway, rng: np.random.Generator) -> Turnout:
    """Return a turnout whose ramp has a drawn crossfall, which falls away from the main road, and a drawn grade.

    The crossfall differs by no more than `SHARPEST_RIDGE` from that of the carriageway at the nose.
    """
    if turnout.ramp is None:
        return turnout
    fall_percent, grade = (draw_between(rng, bounds(limit)) for limit in (limits.ramp_crossfall, limits.ramp_grade))
    station, percent = zip(*((point.station, point.crossfall_percent) for point in road.crossfall), strict=True)
    percent_at_nose = float(np.interp(TurnoutShape(turnout, road).nose_station(), station, percent))
    target_percent = -road.sign * fall_percent
    crossfall = round_value(
        min(max(target_percent, percent_at_nose - SHARPEST_RIDGE), percent_at_nose + SHARPEST_RIDGE)
    )
    ramp = turnout.ramp.model_copy(update={"crossfall_percent": crossfall, "grade_percent": grade})
    return turnout.model_copy(update={"ramp": ramp})


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
    oncoming_lanes = section.oncoming_lanes if scenario.lanes is None and scenario.lane_width is None else ()
    return replace(section, lanes=lanes, median=median, oncoming_lanes=oncoming_lanes)


def _unchanged_cross_section(cross_section: str | FreeCrossSection) -> StandardCrossSection:
    """Return the standard cross-section of a name, or one by hand, as the guidelines' table would have it."""
    if isinstance(cross_section, str):
        return STANDARD_CROSS_SECTIONS[cross_section]
    return StandardCrossSection(**{name: getattr(cross_section, name) for name in FreeCrossSection.model_fields})


def lever_of(scenario: RoadScenario) -> float:
    """Return the largest distance (m) of a paved edge from the axis about which the crossfall turns."""
    section = cross_section_of(scenario)
    return section.lever + (section.overtaking_lane if scenario.overtaking.share > 0.0 else 0.0)


class CarriagewaySampler:
    """Draws the carriageways of one road, each from its own random streams."""

    def __init__(self, scenario: RoadScenario, seed: int, axis: AlignmentObject) -> None:
        self.scenario, self.seed, self.axis = scenario, seed, axis
        self.length = axis.length
        self.section = cross_section_of(scenario)
        curvature = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in axis.horizontal)
        self.ramps = RampLimits(scenario, self.section, 1.0 / max(curvature, 1e-9))
        self.features = features_of(scenario, self.section, self.ramps)
        self._courses = SurfaceCourses(scenario, seed, axis.length)
        forward: Side = "left" if traffic_side_of(scenario) == "left" else "right"
        self.overtaking = overtaking_plan(scenario, seed, self.section, axis.length, forward)

    def draw(
        self, side: Side, crossfall: tuple[CrossfallPoint, ...] | None = None
    ) -> tuple[Carriageway, dict[str, Turnout]]:
        """Return a drawn carriageway and its turnouts by id, all with instance 1; with its crossfall if it is given."""
        rng = stream(self.seed, "section", side)
        turnouts: dict[str, Turnout] = {}
        section = self.section.of_side(side)
        lanes = tuple(Lane(width=width) for width in section.lanes)
        stated = [place for place in self.scenario.turnouts.places if place.side == side]
        for stated_place in stated:
            name = self._free_name(stated_place.kind, side, turnouts)
            turnouts[name] = stated_turnout(self.scenario, self.ramps, stated_place)
        for place in arrange_features(self.features, self.length, rng) if not stated else ():
            if place.kind == "lane_change":
                lanes = self._change_lane(lanes, place, side, rng)
                continue
            name = self._free_name(place.kind, side, turnouts)
            turnouts[name] = sample_turnout(self.scenario, self.ramps, place, side, self.length, rng)
        road = self._carriageway(side, lanes, rng)
        if self.overtaking is not None:
            road = self.overtaking.apply(road)
            tapers = self.overtaking.tapers(road)
            turnouts = {
                name: turnout
                for name, turnout in turnouts.items()
                if all(end < turnout.start_station or start > turnout.end_station for start, end in tapers)
            }
        if crossfall is not None:
            road = road.model_copy(update={"crossfall": crossfall})
        return road, {name: self._lay_ramp(name, turnout, road) for name, turnout in turnouts.items()}

    def pave(self, carriageway: Carriageway) -> Carriageway:
        """Return a given carriageway with a drawn surface course; nothing is drawn that would change its surface."""
        side = carriageway.side
        fields = {**self._courses.draw(side, len(carriageway.lanes)), **self._relief(side)}
        return carriageway.model_copy(update={"pavement": Pavement(**fields)})

    @staticmethod
    def _free_name(kind: FeatureKind, side: Side, turnouts: dict[str, Turnout]) -> str:
        """Return the id of one more turnout of a kind beside a carriageway."""
        name = f"{kind.replace('_', '-')}-{side}"
        number = sum(other.startswith(name) for other in turnouts) + 1
        return name if number == 1 else f"{name}-{number}"

    def _lay_ramp(self, name: str, turnout: Turnout, road: Carriageway) -> Turnout:
        """Return a turnout with a drawn ramp surface, from random numbers of its own."""
        return lay_ramp(self.scenario.turnouts, turnout, road, stream(self.seed, "ramp surface", name))

    def _change_lane(
        self, lanes: tuple[Lane, ...], place: TurnoutPlace, side: Side, rng: np.random.Generator
    ) -> tuple[Lane, ...]:
        """Return the lanes with the outermost or innermost one ending, or beginning, over the taper of a place."""
        index = 0 if rng.random() < 0.5 else len(lanes) - 1
        is_dropped = rng.random() < 0.5
        (taper,) = place.lengths
        with_stations = runs_with_stations(self.scenario, side)
        start = lowest_station(with_stations, self.length, place.begin + BESIDE_LANE_CHANGE, taper)
        full_width = self.section.of_side(side).lanes[index]
        first_width, last_width = (full_width, 0.0) if is_dropped == with_stations else (0.0, full_width)
        stations = (0.0, start, round_value(start + taper), round_value(self.length))
        points = zip(stations, (first_width, first_width, last_width, last_width), strict=True)
        changed_lane = Lane(width=tuple(WidthPoint(station=station, width=width) for station, width in points))
        return tuple(changed_lane if i == index else lane for i, lane in enumerate(lanes))

    def _carriageway(self, side: Side, lanes: tuple[Lane, ...], rng: np.random.Generator) -> Carriageway:
        """Return a carriageway of the road's cross-section with its crossfall, and its pavement with drawn damage."""
        section, axis = self.section.of_side(side), self.axis.horizontal
        lever = lever_of(self.scenario)
        edges = self._lane_edges(lanes) if self.overtaking is None else self.overtaking.steady_edges(side)
        damage = PavementDamage(self.scenario.materials, self.seed, side, self.length, edges)
        return Carriageway(
            instance=1,
            side=side,
            inner_offset=section.median / 2.0,
            hard_shoulder_width=section.hard_shoulder,
            outer_edge_strip_width=section.outer_edge_strip,
            lanes=lanes,
            inner_edge_strip_width=section.inner_edge_strip,
            verge_width=section.verge,
            crossfall=crossfall_points(self.scenario.design_class, side, lever, axis),
            rotation_axis="centreline" if section.single else "carriageway_axis",
            traffic_side="left" if traffic_side_of(self.scenario) == "left" else None,
            pavement=Pavement(
                **self._courses.draw(side, len(lanes) if self.overtaking is None else _WITH_OVERTAKING),
                **self._relief(side),
                ruts=self._ruts(lanes, rng),
                potholes=self._potholes(side, lanes, rng),
                patches=damage.patches(),
                cracks=damage.cracks(),
                removed_markings=self._courses.removed_markings(side, edges),
            ),
        )

    def _relief(self, side: Side) -> dict[str, float]:
        """Return the depths of wheel tracks and joints, and the unevenness."""
        rng, limits = stream(self.seed, "pavement relief", side), self.scenario.pavement
        names = ("wheel_track_depth", "joint_depth", "unevenness")
        return {name: draw(rng, getattr(limits, name)) for name in names}

    def _lane_edges(self, lanes: tuple[Lane, ...]) -> tuple[float, ...]:
        """Return the distances (m) from the centreline of the boundaries of steady lanes, outermost first."""
        innermost_edge = self.section.median / 2.0 + self.section.inner_edge_strip
        steady_widths = [lane.width if isinstance(lane.width, float) else 0.0 for lane in lanes]
        first_steady = next(i for i, width in enumerate(steady_widths) if width)
        steady_widths = steady_widths[first_steady:]
        # A lane that begins or ends is the outermost or the innermost one: the latter moves nothing outside of it.
        if not steady_widths[-1]:
            innermost_edge += max(point.width for point in lanes[-1].width)  # type: ignore[union-attr]
            steady_widths = steady_widths[:-1]
        return tuple(innermost_edge + sum(steady_widths[i:]) for i in range(len(steady_widths) + 1))

    def _ruts(self, lanes: tuple[Lane, ...], rng: np.random.Generator) -> tuple[Rut, ...]:
        """Return at most one drawn rut, of the outermost lane that is there all along, on a part of the road."""
        limits = self.scenario.pavement
        if rng.random() >= limits.rutted:
            return ()
        length = self.length * draw_between(rng, (_SHORTEST_RUT, 1.0))
        start = round_value((self.length - length) * rng.random())
        lane = next(i for i, lane in enumerate(lanes) if isinstance(lane.width, float))
        width = draw_between(rng, bounds(limits.rut_width))
        rut = Rut(
            lane=lane,
            start_station=start,
            end_station=round_value(min(start + length, self.length)),
            depth=draw_between(rng, bounds(limits.rut_depth)),
            width=width,
            track=round_value(min(_WHEEL_TRACK, nominal_width(lanes[lane].width) - width)),
            ramp_length=round_value(min(_RUT_RAMP, length / 3.0)),
        )
        return (rut,)

    def _potholes(self, side: Side, lanes: tuple[Lane, ...], rng: np.random.Generator) -> tuple[Pothole, ...]:
        """Return drawn potholes that lie wholly on the main road's pavement."""
        limits, sign = self.scenario.pavement, 1.0 if side == "left" else -1.0
        count = int(draw_between(rng, bounds(limits.potholes_per_km)) * self.length / 1000.0 + rng.random())
        inner_edge, (smallest, largest) = self.section.median / 2.0, bounds(limits.pothole_size)
        steady_edges = None if self.overtaking is None else self.overtaking.steady_edges(side)
        if steady_edges is not None:
            inner_edge = steady_edges[1]
        potholes = []
        for _ in range(count if smallest <= self.length else 0):
            length = draw_between(rng, (smallest, min(largest, self.length)))
            station = draw_between(rng, (length / 2.0, self.length - length / 2.0))
            # A lane only grows or only shrinks: one of the ends is the narrowest place.
            paved_width = min(
                self._paved_width(side, lanes, station + half_length) for half_length in (-length / 2.0, length / 2.0)
            )
            if steady_edges is not None:
                paved_width = steady_edges[0] - steady_edges[1]
            width = min(draw_between(rng, (smallest, largest)), paved_width)
            offset = sign * draw_between(rng, (inner_edge + width / 2.0, inner_edge + paved_width - width / 2.0))
            depth = draw_between(rng, bounds(limits.pothole_depth))
            potholes.append(Pothole(station=station, offset=offset, length=length, width=width, depth=depth))
        return tuple(potholes)

    def _paved_width(self, side: Side, lanes: tuple[Lane, ...], station: float) -> float:
        """Return the width (m) of the main road's pavement of one carriageway at a station."""
        total_width = self.section.of_side(side).paved_width
        for lane in lanes:
            if isinstance(lane.width, tuple):
                total_width += float(width_at(lane.width, station)) - nominal_width(lane.width)
        return total_width
