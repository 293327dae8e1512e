"""Each kind of edit by itself, scanned from the panel: cloud, written parameters and semantic model tell the same road.

What parameters can say is exact within a millimetre; all else is named in the report, is in no file of the road, and
is in the cloud as it stands in the scene, with its class.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

# isort: split
import bmesh  # it comes with bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import modifier_input, set_modifier_input
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import RoadModel
from synthroads_addon.blender.model.roads import origin_of, world_matrix
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.scenes.cloud_truth import EXACT, Written, scan
from tests.helpers.scenes.panel_road import settings, small_pictures  # noqa: F401
from tests.helpers.scenes.scene_hash import lines
from tests.helpers.scenes.small_road import open_small, small_parameters
from tests.helpers.scenes.sparse_scanner import sparse_scanner

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("small_pictures")]


@dataclass
class Expected:
    """How the truth must differ after an edit.

    Attributes:
        changed: ids of the objects that differ from those that were built.
        gone, added: ids that are no longer there, and those that are new.
        by_hand: names of objects that were edited by hand.
        classes: classes of what has no number in the cloud.
        places: (x, y) on the map by the ids of things.
        fields: values by the ids of things and their fields.
        shift: (3,) that the whole road was moved by, m.
        turn_deg: that it was turned by about its root.
        axis: points (N, 3) on the map that the road's axis runs through.
        lost: the road as a whole isn't known.
    """

    changed: set[str] = field(default_factory=set)
    gone: set[str] = field(default_factory=set)
    added: set[str] = field(default_factory=set)
    by_hand: set[str] = field(default_factory=set)
    classes: set[str] = field(default_factory=set)
    places: dict[str, np.ndarray] = field(default_factory=dict)
    fields: dict[str, dict[str, float]] = field(default_factory=dict)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_deg: float = 0.0
    axis: np.ndarray | None = None
    lost: bool = False


def select(*items: bpy.types.Object) -> None:
    """Select some objects only; the first one is the active one."""
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    for item in items:
        item.hide_viewport = False
        item.hide_set(False)
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[0]


def on_map(model: RoadModel, item: bpy.types.Object, vertex: int = 0) -> np.ndarray:
    """Return where a vertex of an object is now, (3,) on the map."""
    return origin_of(model.root) + (world_matrix(item) @ [*item.data.vertices[vertex].co, 1.0])[:3]


def turn(item: bpy.types.Object, degrees: float) -> None:
    """Turn a thing about the vertical where it stands: its object's origin is elsewhere."""
    there = Vector((world_matrix(item) @ [*item.data.vertices[0].co, 1.0])[:3].tolist())
    about = Matrix.Translation(there) @ Matrix.Rotation(np.deg2rad(degrees), 4, "Z") @ Matrix.Translation(-there)
    item.matrix_world = about @ item.matrix_world


def edited_mesh(item: bpy.types.Object, change: Callable[[bmesh.types.BMesh], None]) -> None:
    """Change an object's mesh in edit mode."""
    select(item)
    bpy.ops.object.mode_set(mode="EDIT")
    change(bmesh.from_edit_mesh(item.data))
    bmesh.update_edit_mesh(item.data)
    bpy.ops.object.mode_set(mode="OBJECT")


def move_a_sign(model: RoadModel) -> Expected:
    sign = model.objects["sign"]
    select(sign)
    bpy.ops.transform.translate(value=(-3.0, 1.7, 0.4))
    return Expected({"sign"}, places={"sign": on_map(model, sign)})


def move_a_guardrail(model: RoadModel) -> Expected:
    rail, geometry = model.objects["rail-right"], RoadGeometry(small_parameters())
    middle, across, along = 27.5, 1.3, -2.0
    there, here = (geometry.alignment.place(np.array([s]), np.array([o]))[0] for s, o in ((25.5, -13.6), (27.5, -14.9)))
    select(rail)
    bpy.ops.transform.translate(value=(*(there - here), 0.0))
    start, end = middle + along - 17.5, middle + along + 17.5
    wanted = {"offset": -14.9 + across, "start_station": start, "end_station": end}
    return Expected({"rail-right"}, fields={"rail-right": wanted})


def move_a_car(model: RoadModel) -> Expected:
    geometry = RoadGeometry(small_parameters())
    there = geometry.alignment.place(np.array([32.0]), np.array([-5.0]))[0]
    car = model.objects["car"]
    car.location = (*(there - (on_map(model, car) - geometry.parameters.transform.translate)[:2]), 0.0)
    return Expected({"car"}, fields={"car": {"station": 32.0, "lane": 1}})


def move_the_road(model: RoadModel) -> Expected:
    model.root.location = (3.0, -5.0, 2.0)
    return Expected(shift=(3.0, -5.0, 2.0))


def move_the_backbone(model: RoadModel) -> Expected:
    """Its points are moved onto a known axis: a bend of 400 m instead of 1200 m, falling instead of rising."""
    data = small_parameters().to_dict()
    axis = next(item for item in data["objects"].values() if item["type"] == "Alignment")
    axis["horizontal"] = [{"kind": "arc", "length": 60.0, "curvature_start": 1 / 400, "curvature_end": 1 / 400}]
    axis["vertical"] = [{"station": 0.0, "elevation": 1.0}, {"station": 60.0, "elevation": 0.0}]
    wanted = RoadGeometry(RoadParameters.from_dict(data))
    backbone = model.objects["Backbone"]
    station = np.linspace(0.0, 60.0, len(backbone.data.vertices))
    points = np.column_stack([wanted.alignment.position(station), wanted.profile.elevation(station)])

    def put(mesh: bmesh.types.BMesh) -> None:
        for vertex, point in zip(mesh.verts, points, strict=True):
            vertex.co = point

    edited_mesh(backbone, put)
    stations = {"car": {"station": 20.0}, "rail-left": {"start_station": 5.0, "end_station": 30.0}}
    return Expected({"axis", *stations}, fields=stations, axis=points + origin_of(model.root))


def turn_a_sign(model: RoadModel) -> Expected:
    sign = model.objects["sign"]
    turn(sign, 25.0)
    return Expected({"sign"}, places={"sign": on_map(model, sign)}, fields={"sign": {"rotation_deg": 25.0}})


def turn_the_road(model: RoadModel) -> Expected:
    model.root.rotation_euler = (0.0, 0.0, np.deg2rad(20.0))
    return Expected({"axis"}, turn_deg=20.0)


def scale_a_sign(model: RoadModel) -> Expected:
    model.objects["sign"].scale = (1.0, 1.0, 1.3)
    return Expected(gone={"sign"}, by_hand={"sign"}, classes={"road_sign"})


def scale_the_road(model: RoadModel) -> Expected:
    model.root.scale = (1.0, 1.0, 2.0)
    return Expected(by_hand={model.root.name}, lost=True)


def delete_a_sign(model: RoadModel) -> Expected:
    select(model.objects["sign"])
    bpy.ops.object.delete()
    return Expected(gone={"sign"})


def delete_all_posts(model: RoadModel) -> Expected:
    bpy.data.objects.remove(model.objects["Delineators"])
    return Expected(gone={"post-1", "post-2"})


def delete_one_post(model: RoadModel) -> Expected:
    edited_mesh(model.objects["Delineators"], lambda mesh: bmesh.ops.delete(mesh, geom=list(mesh.verts)[:1]))
    return Expected(gone={"post-1"})


def duplicate_a_sign(model: RoadModel) -> Expected:
    select(model.objects["sign"])
    bpy.ops.object.duplicate()
    copy = bpy.context.view_layer.objects.active
    bpy.ops.transform.translate(value=(-15.0, -8.0, 0.0))
    return Expected(added={"sign-2"}, places={"sign-2": on_map(model, copy)})


def duplicate_a_guardrail_linked(model: RoadModel) -> Expected:
    """The copy shares its mesh; it stands on the other side of the verge."""
    select(model.objects["rail-left"])
    bpy.ops.object.duplicate(linked=True)
    copy = bpy.context.view_layer.objects.active
    before = small_parameters().objects["rail-left"]
    set_modifier_input(copy.modifiers[0], "Offset", 13.9)
    return Expected(added={"rail-left-2"}, fields={"rail-left-2": {"offset": 13.9, "end_station": before.end_station}})


def unlink_a_guardrail(model: RoadModel) -> Expected:
    rail = model.objects["rail-left"]
    for collection in rail.users_collection:
        collection.objects.unlink(rail)
    return Expected(gone={"rail-left"})


def rename_everything(model: RoadModel) -> Expected:
    model.root.name, model.collection.name = "Ramp", "Mine"
    for number, item in enumerate(model.objects.values()):
        item.name = f"Thing {number}"
    return Expected()


def move_a_posts_vertex(model: RoadModel) -> Expected:
    posts = model.objects["Delineators"]

    def put(mesh: bmesh.types.BMesh) -> None:
        next(iter(mesh.verts)).co += Vector((2.0, 0.4, 0.0))

    edited_mesh(posts, put)
    return Expected({"post-1"}, places={"post-1": on_map(model, posts, 0)})


def sculpt_a_guardrail(model: RoadModel) -> Expected:
    edited_mesh(model.objects["rail-left"], lambda mesh: bmesh.ops.create_cube(mesh, size=2.0) and None)
    return Expected(gone={"rail-left"}, by_hand={"rail-left"}, classes={"guardrail"})


def sculpt_the_road(model: RoadModel) -> Expected:
    edited_mesh(model.objects["Road"], lambda mesh: bmesh.ops.create_cube(mesh, size=2.0) and None)
    return Expected(by_hand={model.root.name}, lost=True)


def change_a_guardrails_input(model: RoadModel) -> Expected:
    modifier = model.objects["rail-left"].modifiers[0]
    set_modifier_input(modifier, "Offset", modifier_input(modifier, "Offset") - 0.6)
    return Expected({"rail-left"}, fields={"rail-left": {"offset": 14.3}})


def change_the_roads_input(model: RoadModel) -> Expected:
    set_modifier_input(model.objects["Road"].modifiers[0], "Right Hard Shoulder Width", 2.5)
    return Expected({"right"}, fields={"right": {"hard_shoulder_width": 2.5}})


def apply_a_modifier(model: RoadModel) -> Expected:
    rail = model.objects["rail-left"]
    select(rail)
    bpy.ops.object.modifier_apply(modifier=rail.modifiers[0].name)
    return Expected(gone={"rail-left"}, by_hand={"rail-left"}, classes={"guardrail"})


def join_a_guardrail_and_a_cube(model: RoadModel) -> Expected:
    there = origin_of(model.root)
    here = RoadGeometry(small_parameters()).point(30.0, 12.0)[0]
    bpy.ops.mesh.primitive_cube_add(location=here + small_parameters().transform.translate - there)
    cube = bpy.context.object
    select(model.objects["rail-left"], cube)
    bpy.ops.object.join()
    return Expected(gone={"rail-left"}, by_hand={"rail-left"}, classes={"guardrail"})


def join_posts_to_a_sign(model: RoadModel) -> Expected:
    """The posts become signs that no parameter knows."""
    select(model.objects["sign"], model.objects["Delineators"])
    bpy.ops.object.join()
    return Expected(gone={"sign", "post-1", "post-2"}, by_hand={"sign"}, classes={"road_sign"})


def parent_and_move(model: RoadModel) -> Expected:
    bpy.ops.object.empty_add(location=(7.0, -2.0, 1.0))
    empty, sign = bpy.context.object, model.objects["sign"]
    select(empty, sign)
    bpy.ops.object.parent_set(type="OBJECT")
    empty.location = (5.0, -1.5, 1.0)
    return Expected({"sign"}, places={"sign": on_map(model, sign)})


def parent_the_road_and_move(model: RoadModel) -> Expected:
    bpy.ops.object.empty_add(location=(0.0, 0.0, 0.0))
    empty = bpy.context.object
    select(empty, model.root)
    bpy.ops.object.parent_set(type="OBJECT")
    empty.location = (4.0, 6.0, -1.0)
    return Expected(shift=(4.0, 6.0, -1.0))


def scan_in_another_scene(model: RoadModel) -> Expected:
    """All of the road but a sign is linked to another scene, which is scanned."""
    other = bpy.data.scenes.new("Other")
    for item in (model.root, *model.objects.values()):
        if item.name != "sign":
            other.collection.objects.link(item)
    bpy.context.window.scene = other
    return Expected(gone={"sign"})


def link(model: RoadModel, folder: Path) -> None:
    """Save the road's collection as a library, and link it to an empty file."""
    bpy.data.libraries.write(str(folder / "library.blend"), {model.collection})
    empty_file()
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (source, wanted):
        wanted.collections = source.collections
    bpy.context.scene.collection.children.link(wanted.collections[0])


def link_a_road_with_a_moved_sign(model: RoadModel, folder: Path) -> Expected:
    expected = move_a_sign(model)
    link(model, folder)
    return expected


CASES: list[Callable[..., Expected]] = [
    *(move_a_sign, move_a_guardrail, move_a_car, move_the_road, move_the_backbone),
    *(turn_a_sign, turn_the_road),
    *(scale_a_sign, scale_the_road),
    *(delete_a_sign, delete_all_posts, delete_one_post),
    *(duplicate_a_sign, duplicate_a_guardrail_linked),
    unlink_a_guardrail,
    rename_everything,
    *(move_a_posts_vertex, sculpt_a_guardrail, sculpt_the_road),
    *(change_a_guardrails_input, change_the_roads_input),
    apply_a_modifier,
    *(join_a_guardrail_and_a_cube, join_posts_to_a_sign),
    *(parent_and_move, parent_the_road_and_move),
    scan_in_another_scene,
    link_a_road_with_a_moved_sign,
]


@pytest.mark.parametrize("edit", CASES, ids=lambda case: case.__name__)
def test_cloud_and_written_truth_agree_after_an_edit(edit: Callable[..., Expected], tmp_path: Path) -> None:
    model = open_small()
    takes_folder = edit.__code__.co_argcount == 2
    expected = edit(model, tmp_path) if takes_folder else edit(model)
    bpy.context.view_layer.update()
    shown = scene_mesh()
    written = Written.read(scan(tmp_path, "edited", sparse_scanner(tmp_path, 60.0)))
    assert written.by_hand() == expected.by_hand
    if expected.lost:
        assert written.parameters is None
        assert not written.twin
        assert all(written.lies_on(shown, number) for number in written.by_instance)
        return
    check_parameters(written.parameters, expected)
    check_twin(written, expected)
    foreign = written.foreign()
    assert all(written.lies_on(shown, number) for number in foreign)
    assert written.classes_of(foreign) == {class_id(name) for name in expected.classes}
    assert written.seen(THINGS & set(written.parameters.objects)) == THINGS & set(written.parameters.objects)


def test_a_linked_road_that_must_be_built_again_is_refused_and_stays(tmp_path: Path) -> None:
    """Its guardrail was moved where nothing followed the move: a scan would show another road than its truth."""
    model = open_small()
    move_a_guardrail(model)
    link(model, tmp_path)
    before = set(lines())
    for scanned in (True, False):
        with pytest.raises(RuntimeError, match=r"is linked from .*library\.blend"):
            scan(tmp_path, "edited", sparse_scanner(tmp_path, 60.0)) if scanned else bpy.ops.synthroads.build()
        assert [line for line in lines() if line not in before and not line.startswith("scenes[")] == []
    assert not (tmp_path / "edited").exists()


THINGS = {"rail-left", "rail-right", "sign", "post-1", "post-2", "car", "sign-2", "rail-left-2"}


def check_parameters(written: RoadParameters | None, expected: Expected) -> None:
    """Check the written parameter set."""
    assert written is not None
    before, now = small_parameters().objects, written.objects
    assert set(before) - set(now) == expected.gone
    assert set(now) - set(before) == expected.added
    assert {name for name in before if name in now and before[name] != now[name]} == expected.changed
    for name, fields in expected.fields.items():
        found = {field: getattr(now[name], field) for field in fields}
        assert found == pytest.approx(fields, abs=EXACT), name
    geometry, origin = RoadGeometry(written), np.array(written.transform.translate)
    for name, place in expected.places.items():
        item: Any = now[name]
        found = geometry.alignment.place(np.array([item.station]), np.array([item.offset]))[0] + origin[:2]
        assert np.linalg.norm(found - place[:2]) < EXACT, name
    start = RoadGeometry(small_parameters()).point(0.0, 0.0)[0][:2]
    assert np.allclose(origin - small_parameters().transform.translate, expected.shift, rtol=0.0, atol=EXACT)
    if expected.turn_deg:
        ahead = np.diff([g.alignment.heading(0.0) for g in (RoadGeometry(small_parameters()), geometry)])
        assert np.rad2deg(ahead) == pytest.approx(expected.turn_deg, abs=1e-4)
        assert np.linalg.norm(geometry.alignment.position(0.0)) == pytest.approx(np.linalg.norm(start), abs=EXACT)
    if expected.axis is not None:
        station, offset = geometry.alignment.project(expected.axis[:, :2] - origin[:2])
        assert np.abs(offset).max() < EXACT
        heights = geometry.profile.elevation(station) + origin[2]
        assert np.abs(heights - expected.axis[:, 2]).max() < EXACT


def check_twin(written: Written, expected: Expected) -> None:
    """Check that the semantic model has the same objects, where they are."""
    assert written.parameters is not None
    assert THINGS & set(written.twin) == THINGS & set(written.parameters.objects)
    for name, place in expected.places.items():
        assert np.linalg.norm(np.array(written.twin[name]["geometry"]["coordinates"])[:2] - place[:2]) < EXACT, name
