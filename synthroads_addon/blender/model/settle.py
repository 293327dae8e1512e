"""Updates of a scene to show its edited road: line-like things and gantries' signs follow, or all is built again."""

from __future__ import annotations

import json
from collections.abc import Generator

import bpy
import numpy as np

from ...base.errors import InputError
from ...road.objects import LineObject, RoadObject
from ...road.things.gantry import Gantry
from ..compat import set_modifier_input
from ..nodes.inputs import input_name
from ..things.model_builder import ROLE, BuildRequest
from .added import kept_thing, present_thing, renew_thing, stand_at_beginning, stored_axes
from .build import BuildTarget, RoadModel, build_steps
from .edits import is_mirrored, own_modifier, place_reason
from .older_files import PARAMETERS
from .places import Lost, RoadAxes, line_update
from .read_back import edited_object
from .roads import NAME, OF_ROAD, parts_and_copies, road_of_id, root_of, world_matrix
from .store import BUILT_FROM, EPOCHS, FOUND, recall, remember
from .truth import BY_HAND, EditedRoad


def settle_steps(road: str, edited: EditedRoad) -> Generator[float | None, None, RoadModel]:
    """Generator that rebuilds an edited road in its place, in steps as `build_steps`; it returns the model.

    Copies become parts of the road. Parts that were edited by hand stay as they are, as objects of the user's that are
    children of the road's root.

    Args:
        road: the road's id.
        edited: the road as read back from the scene.

    Raises:
        InputError: the road's surface was edited by hand, or the road can't be built; the scene is as it was.
    """
    parameters, scene = edited.known(), bpy.context.scene
    root = road_of_id(scene, road)
    assert root is not None
    _, scenario = recall(root)
    built_from, reconstruction, settings = str(root.get(BUILT_FROM, "")), str(root.get(FOUND, "")), scenario.settings()
    epochs = root.get(EPOCHS)
    parts, copies = parts_and_copies(root, scene)
    names = {item.name for item in (*parts.values(), *copies)}
    hand_edits = {edit.name: edit for edit in edited.by_hand if edit.name in names}
    copy_names = frozenset(item.name for item in copies) - set(hand_edits)
    place = BuildTarget(road, keep_moves=False, keeps=frozenset(hand_edits), drops=copy_names)
    model = yield from build_steps(BuildRequest(parameters, settings.tolerance, settings.vegetation_detail), place)
    for name, edit in hand_edits.items():
        _hand_over(bpy.data.objects[name], edit.part, edit.reason)
    remember(model.root, parameters, scenario, built_from, reconstruction)
    if epochs is not None:
        model.root[EPOCHS] = epochs
    return model


def settle(road: str, edited: EditedRoad) -> RoadModel:
    """Rebuild an edited road in its place, without pauses, copies becoming parts; return the model."""
    steps = settle_steps(road, edited)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            model: RoadModel = end.value
            bpy.context.view_layer.update()
            return model


def _hand_over(item: bpy.types.Object, part: str, reason: str) -> None:
    """Turn a part that was edited by hand into a user's object, in place: no role, instance 0, class kept."""
    modifier = own_modifier(item)
    if modifier is not None and modifier.node_group.interface.items_tree.get("Instance") is not None:
        set_modifier_input(modifier, "Instance", 0)
    item[BY_HAND] = json.dumps([part, reason])
    for key in (ROLE, OF_ROAD, NAME):
        if key in item:
            del item[key]


def move_line(item: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Write an object's move to the station and offset inputs of its line-like thing; return whether it moved.

    Such a thing's shape follows the road wherever its object is, so that the move alone changes nothing that is seen.
    Only this object changes: an undo of its move undoes this too.
    """
    root, modifier = root_of(item, scene), own_modifier(item)
    if ROLE not in item or root is None or modifier is None or item.library is not None or PARAMETERS not in root:
        return False
    axes = stored_axes(str(root[PARAMETERS]))
    thing = _thing_of(item, axes) if axes else None
    place = np.linalg.inv(world_matrix(root)) @ world_matrix(item)
    if axes is None or not isinstance(thing, LineObject) or place_reason(place, mirrorable=True):
        return False
    try:
        update = line_update(axes, edited_object(thing, modifier), item, place)  # type: ignore[arg-type]
    except Lost:
        return False
    if not update and not is_mirrored(place):
        return False
    for field, value in update.items():
        if field == "faces":
            for side in ("left", "right"):
                set_modifier_input(modifier, f"{side.title()} Beam", value in (side, "both"))
        else:
            set_modifier_input(modifier, input_name(field), value)
    stand_at_beginning(root, item, axes, edited_object(thing, modifier))  # type: ignore[arg-type]
    return True


def renew_moved_gantry(item: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Put a moved or turned gantry's signs where it is now, and its posts onto the ground; return whether it moved.

    The signs' faces are objects of their own, which would stay until the road is built again.
    """
    root = root_of(item, scene)
    axes = stored_axes(str(root[PARAMETERS])) if root is not None and PARAMETERS in root and ROLE in item else None
    if root is None or axes is None or item.library is not None:
        return False
    before, now = _thing_of(item, axes), present_thing(root, item)
    if not isinstance(before, Gantry) or not isinstance(now, Gantry) or now == before:
        return False
    try:
        renew_thing(root, scene, item, now)
    except InputError:  # the axis was stated anew: Build as Edited puts all in its place
        return False
    return True


def _thing_of(item: bpy.types.Object, axes: RoadAxes) -> RoadObject | None:
    """Return what a part was built as: what it keeps itself, or what the road's parameter set says; None if nothing."""
    try:
        return kept_thing(item) or axes.before.parameters.objects.get(str(item[ROLE]))
    except InputError:
        return None
