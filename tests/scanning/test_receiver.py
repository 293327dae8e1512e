"""Laws of the receiver: how often an echo is detected, and what noise its intensity has."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.scanning.devices.device import Device
from synthroads_addon.scanning.noise import Noise
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.receiver import Receiver, draw_values, number_echoes, values_of_echoes
from synthroads_addon.scanning.receiving.detector import detect_echoes
from synthroads_addon.scanning.returns import Echoes
from synthroads_addon.scanning.scan import BlockScan
from tests.helpers.scenes.scan_scenes import Standing, altered, plane, scan_block, scan_of
from tests.helpers.scenes.scanners import device

RATIO = 5.0
NOISY = Receiver(threshold_to_noise=RATIO)


def received(plan: ScanPlan, blocks: int = 1, **changes) -> PointBlock:
    """Return the points of the first blocks of a scan with another setting."""
    changed = altered(plan, setting=replace(plan.setting, **changes))
    return concatenate([scan_block(changed, changed.path.strips[0], block).points for block in range(blocks)])


def chi_square(found: np.ndarray, chance: np.ndarray, bins: int = 8) -> float:
    """Return how probable deviations as large are of pulses (P,) that were detected with a chance (P,) each."""
    edges = np.quantile(chance[(chance > 0.02) & (chance < 0.98)], np.linspace(0, 1, bins + 1))
    number = np.digitize(chance, edges[1:-1])
    inside = (chance >= edges[0]) & (chance <= edges[-1])
    excess, spread = (np.bincount(number[inside], values[inside]) for values in (found - chance, chance * (1 - chance)))
    assert spread.min() > 10.0
    return float(stats.chi2.sf(np.sum(excess**2 / spread), len(spread)))


@pytest.mark.parametrize("rays", [1, 7])
def test_asphalt_is_detected_by_chance_over_signal_to_noise(rays: int) -> None:
    """A scanner 2 m above a road whose asphalt thins out from 8 to 30 m on."""
    plan = scan_of(plane(), rays, Standing(2.0))
    calm = received(plan, rays)
    threshold = float(np.interp(12.0, np.sort(calm.range), calm.intensity[np.argsort(calm.range)]))
    noisy = received(plan, rays, threshold=threshold, receiver=NOISY)
    chance = stats.norm.cdf(RATIO * (calm.intensity / threshold - 1.0))
    found = np.isin(calm.gps_time, noisy.gps_time)
    assert chi_square(found, chance) > 0.001
    near, far = calm.range < 9.0, calm.range > 20.0
    assert found[near].all()
    assert not found[far].any()
    assert 0 < found[(calm.range > 11.0) & (calm.range < 13.0)].mean() < 1


def test_noise_of_detected_echoes_is_a_normal_distribution_cut_off_at_the_threshold() -> None:
    plan = scan_of(plane(), 1, Standing(2.0))
    calm = received(plan)
    threshold = float(np.median(calm.intensity[calm.range < 12.0]))
    noisy = received(plan, threshold=threshold, receiver=NOISY)
    sigma = threshold / RATIO
    mean = calm.intensity[np.isin(calm.gps_time, noisy.gps_time)]
    assert noisy.intensity.min() >= threshold
    share = stats.truncnorm.cdf(noisy.intensity, (threshold - mean) / sigma, np.inf, mean, sigma)
    assert stats.chisquare(np.bincount((share * 20).astype(int), minlength=20)).pvalue > 0.001


def test_a_hard_threshold_stays_and_noise_moves_no_point() -> None:
    plan = scan_of(plane(), 1, Standing(2.0), range_sigma=0.01)
    calm = received(plan)
    threshold = float(np.median(calm.intensity))
    hard = received(plan, threshold=threshold)
    none = received(plan, threshold=threshold, receiver=Receiver(threshold_to_noise=0.0))
    noisy = received(plan, threshold=threshold, receiver=NOISY)
    assert hard.intensity.min() >= threshold
    np.testing.assert_array_equal(hard.xyz, none.xyz)
    here, there = (np.isin(a.gps_time, b.gps_time) for a, b in ((hard, noisy), (noisy, hard)))
    np.testing.assert_array_equal(hard.xyz[here], noisy.xyz[there])


def test_each_echo_of_a_pulse_has_a_number_of_its_own() -> None:
    values = draw_values(lambda count: np.random.default_rng(1).standard_normal(count, dtype=np.float32), 500)
    pulse = np.repeat(np.arange(500), 6)
    number = number_echoes(pulse)
    np.testing.assert_array_equal(number.reshape(500, 6), np.tile(np.arange(1, 7), (500, 1)))
    dealt = values_of_echoes(values, pulse, number).reshape(500, 6)
    np.testing.assert_array_equal(dealt[:, 0], values[0])
    assert all(len(set(row)) == 6 for row in dealt.tolist())
    # An echo less in some pulse leaves all others as they are.
    kept = np.arange(len(pulse)) != 11
    np.testing.assert_array_equal(
        values_of_echoes(values, pulse[kept], number_echoes(pulse[kept])), dealt.ravel()[kept]
    )


def test_every_echo_of_a_pulse_follows_the_laws() -> None:
    """Chi-square tests of speckle, noise, detection and lost echoes by their number in the pulse."""
    pulses, echoes, dropout, sigma = 3000, 4, 0.1, 0.3
    plan = scan_of(plane(), 1)
    setting = replace(plan.setting, threshold=1.0, receiver=NOISY)
    plan = altered(plan, setting=setting, noise=Noise(speckle=sigma, dropout=dropout))
    errors = BlockScan(plan).emitter.draw_errors(plan.path.strips[0], pulses, 0)
    pulse = np.repeat(np.arange(pulses), echoes)
    power = np.full(len(pulse), 1.1)
    sent = Echoes(pulse, np.arange(len(pulse)), np.arange(len(pulse)) * 1.0, power, power)
    number, channel = np.arange(pulses), np.zeros(pulses, dtype=np.uint8)
    certain = replace(errors, lost=None, receiver=None), replace(setting, threshold=0.0)
    seen, readout, weak = detect_echoes(sent, certain[0], number, channel, certain[1], provisional=False)
    assert (len(seen.pulse), weak) == (len(pulse), 0)
    assert readout.speckle is not None
    factor, nth = readout.speckle.reshape(-1, echoes), np.arange(len(pulse)) % echoes
    share = stats.gamma.cdf(factor, sigma**-2.0, scale=sigma**2)
    for column in share.T:
        assert stats.chisquare(np.bincount((column * 20).astype(int), minlength=20)).pvalue > 0.001
    assert np.abs(np.corrcoef(factor.T)[~np.eye(echoes, dtype=bool)]).max() < 5.0 / np.sqrt(pulses)
    found, _, weak = detect_echoes(sent, errors, number, channel, setting, dropout=dropout, provisional=False)
    chance = stats.norm.cdf(RATIO * (1.1 * factor.ravel() - 1.0))
    detected = np.isin(sent.hit, found.hit)
    kept = chance * (1.0 - dropout)
    excess, spread = (np.bincount(nth, values) for values in (detected - kept, kept * (1.0 - kept)))
    assert stats.chi2.sf(np.sum(excess**2 / spread), echoes) > 0.001
    assert weak == pytest.approx(np.sum(1.0 - chance), abs=5.0 * np.sqrt(np.sum(chance * (1.0 - chance))))


def test_a_scenario_changes_what_it_names_and_a_device_says_the_rest() -> None:
    shared = Receiver(threshold_to_noise=4.0)
    assert Receiver().over(shared) == shared
    assert Receiver(threshold_to_noise=0.0).over(shared).noise_sigma(2.0) == 0.0
    assert NOISY.over(Receiver()).noise_sigma(2.0) == pytest.approx(2.0 / RATIO)
    assert isinstance(device(receiver=shared.to_dict()), Device)


def test_lost_numbers_are_as_many_as_said_whatever_the_power_and_move_no_point() -> None:
    """Chi-square of the share of zeros over eight groups of the range."""
    share = 0.1
    plan = scan_of(plane(), 1, Standing(2.0), range_sigma=0.01)
    calm = received(plan)
    losing = received(plan, receiver=Receiver(lost_numbers=share))
    np.testing.assert_array_equal(calm.xyz, losing.xyz)
    lost = losing.intensity == 0.0
    np.testing.assert_array_equal(losing.intensity[~lost], calm.intensity[~lost])
    group = (stats.rankdata(calm.range, method="ordinal").astype(int) - 1) * 8 // len(calm)
    found, total = np.bincount(group, lost), np.bincount(group)
    assert stats.chi2.sf(np.sum((found - share * total) ** 2 / (share * (1 - share) * total)), 8) > 0.001
