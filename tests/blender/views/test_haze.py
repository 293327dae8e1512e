"""Haze of the user's own pictures: contrast falls as the visibility says, and fog is as bright as what lights it."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from synthroads_addon.blender.views.daylight import add_views
from synthroads_addon.road.surroundings import Environment
from synthroads_addon.scanning.colour.haze import haze_light
from synthroads_addon.scanning.weather.extinction import visible_extinction
from tests.helpers.scenes.small_road import small_parameters

SUN, SKY = np.array([4.0, 3.8, 3.4]), np.array([0.6, 0.9, 1.4])
DISTANCE, ASIDE, VISIBILITY = 100.0, 0.3, 200.0


class TestLight:
    """Of a layer in two streams: no light is lost but what goes back up."""

    def test_of_clear_air_it_is_that_of_single_scattering(self) -> None:
        light = haze_light(visible_extinction(1e7), math.radians(40.0), SUN, SKY)
        level = SUN * math.sin(math.radians(40.0)) + SKY
        assert (light.sun, light.sky) == pytest.approx((1.0, 1.0), abs=1e-3)
        assert light.diffuse == pytest.approx(0.0, abs=1e-3)
        assert light.air == pytest.approx(SUN / (4.0 * math.pi) + (SKY + 0.2 * level) / (2.0 * math.pi), rel=1e-3)

    def test_in_fog_all_light_is_diffuse_and_some_goes_back_up(self) -> None:
        light = haze_light(visible_extinction(50.0), math.radians(40.0), SUN, SKY)
        level = SUN * math.sin(math.radians(40.0)) + SKY
        assert max(light.sun, light.sky) < 1e-9
        share = math.pi * light.diffuse / level
        assert share == pytest.approx(share[0])
        assert 0.3 < share[0] < 0.5
        assert light.air / light.diffuse == pytest.approx(0.6, abs=0.02)

    def test_the_denser_it_is_the_less_gets_through(self) -> None:
        lights = [
            haze_light(visible_extinction(visibility), 0.5, SUN, SKY)
            for visibility in (10_000.0, 2000.0, 500.0, 100.0, 20.0)
        ]
        level = [SUN * math.sin(0.5) * x.sun + SKY * x.sky + math.pi * x.diffuse for x in lights]
        assert all((after < before).all() for before, after in pairwise(level))
        assert (level[0] < SUN * math.sin(0.5) + SKY).all()
        for elevation in (-0.1, 0.0, 1.5):
            light = haze_light(visible_extinction(300.0), elevation, SUN, SKY)
            assert (light.air > 0.0).all()
            assert (light.diffuse > 0.0).all()


def board(name: str, camera: bpy.types.Object, place: Vector, half: float, shader: str) -> Vector:
    """Put a square that faces the camera, or lies level if it is matt, at a place in its frame; return its middle."""
    middle = camera.matrix_world @ place
    turn = Matrix.Identity(3) if shader == "BsdfDiffuse" else camera.matrix_world.to_3x3()
    corners = [middle + turn @ Vector((x * half, y * half, 0.0)) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(corner) for corner in corners], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    node, output = nodes.new(f"ShaderNode{shader}"), nodes.new("ShaderNodeOutputMaterial")
    node.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0) if name == "Black" else (1.0, 1.0, 1.0, 1.0)
    material.node_tree.links.new(node.outputs[0], output.inputs["Surface"])
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    return place


def seen(visibility: float, file: Path) -> dict[str, np.ndarray]:
    """Return the radiance (3,) of a black and a shining board, of the air, and of a white level board nearby."""
    parameters = small_parameters().model_copy(update={"environment": Environment(visibility=visibility)})
    add_views(bpy.context.scene, parameters, Matrix.Identity(4))
    bpy.context.view_layer.update()
    scene, camera = bpy.context.scene, bpy.context.scene.camera
    places = {
        "Black": board("Black", camera, Vector((-ASIDE * DISTANCE, 0.0, -DISTANCE)), 0.1 * DISTANCE, "Emission"),
        "Shining": board("Shining", camera, Vector((ASIDE * DISTANCE, 0.0, -DISTANCE)), 0.1 * DISTANCE, "Emission"),
        "White": board("White", camera, Vector((0.0, -0.3, -1.2)), 0.2, "BsdfDiffuse"),
        "Air": Vector((0.0, 0.0, -1.0)),
    }
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 16, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 36, 100
    scene.render.image_settings.file_format, scene.render.filepath = "OPEN_EXR", str(file)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(file))
    pixels = np.array(image.pixels).reshape(36, 64, 4)[..., :3]
    focal = camera.data.lens / camera.data.sensor_width * 64
    found = {}
    for name, place in places.items():
        column, row = 32 + focal * place.x / -place.z, 18 + focal * place.y / -place.z
        found[name] = pixels[int(row), int(column)]
    return found


def test_fog_is_bright_and_hides_what_is_beyond_its_visibility(tmp_path: Path) -> None:
    clear = seen(23_000.0, tmp_path / "clear.exr")
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    fog = seen(VISIBILITY, tmp_path / "fog.exr")
    left = math.exp(-3.912 * math.hypot(1.0, ASIDE) * DISTANCE / VISIBILITY)
    assert fog["Shining"] - fog["Black"] == pytest.approx(left, abs=0.003)
    assert fog["Black"] == pytest.approx(fog["Air"] * (1.0 - left), rel=0.03)
    assert (fog["Air"] > 0.45 * fog["White"]).all()
    assert (fog["Air"] < 0.75 * fog["White"]).all()
    share = fog["White"].mean() / clear["White"].mean()
    assert 0.6 < share < 0.85
