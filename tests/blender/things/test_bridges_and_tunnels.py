"""Bridges and tunnels in Blender: one pavement under rays, caps, ground, solids like the twins', edits read back."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.structures.kerbed import kerb_bodies
from synthroads_addon.road.terrain import ground_below, surface_elevation
from synthroads_addon.twin.things import placed_things, road_course
from tests.helpers.roads.structures import changed, with_bridge, with_tunnel

TOLERANCE = 0.005
GRID = 0.1
NAME = "structure"


def built(road: RoadParameters):
    """Return the analytic road, its model, and a function that returns the mesh of some of its objects."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    geometry = RoadGeometry(road)
    model = build_road(BuildRequest(road, TOLERANCE, parts=("road", "terrain", "structures"), geometry=geometry))
    origin = model.origin - np.array(road.transform.translate)
    return geometry, model, origin


def rays(model, roles: tuple[str, ...], points: np.ndarray, classes: tuple[str, ...]) -> list[list[float]]:
    """Return the heights at which upright rays through points in plan (N, 2) hit faces of some classes."""
    mesh = scene_mesh(objects=[model.objects[role] for role in roles])
    chosen = np.isin(mesh.class_id, [class_id(name) for name in classes])
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles[chosen].tolist())
    heights = []
    for point in points.tolist():
        hits, start = [], Vector((*point, 300.0))
        while (hit := tree.ray_cast(start, Vector((0.0, 0.0, -1.0))))[0] is not None:
            hits.append(hit[0].z)
            start = hit[0] - Vector((0.0, 0.0, 1e-4))
        heights.append(hits)
    return heights


ROADS = {"bridge": lambda: with_bridge(joint="none"), "tunnel": with_tunnel}


@pytest.mark.parametrize("kind", ROADS)
def test_rays_hit_exactly_one_pavement(kind: str) -> None:
    """On a grid of 10 cm over its beginning, and some metres of its middle."""
    geometry, model, origin = built(ROADS[kind]())
    for begin in (88.0, 120.0):
        along, across = np.arange(begin, begin + 4.0, GRID) + 0.013, np.arange(-3.9, 3.9, GRID) + 0.007
        station, offset = (grid.ravel() for grid in np.meshgrid(along, across))
        hits = rays(model, ("Road",), geometry.alignment.place(station, offset) - origin[:2], ("road",))
        assert {len(item) for item in hits} == {1}
        wanted = surface_elevation(geometry, station, offset) - origin[2]
        assert np.abs(np.array(hits)[:, 0] - wanted).max() < TOLERANCE


@pytest.mark.parametrize("kind", ROADS)
def test_caps_and_ground_lie_where_they_are_exactly(kind: str) -> None:
    geometry, model, origin = built(ROADS[kind]())
    station = np.linspace(92.0, 135.0, 300)
    offsets = geometry.offsets(station)
    for offset in (offsets[:, 0] - 0.4, offsets[:, -1] + 0.4):
        hits = rays(model, ("Road",), geometry.alignment.place(station, offset) - origin[:2], ("bridge",))
        top = np.array([max(item) for item in hits]) + origin[2]
        np.testing.assert_allclose(top, geometry.elevation(station, offset), atol=TOLERANCE)
    for offset in (np.zeros(300), offsets[:, 0] + 6.0, offsets[:, -1] - 15.0):
        hits = rays(model, ("Terrain",), geometry.alignment.place(station, offset) - origin[:2], ("ground",))
        assert {len(item) for item in hits} == {1}
        ground = np.array(hits)[:, 0] + origin[2]
        np.testing.assert_allclose(ground, ground_below(geometry, station, offset), atol=0.06)


@pytest.mark.parametrize("kind", ROADS)
def test_the_terrain_has_no_holes_at_its_ends(kind: str) -> None:
    geometry, model, origin = built(ROADS[kind]())
    structure = geometry.structures[NAME]
    for end in (structure.cap_start, structure.cap_end):
        station, offset = (
            grid.ravel() for grid in np.meshgrid(end + np.linspace(-0.301, 0.3, 14), np.linspace(-40.0, 40.0, 161))
        )
        points = geometry.alignment.place(station, offset) - origin[:2]
        hits = rays(model, ("Road", "Terrain"), points, ("ground", "road", "roadside", "bridge"))
        places = np.column_stack([station, offset]).tolist()
        assert [place for place, item in zip(places, hits, strict=True) if not item] == []


@pytest.mark.parametrize("kind", ROADS)
def test_solids_are_those_of_the_twins(kind: str) -> None:
    """The corners of the solids lie on the mesh, and each of the mesh's vertices is one of theirs."""
    geometry, model, origin = built(ROADS[kind]())
    (placed,) = [item for item in placed_things(geometry, TOLERANCE) if item.name == NAME]
    caps = {body.part for body in kerb_bodies(placed.thing, road_course(geometry, TOLERANCE))}
    corners = [body.sections.reshape(-1, 3) for body in placed.bodies if body.part not in caps]
    mesh = scene_mesh(objects=[model.objects[NAME]])
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist())
    away = [tree.find_nearest(Vector(point))[3] for point in (np.concatenate(corners) - origin).tolist()]
    assert len(away) > 500
    assert max(away) < 2.0 * TOLERANCE
    assert set(np.unique(mesh.class_id)) == {class_id("bridge")}
    assert set(np.unique(mesh.instance_id)) == {placed.thing.instance}


@pytest.mark.parametrize("kind", ROADS)
def test_an_edited_length_is_read_back_exactly(kind: str) -> None:
    road = ROADS[kind]()
    _, model, _ = built(road)
    modifier = model.objects[NAME].modifiers[0]
    set_modifier_input(modifier, "End Station", 161.25)
    edited = edited_parameters(road, model.objects)
    assert edited.objects[NAME] == changed(road, NAME, end_station=161.25).objects[NAME]
    geometry, _, _ = built(edited)
    assert geometry.structures[NAME].end_station == 161.25


def test_a_road_without_structures_has_no_parts_of_them() -> None:
    road = with_bridge()
    objects = {name: item for name, item in road.objects.items() if name != NAME}
    _, model, _ = built(road.model_copy(update={"objects": objects}))
    assert not {"Bridge Caps", NAME} & set(model.objects)
    names = [socket.name for socket in model.objects["Road"].modifiers[0].node_group.interface.items_tree]
    assert "Bridge Caps" not in names
