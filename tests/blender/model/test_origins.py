"""Origins of a road's objects: where the thing stands, x along the road; Blender's own tools edit what they seem to."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from synthroads_addon.blender.model.build import RoadModel, build_road
from synthroads_addon.blender.model.roads import origin_of
from synthroads_addon.blender.model.settle import move_line
from synthroads_addon.blender.model.store import find_road, objects_of
from synthroads_addon.blender.model.truth import EditedRoad, read_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import ROLE, BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import LineObject, PointObject
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.terrain import surface_elevation
from tests.helpers.scenes.small_road import build_small, small_parameters

EXACT, TURN = 0.001, 0.1
"""Allowed differences of what is read back: m, and degrees."""
POINTS: dict[str, dict[str, Any]] = {
    "sign": {"type": "TrafficSign", "station": 40.0, "offset": -16.5, "code": "274-120", "shape": "round"}
    | {"width": 0.75, "height": 0.75, "rotation_deg": 12.0},
    "pole": {"type": "Pole", "station": 20.0, "offset": 16.0},
    "phone": {"type": "Cabinet", "station": 25.0, "offset": -16.2, "kind": "emergency_phone"},
    "cabinet": {"type": "Cabinet", "station": 27.0, "offset": -18.0, "kind": "utility", "pad_margin": 0.2},
    "light": {"type": "TrafficLight", "station": 30.0, "offset": 16.5, "rotation_deg": 180.0},
    "board": {"type": "KilometreBoard", "station": 33.0, "offset": -16.3, "text": "1,5"},
    "shaft": {"type": "Shaft", "station": 36.0, "offset": 17.0},
    "parked": {"type": "ParkedVehicle", "station": 38.0, "offset": 30.0, "rotation_deg": 90.0},
    "house": {"type": "Building", "station": 45.0, "offset": 45.0, "rotation_deg": 80.0},
    "gantry": {"type": "Gantry", "station": 50.0, "offset": 0.0, "kind": "one_sided", "left_offset": 1.0}
    | {"right_offset": -17.0, "post_side": "right"}
    | {"signs": [{"offset": -8.0, "width": 3.0, "height": 2.0, "kind": "destination", "text": ["A 4"]}]},
    "bridge": {"type": "Overpass", "station": 12.0, "offset": 0.0, "left_abutment": 25.0, "right_abutment": -24.0}
    | {"rotation_deg": 8.0, "pier_offsets": [0.0]},
    "line": {"type": "PowerLine", "station": 55.0, "offset": 0.0},
}
LINES: dict[str, dict[str, Any]] = {
    "rail": {"type": "Guardrail", "start_station": 10.0, "end_station": 45.0, "offset": -14.9, "faces": "left"},
    "wall": {"type": "ConcreteBarrier", "start_station": 12.0, "end_station": 40.0, "offset": 14.9},
    "noise": {"type": "NoiseBarrier", "start_station": 8.0, "end_station": 40.0, "offset": 19.0},
    "fence": {"type": "Fence", "start_station": 5.0, "end_station": 50.0, "offset": -24.0},
    "gutter": {"type": "Gutter", "start_station": 5.0, "end_station": 50.0, "offset": 1.0, "kerb_side": "right"},
    "stone": {"type": "Wall", "start_station": 15.0, "end_station": 35.0, "offset": 28.0},
    "moved-barrier": {"type": "TemporaryBarrier", "start_station": 15.0, "end_station": 45.0, "offset": 9.0}
    | {"end_offset": 10.0},
}
PARTS = None
"""All parts of a model."""


def thing_parameters() -> RoadParameters:
    """Return a road of 60 m with one of every thing."""
    return small_parameters(60.0, **{name: dict(item) for name, item in (POINTS | LINES).items()})


@cache
def _thing_file() -> Path:
    """Return a file with the road of `thing_parameters`, which is built once: to open it is much faster."""
    file = Path(tempfile.mkdtemp(prefix="synthroads-test-")) / "things.blend"
    build_small(thing_parameters(), parts=PARTS)
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


def open_things() -> RoadModel:
    """Return the road of `thing_parameters` in a file of its own, whose scene is the current one then."""
    bpy.ops.wm.open_mainfile(filepath=str(_thing_file()))
    root = find_road(bpy.context.scene)
    assert root is not None
    bpy.context.view_layer.update()
    return RoadModel(root, root.users_collection[0], objects_of(root), np.array(origin_of(root)))


@pytest.fixture
def parameters() -> RoadParameters:
    """The parameters of the road with one of every thing."""
    return thing_parameters()


@pytest.fixture
def model() -> RoadModel:
    """The road with one of every thing, in a file of its own."""
    return open_things()


def truth(model: RoadModel) -> EditedRoad:
    """Return what the scene shows now."""
    bpy.context.view_layer.update()
    return read_road(model.root)


def place_of(parameters: RoadParameters, item: PointObject | LineObject) -> tuple[np.ndarray, float]:
    """Return where a thing's origin belongs, m, and the course of the road there turned by its rotation, deg."""
    geometry = RoadGeometry(parameters)
    station = item.station if isinstance(item, PointObject) else item.start_station
    offset = item.offset
    plan = geometry.alignment.place(np.array([station]), np.array([offset]))[0]
    height = surface_elevation(geometry, np.array([station]), np.array([offset]))[0]
    turn = item.rotation_deg if isinstance(item, PointObject) and item.type != "Overpass" else 0.0
    return np.array([*plan, height]), float(np.rad2deg(geometry.alignment.heading(np.array([station]))[0])) + turn


def angle(first: float, second: float) -> float:
    """Return the difference of two angles, deg, without whole turns."""
    return abs((first - second + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("name", [*POINTS, *LINES])
def test_a_things_origin_is_where_it_stands_with_x_along_the_road(
    model: RoadModel, parameters: RoadParameters, name: str
) -> None:
    item = model.objects[name]
    place, course = place_of(parameters, parameters.objects[name])
    assert np.allclose(item.matrix_world.translation, place, rtol=0.0, atol=EXACT)
    ahead, up = item.matrix_world.col[0], item.matrix_world.col[2]
    assert angle(np.rad2deg(np.arctan2(ahead.y, ahead.x)), course) < TURN
    assert np.allclose(up.to_3d(), (0.0, 0.0, 1.0), atol=1e-6)


def test_the_posts_origin_is_the_first_one(model: RoadModel, parameters: RoadParameters) -> None:
    place, course = place_of(parameters, parameters.objects["post-1"])
    matrix = model.objects["Delineators"].matrix_world
    assert np.allclose(matrix.translation, place, rtol=0.0, atol=EXACT)
    assert angle(np.rad2deg(matrix.to_euler().z), course) < TURN


def test_nothing_is_read_where_nothing_was_edited(model: RoadModel, parameters: RoadParameters) -> None:
    edited = truth(model)
    assert edited.parameters == parameters
    assert not edited.by_hand
    assert not edited.stale


def world_axis(item: bpy.types.Object, number: int) -> Vector:
    return item.matrix_world.col[number].to_3d().normalized()


@pytest.mark.parametrize("name", POINTS)
def test_to_turn_a_thing_about_its_origin_is_to_turn_it(
    model: RoadModel, parameters: RoadParameters, name: str
) -> None:
    """The rotate gizmo leaves the origin where it is, and so station and offset."""
    item, before = model.objects[name], parameters.objects[name]
    item.rotation_euler.z += np.deg2rad(10.0)
    now = truth(model).parameters.objects[name]
    assert (now.station, now.offset) == pytest.approx((before.station, before.offset), abs=EXACT)
    assert angle(now.rotation_deg, before.rotation_deg + 10.0) < TURN


@pytest.mark.parametrize("name", POINTS)
def test_a_move_along_a_things_own_axes_is_one_along_and_across_the_road(
    model: RoadModel, parameters: RoadParameters, name: str
) -> None:
    """G X X and G Y Y move an object along its own axes."""
    item, before = model.objects[name], parameters.objects[name]
    item.location = item.location + world_axis(item, 0) * 1.5 + world_axis(item, 1) * 0.5
    edited = truth(model)
    now = edited.parameters.objects[name]
    turn = np.deg2rad(before.rotation_deg if before.type != "Overpass" else 0.0)
    geometry = RoadGeometry(parameters)
    heading = float(geometry.alignment.heading(np.array([before.station]))[0]) + turn
    way = np.array([np.cos(heading), np.sin(heading)])
    there = geometry.alignment.place(np.array([before.station]), np.array([before.offset]))[0]
    there = there + 1.5 * way + 0.5 * np.array([-way[1], way[0]])
    station, offset = (float(value[0]) for value in geometry.alignment.project(there[None]))
    assert (now.station, now.offset) == pytest.approx((station, offset), abs=EXACT)
    bend = float(np.rad2deg(np.diff(geometry.alignment.heading(np.array([before.station, station])))[0]))
    assert angle(now.rotation_deg, before.rotation_deg - bend) < 0.01
    assert not [edit for edit in edited.by_hand if edit.part == name]


@pytest.mark.parametrize("name", POINTS)
def test_a_snapped_thing_stands_where_it_was_snapped_to(
    model: RoadModel, parameters: RoadParameters, name: str
) -> None:
    item = model.objects[name]
    target = RoadGeometry(parameters).alignment.place(np.array([22.0]), np.array([-20.0]))[0]
    item.matrix_world.translation = Vector((*target, 3.0))
    bpy.context.scene.cursor.location = (*target, 3.0)
    now = truth(model).parameters.objects[name]
    assert (now.station, now.offset) == pytest.approx((22.0, -20.0), abs=EXACT)


@pytest.mark.parametrize("name", POINTS)
def test_a_mirrored_thing_stands_on_the_other_side_and_looks_the_mirrored_way(
    model: RoadModel, parameters: RoadParameters, name: str
) -> None:
    """Mirror across the road's axis at the thing, with the 3D cursor on the axis as pivot."""
    item, before = model.objects[name], parameters.objects[name]
    geometry = RoadGeometry(parameters)
    at = np.array([before.station])
    heading, middle = float(geometry.alignment.heading(at)[0]), geometry.alignment.position(at)[0]
    turn = Matrix.Translation((*middle, 0.0)) @ Matrix.Rotation(heading, 4, "Z")
    item.matrix_world = turn @ Matrix.Scale(-1.0, 4, (0.0, 1.0, 0.0)) @ turn.inverted() @ item.matrix_world
    edited = truth(model)
    assert not [edit for edit in edited.by_hand if edit.part == name]
    assert edited.stale
    now = edited.parameters.objects[name]
    assert (now.station, now.offset) == pytest.approx((before.station, -before.offset), abs=EXACT)
    assert angle(now.rotation_deg, -before.rotation_deg) < TURN
    for field, other in (("left_offset", "right_offset"), ("left_abutment", "right_abutment")):
        if hasattr(before, field):
            assert getattr(now, field) == pytest.approx(-getattr(before, other), abs=EXACT)


@pytest.mark.parametrize("name", [*POINTS, *LINES])
def test_a_duplicate_is_one_more_thing(model: RoadModel, parameters: RoadParameters, name: str) -> None:
    item, before = model.objects[name], parameters.objects[name]
    copy = item.copy()
    bpy.context.scene.collection.objects.link(copy)
    copy.location = copy.location + world_axis(item, 0) * 2.0
    edited = truth(model)
    (new,) = [found for key, found in edited.parameters.objects.items() if key not in parameters.objects]
    assert edited.parameters.objects[name] == before
    assert type(new) is type(before)
    where = new.start_station if isinstance(new, LineObject) else new.station
    was = before.start_station if isinstance(before, LineObject) else before.station
    if isinstance(before, LineObject) or before.rotation_deg in (0.0, 180.0):
        assert abs(where - was) == pytest.approx(2.0, abs=0.06)  # straight on in the bend
    assert not [edit for edit in edited.by_hand if edit.part == name]


@pytest.mark.parametrize("name", LINES)
def test_a_line_moved_along_its_own_axes_stands_at_its_beginning_again(
    model: RoadModel, parameters: RoadParameters, name: str
) -> None:
    item, before = model.objects[name], parameters.objects[name]
    item.location = item.location + world_axis(item, 1) * 0.5
    first = truth(model).parameters.objects[name]
    assert first.offset == pytest.approx(before.offset + 0.5, abs=0.01)
    assert move_line(item, bpy.context.scene)
    bpy.context.view_layer.update()
    second = truth(model)
    assert second.parameters.objects[name].to_dict() == pytest.approx(first.to_dict(), abs=EXACT)
    place, course = place_of(parameters, second.parameters.objects[name])
    assert np.allclose(item.matrix_world.translation, place, rtol=0.0, atol=EXACT)
    assert angle(np.rad2deg(item.matrix_world.to_euler().z), course) < TURN
    assert not move_line(item, bpy.context.scene)


def test_a_mirrored_guardrail_has_its_beam_on_the_other_side(model: RoadModel, parameters: RoadParameters) -> None:
    item = model.objects["rail"]
    geometry = RoadGeometry(parameters)
    at = np.array([27.5])
    heading, middle = float(geometry.alignment.heading(at)[0]), geometry.alignment.position(at)[0]
    turn = Matrix.Translation((*middle, 0.0)) @ Matrix.Rotation(heading, 4, "Z")
    item.matrix_world = turn @ Matrix.Scale(-1.0, 4, (0.0, 1.0, 0.0)) @ turn.inverted() @ item.matrix_world
    rail = truth(model).parameters.objects["rail"]
    assert rail.faces == "right"
    assert rail.offset > 14.0
    assert move_line(item, bpy.context.scene)
    edited = truth(model)
    assert edited.parameters.objects["rail"].faces == "right"
    assert not [edit for edit in edited.by_hand if edit.part == "rail"]
    assert item.matrix_world.determinant() > 0.0


def test_a_line_that_was_turned_keeps_its_shape(model: RoadModel) -> None:
    """It follows the road, wherever its object is: so do its vectors to the left."""
    item = model.objects["rail"]
    before = scene_mesh(objects=[item])
    item.rotation_euler.z += np.deg2rad(25.0)
    bpy.context.view_layer.update()
    after = scene_mesh(objects=[item])
    assert np.allclose(before.vertices, after.vertices, rtol=0.0, atol=2e-4)


def test_a_moved_and_turned_root_takes_the_things_along(model: RoadModel, parameters: RoadParameters) -> None:
    model.root.location = (30.0, -20.0, 2.0)
    model.root.rotation_euler.z = np.deg2rad(35.0)
    edited = truth(model)
    for name in POINTS:
        assert edited.parameters.objects[name] == parameters.objects[name]
    item = model.objects["sign"]
    item.rotation_euler.z += np.deg2rad(10.0)
    now, before = truth(model).parameters.objects["sign"], parameters.objects["sign"]
    assert (now.station, now.offset) == pytest.approx((before.station, before.offset), abs=EXACT)
    assert angle(now.rotation_deg, before.rotation_deg + 10.0) < TURN


def test_a_file_of_an_earlier_version_is_read_as_before(model: RoadModel, parameters: RoadParameters) -> None:
    """There every vertex was in the road's own frame, and the object's frame was that too."""
    for name in ("sign", "pole"):
        item = model.objects[name]
        into = np.linalg.inv(np.array(model.root.matrix_world)) @ np.array(item.matrix_world)
        heading = item.data.attributes["heading"].data[0].value + np.arctan2(into[1, 0], into[0, 0])
        item.data.vertices[0].co = into[:3, 3]
        item.data.attributes["heading"].data[0].value = heading
        item.matrix_basis = Matrix.Identity(4)
        for key in ("synthroads_ahead", "synthroads_built"):
            if key in item:
                del item[key]
    assert truth(model).parameters == parameters
    sign = model.objects["sign"]
    point = sign.data.vertices[0].co.copy()
    turn = Matrix.Translation(point) @ Matrix.Rotation(np.deg2rad(10.0), 4, "Z") @ Matrix.Translation(-point)
    sign.matrix_world = turn @ sign.matrix_world
    now, before = truth(model).parameters.objects["sign"], parameters.objects["sign"]
    assert (now.station, now.offset) == pytest.approx((before.station, before.offset), abs=EXACT)
    assert angle(now.rotation_deg, before.rotation_deg + 10.0) < TURN


def test_a_road_rebuilt_from_its_truth_shows_the_same(model: RoadModel, parameters: RoadParameters) -> None:
    """A turned gantry's and a moved bridge's shapes are those of the parameters that are read."""
    model.objects["gantry"].location.x += 1.0
    model.objects["sign"].rotation_euler.z += 0.3
    edited = truth(model)
    here = scene_mesh(objects=[model.objects["sign"], model.objects["pole"]])
    bpy.context.window.scene = bpy.data.scenes.new("Check")
    again = build_road(BuildRequest(edited.known(), 0.1, 0.0, PARTS))
    there = scene_mesh(objects=[again.objects["sign"], again.objects["pole"]])
    assert np.allclose(here.vertices, there.vertices, rtol=0.0, atol=EXACT)
    assert all(ROLE in item for item in again.objects.values())


def test_it_is_so_in_a_saved_file(model: RoadModel, parameters: RoadParameters, tmp_path: Path) -> None:
    file = tmp_path / "road.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.open_mainfile(filepath=str(file))
    root = next(item for item in bpy.context.scene.objects if "synthroads_frame" in item)
    assert read_road(root).parameters == parameters
