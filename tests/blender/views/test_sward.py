"""The sward in pictures: dense where grass grows and near the camera, low where it is mown, and no part of a scan."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.blender.views.sward import SWARD, Lawn, add_sward, mown, remove_sward
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import Vegetation
from tests.helpers.roads.furnished_data import road_data

GRASS = {
    "type": "Vegetation",
    "kind": "grass",
    "species": "meadow",
    "density": 0.05,
    "band_start": 0.0,
    "band_end": 30.0,
    "height_min": 0.2,
    "height_max": 0.4,
    "mown_width": 3.0,
    "seed": 3,
}
RINGS = ((0.0, 12.0), (12.0, 35.0))
"""Distances from the camera between which tufts are counted, m."""
HERE = Matrix.Translation((5.0, -3.0, 2.0)) @ Matrix.Rotation(0.7, 4, "Z")
"""Where the road's coordinates lie in the scene."""


class Meadow(NamedTuple):
    """A road with grass, where it grows, and a place beside it."""

    parameters: RoadParameters
    lawn: Lawn
    place: np.ndarray


@pytest.fixture
def meadow() -> Meadow:
    """A built road with one stand of grass, and a place above its verge."""
    parameters = RoadParameters.from_dict(road_data({"grass": GRASS}))
    build_road(BuildRequest(parameters, 0.02, 0.0))
    geometry = RoadGeometry(parameters)
    edge = float(geometry.offsets(40.0)[0, -1])
    place = geometry.point(40.0, edge)[0] + (0.0, 0.0, 1.2)
    return Meadow(parameters, Lawn.of(bpy.context.scene, Matrix.Identity(4)), place)


def sward(meadow: Meadow, matrix: Matrix | None = None) -> bpy.types.Object:
    made = add_sward(bpy.context.scene, meadow.parameters, meadow.lawn, meadow.place, matrix or Matrix.Identity(4))
    assert made is not None
    return made


def tufts(item: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Return places (N, 3) and heights (N,) of the tufts, m."""
    size = np.array([entry.vector for entry in item.data.attributes["size"].data])
    return np.array([vertex.co for vertex in item.data.vertices], np.float64), size[:, 2]


def test_no_scan_meets_it(meadow: Meadow) -> None:
    before = scene_mesh()
    assert len(sward(meadow).data.vertices) > 1000
    bpy.context.view_layer.update()
    assert np.array_equal(scene_mesh().vertices, before.vertices)


def test_tufts_stand_on_the_lawn_and_are_dense_near_the_camera(meadow: Meadow) -> None:
    places, _ = tufts(sward(meadow))
    corners = meadow.lawn.corners
    for point in places[::400]:
        first, second, third = (corners[:, number] for number in range(3))
        normal = np.cross(second - first, third - first)
        off_plane = np.abs(np.einsum("ij,ij->i", point - first, normal) / np.linalg.norm(normal, axis=1))
        inside = np.all([
            np.einsum("ij,ij->i", np.cross(b - a, point - a), normal) > -1e-4 * np.linalg.norm(normal, axis=1)
            for a, b in ((first, second), (second, third), (third, first))
        ], axis=0)  # fmt: skip
        assert off_plane[inside].min() < 1e-4
    distance = np.linalg.norm(places - meadow.place, axis=1)
    area = [_lawn_area(meadow, *ring) for ring in RINGS]
    near, farther = (np.count_nonzero(_within(distance, *ring)) / size for ring, size in zip(RINGS, area, strict=True))
    assert 5.0 < near < 15.0
    assert 1.0 < farther < 0.5 * near
    assert distance.max() < 120.0


def _within(distance: np.ndarray, low: float, high: float) -> np.ndarray:
    return (distance >= low) & (distance < high)


def _lawn_area(meadow: Meadow, low: float, high: float) -> float:
    """Return the area (m2) of the lawn's triangles whose middles are between two distances of the place."""
    corners = meadow.lawn.corners
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float(area[_within(np.linalg.norm(corners.mean(axis=1) - meadow.place, axis=1), low, high)].sum())


def test_mown_strips_are_half_as_high(meadow: Meadow) -> None:
    places, heights = tufts(sward(meadow))
    grass = next(iter(meadow.parameters.of_type(Vegetation).values()))
    low = mown(RoadGeometry(meadow.parameters), grass, places)
    assert 100 < np.count_nonzero(low) < len(low) - 100
    for chosen, least, most in ((low, 0.1, 0.15), (~low, 0.2, 0.3)):
        assert least <= heights[chosen].min() <= heights[chosen].max() <= most


def test_same_blades_again_in_place_of_the_earlier_ones(meadow: Meadow) -> None:
    sward(meadow)
    remove_sward(bpy.context.scene)  # with it the road's meadow has come into the file
    before = _counts()
    first, with_it = tufts(sward(meadow)), _counts()
    second = tufts(sward(meadow))
    assert all(np.array_equal(*pair) for pair in zip(first, second, strict=True))
    assert len([item for item in bpy.context.scene.objects if SWARD in item]) == 1
    assert _counts() == with_it
    remove_sward(bpy.context.scene)
    assert _counts() == before


def _counts() -> tuple[int, int, int]:
    """Return numbers of the file's objects, meshes and materials."""
    return len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)


def test_the_lawn_is_in_the_roads_coordinates(meadow: Meadow) -> None:
    for item in bpy.context.scene.objects:
        if item.parent is None:
            item.matrix_world = HERE @ item.matrix_world
    bpy.context.view_layer.update()
    moved = Lawn.of(bpy.context.scene, HERE)
    assert np.allclose(moved.corners, meadow.lawn.corners, atol=1e-4)


def test_light_goes_through_blades_in_pictures_alone(meadow: Meadow) -> None:
    item = sward(meadow)
    bpy.context.view_layer.update()
    shown = {
        slot.name
        for instance in bpy.context.evaluated_depsgraph_get().object_instances
        if instance.parent is not None and instance.parent.original == item and instance.object.type == "MESH"
        for slot in instance.object.data.materials
        if slot is not None
    }
    assert len(shown) == 1
    through = bpy.data.materials[shown.pop()]
    assert any(node.type == "BSDF_TRANSLUCENT" for node in through.node_tree.nodes)
    others = [other.node_tree for other in bpy.data.materials if SWARD not in other and other.node_tree]
    assert others
    assert not any(node.type == "BSDF_TRANSLUCENT" for tree in others for node in tree.nodes)


def test_a_road_without_grass_has_none() -> None:
    parameters = RoadParameters.from_dict(road_data({}))
    build_road(BuildRequest(parameters, 0.02, 0.0))
    lawn = Lawn.of(bpy.context.scene, Matrix.Identity(4))
    assert add_sward(bpy.context.scene, parameters, lawn, (0.0, 0.0, 0.0), Matrix.Identity(4)) is None
