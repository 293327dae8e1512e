"""The sky beyond the scene gives a level surface the light that the scene's surfaces get."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.scanning.cameras.sky import Surroundings
from synthroads_addon.scanning.colour.light import GROUND_ALBEDO, SunAndSky


@pytest.mark.parametrize("clouds", [0.0, 0.5, 1.0])
def test_the_sky_lights_a_level_surface_as_the_scene_is_lit(clouds: float) -> None:
    light = SunAndSky(above=np.array([0.22, 0.28, 0.41]))
    random = np.random.default_rng(1)
    sine, azimuth = np.sqrt(random.random(200_000)), random.random(200_000) * 2.0 * np.pi  # as the cosine's law has it
    level = np.sqrt(1.0 - sine**2)
    direction = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), sine])
    colours = Surroundings(light, clouds).colours(direction)
    assert colours.mean() == pytest.approx(light.above.mean(), rel=0.03)
    blue = colours[:, 2].mean() / colours[:, 0].mean()
    assert blue > 1.2 if clouds == 0.0 else blue >= 0.999


def test_the_sky_is_brightest_at_the_sun_and_the_ground_is_below() -> None:
    light = SunAndSky()
    sun = light.direction
    places = np.stack([sun, [-sun[0], -sun[1], sun[2]], [0.0, 0.0, 1.0], [0.0, 0.6, -0.8]], axis=1)
    bright = Surroundings(light).colours(places).mean(axis=1)
    assert bright[0] > 2.0 * max(bright[1], bright[2])
    level = light.sun * sun[2] + light.above
    assert bright[3] == pytest.approx(GROUND_ALBEDO * level.mean() * np.mean([0.75, 1.0, 0.55]), rel=1e-3)
