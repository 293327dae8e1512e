"""Numbers that receivers make of power: closed forms, rounding, saturation, gains, the overlap near by."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.receiving.response import laser_gains, overlap_share, range_corrected, read_power
from tests.helpers.scenes.scan_scenes import Standing, altered, plane, scan_block, scan_of
from tests.helpers.scenes.scanners import preset

ONES = np.ones(256)
T, M = 1e-4, 1e-1
POWER = np.geomspace(T, 10 * M, 400)
RANGE = np.linspace(2.0, 60.0, 400)
NUMBERS = {
    "linear": POWER / M,
    "range_compensated": np.minimum(POWER, M) * RANGE**2 / 2.5,
    "logarithmic": np.log10(POWER / T) / 3.0,
    "over_threshold": (POWER - T) / (M - T),
}


def setting_with(**receiver):
    """Return a scanner of a dynamic range of 30 dB with a receiver."""
    return replace(preset("velodyne-hdl-64e"), threshold=T, saturation=M, receiver=Receiver(**receiver))


@pytest.mark.parametrize("response", sorted(NUMBERS))
@pytest.mark.parametrize("bits", [4, 8, 16])
def test_numbers_are_shares_of_the_full_scale_in_whole_steps(response: str, bits: int) -> None:
    setting = setting_with(response=response, bits=bits, full_scale=2.5)
    number, clipped = read_power(POWER, RANGE, None, ONES, setting)
    expected, steps = np.clip(NUMBERS[response], 0.0, 1.0), 2**bits - 1
    np.testing.assert_allclose(number, expected, atol=0.5 / steps + 1e-12)
    np.testing.assert_allclose(number * steps, np.rint(number * steps), atol=1e-9)
    assert clipped == np.count_nonzero(POWER > M)
    assert len(np.unique(number)) <= 2**bits


@pytest.mark.parametrize("response", sorted(NUMBERS))
def test_compressed_numbers_have_powers_of_the_ratios_and_none_below_the_pedestal(response: str) -> None:
    setting = setting_with(response=response, full_scale=2.5, pedestal=4.0, compression=0.3)
    number, _ = read_power(POWER, RANGE, None, ONES, setting)
    power = np.maximum(np.minimum(POWER, M) - 4.0 * T, 0.0)
    share = {
        "linear": power / M,
        "range_compensated": power * RANGE**2 / 2.5,
        "logarithmic": np.log10(np.maximum(power / T, 1.0)) / 3.0,
        "over_threshold": (power - T) / (M - T),
    }[response]
    np.testing.assert_allclose(number, np.clip(share, 0.0, 1.0) ** 0.3, atol=0.51 / 65535)
    assert np.all(number[POWER < 4.0 * T] == 0.0)
    inner = (share > 0.05) & (share < 0.9)
    back = range_corrected(number, RANGE, setting)[inner]
    np.testing.assert_allclose(back, (np.minimum(POWER, M) * RANGE**2)[inner], rtol=5e-3)


@pytest.mark.parametrize("response", [None, "power", *sorted(NUMBERS)])
def test_range_corrected_clouds_have_the_power_behind_the_numbers(response: str | None) -> None:
    setting = setting_with(response=response, full_scale=1e3)
    power, reach = POWER[POWER < M], RANGE[POWER < M]
    number, _ = read_power(power, reach, None, ONES, setting)
    error = range_corrected(number, reach, setting) - power * reach**2
    # Half a step of 16 bits, of the logarithmic one as a share of the power.
    step = {"logarithmic": power * np.log(M / T), "range_compensated": 1e3 / reach**2}.get(str(response), M)
    assert np.all(np.abs(error) <= 0.51 / 65535 * step * reach**2)


def test_power_is_handed_on_as_it_is() -> None:
    number, _ = read_power(POWER, RANGE, None, ONES, setting_with(pedestal=4.0, compression=0.3))
    np.testing.assert_array_equal(number, np.minimum(POWER, M))


@pytest.mark.parametrize("softness", [0.5, 1.0, 3.0])
def test_saturation_is_gradual_and_ends_at_the_same_limit(softness: float) -> None:
    number, _ = read_power(POWER, RANGE, None, ONES, setting_with(soft_saturation=softness))
    np.testing.assert_allclose(number ** (-2 * softness), POWER ** (-2 * softness) + M ** (-2 * softness), rtol=1e-9)
    assert np.all(np.diff(number) > 0)
    assert number[-1] < M


def test_gains_of_lasers_are_log_normal_and_drawn_from_the_seed() -> None:
    setting = setting_with(gain_sigma_db=1.5)
    gains = np.concatenate([laser_gains(setting, seed) for seed in range(8)])
    counts = np.bincount((stats.norm.cdf(10 * np.log10(gains) / 1.5) * 20).astype(int), minlength=20)
    assert stats.chisquare(counts).pvalue > 0.001
    np.testing.assert_array_equal(laser_gains(setting, 3), laser_gains(setting, 3))
    channel = np.arange(400) % 64
    number, _ = read_power(POWER / 100, RANGE, channel, gains, setting)
    np.testing.assert_allclose(number, POWER / 100 * gains[channel])


def test_the_scan_gives_each_laser_its_gain() -> None:
    plan = scan_of(plane(), 1, Standing(2.0))
    head = replace(preset("velodyne-hdl-64e"), range_sigma=0.0, threshold=0.0, saturation=np.inf)
    layers = plan.layers.measured | {"channel", "power_db"}
    plan = altered(plan, setting=replace(head, receiver=Receiver(gain_sigma_db=2.0)), measured=layers)
    points = scan_block(plan, plan.path.strips[0], 0).points
    channel, power = points.array("channel"), points.array("power_db")
    assert len(np.unique(channel)) > 50
    np.testing.assert_allclose(10 * np.log10(points.intensity / plan.gains[channel]), power, atol=1e-4)


def test_near_echoes_are_fainter_where_laser_and_receiver_see_different_places() -> None:
    plan = scan_of(plane(), 1, Standing(2.0))
    setting = replace(plan.setting, receiver=Receiver(overlap_begin=1.0, overlap_full=4.0))
    calm, near = (scan_block(p, plan.path.strips[0], 0).points for p in (plan, altered(plan, setting=setting)))
    share = np.clip((calm.range - 1.0) / 3.0, 0.0, 1.0)
    assert share.min() < 0.7
    np.testing.assert_allclose(near.intensity, calm.intensity * share, rtol=1e-9)
    assert overlap_share(plan.setting, calm.range) is None
