"""Broken rules by row of the tables, and the fixes that the tables offer: each keeps the rule that it mends."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from synthroads_addon.checking.marks import RowMarks, row_marks
from synthroads_addon.jobs.drawn_axis import road_along, rounded_axis
from synthroads_addon.jobs.tables.fixes import (
    crossfall_fix,
    element_fix,
    vertical_fix,
    width_fix,
    with_crossfall_by_rule,
)
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.tables import elements as table
from synthroads_addon.road.tables import points
from synthroads_addon.road.tables.stated import StatedRoad
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario

Change = Callable[[StatedRoad], StatedRoad]
RIGHT = "carriageway-right"


@pytest.fixture(scope="module")
def road() -> RoadParameters:
    """A road of arcs, clothoids, S-curves, an egg and a straight."""
    return sample_road(load_scenario("rq31-600m", ["road.length=2000"]).road, 7)


def elements(edit: Callable[[table.Elements], table.ElementsEdit]) -> Change:
    return lambda stated: stated.with_elements(edit(stated.alignment.horizontal))


def vertical(number: int, **values: float) -> Change:
    return lambda s: s.with_alignment(points.with_vertical_point(s.alignment, number, **values))


def width(strip: str, value: float) -> Change:
    return lambda s: s.with_carriageway(RIGHT, points.with_width(s.carriageways[RIGHT], strip, 0, width=value))


def crossfall(percent: float) -> Change:
    return lambda s: s.with_carriageway(
        RIGHT, points.with_crossfall_point(s.carriageways[RIGHT], 0, crossfall_percent=percent)
    )


def marks_of(road: RoadParameters, stated: StatedRoad) -> RowMarks:
    return row_marks(stated.applied(road))


def test_a_drawn_road_has_no_marks(road: RoadParameters) -> None:
    assert row_marks(road) == RowMarks()


@pytest.mark.parametrize(
    ("change", "rule", "row"),
    [
        (elements(lambda e: table.with_radius(e, 4, 700.0)), "radius-minimum", 4),
        (elements(lambda e: table.with_radius(e, 4, 700.0)), "radius-ratio", 7),
        (elements(lambda e: table.with_parameter(e, 3, 200.0)), "clothoid-minimum", 3),
        (elements(lambda e: table.with_parameter(e, 3, 200.0)), "clothoid-short", 3),
        (elements(lambda e: table.with_parameter(e, 3, 1600.0)), "clothoid-long", 3),
        (elements(lambda e: table.with_parameter(e, 6, 900.0)), "clothoid-ratio", 6),
        (elements(lambda e: table.without(e, 3)), "curvature-jump", 3),
        (elements(lambda e: table.with_length(e, 4, 20.0)), "arc-length", 4),
        (elements(lambda e: table.with_length(e, 2, 2500.0)), "straight-longest", 2),
    ],
)
def test_an_elements_rule_is_marked_in_its_row_and_mended(
    road: RoadParameters, change: Change, rule: str, row: int
) -> None:
    stated = change(StatedRoad.of(road))
    broken = [violation for violation in marks_of(road, stated).elements[row] if violation.rule == rule]
    assert len(broken) == 1
    fix = element_fix(stated, road.design_class, row, broken[0])
    assert fix
    left = [v for rows in marks_of(road, fix.change(stated)).elements.values() for v in rows if v.rule == rule]
    assert left == []


@pytest.mark.parametrize(
    ("change", "rule", "row"),
    [(vertical(1, radius=1000.0), "sag-radius", 1), (vertical(1, elevation=-10.0), "grade-maximum", 0)],
)
def test_a_profiles_rule_is_marked_at_its_point_and_mended(
    road: RoadParameters, change: Change, rule: str, row: int
) -> None:
    stated = vertical(1, radius=8800.0)(StatedRoad.of(road))
    stated = change(stated)
    (violation,) = marks_of(road, stated).vertical[row]
    assert violation.rule == rule
    fix = vertical_fix(stated, road.design_class, row, violation)
    assert fix
    assert marks_of(road, fix.change(stated)).vertical == {}


def test_a_crossfall_is_marked_and_stated_by_rule(road: RoadParameters) -> None:
    stated = crossfall(1.0)(StatedRoad.of(road))
    marks = marks_of(road, stated)
    assert set(marks.crossfall) == {(RIGHT, 0)}
    fix = crossfall_fix(stated, road.design_class, RIGHT, marks.crossfall[RIGHT, 0][0])
    assert marks_of(road, fix.change(stated)) == RowMarks()


def test_a_run_off_too_steep_by_rule_is_mended_by_longer_clothoids() -> None:
    """Of a road drawn with bends so near to each other that their clothoids are short: there is no other crossfall."""
    scenario = load_scenario("rq31-600m", ["seed=1"])
    bends = [[0, 0, 0], [300, 0, 0], [520, 110, 0], [740, 60, 0], [1100, 60, 0]]
    drawn = rounded_axis(bends, [300.0, 300.0, 300.0], scenario.road)
    road, violations = road_along(drawn, scenario, (0.0, 0.0, 0.0))
    steep = [violation for violation in violations if violation.rule == "run-off-steepest"]
    assert steep
    stated = StatedRoad.of(road)
    for violation in steep:
        assert with_crossfall_by_rule(stated, road.design_class, violation.object).carriageways == stated.carriageways
        fix = crossfall_fix(stated, road.design_class, violation.object, violation)
        assert fix.text.startswith("Lengthen Clothoids to ")
        left = marks_of(road, fix.change(stated)).crossfall.values()
        assert violation.rule not in {one.rule for row in left for one in row}


@pytest.mark.parametrize(
    ("strip", "value", "rule"),
    [
        ("Lane 1", 2.25, "lane-width"),
        ("Lane 2", 2.25, "lane-width"),
        ("Inner Edge Strip", 0.45, "edge-strip-width"),
        ("Outer Edge Strip", 0.45, "edge-strip-width"),
        ("Hard Shoulder", 1.8, "hard-shoulder-width"),
        ("Verge", 0.9, "verge-width"),
        ("Inner Offset", -1.0, "median-width"),
    ],
)
def test_a_strips_rule_is_marked_at_its_width_and_mended(
    road: RoadParameters, strip: str, value: float, rule: str
) -> None:
    stated = width(strip, value)(StatedRoad.of(road))
    marks = marks_of(road, stated)
    (violation,) = marks.widths[RIGHT, strip, 0]
    assert violation.rule == rule
    fix = width_fix(RIGHT, strip, 0, violation)
    assert fix
    assert [key for key in marks_of(road, fix.change(stated)).widths if key[0] == RIGHT] == []


def test_a_width_by_station_is_marked_where_it_is_too_narrow(road: RoadParameters) -> None:
    def narrowed(stated: StatedRoad) -> StatedRoad:
        carriageway = points.with_width_inserted(stated.carriageways[RIGHT], "Lane 1", 1)
        carriageway = points.with_width(carriageway, "Lane 1", 1, width=3.0)
        return stated.with_carriageway(RIGHT, carriageway)

    marks = marks_of(road, narrowed(StatedRoad.of(road)))
    assert (RIGHT, "Lane 1", 1) in marks.widths
    assert (RIGHT, "Lane 1", 0) not in marks.widths
