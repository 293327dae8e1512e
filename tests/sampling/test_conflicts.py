"""Scenarios that can't be met say which limits conflict; of every other one comes a road."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking import checker
from synthroads_addon.checking.rules import rule as checker_base
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject
from synthroads_addon.road.section import Carriageway, Turnout
from synthroads_addon.sampling.conflicts import conflicts
from synthroads_addon.sampling.road import sample_road
from tests.helpers.roads.sampled_parts import PAIRS, broken, changed_lane, scenario, sides

IMPOSSIBLE = {
    "design_class": "EKA3",
    "cross_section": "RQ25",
    "lanes": 5,
    "lane_width": 4.0,
    "median_width": 2.0,
    "length": 5.0,
    "furniture": {"gantry_spacing": 10.0},
}


def test_one_error_names_all_limits_that_conflict() -> None:
    with pytest.raises(InputError) as caught:
        sample_road(scenario(**IMPOSSIBLE), 1)
    message = str(caught.value)
    for part in (
        "road.lanes is 5, RQ25 has 2",
        "lanes and lane_width and median_width make the road 51 m wide, RQ25 is 25 m wide",
        "road.median_width is 2 m, 2.5 m are needed",
        "road.furniture.gantry_spacing is 10 m, length is 5 m",
    ):
        assert part in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"cross_section": "RQ31", "lanes": 3}, "lanes is 3, RQ31 has 2"),
        ({"cross_section": "RQ31", "median_width": 6.0}, "median_width make the road 33 m wide, RQ31 is 31 m wide"),
        ({"cross_section": "RQ31", "lane_width": 3.0}, "lane_width is 3 m, EKA1A needs 3.5 m"),
        ({"cross_section": {"lanes": [3.75, 3.0]}}, "cross_section.lanes is 3 m, EKA1A needs 3.5 m"),
        ({"cross_section": {"lanes": [3.75], "median": 2.0}}, "cross_section.median is 2 m, 2.5 m are needed"),
        ({"half_width": 12.0}, "half_width is 12 m, the road alone reaches 15.5 m"),
        ({"radius": {"minimum": 500.0, "maximum": 2000.0}}, "radius.minimum is 500 m, EKA1A needs 900 m"),
        ({"radius": {"minimum": 1e3, "maximum": 1e6}}, "radius.maximum is 1e+06 m, at most 100000 m are allowed"),
        ({"grade_percent": {"minimum": -5.0, "maximum": 2.0}}, "grade_percent.minimum is -5 %, EKA1A allows 4 %"),
        ({"grade_percent": {"minimum": 3.0, "maximum": 4.0}, "length": 50_000.0}, "grade_percent is 3 % or more"),
        ({"turnouts": {"exits": 1.0}, "length": 5.0}, "turnouts.exits is 1, "),
        ({"turnouts": {"exits": 1.0, "entries": 1.0}}, "turnouts.exits is 1 and turnouts.entries is 1, "),
        ({"turnouts": {"emergency_bays": 1.0}, "length": 79.0}, "80 m are needed and length is 79 m"),
        ({"turnouts": {"exits": 1.0}, "half_width": 25.0}, "turnouts.exits is 1, within half_width 25 m"),
        ({"turnouts": {"emergency_bays": 1.0}, "half_width": 18.0}, "turnouts.emergency_bays is 1, within half_width"),
        ({"turnouts": {"lane_length": {"minimum": 100.0, "maximum": 200.0}}}, "lane_length.maximum is 200 m, EKA1A"),
        ({"turnouts": {"lane_width": {"minimum": 3.0, "maximum": 3.4}}}, "lane_width.maximum is 3.4 m, a turnout"),
        ({"turnouts": {"taper_length": {"minimum": 5.0, "maximum": 9.0}}}, "taper_length.maximum is 9 m"),
        ({"turnouts": {"ramp_length": {"minimum": 30.0, "maximum": 40.0}}}, "ramp_length.maximum is 40 m, a ramp"),
        ({"turnouts": {"bay_length": {"minimum": 10.0, "maximum": 30.0}}}, "bay_length.maximum is 30 m"),
        ({"turnouts": {"bay_width": {"minimum": 2.0, "maximum": 2.5}}}, "bay_width.maximum is 2.5 m"),
        ({"turnouts": {"bay_taper_length": {"minimum": 2.0, "maximum": 9.0}}}, "bay_taper_length.maximum is 9 m"),
        (
            {"cross_section": "RQ36", "lane_changes": {"taper_length": {"minimum": 50.0, "maximum": 90.0}}},
            "lane_changes.taper_length.maximum is 90 m, EKA1A needs 120 m",
        ),
        ({"cross_section": "RQ36", "lane_changes": {"share": 1.0}, "length": 90.0}, "lane_changes.share is 1, 140 m"),
        (
            {"pavement": {"rut_depth": {"minimum": 0.0, "maximum": 0.02}}},
            "rut_depth.minimum is 0, at least 1e-06 is allowed",
        ),
        (
            {"pavement": {"pothole_size": {"minimum": 1.0, "maximum": 9.0}}},
            "pothole_size.maximum is 9, at most 5 is allowed",
        ),
        ({"embankment_height": {"minimum": -30.0, "maximum": 5.0}}, "embankment_height.minimum is -30, at least -20"),
        ({"furniture": {"overpass_clearance": {"minimum": 4.0, "maximum": 5.0}}}, "overpass_clearance.minimum is 4"),
        ({"furniture": {"construction_zone": 1.0}, "length": 90.0}, "furniture.construction_zone is 1, it needs 120 m"),
        (
            {"furniture": {"construction_length": {"minimum": 50.0, "maximum": 60.0}}},
            "construction_length.maximum is 60 m, a construction zone needs 110 m",
        ),
        ({"furniture": {"overpass": 1.0}, "length": 5.0}, "furniture.overpass is 1, it needs 6 m and length is 5 m"),
        ({"barriers": {"noise_barrier": 1.0}, "length": 90.0}, "barriers.noise_barrier is 1, it needs 100 m"),
        (
            {"vehicles": {"trucks": {"minimum": 0.0, "maximum": 2.0}}},
            "vehicles.trucks.maximum is 2, at most 1 is allowed",
        ),
    ],
)
def test_each_conflict_is_named(changes: dict, named: str) -> None:
    with pytest.raises(InputError) as caught:
        sample_road(scenario(**changes), 1)
    assert named in str(caught.value)
    assert "road." in str(caught.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"length": 5.0, "turnouts": {"exits": 0.99, "entries": 0.99, "emergency_bays": 0.99}},
        {"length": 5.0, "cross_section": "RQ36", "lane_changes": {"share": 0.99}},
        {"half_width": 20.0, "turnouts": {"exits": 0.99, "entries": 0.99}},
        {"cross_section": "RQ31", "lane_changes": {"share": 1.0}, "length": 300.0},  # none of two lanes ends
        {"turnouts": {"exits": 0.0, "entries": 0.0, "lane_length": {"minimum": 10.0, "maximum": 20.0}}},
    ],
)
def test_what_has_no_room_does_not_occur(changes: dict) -> None:
    for seed in range(20):
        road = sample_road(scenario(**changes), seed)
        assert not [item for item in road.of_type(Turnout).values() if item.ramp]
        assert all(changed_lane(carriageway) is None for carriageway in road.of_type(Carriageway).values())


def test_bays_stay_within_the_terrain() -> None:
    """The road reaches 15.5 m, a bay of up to 3.5 m lies outside of it, and 2 m of ground are left."""
    for half_width, there in ((20.9, False), (21.1, True)):
        wanted = scenario(half_width=half_width, turnouts={"emergency_bays": 0.99, "exits": 0.0, "entries": 0.0})
        bays = [len(sample_road(wanted, seed).of_type(Turnout)) for seed in range(20)]
        assert (sum(bays) > 0) == there


def test_an_axis_may_break_the_rules_of_its_class() -> None:
    arc = HorizontalElement.between(500.0, 1 / 150, 1 / 150)
    points = (VerticalPoint(station=0.0, elevation=0.0), VerticalPoint(station=500.0, elevation=40.0))
    axis = AlignmentObject(instance=1, start_x=0, start_y=0, start_heading_deg=0, horizontal=(arc,), vertical=points)
    strict = scenario(length=10.0, radius={"minimum": 100.0, "maximum": 200.0}, turnouts={"emergency_bays": 1.0})
    road = sample_road(strict, 1, axis=axis)
    assert road.alignment == axis
    assert len(road.of_type(Turnout)) >= 2  # there is room for bays on the axis, whatever the scenario's own length
    assert {"radius-minimum", "grade-maximum"} <= {violation.rule for violation in broken(road)}
    short = axis.model_copy(update={"horizontal": (HorizontalElement.between(20.0, 0.0, 0.0),)})
    with pytest.raises(InputError, match=r"emergency_bays is 1.*length is 20 m"):
        sample_road(strict, 1, axis=short)


def ranges(low: float, high: float) -> st.SearchStrategy:
    ends = st.tuples(st.floats(low, high), st.floats(low, high))
    return ends.map(lambda pair: {"minimum": min(pair), "maximum": max(pair)})


@pytest.mark.slow
@given(
    pair=st.sampled_from(PAIRS),
    length=st.floats(1.0, 4000.0),
    seed=st.integers(0, 1000),
    half_width=st.sampled_from([78.0, 30.0, 45.0, 200.0]),
    shares=st.tuples(*[st.sampled_from([0.0, 0.5, 1.0])] * 4),
    by_hand=st.none() | st.lists(st.floats(3.5, 4.5), min_size=1, max_size=6),
    radius=st.none() | ranges(900.0, 20_000.0),
    ramp_length=ranges(20.0, 300.0),
    ramp_clothoid=ranges(30.0, 200.0),
)
@settings(max_examples=150, deadline=None)
def test_a_road_comes_of_every_scenario_without_conflict(
    pair, length, seed, half_width, shares, by_hand, radius, ramp_length, ramp_clothoid
) -> None:
    shares_of = dict(zip(("exits", "entries", "emergency_bays"), shares[:3], strict=True))
    changes = {
        "design_class": pair[0],
        "cross_section": {"lanes": by_hand} if by_hand else pair[1],
        "length": length,
        "half_width": half_width,
        "turnouts": {**shares_of, "ramp_length": ramp_length, "ramp_clothoid": ramp_clothoid},
        "lane_changes": {"share": shares[3]},
        "pavement": {"rutted": 0.5, "potholes_per_km": {"minimum": 0.0, "maximum": 40.0}},
    }
    wanted = scenario(**changes, **({"radius": radius} if radius else {}))
    if conflicts(wanted):
        return
    road = sample_road(wanted, seed)
    assert broken(road) == []
    for name, _, turnouts in sides(road):
        kinds = {turnout.kind for _, turnout in turnouts}
        for kind, share in zip(("exit", "entry", "emergency_bay"), shares[:3], strict=True):
            assert share < 1.0 or kind in kinds, name
            assert share > 0.0 or kind not in kinds


def test_the_sampler_does_not_need_the_checker(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("the sampler asked the checker")

    monkeypatch.setattr(checker, "check", fail)
    monkeypatch.setattr(checker_base.Road, "__init__", fail)
    for seed in range(20):
        sample_road(scenario(length=800.0), seed)
