"""Barriers: where the rules ask for them, on which line they stand, and what they are."""

from typing import Any

import pytest

from synthroads_addon.checking.rules import barriers as checker_barriers
from synthroads_addon.road.guidelines import StandardCrossSection
from synthroads_addon.road.objects import WidthPoint
from synthroads_addon.road.things.concrete_barrier import ConcreteBarrier
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.noise_barrier import NoiseBarrier
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.placing.furniture import place_furniture
from tests.helpers.roads.sites import bay_at, beside, curve, entry_at, exit_at, faults, make_site, of, place, straight

EDGE = 14.0
"""Distance of the outer paved edge of an RQ 31 from the centreline, m."""
BARRIER_RULES = {rule.id for rule in checker_barriers.RULES}
Rail = Guardrail | ConcreteBarrier


def spans(rails: list[Rail]) -> list[tuple[float, float]]:
    return [(rail.start_station, rail.end_station) for rail in rails]


def narrow(median: float) -> StandardCrossSection:
    return StandardCrossSection((3.75, 3.75), 3.0, 0.75, 0.75, median)


# --- median -----------------------------------------------------------------------------------------------------


def test_a_double_guardrail_in_the_median_all_along() -> None:
    rail = place(make_site())["guardrail-median"]
    assert (rail.offset, rail.faces, rail.start_station, rail.end_station) == (0.0, "both", 0.0, 600.0)
    assert rail.terminal_length == 0.0
    assert 0.75 <= rail.height <= 0.9


def test_a_concrete_barrier_in_the_median_by_its_share() -> None:
    found = [place(make_site(seed=seed, barriers={"concrete_median": 0.4})) for seed in range(200)]
    concrete = sum("concrete-barrier-median" in furniture for furniture in found)
    assert all(("concrete-barrier-median" in f) != ("guardrail-median" in f) for f in found)
    assert 55 < concrete < 105
    profiles = {f["concrete-barrier-median"].profile for f in found if "concrete-barrier-median" in f}
    assert profiles == {"step", "new_jersey"}


@pytest.mark.parametrize(
    ("median", "name", "half"),
    [(1.5, "guardrail-median", 0.2), (1.4, "guardrail-median", 0.2), (1.34, "concrete-barrier-median", 0.17)],
)
def test_what_fits_into_a_narrow_median(median: float, name: str, half: float) -> None:
    furniture = place(make_site(section=narrow(median)))
    item = furniture[name]
    width = item.base_width / 2.0 if isinstance(item, ConcreteBarrier) else 0.2
    assert width == pytest.approx(half)
    assert median / 2.0 - width >= 0.5 - 1e-9


def test_concrete_gives_way_to_steel_where_its_foot_is_too_wide_and_nothing_fits_into_half_a_metre() -> None:
    concrete = {"barriers": {"concrete_median": 1.0}}
    foot = place(make_site(section=narrow(1.5), **concrete))["concrete-barrier-median"].base_width
    assert foot == pytest.approx(0.5)
    for median in (0.5, 1.2):
        furniture = place(make_site(section=narrow(median), **concrete))
        assert not [name for name in furniture if "median" in name]


def test_two_guardrails_face_their_carriageways_where_something_stands_in_the_median() -> None:
    for seed in range(40):
        furniture = place(make_site(straight(900.0), seed=seed, furniture={"gantries": 1.0}))
        rails = {name: rail for name, rail in furniture.items() if "median" in name}
        if furniture["gantry-1"].kind == "cantilever":
            assert set(rails) == {"guardrail-median"}
            continue
        assert set(rails) == {"guardrail-median-right", "guardrail-median-left"}
        for side, sign in (("right", -1.0), ("left", 1.0)):
            rail = rails[f"guardrail-median-{side}"]
            assert (rail.offset, rail.faces) == (pytest.approx(sign * 1.3), side)
            assert (rail.start_station, rail.end_station, rail.terminal_length) == (0.0, 900.0, 0.0)


# --- where the rules ask for them ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("height", "batter", "needed"), [(3.01, 2.9, True), (3.0, 1.5, False), (4.0, 3.0, False)])
def test_an_embankment_has_barriers_all_along(height: float, batter: float, needed: bool) -> None:
    throughout = []
    for seed in range(12):
        furniture = place(make_site(seed=seed, embankment=height, batter=batter))
        for side in ("right", "left"):
            rails = beside(furniture, side, Guardrail)
            throughout.append(spans(rails) == [(0.0, 600.0)])
            if throughout[-1]:
                assert rails[0].offset == pytest.approx((-1 if side == "right" else 1) * (EDGE + 0.70))
                assert rails[0].faces == ("left" if side == "right" else "right")
                assert rails[0].terminal_length == 0.0
    assert all(throughout) if needed else not any(throughout)


@pytest.mark.parametrize(("radius", "outer"), [(1000.0, "right"), (-1000.0, "left"), (1200.0, ""), (-1200.0, "")])
def test_tight_curves_have_barriers_on_their_outer_side(radius: float, outer: str) -> None:
    covered = {"right": 0, "left": 0}
    for seed in range(20):
        furniture = place(make_site(curve(radius), seed=seed))
        for side in covered:
            rails = beside(furniture, side, Guardrail)
            covered[side] += any(start <= 850.0 and end >= 1150.0 for start, end in spans(rails))
    for side, count in covered.items():
        assert count == 20 if side == outer else count < 15


def test_a_barrier_before_an_obstacle() -> None:
    for side, lead, tail in (("right", 60.0, 10.0), ("left", 10.0, 60.0)):
        for seed in range(10):
            site = make_site(straight(1500.0), seed=seed, furniture={"surveillance": 1.0})
            for name, pole in place(site).items():
                if not name.startswith(f"pole-surveillance-{side}"):
                    continue
                around = [
                    rail
                    for rail in beside(place(site), side, Guardrail)
                    if rail.start_station <= max(0.0, pole.station - lead)
                    and rail.end_station >= min(1500.0, pole.station + tail)
                ]
                assert around
                assert abs(pole.offset) - pole.diameter / 2.0 > abs(around[0].offset) + 0.05


def test_boards_on_thick_posts_are_obstacles_and_small_signs_are_not() -> None:
    site = make_site(straight(2000.0), turnouts=[exit_at(1500.0)], furniture={"signs": True})
    furniture = place(site)
    boards = [sign for sign in of(furniture, TrafficSign).values() if sign.code in ("448", "449")]
    assert len(boards) == 2
    for board in boards:
        assert any(
            rail.start_station <= board.station - 60.0 and rail.end_station >= board.station + 10.0
            for rail in beside(furniture, "right", Guardrail)
        )
    open_road = 0
    for seed in range(20):
        furniture = place(make_site(design_class="EKA3", cross_section="RQ25", seed=seed, furniture={"signs": True}))
        for side in ("right", "left"):
            signs, rails = beside(furniture, side, TrafficSign), spans(beside(furniture, side, Guardrail))
            open_road += any(not any(start < s.station < end for start, end in rails) for s in signs)
    assert open_road > 5


def test_barriers_stand_elsewhere_too_none_shorter_than_60_m() -> None:
    lengths, count = [], 0
    for seed in range(60):
        found = spans(beside(place(make_site(seed=seed)), "right", Guardrail))
        lengths += [end - start for start, end in found]
        count += len(found)
    assert 20 < count < 55
    assert min(lengths) >= 60.0
    assert max(lengths) > 300.0


def test_systems_of_barriers_and_their_terminals() -> None:
    spacings, heights, concrete = set(), [], 0
    for seed in range(120):
        site = make_site(seed=seed, barriers={"concrete_roadside": 0.3})
        for item in beside(place(site), "left", Guardrail, ConcreteBarrier):
            assert item.terminal_length > 0.0
            assert abs(item.offset) - _inner_half(item) == pytest.approx(EDGE + 0.5)
            if isinstance(item, Guardrail):
                spacings.add(item.post_spacing)
                heights.append(item.height)
            else:
                concrete += 1
    assert spacings == {4.0, 2.0, 1.33}
    assert max(heights) - min(heights) > 0.13
    assert concrete > 10


def _inner_half(item: Rail) -> float:
    return item.base_width / 2.0 if isinstance(item, ConcreteBarrier) else 0.2


def test_a_guardrail_stands_before_every_noise_barrier() -> None:
    found = 0
    for seed in range(30):
        site = make_site(straight(1200.0), seed=seed, barriers={"noise_barrier": 0.6})
        furniture = place(site)
        for side, before, behind in (("right", 60.0, 10.0), ("left", 10.0, 60.0)):
            for wall in beside(furniture, side, NoiseBarrier):
                found += 1
                low, high = max(0.0, wall.start_station - before), min(1200.0, wall.end_station + behind)
                rails = beside(furniture, side, Guardrail, ConcreteBarrier)
                rail = next(r for r in rails if r.start_station <= low and r.end_station >= high)
                assert abs(wall.offset) - abs(rail.offset) >= 1.5
    assert found > 25


# --- beside turnouts and lane changes -----------------------------------------------------------------------------


def test_barriers_step_back_at_a_bay() -> None:
    site = make_site(embankment=4.0, turnouts=[bay_at(250.0)])
    rails = beside(place(site), "right", Guardrail)
    assert spans(rails) == [(0.0, 250.0), (250.0, 350.0), (350.0, 600.0)]
    assert [rail.offset for rail in rails] == pytest.approx([-14.7, -17.9, -14.7])


def test_barriers_leave_the_ramp_for_the_island() -> None:
    site = make_site(straight(1200.0), embankment=4.0, turnouts=[exit_at(400.0)])
    rails = beside(place(site), "right", Guardrail)
    lane, ramp, behind = rails[1:]
    # Lane, edge strip and shoulder instead of the hard shoulder: 3.75 + 0.5 + 1.5 - 3.
    assert (lane.start_station, lane.end_station) == (400.0, 690.0)
    assert lane.offset == pytest.approx(-(EDGE + 2.75 + 0.7))
    # On the island behind the exit board, all of it beside the main road.
    assert site.shape(site.turnouts["turnout-1"]).nose_station() + 1.0 < behind.start_station < 800.0
    assert behind.offset == pytest.approx(-(EDGE + 0.7))
    assert ramp.end_station == pytest.approx(behind.start_station, abs=0.02)
    assert ramp.offset < -(EDGE + 6.0)
    assert faults(site, place(site), BARRIER_RULES) == []


def test_short_stretches_between_turnouts_are_guarded_as_well() -> None:
    """Between two bays 20 m apart the barrier goes on on the bays' line; behind a ramp it begins where that ends."""
    site = make_site(embankment=4.0, turnouts=[bay_at(100.0), bay_at(220.0)])
    assert spans(beside(place(site), "right", Guardrail)) == [(0.0, 100.0), (100.0, 320.0), (320.0, 600.0)]
    site = make_site(straight(900.0), embankment=4.0, turnouts=[exit_at(10.0, clothoid=130.0), bay_at(445.0)])
    rails = beside(place(site), "right", Guardrail)
    assert rails[-2].start_station == pytest.approx(410.0, abs=1e-3)
    assert rails[-2].end_station == 545.0
    assert faults(site, place(site), BARRIER_RULES) == []


def test_barriers_follow_a_lane_that_ends() -> None:
    lane = (WidthPoint(station=300.0, width=3.75), WidthPoint(station=420.0, width=0.0))
    rails = beside(place(make_site(straight(900.0), embankment=4.0, outer_lane=lane)), "right", Guardrail)
    assert spans(rails) == [(0.0, 420.0), (420.0, 900.0)]
    assert [rail.offset for rail in rails] == pytest.approx([-14.7, -10.95])


def test_entries_are_exits_backwards() -> None:
    leaving = place(make_site(straight(1000.0), embankment=4.0, turnouts=[exit_at(300.0, "right")]))
    entering = place(make_site(straight(1000.0), embankment=4.0, turnouts=[entry_at(300.0, "right")]))
    forwards = [(r.start_station, r.end_station, r.offset) for r in beside(leaving, "right", Guardrail)]
    backwards: list[Any] = [
        (1000.0 - r.end_station, 1000.0 - r.start_station, r.offset) for r in beside(entering, "right", Guardrail)
    ]
    assert [value for rail in sorted(backwards) for value in rail] == pytest.approx(
        [value for rail in sorted(forwards) for value in rail]
    )


def test_objects_come_one_by_one() -> None:
    assert next(iter(place_furniture(make_site())))[0] == "guardrail-median"
