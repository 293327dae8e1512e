"""The weathers that the documentation has its readers write."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.classes import UNLABELLED
from tests.helpers.page_modules import module_of_page
from tests.helpers.scenes.scan_scenes import altered, middle_pulses, plane, scan_of

PAGE, FOLDER = "extend/weather.md", "synthroads_addon/scanning/weather"


def test_the_smoke_of_the_page_dims_the_beam(monkeypatch: pytest.MonkeyPatch) -> None:
    smoke = module_of_page(PAGE, f"{FOLDER}/smoke.py", monkeypatch).Smoke()
    assert 0.0 < smoke.attenuation(1550.0) < smoke.attenuation(905.0)
    assert smoke.effects() == ()


def test_the_stones_of_the_page_are_met_before_the_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    hail = module_of_page(PAGE, f"{FOLDER}/hail.py", monkeypatch).Hail(free_path=300.0)
    points = middle_pulses(altered(scan_of(plane()), effects=hail.effects()), 900).points
    stones = points.class_id == UNLABELLED
    assert (points.range[stones] < 60.0 / np.cos(np.deg2rad(points.scan_angle_deg[stones]))).all()
    expected = 1.0 - np.exp(-points.range[~stones] / 300.0)
    assert stones.sum() == pytest.approx(expected.sum(), rel=0.25)
    np.testing.assert_array_equal(points.return_number[stones], 1)
