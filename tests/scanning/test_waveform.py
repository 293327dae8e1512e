"""Echoes that a pulse cannot part, against peaks of summed pulses on a fine grid; points that trail at an edge."""

from dataclasses import replace

import numpy as np
from scipy import stats

from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.receiving.waveform import FULL_WIDTH, have_one_peak, merge_peaks
from synthroads_addon.scanning.returns import Echoes
from tests.helpers.scenes.scan_scenes import ORIGIN, altered, mesh_of, middle_pulses, scan_of

WIDTH = 0.75
LENGTH = WIDTH / FULL_WIDTH
GRID = np.linspace(-1.0, 4.0, 20_001)


def pulses(powers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the summed pulses of echoes (N, E) on the grid, (N, grid)."""
    shape = np.exp(-((GRID - places[:, :, None]) ** 2) / (2 * LENGTH**2))
    return np.einsum("ne,neg->ng", powers, shape)


def drawn(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return powers and places (N, 2) of pairs of echoes."""
    rng = np.random.default_rng(5)
    powers = 10.0 ** rng.uniform(-2, 0, (count, 2))
    return powers, np.stack([np.zeros(count), rng.uniform(0.3, 2.5, count)], axis=1)


def test_pairs_are_one_return_where_their_sum_has_one_peak() -> None:
    powers, places = drawn(300)
    sums = pulses(powers, places)
    peaks = np.count_nonzero((sums[:, 1:-1] > sums[:, :-2]) & (sums[:, 1:-1] >= sums[:, 2:]), axis=1)
    one = have_one_peak(np.log(powers[:, 0] / powers[:, 1]), places[:, 1] / LENGTH)
    assert 50 < np.count_nonzero(one) < 250
    np.testing.assert_array_equal(one, peaks == 1)


def test_their_range_and_power_are_those_of_the_peak() -> None:
    powers, places = drawn(300)
    number = np.arange(600)
    echoes = merge_peaks(
        Echoes(number // 2, number, 10.0 + places.ravel(), powers.ravel(), np.ones(600)),
        WIDTH,
    )
    count = np.bincount(echoes.pulse, minlength=300)
    assert set(count) == {1, 2}
    single = np.flatnonzero(count == 1)
    sums = pulses(powers[single], places[single])
    merged = echoes.select(np.isin(echoes.pulse, single))
    np.testing.assert_allclose(merged.range - 10.0, GRID[sums.argmax(axis=1)], atol=2e-3)
    np.testing.assert_allclose(merged.intensity, sums.max(axis=1), rtol=1e-5)
    np.testing.assert_array_equal(merged.hit, 2 * single + powers[single].argmax(axis=1))
    np.testing.assert_allclose(merged.weight, 2.0)
    # All else is as it was, in order.
    parted = np.isin(echoes.pulse, single, invert=True)
    np.testing.assert_array_equal(echoes.range[parted], 10.0 + places[count == 2].ravel())
    assert np.all(np.diff(echoes.pulse) >= 0)


def edge(step: float) -> tuple:
    """Return ground below the scanner, 60 m away, and a plate a step above it that ends below the beams."""
    roof = [(-50, -50, step), (50, -50, step), (50, 0, step), (-50, 0, step)]
    ground = [(-500, -500, 0), (500, -500, 0), (500, 500, 0), (-500, 500, 0)]
    return mesh_of(roof + ground, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])


def test_points_trail_between_an_edge_and_what_is_behind_it() -> None:
    plan = scan_of(edge(0.78), 61, divergence=(10e-3, 10e-3), range_resolution=WIDTH)
    sharp = middle_pulses(plan, 12).points
    receiver = Receiver(echo_separation="waveform")
    mixed = middle_pulses(altered(plan, setting=replace(plan.setting, receiver=receiver)), 12).points
    off = [np.min(np.abs(points.xyz[:, 2, None] - ORIGIN[2] - [0.0, 0.78]), axis=1) for points in (sharp, mixed)]
    assert off[0].max() < 5e-3
    assert 1e-2 < off[1].max() < 0.3
    assert 12 <= len(mixed) < len(sharp)


def test_shares_of_a_plate_in_the_beam_are_those_of_a_gaussian_beam() -> None:
    """Where surfaces are nearer than the resolution the range is the mean over the beam, at any place of the edge."""
    step = 0.3
    plan = scan_of(edge(step), 61, divergence=(10e-3, 10e-3), range_resolution=WIDTH)
    points = middle_pulses(plan, 40).points
    place = 60.0 * np.tan(np.deg2rad(points.scan_angle_deg.astype(np.float64)))
    near = stats.norm.cdf(place / (60.0 * 10e-3 / 4))
    height = (60.0 / np.cos(np.deg2rad(points.scan_angle_deg)) - points.range) * np.cos(
        np.deg2rad(points.scan_angle_deg)
    )
    assert np.abs(height / step - near).max() < 0.12
