"""The density-aware Chamfer distance against its formula in loops, and what it sees that the usual one doesn't."""

import numpy as np
import pytest

from synthroads_addon.cloud.selection.patches import make_patches, match_density
from synthroads_addon.comparison.chamfer import density_aware_chamfer, mean_chamfer
from tests.helpers.clouds.pavement_points import pavement


def by_loops(one: np.ndarray, other: np.ndarray, scale: float) -> float:
    """Return the distance by the formula."""
    total = 0.0
    for points, others in ((one, other), (other, one)):
        nearest = [int(np.argmin(np.linalg.norm(others - point, axis=1))) for point in points]
        terms = [
            1.0 - np.exp(-np.linalg.norm(point - others[near]) / scale) / nearest.count(near)
            for point, near in zip(points, nearest, strict=True)
        ]
        total += 0.5 * float(np.mean(terms))
    return total


def test_it_follows_its_formula() -> None:
    random = np.random.default_rng(1)
    for count in (5, 40, 90):
        one, other = random.normal(size=(40, 3)), random.normal(size=(count, 3))
        assert density_aware_chamfer(one, other, 0.3) == pytest.approx(by_loops(one, other, 0.3), rel=1e-12)


def test_equal_sets_are_0_and_points_that_one_stands_for_count() -> None:
    points = np.random.default_rng(2).uniform(size=(50, 3))
    assert density_aware_chamfer(points, points, 0.1) == 0.0
    doubled = np.concatenate([points, np.repeat(points[:1], 50, axis=0)])
    assert density_aware_chamfer(points, doubled, 0.1) == pytest.approx(0.25)


def test_a_lattice_is_farther_from_random_points_than_others_are() -> None:
    usual, other, lattice = (
        make_patches(pavement(seed=seed, **changes), "x")
        for seed, changes in ((1, {}), (2, {}), (3, {"height_noise": 0.3}))
    )
    alike, rough = (mean_chamfer(*match_density(usual, patches, 1, 400)) for patches in (other, lattice))
    assert 0.0 < alike < rough < 1.0
