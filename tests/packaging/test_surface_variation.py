"""Surface variation and residuals about planes agree with their definitions, point by point."""

import numpy as np
import pytest

from studies.surfaces import surface_variation as module
from studies.surfaces.surface_variation import plane_residuals, surface_variation


def rough_plane(count: int, sigma: float, size: float = 10.0, slope: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(4)
    plan = rng.uniform(0, size, (count, 2))
    return np.column_stack([plan, slope * plan[:, 0] + rng.normal(0, sigma, count)])


def test_variation_by_definition() -> None:
    rng = np.random.default_rng(0)
    xyz = rng.uniform(-2, 2, (600, 3)) * np.array([1, 1, 0.3]) + np.array([294_000.0, 5_628_000.0, 180.0])
    expected = []
    for point in xyz:
        near = xyz[np.linalg.norm(xyz - point, axis=1) <= 0.5]
        values = np.linalg.eigvalsh(np.cov(near.T)) if len(near) >= 8 else np.full(3, np.nan)
        expected.append(values[0] / values.sum())
    found = surface_variation(xyz, 0.5)
    assert 0 < np.isnan(found).sum() < len(found)
    assert found == pytest.approx(np.array(expected), rel=1e-9, abs=1e-12, nan_ok=True)


def test_variation_of_chosen_points_and_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    xyz = rough_plane(2000, 0.02)
    whole = surface_variation(xyz, 0.5)
    monkeypatch.setattr(module, "_QUERIES", 37)
    chosen = np.array([5, 1999, 700, 0, 5])
    np.testing.assert_allclose(surface_variation(xyz, 0.5, chosen), whole[chosen], rtol=1e-12)


@pytest.mark.parametrize("density", [18, 134])
def test_variation_of_noisy_plane_knows_no_density(density: int) -> None:
    xyz = rough_plane(density * 400, 0.02, 20.0)
    inside = np.flatnonzero((np.abs(xyz[:, :2] - 10) < 8).all(axis=1))[:1000]
    assert np.median(surface_variation(xyz, 1.0, inside)) == pytest.approx(2 * 0.02**2, rel=0.05)


def test_variation_without_points_or_neighbours() -> None:
    assert surface_variation(np.empty((0, 3)), 1.0).shape == (0,)
    assert np.isnan(surface_variation(np.zeros((3, 3)), 1.0)).all()
    assert np.isnan(surface_variation(np.zeros((20, 3)), 1.0)).all()  # all in one place: no direction at all


def test_residuals_by_definition() -> None:
    xyz = rough_plane(1500, 0.03, slope=0.3) + np.array([294_000.0, 5_628_000.0, 180.0])
    found, number = plane_residuals(xyz, 2.0)
    low = xyz[:, :2].min(axis=0)
    expected = []
    for cell in np.unique(np.floor((xyz[:, :2] - low) / 2.0), axis=0):
        part = xyz[(np.floor((xyz[:, :2] - low) / 2.0) == cell).all(axis=1)]
        design = np.column_stack([np.ones(len(part)), part[:, :2] - part[:, :2].mean(axis=0)])
        rest = part[:, 2] - design @ np.linalg.lstsq(design, part[:, 2], rcond=None)[0]
        expected.append((np.sqrt(rest @ rest / (len(part) - 3)), len(part)))
    np.testing.assert_allclose(np.column_stack([found, number]), np.array(expected), rtol=1e-6)
    assert np.sqrt(np.mean(found**2)) == pytest.approx(0.03, rel=0.05)


def test_residuals_leave_out_single_scan_lines_and_small_patches() -> None:
    rng = np.random.default_rng(2)
    line = np.column_stack([rng.uniform(0, 1, 50), rng.normal(0.5, 0.01, 50), rng.normal(0, 0.01, 50)])
    few = np.column_stack([rng.uniform((3.1, 3.6), (3.9, 4.4), (9, 2)), np.zeros(9)])
    assert len(plane_residuals(np.vstack([line, few]), 1.0)[0]) == 0
    assert len(plane_residuals(np.vstack([line, few]), 1.0, fewest=9)[0]) == 1
    assert len(plane_residuals(np.empty((0, 3)), 1.0)[0]) == 0
