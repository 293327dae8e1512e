"""Render targets: points take the surface's own colours and layers, from images and from a pixel of their own."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA, RenderedLayers, ReturnCamera, layer_source, light
from synthroads_addon.blender.cameras.images import aim
from synthroads_addon.blender.cameras.light import daylight
from synthroads_addon.blender.cameras.stage import Passes, stage
from synthroads_addon.blender.materials import material as table_material
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.colour.colour import (
    FROM_MATERIAL,
    FROM_RETURN,
    MATERIAL_LAYERS,
    NEARBY,
    ColourSettings,
    SeenPoints,
)
from synthroads_addon.scanning.colour.images import REACH
from synthroads_addon.scanning.colour.views import scene_sample, views_along
from tests.helpers.scenes.coded_scene import (
    ENVIRONMENT,
    GREY,
    PLATE,
    SIDE,
    OverPath,
    build_coded_scene,
    edge_distance,
    ground_values,
    job,
    plain_material,
    points_on,
    quad,
)

SOURCES = [
    "nodes",
    "images",
    pytest.param("returns", marks=pytest.mark.skipif(not HAS_RETURN_CAMERA, reason="Blender < 5")),
]
RENDERED = SOURCES[1:]
ACCURACY = {"nodes": 1e-6, "images": 1.0 / 255.0, "returns": 1e-4}
LOW, HIGH = (-SIDE + 0.5, -SIDE + 0.5, 0.0), (SIDE - 0.5, SIDE - 0.5, 0.0)
LAYERS = {"base_color", "roughness", "metallic"}


@pytest.mark.parametrize("source", SOURCES)
def test_points_have_the_surfaces_own_values(source: str) -> None:
    mesh = build_coded_scene()
    ground = points_on(mesh, 3000, LOW, HIGH, "Coded")
    with layer_source(job(mesh, LAYERS, source=source)) as layers:
        values = layers.sample(SeenPoints(**ground), frozenset(LAYERS))
    expected = ground_values(ground["position"])
    # The width of a pixel and a bit, from the checkerboard's edges.
    away = edge_distance(ground["position"]) > 0.06
    seen = ~np.isin(values.source, (FROM_MATERIAL, NEARBY))
    for name, wanted in expected.items():
        error = np.abs(values.arrays[name] - wanted)[seen & away]
        assert error.max() < ACCURACY[source], name
    y0, y1, _ = PLATE
    beside = (ground["position"][:, 1] < y0 - 1.0) | (ground["position"][:, 1] > y1 + 3.0)
    within = np.abs(ground["position"][:, 0]) < 10.0
    assert seen[beside & within].mean() > 0.99


@pytest.mark.parametrize("source", SOURCES)
def test_points_below_a_plate_never_take_its_colour(source: str) -> None:
    mesh = build_coded_scene()
    # Wholly below, and around the plate's edges.
    ground = points_on(mesh, 4000, (-SIDE, PLATE[0] - 1.0, 0.0), (SIDE, PLATE[1] + 3.0, 0.0), "Coded")
    with layer_source(job(mesh, {"base_color"}, source=source)) as layers:
        values = layers.sample(SeenPoints(**ground), frozenset({"base_color"}))
    error = np.abs(values.arrays["base_color"] - ground_values(ground["position"])["base_color"])[:, 1:]
    seen = ~np.isin(values.source, (FROM_MATERIAL, NEARBY))
    assert error[seen].max() < ACCURACY[source]
    # What is taken from close by is ground that is as close; the plate's colours differ by far more.
    near = values.source == NEARBY
    assert (error[near] < REACH / 40.0 + ACCURACY[source]).all()
    assert near.any() == (source == "images")
    # A pixel per return shows what is below; images can't, and the mean is taken.
    assert seen.mean() > (0.05 if source == "images" else 0.999)
    if source == "images":
        assert (~seen).mean() > 0.3


def test_a_wall_is_seen_in_its_own_colours() -> None:
    """A wall beside the path, at a grazing angle for cameras that look down."""
    quad("Wall", [(-SIDE, 8.0, 0.0), (SIDE, 8.0, 0.0), (SIDE, 8.0, 6.0), (-SIDE, 8.0, 6.0)], table_material("soil"))
    mesh = build_coded_scene(plate=False)
    wall = points_on(mesh, 1000, (-9.0, 8.0, 1.0), (9.0, 8.0, 5.0), "soil")
    wall["normal"][:] = [0.0, -1.0, 0.0]
    with layer_source(job(mesh, {"base_color"}, source="images")) as layers:
        values = layers.sample(SeenPoints(**wall), frozenset({"base_color"}))
    assert (values.source != FROM_MATERIAL).mean() > 0.95
    mean = layers.material.constants.values["base_color"][wall["material"][0]]
    # The pattern varies by half of the mean at most, and the ground is far brighter.
    assert (np.abs(values.arrays["base_color"] / mean - 1.0) < 0.6).all()
    assert values.arrays["base_color"].std(axis=0).min() > 0.01 * mean.max()


def test_places_lie_in_their_pixels() -> None:
    """A pixel's content is projected back into it, with an off-centre principal point as well."""
    mesh = build_coded_scene()
    settings = ColourSettings(7.0, 0.06, 1)
    views = views_along(OverPath(), scene_sample(mesh), settings, np.deg2rad(70.0), 4096)
    views += views_along(Low(), scene_sample(mesh), ColourSettings(20.0, 0.05, 1), 6.0, 300)
    assert max(abs(view.centre[1] - view.size[1] / 2.0) for view in views) > 10.0
    passes = Passes((), lit=False, depth=True, position=True)
    with stage(bpy.context.scene, mesh.materials, passes, (), None) as set_up:
        for view in views:
            aim(set_up.camera, view)
            rendered = set_up.render(*view.size)
            there = rendered.material > 0.5
            x, y, depth = view.project(rendered.position[there].astype(np.float64))
            row, column = np.nonzero(there)
            assert np.abs(np.hypot(x - column - 0.5, y - row - 0.5)).max() < 0.1, "far less than half a pixel"
            np.testing.assert_allclose(rendered.depth[there], depth, rtol=1e-5)


def test_what_light_comes_through_hides_the_ground_behind_it_from_the_camera() -> None:
    """Else Cycles adds up the layers of both."""
    low, high = (-SIDE, -SIDE, 1.0), (SIDE, SIDE, 1.0)
    corners = [low, (SIDE, -SIDE, 1.0), high, (-SIDE, SIDE, 1.0)]
    quad("Fence", corners, table_material("wire_mesh"))
    quad("Ground", [(x, y, 0.0) for x, y, _ in corners], table_material("soil"))
    mesh, before = scene_mesh(), _state()
    (view, *_) = views_along(OverPath(), scene_sample(mesh), ColourSettings(7.0, 0.06, 1), np.deg2rad(70.0), 256)
    with stage(bpy.context.scene, mesh.materials, Passes(("roughness", "metallic"), lit=False), (), None) as set_up:
        aim(set_up.camera, view)
        rendered = set_up.render(*view.size)
    assert _state() == before
    fence = rendered.material == mesh.materials.index("wire_mesh") + 1
    assert fence[rendered.material > 0.5].mean() > 0.999
    row = materials()["wire_mesh"]
    for name, mean in (("roughness", row.roughness), ("metallic", row.metallic)):
        assert np.abs(rendered.layers[name][fence].mean() - mean) < 0.1, name
        assert rendered.layers[name][fence].max() < 1.5 * mean + 0.1, name
    assert rendered.layers["roughness"][fence].std() > 0.005


class Low(OverPath):
    """A path that is low above the ground."""

    typical_range = 8.0

    def pose(self, strip: object, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position, rotation = super().pose(strip, time)  # type: ignore[arg-type]
        return position + [0.0, -3.0, -27.0], rotation


def test_images_around_a_low_platform_show_the_ground() -> None:
    mesh = build_coded_scene()
    ground = points_on(mesh, 500, (-9.0, -10.0, 0.0), (9.0, 2.0, 0.0), "Coded")
    ground["scanner"][:, 1:] = [-3.0, 3.0]
    task = job(mesh, LAYERS, source="images", ground_sampling_distance=0.08)
    with layer_source(task.__class__(**{**task.__dict__, "path": Low()})) as layers:
        values = layers.sample(SeenPoints(**ground), frozenset(LAYERS))
    assert (values.source != FROM_MATERIAL).mean() > 0.95
    away = (edge_distance(ground["position"]) > 0.15) & (values.source != FROM_MATERIAL)
    for name, wanted in ground_values(ground["position"]).items():
        assert np.abs(values.arrays[name] - wanted)[away].max() < 1.0 / 255.0, name


@pytest.mark.skipif(not HAS_RETURN_CAMERA, reason="Blender < 5")
def test_pixels_of_returns_lie_at_the_returns() -> None:
    mesh = build_coded_scene(plate=False)
    # Numbers that fill no image evenly.
    for count in (1, 7, 1500):
        ground = points_on(mesh, count, LOW, HIGH, "Coded")
        with layer_source(job(mesh, {"base_color"}, source="returns")) as layers:
            values = layers.sample(SeenPoints(**ground), frozenset({"base_color"}))
            assert isinstance(layers, ReturnCamera)
            assert (values.source == FROM_RETURN).all()
            assert layers.worst < 1e-4


@pytest.mark.skipif(not HAS_RETURN_CAMERA, reason="Blender < 5")
def test_a_return_from_something_else_takes_its_materials_mean() -> None:
    mesh = build_coded_scene()
    ground = points_on(mesh, 300, LOW, HIGH, "Plate")
    with layer_source(job(mesh, {"base_color"}, source="returns")) as layers:
        values = layers.sample(SeenPoints(**ground), frozenset({"base_color"}))
    assert (values.source == FROM_MATERIAL).all()
    assert np.ptp(values.arrays["base_color"], axis=0).max() == 0.0


def _linear(values: np.ndarray) -> np.ndarray:
    """Return what `encode_srgb` made of values above its linear part."""
    return ((values / 65535.0 + 0.055) / 1.055) ** 2.4


COARSE = {"image_spacing": 10.0, "ground_sampling_distance": 0.1}
COARSEST = {"image_spacing": 20.0, "ground_sampling_distance": 0.5}


@pytest.mark.parametrize(("lighting", "tolerance"), [("direct", 0.005), ("path", 0.10)])
@pytest.mark.parametrize("source", RENDERED)
def test_lit_colours_have_sun_sky_and_shadow(source: str, lighting: str, tolerance: float) -> None:
    """Matt ground reflects sun and sky alike; below an open sky both lightings agree."""
    mesh = build_coded_scene(matt=True)
    extra = {"samples": 8} if lighting == "path" else {}
    # The sun stands in the south, 60 degrees high: the plate's shadow lies to its north.
    shift = PLATE[2] / np.tan(np.deg2rad(60.0))
    shadow = points_on(mesh, 300, (-9.0, PLATE[1] + 1.5, 0.0), (9.0, PLATE[1] + shift - 0.3, 0.0), "Matt")
    sunny = points_on(mesh, 300, (-9.0, -10.0, 0.0), (9.0, -5.0, 0.0), "Matt")
    wanted = frozenset({"rgb"})
    with layer_source(job(mesh, {"rgb"}, source=source, lighting=lighting, **COARSE, **extra)) as layers:
        day = layers.material.light
        in_shadow, in_sun = layers.sample(SeenPoints(**shadow), wanted), layers.sample(SeenPoints(**sunny), wanted)
    up = np.array([[0.0, 0.0, 1.0]])
    sky, sun = np.array(GREY) * day.sky(up), np.array(GREY) * day.sunlight(up)
    assert (in_sun.source != FROM_MATERIAL).all()
    assert (in_shadow.source != FROM_MATERIAL).mean() > 0.9
    rendered = _linear(in_sun.arrays["rgb"]).mean(axis=0)
    np.testing.assert_allclose(rendered, (sky + sun)[0], rtol=tolerance)
    shaded = _linear(in_shadow.arrays["rgb"][in_shadow.source != FROM_MATERIAL]).mean(axis=0)
    if lighting == "direct":
        np.testing.assert_allclose(shaded, sky[0], rtol=tolerance)
    else:
        # The plate hides a part of the sky, and throws red light.
        assert (shaded < (sky + 0.3 * sun)[0]).all()
        assert (shaded > 0.3 * sky[0]).all()


@pytest.mark.any_blender
def test_each_sky_is_rendered_once_and_gives_the_same_light_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light, "_PROBE_SAMPLES", 8)

    def light_of(sun_elevation: float) -> bytes:
        with daylight(ENVIRONMENT.model_copy(update={"sun_elevation_deg": sun_elevation}), sharp=True) as day:
            return day.light.sky(np.array([[0.0, 0.0, 1.0]])).tobytes()

    light._sky_radiance.cache_clear()
    first = light_of(60.0)
    assert light_of(20.0) != first
    assert light_of(60.0) == first
    assert light._sky_radiance.cache_info().misses == 2
    light._sky_radiance.cache_clear()
    assert light_of(60.0) == first
    light._sky_radiance.cache_clear()


def test_constant_layers_are_not_rendered() -> None:
    mesh = build_coded_scene()
    with layer_source(job(mesh, {"specular"}, source="images")) as layers:
        assert not isinstance(layers, RenderedLayers), "the specular is constant on all materials"
    with layer_source(job(mesh, {"roughness", "specular"}, source="images")) as layers:
        assert isinstance(layers, RenderedLayers)
        assert layers.report["layers"] == ["roughness"]
        assert layers.report["images"] == 4
        assert layers.report["pixels"] == sum(image.view.pixels for image in layers.images)
    with layer_source(job(mesh, {"rgb"}, source="images", mode="unlit")) as layers:
        assert layers.report["layers"] == ["base_color"], "no light is rendered for the base colour"


def test_materials_alone_render_nothing() -> None:
    mesh = build_coded_scene()
    ground = points_on(mesh, 10, LOW, HIGH, "Coded")
    scenes = len(bpy.data.scenes)
    with layer_source(job(mesh, {"rgb"}, source="material")) as layers:
        assert len(bpy.data.scenes) == scenes
        assert (layers.sample(SeenPoints(**ground), frozenset({"rgb"})).source == FROM_MATERIAL).all()


def _state() -> dict[str, object]:
    """Return what can be told of the file: its data, the scene's settings, and the materials' nodes."""
    kinds = {
        name: sorted((item.name, item.users) for item in getattr(bpy.data, name))
        for name in dir(bpy.data)
        if isinstance(getattr(bpy.data, name), bpy.types.bpy_prop_collection) and name != "window_managers"
    }
    scene = bpy.context.scene
    settings = {
        key: str(getattr(scene.render, key)) for key in ("engine", "resolution_x", "filepath", "film_transparent")
    }
    layer = scene.view_layers[0]
    passes = [len(layer.aovs), len(layer.lightgroups), layer.use_pass_position, layer.use_pass_material_index]
    nodes = {
        item.name: (
            item.pass_index,
            [node.name for node in item.node_tree.nodes],
            len(item.node_tree.links),
            getattr(item.node_tree.nodes.active, "name", None),
            [node.name for node in item.node_tree.nodes if node.select],
        )
        for item in bpy.data.materials
        if item.node_tree
    }
    own = {"settings": settings, "passes": passes, "scene": scene.name, "world": scene.world}
    return own | {"data": kinds, "nodes": nodes}


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("source", SOURCES)
def test_the_scene_is_left_as_it_was(source: str, fails: bool) -> None:
    mesh = build_coded_scene()
    ground = points_on(mesh, 10, LOW, HIGH, "Coded")
    bpy.data.materials["Coded"].pass_index = 77
    before = _state()
    wanted = frozenset({"rgb", *LAYERS})
    light = {} if source == "nodes" else {"lighting": "path", "samples": 1}
    try:
        with layer_source(job(mesh, set(wanted), source=source, **light, **COARSEST)) as layers:
            layers.sample(SeenPoints(**ground), wanted)
            # Images are all rendered by now.
            assert (_state() == before) == isinstance(layers, RenderedLayers)
            if fails:
                raise KeyboardInterrupt
    except KeyboardInterrupt:
        assert fails
    assert _state() == before


def test_hidden_objects_are_not_rendered() -> None:
    mesh = build_coded_scene()
    bpy.data.objects["Plate"].hide_set(True)
    ground = points_on(mesh, 200, (-9.0, PLATE[0] + 0.5, 0.0), (9.0, PLATE[1] - 0.5, 0.0), "Coded")
    with layer_source(job(mesh, {"base_color"}, source="images")) as layers:
        values = layers.sample(SeenPoints(**ground), frozenset({"base_color"}))
    assert (values.source != FROM_MATERIAL).all()


def test_what_this_blender_cannot_do_is_refused() -> None:
    mesh = build_coded_scene()
    with (
        pytest.raises(InputError, match="engine" if HAS_RETURN_CAMERA else "source"),
        layer_source(job(mesh, {"rgb"}, source="returns", engine="eevee")),
    ):
        pass
    with (
        pytest.raises(InputError, match="lighting"),
        layer_source(job(mesh, {"rgb"}, source="images", engine="eevee", lighting="path")),
    ):
        pass
    for field, wrong in {"engine": {"engine": "eevee"}, "source": {"lighting": "path"}}.items():
        with pytest.raises(InputError, match=field), layer_source(job(mesh, {"rgb"}, source="nodes", **wrong)):
            pass


def test_an_image_has_the_clouds_of_its_own_time() -> None:
    mesh = build_coded_scene(plate=False, matt=True)
    cloudy = ENVIRONMENT.model_copy(update={"cloud_cover": 0.5, "cloud_size": 20.0, "cloud_speed": 10.0})
    ground = points_on(mesh, 2000, (-9.0, -9.0, 0.0), (9.0, 9.0, 0.0), "Matt")
    x = ground["position"][:, 0]
    with layer_source(job(mesh, {"rgb"}, cloudy, source="images", **COARSE)) as layers:
        red = _linear(layers.sample(SeenPoints(**ground), frozenset({"rgb"})).arrays["rgb"][:, 0])
        shading = layers.material
    up = np.array([[0.0, 0.0, 1.0]])
    share = (red - GREY[0] * shading.light.sky(up)[0, 0]) / (GREY[0] * shading.light.sunlight(up)[0, 0])
    # The images are taken at x = -5 and 5, after 1 and 3 seconds.
    own_time = np.where(x < 0.0, 1.0, 3.0)
    assert shading.clouds is not None
    expected = shading.clouds.transmission(ground["position"], own_time)
    assert np.ptp(expected) > 0.5
    np.testing.assert_allclose(share, expected, atol=0.01)


@pytest.mark.slow
def test_eevee_and_cycles_agree() -> None:
    mesh = build_coded_scene()
    ground = points_on(mesh, 2000, LOW, HIGH, "Coded")
    values = {}
    for engine in ("cycles", "eevee"):
        with layer_source(job(mesh, LAYERS, source="images", engine=engine, **COARSE)) as layers:
            values[engine] = layers.sample(SeenPoints(**ground), frozenset(LAYERS))
    away = edge_distance(ground["position"]) > 0.11
    both = away & (values["cycles"].source == 1) & (values["eevee"].source == 1)
    assert both.sum() > 0.95 * (away & (values["cycles"].source == 1)).sum()
    for name in MATERIAL_LAYERS.keys() & LAYERS:
        # Half floats have 11 bits: errors of up to 2^-12 of values below 1, in either.
        error = np.abs(values["cycles"].arrays[name] - values["eevee"].arrays[name])[both]
        assert error.max() < 2.0**-10, name


def test_materials_that_nothing_uses_stay_as_they_are() -> None:
    plain_material("Unused", (0.2, 0.2, 0.2))
    mesh = build_coded_scene()
    with layer_source(job(mesh, {"base_color"}, source="images", **COARSE)):
        assert bpy.data.materials["Unused"].pass_index == 0
