"""The rays of a pulse have the moments of the Gaussian beam that they stand for."""

import pytest

from synthroads_addon.core.scanning.beam import RINGS, beam_pattern


@pytest.mark.parametrize("rays", list(RINGS))
def test_counts_and_energy(rays: int) -> None:
    pattern = beam_pattern(rays)
    assert pattern.across.shape == (rays, 2)
    assert pattern.weights.min() > 0
    assert pattern.weights.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("rays", [7, 19, 37, 61])
def test_moments_of_gaussian(rays: int) -> None:
    """For exp(-2 r^2 / w^2) with w = 1: <x> = 0, <x^2> = 1/4, <x y> = 0; <x^4> = 3/16 from two rings on."""
    pattern = beam_pattern(rays)
    x, y = pattern.across.T
    mean = pattern.weights
    assert mean @ x == pytest.approx(0, abs=1e-14)
    assert mean @ (x * y) == pytest.approx(0, abs=1e-14)
    assert mean @ x**2 == pytest.approx(0.25, abs=1e-12)
    assert mean @ y**2 == pytest.approx(0.25, abs=1e-12)
    if rays > 7:
        assert mean @ x**4 == pytest.approx(3 / 16, abs=1e-12)
