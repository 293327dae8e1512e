"""The landscape in Blender: pictures show it, no scan meets it, and nothing builds it that doesn't look at it."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.blender.views.landscape import LANDSCAPE, add_landscape, remove_landscape
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.roads.furnished_data import road_data

LAND = {
    "type": "Landscape",
    "reach": 800.0,
    "seed": 4,
    "villages": [{"x": 200.0, "y": 500.0, "houses": 3}],
    "turbines": [{"x": -300.0, "y": 400.0}],
}


@pytest.fixture
def parameters() -> RoadParameters:
    """A road with a landscape and a power line across it."""
    line = {"type": "PowerLine", "station": 40.0, "offset": 0.0}
    return RoadParameters.from_dict(road_data({"land": LAND, "line": line}))


def landscape_objects() -> list[bpy.types.Object]:
    return [item for item in bpy.context.scene.objects if LANDSCAPE in item]


def test_scans_neither_build_nor_meet_it(parameters: RoadParameters) -> None:
    build_road(BuildRequest(parameters, 0.02, 0.0))
    assert not landscape_objects()
    before = scene_mesh()
    made = add_landscape(bpy.context.scene, parameters, Matrix.Identity(4))
    bpy.context.view_layer.update()
    after = scene_mesh()
    assert len(landscape_objects()) == len(made) == 4
    assert len(after) == len(before)
    assert np.array_equal(after.vertices, before.vertices)
    assert all(len(item.data.vertices) > 100 for item in made.values())


def test_it_is_replaced_and_removed_with_its_meshes(parameters: RoadParameters) -> None:
    meshes = len(bpy.data.meshes)
    for _ in range(2):
        add_landscape(bpy.context.scene, parameters, Matrix.Identity(4))
    assert len(landscape_objects()) == 4
    remove_landscape(bpy.context.scene)
    assert (len(landscape_objects()), len(bpy.data.meshes)) == (0, meshes)


def test_a_road_without_landscape_has_none() -> None:
    bare = RoadParameters.from_dict(road_data({}))
    assert add_landscape(bpy.context.scene, bare, Matrix.Identity(4)) == {}
