"""Sunlight that surfaces throw back: what is matt by Lambert, no light is lost, and none is made."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.scanning.colour.reflection import reflected_sunlight

UP = np.array([[0.0, 0.0, 1.0]], np.float32)


def reflect(color: float, roughness: float, metallic: float, specular: float, view: np.ndarray, sun: np.ndarray):
    """Return the red that a level surface throws back of each sun (N,) to each view (N, 3)."""
    count = len(view)
    columns = (np.full(count, value, np.float32) for value in (roughness, metallic, specular))
    normal = np.repeat(UP, count, axis=0)
    return reflected_sunlight(np.full((count, 3), color, np.float32), *columns, normal, view, sun)[:, 0]


def from_above(degrees: float, count: int = 1) -> np.ndarray:
    angle = np.deg2rad(degrees)
    return np.repeat(np.array([[np.sin(angle), 0.0, np.cos(angle)]], np.float32), count, axis=0)


def test_a_matt_surface_is_lamberts() -> None:
    for sun in (0.0, 40.0, 85.0):
        towards = from_above(sun)[0].astype(np.float64)
        for view in (0.0, 60.0):
            found = reflect(0.3, 0.5, 0.0, 0.0, from_above(view), towards)
            assert found == pytest.approx(0.3 * np.cos(np.deg2rad(sun)), rel=1e-5)
    assert reflect(0.3, 0.5, 1.0, 0.5, from_above(0.0), np.array([0.0, 1.0, -0.1])) == 0.0


@pytest.mark.parametrize(("metallic", "specular"), [(1.0, 0.0), (0.0, 0.5)])
def test_white_surfaces_lose_no_light(metallic: float, specular: float) -> None:
    """Under light from all over the sky white things are white, at any roughness and from any side."""
    roughness = np.repeat(np.array([0.4, 0.7, 1.0], np.float32), 2)
    count, white = len(roughness), np.ones((6, 3), np.float32)
    views = np.tile(np.concatenate([from_above(10.0), from_above(60.0)]), (3, 1))
    columns = (np.full(count, value, np.float32) for value in (metallic, specular))
    surface = (white, roughness, *columns, np.repeat(UP, count, axis=0), views)
    total, heights, around = np.zeros(count), 40, 32
    for height in (np.arange(heights) + 0.5) / heights:
        for angle in (np.arange(around) + 0.5) * 2.0 * np.pi / around:
            slant = np.sqrt(1.0 - height * height)
            sun = np.array([slant * np.cos(angle), slant * np.sin(angle), height])
            total += reflected_sunlight(*surface, sun)[:, 0]
    np.testing.assert_allclose(total * 2.0 / (heights * around), 1.0, atol=0.03)


def test_gloss_is_brightest_where_a_mirror_would_be() -> None:
    sun = from_above(40.0)[0].astype(np.float64)
    views = np.concatenate([from_above(angle) for angle in (-70.0, -40.0, 0.0, 40.0)])
    smooth = reflect(0.0, 0.3, 0.0, 0.5, views, sun)
    assert smooth.argmax() == 1
    rough = reflect(0.0, 0.9, 0.0, 0.5, views, sun)
    assert np.ptp(rough) < np.ptp(smooth)
