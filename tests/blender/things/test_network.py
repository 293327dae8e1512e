"""Interchanges in Blender: one top surface over cuts, noses and mouths, with classes and instance numbers."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.network.network import network_of
from synthroads_addon.road.other_roads.guardrail import RampGuardrail
from synthroads_addon.road.other_roads.parts import ConnectingRamp, CrossingRoad
from tests.helpers.roads.interchanges import interchange

GRID, HALF = 0.1, 4.0
"""Distance of rays, and half of the square that is looked at, m."""


@pytest.mark.parametrize(
    ("form", "seed"), [("diamond", 1), ("half-clover-under", 1), pytest.param("diamond", 3, marks=pytest.mark.slow)]
)
def test_vertical_rays_hit_exactly_one_surface(form: str, seed: int) -> None:
    """On a grid of 10 cm over cuts, the ground's tip behind them, mouths and corners; markings aside."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    whole = interchange(form, seed)
    road = whole.model_copy(
        update={"objects": {name: item for name, item in whole.objects.items() if not isinstance(item, RampGuardrail)}}
    )
    geometry = RoadGeometry(road)
    build_road(BuildRequest(road, 0.005, parts=("road", "terrain", "network"), geometry=geometry))
    mesh = scene_mesh()
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist())
    paint = class_id("road_marking")
    steps = np.arange(-HALF, HALF, GRID)
    grid = np.stack(np.meshgrid(steps + 0.0137, steps + 0.0071), axis=-1).reshape(-1, 2)
    for joint in network_of(geometry).joints.values():
        mouth = joint.surface.mouth
        middles = [
            *(joint.cut.points[[0, 3]]),
            mouth.origin,
            *mouth.place(np.array([2.0, joint.ramp.mouth_length]), np.array([6.0, 0.0])),
            joint.surface.grid.points[40, 0, :2],
        ]
        for middle in middles:
            for point in (middle + grid).tolist():
                hits, origin = 0, Vector((*point, 200.0))
                while (hit := tree.ray_cast(origin, Vector((0.0, 0.0, -1.0))))[0] is not None:
                    hits += int(mesh.class_id[hit[2]] != paint)
                    origin = hit[0] - Vector((0.0, 0.0, 1e-4))
                assert hits == 1, (joint.name, point)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (up > 0.0).mean() > 0.99
    roads = {class_id(name) for name in ("road", "roadside", "road_marking")}
    for item in (*road.of_type(ConnectingRamp).values(), *road.of_type(CrossingRoad).values()):
        assert set(np.unique(mesh.class_id[mesh.instance_id == item.instance]).tolist()) == roads
