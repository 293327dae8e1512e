"""Figures of predicted centrelines against lines whose distances are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ml.scores import metrics
from ml.scores.distances import METRICS, Comparison, chamfer, coverage, lateral_errors, over_roads, windows
from ml.scores.metrics import over_seeds
from synthroads_addon.base.random_streams import stream

Float = NDArray[np.float64]


def figures(*given: Float) -> dict[str, float]:
    return metrics.figures(METRICS, Comparison(*given))


def arc(length: float, radius: float, offset: float = 0.0, heading: float = 0.7) -> tuple[Float, Float]:
    """Return stations (M,) and points (M, 2) each metre along an arc to the left, moved aside by an offset."""
    station = np.arange(0.0, length + 0.5)
    turn = station / radius
    local = np.column_stack([(radius - offset) * np.sin(turn), radius - (radius - offset) * np.cos(turn)])
    rotation = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    return station, local @ rotation.T + (3.5e5, 5.6e6)


def test_a_line_beside_another_is_as_far_as_it_is_moved() -> None:
    station, true = arc(600.0, 900.0)
    _, predicted = arc(600.0, 900.0, 0.25)
    result = figures(predicted, true, station)
    assert result["mae"] == pytest.approx(0.25, abs=1e-6)
    assert result["lateral"] == pytest.approx(0.25, abs=1e-3)
    assert result["bias"] == pytest.approx(0.25, abs=1e-3)
    assert result["chamfer_full"] == pytest.approx(0.5, abs=0.002)  # both directed means
    assert result["chamfer_common"] == pytest.approx(0.5, abs=0.002)
    assert result["found"] == result["chamfer_compared"] == 1.0
    assert result["slices"] == 601
    assert result["chamfer_windows"] == 10


def test_the_bias_has_the_side_and_deviations_to_both_sides_cancel() -> None:
    station, true = arc(200.0, 500.0)
    _, right = arc(200.0, 500.0, -0.3)
    assert figures(right, true, station)["bias"] == pytest.approx(-0.3, abs=1e-3)
    alternating = np.where((np.arange(len(true)) % 2 == 0)[:, None], right, 2 * true - right)
    result = figures(alternating, true, station)
    assert result["mae"] == pytest.approx(0.3, abs=1e-6)
    assert abs(result["bias"]) < 2e-3
    assert result["chamfer_full"] < 0.04, "the polynomial averages"


def test_distance_along_the_road_counts_in_the_plane_and_not_aside() -> None:
    station, true = arc(300.0, 1e6)
    ahead = true + 0.4 * np.diff(true, axis=0).mean(axis=0)
    result = figures(ahead, true, station)
    assert result["mae"] == pytest.approx(0.4, abs=1e-3)
    assert result["lateral"] < 1e-3


def test_full_extent_shows_what_is_missing_and_common_extent_does_not() -> None:
    station, true = arc(100.0, 800.0)
    predicted = true.copy()
    predicted[:30] = np.nan
    result = chamfer(predicted, true, station)
    assert result.common < 1e-3
    # 30 of 101 samples of the truth are 1 to 30 m beyond the prediction's end.
    assert result.full == pytest.approx(sum(range(1, 31)) / 101.0, rel=0.06)


def test_common_extent_does_not_go_beyond_either_line() -> None:
    station, true = arc(60.0, 1e6)
    predicted = true.copy()
    _, aside = arc(60.0, 1e6, offset=1.0)
    bend = np.clip((station - 30.0) / 30.0, 0.0, None) ** 3
    predicted += bend[:, None] * (aside - true)
    predicted[:40] = np.nan
    result = chamfer(predicted, true, station)
    # Two means of 0.37 over the last 20 m; over the whole window it would be 0.25.
    assert result.common == pytest.approx(0.74, abs=0.06)
    assert result.full > 5.0


def test_windows_count_by_their_lengths() -> None:
    station, true = arc(200.0, 1e6)
    _, predicted = arc(200.0, 1e6, offset=0.3)
    true[61:80] = np.nan
    predicted[:61] = true[:61]
    # One window of 60 m without error, two of 60 m with 2 x 0.3 m.
    assert chamfer(predicted, true, station).full == pytest.approx(0.4, abs=0.005)
    true[80:160] = np.nan
    # Now 60 m without and 40 m with.
    assert chamfer(predicted, true, station).full == pytest.approx(0.24, abs=0.005)


def test_gaps_of_the_truth_are_left_out() -> None:
    station, true = arc(300.0, 1e5)
    true[100:140] = np.nan
    predicted = np.where(np.isnan(true), 1e3, true)
    parts = windows(station, np.isfinite(true).all(axis=1))
    assert [(part[0], part[-1]) for part in parts] == [(0, 49), (50, 99), (140, 193), (194, 246), (247, 300)]
    result = figures(predicted, true, station)
    assert result["mae"] == 0.0
    assert result["chamfer_full"] < 1e-6
    assert result["slices"] == 261


def test_short_pieces_have_no_polynomial() -> None:
    station, _ = arc(100.0, 1e5)
    known = np.ones(101, dtype=bool)
    known[19:30] = False
    assert [(part[0], part[-1]) for part in windows(station, known)] == [(30, 100)]
    assert windows(station, np.zeros(101, dtype=bool)) == []


def test_windows_without_prediction_are_told() -> None:
    station, true = arc(200.0, 1e5)
    predicted = true.copy()
    predicted[:64] = np.nan
    result = chamfer(predicted, true, station)
    assert result.windows == 3
    assert result.compared == pytest.approx(2 / 3, abs=0.01)
    nothing = figures(np.full_like(true, np.nan), true, station)
    assert nothing["found"] == 0.0
    assert np.isnan(nothing["mae"])
    assert np.isnan(nothing["chamfer_full"])


def test_one_window_of_a_long_curve_would_measure_the_polynomial() -> None:
    station, true = arc(1000.0, 600.0)
    # In windows of 60 m the arc itself is met to a millimetre: the distance of noise is that of its polynomial.
    noisy = true + stream(1, "noise").normal(0.0, 0.1, true.shape)
    assert chamfer(noisy, true, station).full < 0.08
    assert chamfer(noisy, true, station, window=2000.0).full < 0.03, "one cubic hardly follows either line"
    assert chamfer(true.copy(), true, station).full < 1e-9


def test_offsets_from_a_line_are_signed_and_none_beside_a_gap() -> None:
    station, true = arc(100.0, 1e6, heading=0.0)
    true[40:60] = np.nan
    points = true[[10, 80]] + (0.3, -0.2)
    middle = (arc(100.0, 1e6, heading=0.0)[1][50] + (0.0, 0.1))[None]
    found = lateral_errors(np.vstack([points, middle]), true, station)
    assert found[:2] == pytest.approx([-0.2, -0.2], abs=1e-3)
    assert np.isnan(found[2])


def test_coverage_of_gaussian_errors_is_its_level() -> None:
    random = stream(7, "coverage")
    std = random.uniform(0.02, 0.5, 40_000)
    error = std * random.normal(size=len(std))
    assert coverage(error, std, 0.68) == pytest.approx(0.68, abs=0.01)
    assert coverage(error, std, 0.95) == pytest.approx(0.95, abs=0.005)
    assert coverage(error, 0.5 * std, 0.95) < 0.7
    assert np.isnan(coverage(np.array([np.nan, 0.1]), np.array([1.0, np.nan]), 0.95))
    assert coverage(np.array([np.nan, 0.1, 0.1, 3.0, 0.1]), np.array([1.0, np.nan, 1.0, 1.0, 1.0]), 0.95) == 2.0 / 3.0


def test_seeds_are_averaged_with_the_sample_deviation() -> None:
    spread = over_seeds([{"mae": 0.1, "found": 1.0}, {"mae": 0.2, "found": np.nan}, {"mae": 0.3, "found": 1.0}])
    assert spread["mae"].mean == pytest.approx(0.2)
    assert spread["mae"].std == pytest.approx(0.1)
    assert spread["mae"].count == 3
    assert np.isnan(spread["found"].mean), "what one seed lacks is not averaged away"
    assert np.isnan(over_seeds([{"mae": 0.1}])["mae"].std)


def test_roads_count_by_their_slices() -> None:
    result = over_roads([{"slices": 100.0, "mae": 0.1}, {"slices": 300.0, "mae": 0.3}])
    assert result == {"slices": 400.0, "mae": pytest.approx(0.25)}


def test_roads_too_short_for_a_window_say_nothing_of_chamfer_distances() -> None:
    def row(slices: float, distance: float, windows: float) -> dict[str, float]:
        told = {"chamfer_full": distance, "chamfer_compared": float(windows > 0), "chamfer_windows": windows}
        return {"slices": slices, "mae": 0.1, **told}

    long, short, unseen = row(500.0, 0.2, 8.0), row(10.0, np.nan, 0.0), row(300.0, np.nan, 5.0)
    both = over_roads([long, short])
    assert both["chamfer_full"] == pytest.approx(0.2)
    assert (both["chamfer_compared"], both["chamfer_windows"], both["slices"]) == (1.0, 8.0, 510.0)
    assert np.isnan(over_roads([long, unseen])["chamfer_full"])
    assert np.isnan(over_roads([short])["chamfer_full"])
