"""Intensities as a model sees them: the same from scanners of any gain, range and compression."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ml.data.intensity import DARKEST, contrast, level, logarithms

Float = NDArray[np.float64]


def lines(seed: int = 0) -> tuple[Float, Float]:
    """Return places across a road and intensities with two lines at -3.5 and 3.5 m, ten times as bright."""
    rng = np.random.default_rng(seed)
    y = rng.uniform(-14.0, 14.0, 3000)
    painted = np.abs(np.abs(y) - 3.5) < 0.1
    return y, np.where(painted, 1.0, 0.1) * np.exp(0.05 * rng.standard_normal(len(y)))


@settings(max_examples=50, deadline=None)
@given(gain=st.floats(1e-3, 1e3), power=st.floats(0.2, 2.0))
def test_neither_gain_nor_power_matters(gain: float, power: float) -> None:
    y, intensity = lines()
    logs, other = logarithms(intensity), logarithms(gain * intensity**power)
    np.testing.assert_allclose(level(other), level(logs), atol=1e-6)
    np.testing.assert_allclose(contrast(other, y), contrast(logs, y), atol=1e-6)


@pytest.mark.parametrize("height", [2.0, 5.0, 30.0])
def test_lines_stand_out_whatever_the_range(height: float) -> None:
    """Seen from a vehicle the lane below is a hundred times as bright as the next carriageway: not so the contrast."""
    y, intensity = lines()
    painted = np.abs(np.abs(y) - 3.5) < 0.1
    dimmed = intensity * (1.0 + ((y - 6.0) / height) ** 2) ** -2.0
    found = contrast(logarithms(dimmed), y)
    assert np.percentile(found[painted], 5) > 3.0 * np.percentile(np.abs(found[~painted]), 95)
    assert np.abs(found[~painted]).std() < 2.0, "the unit is the noise"
    raw = dimmed / dimmed.max()
    assert height > 10.0 or np.median(raw[painted & (y < 0)]) < np.percentile(raw[~painted], 90), "why it is needed"


def test_wide_things_are_no_contrast() -> None:
    rng = np.random.default_rng(1)
    y = rng.uniform(-14.0, 14.0, 5000)
    intensity = np.where(y > 5.0, 0.5, 0.1) * np.exp(0.05 * rng.standard_normal(len(y)))
    found = np.abs(contrast(logarithms(intensity), y))
    assert np.median(found[np.abs(y - 5.0) > 2.0]) < np.median(found[np.abs(y - 5.0) < 0.3])
    assert level(logarithms(intensity))[y > 6.0].min() > level(logarithms(intensity))[y < 4.0].max()


def test_black_points_and_lone_points() -> None:
    logs = logarithms(np.array([0.0, 1.0, 2.0, 3.0]))
    assert logs[0] == pytest.approx(np.log(2.0 * DARKEST))
    assert np.isfinite(logarithms(np.zeros(3))).all()
    assert contrast(np.array([1.0]), np.array([-7.3])) == pytest.approx([0.0])
    assert level(np.full(5, 2.0)) == pytest.approx(np.zeros(5))
    far = contrast(np.array([0.0, 1.0, 0.0]), np.array([-1e3, 0.0, 1e3]))
    assert np.isfinite(far).all()
