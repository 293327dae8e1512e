"""Side roads in Blender: one top surface everywhere, on the analytic one, with their classes; and the centre line."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.terrain import surface_elevation
from tests.helpers.roads.side_roads import SHAPES, roof, with_side_road

TOLERANCE = 0.005
GRID = 0.1
"""Distance of rays, m."""
HALF = 7.0
"""Half of the square that is looked at, m, about each place."""


def built(road: RoadParameters):
    """Return the analytic road and the mesh of its surface and ground."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    geometry = RoadGeometry(road)
    build_road(BuildRequest(road, TOLERANCE, parts=("road", "terrain", "side_roads"), geometry=geometry))
    return geometry, scene_mesh()


@pytest.mark.parametrize(
    "shape", [name if n < 1 else pytest.param(name, marks=pytest.mark.slow) for n, name in enumerate(SHAPES)]
)
def test_vertical_rays_hit_exactly_one_surface(shape: str) -> None:
    """On a grid of 10 cm about both corners, the join, the end of the ground's stretch and the terrain's edge."""
    geometry, mesh = built(with_side_road(**SHAPES[shape]))
    mouth = geometry.mouths["side-road-1"]
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist())
    along = [mouth.low.start_station, mouth.station, mouth.high.start_station, mouth.start, mouth.end, mouth.station]
    depths = [1.0, 0.0, 1.0, 3.0, 20.0, 30.0]
    middles = mouth.plan(np.array(along), np.array(depths))
    steps = np.arange(-HALF, HALF, GRID)
    grid = np.stack(np.meshgrid(steps + 0.0137, steps + 0.0071), axis=-1).reshape(-1, 2)
    paint = class_id("road_marking")
    for middle in middles:
        points = middle + grid
        station, offset = geometry.alignment.project(points)
        wanted = surface_elevation(geometry, station, offset)
        errors = []
        for point, height in zip(points.tolist(), wanted.tolist(), strict=True):
            hits, origin = [], Vector((*point, 100.0))
            while (hit := tree.ray_cast(origin, Vector((0.0, 0.0, -1.0))))[0] is not None:
                if mesh.class_id[hit[2]] != paint:
                    hits.append(hit[0].z)
                origin = hit[0] - Vector((0.0, 0.0, 1e-4))
            assert len(hits) == 1, (point, hits)
            errors.append(abs(hits[0] - height))
        assert np.quantile(errors, 0.99) < 0.05


def test_faces_have_their_classes_and_lie_on_the_surface() -> None:
    road = with_side_road()
    geometry, mesh = built(road)
    mouth, number = geometry.mouths["side-road-1"], road.objects["side-road-1"].instance
    own = mesh.instance_id == number
    assert {int(value) for value in np.unique(mesh.class_id[own])} == {
        class_id(name) for name in ("road", "roadside", "road_marking")
    }
    corners = mesh.vertices[mesh.triangles[own]].astype(np.float64)
    middle = corners.mean(axis=1)
    station, offset = geometry.alignment.project(middle[:, :2])
    height = surface_elevation(geometry, station, offset)
    film = np.where(mesh.class_id[own] == class_id("road_marking"), 0.003, 0.0)
    depth = mouth.depth(station, offset)
    inner = (depth > 0.05) & (depth < mouth.reach - 0.1)
    assert np.abs(middle[:, 2] - height - film)[inner].max() < 0.001
    # No verge of the main road lies in the mouth.
    main = ~own & (mesh.class_id == class_id("roadside"))
    places = mesh.vertices[mesh.triangles[main]].astype(np.float64).mean(axis=1)
    s, o = geometry.alignment.project(places[:, :2])
    inside = (s > mouth.low.start_station + 0.01) & (s < mouth.high.start_station - 0.01) & (mouth.sign * o > 0.0)
    assert not inside.any()


def test_centre_line_lies_on_both_planes_of_a_roof() -> None:
    road = roof(with_side_road())
    geometry, mesh = built(road)
    (line,) = (item for name, item in road.objects.items() if name == "centre-line" and isinstance(item, LineMarking))
    parts = geometry.numbers.parts["centre-line"]
    numbers = [line.instance, *range(parts.first, parts.first + parts.count)]
    own = np.isin(mesh.instance_id, numbers) & (mesh.class_id == class_id("road_marking"))
    corners = mesh.vertices[mesh.triangles[own]].astype(np.float64)
    places = np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1)])
    station, offset = geometry.alignment.project(places[:, :2])
    near = np.abs(offset) < line.width
    height = surface_elevation(geometry, np.clip(station, 0.0, geometry.length), offset)
    assert near.any()
    assert np.abs(places[:, 2] - height - line.film_thickness)[near].max() < 5e-4


def test_a_side_road_is_read_back_as_it_was_built() -> None:
    road = with_side_road()
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    model = build_road(BuildRequest(road, TOLERANCE, parts=("road", "terrain", "side_roads")))
    assert edited_parameters(road, model.objects) == road
