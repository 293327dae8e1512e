"""The sky beyond the scene gives a level surface the light that the scene's surfaces get."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.scanning.cameras.sky import Surroundings
from synthroads_addon.scanning.colour.light import GROUND_ALBEDO, SunAndSky
from synthroads_addon.scanning.weather.extinction import CONTRAST, visible_extinction


@pytest.mark.parametrize("visibility", [None, 23_000.0, 2000.0, 400.0, 100.0])
@pytest.mark.parametrize("clouds", [0.0, 0.5, 1.0])
def test_the_sky_lights_a_level_surface_as_the_scene_is_lit(clouds: float, visibility: float | None) -> None:
    extinction = visible_extinction(visibility) if visibility else 0.0
    light = SunAndSky(above=np.array([0.22, 0.28, 0.41]))
    random = np.random.default_rng(1)
    sine, azimuth = np.sqrt(random.random(200_000)), random.random(200_000) * 2.0 * np.pi  # as the cosine's law has it
    level = np.sqrt(1.0 - sine**2)
    direction = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), sine])
    surroundings = Surroundings(light, clouds, extinction)
    colours = surroundings.colours(direction)
    assert (colours >= 0.0).all()
    assert colours.mean() == pytest.approx(surroundings.light_below.above.mean(), rel=0.03)
    if visibility is not None and visibility < 23_000.0:
        return
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


def test_contrast_falls_to_the_visibilitys_over_the_visibility() -> None:
    """Koschmieder's law: of black before the horizon 2 % is left, and two parts of the way act one after the other."""
    visibility = 400.0
    surroundings = Surroundings(SunAndSky(), 0.0, visible_extinction(visibility))
    black, distance = np.zeros((3, 3), np.float32), np.array([0.0, visibility / 2.0, visibility])
    contrast = 1.0 - surroundings.through_air(black, distance) / surroundings.air
    assert contrast[:, 0] == pytest.approx([1.0, CONTRAST**0.5, CONTRAST], rel=1e-5)
    half = np.array([visibility / 2.0])
    twice = surroundings.through_air(surroundings.through_air(black[:1], half), half)
    assert twice == pytest.approx(surroundings.through_air(black[2:], distance[2:]), rel=1e-5)


def test_fog_has_no_horizon_and_no_sun() -> None:
    surroundings = Surroundings(SunAndSky(), 0.0, visible_extinction(100.0))
    sun = surroundings.light.direction
    ways = np.array([[1.0, 0.0, 1e-4], [1.0, 0.0, -1e-4], [0.0, 1.0, 1e-4], [sun[0], sun[1], sun[2]]]).T
    colours = surroundings.colours(ways / np.linalg.norm(ways, axis=0), 2.0)
    assert colours[:3] == pytest.approx(np.broadcast_to(surroundings.air, (3, 3)), rel=0.01)
    assert colours[3].mean() < 3.0 * colours[0].mean()
    assert surroundings.light_below.sun.max() < 1e-5 < surroundings.light.sun.min()
    clear = Surroundings(SunAndSky()).colours(ways)
    assert clear[3].mean() > 3.0 * clear[2].mean()
