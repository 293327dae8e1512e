"""Data made while a road is being built, so that nothing of it is left when the build is given up."""

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
"""Custom property of the collection in which a road grows, until it is complete."""

_NOT_OURS = ("screens", "window_managers", "workspaces", "brushes", "palettes", "scenes")


class DataBlockLog:
    """Log of the data-blocks made while it records, by Blender's session numbers, which outlive an undo.

    Between two looks the user may make data-blocks too; those are not noted.
    """

    def __init__(self) -> None:
        self._numbers: set[int] = set()
        self._groups = {group.session_uid: group.name for group in bpy.data.node_groups if KEY in group}

    @contextmanager
    def record(self) -> Iterator[None]:
        """Context that logs the data-blocks made inside."""
        before = {item.session_uid for item in _blocks()}
        try:
            yield
        finally:
            self._numbers |= {item.session_uid for item in _blocks()} - before

    def remove(self) -> None:
        """Remove all logged data-blocks that still exist, and give node groups their former names back."""
        bpy.data.batch_remove([item for item in _blocks() if item.session_uid in self._numbers])
        for group in bpy.data.node_groups:
            # A new group takes the name of one of an older version.
            group.name = self._groups.get(group.session_uid, group.name)

    def keep(self, collection: bpy.types.Collection) -> None:
        """Clear the log and the collection's staging mark: the build is complete."""
        self._numbers.clear()
        if STAGING in collection:
            del collection[STAGING]


def _blocks() -> Iterator[Any]:
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
    """Remove staging collections with their parts, which builds left in files saved or undo steps made meanwhile."""
    for collection in [item for item in bpy.data.collections if STAGING in item]:
        remove_with_meshes([item for item in collection.objects if ROLE in item or ROAD in item])
        bpy.data.collections.remove(collection)
        remove_unused_groups()


def remove_with_meshes(objects: list[bpy.types.Object]) -> None:
    """Remove objects, and their meshes that no other object uses."""
    meshes = {item.data for item in objects if item.data is not None}
    bpy.data.batch_remove(objects)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
