"""Log of the data made while a road is built, so that all of it can be removed when the build is cancelled."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ..nodes.builder import remove_unused_groups
from ..nodes.kept_groups import KEY
from ..things.model_builder import ROLE
from .roads import ROAD

STAGING = "synthroads_staging"
"""Custom property of the collection in which a road is built, until it is complete."""

_NOT_OURS = ("screens", "window_managers", "workspaces", "brushes", "palettes", "scenes")


class DataBlockLog:
    """Log of the data-blocks made while it records, by Blender's session numbers, which outlive an undo.

    Data-blocks that the user makes between two recordings aren't logged.
    """

    def __init__(self) -> None:
        self._numbers: set[int] = set()
        self._groups = {group.session_uid: group.name for group in bpy.data.node_groups if KEY in group}

    @contextmanager
    def record(self) -> Iterator[None]:
        """Context that logs the data-blocks made inside."""
        earlier_numbers = {item.session_uid for item in _blocks()}
        try:
            yield
        finally:
            self._numbers |= {item.session_uid for item in _blocks()} - earlier_numbers

    def remove(self) -> None:
        """Remove all logged data-blocks that still exist, and give node groups their former names back."""
        bpy.data.batch_remove([item for item in _blocks() if item.session_uid in self._numbers])
        for group in bpy.data.node_groups:
            # A new group takes the name of the group of an older version, which was renamed.
            group.name = self._groups.get(group.session_uid, group.name)

    def keep(self, collection: bpy.types.Collection) -> None:
        """Clear the log and the collection's staging mark: the build is complete."""
        self._numbers.clear()
        if STAGING in collection:
            del collection[STAGING]


def _blocks() -> Iterator[Any]:
    """Yield all data-blocks of the open file, without kinds that a build doesn't make."""
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION" and prop.identifier not in _NOT_OURS:
            yield from getattr(bpy.data, prop.identifier)


def new_staging(scene: bpy.types.Scene) -> bpy.types.Collection:
    """Make a marked collection in a scene for a road under construction, visible so that Blender evaluates it."""
    collection = bpy.data.collections.new("SynthRoads (building)")
    collection[STAGING] = True
    scene.collection.children.link(collection)
    return collection


def remove_staged() -> None:
    """Remove staging collections with their parts, left over in files or undo steps that were saved during a build."""
    for collection in [item for item in bpy.data.collections if STAGING in item]:
        remove_with_meshes([item for item in collection.objects if ROLE in item or ROAD in item])
        bpy.data.collections.remove(collection)
        remove_unused_groups()


def remove_with_meshes(objects: list[bpy.types.Object]) -> None:
    """Remove objects, and their meshes that no other object uses."""
    meshes = {item.data for item in objects if item.data is not None}
    bpy.data.batch_remove(objects)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
