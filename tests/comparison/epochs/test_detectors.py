"""Detectors of changes and their scores on clouds whose changes are known by construction."""

from __future__ import annotations

from argparse import ArgumentTypeError
from pathlib import Path

import numpy as np
import pytest

from headless.changes import _registration
from synthroads_addon.base.errors import InputError
from synthroads_addon.comparison.epochs.detectors import (
    NORMAL_QUANTILE,
    DetectorSettings,
    m3c2,
    nearest_distance,
    raster_difference,
)
from synthroads_addon.comparison.epochs.judge import judge_list, judge_points
from synthroads_addon.comparison.epochs.pairs import Detected, EpochPoints, read_result, stated_registration
from synthroads_addon.sampling.changes import sample_changes
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.epochs.truth import CODES, MOBILE
from synthroads_addon.scenario.changes import ChangeLimits
from synthroads_addon.scenario.road import RoadScenario

SIGMA, STEP = 0.004, 0.02
"""Noise of the clouds and height of the step in the second one, m."""


def clouds() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return two clouds of a plane, of which a square lies higher in the second one, and the true distances of that."""
    rng = np.random.default_rng(2)
    first, second = (np.column_stack([rng.uniform(0, 10, (30_000, 2)), rng.normal(0, SIGMA, 30_000)]) for _ in "ab")
    true = np.where((second[:, :2] > 4.0).all(axis=1) & (second[:, :2] < 7.0).all(axis=1), STEP, 0.0)
    second[:, 2] += true
    return first, second, true


def truth_of(second: np.ndarray, true: np.ndarray) -> EpochPoints:
    """Return the points with the truth."""
    is_changed = true > 0
    change = np.where(is_changed, CODES["overlaid"], 0).astype(np.uint8)
    return EpochPoints(second, change, is_changed.astype(np.uint16), true, np.zeros(len(true), bool))


@pytest.mark.parametrize("detect", [raster_difference, m3c2])
def test_distances_are_found_with_a_level_that_holds(detect: object) -> None:
    if detect is m3c2:
        pytest.importorskip("py4dgeo")
    first, second, true = clouds()
    result = detect(first, second, DetectorSettings())  # type: ignore[operator]
    inner = (np.abs(second[:, :2] - 5.5) < 0.9).all(axis=1)
    outer = (second[:, 0] < 3.0) & np.isfinite(result.distance)
    assert result.distance[inner].mean() == pytest.approx(STEP, abs=0.0005)
    assert abs(result.distance[outer].mean()) < 0.0002
    assert (np.abs(result.distance[outer]) <= result.detection_limit[outer]).mean() > 0.9
    report = judge_points(truth_of(second, true), Detected(result.distance, None, result.detection_limit), 0.0)
    assert report["changed"]["recall"] > 0.9
    assert report["objects"]["by_kind"]["overlaid"] == {"found": 1, "missed": 0}
    assert report["distances"]["by_kind"]["unchanged"]["rms_mm"] < 4.0


def test_the_raster_adds_the_registration_to_its_level() -> None:
    first, second, _ = clouds()
    plain, worse = (raster_difference(first, second, DetectorSettings(registration=r)) for r in (0.0, 0.01))
    difference = np.nanmean(worse.detection_limit - plain.detection_limit)
    assert difference == pytest.approx(NORMAL_QUANTILE * 0.01)


@pytest.mark.parametrize(("shift", "changed"), [(0.0, 0.09), (0.015, 0.09), (-0.03, 0.36)])
def test_the_registration_is_estimated_from_what_stays(shift: float, changed: float) -> None:
    """Of two clouds that are shifted against each other, with a step of 0.3 m in a share of the second one."""
    first, second, _ = clouds()
    is_raised = (second[:, :2] < 10.0 * np.sqrt(changed)).all(axis=1)
    second[:, 2] += shift + np.where(is_raised, 0.3, 0.0)
    result = raster_difference(first, second, DetectorSettings(registration=None))
    still = (second[:, :2] > 10.0 * np.sqrt(changed) + 0.6).any(axis=1)
    assert result.registration is not None
    assert result.registration < 0.001 + 3.0 * abs(shift)
    plain = raster_difference(first, second, DetectorSettings())
    within, without = ((np.abs(r.distance[still]) <= r.detection_limit[still]).mean() for r in (result, plain))
    assert within >= without
    assert within > 0.95 or shift == 0.0
    assert without < 0.1 or shift == 0.0
    assert (np.abs(result.distance[is_raised]) > result.detection_limit[is_raised]).all()


def test_nearest_distances_see_only_what_is_far() -> None:
    first, second, true = clouds()
    second[:50, 2] += 3.0
    result = nearest_distance(first, second, DetectorSettings())
    assert (result.distance[:50] > 2.5).all()
    assert (result.distance[50:][true[50:] == 0] < 0.3).all()


def test_scores_count_points_and_objects() -> None:
    _, second, true = clouds()
    points = truth_of(second, true)
    label = points.change.copy()
    assert judge_points(points, Detected(label=label), 0.0)["changed"]["iou"] == 1.0
    label[points.change > 0] = 0
    report = judge_points(points, Detected(label=label), 0.0)
    assert report["objects"]["missed"] == 1
    assert report["changed"]["recall"] == 0.0
    label[(second[:, :2] < 2.0).all(axis=1)] = CODES["rutted"]
    report = judge_points(points, Detected(label=label), 0.0)
    assert report["objects"]["false"] == 1
    assert report["changed"]["false_alarms"] == pytest.approx(
        ((second[:, :2] < 2.0).all(1)).sum() / (true == 0).sum(), abs=1e-5
    )


def test_kinds_are_scored_without_the_unchanged() -> None:
    _, second, true = clouds()
    points = truth_of(second, true)
    label = points.change.copy()
    rows = np.flatnonzero(points.change > 0)
    label[rows[: len(rows) // 2]] = CODES["rutted"]
    report = judge_points(points, Detected(label=label), 0.0)
    assert report["kinds"]["overlaid"]["iou"] == pytest.approx(0.5, abs=0.001)
    assert report["kinds"]["rutted"]["iou"] == 0.0
    assert report["mean_iou_of_changes"] == pytest.approx(0.25, abs=0.001)


def test_traffic_and_hidden_places_do_not_count() -> None:
    _, second, true = clouds()
    points = truth_of(second, true)
    points.change[:100], points.hidden[100:300] = MOBILE, True
    assert judge_points(points, Detected(label=points.change), 0.0)["judged"] == len(true) - 300


def test_the_share_found_is_given_by_size() -> None:
    _, second, true = clouds()
    rows = judge_points(truth_of(second, true), Detected(np.where(true > 0, STEP, 0.0)), 0.01)["found_by_size"]
    assert rows[0]["found"] == 0.0
    assert rows[-1]["found"] == 1.0


def test_lists_are_compared_change_by_change() -> None:
    road = sample_road(RoadScenario(length=300.0), 3)
    truth = sample_changes(road, ChangeLimits(years=6.0), 4)
    whole = judge_list(truth, truth)["objects"]
    assert (whole["found"], whole["missed"], whole["false"]) == (len(truth.changes), 0, 0)
    fewer = truth.model_copy(update={"changes": truth.changes[2:]})
    part = judge_list(truth, fewer)["objects"]
    assert (part["found"], part["missed"], part["false"]) == (len(truth.changes) - 2, 2, 0)
    assert judge_list(fewer, truth)["objects"]["false"] == 2


def test_a_result_of_another_length_or_without_values_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "short.npz", distance=np.zeros(3))
    with pytest.raises(InputError, match="value for each of the 5 points"):
        read_result(tmp_path / "short.npz", 5)
    np.savez(tmp_path / "none.npz", other=np.zeros(5))
    with pytest.raises(InputError, match="must have distances or labels"):
        read_result(tmp_path / "none.npz", 5)


def test_the_stated_registration_is_that_of_the_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="states no registration_error"):
        stated_registration(tmp_path)
    file = tmp_path / "registration.json"
    file.write_text('{"registration_error": null}', encoding="utf-8")
    with pytest.raises(InputError, match="--registration estimated"):
        stated_registration(tmp_path / "cloud.laz")
    file.write_text('{"registration_error": 0.0123}', encoding="utf-8")
    assert stated_registration(tmp_path / "cloud.laz") == 0.0123


@pytest.mark.parametrize(("text", "value"), [("stated", "stated"), ("estimated", "estimated"), ("0.02", 0.02)])
def test_a_registration_is_a_number_or_a_word(text: str, value: float | str) -> None:
    assert _registration(text) == value
    for wrong in ("-0.1", "none", "nan", "inf"):
        with pytest.raises(ArgumentTypeError, match="must be a number of metres"):
            _registration(wrong)
