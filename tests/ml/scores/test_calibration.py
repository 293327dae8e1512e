"""Calibration of standard deviations."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ml.scores.calibration import DEVIATIONS, LEVELS, IntervalCalibration, calibrate_target
from synthroads_addon.base.random_streams import stream


def _errors(kind: str, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return errors whose deviation differs from case to case, and predicted deviations that are half of it."""
    rng = stream(seed, "calibration", kind)
    true = rng.uniform(0.02, 0.2, count)
    shape = {"gauss": rng.standard_normal, "heavy": lambda n: rng.standard_t(1.6, n)}[kind](count)
    return true * shape, 0.5 * true


def test_factor_of_gaussian_errors():
    found = calibrate_target(*_errors("gauss", 5000, 1))
    assert found.factor == pytest.approx(2.0, rel=0.05)
    assert found.holds
    assert found.before[0] == pytest.approx(0.38, abs=0.03)
    assert found.after == pytest.approx(LEVELS, abs=0.02)
    assert found.widths == pytest.approx([2.0 * value for value in DEVIATIONS], rel=0.05)
    error, std = _errors("gauss", 5000, 2)
    for level, deviation in zip(LEVELS, DEVIATIONS, strict=True):
        assert (np.abs(error) <= deviation * found.factor * std).mean() == pytest.approx(level, abs=0.02)


def test_heavy_tails_have_no_factor_but_intervals():
    found = calibrate_target(*_errors("heavy", 5000, 1))
    assert not found.holds
    error, std = _errors("heavy", 5000, 2)
    for level, width in zip(LEVELS, found.widths, strict=True):
        assert (np.abs(error) <= width * std).mean() == pytest.approx(level, abs=0.02)
    # The factor misses neither share by more than the tolerances' ratio asks for.
    assert found.after[0] > LEVELS[0]
    assert found.after[1] < LEVELS[1]


def test_unknown_errors_do_not_count():
    error, std = _errors("gauss", 1000, 1)
    holes = np.concatenate([error, [np.nan, 0.1]]), np.concatenate([std, [0.1, np.nan]])
    assert calibrate_target(*holes) == calibrate_target(error, std)


def test_nothing_to_calibrate_with():
    found = calibrate_target(np.full(3, np.nan), np.ones(3))
    assert found.factor == 1.0
    assert found.widths == DEVIATIONS
    assert not found.holds


def test_errors_of_zero():
    assert calibrate_target(np.zeros(10), np.ones(10)).factor == 1.0


def test_survives_json():
    for found in (calibrate_target(*_errors("heavy", 100, 1)), IntervalCalibration()):
        data = found.to_dict() | {"after": [None if np.isnan(x) else x for x in found.after]}
        data["before"] = [None if np.isnan(x) else x for x in found.before]
        again = IntervalCalibration.from_dict(json.loads(json.dumps(data)))
        assert (again.factor, again.widths, again.count) == (found.factor, found.widths, found.count)
        assert again.after == pytest.approx(found.after, nan_ok=True)
