"""Images: where points lie in them, which of them a point takes, and that it never takes another surface's values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.colour.colour import (
    FROM_MATERIAL,
    MATERIAL_LAYERS,
    NEARBY,
    ColourSettings,
    MaterialLayers,
    SeenPoints,
    encode_srgb,
    surface_constants,
)
from synthroads_addon.scanning.colour.images import REACH, ImageLayers, sample_image
from synthroads_addon.scanning.colour.light import SunAndSky
from synthroads_addon.scanning.colour.views import RenderedImage, View, views_along

DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
ROWS = [materials()[name] for name in ("asphalt", "paint_white")]


def _view(x: float = 0.0, height: float = 50.0, time: float = 0.0) -> View:
    return View(np.array([x, 0.0, height]), DOWN, 500.0, (200.0, 150.0), (400, 300), time)


def _field(places: np.ndarray) -> np.ndarray:
    """Return the base colour (..., 3) of the world: linear in x and y."""
    x, y = places[..., 0], places[..., 1]
    return np.stack([0.5 + x / 200.0, 0.5 + y / 200.0, 0.3 + (x + y) / 500.0], axis=-1)


def _ground_image(view: View, slope: float = 0.0, time: float = 0.0) -> RenderedImage:
    """Return the image of the plane z = slope * y, which is of material 0, with the field's colours."""
    width, height = view.size
    i, j = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = (
        np.stack([(i - view.centre[0]) / view.focal, (view.centre[1] - j) / view.focal, -np.ones_like(i)], axis=-1)
        @ view.rotation.T
    )
    depth = (slope * view.position[1] - view.position[2]) / (rays[..., 2] - slope * rays[..., 1])
    colors = _field(view.position + depth[..., None] * rays)
    return RenderedImage(view, colors.astype(np.float16), depth.astype(np.float32), np.ones_like(i, np.uint16))


def _layers(images: list[RenderedImage], mode: str = "unlit") -> ImageLayers:
    varies = {name: np.zeros(len(ROWS), bool) for name in MATERIAL_LAYERS}
    varies["base_color"][0] = True
    material = MaterialLayers(surface_constants(ROWS, varies), mode)  # type: ignore[arg-type]
    return ImageLayers(images, {"base_color": 3}, material)


def _seen(places: np.ndarray, normal: np.ndarray | None = None, material: int = 0) -> SeenPoints:
    count = len(places)
    up = np.tile([0.0, 0.0, 1.0], (count, 1)) if normal is None else normal
    return SeenPoints(places, places + [0.0, 0.0, 50.0], up, np.full(count, material, np.uint16), np.zeros(count))


def _sampled(layers: ImageLayers, places: np.ndarray, normal: np.ndarray | None = None, material: int = 0):
    return layers.sample(_seen(places, normal, material), frozenset({"base_color"}))


@given(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0), st.floats(-5.0, 30.0))
def test_a_point_lies_on_the_ray_of_its_pixel(x: float, y: float, z: float) -> None:
    view, point = _view(3.0), np.array([[x, y, z]])
    column, row, depth = view.project(point)
    ray = np.array([(column[0] - 200.0) / 500.0, (150.0 - row[0]) / 500.0, -1.0]) @ view.rotation.T
    assert np.allclose(view.position + depth[0] * ray, point)
    assert np.isclose(depth[0], 50.0 - z)


def test_a_linear_field_comes_back() -> None:
    places = np.random.default_rng(1).uniform(-10.0, 10.0, (500, 3)) * [1.0, 1.0, 0.0]
    values = _sampled(_layers([_ground_image(_view())]), places)
    assert (values.source == 1).all()
    np.testing.assert_allclose(values.arrays["base_color"], _field(places), atol=5e-4)


@pytest.mark.parametrize("slope", [0.5, 3.0])
def test_steep_planes_are_seen(slope: float) -> None:
    """Their depth changes by more than the tolerance from pixel to pixel."""
    y = np.random.default_rng(1).uniform(-8.0, 5.0, 300)
    places = np.stack([np.zeros(300), y, slope * y], axis=1)
    normal = np.tile(np.array([0.0, -slope, 1.0]) / np.hypot(1.0, slope), (300, 1))
    values = _sampled(_layers([_ground_image(_view(), slope)]), places, normal)
    assert (values.source == 1).mean() > 0.99
    np.testing.assert_allclose(values.arrays["base_color"], _field(places), atol=2e-3)


def test_an_occluder_is_never_taken() -> None:
    image = _ground_image(_view())
    # A plate of the same material over a third of the image, 0.3 m above the ground.
    image.depth[:, 100:233] -= np.float32(0.3)
    image.layers[:, 100:233] = 1.0
    places = np.random.default_rng(1).uniform(-12.0, 12.0, (4000, 3)) * [1.0, 1.0, 0.0]
    values, shown = sample_image(image, _seen(places))
    column, _, _ = image.view.project(places)
    assert not shown[(column > 101.0) & (column < 232.0)].any()
    assert shown[(column < 99.0) | (column > 234.0)].all()
    np.testing.assert_allclose(values, _field(places[shown]), atol=3e-3)


def test_values_stay_on_their_material() -> None:
    """A line of paint narrower than a pixel is wide doesn't bleed into the asphalt."""
    image = _ground_image(_view())
    image.material[:, 200:202], image.layers[:, 200:202] = 2, 1.0
    places = np.random.default_rng(1).uniform(-1.0, 1.0, (1000, 3)) * [1.0, 1.0, 0.0]
    values, _ = sample_image(image, _seen(places))
    assert values.max() < 0.6


def test_the_other_side_of_a_thin_sheet_is_not_taken() -> None:
    values = _sampled(_layers([_ground_image(_view())]), np.zeros((5, 3)), np.tile([0.0, 0.0, -1.0], (5, 1)))
    assert (values.source == FROM_MATERIAL).all()


def test_the_image_with_the_scanners_view_is_taken_then_the_next() -> None:
    images = [_ground_image(_view(x)) for x in (-8.0, 0.0, 8.0)]
    for number, image in enumerate(images):
        image.layers[...] = number / 4.0
    places = np.array([[-8.0, 0.0, 0.0], [0.1, 0.0, 0.0], [8.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    values = _sampled(_layers(images), places)
    assert values.source.tolist() == [1, 1, 1, FROM_MATERIAL]
    np.testing.assert_allclose(values.arrays["base_color"][:3, 0], [0.0, 0.25, 0.5])
    images[1].depth[...] = 1.0
    hidden = _sampled(_layers(images), places)
    assert hidden.source.tolist() == [1, 2, 1, FROM_MATERIAL]


def test_what_the_best_images_hide_is_looked_for_in_all_around() -> None:
    """Only the farthest of ten images shows the point: it comes after the three best."""
    images = [_ground_image(_view(x)) for x in np.arange(10.0)]
    for image in images[:9]:
        image.depth[...], image.layers[...] = 1.0, 1.0
    values = _sampled(_layers(images), np.zeros((1, 3)))
    assert values.source.tolist() == [10]
    np.testing.assert_allclose(values.arrays["base_color"], _field(np.zeros((1, 3))), atol=5e-4)


def _hidden_by(material: int, above: float) -> RenderedImage:
    """Return an image of the ground below a plate of a material in its right half, brighter than all else."""
    image = _ground_image(_view())
    image.material[:, 200:], image.layers[:, 200:] = material + 1, 2.0
    image.depth[:, 200:] -= np.float32(above)
    return image


def _edge_places() -> tuple[np.ndarray, np.ndarray]:
    """Return places on the ground (N, 3) below and beside such a plate, and how far below it they lie (N,), m."""
    places = np.random.default_rng(1).uniform(-1.0, 1.0, (3000, 3)) * [1.0, 1.0, 0.0]
    return places, -places[:, 1]


@pytest.mark.parametrize(("material", "above"), [(1, 0.1), (1, 5.0), (0, 1.01 * REACH), (0, 5.0)])
def test_hidden_points_take_their_own_surface_close_by_and_never_what_hides_them(material: int, above: float) -> None:
    """Neither another material, however close, nor the same from farther away."""
    places, below = _edge_places()
    values = _sampled(_layers([_hidden_by(material, above)]), places)
    near = values.source == NEARBY
    pixel = 0.1
    assert (values.source[below < -pixel] == 1).all()
    assert near[(below > pixel) & (below < 1.9 * pixel)].all()
    assert (values.source[below > REACH + pixel] == FROM_MATERIAL).all()
    error = np.abs(values.arrays["base_color"] - _field(places))[near]
    assert error.max() < REACH / 200.0 + 1e-3
    assert error.max() > 1e-3, "it is another place"


def test_the_nearest_place_of_all_images_is_taken() -> None:
    hiding = _hidden_by(1, 5.0)
    other = _hidden_by(1, 5.0)
    # The other image, which suits less, shows ground that is nearer to the point.
    other.material[:, :201], other.layers[:, :201] = 1, 0.25
    other.depth[:, :201] = 50.0
    shifted = RenderedImage(_view(0.5), other.layers, other.depth, other.material)
    place = np.array([[0.0, -0.15, 0.0]])
    assert _sampled(_layers([hiding]), place).arrays["base_color"][0, 1] > 0.45
    values = _sampled(_layers([hiding, shifted]), place)
    assert values.source.tolist() == [NEARBY]
    np.testing.assert_allclose(values.arrays["base_color"], 0.25)


@pytest.mark.parametrize("lit", [True, False])
def test_light_from_close_by_is_that_of_the_points_own_slope(lit: bool) -> None:
    light = SunAndSky(np.array([0.0, 0.6, 0.8]), np.full(3, 0.8), np.full(3, 0.1), np.full(3, 0.1))
    varies = {name: np.zeros(len(ROWS), bool) for name in MATERIAL_LAYERS}
    varies["base_color"][0] = True
    image = _ground_image(_view())
    image.depth[:, 200:] = 1.0
    color, own = np.array([0.2, 0.3, 0.4], np.float32), np.array([0.0, -0.6, 0.8])
    sun = color * light.sunlight(np.array([[0.0, 0.0, 1.0]])) * lit
    stack = np.concatenate([np.broadcast_to(part, (*image.depth.shape, 3)) for part in (color, sun)], axis=2)
    image = RenderedImage(image.view, stack.astype(np.float16), image.depth, image.material)
    constants = surface_constants(ROWS, varies)
    layers = ImageLayers([image], {"base_color": 3, "sun": 3}, MaterialLayers(constants, "lit", light))
    places, normal = np.array([[0.0, -0.15, 0.0]]), own[None]
    values = layers.sample(_seen(places, normal), frozenset({"rgb"}))
    assert values.source.tolist() == [NEARBY]
    expected = color * (light.sunlight(normal) * lit + light.sky(normal))
    np.testing.assert_allclose(values.arrays["rgb"] / 65535.0, encode_srgb(expected) / 65535.0, atol=1e-3)


def test_points_of_a_whole_strip_find_the_images_along_it() -> None:
    """Far more images than a point has candidates, and points in any order."""
    x = np.arange(0.0, 1000.0, 10.0)
    images = [_ground_image(_view(float(place))) for place in x]
    for number, image in enumerate(images):
        image.layers[...] = number / 128.0
    places = np.random.default_rng(1).permutation(x)[:, None] * [1.0, 0.0, 0.0] + [1.0, 0.0, 0.0]
    values = _sampled(_layers(images), places)
    assert (values.source == 1).all()
    np.testing.assert_allclose(values.arrays["base_color"][:, 0] * 128.0, (places[:, 0] - 1.0) / 10.0)


def test_what_nothing_shows_has_its_materials_mean() -> None:
    values = _sampled(_layers([]), np.zeros((3, 3)), material=1)
    np.testing.assert_allclose(values.arrays["base_color"], np.tile(ROWS[1].base_color, (3, 1)), atol=1e-6)


def test_constant_materials_keep_their_exact_value() -> None:
    image = _ground_image(_view())
    image.material[...] = 2
    values = _sampled(_layers([image]), np.zeros((3, 3)), material=1)
    assert (values.source == 1).all()
    np.testing.assert_allclose(values.arrays["base_color"], np.tile(ROWS[1].base_color, (3, 1)), atol=1e-6)


@dataclass(frozen=True)
class _Strip:
    index: int
    start_time: float
    duration: float


class _Straight:
    """A path along x at a height over the ground; standing still with no speed."""

    def __init__(self, height: float, speed: float = 5.0, length: float = 100.0) -> None:
        self.height, self.speed, self.typical_range = height, speed, max(height, 10.0)
        self.strips = (_Strip(0, 0.0, length / 5.0),)

    def pose(self, strip: _Strip, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = np.stack([self.speed * time, 0 * time, 0 * time + self.height], axis=1)
        return position, np.broadcast_to(np.eye(3), (len(time), 3, 3))


def _terrain() -> np.ndarray:
    x, y = np.meshgrid(np.arange(-5.0, 106.0), np.arange(-40.0, 41.0))
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


@pytest.mark.parametrize("spacing", [10.0, 25.0, 33.0])
def test_high_cameras_cover_the_swath(spacing: float) -> None:
    settings = ColourSettings(spacing, 0.1, 1)
    views = views_along(_Straight(60.0), _terrain(), settings, np.deg2rad(60.0), 4096)
    assert len(views) == int(np.ceil(100.0 / spacing))
    places = np.random.default_rng(1).uniform([0.0, -31.0, 0.0], [100.0, 31.0, 6.0], (3000, 3))
    inside = np.zeros(3000, bool)
    for view in views:
        x, y, depth = view.project(places)
        inside |= (depth > 0.0) & (x > 0.0) & (x < view.size[0]) & (y > 0.0) & (y < view.size[1])
        assert np.isclose(60.0 / view.focal, 0.1)
    assert inside.all()


def test_images_are_no_larger_than_allowed() -> None:
    views = views_along(_Straight(60.0), _terrain(), ColourSettings(50.0, 0.02, 1), np.deg2rad(100.0), 512)
    assert max(max(view.size) for view in views) <= 513


def test_low_cameras_look_around() -> None:
    views = views_along(_Straight(2.5), _terrain(), ColourSettings(50.0, 0.05, 1), 6.0, 1024)
    at = {tuple(view.position) for view in views}
    assert len(at) == 2
    random = np.random.default_rng(1)
    for place in at:
        own = [view for view in views if tuple(view.position) == place]
        assert all(np.isclose(np.linalg.det(view.rotation), 1.0) for view in own)
        near = np.array([place[0], 0.0, 0.0]) + random.uniform([-30.0, -30.0, 0.0], [30.0, 30.0, 0.0], (500, 3))
        near = near[np.abs(near[:, 0]) < 100.0]
        inside = np.zeros(len(near), bool)
        for view in own:
            x, y, depth = view.project(near)
            inside |= (depth > 0.0) & (x >= 0.0) & (x <= view.size[0]) & (y >= 0.0) & (y <= view.size[1])
        assert inside[near[:, 0] > -4.0].all()


def test_a_platform_that_stands_has_one_place() -> None:
    views = views_along(_Straight(2.0, speed=0.0), _terrain(), ColourSettings(5.0, 0.05, 1), 6.0, 256)
    assert len({tuple(view.position) for view in views}) == 1
    assert {view.time for view in views} == {10.0}
