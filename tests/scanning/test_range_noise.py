"""Laws of the range's errors: by signal and incidence, with heavy tails, and without a bias."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.scanning.noise import Noise
from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.receiving.range_noise import range_sigma
from synthroads_addon.scanning.strip_errors import StripErrors, strip_gain
from tests.helpers.scenes.scan_scenes import Standing, altered, plane, scan_block, scan_of

SIGMA = 0.01


def errors_and_sigma(**receiver):
    """Return the errors of ranges over a road from 2 m above, and their standard deviations by the formula."""
    plan = scan_of(plane(), 1, Standing(2.0), range_sigma=SIGMA)
    strip = plan.path.strips[0]
    calm = scan_block(altered(plan, setting=replace(plan.setting, range_sigma=0.0)), strip, 0).points
    threshold = float(calm.intensity[calm.range < 20.0].min())
    calm = calm.select(np.flatnonzero(calm.intensity >= threshold))
    setting = replace(plan.setting, threshold=threshold, receiver=Receiver(**receiver))
    noisy = scan_block(altered(plan, setting=setting), strip, 0).points
    assert len(noisy) == len(calm)
    cosine = 2.0 / calm.range
    depth = calm.range * np.sqrt(np.mean(np.square(setting.divergence))) / 4 * np.tan(np.arccos(cosine))
    depth = np.minimum(depth, setting.range_resolution)
    faint, slant = receiver.get("faint_range_sigma", 0.0), receiver.get("incidence_range_noise", 0.0)
    pulse = setting.range_resolution / 2.354820045
    variance = (faint * threshold / calm.intensity) ** 2 * (1 + (depth / pulse) ** 2) + (slant * depth) ** 2
    return noisy.range - calm.range, np.sqrt(SIGMA**2 + variance), calm.range


@pytest.mark.parametrize(
    "receiver",
    [
        {},
        {"faint_range_sigma": 0.2},
        {"incidence_range_noise": 0.5},
        {"faint_range_sigma": 0.1, "range_tails": 5.0},
        {"faint_range_sigma": 0.1, "range_delay": 0.5},
    ],
)
def test_errors_of_ranges_follow_their_law_in_every_ring(receiver) -> None:
    error, sigma, reach = errors_and_sigma(**receiver)
    freedom = receiver.get("range_tails", 0.0)
    delayed = receiver.get("range_delay", 0.0)
    law = stats.t(freedom, scale=np.sqrt((freedom - 2) / freedom)) if freedom else stats.norm()
    if delayed:
        even = np.sqrt(1.0 - delayed**2)
        law = stats.exponnorm(delayed / even, loc=-delayed, scale=even)
    share = law.cdf(error / sigma)
    for low, high in ((0.0, 4.0), (4.0, 10.0), (10.0, np.inf)):
        here = (reach >= low) & (reach < high)
        counts = np.bincount((share[here] * 20).astype(int), minlength=20)
        assert here.sum() > 300
        assert stats.chisquare(counts).pvalue > 0.001


def test_errors_have_no_mean() -> None:
    error, sigma, _ = errors_and_sigma(
        faint_range_sigma=0.1, incidence_range_noise=0.3, range_tails=4.0, range_delay=0.4
    )
    assert abs(np.average(error, weights=sigma**-2.0)) < min(1e-3, 5.0 / np.sqrt(np.sum(sigma**-2.0)))


def test_without_a_sigma_ranges_are_exact_whatever_the_receiver() -> None:
    plan = scan_of(plane(), 1)
    receiver = Receiver(faint_range_sigma=0.5, incidence_range_noise=1.0, range_tails=4.0)
    points = scan_block(altered(plan, setting=replace(plan.setting, receiver=receiver)), plan.path.strips[0], 0).points
    np.testing.assert_allclose(points.range, points.true_range, atol=1e-9)


def test_a_strong_echo_at_a_right_angle_has_the_device_s_sigma() -> None:
    setting = replace(scan_of(plane()).setting, range_sigma=SIGMA, threshold=1e-6)
    setting = replace(setting, receiver=Receiver(faint_range_sigma=1.0, incidence_range_noise=1.0))
    sigma = range_sigma(setting, np.array([50.0]), np.array([1.0]), np.array([1.0]))
    np.testing.assert_allclose(sigma, SIGMA, rtol=1e-6)


def test_bright_speckle_is_ranged_nearer_without_a_bias() -> None:
    plan = scan_of(plane(), 1, range_sigma=1e-9)
    plan = altered(plan, noise=Noise(speckle=0.3))
    strip = plan.path.strips[0]
    walking = replace(plan.setting, receiver=Receiver(range_walk=0.004))
    calm, points = (scan_block(p, strip, 0).points for p in (plan, altered(plan, setting=walking)))
    level = 10 * np.log10(points.intensity / (points.intensity * points.range**3).mean() * points.range**3)
    shift = points.range - calm.range
    slope, _ = np.polyfit(level, shift, 1)
    assert slope == pytest.approx(-0.004, rel=1e-3)
    assert abs(shift.mean()) < min(1e-4, 5 * shift.std() / np.sqrt(len(shift)))


def test_a_bright_strip_is_ranged_nearer_and_all_strips_together_are_not() -> None:
    plan = altered(scan_of(plane(), 1, range_sigma=1e-9), strip_errors=StripErrors(gain_sigma_db=1.0))
    strip = plan.path.strips[0]
    walking = replace(plan.setting, receiver=Receiver(range_walk=0.004))
    calm, points = (scan_block(p, strip, 0).points for p in (plan, altered(plan, setting=walking)))
    gains = [
        10 * np.log10(strip_gain(plan.reception.strip_errors, seed, 0))
        for seed in range(plan.run.seed, plan.run.seed + 900)
    ]
    np.testing.assert_allclose(points.range - calm.range, -0.004 * gains[0], atol=1e-7)
    assert abs(0.004 * np.mean(gains)) < 1e-3
