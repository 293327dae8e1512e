"""Clouds and exposure of pictures: as much of the sky as the environment says, and ground that keeps its brightness."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.views import pictures
from synthroads_addon.blender.views.clouds import add_clouds, cloud_share
from synthroads_addon.blender.views.exposure import level_irradiance, stops_for
from synthroads_addon.road.surroundings import Environment

pytestmark = pytest.mark.any_blender


def overhead(environment: Environment, path: Path) -> np.ndarray:
    """Return the picture (H, W, 3) of the sky overhead."""
    empty_file()
    pictures.light(environment)
    bpy.context.scene.world.cycles.sampling_method = "NONE"  # quicker
    pictures.camera((0.0, 0.0, 0.0), (0.0, 0.4, 1.0), lens=16.0)
    pictures.render(path, (64, 64), 1)
    return np.asarray(Image.open(path).convert("RGB"), np.float64)


def test_clouds_cover_as_much_of_the_sky_as_the_environment_says(tmp_path: Path) -> None:
    clear = overhead(Environment(cloud_size=60.0), tmp_path / "clear.png")
    for cover in (0.3, 0.7):
        cloudy = overhead(Environment(cloud_cover=cover, cloud_size=60.0), tmp_path / "cloudy.png")
        changed = np.abs(cloudy - clear).max(axis=-1) > 40.0  # about half as bright as a dense one
        assert changed.mean() == pytest.approx(cover, abs=0.17), cover
    rain = overhead(Environment(weather="rain"), tmp_path / "rain.png")
    assert (np.abs(rain - clear).max(axis=-1) > 16.0).mean() > 0.95


def test_rain_falls_from_a_closed_sky_and_none_is_built_for_a_clear_one() -> None:
    assert cloud_share(Environment(weather="rain", cloud_cover=0.1)) == 1.0
    pictures.light(Environment())
    world = bpy.context.scene.world
    before = len(world.node_tree.nodes)
    add_clouds(world, Environment())
    assert len(world.node_tree.nodes) == before


def test_the_exposure_makes_up_for_most_of_a_low_sun() -> None:
    high, low = (Environment(sun_elevation_deg=elevation) for elevation in (42.0, 10.0))
    assert stops_for(level_irradiance(high)) == pytest.approx(0.0, abs=1e-6)
    stops = stops_for(level_irradiance(low))
    lost = np.log2(level_irradiance(high).mean() / level_irradiance(low).mean())
    assert lost > 1.0
    assert stops == pytest.approx(0.85 * lost)
    pictures.light(low)
    assert bpy.context.scene.view_settings.exposure == pytest.approx(stops, abs=1e-5)
