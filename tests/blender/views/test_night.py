"""Night in pictures: lamps of real intensities, light sent back to the driver by the laws' numbers."""

import math
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from synthroads_addon.blender.cameras.light import measured_light
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.materials.surface_layers import layer_expressions
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.blender.views import glow, lamps
from synthroads_addon.blender.views.daylight import add_views, views_of
from synthroads_addon.materials.table import materials
from synthroads_addon.road.surroundings import Environment, Vehicle
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario

DISTANCE = 30.0


@pytest.fixture(autouse=True)
def _empty() -> Iterator[None]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield
    bpy.ops.wm.read_factory_settings(use_empty=True)


def plane(item: bpy.types.Material, place: tuple[float, float, float], size: float = 0.2) -> None:
    """Add a square that faces -y."""
    mesh = bpy.data.meshes.new("Plane")
    mesh.from_pydata([(-size, 0, -size), (size, 0, -size), (size, 0, size), (-size, 0, size)], [], [(0, 1, 2, 3)])
    mesh.materials.append(item)
    square = bpy.data.objects.new("Plane", mesh)
    square.location = place
    bpy.context.scene.collection.objects.link(square)


def camera(place: tuple[float, float, float], name: str = "Eye") -> bpy.types.Object:
    """Return a new camera that looks along +y through a narrow angle."""
    data = bpy.data.cameras.new(name)
    data.lens, data.sensor_width = 5000.0, 1.0
    item = bpy.data.objects.new(name, data)
    item.location, item.rotation_euler = place, (math.pi / 2.0, 0.0, 0.0)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.update()
    return item


def radiance(eye: bpy.types.Object, folder: Path) -> np.ndarray:
    """Return the mean radiance (3,) that a camera sees, rendered by Cycles."""
    scene = bpy.context.scene
    scene.camera = eye
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 16, False
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(folder / "seen.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(folder / "seen.exr"))
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return pixels.mean(axis=0)


@pytest.mark.parametrize(("name", "scale", "start"), [("sheeting_white", 0.7, 0.0), ("paint_white", 3.0, 1.05)])
def test_a_surface_sends_back_what_its_coefficient_says(name: str, scale: float, start: float, tmp_path: Path) -> None:
    table = materials()[name]
    plane(material(name), (0.0, DISTANCE, 1.2 - 0.55 - 0.6))  # 0.6 m below the lamp: 2 % down, the beam's middle
    eye = camera((0.0, 0.0, 1.2))
    eye.rotation_euler.x -= math.atan(1.15 / DISTANCE)
    headlights = bpy.data.objects.new("Headlights", None)
    bpy.context.scene.collection.objects.link(headlights)
    headlights.parent = eye
    headlights.location = lamps.DRIVER_LAMP
    headlights.rotation_euler = (math.atan(1.15 / DISTANCE), 0.0, 0.0)
    bpy.context.view_layer.update()
    glow.add_glow(headlights)
    seen = radiance(eye, tmp_path)
    lamp, spot = np.array(headlights.matrix_world.translation), np.array([0.0, DISTANCE, 0.05])
    to_lamp, to_eye = lamp - spot, np.array([0.0, 0.0, 1.2]) - spot
    distance = np.linalg.norm(to_lamp)
    angle = math.degrees(math.acos(to_lamp @ to_eye / distance / np.linalg.norm(to_eye)))
    _, y, z = np.array(headlights.matrix_world.inverted()) @ np.array([*spot, 1.0]) @ np.eye(4)[:, :3]
    depth = min(y / -z + 0.02, 0.0) / 0.03
    t = min(max((y / -z + 0.02) / 0.016, 0.0), 1.0)
    beam = (1.0 + (0.03 - 1.0) * t * t * (3.0 - 2.0 * t)) / (1.0 + depth * depth)
    illuminance = lamps.BEAM * beam / distance**2
    entrance = math.acos(to_eye[1] / -np.linalg.norm(to_eye))
    lobe = math.exp(-((entrance / math.radians(table.retro_lobe_deg)) ** 2))
    luminance = table.retroreflection / math.pi * illuminance * math.exp(-max(angle - start, 0.0) / scale) * lobe
    hue = np.array(table.base_color) / max(table.base_color)
    assert seen.max() == pytest.approx(luminance / lamps.LUX * hue.max(), rel=0.25 if name == "paint_white" else 0.01)
    other = camera((3.0, 0.0, 1.2), "Other")
    other.rotation_euler = (math.pi / 2.0 - math.atan(1.15 / DISTANCE), 0.0, math.atan(3.0 / DISTANCE))
    assert radiance(other, tmp_path).max() < 1e-6  # it has no headlights
    glow.remove_glow()
    assert radiance(eye, tmp_path).max() < 1e-6


def test_lamps_have_their_intensity_in_lux(tmp_path: Path) -> None:
    white = bpy.data.materials.new("White")
    white.use_nodes = True
    nodes = white.node_tree.nodes
    nodes.clear()
    matt, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    matt.inputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    white.node_tree.links.new(matt.outputs[0], output.inputs[0])
    plane(white, (0.0, DISTANCE, 0.0), 3.0)
    light = lamps._beam("Beam")
    light.color = (1.0, 1.0, 1.0)
    item = bpy.data.objects.new("Beam", light)
    item.location, item.rotation_euler = (0.0, 0.0, 0.6), (math.pi / 2.0, 0.0, 0.0)
    bpy.context.scene.collection.objects.link(item)
    below = radiance(camera((0.0, DISTANCE - 5.0, 0.0)), tmp_path)  # 2 % below the lamp's level: full intensity
    assert below.mean() * math.pi * lamps.LUX == pytest.approx(lamps.BEAM / DISTANCE**2, rel=0.02)
    above = radiance(camera((0.0, DISTANCE - 5.0, 1.6), "High"), tmp_path)  # above the cut-off
    assert above.mean() < 0.05 * below.mean()


def night_road(elevation: float) -> object:
    sun = {"minimum": elevation, "maximum": elevation}
    scenario = load_scenario(
        "rq31-600m",
        [
            "road.length=150",
            "seed=4",
            f"road.environment.sun_elevation_deg={str(sun).replace(chr(39), chr(34))}",
            "road.environment.bad_weather=0",
            "road.furniture.lighting=1",
            'road.vehicles.per_km={"minimum":30,"maximum":30}',
        ],
    )
    parameters = sample_road(scenario.road, scenario.seed)
    build_road(BuildRequest(parameters, tolerance=0.05, vegetation_detail=0.0))
    return parameters


def test_night_switches_lamps_on_and_day_off_again() -> None:
    parameters = night_road(-12.0)
    scene = bpy.context.scene
    before = scene_mesh(scene)
    layers = {item.name: repr(layer_expressions(item)) for item in bpy.data.materials}
    add_views(scene, parameters, Matrix.Identity(4))
    kinds = [item[lamps.LAMP] for item in scene.objects if lamps.LAMP in item]
    lighting = [pole for pole in parameters.of_type(Pole).values() if pole.kind == "lighting"]
    assert kinds.count("street") == len(lighting) > 0
    assert kinds.count("vehicle") == len(parameters.of_type(Vehicle)) > 0
    assert kinds.count("headlights") == 1
    assert views_of(scene)["sun"].data.color[:] == (0.0, 0.0, 0.0)
    glowing = {str(item["synthroads_material"]) for item in bpy.data.materials if glow.GLOW in item}
    assert {"paint_white", "lamp_glass", "lamp_red", "number_plate"} <= glowing
    assert not glowing & {"asphalt", "car_paint", "galvanised_steel"}
    driver = views_of(scene)["driver"]
    headlights = next(item for item in scene.objects if item.get(lamps.LAMP) == "headlights")
    bpy.context.view_layer.update()
    assert abs((headlights.matrix_world.to_3x3() @ Matrix.Identity(3)).col[2].z) < 1e-4  # level
    assert (headlights.matrix_world.translation - driver.matrix_world.translation).length == pytest.approx(
        math.hypot(*lamps.DRIVER_LAMP), rel=1e-5
    )
    after = scene_mesh(scene)
    assert (before.vertices == after.vertices).all()
    names = set(layers) & {item.name for item in bpy.data.materials}
    assert {name: repr(layer_expressions(bpy.data.materials[name])) for name in names} == {
        name: layers[name] for name in names
    }
    exposure = scene.view_settings.exposure
    day = parameters.model_copy(
        update={"environment": parameters.environment.model_copy(update={"sun_elevation_deg": 40.0})}
    )
    add_views(scene, day, Matrix.Identity(4))
    assert not [item for item in scene.objects if lamps.LAMP in item]
    assert not [item for item in bpy.data.materials if glow.GLOW in item]
    strengths = [
        node.inputs["Emission Strength"]
        for item in bpy.data.materials
        if item.node_tree
        for node in item.node_tree.nodes
        if node.type == "BSDF_PRINCIPLED"
    ]
    assert strengths
    assert all(not strength.is_linked and strength.default_value == 0.0 for strength in strengths)
    assert scene.view_settings.exposure < exposure - 6.0


def test_points_keep_their_exposure_in_the_dark_and_get_no_sun() -> None:
    dark, low = (measured_light(Environment(sun_elevation_deg=height)) for height in (-20.0, 1.0))
    assert (dark.sun == 0.0).all()
    assert low.sun.max() > 0.0
    assert dark.above.mean() == pytest.approx(0.9, rel=1e-3)
    assert dark.above[2] > 1.5 * dark.above[0]  # twilight is blue
