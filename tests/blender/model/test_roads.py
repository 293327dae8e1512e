"""Several roads in a file: each is built, moved, copied and renamed by itself, and nothing of the user's is lost."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.model.build import BuildTarget, remove_road
from synthroads_addon.blender.model.roads import ROAD, choose_road, renew_ids
from synthroads_addon.blender.model.store import find_road, objects_of, recall_parameters, road_named, roads
from synthroads_addon.blender.things.model_builder import ROLE
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.scenes.scene_hash import lines
from tests.helpers.scenes.small_road import build_small, small_parameters

ONLY = ("road", "guardrails")


def add_cube(name: str = "Mine") -> bpy.types.Object:
    """Add an object of the user's own to the current scene."""
    bpy.ops.mesh.primitive_cube_add(location=(0.0, 100.0, 0.0))
    bpy.context.object.name = name
    return bpy.context.object


def in_own_collection(item: bpy.types.Object, name: str = "Mine") -> None:
    """Move an object to a collection of the user's own."""
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(collection)
    for other in item.users_collection:
        other.objects.unlink(item)
    collection.objects.link(item)


def described(names: Collection[str]) -> list[str]:
    """Return what the file says of some objects and their meshes."""
    wanted = re.compile("|".join(rf"(objects|meshes)\\[{re.escape(name)}\\]" for name in names))
    return [line for line in lines() if wanted.match(line)]


class TestNothingIsLost:
    def test_a_road_in_a_second_scene_leaves_that_of_the_first(self) -> None:
        build_small(parts=ONLY)
        first = bpy.context.scene
        before = {item.name for item in first.objects}
        bpy.context.window.scene = bpy.data.scenes.new("Second")
        build_small(parts=ONLY)
        build_small(parts=ONLY)
        assert {item.name for item in first.objects} == before
        assert {item[ROLE] for item in bpy.context.scene.objects if ROLE in item} == {
            item[ROLE] for item in first.objects if ROLE in item
        }

    def test_a_copy_of_a_part_in_a_collection_of_the_users_stays(self) -> None:
        model = build_small(parts=ONLY)
        copy = model.objects["rail-left"].copy()
        copy.data = copy.data.copy()
        bpy.context.scene.collection.objects.link(copy)
        in_own_collection(copy)
        name, count = copy.name, len(bpy.data.objects)
        build_small(parts=ONLY)
        assert name in bpy.data.objects
        assert len(bpy.data.objects) == count

    def test_a_renamed_collection_keeps_its_road_and_what_the_user_put_into_it(self) -> None:
        model = build_small(parts=ONLY)
        model.collection.name = "My Motorway"
        model.collection.objects.link(add_cube())
        count = len(bpy.data.objects)
        assert find_road(bpy.context.scene) is not None
        build_small(parts=ONLY)
        assert len(bpy.data.objects) == count
        assert "Mine" in bpy.data.collections["My Motorway"].objects
        remove_road()
        assert [item.name for item in bpy.data.objects] == ["Mine"]

    def test_what_the_user_hung_on_a_road_stays_where_it_is(self) -> None:
        model = build_small(parts=ONLY)
        model.root.location = (5.0, 0.0, 0.0)
        cube = add_cube()
        cube.parent = model.root
        bpy.context.view_layer.update()
        place = np.array(cube.matrix_world)
        build_small(parts=ONLY)
        assert cube.parent == model.root
        remove_road()
        assert cube.parent is None
        bpy.context.view_layer.update()
        assert np.allclose(np.array(cube.matrix_world), place)


class TestSeveral:
    def test_the_active_objects_road_is_meant_then_the_chosen_one(self) -> None:
        scene = bpy.context.scene
        first = build_small(parts=ONLY)
        assert find_road(scene) == first.root
        second = build_small(parts=ONLY, place=BuildTarget(beside=True))
        assert roads(scene) == [first.root, second.root]
        bpy.context.view_layer.objects.active = None
        assert find_road(scene) == first.root
        choose_road(scene, second.root)
        assert find_road(scene) == second.root
        bpy.context.view_layer.objects.active = first.objects["rail-left"]
        assert find_road(scene) == first.root
        assert road_named(scene, second.root.name) == second.root
        with pytest.raises(InputError, match=f"--road.*{first.root.name}"):
            road_named(scene, "Elsewhere")

    def test_they_lie_as_far_apart_as_on_the_map(self) -> None:
        first = build_small(parts=ONLY)
        data = small_parameters().to_dict()
        data["transform"]["translate"] = np.add(data["transform"]["translate"], (200.0, -300.0, 5.0)).tolist()
        elsewhere = RoadParameters.from_dict(data)
        second = build_small(elsewhere, parts=ONLY, place=BuildTarget(beside=True))
        assert tuple(first.root.location) == (0.0, 0.0, 0.0)
        assert np.allclose(second.root.location, second.origin - first.origin)
        assert np.abs(second.root.location).max() > 200.0
        second.root.location.x += 7.0
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = second.root
        data["transform"]["translate"][1] += 40.0
        third = build_small(RoadParameters.from_dict(data), parts=ONLY)
        assert third.root == second.root
        assert np.allclose(third.root.location, third.origin - first.origin + (7.0, 0.0, 0.0))

    def test_building_one_leaves_the_other_and_all_else_as_it_is(self) -> None:
        first = build_small(parts=ONLY)
        build_small(parts=ONLY, place=BuildTarget(beside=True))
        kept = [item.name for item in objects_of(first.root).values()] + [first.root.name, add_cube().name]
        before = described(kept)
        other = roads(bpy.context.scene)[1]
        other.name = "Ramp"
        bpy.context.view_layer.objects.active = other
        build_small(small_parameters(40.0), parts=ONLY)
        assert described(kept) == before
        assert recall_parameters(other).alignment.length == 40.0
        assert recall_parameters(first.root).alignment.length == 60.0

    def test_a_copy_is_a_new_road(self) -> None:
        model = build_small(parts=ONLY)
        for item in (model.root, *model.objects.values()):
            item.hide_viewport = False
            item.select_set(True)
        bpy.ops.object.duplicate()
        renew_ids()
        first, copy = roads(bpy.context.scene)
        assert first[ROAD] != copy[ROAD]
        assert objects_of(first) == model.objects
        parts = objects_of(copy)
        assert list(parts) == list(model.objects)
        assert not set(parts.values()) & set(model.objects.values())
        before = described([item.name for item in parts.values()])
        build_small(small_parameters(40.0), parts=ONLY, place=BuildTarget(str(first[ROAD])))
        assert described([item.name for item in parts.values()]) == before

    def test_a_road_appended_from_another_file_is_one_of_its_own(self, tmp_path: Path) -> None:
        file = tmp_path / "road.blend"
        bpy.data.libraries.write(str(file), {build_small(parts=ONLY).collection})
        here = build_small(small_parameters(40.0), parts=ONLY)
        with bpy.data.libraries.load(str(file)) as (source, wanted):
            wanted.collections = source.collections
        bpy.context.scene.collection.children.link(wanted.collections[0])
        renew_ids()
        first, second = roads(bpy.context.scene)
        assert first == here.root
        assert first[ROAD] != second[ROAD]
        assert set(objects_of(second)) == set(objects_of(first))
        assert recall_parameters(second).alignment.length == 60.0
