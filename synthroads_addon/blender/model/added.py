"""Things put onto a built road one by one, and things made anew in place: each object keeps what it is a thing of.

A thing that was added, or one of whose fields no input shows, has its parameters as JSON at its object. They are part
of the road's truth, see `truth`, until the road is built again: then they are in its parameter set.
"""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...base.errors import InputError
from ...base.schema import Model
from ...road.geometry import RoadGeometry
from ...road.objects import LineObject, PointObject, RoadObject
from ...road.parameters import RoadParameters
from ...road.things.gantry import Gantry
from ...road.things.overpass import Overpass
from ...road.things.registry import THINGS
from ...road.things.sign import TrafficSign
from ...road.things.thing import Thing
from ..compat import modifier_input, set_modifier_input
from ..things.meshes import ObjectFrame, foot_frame, line_frame
from ..things.model_builder import AHEAD, ROLE, BuildRequest, ModelBuilder, group_inputs, named_fields
from ..things.registry import thing_parts
from .build import describe, road_collection
from .edits import POSTS, keep_built, own_modifier, place_reason
from .older_files import PARAMETERS
from .places import IN_A_FRAME, PLACED, Lost, RoadAxes, part_update
from .read_back import edited_object
from .roads import NAME, OF_ROAD, ROAD, parts_and_copies, world_matrix
from .store import recall, recall_parameters, refuse_stated_axis

_PLACE = frozenset({"station", "offset", "rotation_deg"})
"""Fields that say where a thing stands and how it is turned."""
THING = "synthroads_thing"
"""Custom property of a part: parameters of what it is, as JSON, where the road's parameter set doesn't say them."""


def kept_thing(item: bpy.types.Object) -> RoadObject | None:
    """Return the thing whose parameters an object keeps; None if it keeps none.

    Raises:
        InputError: they are damaged.
    """
    return _parsed(str(item[THING])) if THING in item else None


@lru_cache(maxsize=256)
def _parsed(text: str) -> RoadObject:
    """Return the thing of a JSON text, cached; raise `InputError` if it is damaged."""
    try:
        data = json.loads(text)
        model: type[Model] = THINGS[data["type"]]
    except (KeyError, TypeError, ValueError):
        raise InputError("Thing", None, "its parameters in the file are damaged: delete it and add it again") from None
    thing = model.from_dict(data, "Thing")
    assert isinstance(thing, RoadObject)
    return thing


def with_kept_things(parameters: RoadParameters, items: dict[str, bpy.types.Object]) -> RoadParameters:
    """Return a road's parameter set with what its objects keep of themselves; damaged ones are left out.

    Args:
        parameters: of the road as it was built.
        items: its parts by role.
    """
    kept: dict[str, RoadObject] = {}
    for role, item in items.items():
        try:
            thing = kept_thing(item)
        except InputError:
            continue
        if thing is not None:
            kept[role] = thing
    return parameters.model_copy(update={"objects": parameters.objects | kept}) if kept else parameters


@lru_cache(maxsize=4)
def stored_axes(text: str) -> RoadAxes | None:
    """Return a road's geometry from its stored parameter set (JSON text), cached; None if that is damaged."""
    try:
        geometry = RoadGeometry(recall_parameters({PARAMETERS: text}))  # it reads this key only
    except InputError:
        return None
    return RoadAxes(geometry, geometry)


def present_thing(root: bpy.types.Object, item: bpy.types.Object) -> RoadObject | None:
    """Return what a part is now, with the edits of its place and inputs; None if no parameters describe it.

    It is read without the rest of the road, as the panel asks for it at each drawing.
    """
    axes, role = stored_axes(str(root.get(PARAMETERS, ""))), str(item.get(ROLE, ""))
    if axes is None:
        return None
    try:
        thing = kept_thing(item) or axes.before.parameters.objects.get(role)
        if not isinstance(thing, Thing) or role in POSTS:
            return None
        modifier = own_modifier(item)
        edited = thing if modifier is None else edited_object(thing, modifier)
        place = np.linalg.inv(world_matrix(root)) @ world_matrix(item)
        if place_reason(place, item.type == "EMPTY", mirrorable=True):
            return None
        update, _ = part_update(edited, thing, item, place, axes)
        return edited.model_copy(update=update)
    except (InputError, Lost, ValueError):
        return None


def add_thing(root: bpy.types.Object, scene: bpy.types.Scene, thing: Thing, name: str) -> bpy.types.Object:
    """Build one more thing of a road and return its object; its parameters are kept at it.

    Args:
        root: of the road.
        scene: that the road is in.
        thing: what is built, with its instance number.
        name: id of the thing, which no part has.

    Raises:
        InputError: the road's parameters are damaged, its axis was stated anew since it was built, or an asset can't be
            read.
    """
    made = _build(root, scene, thing, name)
    for role, item in made.items():
        item.name = role
        item[OF_ROAD], item[NAME], item[ROLE] = str(root[ROAD]), item.name, role
        keep_built(item)
        if isinstance(thing, LineObject):
            item[PLACED] = list(item.location)[:2]
        describe(item, role, {name: thing})
    made[name][THING] = thing.to_json()
    return made[name]


def _build(root: bpy.types.Object, scene: bpy.types.Scene, thing: Thing, name: str) -> dict[str, bpy.types.Object]:
    """Return the new objects of a thing by role, the thing's own first, in the road's collection."""
    axes = stored_axes(str(root.get(PARAMETERS, "")))
    if axes is None:
        raise InputError("Road", root.name, "its parameter set in the file is damaged; build it again")
    refuse_stated_axis(root)
    settings = recall(root)[1].settings()
    base = axes.before.parameters
    ground = {key: item for key, item in base.objects.items() if not isinstance(item, Thing)}
    parameters = base.model_copy(update={"objects": ground | {name: thing}})
    request = BuildRequest(parameters, settings.tolerance, settings.vegetation_detail, geometry=axes.before)
    builder = ModelBuilder(request, road_collection(root, scene), root)
    there = parts_and_copies(root, scene)[0]
    builder.objects |= {role: item for role, item in there.items() if role not in POSTS}
    before = dict(builder.objects)
    for part in thing_parts():
        part.build(builder)
    made = {role: item for role, item in builder.objects.items() if before.get(role) != item}
    made = {name if role in POSTS else role: item for role, item in made.items()}
    if name not in made:
        raise InputError("Plants Built", settings.vegetation_detail, "must be above 0: no plants are built otherwise")
    return made


def renew_thing(root: bpy.types.Object, scene: bpy.types.Scene, item: bpy.types.Object, thing: Thing) -> None:
    """Make a part's object show other parameters: its mesh and its modifier's inputs are made anew, the object stays.

    Raises:
        InputError: as `add_thing`.
    """
    role = str(item[ROLE])
    made = _build(root, scene, thing, role)
    new = made.pop(role)
    old_data, old_modifier, new_modifier = item.data, own_modifier(item), own_modifier(new)
    if new.data is not None and item.type == new.type:
        item.data = new.data
    if new.instance_type == "COLLECTION":
        item.instance_collection = new.instance_collection
    if old_modifier is not None and new_modifier is not None:
        old_modifier.node_group = new_modifier.node_group
        for socket in group_inputs(new_modifier.node_group):
            if socket.socket_type != "NodeSocketGeometry":
                set_modifier_input(old_modifier, socket.name, modifier_input(new_modifier, socket.name))
    item[AHEAD] = True
    item.matrix_basis = _basis(item, root, np.array(new.matrix_basis, dtype=np.float64))
    bpy.data.objects.remove(new)
    if old_data is not None and not old_data.users:
        bpy.data.meshes.remove(old_data)
    _replace_faces(root, scene, item, role, made)
    keep_built(item)
    if isinstance(thing, LineObject):
        item[PLACED] = list((np.linalg.inv(world_matrix(root)) @ world_matrix(item))[:2, 3])
    item[THING] = thing.to_json()


def _replace_faces(
    root: bpy.types.Object,
    scene: bpy.types.Scene,
    item: bpy.types.Object,
    role: str,
    made: dict[str, bpy.types.Object],
) -> None:
    """Put the new faces of a gantry's signs in the place of the old ones, on the gantry's object that stays."""
    for old_role, old in parts_and_copies(root, scene)[0].items():
        if old_role.startswith(f"{role}/") and old not in made.values():
            bpy.data.objects.remove(old)
    for face_role, face in made.items():
        face.name = face_role
        face[OF_ROAD], face[NAME] = str(root[ROAD]), face.name
        modifier = own_modifier(face)
        if modifier is not None:
            set_modifier_input(modifier, "Gantry", item)
        keep_built(face)
        describe(face, face_role, {})


def set_place(root: bpy.types.Object, item: bpy.types.Object, before: Thing, now: Thing) -> None:
    """Move a part's object in the scene from where it stands as one thing to where it would stand as another.

    Only stations, offsets and the rotation count, on the road's axis as it was built.
    """
    axes = stored_axes(str(root.get(PARAMETERS, "")))
    assert axes is not None
    place = np.linalg.inv(world_matrix(root)) @ world_matrix(item)
    was, being = (frame_on_road(axes.before, thing).matrix() for thing in (before, now))
    item.matrix_basis = _basis(item, root, being @ np.linalg.inv(was) @ place)
    if isinstance(now, LineObject):
        item[PLACED] = being[:2, 3].tolist()


def stand_at_beginning(root: bpy.types.Object, item: bpy.types.Object, axes: RoadAxes, thing: LineObject) -> None:
    """Put a line-like thing's object where the thing begins on its road, with x along the road.

    In files of earlier versions, where its frame was the road's own, it stays where it is.
    """
    place = np.linalg.inv(world_matrix(root)) @ world_matrix(item)
    if AHEAD in item:
        place = frame_on_road(axes.now, thing).matrix()
        item.matrix_basis = _basis(item, root, place)
    item[PLACED] = place[:2, 3].tolist()


def frame_on_road(geometry: RoadGeometry, thing: RoadObject) -> ObjectFrame:
    """Return the frame of a thing's object on a whole road, see `ModelBuilder.frame`."""
    if isinstance(thing, LineObject):
        return line_frame(geometry, thing, (0.0, geometry.length))
    assert isinstance(thing, PointObject)
    return foot_frame(geometry, thing)


def _basis(item: bpy.types.Object, root: bpy.types.Object, place: np.ndarray) -> Matrix:
    """Return the own transform (4, 4) that puts an object at a place in its road's frame, whatever it hangs on."""
    above = np.eye(4)
    if item.parent is not None:
        above = world_matrix(item.parent) @ np.array(item.matrix_parent_inverse, dtype=np.float64)
    return Matrix((np.linalg.inv(above) @ world_matrix(root) @ place).tolist())


def input_of(thing: RoadObject, item: bpy.types.Object, field: str) -> str:
    """Return the name of a part's modifier input that holds a field of its thing; empty if none does."""
    modifier = own_modifier(item)
    if modifier is None or field == "instance":
        return ""
    fields = named_fields(thing, modifier.node_group)
    return next((name for name, known in fields.items() if known == field), "")


def change_thing(
    root: bpy.types.Object, scene: bpy.types.Scene, item: bpy.types.Object, values: dict[str, Any]
) -> Thing:
    """Give fields of the thing that a part shows other values; the scene follows at once. Return the thing.

    Raises:
        InputError: a value isn't allowed, or no parameters describe the part; the scene is as it was.
    """
    refuse_stated_axis(root)
    before = present_thing(root, item)
    if not isinstance(before, Thing):
        raise InputError(item.name, None, "it was edited by hand, so that it has no fields: undo that edit first")
    thing = type(before).from_dict(before.to_dict() | values, item.name)
    if thing.instance != before.instance:
        _check_number(root, scene, thing.instance)
    modifier = own_modifier(item)
    is_skew = isinstance(before, Overpass) and "rotation_deg" in values  # which is in its shape, not in its frame
    if isinstance(before, PointObject) and set(values) <= _PLACE and not is_skew:
        set_place(root, item, before, thing)
        moved = present_thing(root, item)
        if isinstance(moved, Gantry):  # whose faces are objects of their own
            renew_thing(root, scene, item, moved)
        return thing
    inputs = {field: input_of(before, item, field) for field in values}
    if modifier is None or not all(inputs.values()) or isinstance(before, IN_A_FRAME + (TrafficSign,)):
        renew_thing(root, scene, item, thing)
        return thing
    for field, name in inputs.items():
        set_modifier_input(modifier, name, values[field])
    if isinstance(thing, LineObject):
        axes = stored_axes(str(root[PARAMETERS]))
        assert axes is not None
        stand_at_beginning(root, item, axes, thing)
    return thing


def _check_number(root: bpy.types.Object, scene: bpy.types.Scene, number: int) -> None:
    """Raise `InputError` if a thing of the road has an instance number already."""
    known = with_kept_things(recall_parameters(root), parts_and_copies(root, scene)[0])
    owner = next((name for name, item in known.objects.items() if item.instance == number), None)
    if owner is not None:
        raise InputError("Instance Number", number, f"is that of {owner}: choose one that no other object has")
