"""Edits of a built road, one by one: what is read back agrees with what stands in the scene."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import BuildTarget, RoadModel, build_road
from synthroads_addon.blender.model.settle import move_line, settle
from synthroads_addon.blender.model.truth import EditedRoad, open_road, read_road
from synthroads_addon.blender.scene.evaluated import scanned_scene
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry, alignment_of
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.scenes.small_road import PARTS, TOLERANCE, build_small, open_small, small_parameters

EXACT = 0.001
"""Allowed difference of a place in the parameters from the one that the scene shows, m."""


@pytest.fixture
def model() -> RoadModel:
    """A short road, built."""
    return open_small()


def truth(model: RoadModel) -> EditedRoad:
    """Return what the scene shows now."""
    bpy.context.view_layer.update()
    return read_road(model.root)


def changed(model: RoadModel, edited: EditedRoad) -> set[str]:
    """Return the ids of the objects that differ from those of the road that was built."""
    before, now = small_parameters().objects, edited.parameters.objects
    return {name for name in {**before, **now} if before.get(name) != now.get(name)}


def move(item: bpy.types.Object, by: tuple[float, float, float], turn_deg: float = 0.0) -> None:
    """Move an object in the scene, turned about where its mesh is."""
    bpy.context.view_layer.update()
    corners = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).bound_box
    middle = item.matrix_world @ Matrix.Translation(np.mean(corners, axis=0).tolist()).translation
    turn = Matrix.Translation(middle) @ Matrix.Rotation(np.deg2rad(turn_deg), 4, "Z") @ Matrix.Translation(-middle)
    item.matrix_world = Matrix.Translation(by) @ turn @ item.matrix_world


def shown(parameters: RoadParameters | None = None) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Return the bounds of everything in the scene by instance number, in map coordinates less a rounded origin."""
    scene = scanned_scene(geometry=RoadGeometry(parameters) if parameters else None).static
    corners = scene.vertices[scene.triangles].astype(np.float64) + (scene.origin - MAP)
    found = {}
    for number in np.unique(scene.instance_id):
        points = corners[scene.instance_id == number].reshape(-1, 3)
        found[int(number)] = (points.min(axis=0), points.max(axis=0))
    return found


MAP = np.array([294000.0, 5628000.0, 180.0])


def assert_shows(edited: EditedRoad, names: tuple[str, ...] = ()) -> None:
    """Check that the scene is that of the parameters that were read, built anew elsewhere."""
    here = shown()
    bpy.context.window.scene = bpy.data.scenes.new("Check")
    build_road(BuildRequest(edited.known(), TOLERANCE, 0.0, PARTS))
    there = shown()
    for name in names or edited.parameters.objects:
        number = edited.parameters.objects[name].instance
        assert (number in here) == (number in there), name
        if number in here:
            assert np.allclose(here[number], there[number], rtol=0.0, atol=EXACT), (name, here[number], there[number])


class TestPlaces:
    def test_nothing_is_read_where_nothing_was_edited(self, model: RoadModel) -> None:
        edited = truth(model)
        assert edited.parameters == small_parameters()
        assert not edited.by_hand
        assert not edited.stale

    @pytest.mark.parametrize(
        ("by", "turn"), [((3.0, 0.7, 0.0), 0.0), ((0.0, 0.0, 0.0), 25.0), ((1.0, 2.0, 0.4), -70.0)]
    )
    def test_a_sign_that_was_moved_or_turned(
        self, model: RoadModel, by: tuple[float, float, float], turn: float
    ) -> None:
        move(model.objects["sign"], by, turn)
        edited = truth(model)
        assert changed(model, edited) == {"sign"}
        assert not edited.stale
        assert_shows(edited)

    def test_posts_whose_vertices_were_moved_and_deleted(self, model: RoadModel) -> None:
        mesh = model.objects["Delineators"].data
        mesh.vertices[0].co.x += 2.0
        before = small_parameters()
        edited = truth(model)
        assert changed(model, edited) == {"post-1"}
        was, now = (RoadGeometry(p).alignment.place(*place(p, "post-1"))[0] for p in (before, edited.parameters))
        ahead = RoadGeometry(before).alignment.heading(np.array([10.0]))[0]  # the first post's own x axis
        assert np.allclose(now - was, 2.0 * np.array([np.cos(ahead), np.sin(ahead)]), atol=EXACT)
        keep_vertices(mesh, [1])
        edited = truth(model)
        assert "post-1" not in edited.parameters.objects
        assert not edited.by_hand
        assert_shows(edited, ("post-2",))

    def test_a_guardrail_moves_along_and_across_the_road(self, model: RoadModel) -> None:
        before = small_parameters()
        geometry = RoadGeometry(before)
        middle = np.array([27.5])
        left, ahead = geometry.alignment.heading(middle)[0] + np.pi / 2.0, geometry.alignment.heading(middle)[0]
        shift = 3.0 * np.array([np.cos(left), np.sin(left)]) + 2.0 * np.array([np.cos(ahead), np.sin(ahead)])
        rail = model.objects["rail-right"]
        move(rail, (*shift, 0.0))
        edited = truth(model)
        assert changed(model, edited) == {"rail-right"}
        item: Any = edited.parameters.objects["rail-right"]
        assert item.offset == pytest.approx(-11.9, abs=0.002)  # straight on by 2 m in the bend
        assert (item.start_station, item.end_station) == pytest.approx((12.0, 47.0), abs=0.05)
        assert edited.stale
        assert move_line(rail, bpy.context.scene)
        assert not move_line(rail, bpy.context.scene)
        again = truth(model)
        assert again.parameters.objects["rail-right"].to_dict() == pytest.approx(item.to_dict(), abs=1e-5)
        assert not again.stale
        assert_shows(again)

    def test_a_guardrail_stops_at_the_roads_end(self, model: RoadModel) -> None:
        move(model.objects["rail-right"], (500.0, 300.0, 0.0))
        item: Any = truth(model).parameters.objects["rail-right"]
        assert (item.start_station, item.end_station) == pytest.approx((25.0, 60.0))

    def test_a_car_stands_in_the_lane_that_it_was_put_on(self, model: RoadModel) -> None:
        geometry = RoadGeometry(small_parameters())
        there = geometry.alignment.place(np.array([30.0]), np.array([-5.0]))[0]
        here = geometry.alignment.place(np.array([20.0]), np.array([-10.6]))[0]
        car = model.objects["car"]
        move(car, (*(there - here), 0.0))
        edited = truth(model)
        item: Any = edited.parameters.objects["car"]
        assert (item.carriageway, item.lane) == ("right", 1)
        assert item.station == pytest.approx(30.0, abs=0.1)
        settle(str(model.root["synthroads_road"]), edited)
        assert read_road(model.root).parameters == edited.parameters
        assert_shows(edited)

    def test_deleted_and_unlinked_things_are_gone(self, model: RoadModel) -> None:
        bpy.data.objects.remove(model.objects["rail-left"])
        sign = model.objects["sign"]
        for collection in sign.users_collection:
            collection.objects.unlink(sign)
        bpy.data.scenes.new("Other").collection.objects.link(sign)
        edited = truth(model)
        assert changed(model, edited) == {"rail-left", "sign"}
        assert {"rail-left", "sign"}.isdisjoint(edited.parameters.objects)
        if edited.stale:
            settle(str(model.root["synthroads_road"]), edited)
        assert_shows(edited)

    def test_a_copy_is_one_more_thing_with_a_number_of_its_own(self, model: RoadModel) -> None:
        for name in ("sign", "rail-left"):
            copy = model.objects[name].copy()
            copy.data = copy.data.copy()
            model.collection.objects.link(copy)
            move(copy, (-4.0, -3.0, 0.0))
        edited = truth(model)
        assert changed(model, edited) == {"sign-2", "rail-left-2"}
        settle(str(model.root["synthroads_road"]), edited)
        assert read_road(model.root).parameters == edited.parameters
        assert len([item for item in bpy.data.objects if item.name.startswith("sign")]) == 2
        assert_shows(edited)

    def test_a_renamed_and_a_parented_part_are_still_parts(self, model: RoadModel) -> None:
        model.objects["sign"].name = "My Sign"
        empty = bpy.data.objects.new("Empty", None)
        bpy.context.scene.collection.objects.link(empty)
        empty.location = (7.0, -2.0, 1.0)
        bpy.context.view_layer.update()
        rail = model.objects["rail-left"]
        rail.parent, rail.matrix_parent_inverse = empty, empty.matrix_world.inverted()
        edited = truth(model)
        assert edited.parameters == small_parameters()
        assert not edited.by_hand

    def test_a_road_in_two_scenes_is_read_by_what_each_shows(self, model: RoadModel) -> None:
        other = bpy.data.scenes.new("Other")
        for item in (model.root, *model.objects.values()):
            if item.name != "sign":
                other.collection.objects.link(item)
        assert "sign" not in read_road(model.root, other).parameters.objects
        assert truth(model).parameters == small_parameters()

    def test_a_linked_road_is_read_and_left_alone(self, model: RoadModel, tmp_path: Path) -> None:
        file = tmp_path / "linked.blend"
        model.objects["sign"].location += Vector((1.0, 0.5, 0.0))
        bpy.context.view_layer.update()
        edited = truth(model)
        bpy.data.libraries.write(str(file), {model.collection})
        empty_file()
        with bpy.data.libraries.load(str(file), link=True) as (source, wanted):
            wanted.collections = source.collections
        bpy.context.scene.collection.children.link(wanted.collections[0])
        opened = open_road()
        assert opened is not None
        assert opened.edited == edited
        before = shown()
        here = build_small(small_parameters(40.0), parts=("road",), place=BuildTarget(beside=True))
        bpy.data.objects.remove(here.objects["Road"])
        assert shown().keys() >= before.keys()
        assert opened.edited == open_road(opened.name).edited  # type: ignore[union-attr]

    def test_structures_and_assets_that_were_moved_and_turned(self) -> None:
        """A gantry with its signs, a bridge with its piers, and an asset that was also raised and enlarged."""
        more: dict[str, dict[str, Any]] = {
            "gantry": {"type": "Gantry", "kind": "one_sided", "station": 30.0, "offset": -8.5, "left_offset": -1.0}
            | {"right_offset": -16.0, "signs": [{"offset": -7.0, "width": 2.0, "height": 1.0, "text": ["A"]}]},
            "bridge": {"type": "Overpass", "station": 45.0, "offset": 0.0, "left_abutment": 20.0}
            | {"right_abutment": -20.0, "pier_offsets": [0.0]},
            "bin": {"type": "Asset", "library": "roadside", "name": "grit_bin", "class_name": "roadside"}
            | {"station": 12.0, "offset": -17.0},
        }
        model = build_small(small_parameters(**more), parts=(*PARTS, "gantries", "overpasses", "assets"))
        assert truth(model).parameters == small_parameters(**more)
        model.objects["gantry"].location.x += 2.0
        model.objects["bridge"].location.y += 1.0
        asset = model.objects["bin"]
        asset.location.z += 0.4
        asset.scale = (1.5, 1.5, 1.5)
        asset.rotation_euler.z += 0.3
        edited = truth(model)
        now: Any = edited.parameters.objects
        assert not edited.by_hand
        assert now["bin"].elevation == pytest.approx(0.4, abs=EXACT)
        assert (now["bin"].scale, now["bin"].station, now["bin"].offset) == pytest.approx((1.5, 12.0, -17.0), abs=EXACT)
        assert now["bin"].rotation_deg == pytest.approx(np.rad2deg(0.3), abs=0.001)
        shift = now["gantry"].offset + 8.5
        assert shift == pytest.approx(-2.0 * np.sin(np.deg2rad(31.4)), abs=0.01)
        ends = now["gantry"].left_offset, now["gantry"].right_offset, now["gantry"].signs[0].offset
        assert ends == pytest.approx((-1.0 + shift, -16.0 + shift, -7.0 + shift), abs=1e-5)
        assert now["bridge"].station == pytest.approx(45.0 + np.sin(np.deg2rad(32.1)), abs=0.01)
        place, before = np.array(asset.matrix_world), np.array(model.objects["gantry"].location)
        settle(str(model.root["synthroads_road"]), edited)
        again = read_road(model.root).parameters.objects
        assert {name: item for name, item in again.items() if item != now[name]} == {}
        assert np.allclose(np.array(bpy.data.objects["bin"].matrix_world), place, atol=EXACT)
        assert np.allclose(np.array(bpy.data.objects["gantry"].location)[:2], before[:2], atol=EXACT)


class TestByHand:
    @pytest.mark.parametrize("what", ["scaled", "tilted", "modified", "applied", "sculpted", "off", "input"])
    def test_what_no_parameter_says_is_marked_and_named(self, model: RoadModel, what: str) -> None:
        names = {"sign", "rail-left"} if what == "input" else {"sign", "rail-left", "car"}
        for name in names:
            change(model.objects[name], what)
        edited = truth(model)
        assert {(edit.part, edit.name) for edit in edited.by_hand} == {(name, name) for name in names}
        assert names.isdisjoint(edited.parameters.objects)
        assert changed(model, edited) == names
        assert {entry["object"] for entry in edited.to_dict()["edited_by_hand"]} == names

    def test_joined_signs_are_marked(self, model: RoadModel) -> None:
        copy = model.objects["sign"].copy()
        copy.data = copy.data.copy()
        model.collection.objects.link(copy)
        bpy.context.view_layer.update()
        with bpy.context.temp_override(
            active_object=model.objects["sign"], selected_editable_objects=[model.objects["sign"], copy]
        ):
            bpy.ops.object.join()
        assert [edit.part for edit in truth(model).by_hand] == ["sign"]

    def test_it_stays_in_the_scene_with_its_class_when_the_road_is_built_again(self, model: RoadModel) -> None:
        model.objects["sign"].scale = (1.0, 1.0, 1.5)
        copy = model.objects["rail-left"].copy()
        model.collection.objects.link(copy)
        move(copy, (-3.0, 1.0, 0.0))
        bpy.context.view_layer.update()
        number = small_parameters().objects["sign"].instance
        before = shown()[number]
        settle(str(model.root["synthroads_road"]), truth(model))
        edited = truth(model)
        assert [edit.part for edit in edited.by_hand] == ["sign"]
        assert "sign" not in edited.parameters.objects
        scene = scanned_scene().static
        signs = scene.triangles[(scene.class_id == class_id("road_sign")) & (scene.instance_id == 0)]
        assert number not in np.unique(scene.instance_id)
        points = scene.vertices[np.unique(signs)] + (scene.origin - MAP)
        assert np.allclose([points.min(axis=0), points.max(axis=0)], before, atol=EXACT)

    def test_a_road_whose_surface_was_edited_is_lost(self, model: RoadModel) -> None:
        model.objects["Road"].modifiers.new("Bevel", "BEVEL")
        edited = truth(model)
        assert "Bevel" in edited.lost
        with pytest.raises(InputError, match="Bevel"):
            edited.known()

    def test_a_scaled_road_is_lost(self, model: RoadModel) -> None:
        model.root.scale = (1.0, 2.0, 1.0)
        with pytest.raises(InputError, match="scaled"):
            truth(model).known()


def change(item: bpy.types.Object, what: str) -> None:
    """Do something to an object that no parameter says."""
    modifier = item.modifiers[0]
    if what == "scaled":
        item.scale = (1.0, 1.0, 1.2)
    elif what == "tilted":
        item.rotation_euler = (0.05, 0.0, 0.0)
    elif what == "modified":
        item.modifiers.new("Bevel", "BEVEL")
    elif what == "off":
        modifier.show_viewport = False
    elif what == "applied":
        with bpy.context.temp_override(object=item, active_object=item):
            bpy.ops.object.modifier_apply(modifier=modifier.name)
    elif what == "sculpted":
        item.data.vertices.add(3)
    else:
        name = {"sign": "Shape", "rail-left": "Spacer"}[item["synthroads_role"]]
        set_modifier_input(modifier, name, 2 if name == "Shape" else 0.33)


def keep_vertices(mesh: bpy.types.Mesh, numbers: list[int]) -> None:
    """Delete all vertices of a mesh but some."""
    import bmesh

    body = bmesh.new()
    body.from_mesh(mesh)
    bmesh.ops.delete(body, geom=[vertex for vertex in body.verts if vertex.index not in numbers])
    body.to_mesh(mesh)
    body.free()


def place(parameters: RoadParameters, name: str) -> Iterator[np.ndarray]:
    """Yield station and offset of a thing, as arrays."""
    item: Any = parameters.objects[name]
    yield np.array([item.station])
    yield np.array([item.offset])


class TestWhole:
    def test_a_raised_and_shifted_road(self, model: RoadModel) -> None:
        model.root.location = (3.0, -4.0, 2.0)
        edited = truth(model)
        before = small_parameters()
        assert edited.parameters.objects == before.objects
        shift = np.array(edited.parameters.transform.translate) - np.array(before.transform.translate)
        assert np.allclose(shift, (3.0, -4.0, 2.0), atol=EXACT)
        assert not edited.stale
        assert_shows(edited)

    def test_a_turned_road_is_built_again_where_it_is(self, model: RoadModel) -> None:
        model.root.location, model.root.rotation_euler = (3.0, -4.0, 2.0), (0.0, 0.0, 0.4)
        edited = truth(model)
        assert edited.stale
        settle(str(model.root["synthroads_road"]), edited)
        assert tuple(model.root.rotation_euler) == (0.0, 0.0, 0.0)
        assert read_road(model.root).parameters == edited.parameters
        assert_shows(edited)

    def test_moved_points_of_the_backbone_are_fitted(self, model: RoadModel) -> None:
        """They are moved onto a known axis: a bend of 400 m instead of 1200 m, falling instead of rising."""
        data = small_parameters().to_dict()
        axis = next(item for item in data["objects"].values() if item["type"] == "Alignment")
        axis["horizontal"] = [{"kind": "arc", "length": 62.0, "curvature_start": 1 / 400, "curvature_end": 1 / 400}]
        axis["vertical"] = [{"station": 0.0, "elevation": 1.0}, {"station": 62.0, "elevation": 0.0}]
        wanted = RoadGeometry(RoadParameters.from_dict(data))
        mesh = model.objects["Backbone"].data
        station = np.linspace(0.0, 62.0, len(mesh.vertices))
        points = np.column_stack([wanted.alignment.position(station), wanted.profile.elevation(station)])
        mesh.vertices.foreach_set("co", points.astype(np.float32).ravel())
        edited = truth(model)
        assert edited.axis is not None
        assert edited.axis.horizontal.worst < EXACT
        assert edited.axis.height.worst < EXACT
        found = alignment_of(edited.parameters.alignment)
        assert np.allclose(found.position(station), points[:, :2], atol=EXACT)
        item: Any = edited.parameters.objects["rail-right"]
        assert item.start_station == pytest.approx(10.0 * 62.0 / 60.0, abs=0.3)
        assert item.offset == -14.9
        settle(str(model.root["synthroads_road"]), edited)
        assert read_road(model.root).parameters == edited.parameters
        assert_shows(edited)

    def test_raised_points_leave_the_curves_as_they_are(self, model: RoadModel) -> None:
        mesh = model.objects["Backbone"].data
        for vertex in mesh.vertices:
            vertex.co.z += 0.02 * vertex.co.x
        edited = truth(model)
        before = small_parameters().alignment
        assert edited.parameters.alignment.horizontal == before.horizontal
        assert edited.parameters.alignment.vertical != before.vertical
        assert edited.axis is not None
        assert edited.axis.height.worst < 0.01
