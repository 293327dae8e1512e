"""How a platform sways: its law, that any time can be asked for by itself, and that a scan follows it exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.knots import Track
from synthroads_addon.scanning.platforms.path import KNOT_ERROR, KNOT_RANGE, Strip
from synthroads_addon.scanning.sway import Motion, SwayingPath, sway_offsets, with_motion

STRIP = Strip(0, 100.0, 60.0)
MOTION = Motion(position_sigma=0.4, attitude_sigma_deg=0.3, heading_sigma_deg=0.5, shortest_period=0.5)
SIGMA = np.array([0.4] * 3 + [np.deg2rad(0.3)] * 2 + [np.deg2rad(0.5)])


class Level:
    """A path straight on, without turning."""

    strips = (STRIP,)
    knot_spacing = 0.25
    typical_range = 100.0

    def pose(self, strip: Strip, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = np.outer(time - strip.start_time, [30.0, 0.0, 0.0])
        return position, np.broadcast_to(np.eye(3), (len(time), 3, 3))


def off_path(seed: int, time: np.ndarray, strip: int = 0) -> np.ndarray:
    """Return the six values (K, 6) in units of sigma."""
    return np.concatenate(sway_offsets(MOTION, seed, strip, time), axis=1) / SIGMA


def test_it_is_normally_distributed_with_the_stated_deviation() -> None:
    """One time of many seeds: independent values, by a chi-square test of twenty equal shares."""
    values = np.concatenate([off_path(seed, np.array([100.0 + seed])) for seed in range(400)])
    assert values.std(axis=0) == pytest.approx(1.0, abs=5 * np.sqrt(0.5 / 400))
    counts = np.bincount((stats.norm.cdf(values.ravel()) * 20).astype(int), minlength=20)
    assert stats.chisquare(counts).pvalue > 0.001


def test_periods_lie_between_the_stated_ones() -> None:
    time = np.arange(0.0, 200.0, 0.05)
    power = np.abs(np.fft.rfft(off_path(1, time) * np.hanning(len(time))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(time), 0.05)
    outside = (frequency > 1.02 / MOTION.shortest_period) | (frequency < 0.8 / MOTION.longest_period)
    assert power[outside].sum() < 0.01 * power.sum()


def test_slow_sway_is_larger_by_the_power_of_its_period_and_the_deviation_stays() -> None:
    slow = MOTION.model_copy(update={"period_exponent": 1.0})
    values = [sway_offsets(slow, seed, 0, np.array([100.0 + seed]))[0] / SIGMA[:3] for seed in range(400)]
    assert np.std(values) == pytest.approx(1.0, abs=5 * np.sqrt(0.5 / 1200))
    time = np.arange(0.0, 400.0, 0.1)
    even, slower = (
        np.concatenate(sway_offsets(motion, 3, 0, time), axis=1)[:, 0] / SIGMA[0] for motion in (MOTION, slow)
    )
    before, after = (np.abs(np.fft.rfft(values * np.hanning(len(time)))) for values in (even, slower))
    frequency = np.fft.rfftfreq(len(time), 0.1)
    sines = np.flatnonzero((before > 0.5 * before.max()) & (frequency > 0.0))
    power = np.polyfit(np.log(frequency[sines]), np.log(after[sines] / before[sines]), 1)[0]
    assert power == pytest.approx(-1.0, abs=0.05)


def test_each_strip_and_seed_sways_by_itself() -> None:
    time = np.linspace(100.0, 400.0, 3000)
    first, seed, strip = off_path(1, time), off_path(2, time), off_path(1, time, strip=1)
    for other in (seed, strip):
        assert abs(np.corrcoef(first[:, 3], other[:, 3])[0, 1]) < 0.3
    np.testing.assert_array_equal(off_path(1, time[700:701]), first[700:701])


@pytest.mark.parametrize("all_worked_out", [True, False])
@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0])
def test_between_knots_the_swaying_is_followed(exponent: float, all_worked_out: bool) -> None:
    path = with_motion(Level(), MOTION.model_copy(update={"period_exponent": exponent, "shortest_period": 0.1}), 1)
    assert isinstance(path, SwayingPath)
    assert path.knot_spacing < Level.knot_spacing

    def pose(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        position, rotation = path.pose(STRIP, time)
        return rotation, position, np.ones(len(time))

    time = np.linspace(100.0, 110.0, 5003)
    assert path.knots_per_node > 5
    every = 1 if all_worked_out else path.knots_per_node
    track = Track.between(pose, 100.0, 110.0, path.knot_spacing, every)
    rotation, origin, _ = track.at(time)
    exact_position, exact_rotation = path.pose(STRIP, time)
    beam = np.array([0.3, 0.4, -np.sqrt(0.75)]) * KNOT_RANGE
    place = origin.T + np.einsum("ijk,j->ki", rotation.reshape(3, 3, -1).transpose(0, 1, 2), beam)
    exact = exact_position + exact_rotation @ beam
    assert np.linalg.norm(place - exact, axis=1).max() < 2.0 * KNOT_ERROR


def test_no_knot_depends_on_where_a_block_begins() -> None:
    path = SwayingPath(Level(), MOTION, 1)

    def pose(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        position, rotation = path.pose(STRIP, time)
        return rotation, position, np.ones(len(time))

    spacing, every = path.knot_spacing, path.knots_per_node
    whole = Track.between(pose, 100.0, 101.0, spacing, every)
    for begin in (100.13, 100.5, 100.5 + 3.0 * spacing):
        part = Track.between(pose, begin, begin + 0.1, spacing, every)
        first = round((part.begin - whole.begin) / spacing)
        knots = slice(first, first + len(part.present))
        np.testing.assert_array_equal(part.position, whole.position[:, knots])
        np.testing.assert_array_equal(part.rotation, whole.rotation[:, knots])
        assert part.begin <= begin < begin + 0.1 <= part.begin + (len(part.present) - 1) * spacing + 1e-9


def test_a_platform_that_does_not_sway_keeps_its_path() -> None:
    level = Level()
    assert with_motion(level, Motion(), 1) is level


def test_periods_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(InputError, match="shortest_period 30 must be at most longest_period, 20"):
        Motion.from_dict({"shortest_period": 30.0})
