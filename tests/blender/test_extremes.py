"""Numerical extremes in Blender: the shortest and the longest road, a million instances, faces without area."""

from __future__ import annotations

from array import array

import bpy
import numpy as np
import pytest

from studies.costs.casters import bare_mesh
from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.casters import make_caster
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.nodes.builder import Tree, node_group
from synthroads_addon.blender.scene.evaluated import scanned_scene, scene_mesh
from synthroads_addon.blender.scene.reading import MeshPart, Places, SceneTables, join_parts
from synthroads_addon.blender.services import BlenderServices
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.tessellation import MAXIMUM_SPACING
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.scenes.scan_scenes import scan_block

ROUNDING = 2e-4  # m, of float32 coordinates a few hundred metres from the origin


def test_a_road_of_a_metre_is_built_and_scanned() -> None:
    scenario = Scenario.from_dict(
        {"fidelity": "draft", "road": {"length": 1.0, "half_width": 20.0}, "scan": {"lines_per_second": 100.0}}
    )
    parameters = sample_road(scenario.road, 1)
    geometry = RoadGeometry(parameters)
    build_road(BuildRequest(parameters, 0.02, 0.1))
    scene = scanned_scene(geometry=geometry)
    surface = np.isin(scene.static.class_id, [class_id("road"), class_id("road_marking")])
    width = -np.diff(geometry.offsets(0.5)[0, [0, -1]])[0]
    assert 0.5 * width < scene.static.areas()[surface].sum() < 1.2 * width
    scan = Site.of_road(scenario, geometry, ScenarioInputs.read(scenario)).plan(scene, BlenderServices())
    points = scan_block(scan, scan.path.strips[0], 0).points
    station, _ = geometry.alignment.project(points.xyz[:, :2] - np.array(parameters.transform.translate)[:2])
    assert np.count_nonzero((station >= 0.0) & (station <= 1.0)) > 50


@pytest.mark.slow
@pytest.mark.any_blender
def test_the_end_of_a_hundred_kilometres_is_as_exact_as_the_start() -> None:
    parameters = sample_road(RoadScenario(length=100_000.0), 4)
    geometry = RoadGeometry(parameters)
    for start, end in ((0.0, 300.0), (99_700.0, 100_000.0)):
        model = build_road(BuildRequest(parameters, 0.005, 0.0, ("road",), (start, end)))
        mesh = scene_mesh()
        used = np.unique(mesh.triangles[mesh.class_id == class_id("road")])
        local = mesh.vertices[used].astype(np.float64) + model.origin - np.array(parameters.transform.translate)
        station, offset = geometry.alignment.project(local[:, :2])
        error = local[:, 2] - geometry.elevation(station, offset)
        assert np.nanmax(np.abs(error)) < ROUNDING
        # From the whole road's last row before the stretch to its last row in it, so that stretches join.
        assert start - MAXIMUM_SPACING < station.min() < start + 1e-3
        assert end - MAXIMUM_SPACING < station.max() < end + 1e-3
        assert station.max() == pytest.approx(end, abs=1e-3) or end < geometry.length


@pytest.mark.slow
def test_a_million_instances_are_read_at_their_places() -> None:
    side = 1000

    def build(tree: Tree) -> None:
        """A face on each point of a grid, a metre apart."""
        points = tree.node(
            "GeometryNodeMeshGrid", size_x=side - 1.0, size_y=side - 1.0, vertices_x=side, vertices_y=side
        ).value
        face = tree.node("GeometryNodeMeshCircle", vertices=3, radius=0.1, fill_type="NGON").value
        tree.output("Mesh", tree.node("GeometryNodeInstanceOnPoints", points, instance=face).value)

    item = bpy.data.objects.new("Many", bpy.data.meshes.new("Many"))
    item["synthroads_class"], item["synthroads_instance"] = "vegetation", 9
    bpy.context.scene.collection.objects.link(item)
    item.modifiers.new("Nodes", "NODES").node_group = node_group("Faces", build)
    mesh = scene_mesh()
    assert len(mesh) == side * side
    assert set(mesh.class_id) == {class_id("vegetation")}
    assert set(mesh.instance_id) == {9}
    middles = mesh.vertices[mesh.triangles].astype(np.float64).mean(axis=1)[:, :2]
    places = np.rint(middles + (side - 1) / 2.0).astype(np.int64)
    assert np.abs(middles + (side - 1) / 2.0 - places).max() < 1e-3
    assert len(np.unique(places[:, 0] * side + places[:, 1])) == side * side


def test_more_triangles_than_32_bits_can_count_are_refused() -> None:
    corners = np.zeros((200_000, 3), np.float32)
    part = MeshPart(corners, np.zeros((100_000, 3), np.int32), 0, None, None, None)
    places = Places(array("d"), array("l", [0]) * 25_000)
    whole = SceneTables([], ("asphalt",), np.zeros(3))
    with pytest.raises(InputError, match=r"scene is 5000000000: must have less than 2\*\*31 vertices and triangles"):
        join_parts([(part, places)], whole)


@pytest.mark.parametrize("name", ["bvhtree", "embree"])
def test_faces_without_area_are_never_hit(name: str) -> None:
    corners = np.array([(-9, -9, 0), (9, -9, 0), (0, 9, 0), (0, 0, 5), (1, 0, 5), (2, 0, 5)], np.float32)
    faces = np.array([(0, 1, 2), (0, 0, 1), (2, 2, 2), (3, 4, 5)], np.int32)
    x = np.linspace(-3.0, 3.0, 61, dtype=np.float32)
    origins = np.stack([x, np.zeros_like(x), np.full_like(x, 30.0)], axis=1)
    down = np.tile(np.float32((0.0, 0.0, -1.0)), (len(x), 1))
    assert set(make_caster(name, bare_mesh(corners, faces)).cast(origins, down, 60.0).tolist()) == {0}
