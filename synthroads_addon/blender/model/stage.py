"""Data made while a road is being built, so that nothing of it is left when the build is given up."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ..nodes.builder import KEY, remove_unused_groups
from ..things.model_builder import ROLE
from .roads import ROAD

STAGING = "synthroads_staging"
"""Custom property of the collection in which a road grows, until it is complete."""

_NOT_OURS = ("screens", "window_managers", "workspaces", "brushes", "palettes", "scenes")


class DataBlockLog:
    """Notes the data-blocks that are made while it looks, by Blender's number of them: those outlive an undo.

    Between two looks the user may make data-blocks too; those are not noted.
    """

    def __init__(self) -> None:
        self._numbers: set[int] = set()
        self._groups = {group.session_uid: group.name for group in bpy.data.node_groups if KEY in group}

    @contextmanager
    def record(self) -> Iterator[None]:
        """Note what is made inside."""
        before = {item.session_uid for item in _blocks()}
        try:
            yield
        finally:
            self._numbers |= {item.session_uid for item in _blocks()} - before

    def remove(self) -> None:
        """Remove all that was noted and is still there."""
        bpy.data.batch_remove([item for item in _blocks() if item.session_uid in self._numbers])
        for group in bpy.data.node_groups:
            # A new group takes the name of one of an older version.
            group.name = self._groups.get(group.session_uid, group.name)

    def keep(self, collection: bpy.types.Collection) -> None:
        """Forget what was noted: it is complete now."""
        self._numbers.clear()
        if STAGING in collection:
            del collection[STAGING]


def _blocks() -> Iterator[Any]:
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION" and prop.identifier not in _NOT_OURS:
            yield from getattr(bpy.data, prop.identifier)


def new_staging(scene: bpy.types.Scene) -> bpy.types.Collection:
    """Return a new collection in a scene for what is being built. It is shown, as Blender evaluates only what is."""
    collection = bpy.data.collections.new("SynthRoads (building)")
    collection[STAGING] = True
    scene.collection.children.link(collection)
    return collection


def remove_staged() -> None:
    """Remove what a build left that could not clean up: of a file saved, or an undo step made, in the midst of it."""
    for collection in [item for item in bpy.data.collections if STAGING in item]:
        remove_with_meshes([item for item in collection.objects if ROLE in item or ROAD in item])
        bpy.data.collections.remove(collection)
        remove_unused_groups()


def remove_with_meshes(objects: list[bpy.types.Object]) -> None:
    """Remove objects, and their meshes if no other object has them."""
    meshes = {item.data for item in objects if item.data is not None}
    bpy.data.batch_remove(objects)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
