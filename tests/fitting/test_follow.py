"""Points of a design give its elements back: exact ones, jumps of curvature, kinks, parabolas; noise is left alone."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.fitting.between import calm_swings, excess_swings
from synthroads_addon.fitting.chain import EQUAL
from synthroads_addon.fitting.design import Model
from synthroads_addon.fitting.fit import axis_of_points, fit_axis
from synthroads_addon.fitting.follow import follow_heights, follow_points, rounding_unit
from synthroads_addon.fitting.pieces import cut_into_pieces, noise_std, unroll_points
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road.profile import IntersectionPoint, Profile
from synthroads_addon.sampling.road import sample_alignment
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.relative_speed import quiet_seconds

JUMPS = [(60.0, 0.0, 0.0), (80.0, 1 / 150, 1 / 150), (1.5, 0.0, 0.0), (90.0, -1 / 200, -1 / 200), (70.0, 0.0, 0.0)]
EGG = [(50.0, 0.0, 0.0), (40.0, 0.0, 1 / 90), (60.0, 1 / 90, 1 / 90), (30.0, 1 / 90, 1 / 40), (45.0, 1 / 40, 1 / 40)]
PROFILE = Profile([IntersectionPoint(0.0, 5.0), IntersectionPoint(120.0, 9.0, 2500.0), IntersectionPoint(300.0, 3.0)])


def sampled(rows: list[tuple[float, float, float]], step: float, heading: float = 0.7) -> tuple[Alignment, np.ndarray]:
    alignment = Alignment([Element(*row) for row in rows], 30.0, -20.0, heading)
    station = np.append(np.arange(0.0, alignment.length, step), alignment.length)
    return alignment, alignment.position(station)


@pytest.mark.parametrize("rows", [JUMPS, EGG], ids=["jumps", "egg"])
def test_points_every_two_metres_give_the_elements_back(rows: list[tuple[float, float, float]]) -> None:
    truth, points = sampled(rows, 2.0)
    found = fit_axis(np.round(points, 6), follow=True)
    assert [e.kind for e in found.alignment.elements] == [e.kind for e in truth.elements]
    assert np.abs(np.array([e.length for e in found.alignment.elements]) - [row[0] for row in rows]).max() < 0.02
    assert np.abs(truth.project(found.alignment.position(np.linspace(0.0, truth.length, 500)))[1]).max() < 1e-5


FLAT = [(62.0, -1 / 1200, -1 / 1200), (50.0, -1 / 1200, -1 / 2000), (297.0, -1 / 2000, -1 / 2000)]
TURN = [(50.0, 1 / 500, 1 / 500), (50.0, 1 / 500, -1 / 500), (50.0, -1 / 500, -1 / 500)]


@pytest.mark.parametrize("rows", [FLAT, TURN], ids=["flat", "turn"])
def test_points_rounded_to_millimetres_give_the_elements_back(rows: list[tuple[float, float, float]]) -> None:
    truth, points = sampled(rows, 2.0, 0.0)
    found = fit_axis(np.round(points, 3), follow=True).alignment
    assert [e.kind for e in found.elements] == [e.kind for e in truth.elements]
    assert np.abs(truth.project(found.position(np.linspace(0.0, truth.length, 500)))[1]).max() < 1e-3


def test_steps_of_rounding_along_a_line_are_no_elements() -> None:
    """Rounded points of lines that hardly turn away from an axis of the map lie on steps, not at random."""
    lengths, turns = (113.0, 105.0, 48.0, 57.0, 35.0), (0.0007, 0.0013, -0.0047, 0.0015)
    rows = [(lengths[0], 0.0, 0.0)]
    for length, turn in zip(lengths[1:], turns, strict=True):
        rows += [(0.5, turn / 0.5, turn / 0.5), (length, 0.0, 0.0)]
    truth, points = sampled(rows, 2.0, -3.0971)
    found = fit_axis(np.round(points, 3), follow=True).alignment
    assert len(found.elements) == len(truth.elements)
    assert np.abs(truth.project(found.position(np.linspace(0.0, truth.length, 500)))[1]).max() < 1e-3


def test_the_unit_of_rounding_is_told_from_coordinates() -> None:
    points = np.random.default_rng(1).uniform(-4000.0, 4000.0, (300, 2))
    assert [rounding_unit(np.round(points, digits)) for digits in (2, 3, 4, 6)] == [1e-2, 1e-3, 1e-4, 0.0]


def test_a_kink_becomes_a_short_arc_within_the_tolerance() -> None:
    points = np.array([[2.0 * n, 0.0] for n in range(40)])
    turned = points[-1] + np.array([[2.0 * n * np.cos(0.1), 2.0 * n * np.sin(0.1)] for n in range(1, 40)])
    found = fit_axis(np.vstack([points, turned]), follow=True)
    assert found.horizontal.worst < 0.025  # half of the tolerance
    assert len(found.alignment.elements) <= 4
    assert max(abs(e.curvature_start) for e in found.alignment.elements) <= 0.1


def test_heights_of_grades_and_a_parabola_come_back() -> None:
    station = np.arange(0.0, 301.0, 2.0)
    found = follow_heights(station, np.round(PROFILE.elevation(station), 6), 300.0)
    assert found is not None
    assert len(found.points) == 3
    assert found.points[1].station == pytest.approx(120.0, abs=0.05)
    assert found.points[1].radius == pytest.approx(2500.0, rel=1e-3)


def test_heights_between_sparse_points_do_not_swing() -> None:
    """A dip that ends in a rise of 34 m: points every 10 m say how the heights run between them."""
    station = np.arange(0.0, 201.0, 10.0)

    def heights(at: np.ndarray) -> np.ndarray:
        share = np.clip((at - 116.0) / 34.0, 0.0, 1.0)
        return 5e-5 * np.minimum(at - 116.0, 0.0) ** 2 + 0.4 * share**3 * (4.0 - 3.0 * share)

    found = fit_axis(np.column_stack([station, 0.0 * station, np.round(heights(station), 4)]), follow=True)
    assert found.height.worst < 1e-3
    between = np.arange(0.0, 200.0, 0.5)
    assert np.abs(found.profile.elevation(between) - heights(between)).max() < 0.02


def test_a_swing_between_points_is_calmed_and_the_rest_stays() -> None:
    """Two grades that pass through the points, but leave the middle of a chord by 8 cm."""
    knots = np.array([0.0, 30.0, 32.5, 37.5, 40.0, 90.0])
    grades = np.array([0.0, 0.032, 0.0, -0.032, 0.0])
    model = Model(np.zeros(1), knots, np.column_stack([grades, grades]), np.full(5, EQUAL), np.zeros(4, dtype=bool))
    station = np.arange(0.0, 91.0, 10.0)
    heights = model.evaluate(station)
    assert excess_swings(model, station, heights)[3] == pytest.approx(0.08)
    calm = calm_swings(model, station, heights, 0.03)
    assert calm.evaluate(station) == pytest.approx(heights)
    assert np.abs(calm.evaluate(np.linspace(0.0, 90.0, 181))).max() < 1e-9
    assert calm_swings(model, station, heights, 0.09) is model


def test_a_road_of_two_points_has_no_swings() -> None:
    model = Model(
        np.zeros(1), np.array([0.0, 10.0]), np.array([[0.1, 0.1]]), np.array([EQUAL]), np.zeros(0, dtype=bool)
    )
    station = np.array([0.0, 10.0])
    assert calm_swings(model, station, model.evaluate(station), 0.03) is model


def test_points_with_noise_are_fitted_as_without_it() -> None:
    _, points = sampled(EGG, 1.0)
    noisy = points + np.random.default_rng(4).normal(0.0, 0.02, points.shape)
    assert follow_points(noisy, 0.05) is None
    assert fit_axis(noisy, follow=True).alignment.elements == fit_axis(noisy).alignment.elements


def test_the_noise_is_told_from_the_points() -> None:
    _, points = sampled(EGG, 1.0)
    noisy = points + np.random.default_rng(5).normal(0.0, 0.005, points.shape)
    assert noise_std(*unroll_points(points), 3) < 1e-5
    assert noise_std(*unroll_points(noisy), 3) == pytest.approx(0.005, rel=0.25)


def test_pieces_are_as_few_as_the_polynomials() -> None:
    station = np.arange(0.0, 100.0, 1.0)
    values = np.where(station < 40.0, 0.1 * station, 4.0 + 0.1 * (station - 40.0) + 0.002 * (station - 40.0) ** 2)
    pieces = cut_into_pieces(station, values, (1, 2, 3), 1e-4)
    assert [piece.degree for piece in pieces] == [1, 2]
    assert pieces[0].last in (39, 40, 41)


def test_a_road_that_is_off_its_points_is_told() -> None:
    _, points = sampled(EGG, 1.0)
    noisy = np.column_stack([points + np.random.default_rng(6).normal(0.0, 0.12, points.shape), np.zeros(len(points))])
    with collected_remarks() as remarks:
        axis_of_points("track.csv", noisy + [500000.0, 5700000.0, 0.0], None, RoadScenario())
    assert any("is off its points" in str(remark) for remark in remarks)


def test_following_takes_no_longer_than_the_usual_fit() -> None:
    _, points = sampled(JUMPS, 2.0)
    usual = quiet_seconds(lambda: fit_axis(points))
    assert quiet_seconds(lambda: fit_axis(points, follow=True)) < usual


@pytest.mark.slow
@pytest.mark.parametrize(("step", "right"), [(2.0, 17), (10.0, 7)])
def test_drawn_axes_come_back_from_points(step: float, right: int) -> None:
    """The figures of docs/roads.md: `-s` shows them."""
    worst, same = 0.0, 0
    for seed in range(20):
        truth = alignment_of(sample_alignment(RoadScenario(length=1500.0), seed))
        station = np.append(np.arange(0.0, truth.length, step), truth.length)
        found = fit_axis(np.round(truth.position(station), 4), follow=True).alignment
        off = truth.project(found.position(np.linspace(0.0, found.length, 1500)))[1]
        worst = max(worst, float(np.abs(off).max()))
        same += [e.kind for e in found.elements] == [e.kind for e in truth.elements]
    print(f"every {step:g} m: elements of {same} of 20 axes come back, all within {1000.0 * worst:.1f} mm")
    assert worst < (0.002 if step < 5.0 else 0.02)
    assert same >= right


def test_a_stretch_without_points_is_no_fault() -> None:
    """The first point ten kilometres before the others, which lie on a parabola."""
    x = np.arange(20.0, 281.0, 20.0)
    points = np.vstack([[-10_000.0, 0.0, 0.0], np.column_stack([x, np.round(x**2 / 1000.0, 3), 0.0 * x])])
    fit = fit_axis(points - np.round(points.mean(axis=0)), follow=True)
    assert fit.horizontal.worst < fit.limit
