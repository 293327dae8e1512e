"""The checker's rules for alignment and crossfall: one planted violation per rule, and values at their limits."""

import math

import pytest

from synthroads_addon.checking.rules import alignment as checker_alignment
from synthroads_addon.checking.rules import crossfall as checker_crossfall
from synthroads_addon.road.guidelines import DUAL_CLASSES, LIMITS
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.roads.checker_roads import (
    CURVE,
    EGG,
    INSIDE,
    RIGHT_OF_CURVE,
    S_CURVE,
    SAME_WAY,
    STRAIGHT,
    TIGHT,
    Planted,
    assert_found,
    changed,
    checked,
    crossfall,
    curve,
    mirrored,
    profile,
    road,
    rules_of,
    without_length,
)
from tests.sampling.test_country_roads import OF_COUNTRY_ROADS

UNEVEN = [*curve(1000, 500)[:4], *curve(-1500, 800)[1:]]
"""An S-curve of A = 500 m and 800 m."""

PLANTED = [
    Planted("element-length", without_length, "axis", 1400, 0, 0),
    Planted("radius-minimum", lambda: road(curve(800, 400)), "axis", 500, 800, 900, INSIDE),
    Planted(
        "radius-minimum", lambda: road([(300, 0, 0), (200, 0, 1 / 800)]), "axis", 500, 800, 900, frozenset()
    ),  # a clothoid that the road's end cuts
    Planted("clothoid-minimum", lambda: road(curve(470, 158), "EKA2"), "axis", 300, 158, 160, TIGHT, 2),
    Planted("clothoid-short", lambda: road(curve(1500, 400)), "axis", 300, 400, 500, INSIDE, 2),
    Planted("clothoid-long", lambda: road(curve(1000, 1100)), "axis", 300, 1100, 1000, INSIDE, 2),
    Planted(
        "clothoid-long",
        lambda: road(EGG[:3] + [(500, 1 / 900, 1 / 1800), EGG[4]]),
        "axis",
        825,
        math.sqrt(900000),
        900,
        INSIDE | {"radius-ratio"},
    ),
    Planted("clothoid-ratio", lambda: road(UNEVEN), "axis", 1100, 1.6, 1.5, INSIDE),
    Planted("curvature-jump", lambda: road([CURVE[0], CURVE[2]]), "axis", 300, 0.001, 0, INSIDE),
    Planted("straight-longest", lambda: road([(1200, 0, 0), (1000, 0, 0)]), "axis", 0, 2200, 2000),
    Planted("straight-between", lambda: road(SAME_WAY), "axis", 1100, 200, 400, INSIDE),
    Planted("radius-ratio", lambda: road(S_CURVE), "axis", 1406.25, 1.6, 1.5, INSIDE),
    Planted("radius-ratio", lambda: road(EGG), "axis", 950, 2.0, 1.5, INSIDE | {"clothoid-short"}),
    Planted("arc-length", lambda: road(curve(1000, 500, arc=50)), "axis", 550, 50, 72.2222, INSIDE),
    Planted("arc-length", lambda: road([CURVE[1], CURVE[3]]), "axis", 250, 0, 72.2222),
    Planted("vertical-order", lambda: profile((0, 0, 0), (900, 9, 0), (800, 9, 0)), "axis", 800, 800, 900),
    Planted("grade-maximum", lambda: profile((0, 0, 0), (700, 14, 9000), (1400, 49, 0)), "axis", 835, 5, 4),
    Planted("crest-radius", lambda: profile((0, 0, 0), (700, 7, 12000), (1400, 0, 0)), "axis", 700, 12000, 13000),
    Planted("sag-radius", lambda: profile((0, 0, 0), (700, -7, 0), (1400, 0, 0)), "axis", 700, 0, 8800),
    Planted(
        "rounding-overlap",
        lambda: profile((0, 0, 0), (600, 6, 15000), (800, 4, 15000), (1400, 10, 0)),
        "axis",
        650,
        300,
        200,
    ),
    Planted("crossfall-order", lambda: crossfall(*RIGHT_OF_CURVE, (700, -6.0)), "right", 700, 700, 1100),
    Planted("crossfall-least", lambda: crossfall((0, 2.0), of=road(STRAIGHT)), "right", 0, 2.0, 2.5),
    Planted("crossfall-largest", lambda: crossfall((0, 6.5), of=road(STRAIGHT)), "right", 0, 6.5, 6),
    Planted("crossfall-inside", lambda: crossfall(*((s, max(q, -4.0)) for s, q in RIGHT_OF_CURVE)), "right", 550, 4, 6),
    Planted(
        "run-off-steepest", lambda: crossfall((300, 2.5), (330, -2.5), *RIGHT_OF_CURVE[2:]), "right", 300, 1.0, 0.9
    ),
    Planted("run-off-least", lambda: crossfall((300, 2.5), (360, -2.5), *RIGHT_OF_CURVE[2:]), "right", 300, 0.5, 0.6),
    Planted("run-off-place", lambda: crossfall((280, 2.5), (320, -2.5), *RIGHT_OF_CURVE[2:]), "right", 280, 20, 1),
]


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_a_planted_violation_is_found(case: Planted) -> None:
    assert_found(case)


def test_every_rule_has_a_planted_violation() -> None:
    assert {case.rule for case in PLANTED} == rules_of(checker_alignment, checker_crossfall) - OF_COUNTRY_ROADS


@pytest.mark.parametrize("case", PLANTED, ids=lambda case: case.rule)
def test_the_mirrored_road_breaks_the_same_rules(case: Planted) -> None:
    made = case.make()
    if not isinstance(made, RoadParameters):
        found, other = checked(made), checked(mirrored(made))
        assert sorted((v.rule, v.station, v.limit) for v in found) == sorted(
            (v.rule, v.station, v.limit) for v in other
        )


def test_what_is_exactly_at_a_limit_passes() -> None:
    assert {v.rule for v in checked(road(curve(900, 300)))} == INSIDE
    assert checked(road([(2000, 0, 0)])) == []
    assert checked(profile((0, 0, 0), (700, 7, 13000), (1400, 0, 0))) == []
    assert checked(profile((0, 0, 0), (1400, 56, 0))) == []
    steepest = crossfall((300, 2.5), (300 + 5 * 6 / 0.9, -2.5), *RIGHT_OF_CURVE[2:])
    assert checked(steepest) == []
    least = crossfall((300, 2.5), (350, -2.5), *RIGHT_OF_CURVE[2:])
    assert checked(least) == []


@pytest.mark.parametrize(("run_off", "rule"), [(45, "run-off-steepest"), (50, None), (55, "run-off-least")])
def test_where_least_and_largest_run_off_conflict_the_least_wins(run_off: float, rule: str | None) -> None:
    """About its inner edge the carriageway reaches 12 m: at least 1.2 % below 2.5 % crossfall, at most 0.9 % beyond."""
    data = crossfall((300, 2.5), (300 + run_off, -2.5), *RIGHT_OF_CURVE[2:4], (850, -6.0), (1050, -2.5), (1100, 2.5))
    data["objects"]["right"]["rotation_axis"] = "inner_edge"
    found = checked(data)
    assert [(v.rule, v.limit) for v in found] == ([(rule, pytest.approx(1.2))] if rule else [])
    data["objects"]["right"]["crossfall"][-2]["station"] = 870.0  # from -6 to -2.5 % in 20 m: 2.1 %
    beyond = [v for v in checked(data) if v.station == 850.0]
    assert [(v.rule, v.limit) for v in beyond] == [("run-off-steepest", pytest.approx(0.9))]


def test_a_narrow_carriageway_runs_off_by_its_width() -> None:
    """3 m from the axis to the edge: 0.675 % at most."""
    data = changed(("right/lanes", [{"width": 3.5}]), ("right/hard_shoulder_width", 1.0))
    data = changed(*((f"right-line-{i}", None) for i in (1, 2)), of=data)
    limits = {v.rule: v.limit for v in checked(crossfall((300, 2.5), (320, -2.5), of=data))}
    assert limits["run-off-steepest"] == pytest.approx(0.675)


def test_curves_so_wide_that_the_crossfall_may_fall_outwards() -> None:
    for design_class, limits in ((name, LIMITS[name]) for name in DUAL_CLASSES):
        elements = [(600, 1 / limits.radius_outwards, 1 / limits.radius_outwards)]
        assert checked(road(elements, design_class)) == []
        elements = [(600, 1.01 / limits.radius_outwards, 1.01 / limits.radius_outwards)]
        assert {v.rule for v in checked(road(elements, design_class))} == INSIDE


def test_a_vertex_of_two_clothoids_and_a_hidden_jump_are_found() -> None:
    """A clothoid of a millimetre is no transition; a line cut in two is one straight, an arc cut in two one arc."""
    sliver = [(300, 0, 0), (0.001, 0, 0.001), (300, 0.001, 0.001)]
    assert "clothoid-minimum" in {v.rule for v in checked(road(sliver))}
    halves = [*curve(1000, 500, arc=40)[:3], *curve(1000, 500, arc=40)[2:]]
    assert {v.rule for v in checked(road(halves))} == INSIDE


@pytest.mark.parametrize(("jump", "found"), [(3e-8, False), (3e-7, True)])
def test_a_jump_that_is_a_file_s_rounding_is_none(jump: float, found: bool) -> None:
    (length, start, end), *others = CURVE[1:]
    moved = [CURVE[0], (length, start, end - jump), *others]
    assert ("curvature-jump" in {v.rule for v in checked(road(moved))}) == found
