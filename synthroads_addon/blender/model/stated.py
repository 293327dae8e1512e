"""Stating a road's axis and carriageways: the surface is built anew in place, and what hangs on it follows at once.

Only the backbone, the surface's inputs and its damage are made: the nodes of all that runs along the road, and of the
ground, read them. What stands at one place moves when the road is built as edited. Until then the statement is kept
with the root, and is part of the road's truth (`truth.read_road`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import bpy
import numpy as np

from ...base.errors import InputError
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.section import Carriageway
from ...road.tables.stated import StatedRoad
from ..compat import identified_input, set_modifier_input
from ..nodes.builder import remove_unused_groups
from ..things.model_builder import ROLE, BuildRequest, ModelBuilder, group_inputs
from ..things.registry import model_parts
from .axis_edits import edited_axis
from .build import road_collection
from .edits import keep_built, own_modifier
from .older_files import PARAMETERS
from .read_back import edited_carriageway
from .roads import NAME, OF_ROAD, ROAD, parts_and_copies, world_matrix
from .store import STATED, recall, recall_parameters
from .truth import read_as_stated

_SURFACE = "road"
"""Name of the model's part that is built anew."""


def stated_road(root: bpy.types.Object, scene: bpy.types.Scene) -> StatedRoad:
    """Return a road's axis and carriageways as its tables show them: as built, stated since, or edited by inputs.

    Raises:
        InputError: what is kept of the road is damaged.
    """
    stated = shown_base(root)[1]
    road = parts_and_copies(root, scene)[0].get("Road")
    modifier = own_modifier(road) if road is not None else None
    if modifier is None:
        return stated
    edited_carriageways: dict[str, Carriageway] = {}
    for name, carriageway in stated.carriageways.items():
        try:
            edited_carriageways[name] = edited_carriageway(carriageway, modifier)
        except KeyError:  # the model, of an older version, lacks an input
            edited_carriageways[name] = carriageway
    return StatedRoad(stated.alignment, edited_carriageways, stated.stations)


def shown_base(root: bpy.types.Object) -> tuple[RoadParameters, StatedRoad]:
    """Return a road's parameter set as built, and what its tables state, without edits of the model's inputs."""
    parameters = _built(str(root.get(PARAMETERS, "")))
    return parameters, _stated(str(root[STATED])) if STATED in root else StatedRoad.of(parameters)


@lru_cache(maxsize=4)
def _built(text: str) -> RoadParameters:
    """Return the parameter set of a JSON text, cached; `InputError` if it is damaged."""
    return recall_parameters({PARAMETERS: text})  # it reads this key only


@lru_cache(maxsize=4)
def _stated(text: str) -> StatedRoad:
    """Return the stated road of a JSON text, cached; `InputError` if it is damaged."""
    return StatedRoad.from_json(text)


def restate(root: bpy.types.Object, scene: bpy.types.Scene, change: Callable[[StatedRoad], StatedRoad]) -> StatedRoad:
    """Change what a road's tables state; the scene shows it at once. Return the new statement.

    Args:
        root: of the road.
        scene: that the road is in.
        change: function from the present statement to the new one.

    Raises:
        InputError: the change isn't allowed or no road can be built so; the backbone was moved by hand, or the surface
            was edited by hand. The scene is as it was.
    """
    now = stated_road(root, scene)
    parts = parts_and_copies(root, scene)[0]
    _refuse_moved_backbone(root, parts, now)
    new = change(now)
    if new == now:
        return now
    parameters = read_as_stated(root, scene, new)
    new_objects = _surface(root, scene, parameters)
    _take_over(root, parts, new_objects)
    root[STATED] = new.to_json()
    return new


def _refuse_moved_backbone(root: bpy.types.Object, parts: dict[str, bpy.types.Object], stated: StatedRoad) -> None:
    """Raise `InputError` if the backbone isn't where the tables have it: its edit would be lost."""
    backbone = parts.get("Backbone")
    if backbone is None or "Road" not in parts:
        raise InputError("Alignment", None, "the road's surface or backbone was deleted: undo that, or build it again")
    base = shown_base(root)[0]
    objects = {name: _stated_object(item, stated) for name, item in base.objects.items()}
    data = base.model_copy(update={"objects": objects})
    place = np.linalg.inv(world_matrix(root)) @ world_matrix(backbone)
    if edited_axis(RoadGeometry(data), backbone, place) is not None:
        raise InputError("Alignment", None, "the backbone was moved by hand: press Build as Edited first")


def _stated_object(item: object, stated: StatedRoad) -> object:
    """Return the stated alignment in the place of the built one; any other object as it is."""
    return stated.alignment if type(item) is type(stated.alignment) else item


def _surface(root: bpy.types.Object, scene: bpy.types.Scene, parameters: RoadParameters) -> dict[str, bpy.types.Object]:
    """Return new objects of the road's surface by role, unlinked from the scene's sight until they are taken over."""
    settings = recall(root)[1].settings()
    builder = ModelBuilder(
        BuildRequest(parameters, settings.tolerance, settings.vegetation_detail), road_collection(root, scene), root
    )
    try:
        builder.lay_out()
        model_parts()[_SURFACE].build(builder)
    except BaseException:
        _remove(builder.objects)
        raise
    return dict(builder.objects)


def _remove(objects: dict[str, bpy.types.Object]) -> None:
    """Remove objects and their meshes from the file."""
    for item in objects.values():
        mesh = item.data
        bpy.data.objects.remove(item)
        if mesh is not None and not mesh.users:
            bpy.data.meshes.remove(mesh)


def _take_over(
    root: bpy.types.Object, parts: dict[str, bpy.types.Object], new_objects: dict[str, bpy.types.Object]
) -> None:
    """Give the road's own objects the meshes, node groups and inputs of new ones; the objects stay, for all that refer.

    Args:
        root: of the road.
        parts: its objects by role.
        new_objects: the new ones by role.
    """
    kept_objects = {role: parts[role] for role in new_objects if role in parts}
    for role, new in new_objects.items():
        item = kept_objects.get(role)
        if item is None:  # a detail that the road hadn't
            new.name = role
            new[OF_ROAD], new[NAME] = str(root[ROAD]), new.name
            keep_built(new)
            continue
        old_mesh = item.data
        item.data = new.data
        old, modifier = own_modifier(item), own_modifier(new)
        if old is not None and modifier is not None:
            _copy_inputs(old, modifier, kept_objects)
        if old_mesh is not None and not old_mesh.users:
            bpy.data.meshes.remove(old_mesh)
        keep_built(item)
    for role in kept_objects:  # all inputs are copied: to remove an object empties the inputs that name it
        bpy.data.objects.remove(new_objects[role])
    remove_unused_groups()


def _copy_inputs(
    modifier: bpy.types.NodesModifier, new: bpy.types.NodesModifier, kept_objects: dict[str, bpy.types.Object]
) -> None:
    """Give a modifier the node group and inputs of a new one; only what differs is set.

    Args:
        modifier: of the road's own object.
        new: the new one.
        kept_objects: objects by role that stay in place of new ones.
    """
    if modifier.node_group != new.node_group:
        modifier.node_group = new.node_group
    for socket in group_inputs(new.node_group):
        if socket.socket_type == "NodeSocketGeometry":
            continue
        value = identified_input(new, socket.identifier)
        if isinstance(value, bpy.types.Object):
            value = kept_objects.get(str(value.get(ROLE, "")), value)
        if identified_input(modifier, socket.identifier) != value:
            set_modifier_input(modifier, socket.name, value)
