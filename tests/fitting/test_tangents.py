"""Tangent polygons: elements are exact, radii as large as the tangents hold, clothoids by the rule."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.fitting.tangents import (
    LEAST_RADIUS,
    CurveRule,
    TangentAxis,
    radius_at_distance,
    snapped_point,
    tangent_axis,
    tangent_length,
)
from synthroads_addon.road.guidelines import LIMITS

RULE = CurveRule("EKA1A", half_width=12.0)
EXACT = 1e-6
"""Curvatures are rounded to 12 decimals: over 10 km of road that is less than a micrometre."""


def clicks(seed: int, count: int = 20, reach: float = 1000.0) -> list[np.ndarray]:
    """Return so many random points of a square of twice the reach (m), without those that are refused."""
    rng = np.random.default_rng(seed)
    points = [rng.uniform(-reach, reach, 2)]
    while len(points) < count:
        point = rng.uniform(-reach, reach, 2)
        try:
            tangent_axis([*points, point], [None] * (len(points) - 1), RULE)
        except InputError:
            continue
        points.append(point)
    return points


def check_exact(points: list[np.ndarray], axis: TangentAxis) -> None:
    """Check that the axis runs from the first point to the last one, along all tangents, without a jump or a kink."""
    polygon, alignment = np.array(points), axis.alignment
    assert np.abs(alignment.position([0.0, alignment.length]) - polygon[[0, -1]]).max() < EXACT
    legs = np.diff(polygon, axis=0)
    for corner in axis.corners:
        i = corner.number
        for station, leg in ((corner.start, legs[i - 1]), (corner.end, legs[i])):
            position, heading, _ = alignment.frame(station)
            direction = leg / np.hypot(*leg)
            x, y = position - polygon[i]
            across = float(direction[0] * y - direction[1] * x)
            assert abs(across) < EXACT, "the curve begins and ends on the tangents"
            assert math.cos(float(heading) - math.atan2(leg[1], leg[0])) > 1.0 - 1e-12
        middle = alignment.position((corner.start + corner.end) / 2.0)
        assert np.hypot(*(middle - polygon[i])) == pytest.approx(corner.distance, abs=EXACT)
    for before, after in zip(alignment.elements[:-1], alignment.elements[1:], strict=True):
        assert before.curvature_end == after.curvature_start


@pytest.mark.parametrize("seed", range(12))
def test_an_axis_of_20_random_points_is_exact(seed: int) -> None:
    points = clicks(seed)
    axis = tangent_axis(points, [None] * 18, RULE)
    check_exact(points, axis)
    assert axis.deviation == max(corner.distance for corner in axis.corners) > 0.0
    assert min(corner.radius for corner in axis.corners) >= LEAST_RADIUS


@pytest.mark.parametrize("design_class", LIMITS)
def test_a_curve_with_room_keeps_every_rule_of_its_class(design_class: str) -> None:
    rule = CurveRule(design_class, half_width=12.0)
    axis = tangent_axis([[0, 0], [3000, 0], [5500, 1500]], [None], rule)
    (corner,) = axis.corners
    limits = LIMITS[design_class]
    assert corner.radius == corner.wanted_radius >= limits.radius
    parameter = math.sqrt(corner.clothoid * corner.radius)
    assert max(limits.clothoid, corner.radius / 3.0) - 1e-9 <= parameter <= corner.radius + 1e-9
    arc = axis.alignment.elements[2]
    assert (arc.kind, arc.length >= rule.shortest_arc) == ("arc", True)
    assert [element.kind for element in axis.alignment.elements] == ["line", "clothoid", "arc", "clothoid", "line"]


def test_a_flat_angle_gets_a_larger_radius() -> None:
    """At 900 m its arc would be shorter than two seconds of travel."""
    (flat,) = tangent_axis([[0, 0], [3000, 0], [6000, 450]], [None], RULE).corners
    assert abs(flat.turn) * 900.0 - RULE.usual_clothoid(900.0) < RULE.shortest_arc
    assert flat.radius > 900.0
    assert abs(flat.turn) * flat.radius - flat.clothoid >= RULE.shortest_arc - 1e-9


def test_clothoids_leave_the_shortest_arc_or_half_of_the_turn() -> None:
    arc = RULE.shortest_arc
    assert RULE.clothoid(900.0, 0.5) == RULE.usual_clothoid(900.0) == pytest.approx(100.0)
    assert RULE.clothoid(900.0, -0.18) == pytest.approx(162.0 - arc)
    assert RULE.clothoid(900.0, 0.1) == pytest.approx(45.0)


def test_a_radius_is_what_the_tangents_hold() -> None:
    (corner,) = tangent_axis([[0, 0], [200, 0], [400, 200]], [None], RULE).corners
    assert corner.is_reduced
    assert corner.wanted_radius == 900.0
    room = 200.0
    assert corner.tangent == pytest.approx(room, abs=EXACT), "all of it"
    assert tangent_length(corner.radius + 1.0, corner.turn, RULE) > room, "one metre more has no room"
    assert abs(corner.turn) * corner.radius - corner.clothoid == pytest.approx(RULE.shortest_arc, abs=1e-3)
    (sharp,) = tangent_axis([[0, 0], [600, 0], [600, 600]], [None], RULE).corners
    assert sharp.tangent == pytest.approx(600.0, abs=EXACT)
    assert sharp.radius == round(sharp.radius), "in whole metres, where the arc is long enough for that"


def test_two_curves_share_the_tangent_between_them() -> None:
    points = [[0, 0], [2000, 0], [2300, 200], [4300, 200]]
    first, second = tangent_axis(points, [None, None], RULE).corners
    leg = math.hypot(300.0, 200.0)
    assert first.tangent + second.tangent <= leg + 1e-9
    assert first.tangent == pytest.approx(second.tangent, abs=3.0)
    assert first.tangent + second.tangent == pytest.approx(leg, abs=EXACT)
    small, large = tangent_axis(points, [100.0, None], RULE).corners
    assert (small.radius, small.is_reduced) == (100.0, False)
    assert large.radius > second.radius, "what one doesn't take the other has"


@pytest.mark.parametrize("seed", range(6))
def test_no_straight_is_left_where_curves_share_a_tangent(seed: int) -> None:
    """Left and right in turn, with tangents too short for the radii: whole metres of radius used to leave 0.1 m."""
    rng = np.random.default_rng(seed)
    headings = np.concatenate([[0.0], np.cumsum(rng.uniform(0.12, 0.6, 6) * np.array([1, -1, 1, -1, 1, -1]))])
    lengths = np.array([400.0, *rng.uniform(120.0, 260.0, 5), 400.0])
    legs = lengths[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    points = [np.zeros(2), *np.cumsum(legs, axis=0)]
    axis = tangent_axis(points, [None] * 6, RULE)
    check_exact(points, axis)
    for before, after in zip(axis.corners[:-1], axis.corners[1:], strict=True):
        straight = after.start - before.end
        if before.is_reduced and after.is_reduced and straight < 5.0:
            assert straight < EXACT
    touching = sum(after.start - before.end < EXACT for before, after in itertools.pairwise(axis.corners))
    assert touching >= 3
    for corner in axis.corners:
        arc, usual = abs(corner.turn) * corner.radius - corner.clothoid, RULE.clothoid(corner.radius, corner.turn)
        usual_arc = abs(corner.turn) * corner.radius - usual
        assert arc >= min(RULE.shortest_arc, 0.9 * usual_arc) - EXACT, "no arc becomes too short for it"
        assert usual * (1.0 - 2e-6) <= corner.clothoid <= corner.radius


def test_a_given_radius_is_taken_exactly() -> None:
    (corner,) = tangent_axis([[0, 0], [2000, 0], [3000, 1500]], [1234.5], RULE).corners
    assert corner.radius == 1234.5


def test_tangents_that_go_straight_on_are_one_line() -> None:
    axis = tangent_axis([[0, 0], [500, 0], [900, 0]], [None], RULE)
    assert [element.kind for element in axis.alignment.elements] == ["line"]
    assert axis.alignment.length == pytest.approx(900.0)
    assert axis.deviation == 0.0


@pytest.mark.parametrize("radius", [50.0, 470.0, 2500.0])
@pytest.mark.parametrize("turn", [0.15, -0.9, 2.0])
def test_a_handle_at_the_curves_middle_gives_its_radius_back(radius: float, turn: float) -> None:
    points = [[-1e5, 0.0], [0.0, 0.0], [1e5 * math.cos(turn), 1e5 * math.sin(turn)]]
    (corner,) = tangent_axis(points, [radius], RULE).corners
    assert radius_at_distance(corner.distance, corner.turn, RULE) == pytest.approx(radius, rel=1e-9)


@pytest.mark.parametrize(
    ("points", "radii", "message"),
    [
        ([[0, 0]], [], "two points or more"),
        ([[0, 0], [0.001, 0]], [], "put it elsewhere"),
        ([[0, 0], [100, 0], [200, 50]], [], "one for each inner point is needed: 1"),
        ([[0, 0], [100, 0], [0, 1]], [None], "turns by 179 degrees and has 100.0 m"),
        ([[0, 0], [math.nan, 0]], [], "finite"),
    ],
)
def test_what_cannot_be_rounded_is_refused_with_its_place(points: list, radii: list, message: str) -> None:
    with pytest.raises(InputError, match=message):
        tangent_axis(points, radii, RULE)


def test_snapping_keeps_angles_to_the_tangent_before_and_lengths() -> None:
    last, before = np.array([100.0, 100.0]), np.array([0.0, 0.0])  # a tangent at 45 degrees
    point = snapped_point(np.array([100.0 + 3.0, 100.0 + 57.0]), last, before)
    leg = point - last
    assert math.degrees(math.atan2(leg[1], leg[0])) == pytest.approx(90.0)
    assert np.hypot(*leg) == pytest.approx(60.0)
    near = snapped_point(np.array([100.5, 100.0]), last, before) - last
    assert np.hypot(*near) == pytest.approx(10.0), "never on the point before"
