"""The pattern that the documentation has its readers write."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.scanning.patterns.base import PulseTiming
from tests.helpers.page_modules import module_of_page


def test_the_pattern_of_the_page_works(monkeypatch: pytest.MonkeyPatch) -> None:
    file = "synthroads_addon/scanning/patterns/lissajous.py"
    model = module_of_page("extend/pattern.md", file, monkeypatch).Lissajous
    pattern = model.from_dict({"type": "lissajous", "along_field_deg": 40.0, "lines": 4, "forward_swings": 5})
    timing = PulseTiming(20e3, 100.0, np.deg2rad(60.0), pattern.sweep(np.deg2rad(60.0)) * 100.0 / 20e3, 200)
    shot = pattern.rays(timing, np.arange(1600), True)
    forward = np.rad2deg(np.arctan2(shot.direction[0], -shot.direction[2]))
    assert np.abs(np.rad2deg(shot.scan_angle)).max() == pytest.approx(30.0)
    assert np.abs(forward).max() == pytest.approx(20.0)
    assert np.abs(np.diff(shot.scan_angle)).max() == pytest.approx(timing.angle_step, rel=1e-3)
    np.testing.assert_allclose(np.diff(shot.time), 1 / 20e3)
    np.testing.assert_array_equal(shot.direction[:, :800], shot.direction[:, 800:])
    frame = np.stack([shot.direction, shot.in_plane, shot.across])
    products = np.einsum("aip,bip->pab", frame, frame)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-12)
