"""The road itself as the sampler draws it: cross-sections, lanes that begin or end, turnouts, pavement, alignment."""

from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import (
    LIMITS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    TURNOUT_GAP,
)
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import ASPHALTS, CONCRETES, Carriageway, LineMarking, Median, Turnout
from synthroads_addon.sampling.conflicts import conflicts
from synthroads_addon.sampling.road import sample_alignment, sample_road
from synthroads_addon.sampling.section import cross_section_of
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.files.mutations import cases
from tests.helpers.roads.sampled_parts import (
    broken,
    changed_lane,
    full_roads,
    nose,
    sampled_roads,
    scenario,
    sides,
    stretch,
)


@pytest.fixture(scope="module")
def roads() -> list[RoadParameters]:
    return sampled_roads()


@pytest.fixture(scope="module")
def furnished() -> list[RoadParameters]:
    return full_roads()


# --- cross-sections -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(STANDARD_CROSS_SECTIONS))
def test_a_standard_cross_section_is_itself(name: str) -> None:
    design_class = next(c for c, names in SECTIONS_OF_CLASS.items() if name in names)
    assert cross_section_of(scenario(design_class=design_class, cross_section=name)) == STANDARD_CROSS_SECTIONS[name]


def test_a_scenario_can_change_a_cross_section() -> None:
    section = cross_section_of(scenario(cross_section="RQ36", lanes=2, median_width=3.0))
    assert (section.lanes, section.median, section.verge) == ((3.75, 3.5), 3.0, 1.5)
    by_hand = {"lanes": [4.0, 3.6], "hard_shoulder": 1.0, "verge": 2.0}
    section = cross_section_of(scenario(cross_section=by_hand, lanes=4))
    assert (section.lanes, section.hard_shoulder, section.verge) == ((4.0, 3.6, 3.6, 3.6), 1.0, 2.0)
    assert cross_section_of(scenario(cross_section=by_hand, lane_width=3.8)).lanes == (3.8, 3.8)


def test_a_road_by_hand_is_as_asked() -> None:
    by_hand = {"lanes": [4.0, 3.8, 3.6, 3.6, 3.5], "hard_shoulder": 0.0, "median": 6.0, "outer_edge_strip": 0.7}
    road = sample_road(scenario(cross_section=by_hand, lane_changes={"share": 0.0}), 1)
    for carriageway in road.of_type(Carriageway).values():
        assert [lane.width for lane in carriageway.lanes] == by_hand["lanes"]
        assert (carriageway.inner_offset, carriageway.hard_shoulder_width) == (3.0, 0.0)
    assert road.metadata.identifier == "free-eka1a-1"
    assert broken(road) == []


def test_narrow_and_wide_roads_keep_the_rules_of_the_crossfall() -> None:
    """The pavement's edge is 3.5 m and 17 m away from its rotation axis."""
    for lanes in ([3.5], [3.75] * 8):
        section = {"design_class": "EKA3", "cross_section": {"lanes": lanes}}
        for seed in range(5):
            wanted = scenario(**section, length=3000.0, radius={"minimum": 280.0, "maximum": 300.0})
            assert broken(sample_road(wanted, seed)) == []


# --- lanes that begin or end --------------------------------------------------------------------------------------


def test_one_lane_at_the_edge_begins_or_ends_over_a_long_taper(roads, furnished) -> None:
    kinds = set()
    for road in roads + furnished:
        for _, carriageway, turnouts in sides(road):
            if (index := changed_lane(carriageway)) is None:
                continue
            lanes = carriageway.lanes
            assert len(lanes) >= 3
            assert index in (0, len(lanes) - 1)
            points = lanes[index].width
            assert [points[0].station, points[-1].station] == pytest.approx([0.0, road.alignment.length])
            widths = [point.width for point in points]
            assert widths[:2] == widths[3:1:-1] or sorted(widths) == sorted([0.0, 0.0, max(widths), max(widths)])
            start, end = points[1].station, points[2].station
            assert end - start >= LIMITS[road.design_class].lane_taper_length - 1e-6
            for _, turnout in turnouts:
                low, high = stretch(turnout)
                assert high <= start - TURNOUT_GAP + 0.02 or low >= end + TURNOUT_GAP - 0.02
            ends = (widths[0] > 0.0) == (carriageway.traffic > 0)
            kinds.add(("ends" if ends else "begins", "outside" if index == 0 else "inside", carriageway.side))
    assert len(kinds) == 8


def test_two_lanes_by_hand_may_become_one() -> None:
    wanted = scenario(cross_section={"lanes": [3.75, 3.6]}, lane_changes={"share": 1.0})
    for seed in range(10):
        road = sample_road(wanted, seed)
        assert all(changed_lane(carriageway) is not None for carriageway in road.of_type(Carriageway).values())
        assert broken(road) == []


def test_an_inner_lane_that_ends_moves_the_outer_boundaries(furnished) -> None:
    seen = 0
    for road in furnished:
        for _, carriageway, _ in sides(road):
            index = changed_lane(carriageway)
            if index != len(carriageway.lanes) - 1:
                continue
            points = carriageway.lanes[index].width
            at = np.array([points[0].station, points[-1].station])
            section = RoadGeometry(road).sections[carriageway.side]
            distances = section.distances(at)
            full = max(point.width for point in points)
            assert distances[0, 0] == distances[1, 0]
            shift = abs(section.main_edge(at)[0] - section.main_edge(at)[1])
            assert shift == pytest.approx(full)
            seen += 1
    assert seen > 5


# --- turnouts -----------------------------------------------------------------------------------------------------


def test_turnouts_lie_in_the_road_and_apart(roads, furnished) -> None:
    for road in roads + furnished:
        for name, carriageway, turnouts in sides(road):
            stretches = [stretch(turnout) for _, turnout in turnouts]
            for low, high in stretches:
                assert -0.02 <= low < high <= road.alignment.length + 0.02, name
            for before, after in pairwise(stretches):
                assert after[0] - before[1] >= TURNOUT_GAP - 0.05
            for kind in ("exit", "entry"):
                alike = [turnout.start_station for _, turnout in turnouts if turnout.kind == kind]
                assert all(b - a >= LIMITS[road.design_class].interchange_spacing for a, b in pairwise(alike))
            assert all(turnout.carriageway == f"carriageway-{carriageway.side}" for _, turnout in turnouts)


def test_turnouts_keep_the_limits_of_their_class(roads, furnished) -> None:
    for road in roads + furnished:
        for _, carriageway, turnouts in sides(road):
            for _, turnout in turnouts:
                if turnout.ramp is None:
                    assert turnout.lane_length >= 40.0
                    assert turnout.lane_width >= 3.0
                    continue
                assert turnout.lane_length >= LIMITS[road.design_class].turnout_lane_length
                assert turnout.lane_width >= 3.5
                assert turnout.ramp.length >= nose(turnout, carriageway) + 10.0 - 1e-6


@pytest.mark.parametrize("half_width", [27.0, 30.0, 40.0, 78.0, 300.0])
def test_ramps_stay_within_the_terrain(half_width: float) -> None:
    limits = {"ramp_length": {"minimum": 20.0, "maximum": 400.0}, "exits": 0.9, "entries": 0.9}
    ramps = 0
    for seed in range(20):
        section = {"design_class": "EKA3", "cross_section": "RQ38.5", "length": 900.0}
        road = sample_road(scenario(**section, half_width=half_width, turnouts=limits), seed)
        stations = np.linspace(0.0, 900.0, 3000)
        reach = max(section.road_edge(stations).max() for section in RoadGeometry(road).sections.values())
        assert reach <= min(half_width, 100.0) - 1.0
        for _, carriageway, turnouts in sides(road):
            for turnout in (turnout for _, turnout in turnouts if turnout.ramp):
                assert turnout.ramp.length >= nose(turnout, carriageway) + 10.0 - 1e-6
                ramps += 1
    assert (ramps > 20) == (half_width > 27.0)


def test_what_is_certain_fits_as_long_as_nothing_conflicts() -> None:
    """Even where the least lengths alone fill the road."""
    shares = {"exits": 1.0, "entries": 1.0, "emergency_bays": 1.0}
    for length in range(900, 1500, 3):
        wanted = scenario(cross_section="RQ36", length=length, turnouts=shares, lane_changes={"share": 1.0})
        if conflicts(wanted):
            continue
        for seed in range(10):
            road = sample_road(wanted, seed)
            for _, carriageway, turnouts in sides(road):
                assert sorted(turnout.kind for _, turnout in turnouts)[:1] == ["emergency_bay"]
                assert {"exit", "entry"} <= {turnout.kind for _, turnout in turnouts}
                assert changed_lane(carriageway) is not None
            assert broken(road) == []
        return
    pytest.fail("no length is enough")


def test_long_roads_have_several_exits() -> None:
    counts = []
    for seed in range(3):
        road = sample_road(scenario(length=40_000.0, turnouts={"exits": 1.0}), seed)
        counts += [sum(turnout.kind == "exit" for _, turnout in turnouts) for _, _, turnouts in sides(road)]
    assert min(counts) >= 3
    assert max(counts) <= 1 + 40_000 / LIMITS["EKA1A"].interchange_spacing


# --- pavement -----------------------------------------------------------------------------------------------------


def test_damage_lies_on_the_pavement(roads, furnished) -> None:
    kinds = set()
    for road in roads + furnished:
        sections, length = RoadGeometry(road).sections, road.alignment.length
        pavements = {item.side: item.pavement for item in road.of_type(Carriageway).values()}
        kinds |= {pavement.kind for pavement in pavements.values()}
        assert pavements["left"].is_concrete == pavements["right"].is_concrete
        for side, pavement in pavements.items():
            section = sections[side]
            for pothole in pavement.potholes:
                ends = pothole.station + np.array([-0.5, 0.5]) * pothole.length
                assert 0.0 - 1e-6 <= ends[0] < ends[1] <= length + 1e-6
                distance = section.carriageway.sign * pothole.offset
                assert distance - pothole.width / 2 >= section.distances(ends)[:, 0].max() - 1e-6
                assert distance + pothole.width / 2 <= section.main_edge(ends).min() + 1e-6
            for rut in pavement.ruts:
                assert 0.0 <= rut.start_station < rut.end_station <= length + 1e-6
                lane = section.carriageway.lanes[rut.lane].width
                assert isinstance(lane, float)
                assert rut.track + rut.width <= lane + 1e-9
            inner, outer = section.distances(np.array([0.0, length])).T[[0, -2]]
            for line in pavement.removed_markings:
                distance = section.carriageway.sign * line.offset
                assert inner.max() < distance - line.width / 2 < distance + line.width / 2 < outer.min()
                assert 0.0 <= line.start_station < line.end_station <= length + 1e-6
    assert kinds == {*ASPHALTS, *CONCRETES}


def test_pavements_are_of_the_kinds_and_ages_that_are_allowed() -> None:
    limits = {"asphalts": ["porous_asphalt"], "concretes": ["exposed_aggregate_concrete"], "concrete": 0.5}
    some = scenario(length=300.0, pavement={**limits, "renewed": 1.0}, markings={"removed": 1.0})
    none = scenario(length=300.0, pavement={**limits, "renewed": 0.0}, markings={"removed": 0.0})
    kinds, aged = set(), set()
    for seed in range(30):
        for carriageway in sample_road(some, seed).of_type(Carriageway).values():
            pavement = carriageway.pavement
            kinds.add(pavement.kind)
            aged.add((len(pavement.lane_ages), pavement.shoulder_age is None))
            assert pavement.removed_markings
        for carriageway in sample_road(none, seed).of_type(Carriageway).values():
            pavement = carriageway.pavement
            assert (pavement.lane_ages, pavement.shoulder_age, pavement.removed_markings) == ((), None, ())
    assert kinds == {"porous_asphalt", "exposed_aggregate_concrete"}
    assert aged == {(1, True), (2, True), (0, False)}


def test_potholes_are_as_many_as_asked() -> None:
    many = scenario(length=5000.0, pavement={"potholes_per_km": {"minimum": 10.0, "maximum": 10.0}})
    for seed in range(5):
        for carriageway in sample_road(many, seed).of_type(Carriageway).values():
            assert 50 <= len(carriageway.pavement.potholes) <= 51
    few = scenario(length=100.0, pavement={"potholes_per_km": {"minimum": 5.0, "maximum": 5.0}})
    counts = [len(c.pavement.potholes) for s in range(200) for c in sample_road(few, s).of_type(Carriageway).values()]
    assert 0.4 <= np.mean(counts) <= 0.6


# --- the whole ----------------------------------------------------------------------------------------------------


def test_instance_numbers_run_without_gaps(roads) -> None:
    for road in roads:
        assert [item.instance for item in road.objects.values()] == list(range(1, len(road.objects) + 1))
        assert len(road.of_type(Median)) == 1


def draws(road: RoadParameters) -> Iterator[tuple[str, float]]:
    """Yield (name, value) of what was drawn for a road."""
    yield from (("radius", 1 / abs(e.curvature_start)) for e in road.alignment.horizontal if e.kind == "arc")
    for a, b in pairwise(road.alignment.vertical):
        yield "grade", 100 * (b.elevation - a.elevation) / (b.station - a.station)
    yield "film", next(iter(road.of_type(LineMarking).values())).film_thickness
    for carriageway in road.of_type(Carriageway).values():
        for pothole in carriageway.pavement.potholes:
            yield from (("pothole size", pothole.length), ("pothole size", pothole.width))
            yield "pothole depth", pothole.depth
        for rut in carriageway.pavement.ruts:
            yield from (("rut depth", rut.depth), ("rut width", rut.width))
        if (index := changed_lane(carriageway)) is not None:
            points = carriageway.lanes[index].width
            yield "lane change", points[2].station - points[1].station
    for turnout in road.of_type(Turnout).values():
        kind = "lane" if turnout.ramp else "bay"
        yield from ((kind, turnout.lane_length), (f"{kind} width", turnout.lane_width))
        yield f"{kind} taper", max(turnout.taper_in_length, turnout.taper_out_length)
        if turnout.ramp:
            yield from (("ramp", turnout.ramp.length), ("clothoid", turnout.ramp.clothoid_parameter))
            yield "shoulder", turnout.shoulder_width
            yield "ramp grade", turnout.ramp.grade_percent


@pytest.mark.slow
def test_draws_reach_all_of_their_intervals() -> None:
    """At least 90 % of each interval, narrowed by what the class asks for."""
    drawn = defaultdict(list)
    for seed in range(400):
        wanted = scenario(design_class="EKA3", cross_section="RQ38.5", length=1500.0)
        for name, value in draws(sample_road(wanted, seed)):
            drawn[name].append(value)
    default = RoadScenario()
    steepest = LIMITS["EKA3"].grade_percent
    turnouts, pavement = default.turnouts, default.pavement
    limits = {
        "radius": (LIMITS["EKA3"].radius, 5000.0),
        "grade": (-steepest, steepest),
        "film": default.markings.film_thickness,
        "pothole size": pavement.pothole_size,
        "pothole depth": pavement.pothole_depth,
        "rut depth": pavement.rut_depth,
        "rut width": pavement.rut_width,
        "lane change": default.lane_changes.taper_length,
        "lane": turnouts.lane_length,
        "lane taper": turnouts.taper_length,
        "lane width": turnouts.lane_width,
        "bay": turnouts.bay_length,
        "bay taper": turnouts.bay_taper_length,
        "bay width": turnouts.bay_width,
        "shoulder": turnouts.shoulder_width,
        "ramp": turnouts.ramp_length,
        "clothoid": turnouts.ramp_clothoid,
        "ramp grade": turnouts.ramp_grade,
    }
    assert drawn.keys() == limits.keys()
    for name, values in drawn.items():
        allowed = limits[name]
        low, high = allowed if isinstance(allowed, tuple) else (allowed.minimum, allowed.maximum)
        assert low - 1e-6 <= min(values) <= max(values) <= high + 1e-6, name
        assert np.ptp(values) >= 0.9 * (high - low), name


def test_a_road_has_the_alignment_that_is_drawn_for_it() -> None:
    """So where many alignments are looked at they are drawn alone, which takes far less time."""
    for limits in (scenario(length=700.0), scenario(design_class="EKA3", cross_section="RQ25", length=3000.0)):
        drawn, road = sample_alignment(limits, 5), sample_road(limits, 5)
        assert road.alignment == drawn.model_copy(update={"instance": road.alignment.instance})


@pytest.mark.parametrize("length", [600.0, 3000.0])
@cases(60, 300)
def test_short_and_long_roads_have_curves_of_all_radii(length: float, count: int) -> None:
    radii = []
    for seed in range(count):
        elements = sample_alignment(scenario(length=length), seed).horizontal
        radii += [1 / abs(element.curvature_start) for element in elements if element.kind == "arc"]
    assert np.ptp(radii) >= (0.9 if count >= 300 else 0.8) * (5000.0 - 900.0)


def test_wide_curves_fit_into_short_roads() -> None:
    for seed in range(30):
        axis = sample_alignment(scenario(length=700.0, radius={"minimum": 4000.0, "maximum": 5000.0}), seed)
        assert any(element.kind == "clothoid" for element in axis.horizontal)
        road = sample_road(scenario(length=3000.0, radius={"minimum": 3e4, "maximum": 5e4}), seed)
        assert broken(road) == []  # no straight is too long, though there is no room for a clothoid


@pytest.mark.parametrize(("low", "high"), [(-6.0, 6.0), (-1.0, 4.0), (-4.0, 1.0)])
def test_long_roads_do_not_climb_for_ever(low: float, high: float) -> None:
    grades = {"grade_percent": {"minimum": low, "maximum": high}}
    for seed in range(1):
        axis = sample_alignment(scenario(design_class="EKA3", cross_section="RQ25", length=50_000.0, **grades), seed)
        assert np.ptp([point.elevation for point in axis.vertical]) < 500.0
