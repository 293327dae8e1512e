"""Vertical profile: against its definition by tangents and parabolas, numerical integration, and bad input."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.profile import IntersectionPoint, Profile


def hill() -> Profile:
    """+2 %, crest of 10,000 m, -1.5 %, sag of 6,000 m, +1 %, a kink, -0.5 %."""
    points = (
        (100.0, 50.0, 0.0),
        (600.0, 60.0, 10_000.0),
        (1400.0, 48.0, 6_000.0),
        (1900.0, 53.0, 0.0),
        (2300.0, 51.0, 0.0),
    )
    return Profile([IntersectionPoint(*point) for point in points])


def test_grades_tangents_and_breakpoints_by_hand() -> None:
    profile = hill()
    np.testing.assert_allclose(profile.grades, [0.02, 0.02, -0.015, 0.01, -0.005, -0.005], atol=1e-15)
    np.testing.assert_allclose(profile.tangent_lengths, [0.0, 175.0, 75.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(profile.breakpoints, [425.0, 775.0, 1325.0, 1475.0, 1900.0], atol=1e-9)


def test_elevations_by_hand() -> None:
    """On a crest the profile runs T^2 / 2H below the intersection, in a sag above it."""
    profile = hill()
    assert float(profile.elevation(600.0)) == pytest.approx(60.0 - 175.0**2 / 20_000.0, abs=1e-12)
    assert float(profile.elevation(1400.0)) == pytest.approx(48.0 + 75.0**2 / 12_000.0, abs=1e-12)
    at = [-100.0, 100.0, 425.0, 775.0, 1000.0, 1900.0, 2300.0, 3000.0]
    by_hand = [46.0, 50.0, 56.5, 60 - 0.015 * 175, 54.0, 53.0, 51.0, 47.5]
    np.testing.assert_allclose(profile.elevation(at), by_hand, atol=1e-12)
    np.testing.assert_allclose(profile.grade([425.0, 600.0, 775.0]), [0.02, 0.0025, -0.015], atol=1e-12)
    np.testing.assert_allclose(profile.curvature([300, 500, 1000, 1400, 1600]), [0, -1e-4, 0, 1 / 6000, 0], atol=1e-15)


def test_a_kink_has_the_grade_that_follows() -> None:
    profile = hill()
    np.testing.assert_allclose(profile.grade([1900.0 - 1e-9, 1900.0]), [0.01, -0.005], atol=1e-12)


def test_lowest_point_of_a_sag_lies_where_the_grade_changes_sign() -> None:
    profile = Profile([IntersectionPoint(0, 10, 0), IntersectionPoint(500, 0, 8000), IntersectionPoint(1500, 10, 0)])
    s = np.linspace(300.0, 700.0, 400_001)
    lowest = s[np.argmin(profile.elevation(s))]
    assert lowest == pytest.approx(500.0 - 120.0 + 0.02 * 8000.0, abs=2e-3)
    assert float(profile.grade(lowest)) == pytest.approx(0.0, abs=1e-6)


def test_one_point_is_level_and_two_are_a_grade() -> None:
    level = Profile([IntersectionPoint(5.0, 7.0, 300.0)])
    np.testing.assert_array_equal(level.elevation([-1e5, 5.0, 1e5]), [7.0, 7.0, 7.0])
    assert level.breakpoints.size == 0
    slope = Profile([IntersectionPoint(0.0, 0.0, 50.0), IntersectionPoint(10.0, 1.0, 50.0)])
    np.testing.assert_allclose(slope.elevation([-10.0, 0.0, 20.0]), [-1.0, 0.0, 2.0], atol=1e-12)
    assert slope.breakpoints.size == 0


def test_points_in_line_round_nothing() -> None:
    profile = Profile([IntersectionPoint(100.0 * i, 2.0 * i, 5000.0) for i in range(5)])
    np.testing.assert_allclose(profile.elevation(np.arange(-100.0, 600.0)), 0.02 * np.arange(-100.0, 600.0), atol=1e-12)


def test_a_rounding_too_small_to_see_is_a_kink() -> None:
    rows = (0.0, 0.0, 0.0), (100.0, 10.0, 1e-310), (200.0, 0.0, 0.0)
    profile = Profile([IntersectionPoint(*row) for row in rows])
    np.testing.assert_allclose(profile.elevation([50.0, 100.0, 150.0]), [5.0, 10.0, 5.0], atol=1e-12)
    np.testing.assert_array_equal(profile.breakpoints, [100.0])


def test_shapes_follow_the_stations() -> None:
    profile = hill()
    assert np.ndim(profile.elevation(5.0)) == 0
    assert profile.grade(np.zeros((2, 3))).shape == (2, 3)
    assert profile.curvature([]).shape == (0,)


@st.composite
def profiles(draw: st.DrawFn) -> Profile:
    """Valid profiles: each rounding takes at most its half of the way to its neighbours."""
    gaps = draw(st.lists(st.floats(10.0, 900.0), min_size=1, max_size=6))
    station = np.cumsum([draw(st.floats(-500.0, 500.0)), *gaps])
    level = np.array(draw(st.lists(st.floats(-30.0, 30.0), min_size=len(station), max_size=len(station))))
    grade = np.diff(level) / np.diff(station)
    radius = np.zeros(len(station))
    for i in range(1, len(station) - 1):
        room = 0.5 * min(gaps[i - 1], gaps[i])
        change = abs(grade[i] - grade[i - 1])
        radius[i] = draw(st.just(0.0) | st.floats(0.05, 1.0)) * min(2 * room / change, 1e7) if change > 1e-9 else 0.0
    return Profile([IntersectionPoint(*map(float, row)) for row in zip(station, level, radius, strict=True)])


@given(profiles())
@settings(max_examples=80, deadline=None)
def test_curvature_integrates_to_grade_and_grade_to_elevation(profile: Profile) -> None:
    """Between breakpoints, where all three are smooth, by Simpson's rule."""
    ends = [profile.points[0].station - 50.0, *profile.breakpoints, profile.points[-1].station + 50.0]
    for a, b in itertools.pairwise(ends):
        if b - a < 1e-6:
            continue
        s = np.linspace(a + 1e-9 * (b - a), b - 1e-9 * (b - a), 41)
        grade, elevation = profile.grade(s), profile.elevation(s)
        np.testing.assert_allclose(
            grade, grade[0] + cumulative_simpson(profile.curvature(s), x=s, initial=0), atol=1e-9
        )
        np.testing.assert_allclose(elevation, elevation[0] + cumulative_simpson(grade, x=s, initial=0), atol=1e-7)


@given(profiles())
@settings(max_examples=80, deadline=None)
def test_elevation_has_no_steps_and_grade_kinks_only_without_rounding(profile: Profile) -> None:
    s = profile.breakpoints
    np.testing.assert_allclose(profile.elevation(s - 1e-7), profile.elevation(s + 1e-7), atol=1e-5)
    kinks = {
        point.station for point, tangent in zip(profile.points, profile.tangent_lengths, strict=True) if tangent == 0
    }
    rounded = np.array([station for station in s if station not in kinks])
    if rounded.size:
        steepest = np.abs(profile.curvature(np.linspace(s[0], s[-1], 5000))).max(initial=1e-9)
        step = np.abs(profile.grade(rounded - 1e-7) - profile.grade(rounded + 1e-7))
        near = np.array([min(abs(r - k) for k in kinks) if kinks else 1.0 for r in rounded])
        assert (step[near > 1e-6] <= 10 * steepest * 1e-6 + 1e-9).all()


@given(profiles())
@settings(max_examples=60, deadline=None)
def test_driven_backwards_it_is_the_same_road(profile: Profile) -> None:
    turned = Profile([IntersectionPoint(-p.station, p.elevation, p.radius) for p in reversed(profile.points)])
    s = np.linspace(profile.points[0].station - 20.0, profile.points[-1].station + 20.0, 300)
    np.testing.assert_allclose(turned.elevation(-s), profile.elevation(s), atol=1e-8)


@given(profiles(), st.floats(-1e5, 1e5), st.floats(-500.0, 500.0))
@settings(max_examples=60, deadline=None)
def test_moving_all_points_moves_the_profile(profile: Profile, along: float, up: float) -> None:
    moved = Profile([IntersectionPoint(p.station + along, p.elevation + up, p.radius * 0.999) for p in profile.points])
    still = Profile([IntersectionPoint(p.station, p.elevation, p.radius * 0.999) for p in profile.points])
    s = np.linspace(profile.points[0].station - 20.0, profile.points[-1].station + 20.0, 200)
    np.testing.assert_allclose(moved.elevation(s + along), still.elevation(s) + up, atol=1e-7)


def test_touching_roundings_are_allowed_and_overlapping_ones_are_not() -> None:
    """Grades 2 %, -2 %, 2 %: with H = 5000 m both tangents are 100 m, together the distance."""

    def wave(radius: float) -> Profile:
        rows = (0.0, 0.0, 0.0), (200.0, 4.0, 5000.0), (400.0, 0.0, radius), (600.0, 4.0, 0.0)
        return Profile([IntersectionPoint(*row) for row in rows])

    touching = wave(5000.0)
    assert float(touching.grade(300.0)) == pytest.approx(-0.02, abs=1e-12)
    assert wave(5000.0 + 1e-8) is not None
    with pytest.raises(InputError, match=r"profile\.points\[2\]\.radius is 5001\.0.*points 1 and 2 need 200\.02 m"):
        wave(5001.0)


def test_a_rounding_may_reach_beyond_the_first_point_only_by_right() -> None:
    """The first point has no rounding, so a tangent longer than the way to it overlaps."""
    rows = (0.0, 0.0), (50.0, 2.0), (500.0, 0.0)
    with pytest.raises(InputError, match="radius"):
        Profile([IntersectionPoint(s, z, 5000.0) for s, z in rows])


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: IntersectionPoint(NAN, 0.0), r"intersection_point\.station"),
        (lambda: IntersectionPoint(0.0, INF), r"intersection_point\.elevation"),
        (lambda: IntersectionPoint(0.0, 0.0, NAN), r"intersection_point\.radius"),
        (lambda: IntersectionPoint(0.0, 0.0, -1.0), r"intersection_point\.radius"),
        (lambda: Profile([]), r"profile\.points"),
        (lambda: Profile([IntersectionPoint(1.0, 0.0), IntersectionPoint(1.0, 1.0)]), r"profile\.points\[1\]\.station"),
        (
            lambda: Profile([IntersectionPoint(0.0, 0.0), IntersectionPoint(2.0, 0.0), IntersectionPoint(1.0, 0.0)]),
            r"profile\.points\[2\]\.station is 1\.0: stations must increase",
        ),
        (lambda: hill().elevation([0.0, NAN]), r"station\[1\]"),
        (lambda: hill().grade(INF), "station"),
        (lambda: hill().curvature("here"), "station"),
    ],
)
def test_bad_input_is_refused_by_name(make: object, named: str) -> None:
    with pytest.raises(InputError, match=f"^{named}"):
        make()  # type: ignore[operator]
