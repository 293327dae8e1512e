"""The platforms that the documentation has its readers write."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from tests.helpers.page_modules import module_of_page

PAGE, FOLDER = "extend/platform.md", "synthroads_addon/scanning/platforms"
GUIDE = PolylineGuide([(0.0, 0.0, 100.0), (60.0, 0.0, 100.0)])


def test_the_helicopter_of_the_page_flies_level(monkeypatch: pytest.MonkeyPatch) -> None:
    path = module_of_page(PAGE, f"{FOLDER}/helicopter.py", monkeypatch).Helicopter().make_path(GUIDE)
    (strip,) = path.strips
    assert strip.duration == pytest.approx(60.0 / 20.0)
    position, rotation = path.pose(strip, np.linspace(0.0, strip.duration, 5))
    np.testing.assert_allclose(position[:, 1:], [[0.0, 250.0]] * 5, atol=1e-9)
    np.testing.assert_allclose(rotation, [np.eye(3)] * 5, atol=1e-12)


def test_the_person_of_the_page_leans_forward(monkeypatch: pytest.MonkeyPatch) -> None:
    model = module_of_page(PAGE, f"{FOLDER}/backpack.py", monkeypatch).Backpack
    path = model(lean_deg=10.0).make_path(GUIDE)
    (strip,) = path.strips
    assert strip.duration == pytest.approx(60.0 / 1.3)
    position, rotation = path.pose(strip, np.linspace(0.0, strip.duration, 5))
    np.testing.assert_allclose(position[:, 1:], [[-16.0, 102.0]] * 5, atol=1e-9)
    forward = np.cos(np.deg2rad(10.0)), 0.0, -np.sin(np.deg2rad(10.0))
    np.testing.assert_allclose(rotation[:, :, 0], [forward] * 5, atol=1e-12)
    assert path.typical_range == 10.0
