"""Errors of the trajectory: their standard deviation and correlation, and that no order or grouping changes them.

Statistics are of long records with fixed seeds. A record of N correlation times has about N independent values of the
square of a Gauss-Markov process, so its variance is known to sqrt(2 / N); tolerances are five of these.
"""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from synthroads_addon.base.rotations import rotation_matrix
from synthroads_addon.scanning import noise as module
from synthroads_addon.scanning.noise import BLOCK, KNOTS_PER_CORRELATION_TIME, Noise, measured_pose, trajectory_errors
from synthroads_addon.scanning.platforms.path import Strip

TAU = 30.0
STRIP = Strip(3, 500.0, 36_000.0)
ALL = Noise(position_sigma=0.02, attitude_sigma_deg=0.015, heading_sigma_deg=0.04, correlation_time=TAU)
SIGMA = np.array([0.02] * 3 + [np.deg2rad(0.015)] * 2 + [np.deg2rad(0.04)])
KNOT = TAU / KNOTS_PER_CORRELATION_TIME
RECORD = 10_000
"""Correlation times in the record that statistics are of."""


def errors(noise: Noise = ALL, strip: Strip = STRIP, seed: int = 1, *, time: np.ndarray) -> np.ndarray:
    """Return the six errors, (K, 6), at times since the strip's start."""
    return np.concatenate(trajectory_errors(noise, seed, strip, strip.start_time + time), axis=1)


@pytest.fixture(scope="module")
def record() -> np.ndarray:
    """Return ten values per correlation time, never at a knot, in units of sigma."""
    return errors(time=(np.arange(RECORD * 10) + 0.5037) * (TAU / 10)) / SIGMA


def test_every_axis_has_its_standard_deviation_and_no_mean(record: np.ndarray) -> None:
    np.testing.assert_allclose(record.var(axis=0), 1.0, atol=5 * np.sqrt(2 / RECORD))
    # The variance of a mean is 2 tau / T.
    np.testing.assert_allclose(record.mean(axis=0), 0.0, atol=5 * np.sqrt(2 / RECORD))
    # Gaussian: the fourth moment is 3 (its own variance is 96, shared by records of the square's square).
    np.testing.assert_allclose((record**4).mean(axis=0), 3.0, atol=5 * np.sqrt(96 / RECORD))


@pytest.mark.parametrize("tenths", [1, 3, 10, 20, 50])
def test_the_correlation_falls_as_an_exponential(record: np.ndarray, tenths: int) -> None:
    found = (record[tenths:] * record[:-tenths]).mean(axis=0) / record.var(axis=0)
    np.testing.assert_allclose(found, np.exp(-tenths / 10), atol=5 * np.sqrt(2 / RECORD))


def test_errors_are_normal(record: np.ndarray) -> None:
    """A chi-square test of twenty equal shares, of values ten correlation times apart."""
    counts = np.bincount((stats.norm.cdf(record[::100].ravel()) * 20).astype(int), minlength=20)
    assert stats.chisquare(counts).pvalue > 0.001


def test_axes_and_strips_and_seeds_are_independent(record: np.ndarray) -> None:
    time = (np.arange(RECORD) + 0.5037) * TAU
    others = [errors(strip=Strip(4, 500.0, 36_000.0), time=time), errors(seed=2, time=time)]
    together = np.concatenate([record[::10] / record[::10].std(axis=0), *(other / SIGMA for other in others)], axis=1)
    correlation = together.T @ together / RECORD
    # Values a correlation time apart keep exp(-1): the variance is (1 + e^-2) / (1 - e^-2) = 1.3 of independent ones'.
    off = correlation[~np.eye(18, dtype=bool)]
    assert np.abs(off).max() < 5 * np.sqrt(1.32 / RECORD)


def test_at_the_knots_the_process_is_exactly_autoregressive_across_blocks_too() -> None:
    count = 64 * BLOCK
    values = errors(time=(np.arange(count) + 1e-7) * KNOT) / SIGMA
    a = np.exp(-1 / KNOTS_PER_CORRELATION_TIME)
    drive = (values[1:] - a * values[:-1]) / np.sqrt(1 - a * a)
    np.testing.assert_allclose(drive.var(axis=0), 1.0, atol=5 * np.sqrt(2 / count))
    np.testing.assert_allclose((drive[1:] * drive[:-1]).mean(axis=0), 0.0, atol=5 / np.sqrt(count))
    across = drive[BLOCK - 1 :: BLOCK].ravel()
    assert len(across) == 63 * 6 + (len(drive) % BLOCK == 0) * 6
    assert across.var() == pytest.approx(1.0, abs=5 * np.sqrt(2 / len(across)))


def test_errors_are_continuous_from_one_block_to_the_next() -> None:
    border = np.arange(1, 30) * BLOCK * KNOT
    before, after = (errors(time=border + shift) / SIGMA for shift in (-1e-6, 1e-6))
    np.testing.assert_allclose(before, after, atol=1e-4)


@given(st.floats(0.001, 0.999))
@settings(max_examples=30, deadline=None)
def test_between_knots_the_variance_is_exact_and_the_correlation_nearly(share: float) -> None:
    """A value between knots is a sum of its neighbours: its weights, found by regression, tell its variance."""
    cells = np.arange(5, 25)
    before, between, after = (errors(time=(cells + at) * KNOT).ravel() / np.tile(SIGMA, 20) for at in (1e-9, share, 1))
    (a, b), residual, *_ = np.linalg.lstsq(np.column_stack([before, after]), between, rcond=None)
    assert residual[0] < 1e-12
    h = 1 / KNOTS_PER_CORRELATION_TIME
    rho = np.exp(-h)
    assert a * a + b * b + 2 * a * b * rho == pytest.approx(1.0, abs=1e-6)
    # With a knot ten cells ahead, and with a value at the same share of the cell ten cells ahead.
    assert a * rho**10 + b * rho**9 == pytest.approx(np.exp(-(10 - share) * h), abs=0.004)
    assert (a * a + b * b) * rho**10 + a * b * (rho**9 + rho**11) == pytest.approx(rho**10, abs=0.004)


@given(st.lists(st.floats(0.0, 36_000.0), min_size=1, max_size=40), st.randoms(use_true_random=False))
@settings(max_examples=30, deadline=None)
def test_order_and_grouping_change_nothing(chosen: list[float], random) -> None:
    time = np.array(chosen)
    whole = errors(time=time)
    order = list(range(len(time)))
    random.shuffle(order)
    cut = random.randint(0, len(order))
    for part in (order[:cut], order[cut:]):
        position, attitude = trajectory_errors(ALL, 1, STRIP, STRIP.start_time + time[part])
        np.testing.assert_array_equal(np.concatenate([position, attitude], axis=1), whole[part])


def test_seed_strip_and_sigma_are_all_that_matters() -> None:
    time = np.linspace(0.0, 600.0, 50)
    base = errors(time=time)
    np.testing.assert_array_equal(errors(strip=Strip(3, 500.0, 1.0), time=time), base)
    assert np.abs(errors(seed=2, time=time) - base).min() > 0.0
    assert np.abs(errors(strip=Strip(2, 500.0, 1.0), time=time) - base).min() > 0.0
    only = ALL.model_copy(update={"position_sigma": 0.0, "attitude_sigma_deg": 0.0})
    changed = errors(only, time=time)
    np.testing.assert_array_equal(changed[:, 5], base[:, 5])  # one axis doesn't know of the others
    assert not changed[:, :5].any()


def test_no_sigma_gives_zeros_without_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("drawn")

    monkeypatch.setattr(module, "stream", refuse)
    position, attitude = trajectory_errors(Noise(), 1, STRIP, np.linspace(0.0, 1e5, 1000))
    assert position.shape == attitude.shape == (1000, 3)
    assert not position.any()
    assert not attitude.any()
    with pytest.raises(AssertionError, match="drawn"):
        errors(seed=99, time=np.zeros(1))  # no other test has kept these


def test_before_the_start_errors_are_those_of_the_start() -> None:
    values = errors(time=np.array([-5.0, -1e-9, 0.0]))
    np.testing.assert_array_equal(values[:2], values[[2, 2]])


@pytest.mark.parametrize("correlation_time", [1e-3, 1.0, 10_000.0])
def test_hours_of_errors_cost_little_memory(correlation_time: float) -> None:
    noise = ALL.model_copy(update={"correlation_time": correlation_time})
    tracemalloc.start()
    late = errors(noise, time=36_000.0 + np.arange(2000) * 1e-4)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.isfinite(late).all()
    assert peak < 20e6


def test_errors_turn_a_pose_as_they_say() -> None:
    position = np.zeros((3, 3))
    heading = np.array([0.0, 1.0, 2.0])
    level = rotation_matrix(heading)
    shift = np.arange(9.0).reshape(3, 3)
    zero = np.zeros((3, 3))
    moved, turned = measured_pose(position, level, (shift, zero))
    np.testing.assert_array_equal(moved, shift)
    np.testing.assert_allclose(turned, level, atol=1e-15)
    turn = np.tile([0.0, 0.0, 0.3], (3, 1))
    found = measured_pose(position, level, (zero, turn))[1]
    np.testing.assert_allclose(found, rotation_matrix(heading + 0.3), atol=1e-15)
    tilt = np.tile([0.02, -0.03, 0.0], (3, 1))
    eastwards = np.broadcast_to(np.eye(3), (3, 3, 3))
    found = measured_pose(position, eastwards, (zero, tilt))[1]
    np.testing.assert_allclose(found, np.broadcast_to(rotation_matrix(0.0, -0.03, 0.02), found.shape), atol=1e-15)
    # Whatever its heading, the vertical axis leans over by the same angle in the same direction.
    leaning = measured_pose(position, level, (zero, tilt))[1][:, :, 2]
    np.testing.assert_allclose(leaning, np.tile(leaning[0], (3, 1)), atol=1e-15)
    np.testing.assert_allclose(np.arccos(leaning[:, 2]), np.hypot(0.02, 0.03), rtol=1e-3)
