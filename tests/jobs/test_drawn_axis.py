"""Roads along drawn lines: the deviation is what it is, rules are kept or named, heights are the line's."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check, check_axis
from synthroads_addon.checking.rules.alignment import RULES as AXIS_RULES
from synthroads_addon.fitting.fit import AxisRefusedError
from synthroads_addon.jobs.drawn_axis import (
    fitted_axis,
    place_text,
    road_along,
    rounded_axis,
    rules_text,
    with_drawn_heights,
)
from synthroads_addon.road.geometry import alignment_of, profile_of
from synthroads_addon.road.guidelines import LIMITS
from synthroads_addon.scenario.scenario import load_scenario
from tests.fitting.test_tangents import clicks

SCENARIO = load_scenario("rq31-600m", ["fidelity=draft", "road.half_width=30"])
ORIGIN = (294_000.0, 5_628_000.0, 180.0)


def flat(points: object) -> np.ndarray:
    """Return points (N, 3) on the ground."""
    plan = np.asarray(points, dtype=np.float64)
    return np.column_stack([plan, np.zeros(len(plan))])


@pytest.mark.parametrize("seed", range(8))
def test_what_20_random_clicks_break_is_named_and_their_deviation_told(seed: int) -> None:
    points = clicks(seed)
    drawn = rounded_axis(flat(points), [None] * 18, SCENARIO.road)
    parameters, violations = road_along(drawn, SCENARIO, ORIGIN)
    axis_rules = {rule.id for rule in AXIS_RULES}
    named = [violation for violation in violations if violation.rule in axis_rules]
    assert named == list(drawn.violations), "what is shown while drawing is what the built road breaks"
    assert violations == check(parameters)
    off = np.abs(alignment_of(parameters.alignment).project(np.array(points))[1])
    assert off.max() <= drawn.deviation + 1e-6, "no point is farther off than is told"
    assert f"at most {drawn.deviation:.3f} m" in drawn.text
    text = rules_text(violations)
    assert text.startswith(f"it breaks {len({violation.rule for violation in violations})} rule")
    assert "Smallest radius (" in text


@pytest.mark.parametrize("seed", range(4))
def test_clicks_with_room_keep_the_rules_of_the_centreline(seed: int) -> None:
    """Tangents of 1.2 to 2 km that turn by 20 to 50 degrees, left and right in turn."""
    rng = np.random.default_rng(seed)
    lengths, turns = rng.uniform(1200.0, 2000.0, 5), np.radians(rng.uniform(20.0, 50.0, 4))
    headings = np.concatenate([[0.0], np.cumsum(turns * np.array([1, -1, 1, -1]))])
    legs = lengths[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    points = np.concatenate([[[0.0, 0.0]], np.cumsum(legs, axis=0)])
    drawn = rounded_axis(flat(points), [None] * 4, SCENARIO.road)
    assert drawn.violations == ()
    assert rules_text(drawn.violations) == "it keeps all rules"


def test_an_axis_is_checked_by_the_rules_of_its_own_class() -> None:
    drawn = rounded_axis(flat([[0, 0], [900, 0], [1600, 500]]), [500.0], SCENARIO.road)
    assert {violation.rule for violation in check_axis(drawn.axis, "EKA1A")} == {"radius-minimum"}
    assert check_axis(drawn.axis, "EKA2") == []


def test_the_heights_of_a_polygon_are_its_profile() -> None:
    points = np.array([[0.0, 0.0, 3.0], [1500.0, 0.0, 33.0], [2800.0, 700.0, 10.0]])
    drawn = rounded_axis(points, [None], SCENARIO.road)
    profile = profile_of(drawn.axis)
    assert profile.elevation([0.0, drawn.axis.length]).tolist() == pytest.approx([3.0, 10.0])
    (crest,) = drawn.axis.vertical[1:-1]
    assert (crest.elevation, crest.radius) == (33.0, LIMITS["EKA1A"].crest)
    assert drawn.height_deviation == pytest.approx(abs(profile.elevation(crest.station) - 33.0))
    assert "in height" in drawn.text
    level = rounded_axis(flat(points[:, :2]) + [0.0, 0.0, 7.0], [None], SCENARIO.road)
    assert [point.elevation for point in level.axis.vertical] == [7.0, 7.0]


def test_heights_from_the_seed_are_those_of_a_random_road() -> None:
    drawn = rounded_axis(flat([[0, 0], [900, 0], [1600, 500]]), [None], SCENARIO.road)
    one, same, other = (with_drawn_heights(drawn, SCENARIO.road, seed) for seed in (1, 1, 2))
    assert one == same != other
    assert np.ptp([point.elevation for point in one.axis.vertical]) > 0.0
    assert one.axis.horizontal == drawn.axis.horizontal


def test_a_curve_is_fitted_with_its_heights_and_the_deviation_is_true() -> None:
    station = np.linspace(0.0, 900.0, 181)
    curve = np.column_stack([station, 150.0 * np.sin(station / 300.0), 0.02 * station])
    drawn = fitted_axis(curve, SCENARIO.road, 0.05)
    alignment, profile = alignment_of(drawn.axis), profile_of(drawn.axis)
    at, off = alignment.project(curve[:, :2])
    assert np.abs(off).max() == pytest.approx(drawn.deviation, abs=1e-3)
    assert drawn.deviation < 0.2
    assert np.abs(profile.elevation(at) - curve[:, 2]).max() < 0.1
    assert {violation.rule for violation in drawn.violations} >= {"radius-minimum"}
    parameters, _ = road_along(drawn, SCENARIO, ORIGIN)
    assert parameters.transform.translate == ORIGIN
    assert parameters.alignment == drawn.axis


def test_a_corner_is_refused_and_taken_as_tangents() -> None:
    corner = flat([[0, 0], [300, 0], [300, 300]])
    dense = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in itertools.pairwise(corner)])
    with pytest.raises(AxisRefusedError, match="no road follows its points"):
        fitted_axis(dense, SCENARIO.road, 0.005, "BezierCurve")
    assert rounded_axis(corner, [None], SCENARIO.road).deviation > 10.0


def test_too_few_points_are_refused() -> None:
    with pytest.raises(InputError, match="two"):
        rounded_axis(flat([[0, 0]]), [], SCENARIO.road)


def test_a_place_is_told_by_station_and_offset() -> None:
    drawn = rounded_axis(flat([[0, 0], [900, 0], [1600, 500]]), [None], SCENARIO.road)
    assert place_text(drawn.axis, (123.4, -4.2)) == "station 123.40 m, offset -4.20 m"
    assert place_text(drawn.axis, (0.0, 0.001)) == "station 0.00 m, offset 0.00 m"


def test_one_element_is_told_as_one() -> None:
    assert rounded_axis(flat([[0, 0], [900, 0]]), [], SCENARIO.road).text.startswith("1 element, at most 0.000 m")
    assert "5 elements, at most" in rounded_axis(flat([[0, 0], [900, 0], [1600, 500]]), [None], SCENARIO.road).text
