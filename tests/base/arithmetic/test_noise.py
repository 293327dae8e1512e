"""The noise field is the same everywhere by its definition, has the variance it states, and knows no blocks."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthroads_addon.base.arithmetic import noise as noise_module
from synthroads_addon.base.arithmetic.noise import MAX_OCTAVES, hash_cells, mean_deviation, noise_field
from synthroads_addon.base.random_streams import stream

TURN = np.array([[15, 6, -10], [6, 10, 15], [10, -15, 6]]) / 19.0


def scattered(count: int, seed: int = 0, size: float = 300.0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-size, size, (count, 3))


def hashed(*node: int, key: int) -> float:
    """Integer arithmetic of Python, one node at a time: nothing shared with the code under test."""

    def mixed(value: int) -> int:
        value = ((value ^ (value >> 15)) * 0x7FEB352D) % 2**32
        return value ^ (value >> 13)

    value = key
    for index, prime in zip(node, (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D), strict=True):
        value = mixed((value + index * prime) % 2**32)
    value = (value * 0x846CA68B) % 2**32
    return math.sqrt(3) * (value - 2**32 if value >= 2**31 else value) / 2**31


def by_definition(position: np.ndarray, wavelength: float, seed: int, octaves: int) -> float:
    keys = stream(seed, "noise field").integers(0, 2**32, MAX_OCTAVES, dtype=np.uint32)
    point, total = position * 2.0 / wavelength, 0.0
    for octave in range(octaves):
        point = TURN @ point
        base = np.floor(point).astype(int)
        above = (point - base) ** 2 * (3 - 2 * (point - base))
        value = 0.0
        for corner in np.ndindex(2, 2, 2):
            weight = math.prod((s if up else 1 - s) / math.hypot(s, 1 - s) for s, up in zip(above, corner, strict=True))
            value += weight * hashed(*(int(i) for i in base + corner), key=int(keys[octave]))
        total += value * 2.0 ** (-octave / 2)
        point = point * 2.0
    return total / math.sqrt(sum(2.0**-octave for octave in range(octaves)))


@pytest.mark.parametrize("octaves", [1, 4])
def test_follows_its_definition(octaves: int) -> None:
    position = scattered(50)
    expected = [by_definition(row, 0.3, 11, octaves) for row in position]
    assert noise_field(position, 0.3, 11, octaves) == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("place", [0.0, 0.25, 0.5])
def test_variance_is_one_at_every_place_of_a_cell(place: float) -> None:
    """Plain interpolation has 1/8 in the middle."""
    nodes = np.random.default_rng(1).integers(-500, 500, (40_000, 3)) + place + 1e-6
    values = noise_field(nodes @ TURN, 2.0, 5, octaves=1)
    assert values.std() == pytest.approx(1.0, abs=0.02)
    assert values.mean() == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("octaves", [1, 2, 4, 6, MAX_OCTAVES])
def test_variance_is_one_with_any_octaves(octaves: int) -> None:
    assert noise_field(scattered(100_000), 0.5, 2, octaves).std() == pytest.approx(1.0, abs=0.01)


def test_nearly_normal() -> None:
    values = noise_field(scattered(200_000), 0.5, 4, 4)
    share = [np.mean(np.abs(values) < k) for k in (1, 2, 3)]
    assert share == pytest.approx([0.683, 0.954, 0.997], abs=0.02)
    assert abs(np.mean(values**3)) < 0.02


def correlation(step: np.ndarray, octaves: int = 4) -> float:
    position = scattered(100_000, 3)
    return float(np.mean(noise_field(position, 1.0, 6, octaves) * noise_field(position + step, 1.0, 6, octaves)))


def test_correlation_is_that_of_the_documentation() -> None:
    directions = np.random.default_rng(0).normal(size=(12, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    at = {lag: np.array([correlation(lag * d) for d in directions]) for lag in (0.05, 0.28, 1.0, 1.76)}
    assert at[0.28].mean() == pytest.approx(np.exp(-1), abs=0.02)
    assert at[0.28].std() < 0.03  # the same in every direction
    assert at[0.05].min() > 0.85
    assert np.abs(at[1.0]).max() < 0.03
    assert np.abs(at[1.76]).max() < 0.015


def test_continuous_across_cells() -> None:
    """No steps: over 1e-6 of a wavelength nothing changes by more than the steepest slope times that."""
    start = scattered(2_000, 8)
    line = (start[:, None, :] + np.linspace(0, 1, 400)[None, :, None] * np.array([0.8, 0.6, 0.0])).reshape(-1, 3)
    near = noise_field(line, 1.0, 9, 3) - noise_field(line + 1e-6, 1.0, 9, 3)
    assert np.abs(near).max() < 1e-4


@settings(max_examples=20, deadline=None)
@given(cut=st.integers(0, 3000), chunk=st.integers(64, 5000), seed=st.integers(0, 2**32))
def test_blocks_and_order_do_not_matter(cut: int, chunk: int, seed: int) -> None:
    position = scattered(3000, 7)
    wavelength = np.where(np.arange(3000) % 2, 0.2, 0.4)
    whole = noise_field(position, wavelength, seed)
    order = np.random.default_rng(cut).permutation(3000)
    shuffled = np.empty(3000)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise_module, "CHUNK", chunk)
        for part in (order[:cut], order[cut:]):
            shuffled[part] = noise_field(position[part], wavelength[part], seed)
    assert (shuffled == whole).all()


def test_seeds_and_wavelengths_are_unrelated() -> None:
    position = scattered(50_000)
    first = noise_field(position, 0.2, 1)
    for other in (noise_field(position, 0.2, 2), noise_field(position, 0.31, 1)):
        assert np.mean(first * other) == pytest.approx(0.0, abs=0.02)


def test_octaves_are_unrelated() -> None:
    position = scattered(50_000)
    coarse = noise_field(position, 0.2, 1, 1)
    fine = noise_field(position, 0.2, 1, 2) * math.sqrt(1.5) - coarse
    assert fine.std() == pytest.approx(math.sqrt(0.5), abs=0.02)
    assert np.mean(coarse * fine) == pytest.approx(0.0, abs=0.02)


def test_map_coordinates_keep_the_field() -> None:
    """At 5.6e6 m a float64 still tells places 1 nm apart."""
    position = scattered(50_000, size=50) + np.array([294_000.0, 5_628_000.0, 180.0])
    values = noise_field(position, 0.1, 3, 6)
    assert values.std() == pytest.approx(1.0, abs=0.02)
    assert np.abs(values - noise_field(position + 1e-7, 0.1, 3, 6)).max() < 1e-3


@pytest.mark.parametrize("patch", [(0.3, 0.3), (1.0, 0.2), (2.0, 0.6)])
def test_means_over_patches_deviate_as_stated(patch: tuple[float, float]) -> None:
    """Means of an octave over Gaussian patches of a tilted plane; the noise of 60 places each is taken off."""
    rng = np.random.default_rng(5)
    plane = np.array([[1.0, 0.0, 0.0], [0.0, 0.94, 0.34]])
    place = rng.uniform(-1000, 1000, (1500, 1, 3)) + rng.normal(size=(1500, 60, 2)) * np.array(patch) @ plane
    values = noise_field(place.reshape(-1, 3), 2.0, 3, 1).reshape(1500, 60)
    variance = values.mean(axis=1).var() - values.var(axis=1, ddof=1).mean() / 60
    stated = float(mean_deviation(*(np.array([axis]) for axis in patch))[0]) ** 2
    assert variance == pytest.approx(stated, abs=0.05)


def test_an_averaged_field_is_the_field_with_flatter_octaves() -> None:
    position, patch = scattered(2000), (np.full(2000, 0.05), np.full(2000, 0.02))
    flat = noise_field(position, 0.2, 1, 1, patch)
    factor = mean_deviation(np.array([0.5]), np.array([0.2]))[0]
    np.testing.assert_allclose(flat, factor * noise_field(position, 0.2, 1, 1), rtol=1e-6)
    np.testing.assert_array_equal(
        noise_field(position, 0.2, 1, 4, (np.zeros(2000), np.zeros(2000))), noise_field(position, 0.2, 1, 4)
    )


def test_no_points() -> None:
    assert noise_field(np.empty((0, 3)), np.empty(0), 1).shape == (0,)


@pytest.mark.parametrize("octaves", [0, -1, MAX_OCTAVES + 1])
def test_octaves_out_of_range(octaves: int) -> None:
    with pytest.raises(ValueError, match="octaves"):
        noise_field(np.zeros((1, 3)), 1.0, 1, octaves)


def test_hashes_of_cells_are_uniform_and_unrelated_to_their_neighbours() -> None:
    axis = np.arange(-15, 15)
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij")).reshape(3, -1)
    share = hash_cells(cells, 5) / 2.0**32
    counts = np.histogram(share, 16, (0.0, 1.0))[0]
    assert counts.sum() == len(share)
    assert np.abs(counts / len(share) * 16.0 - 1.0).max() < 0.08
    grid = share.reshape(30, 30, 30)
    for turned in (grid[1:], grid[:, 1:], grid[:, :, 1:]):
        there = grid[tuple(slice(0, size) for size in turned.shape)]
        assert abs(np.corrcoef(there.ravel(), turned.ravel())[0, 1]) < 0.02
    assert (hash_cells(cells, 6) != hash_cells(cells, 5)).mean() > 0.99
