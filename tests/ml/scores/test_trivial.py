"""Predictors that learn nothing, on slices made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from ml.scores.baselines import RULES, between_brightest, bright_middle, centroid, extent_middle, slice_centers
from synthroads_addon.base.random_streams import stream


def test_each_rule_on_one_slice() -> None:
    y = np.array([-4.0, -1.0, 0.0, 1.0, 2.0])
    flat = np.ones(5)
    assert centroid(y, flat) == pytest.approx(-0.4)
    assert extent_middle(y, flat) == -1.0


def test_bright_points_are_those_above_the_middle_of_the_range() -> None:
    y = np.linspace(-6.0, 10.0, 801)
    bright = (y > 1.0) & (y < 5.0)
    intensity = np.where(bright, 0.8, 0.2)
    assert bright_middle(y, intensity) == pytest.approx(3.0, abs=0.03)
    stray = intensity.copy()
    stray[3] = 50.0  # one reflector doesn't move the range
    assert bright_middle(y, stray) == pytest.approx(3.0, abs=0.1)


def test_the_brightest_of_either_side() -> None:
    y = stream(2, "y").uniform(-5.0, 7.0, 4000)
    intensity = np.full(len(y), 0.2)
    intensity[np.abs(y - 4.5) < 0.1] = 0.9
    intensity[np.abs(y + 2.5) < 0.1] = 0.7
    assert between_brightest(y, intensity) == pytest.approx(1.0, abs=0.2)
    one_side = y[y > 0]
    assert np.isfinite(between_brightest(one_side, np.ones(len(one_side))))
    assert np.isnan(between_brightest(np.arange(6.0), np.ones(6))), "single points make no strip"


def test_slices_stay_apart_and_thin_ones_have_no_prediction() -> None:
    number = np.array([2] * 6 + [0] * 5 + [1] * 4)
    y = np.concatenate([np.arange(6.0), np.arange(5.0) - 10.0, np.zeros(4)])
    found = slice_centers(extent_middle, number, y, np.ones(len(y)), 4)
    assert found == pytest.approx([-8.0, np.nan, 2.5, np.nan], nan_ok=True)


def test_mirroring_the_points_mirrors_each_prediction() -> None:
    random = stream(6, "mirror")
    y, intensity = random.uniform(-5.0, 8.0, 900), random.uniform(0.0, 1.0, 900)
    for rule, _ in RULES.values():
        assert rule(-y, intensity) == pytest.approx(-rule(y, intensity), abs=1e-9)
        assert rule(y + 3.0, intensity) == pytest.approx(rule(y, intensity) + 3.0, abs=1e-9)
