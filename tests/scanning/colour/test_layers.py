"""Colours and layers of points: the materials' own, light and clouds, and what the scenario says."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.materials.table import materials
from synthroads_addon.road.surroundings import Environment
from synthroads_addon.scanning.colour.colour import (
    FROM_MATERIAL,
    FROM_NODES,
    MATERIAL_LAYERS,
    MaterialLayers,
    SeenPoints,
    encode_srgb,
    needed_layers,
    shares_by_source,
    surface_constants,
)
from synthroads_addon.scanning.colour.light import (
    SHADE,
    SUN,
    WHITE,
    CloudShadows,
    SunAndSky,
    expose_light,
    sun_direction,
)
from synthroads_addon.scenario.colour import COLOUR_FIDELITIES, ColourScenario

ALL = frozenset({"rgb", *MATERIAL_LAYERS})
ROWS = [materials()[name] for name in ("asphalt", "paint_white", "galvanised_steel")]


def _points(count: int = 50) -> dict[str, np.ndarray]:
    random = np.random.default_rng(1)
    normal = random.normal(size=(count, 3))
    return {
        "position": random.uniform(-50.0, 50.0, (count, 3)),
        "scanner": random.uniform(-50.0, 50.0, (count, 3)) + [0.0, 0.0, 100.0],
        "normal": normal / np.linalg.norm(normal, axis=1, keepdims=True),
        "material": random.integers(0, len(ROWS), count).astype(np.uint16),
        "time": random.uniform(0.0, 100.0, count),
    }


def test_materials_give_their_means_under_a_usual_sun_and_sky() -> None:
    points = _points()
    values = MaterialLayers(surface_constants(ROWS)).sample(SeenPoints(**points), ALL)
    for name in MATERIAL_LAYERS:
        expected = np.array([getattr(ROWS[i], name) for i in points["material"]])
        np.testing.assert_allclose(values.arrays[name], expected, atol=1e-7)
    color = np.array([ROWS[i].base_color for i in points["material"]])
    linear = np.clip(color * (0.45 + 0.55 * np.clip(points["normal"] @ SUN, 0.0, 1.0))[:, None], 0.0, 1.0)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055) * 65535.0
    assert np.abs(values.arrays["rgb"].astype(float) - expected).max() <= 2.0
    assert (values.source == FROM_MATERIAL).all()


def test_means_stand_where_nothing_was_rendered_and_what_was_rendered_stays() -> None:
    points, random = SeenPoints(**_points()), np.random.default_rng(2)
    constants = surface_constants(ROWS, {name: np.array([True, False, True]) for name in MATERIAL_LAYERS})
    source = np.where(random.random(len(points)) < 0.7, FROM_NODES, FROM_MATERIAL).astype(np.uint8)
    channels = {name: random.random((len(points), parts)).astype(np.float32) for name, parts in MATERIAL_LAYERS.items()}
    before = {name: array.copy() for name, array in channels.items()}
    values = MaterialLayers(constants).layer_values(points, channels, source, frozenset(MATERIAL_LAYERS))
    rendered = (source == FROM_NODES) & (points.material != 1)
    assert 0 < np.count_nonzero(rendered) < len(points)
    for name, array in values.arrays.items():
        means = constants.values[name][points.material]
        np.testing.assert_array_equal(array[rendered], channels[name].reshape(means.shape)[rendered])
        np.testing.assert_array_equal(array[~rendered], means[~rendered])
        np.testing.assert_array_equal(channels[name], before[name])


def test_the_sky_is_that_above_and_below_by_the_share_of_each_to_the_last_digit() -> None:
    light = SunAndSky(above=np.array([0.3, 0.4, 0.55]), below=np.array([0.21, 0.2, 0.17]))
    normal = _points()["normal"].astype(np.float32)
    share = (np.float32(1.0) + normal[:, 2:]) / np.float32(2.0)
    above, below = light.above.astype(np.float32), light.below.astype(np.float32)
    np.testing.assert_array_equal(light.sky(normal), share * above + (np.float32(1.0) - share) * below)


def test_shares_name_every_source() -> None:
    counts = np.zeros(256, int)
    counts[[0, 1, 2, 7, 254, 255]] = 10, 50, 20, 10, 5, 5
    shares = shares_by_source(counts)
    assert shares == {"material": 0.1, "image": 0.5, "next image": 0.3, "nearby": 0.05, "return": 0.05}
    assert shares_by_source(np.zeros(256, int)) == {}


def test_only_wanted_layers_are_given() -> None:
    values = MaterialLayers(surface_constants(ROWS)).sample(SeenPoints(**_points()), frozenset({"metallic"}))
    assert set(values.arrays) == {"metallic"}


def test_no_points_are_no_values() -> None:
    values = MaterialLayers(surface_constants(ROWS)).sample(SeenPoints(**_points(0)), ALL)
    assert values.arrays["rgb"].shape == (0, 3)


@pytest.mark.parametrize(
    ("mode", "needed"),
    [("lit", {"base_color"}), ("unlit", {"base_color"}), ("false_colour", {"roughness", "metallic", "specular"})],
)
def test_a_mode_of_rgb_needs_its_layers(mode: str, needed: set[str]) -> None:
    assert needed_layers(frozenset({"rgb"}), mode) == needed  # type: ignore[arg-type]


def test_unlit_and_false_colours_are_layers() -> None:
    points, constants = _points(), surface_constants(ROWS)
    unlit = MaterialLayers(constants, "unlit").sample(SeenPoints(**points), ALL).arrays
    np.testing.assert_array_equal(unlit["rgb"], encode_srgb(unlit["base_color"]))
    false = MaterialLayers(constants, "false_colour").sample(SeenPoints(**points), ALL).arrays
    np.testing.assert_array_equal(false["rgb"][:, 1], encode_srgb(false["metallic"]))


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_encoding_keeps_order_and_ends(a: float, b: float) -> None:
    low, high = sorted([a, b])
    assert encode_srgb(np.array([low]))[0] <= encode_srgb(np.array([high]))[0]
    assert encode_srgb(np.array([0.0, 1.0, 2.0])).tolist() == [0, 65535, 65535]


@given(st.floats(0.0, 360.0), st.floats(0.0, 90.0))
def test_the_sun_stands_where_the_environment_says(azimuth: float, elevation: float) -> None:
    x, y, z = sun_direction(Environment(sun_azimuth_deg=azimuth, sun_elevation_deg=elevation))
    assert np.isclose(x * x + y * y + z * z, 1.0)
    assert np.isclose(np.rad2deg(np.arcsin(np.clip(z, -1.0, 1.0))), elevation, atol=1e-5)
    if elevation < 89.0:
        assert np.isclose(np.cos(np.arctan2(x, y) - np.deg2rad(azimuth)), 1.0)


@given(st.floats(0.0, 89.0), st.floats(0.1, 5.0), st.floats(0.05, 2.0))
def test_the_exposure_suits_a_white_surface_in_the_sun(elevation: float, sun: float, sky: float) -> None:
    direction = sun_direction(Environment(sun_elevation_deg=elevation))
    light, exposure = expose_light(direction, np.full(3, sun), np.full(3, sky))
    up = np.array([[0.0, 0.0, 1.0]])
    assert np.allclose(light.sunlight(up) + light.sky(up), WHITE, rtol=1e-5)
    assert np.isclose(exposure * (sun * direction[2] + sky), WHITE)
    # What faces the ground has what that throws back: soil and grass, 15 to 25 % of the light.
    assert abs(light.sky(-up) / WHITE - 0.2).max() <= 0.05


def test_what_faces_away_from_the_sun_has_the_sky_alone() -> None:
    light = SunAndSky()
    assert (light.sunlight(-light.direction[None]) == 0.0).all()
    assert (light.sky(-light.direction[None]) > 0.0).all()


CLOUDY = Environment(cloud_cover=0.4, cloud_speed=8.0, cloud_direction_deg=120.0, sun_elevation_deg=50.0)


@pytest.mark.parametrize("cover", [0.0, 0.1, 0.4, 0.8, 1.0])
def test_clouds_cover_their_share_of_the_ground(cover: float) -> None:
    shadows = CloudShadows(CLOUDY.model_copy(update={"cloud_cover": cover}), seed=3)
    # All of the periodic field: 256 cells of an eighth of 120 m.
    side = (np.arange(512) + 0.5) / 512 * 256 * 15.0
    x, y = np.meshgrid(side, side)
    ground = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    share = shadows.transmission(ground, 0.0)
    assert share.min() >= SHADE - 1e-6
    assert share.max() <= 1.0
    assert np.isclose(((1.0 - share) / (1.0 - SHADE)).mean(), cover, atol=0.01)


@cache
def _cloudy() -> CloudShadows:
    return CloudShadows(CLOUDY, seed=3)


@given(st.floats(-200.0, 200.0), st.floats(-500.0, 500.0), st.floats(0.0, 300.0))
def test_shadows_drift_with_the_wind(x: float, y: float, seconds: float) -> None:
    shadows = _cloudy()
    drift = 8.0 * seconds * np.array([np.sin(np.deg2rad(120.0)), np.cos(np.deg2rad(120.0)), 0.0])
    here = np.array([[x, y, 0.0]])
    assert np.allclose(shadows.transmission(here, 10.0), shadows.transmission(here + drift, 10.0 + seconds), atol=1e-3)


def test_the_drift_can_be_measured_in_the_colours() -> None:
    """Two passes over the same ground: the shift that fits their colours best is the wind's."""
    shadows = CloudShadows(CLOUDY.model_copy(update={"cloud_direction_deg": 90.0}), seed=5)
    layers = MaterialLayers(surface_constants(ROWS), clouds=shadows)
    x = np.arange(0.0, 2000.0, 2.0)
    line = {
        "position": np.stack([x, 0 * x, 0 * x], axis=1),
        "scanner": np.stack([x, 0 * x, 0 * x + 60.0], axis=1),
        "normal": np.tile([0.0, 0.0, 1.0], (len(x), 1)),
        "material": np.zeros(len(x), np.uint16),
    }
    passes = (SeenPoints(**line, time=np.full(len(x), time)) for time in (0.0, 30.0))
    first, second = (layers.sample(seen, frozenset({"rgb"})).arrays["rgb"][:, 0].astype(float) for seen in passes)
    errors = [np.abs(second[k:] - first[: len(x) - k]).mean() for k in range(200)]
    assert np.argmin(errors) * 2.0 == 8.0 * 30.0
    assert errors[0] > 20.0 * max(errors[120], 1.0)


def test_all_places_on_a_ray_of_the_sun_share_its_cloud() -> None:
    shadows = CloudShadows(CLOUDY, seed=3)
    foot = np.random.default_rng(1).uniform(-500.0, 500.0, (50, 3)) * [1.0, 1.0, 0.0]
    low = shadows.transmission(foot, 7.0)
    assert np.ptp(low) > 0.5
    np.testing.assert_allclose(shadows.transmission(foot + 40.0 * sun_direction(CLOUDY), 7.0), low, atol=1e-5)


def test_clouds_repeat_with_their_seed() -> None:
    places = np.random.default_rng(0).uniform(-1e3, 1e3, (100, 3))
    a, b, c = (CloudShadows(CLOUDY, seed).transmission(places, 5.0) for seed in (1, 1, 2))
    assert (a == b).all()
    assert (a != c).any()


def test_the_fidelity_gives_what_the_scenario_leaves_open() -> None:
    assert ColourScenario(lighting="path").settings("high") == replace(COLOUR_FIDELITIES["high"], lighting="path")
    own = ColourScenario(image_spacing=7.0).settings("draft")
    assert own.image_spacing == 7.0
    assert own.ground_sampling_distance == COLOUR_FIDELITIES["draft"].ground_sampling_distance
    assert own.samples == 1, "direct lighting has no noise"
    far = ColourScenario().settings("draft", 600.0)
    assert far.image_spacing == 10.0 * COLOUR_FIDELITIES["draft"].image_spacing
    assert far.ground_sampling_distance == 10.0 * COLOUR_FIDELITIES["draft"].ground_sampling_distance


@pytest.mark.parametrize(
    ("data", "field"),
    [
        ({"image_spacing": 0.0}, "image_spacing"),
        ({"ground_sampling_distance": -1.0}, "ground_sampling_distance"),
        ({"source": "photos"}, "source"),
        ({"samples": 8}, "samples can't be given for direct lighting"),
        ({"gsd": 0.1}, "gsd"),
    ],
)
def test_wrong_fields_are_named(data: dict[str, object], field: str) -> None:
    with pytest.raises(InputError, match=field):
        ColourScenario.from_dict(data)
