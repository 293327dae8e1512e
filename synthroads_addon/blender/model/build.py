"""A road's objects, built from its parameters: Python makes the backbone and sets inputs, node groups do the rest."""

from __future__ import annotations

import json
import time
from collections.abc import Generator, Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.turns.stepper import Stepper
from ...road.objects import LineObject, PointObject, RoadObject
from ...road.surroundings import Vehicle
from ..compat import modifier_input, object_inputs, set_modifier_input
from ..labels import CLASS_PROPERTY
from ..materials import remove_unused_materials, used_materials
from ..nodes.builder import remove_unused_groups
from ..nodes.kept_groups import keep_groups, may_keep_groups, restore_names
from ..things.deformation import deform_things
from ..things.model_builder import ROLE, BuildRequest, ModelBuilder
from ..things.registry import model_parts, required_parts
from .edits import POSTS, keep_built
from .places import PLACED
from .roads import (
    BUILT_PARTS,
    FRAME,
    NAME,
    OF_ROAD,
    ROAD,
    library_of,
    new_root,
    parts_and_copies,
    place_root,
    renew_ids,
    road_meant,
    road_of_id,
)
from .stage import DataBlockLog, new_staging, remove_staged, remove_with_meshes

COLLECTION = "SynthRoads"
"""Name of the collection that a new road is put into."""
MADE_COLLECTION = "synthroads_collection"
"""Custom property of a collection that was made for a road: it is removed with the last object in it."""

_TURN = 0.03
"""Seconds after which a build returns to its caller for a moment; chosen."""
_EVALUATION, _MOST_AT_ONCE = 0.1, 32
"""Seconds that one evaluation of new objects by Blender should take, and their largest number in it; chosen."""


@dataclass(frozen=True)
class BuildTarget:
    """Road that a new one replaces, and the parts of it that stay or are removed.

    Attributes:
        road: id of the road to replace; the scene's current road (`roads.road_meant`) if empty.
        beside: whether to replace no road, but to add one more.
        moves_aside: whether one more road is moved until it overlaps nothing; else it is where its parameters say.
        keep_moves: whether a user's move of the replaced road stays; else the road is put where its parameters say.
        keeps: names of old parts that stay beside the new ones.
        drops: names of copies of parts that are removed with the old parts.
    """

    road: str = ""
    beside: bool = False
    moves_aside: bool = True
    keep_moves: bool = True
    keeps: frozenset[str] = frozenset()
    drops: frozenset[str] = frozenset()

    def root(self, scene: bpy.types.Scene) -> bpy.types.Object | None:
        """Return the root object of the road to replace; None if there is none.

        Raises:
            InputError: the road is linked from another file, and so can't be changed in this one.
        """
        root = None if self.beside else road_of_id(scene, self.road)
        if root is not None and (file := library_of(root)):
            text = f"is linked from {file}, so it can't be built here: build it there, or make it local with its parts"
            raise InputError("Road", root.name, text)
        return root


MEANT = BuildTarget()


@dataclass(frozen=True)
class RoadModel:
    """A road built in the scene: root, collection and objects.

    Attributes:
        root: the empty that is the parent of all of the model's objects, see `roads`.
        collection: collection that contains them.
        objects: by role: ``Backbone``, ``Road``, ``Ground``, ``Terrain``, ``Delineators``, and the parameter
            set's ids of guardrails and vegetation. Hidden helpers are among them.
        origin: (3,) map coordinates of the root's place when it was built.
    """

    root: bpy.types.Object
    collection: bpy.types.Collection
    objects: dict[str, bpy.types.Object]
    origin: NDArray[np.float64]

    @property
    def road_id(self) -> str:
        """Return the road's id, as its root object keeps it."""
        return str(self.root[ROAD])


def build_road(request: BuildRequest, place: BuildTarget = MEANT) -> RoadModel:
    """Build the road's objects in the current scene, replacing the road of `place`; return the model.

    If it can't be built, the file is as it was before.

    Raises:
        ValueError: a requested part doesn't exist.
        InputError: an asset of the parameter set can't be read.
    """
    work = _Build(request, place)
    try:
        with work.log.record():
            work.build()
    except BaseException:
        work.log.remove()
        raise
    model = work.swap()
    bpy.context.view_layer.update()
    return model


def build_steps(request: BuildRequest, place: BuildTarget = MEANT) -> Generator[float | None, None, RoadModel]:
    """Generator that builds the road as `build_road` does, in short steps so that Blender's window stays responsive.

    The new road is built beside the old one, and replaces it in the last step. Each object is evaluated in a step of
    its own, which Blender can't interrupt. Close the generator to cancel: all that was made is removed, and the file is
    as it was. After an undo, or after another file was opened, the generator may only be closed.

    Yields:
        the share of the work that is done, 0 to 1, or None while another thread works.
    """
    work = _Build(request, place)
    stepper = Stepper(work.build, "SynthRoads build")
    try:
        is_unfinished = True
        while is_unfinished:
            with work.log.record():
                is_unfinished = stepper.run_for(_TURN)
                if not stepper.runs_aside:
                    work.evaluate()
            yield None if stepper.runs_aside else work.share
    except BaseException:
        stepper.close()
        work.log.remove()
        raise
    model = work.swap()
    work.evaluate()
    return model


class _Build:
    """A road under construction in a staging collection, until it replaces the one built before.

    Attributes:
        log: data-blocks that were made for the road.
        share: share of the work that is done, 0 to 1.
    """

    def __init__(self, request: BuildRequest, place: BuildTarget) -> None:
        all_parts = model_parts()
        self._part_names = set(all_parts if request.parts is None else request.parts)
        if self._part_names - set(all_parts):
            raise ValueError(f"parts: {sorted(self._part_names - set(all_parts))} are not among {tuple(all_parts)}")
        scene = bpy.context.scene
        self._scene, self._place = scene.name, place
        remove_staged()
        renew_ids()
        self.log = DataBlockLog()
        self.share = 0.0
        self._keeps_groups = may_keep_groups()
        root = place.root(scene)
        with self.log.record():
            self._collection = new_staging(scene)
            if root is None:
                root = new_root()
                self._collection.objects.link(root)
        self._road = str(root[ROAD])
        self._builder = ModelBuilder(request, self._collection, root)

    def build(self) -> None:
        """Make the requested parts' objects, and hidden ones that these need, updating `share`; within a `Stepper`."""
        self._builder.lay_out()
        built_names = required_parts(self._part_names)
        for number, (name, part) in enumerate(model_parts().items(), 1):
            if name in built_names:
                self._builder.hidden = name not in self._part_names
                part.build(self._builder)
            self.share = number / len(model_parts())
        deform_things(self._builder)

    def evaluate(self) -> None:
        """Make Blender evaluate the new objects; adapt their number before the next evaluation to the time it takes."""
        scene = bpy.data.scenes[self._scene]
        layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
        start_time = time.perf_counter()
        layer.update()
        # Many objects are small: evaluating several at once is faster, as Blender visits the whole scene each time.
        time_ratio = _EVALUATION / max(time.perf_counter() - start_time, 1e-9)
        self._builder.at_once = int(np.clip(self._builder.at_once * np.clip(time_ratio, 0.25, 2.0), 1, _MOST_AT_ONCE))

    def swap(self) -> RoadModel:
        """Replace the road built before by the new one, label its parts and place its root; return the model."""
        parameters, builder, scene = self._builder.parameters, self._builder, bpy.data.scenes[self._scene]
        materials_before = used_materials()
        root = next(item for item in scene.objects if item.get(ROAD) == self._road)
        if FRAME in root:  # the root of a complete road, which is replaced
            old_parts = _parts_of(root, self._place)
            _repoint(old_parts, builder.objects)
            remove_with_meshes(list(old_parts))
            collection = road_collection(root, scene)
        else:
            collection = bpy.data.collections.new(COLLECTION)
            collection[MADE_COLLECTION] = True
            scene.collection.children.link(collection)
            collection.objects.link(root)
        for item in builder.objects.values():
            collection.objects.link(item)
        bpy.data.collections.remove(self._collection)
        self.log.keep(collection)
        for role, item in builder.objects.items():
            item.name = (
                role  # the mesh keeps its name: after renaming a mesh Blender evaluates all objects that depend on it
            )
            item[OF_ROAD], item[NAME] = self._road, item.name
            keep_built(item)
            if isinstance(parameters.objects.get(role), LineObject | Vehicle):
                item[PLACED] = list(item.location)[:2]
            describe(item, role, parameters.objects)
        root[BUILT_PARTS] = json.dumps(list(builder.objects))
        origin = np.array(parameters.transform.translate) + builder.origin
        place_root(root, origin, scene, self._place.keep_moves)
        remove_unused_materials(materials_before)
        if self._keeps_groups:
            keep_groups()
        remove_unused_groups()
        restore_names()
        builder.materials.take_usual_names()
        return RoadModel(root, collection, builder.objects, origin)


_CLASSES = {"Road": "road", "Terrain": "ground", "Painted Areas": "road_marking", "Damaged Areas": "road"} | {
    role: kind.points_class for role, kind in POSTS.items()
}
"""Classes of the parts that aren't objects of the parameter set, by role."""


def describe(item: bpy.types.Object, role: str, objects: Mapping[str, RoadObject]) -> None:
    """Write a part's class to its object's properties; lock the transform of what lies along the whole road.

    The shape of such a part follows the road wherever its object is, so that a move would mislead.
    """
    thing = objects.get(role.partition("/")[0])
    kind = _CLASSES.get(role) or (thing.semantic_class if thing is not None else "")
    if kind:
        item[CLASS_PROPERTY] = kind
    if ("/" not in role and isinstance(thing, PointObject | LineObject | Vehicle)) or role in POSTS:
        return
    item.lock_location = item.lock_rotation = item.lock_scale = (True, True, True)


def road_collection(root: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Collection:
    """Return the scene's collection that holds a road's root object."""
    scene_collections = {scene.collection, *scene.collection.children_recursive}
    return next(collection for collection in root.users_collection if collection in scene_collections)


def _parts_of(root: bpy.types.Object, place: BuildTarget = MEANT) -> dict[bpy.types.Object, str]:
    """Return a road's built objects in all scenes with their roles, but for `place.keeps`, with copies to drop."""
    objects: dict[bpy.types.Object, str] = {}
    for scene in bpy.data.scenes:
        if scene.objects.get(root.name_full) == root:
            parts, copies = parts_and_copies(root, scene)
            objects |= {item: role for role, item in parts.items() if item.name not in place.keeps}
            objects |= {item: str(item[ROLE]) for item in copies if item.name in place.drops}
    return objects


def _repoint(old_parts: Mapping[bpy.types.Object, str], new_parts: Mapping[str, bpy.types.Object]) -> None:
    """Make other objects' modifiers that refer to a road's old parts refer to the new parts of the same role."""
    for item in bpy.data.objects:
        if item in old_parts or item.library is not None:
            continue
        for modifier in item.modifiers:
            if modifier.type == "NODES" and modifier.node_group is not None:
                for name in object_inputs(modifier):
                    target = modifier_input(modifier, name)
                    if target in old_parts and old_parts[target] in new_parts:
                        set_modifier_input(modifier, name, new_parts[old_parts[target]])


def remove_road(root: bpy.types.Object | None = None) -> None:
    """Delete a road's objects, its root, and their collection if it is empty then; the user's children stay in place.

    Args:
        root: root object of the road; that of the current scene's current road if None.
    """
    root = root or road_meant(bpy.context.scene)
    if root is None:
        return
    homes = [collection for collection in root.users_collection if MADE_COLLECTION in collection]
    remove_with_meshes(list(_parts_of(root)))
    for child in root.children:  # objects that the user made children of the road keep their places
        place = child.matrix_world.copy()
        child.parent = None
        child.matrix_world = place
    bpy.data.objects.remove(root)
    for collection in homes:
        if not collection.all_objects and not collection.children:
            bpy.data.collections.remove(collection)
