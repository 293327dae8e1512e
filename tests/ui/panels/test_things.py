"""The Edit panel of things, placing them, repeating and deleting them: all of it is in the truth at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest

import synthroads_addon
from synthroads_addon.blender.model.roads import parts_and_copies
from synthroads_addon.blender.model.settle import settle
from synthroads_addon.blender.model.store import find_road, recall_parameters
from synthroads_addon.blender.model.truth import EditedRoad, read_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import LineObject
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.sampling.placing.single import usual_sign
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.panels import edit, placing, things
from synthroads_addon.ui.work import follow
from tests.blender.model.test_origins import LINES, POINTS, open_things
from tests.helpers.scenes.fake_layout import drawn

EXACT = 0.001


@pytest.fixture(autouse=True)
def road() -> Iterator[bpy.types.Object]:
    """Register the add-on and build a road with one of every thing; return its root."""
    synthroads_addon.register()
    model = open_things()
    yield model.root
    synthroads_addon.unregister()


def truth() -> EditedRoad:
    """Return what the scene shows now."""
    bpy.context.view_layer.update()
    root = find_road(bpy.context.scene)
    assert root
    return read_road(root)


def part(name: str) -> bpy.types.Object:
    """Make a part of the road the active object; return it."""
    root = find_road(bpy.context.scene)
    assert root
    item = parts_and_copies(root, bpy.context.scene)[0][name]
    for other in bpy.context.view_layer.objects.selected:
        other.select_set(False)
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    return item


def group(name: str) -> Any:
    """Return the properties of a part's kind, the part being active."""
    part(name)
    kind = (POINTS | LINES)[name]["type"]
    return getattr(bpy.context.scene.synthroads_things, kind)


@pytest.mark.parametrize("name", [*POINTS, *LINES])
def test_the_panel_shows_every_field_with_its_name_and_unit(name: str) -> None:
    values, thing = group(name), recall_parameters(find_road(bpy.context.scene)).objects[name]
    for field in ("station", "offset", "rotation_deg", "start_station", "end_station", "instance"):
        if hasattr(thing, field):
            assert getattr(values, field) == pytest.approx(getattr(thing, field), abs=EXACT), field
    lines = "\n".join(drawn(edit.SYNTHROADS_PT_edit, bpy.context).lines)
    expected = ["Offset", "Instance Number"]
    expected += ["Start Station", "End Station"] if isinstance(thing, LineObject) else ["Station", "Rotation (°)"]
    for label in expected:
        assert f"label {label!r}" in lines, label


@pytest.mark.parametrize("name", POINTS)
def test_station_offset_and_rotation_are_edited_live(name: str) -> None:
    values, item = group(name), part(name)
    before = item.matrix_world.copy()
    offset, turn = (0.5, 11.0) if name == "bridge" else (12.5, 33.0)
    for field, value in (("station", 21.0), ("offset", offset), ("rotation_deg", turn)):
        setattr(values, field, value)
        bpy.context.view_layer.update()
        assert getattr(truth().parameters.objects[name], field) == pytest.approx(value, abs=EXACT), field
        assert getattr(values, field) == pytest.approx(value, abs=EXACT)
    assert item.matrix_world != before
    assert not [edit_ for edit_ in truth().by_hand if edit_.part == name]


@pytest.mark.parametrize("name", [*POINTS, *LINES])
def test_every_other_number_and_choice_is_edited_live(name: str) -> None:
    values, kind = group(name), THINGS[(POINTS | LINES)[name]["type"]]
    skipped = {"station", "offset", "rotation_deg", "start_station", "end_station", "end_offset", "instance"}
    count = 0
    for field in things.edited_fields(kind):
        before = truth().parameters.objects[name]
        if field in skipped:
            continue
        prop = values.bl_rna.properties[field]
        if prop.type == "ENUM":
            choices = [item.identifier for item in prop.enum_items]
            other = next(choice for choice in choices if choice != getattr(values, field))
        elif prop.type in ("FLOAT", "INT") and not getattr(prop, "is_array", False):
            other = _another(prop, getattr(values, field))
        else:
            continue
        setattr(values, field, other)
        if things._State.refused[1]:
            things._State.refused = ("", "")
            assert truth().parameters.objects[name] == before
            continue
        now = truth()
        assert getattr(now.parameters.objects[name], field) == pytest.approx(other, abs=1e-5), field
        assert not [edit_ for edit_ in now.by_hand if edit_.part == name], field
        count += 1
    assert count >= 2


def test_an_instance_number_is_edited_unless_another_object_has_it() -> None:
    values = group("sign")
    values.instance = 70_000
    assert truth().parameters.objects["sign"].instance == 70_000
    values.instance = truth().parameters.objects["pole"].instance
    assert truth().parameters.objects["sign"].instance == 70_000
    assert "is that of pole" in things._State.refused[1]


def _another(prop: Any, value: float) -> float:
    step = 1 if prop.type == "INT" else 0.01
    return value + step if value + step <= prop.hard_max else value - step


def test_a_signs_number_and_text_change_its_face_at_once() -> None:
    values, item = group("sign"), part("sign")
    before = scene_mesh(objects=[item])
    values.code = "449"
    values.text = "Ausfahrt / Köln"
    sign = truth().parameters.objects["sign"]
    assert (sign.code, sign.text) == ("449", ("Ausfahrt", "Köln"))
    assert values.text == "Ausfahrt / Köln"
    bpy.context.view_layer.update()
    assert len(scene_mesh(objects=[item])) != len(before)
    edited = truth()
    shown = scene_mesh(objects=[item]).vertices
    model = settle(str(find_road(bpy.context.scene)["synthroads_road"]), edited)
    assert np.allclose(scene_mesh(objects=[model.objects["sign"]]).vertices, shown, rtol=0.0, atol=EXACT)
    assert read_road(model.root).parameters.objects["sign"] == edited.parameters.objects["sign"]


def gantry_bounds() -> dict[str, np.ndarray]:
    """Return the least and largest coordinates of a gantry's structure and of each sign's face, m, by part."""
    graph = bpy.context.evaluated_depsgraph_get()
    root = find_road(bpy.context.scene)
    assert root
    bounds: dict[str, np.ndarray] = {}
    for role, item in parts_and_copies(root, bpy.context.scene)[0].items():
        if role.partition("/")[0] == "gantry":
            evaluated = item.evaluated_get(graph)
            places = np.array([evaluated.matrix_world @ vertex.co for vertex in evaluated.data.vertices])
            bounds[role] = np.stack([places.min(axis=0), places.max(axis=0)])
    return bounds


def test_a_turned_and_moved_gantrys_signs_follow_at_once() -> None:
    item = part("gantry")
    first = gantry_bounds()
    item.location.x += 2.0
    item.rotation_euler.z += np.radians(10.0)
    bpy.context.view_layer.update()
    follow._moved.add(item.name)
    assert follow.follow(bpy.context.scene) == [item.name]
    edited = truth()
    shown = gantry_bounds()
    assert max(np.abs(shown[role] - first[role]).max() for role in first) > 1.0
    settle(str(find_road(bpy.context.scene)["synthroads_road"]), edited)
    bpy.context.view_layer.update()
    built = gantry_bounds()
    assert built.keys() == shown.keys() == first.keys()
    assert len(built) > 1
    for role in built:
        assert np.abs(built[role] - shown[role]).max() < EXACT, role
    follow._moved.add(part("gantry").name)
    assert follow.follow(bpy.context.scene) == []


def test_a_gantrys_texts_and_ends_are_edited() -> None:
    values = group("gantry")
    values.sign_texts = "A 57 / Krefeld"
    assert truth().parameters.objects["gantry"].signs[0].text == ("A 57", "Krefeld")
    values.right_offset = -18.5
    edited = truth()
    assert edited.parameters.objects["gantry"].right_offset == pytest.approx(-18.5)
    assert not [edit_ for edit_ in edited.by_hand if edit_.part.startswith("gantry")]


def test_a_value_that_is_not_allowed_stays_as_it_was_with_a_message() -> None:
    values = group("gantry")
    values.left_offset = -50.0  # left of the right end it must be
    assert truth().parameters.objects["gantry"].left_offset == pytest.approx(1.0)
    message = things._State.refused[1]
    assert "Left Offset must be greater than Right Offset" in message
    assert any("<ERROR>" in line for line in drawn(edit.SYNTHROADS_PT_edit, bpy.context).lines)


def test_a_changed_number_survives_another_edit_in_the_viewport() -> None:
    group("sign").code = "274-60"
    item = part("sign")
    item.rotation_euler.z += np.deg2rad(10.0)
    sign = truth().parameters.objects["sign"]
    assert sign.code == "274-60"
    assert sign.rotation_deg == pytest.approx(22.0, abs=0.1)
    assert sign.station == pytest.approx(40.0, abs=EXACT)


def test_every_thing_of_the_registry_can_be_added_at_the_cursor() -> None:
    """Each is in the truth at once, and the road that is built of it shows the same."""
    before = truth().parameters
    alignment, added = RoadGeometry(before).alignment, {}
    for number, kind in enumerate(THINGS):
        station = 4.0 + 2.0 * number
        place = alignment.place(np.array([station]), np.array([8.0]))[0]
        bpy.context.scene.cursor.location = (*place, 0.0)
        # They stand at one place here and there, as they are so near to each other.
        assert bpy.ops.synthroads.add_thing(kind=kind, free_place=False) == {"FINISHED"}, kind
        active = bpy.context.view_layer.objects.active
        added[active["synthroads_role"]] = (kind, station)
        assert len(scene_mesh(objects=[active])) > 0, kind
    edited = truth()
    assert not edited.by_hand
    assert set(edited.parameters.objects) - set(before.objects) == set(added)
    for name, (kind, station) in added.items():
        item = edited.parameters.objects[name]
        assert type(item) is THINGS[kind]
        where = item.start_station if isinstance(item, LineObject) else item.station
        assert where == pytest.approx(station, abs=0.01), kind
        assert item.offset > 0.0 or kind in ("Gantry", "Overpass", "PowerLine", "TrafficIsland"), kind
    assert len({item.instance for item in edited.parameters.objects.values()}) == len(edited.parameters.objects)
    model = settle(str(find_road(bpy.context.scene)["synthroads_road"]), edited)
    again = read_road(model.root)
    assert again.parameters.objects == edited.parameters.objects
    assert not again.stale


def test_side_offset_turn_text_and_length_can_be_given() -> None:
    assert bpy.ops.synthroads.add_thing(
        kind="TrafficSign",
        station=30.0,
        side="right",
        by_rule=False,
        offset=-17.25,
        turned=10.0,
        code="449",
        text="A / B",
    ) == {"FINISHED"}
    sign = truth().parameters.objects["traffic-sign-1"]
    assert (sign.station, sign.offset, sign.rotation_deg) == pytest.approx((30.0, -17.25, 10.0), abs=EXACT)
    assert (sign.code, sign.text) == ("449", ("A", "B"))
    assert bpy.ops.synthroads.add_thing(kind="Hedge", station=5.0, side="left", length=20.0) == {"FINISHED"}
    hedge = truth().parameters.objects["hedge-1"]
    assert (hedge.start_station, hedge.end_station) == pytest.approx((5.0, 25.0), abs=EXACT)


def test_a_small_thing_by_rule_stands_behind_the_barrier_and_faces_its_traffic() -> None:
    assert bpy.ops.synthroads.add_thing(kind="TrafficSign", station=30.0, side="right") == {"FINISHED"}
    sign = truth().parameters.objects["traffic-sign-1"]
    rail = truth().parameters.objects["rail-right"]
    assert sign.offset + sign.width / 2.0 < rail.offset
    assert sign.rotation_deg == 0.0
    assert bpy.ops.synthroads.add_thing(kind="TrafficSign", station=30.0, side="left") == {"FINISHED"}
    assert abs(truth().parameters.objects["traffic-sign-2"].rotation_deg) == 180.0


def test_a_sign_is_that_of_the_last_time_unless_the_road_is_of_another_country() -> None:
    chosen = [placing.sign_again(code, "DMRB85") for code in ("274-120", "GB.512-L", "made up", "")]
    assert chosen == ["", "GB.512-L", "made up", ""]
    assert placing.sign_again("GB.512-L", "EKA1A") == ""
    for code in ("", "GB.670-50"):
        bpy.ops.synthroads.add_thing(kind="TrafficSign", station=30.0, code=code)
    codes = [truth().parameters.objects[f"traffic-sign-{number}"].code for number in (1, 2)]
    assert codes == [usual_sign(truth().parameters.design_class), "GB.670-50"]


@pytest.mark.parametrize("by_rule", [True, False])
def test_a_thing_is_put_behind_what_stands_at_its_station(by_rule: bool, capfd: pytest.CaptureFixture[str]) -> None:
    options: dict[str, Any] = {"kind": "Pole", "station": 30.0, "side": "right", "by_rule": by_rule, "offset": -30.0}
    for _ in range(2):
        assert bpy.ops.synthroads.add_thing(**options) == {"FINISHED"}
    poles = [truth().parameters.objects[f"pole-{number}"] for number in (1, 2)]
    assert poles[0].station == 30.0
    assert 30.0 < poles[1].station < 31.0
    assert f"Info: pole-2 is at station {poles[1].station:.2f} m, behind pole-1" in capfd.readouterr().out
    assert [v.text for v in check(truth().parameters) if v.rule == "object-overlap" and "pole" in v.text] == []


def test_what_stands_at_one_place_with_another_is_named(capfd: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        bpy.ops.synthroads.add_thing(kind="Pole", station=30.0, side="right", free_place=False)
    poles = [truth().parameters.objects[f"pole-{number}"] for number in (1, 2)]
    assert [pole.station for pole in poles] == [30.0, 30.0]
    said = "Warning: pole-2 and pole-1 stand at one place: choose another station, side or offset"
    assert said in capfd.readouterr().out
    assert "object-overlap" in {violation.rule for violation in check(truth().parameters)}


def test_a_board_that_is_moved_tells_where_it_stands() -> None:
    place: dict[str, Any] = {"station": 47.0, "side": "right", "by_rule": False, "offset": -40.0}
    bpy.ops.synthroads.add_thing(kind="Building", free_place=False, **place)
    bpy.ops.synthroads.add_thing(kind="KilometreBoard", **place)
    board = truth().parameters.objects["kilometre-board-1"]
    assert 50.0 < board.station < 97.0
    assert board.text == "0,1"


def test_things_are_repeated_along_the_road() -> None:
    part("phone")
    assert bpy.ops.synthroads.repeat_thing(count=3, spacing=10.0) == {"FINISHED"}
    objects = truth().parameters.objects
    assert [objects[f"cabinet-{number}"].station for number in (1, 2, 3)] == pytest.approx(
        [35.0, 45.0, 55.0], abs=EXACT
    )
    assert {objects[f"cabinet-{number}"].offset for number in (1, 2, 3)} == {objects["phone"].offset}
    assert len({item.instance for item in objects.values()}) == len(objects)
    part("phone")
    with pytest.raises(RuntimeError, match="Spacing is"):
        bpy.ops.synthroads.repeat_thing(count=1, spacing=1000.0)


@pytest.mark.parametrize("name", ["sign", "gantry", "rail"])
def test_a_deleted_thing_is_gone_from_the_truth(name: str) -> None:
    part(name)
    assert bpy.ops.synthroads.delete_thing() == {"FINISHED"}
    edited = truth()
    assert name not in edited.parameters.objects
    assert not [item for item in bpy.data.objects if item.get("synthroads_role", "").startswith(f"{name}/")]
    assert not [edit_ for edit_ in edited.by_hand if edit_.part.startswith(name)]


def test_an_added_thing_can_be_edited_copied_and_deleted() -> None:
    bpy.ops.synthroads.add_thing(kind="Pole", station=30.0, side="right")
    item = bpy.context.view_layer.objects.active
    bpy.context.scene.synthroads_things.Pole.height = 8.0
    assert truth().parameters.objects["pole-1"].height == pytest.approx(8.0)
    copy = item.copy()
    bpy.context.scene.collection.objects.link(copy)
    copy.location = copy.location + copy.matrix_world.col[0].to_3d() * 5.0
    edited = truth()
    assert edited.parameters.objects["pole-1-2"].height == pytest.approx(8.0)
    bpy.data.objects.remove(copy)
    bpy.data.objects.remove(item)
    assert "pole-1" not in truth().parameters.objects


def test_without_a_road_nothing_can_be_added() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with pytest.raises(RuntimeError, match="Build a road first"):
        bpy.ops.synthroads.add_thing(kind="Pole")


@pytest.mark.parametrize("width", [200.0, 300.0])
@pytest.mark.parametrize("name", ["sign", "gantry", "rail", "cabinet"])
def test_the_fields_have_room(name: str, width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    part(name)
    layout = drawn(edit.SYNTHROADS_PT_edit, bpy.context)
    cut = [(text, place, needed) for text, place, needed in layout.texts(room.row_width()) if needed > place + 0.5]
    assert not cut


def test_the_menu_has_every_thing_once() -> None:
    kinds = [kind for block in placing.menu_groups() for kind in block]
    assert sorted(kinds) == sorted(THINGS)


def test_known_sign_numbers_are_listed_by_number_and_meaning() -> None:
    known = dict(things.sign_numbers(None, bpy.context, "274"))
    assert "274-120" in known
    assert all("274" in f"{number} {about}" for number, about in known.items())
    assert things.sign_numbers is placing.sign_numbers  # the redo panel's field lists them as well
    word = known["274-120"].split()[0]
    assert "274-120" in dict(things.sign_numbers(None, bpy.context, word.upper()))
    assert dict(things.sign_numbers(None, bpy.context, "no such sign")) == {}
