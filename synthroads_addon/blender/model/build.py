"""Road parameters -> scene: Python writes the backbone and the node groups' inputs, the nodes do the rest."""

from __future__ import annotations

import time
from collections.abc import Collection, Generator
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.stepper import Stepper
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ..materials import vary
from ..nodes.builder import remove_unused_groups
from ..things.model_builder import ROLE, ModelBuilder
from ..things.registry import model_parts, required_parts
from .stage import DataBlockLog, in_scene, new_staging, remove_staged, remove_with_meshes

COLLECTION = "SynthRoads"
ORIGIN = "synthroads_origin"
"""Custom property of the collection: map coordinates of the local origin."""

_TURN = 0.03
"""Seconds that a build may take before it lets its caller go on."""
_EVALUATION, _MOST_AT_ONCE = 0.1, 32
"""Seconds that Blender's evaluation of new objects is to take, and how many are evaluated together at most."""


@dataclass(frozen=True)
class RoadModel:
    """A road in the scene.

    Attributes:
        collection: holds all of the model's objects.
        objects: by role: ``Backbone``, ``Road``, ``Ground``, ``Terrain``, ``Delineators``, and the parameter
            set's ids of guardrails and vegetation. Hidden helpers are among them.
        origin: (3,) map coordinates of the local origin.
    """

    collection: bpy.types.Collection
    objects: dict[str, bpy.types.Object]
    origin: NDArray[np.float64]


def build_road(
    parameters: RoadParameters,
    tolerance: float,
    vegetation_detail: float = 1.0,
    parts: Collection[str] | None = None,
    stretch: tuple[float, float] | None = None,
    geometry: RoadGeometry | None = None,
) -> RoadModel:
    """Build the road in the current scene; a road built before is replaced, other objects stay as they are.

    If it can't be built, the file is as it was before.

    Args:
        parameters: the road.
        tolerance: largest chord error of the road's surface, m.
        vegetation_detail: share of the vegetation's triangles, 0 to 1; 0 builds none.
        parts: which of `model_parts` are wanted; all if None. What they need from others is built hidden.
        stretch: stations between which it is built, with an origin of its own (see `road.stretches`), from
            and to the nearest rows of the whole road's surface; the whole road if None.
        geometry: of the parameters, if there is one already.

    Raises:
        ValueError: a part that there is none of.
        InputError: an asset of the set can't be read.
    """
    work = _Build(parameters, tolerance, vegetation_detail, parts, stretch, geometry)
    try:
        with work.log.record():
            work.build()
    except BaseException:
        work.log.remove()
        raise
    model = work.swap()
    bpy.context.view_layer.update()
    return model


def build_steps(
    parameters: RoadParameters,
    tolerance: float,
    vegetation_detail: float = 1.0,
    parts: Collection[str] | None = None,
    stretch: tuple[float, float] | None = None,
) -> Generator[float | None, None, RoadModel]:
    """Build the road as `build_road` does, in steps between which the window may live; return the model.

    The new road grows beside the one built before, and takes its place in the last step. Each object is evaluated in a
    step of its own, which Blender can't interrupt. Close the generator to give up: all that was made is removed, and
    the file is as it was. After an undo or when another file was opened, only closing is allowed.

    Yields:
        the share that is done, 0 to 1, or None while there is nothing to do in this thread.
    """
    work = _Build(parameters, tolerance, vegetation_detail, parts, stretch)
    stepper = Stepper(work.build, "SynthRoads build")
    try:
        more = True
        while more:
            with work.log.record():
                more = stepper.run_for(_TURN)
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
    """A road that is being built: in a collection of its own, until it takes the place of the one built before.

    Attributes:
        log: data-blocks that were made for it.
        share: of it that is done, 0 to 1.
    """

    def __init__(
        self,
        parameters: RoadParameters,
        tolerance: float,
        detail: float,
        parts: Collection[str] | None,
        stretch: tuple[float, float] | None,
        geometry: RoadGeometry | None = None,
    ) -> None:
        known = model_parts()
        self._wanted = set(known if parts is None else parts)
        if self._wanted - set(known):
            raise ValueError(f"parts: {sorted(self._wanted - set(known))} are not among {tuple(known)}")
        self._scene = bpy.context.scene.name
        remove_staged()
        self.log = DataBlockLog()
        self.share = 0.0
        with self.log.record():
            self._collection = new_staging(bpy.context.scene)
        self._builder = ModelBuilder(parameters, self._collection, tolerance, detail, stretch, geometry)

    def build(self) -> None:
        """Make the objects; see `base.stepper` for how this is done in steps."""
        self._builder.lay_out()
        there = required_parts(self._wanted)
        for number, (name, part) in enumerate(model_parts().items(), 1):
            if name in there:
                self._builder.hidden = name not in self._wanted
                part.build(self._builder)
            self.share = number / len(model_parts())

    def evaluate(self) -> None:
        """Have Blender work out what is new."""
        scene = bpy.data.scenes[self._scene]
        layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
        begin = time.perf_counter()
        layer.update()
        # Objects in plenty are small: together they are evaluated faster, as each time the whole scene is looked at.
        change = _EVALUATION / max(time.perf_counter() - begin, 1e-9)
        self._builder.at_once = int(np.clip(self._builder.at_once * np.clip(change, 0.25, 2.0), 1, _MOST_AT_ONCE))

    def swap(self) -> RoadModel:
        """Put the new road in the place of the one built before."""
        parameters, builder = self._builder.parameters, self._builder
        remove_road(keep=self._collection)
        collection = bpy.data.collections.get(COLLECTION)
        if collection is None:
            collection = self._collection
            collection.name = COLLECTION
        else:
            if not in_scene(collection, bpy.data.scenes[self._scene]):
                bpy.data.scenes[self._scene].collection.children.link(collection)
            for item in builder.objects.values():
                collection.objects.link(item)
            bpy.data.collections.remove(self._collection)
        for role, item in builder.objects.items():
            item.name = role  # its mesh keeps the name it has: to rename a mesh is to evaluate all that hangs on it
        self.log.keep(collection)
        origin = np.array(parameters.transform.translate) + builder.origin
        collection[ORIGIN] = [float(value) for value in origin]
        remove_unused_groups()
        vary(parameters.materials, parameters.environment)
        return RoadModel(collection, builder.objects, origin)


def scene_origin(scene: bpy.types.Scene) -> NDArray[np.float64] | None:
    """Return the map coordinates (3,) of the road's local origin in a scene; None without a road."""
    for collection in scene.collection.children_recursive:
        if ORIGIN in collection:
            return np.array(collection[ORIGIN], dtype=np.float64)
    return None


def remove_road(keep: bpy.types.Collection | None = None) -> None:
    """Remove the objects that `build_road` made, and its collection unless the user keeps something in it.

    Args:
        keep: the objects of this collection stay.
    """
    staying = set(keep.objects) if keep else set()
    objects = [item for item in bpy.data.objects if ROLE in item and item not in staying]
    remove_with_meshes(objects)
    collection = bpy.data.collections.get(COLLECTION)
    if collection is not None and not collection.all_objects:
        bpy.data.collections.remove(collection)
