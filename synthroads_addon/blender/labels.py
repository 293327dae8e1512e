"""Labels of objects, ours or a user's: class, instance number, velocity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..base.class_mapping import ClassMapping, NameClasses
from ..base.classes import UNLABELLED, classes
from ..base.errors import InputError, nearest_name

CLASS_PROPERTY = "synthroads_class"
"""Custom property of any object: the name of its class."""
INSTANCE_PROPERTY = "synthroads_instance"
"""Custom property of any object: its instance number."""
VELOCITY_PROPERTY = "synthroads_velocity"
"""Custom property of any object: (vx, vy, vz), m/s, at which it and its children move in a scan."""


@dataclass(frozen=True)
class Label:
    """Class and instance of an object's faces where these have none of their own.

    Attributes:
        strong: class of the object that takes precedence over its materials' classes; -1 for none.
        weak: class of the object for faces whose materials have none.
        instance: instance number; -1 for none.
    """

    strong: int
    weak: int
    instance: int


class Labels:
    """Lookup of the class and instance labels of a scene's objects, by mapping, properties and collections.

    Args:
        scene: the scene.
        mapping: classes by name; none if None.
        ids: ``class_id`` by the names of classes that objects may have; that of the full table if None.

    Attributes:
        reserved: values of ``class_id`` that a face may not state as a number, since the mapping gives them to names.

    Raises:
        InputError: a custom property isn't what it must be; names the object.
    """

    def __init__(
        self, scene: bpy.types.Scene, mapping: ClassMapping | None, ids: Mapping[str, int] | None = None
    ) -> None:
        full = {row.name: row.id for row in classes()}
        self._ids = dict(full if ids is None else ids)
        self.reserved = frozenset(self._ids.values()) - frozenset(full.values())
        self.by_name = NameClasses(mapping, self._ids)
        self._by_collection = self._collection_classes(scene)

    def label_of(self, item: bpy.types.Object, owner: bpy.types.Object) -> Label:
        """Return the label of an original object that `owner` shows as an instance (itself if it is none)."""
        strong = self.by_name.find("objects", item.name, owner.name)
        strong = self._property(item, owner) if strong is None else strong
        weak = self._by_collection.get(item, self._by_collection.get(owner, UNLABELLED))
        return Label(-1 if strong is None else strong, weak, self._instance(item, owner))

    def _property(self, *candidates: bpy.types.Object) -> int | None:
        """Return the class id in the custom property of the first object that has it; None if none has."""
        for candidate in candidates:
            name = candidate.get(CLASS_PROPERTY)
            if name is None:
                continue
            if name not in self._ids:
                hint = nearest_name(str(name), self._ids)
                text = f"must be one of {', '.join(self._ids)}{hint}"
                raise InputError(f"{candidate.name}: {CLASS_PROPERTY}", name, text)
            return self._ids[name]
        return None

    def _instance(self, *candidates: bpy.types.Object) -> int:
        """Return the instance number in the custom property of the first object that has it; -1 if none has."""
        for candidate in candidates:
            number = candidate.get(INSTANCE_PROPERTY)
            if number is None:
                continue
            if not isinstance(number, int) or not -(2**31) <= number < 2**32:
                raise InputError(
                    f"{candidate.name}: {INSTANCE_PROPERTY}",
                    number,
                    "must be a whole number of 32 bits, with or without a sign",
                )
            return number % 2**32  # Blender's whole numbers have a sign
        return -1

    def _collection_classes(self, scene: bpy.types.Scene) -> dict[bpy.types.Object, int]:
        """Return the class id of each object by its collections' names; the innermost collection counts."""
        mapped_classes: dict[bpy.types.Object, int] = {}
        own_name_classes: dict[bpy.types.Object, int] = {}
        for collection in _shown_collections(scene):
            number, target = self.by_name.find("collections", collection.name), mapped_classes
            if number is None:  # a collection may have the name of a class itself
                number, target = self._ids.get(collection.name), own_name_classes
            if number is not None:
                target |= dict.fromkeys(collection.all_objects, number)
        return own_name_classes | mapped_classes


def velocity_of(item: bpy.types.Object | None) -> tuple[bpy.types.Object, NDArray[np.float64]] | None:
    """Return (object, velocity (3,), m/s) of the object itself or its nearest parent with one; None if all are still.

    Raises:
        InputError: a velocity isn't three finite numbers; names the object.
    """
    while item is not None:
        value = item.get(VELOCITY_PROPERTY)
        if value is not None:
            try:
                velocity = np.array(value, dtype=np.float64)
            except (TypeError, ValueError):
                velocity = np.empty(0)
            if velocity.shape != (3,) or not np.isfinite(velocity).all():
                shown_value = value.to_list() if hasattr(value, "to_list") else value
                raise InputError(
                    f"{item.name}: {VELOCITY_PROPERTY}", shown_value, "must be three finite numbers (x, y, z), m/s"
                )
            return item, velocity
        item = item.parent
    return None


def _shown_collections(scene: bpy.types.Scene) -> Iterator[bpy.types.Collection]:
    """Yield the scene's collections and those shown as instances by its objects, outer ones first, each once."""
    scene_collections = list(scene.collection.children_recursive)
    yielded = set(scene_collections)
    yield from scene_collections
    # Level by level: collections that objects show as instances, then those shown by the objects in them.
    objects = set(scene.objects)
    while objects:
        sources = {item.instance_collection for item in objects if item.instance_type == "COLLECTION"} - {None}
        instance_collections = [
            part for source in sources for part in (source, *source.children_recursive) if part not in yielded
        ]
        # Outer collections first, then by name: the order of a set would differ from run to run.
        instance_collections = sorted(
            dict.fromkeys(instance_collections), key=lambda part: (part not in sources, part.name)
        )
        yielded.update(instance_collections)
        yield from instance_collections
        objects = {item for part in instance_collections for item in part.objects}
