"""Fitting a measured axis: known elements are found again, real axes are followed, bad files are refused."""

from __future__ import annotations

import functools
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.fitting import fit as fit_module
from synthroads_addon.fitting.chain import FREE, ZERO, Chain, ChainFit, Heights, Plan
from synthroads_addon.fitting.fit import (
    REFUSED_BEYOND,
    AxisFit,
    AxisRefusedError,
    _is_exact,
    _trim_ends,
    fit_axis,
)
from synthroads_addon.fitting.plot import axis_picture
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.road.axes.centerline import read_axis
from synthroads_addon.road.profile import IntersectionPoint, Profile
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.relative_speed import quiet_seconds

REAL = sorted((Path(__file__).resolve().parents[2].parent / "shared" / "real").glob("*_axis.csv"))

LINE = [(400.0, 0.0, 0.0)]
BEND = [(200.0, 0.0, 0.0), (100.0, 0.0, 1 / 900), (300.0, 1 / 900, 1 / 900), (100.0, 1 / 900, 0.0), (250.0, 0.0, 0.0)]
S_CURVE = [
    (150.0, 0.0, 0.0),
    (80.0, 0.0, 1 / 500),
    (150.0, 1 / 500, 1 / 500),
    (80.0, 1 / 500, 0.0),
    (100.0, 0.0, -1 / 700),
    (200.0, -1 / 700, -1 / 700),
    (100.0, -1 / 700, 0.0),
    (150.0, 0.0, 0.0),
]
EGG = [
    (120.0, 1 / 600, 1 / 600),
    (60.0, 1 / 600, 1 / 250),
    (150.0, 1 / 250, 1 / 250),
    (70.0, 1 / 250, 0.0),
    (90.0, 0.0, 0.0),
]
RAMP = [(40.0, 0.0, 0.0), (30.0, 0.0, 1 / 45), (110.0, 1 / 45, 1 / 45), (30.0, 1 / 45, 0.0), (60.0, 0.0, 0.0)]
ROADS = {"line": LINE, "bend": BEND, "s-curve": S_CURVE, "egg": EGG, "ramp": RAMP}


def road(rows: list[tuple[float, float, float]], x: float = 0.0, y: float = 0.0, heading: float = 0.4) -> Alignment:
    return Alignment([Element(*row) for row in rows], x, y, heading)


def sampled(alignment: Alignment, step: float = 1.0, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Points (N, 2) along the alignment, its very end included, with white lateral noise."""
    s = np.append(np.arange(0.0, alignment.length, step), alignment.length)
    position, heading, _ = alignment.frame(s)
    lateral = np.random.default_rng(seed).normal(0.0, 1.0, s.size) * noise
    return position + lateral[:, None] * np.column_stack((-np.sin(heading), np.cos(heading)))


@functools.cache
def fitted(name: str, noise: float = 0.0, seed: int = 0) -> AxisFit:
    """Return the fit to points every metre along one of `ROADS`."""
    return fit_axis(sampled(road(ROADS[name]), noise=noise, seed=seed))


def kinds(alignment: Alignment) -> list[str]:
    return [element.kind for element in alignment.elements]


def differences(found: Alignment, truth: Alignment) -> tuple[float, float]:
    """Largest difference of lengths (m) and of curvatures (1/m) of alignments with the same number of elements."""
    pairs = list(zip(found.elements, truth.elements, strict=True))
    length = max(abs(a.length - b.length) for a, b in pairs)
    start = max(abs(a.curvature_start - b.curvature_start) for a, b in pairs)
    return length, max(start, *(abs(a.curvature_end - b.curvature_end) for a, b in pairs))


def off_road(found: Alignment, truth: Alignment) -> float:
    """Largest distance of the found alignment from the true one, m."""
    s = np.linspace(0.0, found.length, 2000)
    return float(np.abs(truth.project(found.position(s))[1]).max())


@pytest.mark.parametrize("name", ROADS)
def test_exact_points_give_the_elements_back(name: str) -> None:
    truth, fit = road(ROADS[name]), fitted(name)
    assert kinds(fit.alignment) == kinds(truth)
    length, curvature = differences(fit.alignment, truth)
    assert length < 1e-4
    assert curvature < 1e-8
    assert fit.horizontal.worst < 1e-6


@pytest.mark.parametrize("step", [pytest.param(0.5, marks=pytest.mark.slow), 2.0, 5.0])
def test_the_spacing_of_the_points_makes_no_difference(step: float) -> None:
    truth = road(BEND)
    fit = fit_axis(sampled(truth, step))
    assert kinds(fit.alignment) == kinds(truth)
    assert differences(fit.alignment, truth)[0] < 1e-3


def test_coordinates_rounded_to_a_millimetre_give_the_elements_back() -> None:
    truth = road(S_CURVE)
    fit = fit_axis(np.round(sampled(truth), 3))
    assert kinds(fit.alignment) == kinds(truth)
    length, curvature = differences(fit.alignment, truth)
    assert length < 0.1
    assert curvature < 1e-6
    assert 1e-4 < fit.horizontal.rms < 4e-4


@pytest.mark.parametrize("name", ["line", "bend", "s-curve"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_noise_of_2_cm_leaves_the_kinds_and_nearly_the_lengths(name: str, seed: int) -> None:
    truth, fit = road(ROADS[name]), fitted(name, 0.02, seed)
    assert kinds(fit.alignment) == kinds(truth)
    length, curvature = differences(fit.alignment, truth)
    assert length < 8.0
    assert curvature < 1e-4  # where two clothoids meet in the S; arcs are much better known:
    arcs = [(a, b) for a, b in zip(fit.alignment.elements, truth.elements, strict=True) if b.kind == "arc"]
    assert all(a.mean_curvature == pytest.approx(b.mean_curvature, rel=0.005) for a, b in arcs)
    assert 0.017 < fit.horizontal.rms < 0.022
    assert off_road(fit.alignment, truth) < 0.02


def test_at_map_coordinates_the_same_elements_are_found() -> None:
    """At 5.6e6 m, and the alignment lies where the points are."""
    there = road(BEND, 356_789.123, 5_612_345.678)
    near, far = fitted("bend", 0.02), fit_axis(sampled(there, noise=0.02))
    assert kinds(near.alignment) == kinds(far.alignment)
    assert differences(near.alignment, far.alignment)[0] < 0.1
    assert off_road(far.alignment, there) < 0.02
    exact = fit_axis(sampled(there))
    assert kinds(exact.alignment) == kinds(there)
    assert differences(exact.alignment, there)[0] < 1e-3


def test_turned_and_mirrored_points_give_the_turned_and_mirrored_fit() -> None:
    points = sampled(road(BEND), noise=0.02)
    plain, mirrored = fitted("bend", 0.02), fit_axis(points * [1.0, -1.0])
    c, s = np.cos(2.0), np.sin(2.0)
    turned = fit_axis(points @ np.array([[c, s], [-s, c]]))
    for other, sign in ((turned, 1.0), (mirrored, -1.0)):
        assert kinds(other.alignment) == kinds(plain.alignment)
        for a, b in zip(other.alignment.elements, plain.alignment.elements, strict=True):
            assert a.length == pytest.approx(b.length, abs=0.05)
            assert a.curvature_end == pytest.approx(sign * b.curvature_end, abs=1e-7)
    assert turned.alignment.start_heading - plain.alignment.start_heading == pytest.approx(2.0, abs=1e-5)


def test_a_second_run_gives_the_same_bytes() -> None:
    first, second = fitted("bend", 0.02), fit_axis(sampled(road(BEND), noise=0.02))
    assert first.alignment.elements == second.alignment.elements
    assert first.profile.points == second.profile.points
    assert (first.horizontal.rms, first.horizontal.worst) == (second.horizontal.rms, second.horizontal.worst)


def test_figures_are_those_of_the_points_given() -> None:
    truth = road(BEND)
    points = sampled(truth, noise=0.02)
    points[500] += [0.3, -0.9]  # one point far off
    fit = fit_axis(np.column_stack((points, np.zeros(len(points)))))
    station, offset = fit.alignment.project(points)
    assert fit.points == len(points)
    assert fit.horizontal.rms == pytest.approx(np.sqrt((offset**2).mean()), rel=1e-6)
    assert fit.horizontal.p95 == pytest.approx(np.percentile(np.abs(offset), 95), rel=1e-6)
    assert fit.horizontal.worst == pytest.approx(np.abs(offset).max(), rel=1e-6)
    assert fit.horizontal.worst == pytest.approx(0.95, abs=0.1)
    assert fit.horizontal.worst_station == pytest.approx(station[500], abs=1e-6)
    assert fit.horizontal.worst_station == pytest.approx(500.0, abs=1.5)


def test_the_alignment_begins_and_ends_with_the_points() -> None:
    for name, noise in (("egg", 0.0), ("bend", 0.02)):
        points, fit = sampled(road(ROADS[name]), noise=noise), fitted(name, noise)
        station, _ = fit.alignment.project(points[[0, -1]])
        np.testing.assert_allclose(station, [0.0, fit.alignment.length], atol=1e-4)


def test_gaps_are_bridged_by_the_curve_and_not_by_its_chord() -> None:
    """55 m missing within the arc of 300 m, whose chord lies 1.26 m off it."""
    truth = road([(100.0, 0.0, 0.0), (90.0, 0.0, 1 / 300), (200.0, 1 / 300, 1 / 300), (80.0, 1 / 300, 0.0)])
    points = sampled(truth, noise=0.01)
    points = np.delete(points, np.arange(250, 305), axis=0)
    assert off_road(fit_axis(points).alignment, truth) < 0.05


def test_jumps_between_blocks_of_chords_stay_within_the_tolerance() -> None:
    """Built as measured axes are: straight blocks of some 10 m with a lateral jump of centimetres between them."""
    truth, rng = road(S_CURVE), np.random.default_rng(4)
    ends = np.arange(0.0, truth.length, 11.0)
    position, heading, _ = truth.frame(ends)
    normal = np.column_stack((-np.sin(heading), np.cos(heading)))
    shares = np.arange(11)[:, None] / 11
    blocks = [
        a + shares * (b - a) + rng.normal(0.0, 0.03) * n
        for a, b, n in zip(position[:-1], position[1:], normal, strict=False)
    ]
    fit = fit_axis(np.vstack(blocks))
    assert fit.horizontal.rms <= 0.05
    assert fit.horizontal.p95 <= 0.10
    assert len(fit.alignment.elements) <= len(S_CURVE)
    assert off_road(fit.alignment, truth) < 0.12


def test_noise_beyond_the_tolerance_is_reported_and_not_followed() -> None:
    points = np.column_stack((np.arange(600.0), np.random.default_rng(2).normal(0.0, 0.08, 600)))
    fit = fit_axis(points)
    assert kinds(fit.alignment) in (["line"], ["arc"])
    assert 0.075 < fit.horizontal.rms < 0.085


def test_a_wider_tolerance_needs_no_more_elements() -> None:
    s = np.arange(0.0, 600.0, 2.0)
    points = np.column_stack((s, 20.0 * np.sin(s / 150.0) + np.random.default_rng(1).normal(0.0, 0.01, s.size)))
    counts = []
    for tolerance in (0.02, 0.1, 0.5, 50.0):
        fit = fit_axis(points, tolerance)
        assert fit.horizontal.rms <= tolerance
        assert fit.horizontal.p95 <= 2 * tolerance
        counts.append(len(fit.alignment.elements))
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[2] > counts[3] == 1


@pytest.mark.parametrize(("height", "width"), [pytest.param(30.0, 100.0, marks=pytest.mark.slow), (0.3, 60.0)])
def test_a_smooth_curve_is_not_taken_for_a_chain_of_many_elements(height: float, width: float) -> None:
    """Points on a sinusoid have no noise, but no elements of their own either."""
    s = np.arange(0.0, 320.0)
    fit = fit_axis(np.column_stack((s, height * np.sin(s / width))))
    assert len(fit.alignment.elements) <= 4
    assert fit.horizontal.rms <= 0.05


def test_what_counts_as_exact() -> None:
    """Nothing, a smooth micrometre, or random residuals of coordinates rounded to a millimetre; not a smooth tenth."""
    chain = Chain(np.zeros(3), np.array([0.0, 1.0]), np.zeros(2), np.array([ZERO]))
    smooth, random = np.sin(np.linspace(0.0, 20.0, 900)), np.random.default_rng(1).uniform(-0.5e-3, 0.5e-3, 900)
    for residuals, exact in ((1e-7 * smooth, True), (random, True), (2e-4 * smooth, False), (10 * random, False)):
        assert _is_exact(ChainFit(Heights(residuals, residuals, residuals), chain, np.zeros(900), residuals)) is exact


def test_a_corner_is_rounded_and_its_straights_stay_straight() -> None:
    """No chain of elements follows a right angle; finer and finer knots must not be tried in vain."""
    s = np.arange(100.0)[:, None]
    fit = fit_axis(np.vstack((s * [1.0, 0.0], [100.0, 0.0] + s * [0.0, 1.0])))
    assert len(fit.alignment.elements) <= 6
    assert kinds(fit.alignment)[0] == kinds(fit.alignment)[-1] == "line"
    assert fit.horizontal.p95 < 0.5
    assert fit.horizontal.worst_station == pytest.approx(99.0, abs=3.0)


def test_ends_are_cut_and_prolonged_along_their_clothoids() -> None:
    """From 0.5 m before the chain to 0.7 m beyond it, and the other way round, on the same curve."""
    whole = road([(120.0, 0.002, 0.01), (90.0, 0.01, -0.004)], 3.0, 4.0, 0.5)
    for first, last in ((-0.5, 200.7), (0.5, 199.3)):
        chain = Chain(
            np.append(whole.position(5.0), whole.heading(5.0)),
            np.array([0.0, 115.0, 200.0]),
            whole.curvature(np.array([5.0, 120.0, 205.0])),
            np.full(2, FREE),
        )
        cut = _trim_ends(chain, first, last)
        s = np.linspace(0.0, cut.length, 50)
        assert cut.length == pytest.approx(last - first)
        np.testing.assert_allclose(cut.position(s), whole.position(s + 5.0 + first), atol=1e-6)
        np.testing.assert_allclose(cut.curvature(s), whole.curvature(s + 5.0 + first), atol=1e-12)


def test_dense_curves_between_sparse_straights() -> None:
    """Vertices as design programs write them: many on the arc, none on straights of 500 m."""
    truth = road([(500.0, 0.0, 0.0), (157.0, 1 / 100, 1 / 100), (500.0, 0.0, 0.0)], heading=0.0)
    s = np.concatenate(([0.0], np.arange(500.0, 657.0, 2.0), [657.0, 1157.0]))
    fit = fit_axis(truth.position(s))
    assert fit.horizontal.worst < 0.05
    assert off_road(fit.alignment, truth) < 0.3
    assert fit.alignment.length == pytest.approx(truth.length, abs=0.2)


def test_a_few_coarse_points_give_a_smooth_road_through_them() -> None:
    truth = road([(1000.0, 0.0, 1 / 800), (1000.0, 1 / 800, 0.0), (1000.0, 0.0, -1 / 900)])
    fit = fit_axis(sampled(truth, 60.0))
    assert fit.horizontal.rms < 0.05
    assert off_road(fit.alignment, truth) < 0.1


def test_several_turns_above_each_other() -> None:
    """A helix: every point has its own height, three turns over the same ground."""
    turn = np.linspace(0.0, 6 * np.pi, 900)
    points = np.column_stack((50 * np.cos(turn), 50 * np.sin(turn), 3.0 * turn / np.pi))
    fit = fit_axis(points)
    assert kinds(fit.alignment) == ["arc"]
    assert fit.alignment.length == pytest.approx(50 * 6 * np.pi, abs=0.01)
    assert fit.height.worst < 1e-3


@pytest.mark.parametrize("noise", [0.0, pytest.param(0.02, marks=pytest.mark.slow)])
def test_windows_of_a_long_road_join_without_a_seam(noise: float) -> None:
    """4.6 km, several windows, a straight and an arc longer than one of them."""
    rows = [(1900.0, 0.0, 0.0), (120.0, 0.0, 1 / 2000), (1700.0, 1 / 2000, 1 / 2000), (120.0, 1 / 2000, 0.0)]
    rows += [(90.0, 0.0, -1 / 600), (300.0, -1 / 600, -1 / 600), (90.0, -1 / 600, 0.0), (300.0, 0.0, 0.0)]
    truth = road(rows, 3e5, 5.6e6)
    fit = fit_axis(sampled(truth, 2.0, noise))
    if not noise:
        assert kinds(fit.alignment) == kinds(truth)
        assert differences(fit.alignment, truth)[0] < 1e-2
    assert fit.horizontal.rms < max(1e-4, 1.1 * noise)
    assert off_road(fit.alignment, truth) < max(1e-3, 2.5 * noise)
    assert len(fit.alignment.elements) <= len(rows) + 2
    ends = fit.alignment.element_starts[1:-1]
    np.testing.assert_allclose(fit.alignment.curvature(ends - 1e-6), fit.alignment.curvature(ends), atol=1e-8)


def test_the_profile_finds_its_parabolas_again() -> None:
    rows = (0.0, 80.0, 0.0), (250.0, 85.0, 6000.0), (600.0, 76.0, 4000.0), (900.0, 79.0, 0.0)
    truth = Profile([IntersectionPoint(*row) for row in rows])
    alignment = road(BEND)
    s = np.arange(0.0, 900.5, 1.0)
    fit = fit_axis(np.column_stack((alignment.position(s), truth.elevation(s))))
    assert len(fit.profile.points) == 4
    for found, point in zip(fit.profile.points, truth.points, strict=True):
        assert found.station == pytest.approx(point.station, abs=0.01)
        assert found.elevation == pytest.approx(point.elevation, abs=1e-3)
        assert found.radius == pytest.approx(point.radius, rel=1e-3)
    assert fit.height.worst < 1e-4


def test_noisy_heights_give_few_parabolas_within_the_noise() -> None:
    rows = (0.0, 80.0, 0.0), (300.0, 88.0, 8000.0), (900.0, 70.0, 0.0)
    truth = Profile([IntersectionPoint(*row) for row in rows])
    s = np.arange(0.0, 900.5, 1.0)
    noisy = truth.elevation(s) + np.random.default_rng(3).normal(0.0, 0.02, s.size)
    fit = fit_axis(np.column_stack((road(BEND).position(s), noisy)))
    assert len(fit.profile.points) <= 5
    assert fit.height.rms < 0.023
    assert np.abs(fit.profile.elevation(s) - truth.elevation(s)).max() < 0.03
    assert fit.height.worst_station == pytest.approx(s[np.abs(fit.profile.elevation(s) - noisy).argmax()], abs=0.5)


def test_two_points_and_duplicates() -> None:
    fit = fit_axis([[3.0, 4.0, 1.0], [3.0, 4.0, 1.0], [6.0, 8.0, 2.0], [6.0, 8.0, 2.0]])
    assert kinds(fit.alignment) == ["line"]
    assert (fit.points, fit.alignment.length) == (2, pytest.approx(5.0))
    np.testing.assert_allclose(fit.alignment.position([0.0, 5.0]), [[3.0, 4.0], [6.0, 8.0]], atol=1e-9)
    np.testing.assert_allclose(fit.profile.elevation([0.0, 5.0]), [1.0, 2.0], atol=1e-9)
    points = sampled(road(BEND))
    doubled = fit_axis(np.repeat(points, 2, axis=0))
    assert doubled.points == len(points)
    assert kinds(doubled.alignment) == kinds(road(BEND))


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0], [100, 0], [100, 100]],
        [[0, 0], [100, 0], [0, 0], [100, 0]],
        np.random.default_rng(1).normal(0.0, 1.0, (60, 3)).cumsum(axis=0),
        [[0, 0, 0], [0.001, 0, 0]],
        [[0, 0, 0], [1e5, 1, 0]],
    ],
    ids=["corner", "back and forth", "random walk", "1 mm", "100 km"],
)
def test_points_that_are_no_road_end_in_an_honest_report(points: object) -> None:
    fit = fit_axis(points)  # type: ignore[arg-type]
    assert np.isfinite(
        [fit.horizontal.rms, fit.horizontal.p95, fit.horizontal.worst, fit.height.rms, fit.alignment.length]
    ).all()
    assert fit.horizontal.rms <= fit.horizontal.worst
    plan = np.asarray(points, dtype=float)[:, :2]
    nearest = np.abs(fit.alignment.project(plan)[1])
    assert fit.horizontal.worst >= nearest.max() - 1e-6


def check_jacobian(data: Plan | Heights, chain: Chain, stations: np.ndarray, tolerance: float) -> None:
    """Central differences of the residuals by every parameter."""
    matrix = data.jacobian(chain, stations)
    for column in range(matrix.shape[1]):
        value = chain.pose_size <= column < chain.value_columns.stop
        size = 1e-7 if value and isinstance(data, Plan) else 1e-4
        results = []
        for sign in (1.0, -1.0):
            step = np.zeros(matrix.shape[1])
            step[column] = sign * size
            knots = chain.knots.copy()
            knots[1:-1] += step[chain.value_columns.stop :]
            moved = Chain(
                data.move_pose(chain.pose, step[: chain.pose_size]),
                knots,
                chain.values + step[chain.value_columns],
                chain.kinds,
            )
            results.append(data.measure(moved, stations)[1])
        numeric = (results[0] - results[1]) / (2 * size)
        scale = np.abs(numeric).max()
        assert scale > 0
        assert np.abs(numeric - matrix[:, column]).max() < tolerance * scale


def test_derivatives_by_differences() -> None:
    knots = np.array([0.0, 60.0, 130.0, 190.0, 300.0])
    values = np.array([0.0, 0.008, 0.008, -0.004, 0.001])
    plan = Chain(np.array([5.0, 6.0, 0.7]), knots, values, np.full(4, FREE))
    s = np.linspace(2.0, 298.0, 75)
    position, heading, _ = plan.alignment.frame(s)
    points = position + 0.3 * np.sin(s)[:, None] * np.column_stack((-np.sin(heading), np.cos(heading)))
    check_jacobian(Plan(points, np.full(75, 0.5), 5.0, 40.0), plan, s, 5e-3)
    profile = Chain(np.array([80.0]), knots, 5 * values, np.full(4, FREE))
    check_jacobian(Heights(80 + np.sin(s), np.full(75, 0.5), s, 5.0), profile, s, 1e-3)


@functools.cache
def real_fit(path: Path) -> AxisFit:
    axis, fits = read_axis(path), []
    seconds = quiet_seconds(lambda: fits.append(fit_axis(axis)))
    fit = fits[0]
    plane, height = fit.horizontal, fit.height
    print(
        f"{path.stem}: {fit.alignment.length:.0f} m, {len(fit.alignment.elements)} elements, rms {plane.rms:.4f}"
        f" p95 {plane.p95:.4f} worst {plane.worst:.3f} m at {plane.worst_station:.0f} m; heights rms {height.rms:.4f}"
        f" p95 {height.p95:.4f} worst {height.worst:.3f} m; {seconds:.1f} s"
    )
    # 3 to 8 s per kilometre of a quiet core; many times that where BLAS's threads wait for a shared one: this only
    # tells a search that doesn't end.
    assert seconds < 150.0 * max(1.0, fit.alignment.length / 1000.0)
    return fit


@pytest.mark.skipif(not REAL, reason="no real axes beside the repository")
@pytest.mark.parametrize(
    "path",
    [pytest.param(path, id=path.stem, marks=() if "dual6lane" in path.stem else pytest.mark.slow) for path in REAL],
)
class TestRealAxes:
    def test_follows_within_the_tolerance_with_few_elements(self, path: Path) -> None:
        fit = real_fit(path)
        assert fit.horizontal.rms <= 0.05
        assert fit.horizontal.p95 <= 0.10
        assert len(fit.alignment.elements) < fit.alignment.length / 30.0
        assert fit.height.rms < 0.04
        assert fit.height.p95 < 0.08

    def test_curvature_is_continuous(self, path: Path) -> None:
        elements = real_fit(path).alignment.elements
        steps = [abs(a.curvature_end - b.curvature_start) for a, b in itertools.pairwise(elements)]
        assert max(steps, default=0.0) < 1e-12

    def test_a_second_pass_finds_the_elements_again(self, path: Path) -> None:
        fit = real_fit(path)
        alignment = fit.alignment
        s = np.append(np.arange(0.0, alignment.length, 1.0), alignment.length)
        again = fit_axis(np.column_stack((alignment.position(s), fit.profile.elevation(s))))
        assert kinds(again.alignment) == kinds(alignment)
        length, curvature = differences(again.alignment, alignment)
        assert length < 0.01
        assert curvature < 1e-6
        assert len(again.profile.points) == len(fit.profile.points)
        for a, b in zip(again.profile.points, fit.profile.points, strict=True):
            assert a.station == pytest.approx(b.station, abs=0.1)
            assert a.elevation == pytest.approx(b.elevation, abs=0.002)


POINTS = np.array([[0.0, 0.0, 10.0], [50.0, 1.0, 11.0], [100.0, 4.0, 12.5]])
ROWS = POINTS.tolist()


@pytest.mark.parametrize(
    "text",
    [
        "s,x,y,z,tile\n0,0,0,10,1\n50,50,1,11,1\n100,100,4,12.5,2\n",
        "Z;Y;X\n10;0;0\n11;1;50\n12.5;4;100\n",
        "0,0,10\n50,1,11\n100,4,12.5\n",
        "\ufeffx\ty\tz\n0\t0\t10\n\n50\t1\t11\n100\t4\t12.5",
        "# measured\n0 0 10\n 50  1 11\n100 4 12.5\n",
        '"x","y","z"\n"0","0","10"\n5e1,1,11\n100,4,12.5\n',
        json.dumps({"type": "LineString", "coordinates": ROWS}),
        json.dumps({"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": ROWS}}),
        json.dumps(
            {
                "type": "FeatureCollection",
                "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}},
                "features": [
                    {"type": "Feature", "geometry": {"type": "Point", "coordinates": [0, 0]}},
                    {"type": "Feature", "geometry": {"type": "LineString", "coordinates": ROWS}},
                ],
            }
        ),
    ],
    ids=["header", "any order", "bare", "tabs", "spaces", "quotes", "line", "feature", "collection"],
)
def test_files_that_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "axis.dat"
    path.write_text(text, encoding="utf-8")
    np.testing.assert_array_equal(read_axis(path), POINTS)


@pytest.mark.parametrize("text", ["x,y\n0,0\n50,1\n100,4\n", "0,0\n50,1\n100,4\n"])
def test_without_elevations_they_are_zero(tmp_path: Path, text: str) -> None:
    (tmp_path / "axis.csv").write_text(text)
    np.testing.assert_array_equal(read_axis(tmp_path / "axis.csv"), POINTS * [1.0, 1.0, 0.0])
    flat = tmp_path / "axis.geojson"
    flat.write_text(json.dumps({"type": "LineString", "coordinates": POINTS[:, :2].tolist()}))
    np.testing.assert_array_equal(read_axis(flat), POINTS * [1.0, 1.0, 0.0])


def geojson(coordinates: object, kind: str = "LineString", **more: object) -> str:
    return json.dumps({"type": kind, "coordinates": coordinates, **more})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"axis\.csv: .*empty"),
        ("\n\n# nothing\n", r"axis\.csv: .*empty"),
        ("x,y,z\n", r"axis\.csv: .*two distinct points"),
        ("x,y,z\n1,2,3\n", r"axis\.csv: .*two distinct points are needed, the file has 1 "),
        ("1,2,3\n1,2,3\n1,2,4\n", r"axis\.csv: .*two distinct points are needed, the file has 3 "),
        ("east,north\n1,2\n3,4\n", r"axis\.csv:1 is 'east, north': .*x is missing"),
        ("x,z\n1,2\n3,4\n", r"axis\.csv:1 .*y is missing"),
        ("x,y,x\n1,2,3\n3,4,5\n", r"axis\.csv:1 .*x is there 2 times"),
        ("x,y,z\n1,2,3\n4,five,6\n", r"axis\.csv:3 y is 'five': a finite number"),
        ("x,y,z\n1,2,3\n4,nan,6\n", r"axis\.csv:3 y is 'nan': a finite number"),
        ("x,y,z\n1,2,3\n4,5,inf\n", r"axis\.csv:3 z is 'inf': a finite number"),
        ("x,y,z\n1,2,3\n4,5\n", r"axis\.csv:3 .*at least 3 columns are needed, this line has 2"),
        ("x,y,z\n1,2,3\n4,,6\n", r"axis\.csv:3 y is ''"),
        ("1\n2\n", r"axis\.csv:1 .*x, y and, optionally, z"),
        ("{not json", r"axis\.csv:1: valid JSON"),
        ("[1, 2]", r"axis\.csv type: GeoJSON with a LineString"),
        ('{"type": "Topology"}', r"axis\.csv type is 'Topology': GeoJSON"),
        ('{"type": "FeatureCollection", "features": []}', r"axis\.csv is 0: exactly one LineString"),
        ('{"type": "LineString"}', r"axis\.csv coordinates.*list of positions"),
        (geojson([[[0, 0], [9, 9]]], "MultiLineString"), r"axis\.csv type is 'MultiLineString'"),
        (geojson([]), r"axis\.csv: at least two distinct points"),
        (geojson([[300, 0]]), r"axis\.csv: at least two distinct points"),
        (geojson([[300, 0], [300, "a"]]), r"axis\.csv coordinates\[1\] y is 'a'"),
        (geojson([[300, 0], [300, True]]), r"axis\.csv coordinates\[1\] y is True"),
        (geojson([[300, 0], [300, float("nan")]]), r"axis\.csv coordinates\[1\] y is nan"),
        (geojson([[300, 0], [300]]), r"axis\.csv coordinates\[1\] is \[300\]: a list of two or three"),
        (geojson([[300, 0], 5]), r"axis\.csv coordinates\[1\] is 5"),
        (geojson([[6.1, 50.7], [6.2, 50.8]]), r"axis\.csv coordinates .*metres of a projected system"),
        ("x,y\n6.1,50.7\n6.2,50.8\n", r"axis\.csv coordinates is \[6\.1, 50\.7\]: metres of a projected system"),
        (geojson([[0, 0], [90, 9]], crs={"properties": {"name": "EPSG:4326"}}), r"metres of a projected system"),
    ],
)
def test_bad_files_are_refused_with_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "axis.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_axis(path)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.csv: must be a readable axis file"):
        read_axis(tmp_path / "none.csv")
    with pytest.raises(MissingFileError):
        read_axis(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x80" * 9)
    with pytest.raises(InputError, match=r"binary\.csv: this is no text"):
        read_axis(str(tmp_path / "binary.csv"))


@pytest.mark.parametrize(
    ("points", "tolerance", "message"),
    [
        ([], 0.05, "^points"),
        ([[1.0, 2.0, 3.0]], 0.05, "^points is 1: at least two distinct points"),
        ([[1.0, 2.0, 3.0]] * 5, 0.05, "^points is 1: at least two distinct points"),
        ([[1.0], [2.0]], 0.05, r"^points is \(2, 1\): an array of shape"),
        ([[0, 0, 0], [1, float("nan"), 0]], 0.05, r"^points\[1\]\[1\] is nan: a finite number"),
        ([[0, 0, 0], [1, 0, float("inf")]], 0.05, r"^points\[1\]\[2\] is inf"),
        ([["a", 0, 0], [1, 0, 0]], 0.05, "^points"),
        (ROWS, 0.0, "^tolerance is 0.0: a finite length above 0 m"),
        (ROWS, float("nan"), "^tolerance is nan"),
    ],
)
def test_bad_points_are_refused_by_name(points: object, tolerance: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit_axis(points, tolerance)  # type: ignore[arg-type]


def test_a_fit_that_leaves_its_points_is_refused(tmp_path: Path) -> None:
    """Points out of their order: no road goes that way."""
    along = np.arange(0.0, 200.0, 5.0)
    parts = [np.column_stack([along + begin, 0.0 * along, 0.0 * along]) for begin in (0.0, 400.0, 200.0)]
    path = tmp_path / "axis.csv"
    np.savetxt(path, np.vstack(parts), delimiter=",", header="x,y,z", comments="")
    with pytest.raises(
        AxisRefusedError, match=r"axis axis\.csv: no road follows its points within 2 m, .* 40 times"
    ) as e:
        axis_from_file(path, RoadScenario(), 1)
    fit = e.value.fit
    assert max(fit.horizontal.worst, fit.height.worst) > fit.limit == 2.0
    assert f"at station {fit.horizontal.worst_station:.1f} m" in str(e.value)
    assert np.abs(fit.across).max() == pytest.approx(fit.horizontal.worst)
    assert np.abs(fit.above).max() == pytest.approx(fit.height.worst)
    picture = axis_picture(fit, "axis.csv")
    color = np.asarray(picture).astype(int)
    red = color[..., 0] > color[..., 1:3].max(axis=-1) + 50  # lines are smooth: few pixels have their very colour
    assert red.sum() > 100  # limits, and rings around the worst places
    picture.save(tmp_path / "fit.png")


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=pytest.mark.slow if "rural2lane_t000" in path.stem else ())
        for path in REAL
    ],
)
def test_real_axes_are_far_from_being_refused(path: Path) -> None:
    _, _, report = axis_from_file(path, RoadScenario(), 1)
    assert max(report["horizontal"]["worst"], report["height"]["worst"]) < 0.2 * REFUSED_BEYOND * 0.05


def offset_points(alignment: Alignment, sigma: float, seed: int) -> np.ndarray:
    """Return points each 5 m along an alignment, beside it by noise, m."""
    station = np.arange(2.5, alignment.length, 5.0)
    position, heading, _ = alignment.frame(station)
    beside = np.random.default_rng(seed).normal(0.0, sigma, len(station))
    return position + beside[:, None] * np.column_stack([-np.sin(heading), np.cos(heading)])


@pytest.mark.parametrize("seed", range(4))
def test_noise_as_large_as_the_tolerance_is_worth_no_element(seed: int) -> None:
    arc = Alignment([Element(400.0, 1.0 / 800.0, 1.0 / 800.0)])
    fit = fit_axis(offset_points(arc, 0.032, seed), 0.03)
    assert len(fit.alignment.elements) == 1


@pytest.mark.parametrize("seed", range(3))
def test_an_alignment_that_is_designed_ends_on_arcs_or_lines(seed: int) -> None:
    elements = [Element(25.0, 0.0, 0.0), Element(180.0, 0.0, 1.0 / 900.0), Element(30.0, 1.0 / 900.0, 1.0 / 900.0)]
    points = offset_points(Alignment(elements), 0.004, seed)
    designed = fit_axis(points, 0.03, design_ends=True).alignment.elements
    bends = [(e.curvature_start, e.curvature_end) for e in designed]
    assert len(designed) == 3
    assert all(bends[i][0] == bends[i][1] for i in (0, -1))
    assert len(fit_axis(points, 0.03).alignment.elements) < 3  # millimetres are worth no element by themselves


def test_an_alignment_that_bends_on_to_its_ends_is_left_there() -> None:
    tight = Alignment([Element(120.0, -1.0 / 60.0, 1.0 / 60.0)])
    found = fit_axis(offset_points(tight, 0.004, 1), 0.03, design_ends=True).alignment.elements
    assert len(found) <= 3
    assert max(abs(e.curvature_end - e.curvature_start) for e in found) > 0.9 / 30.0


@pytest.mark.parametrize("follow", [False, True])
@pytest.mark.parametrize("way", [(0.0, 400.0, 0.0, 400.0), (97.5, 497.5, 297.5), (0.0, 400.0, 0.0)])
def test_points_that_turn_back_are_refused_with_their_distance(way: tuple[float, ...], follow: bool) -> None:
    points = np.zeros((len(way), 3))
    points[:, 0] = way
    with pytest.raises(AxisRefusedError, match="no road follows its points within 2 m"):
        fit_axis(points, follow=follow).check("axis.csv")


def test_no_few_elements_are_looked_for_where_no_road_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    """A path that turns at every point, 900 m apart: such a search took a minute, to be refused all the same."""

    def search(*_: object) -> None:
        pytest.fail("elements are looked for")

    monkeypatch.setattr("synthroads_addon.fitting.fit.improve_fit", search)
    rng = np.random.default_rng(3)
    heading = np.cumsum(1.5 * (0.3 + rng.normal(0.0, 1.0, 150)))
    points = np.cumsum(
        rng.uniform(300.0, 900.0, (150, 1)) * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0
    )
    with pytest.raises(AxisRefusedError, match="no road follows its points within 2 m"):
        fit_axis(points).check("a.sbet")


def test_nor_behind_a_place_that_no_road_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    """A straight of several windows, in the first of which points are 100 m off."""
    searched: list[Plan] = []
    search = fit_module._fit_window

    def off(data: Plan | Heights, *more: Any) -> ChainFit:
        found = search(data, *more)
        if isinstance(data, Plan):
            searched.append(data)
            found.residuals = found.residuals + 100.0
        return found

    monkeypatch.setattr(fit_module, "_fit_window", off)
    found = fit_axis(np.column_stack([np.arange(0.0, 5000.0, 20.0), np.zeros(250)]))
    assert found.alignment.length == pytest.approx(4980.0)
    assert len(searched) == 1
