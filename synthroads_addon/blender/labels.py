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
        strong: class that the object has, stronger than its materials'; -1 for none.
        weak: class that it has where its materials have none.
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
        reserved: values of ``class_id`` that no face may have by a number of its own: they are classes' by name.

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
        for candidate in candidates:
            name = candidate.get(CLASS_PROPERTY)
            if name is None:
                continue
            if name not in self._ids:
                hint = nearest_name(str(name), self._ids)
                known = f"must be one of {', '.join(self._ids)}{hint}"
                raise InputError(f"{candidate.name}: {CLASS_PROPERTY}", name, known)
            return self._ids[name]
        return None

    def _instance(self, *candidates: bpy.types.Object) -> int:
        for candidate in candidates:
            number = candidate.get(INSTANCE_PROPERTY)
            if number is None:
                continue
            if not isinstance(number, int) or not -(2**31) <= number < 2**32:
                raise InputError(f"{candidate.name}: {INSTANCE_PROPERTY}", number, "must be a whole number of 32 bits")
            return number % 2**32  # Blender's whole numbers have a sign
        return -1

    def _collection_classes(self, scene: bpy.types.Scene) -> dict[bpy.types.Object, int]:
        """Return the class id of each object by its collections' names; the innermost collection counts."""
        mapped: dict[bpy.types.Object, int] = {}
        named: dict[bpy.types.Object, int] = {}
        for collection in _shown_collections(scene):
            number = self.by_name.find("collections", collection.name)
            into, number = (named, self._ids.get(collection.name)) if number is None else (mapped, number)
            if number is not None:
                into |= dict.fromkeys(collection.all_objects, number)
        return named | mapped


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
                shown = value.to_list() if hasattr(value, "to_list") else value
                raise InputError(f"{item.name}: {VELOCITY_PROPERTY}", shown, "must be three numbers, m/s")
            return item, velocity
        item = item.parent
    return None


def _shown_collections(scene: bpy.types.Scene) -> Iterator[bpy.types.Collection]:
    """Yield the scene's collections and those shown as instances by its objects, outer ones first, each once."""
    waiting = list(scene.collection.children_recursive)
    seen = set(waiting)
    yield from waiting
    objects = set(scene.objects)
    while objects:
        sources = {item.instance_collection for item in objects if item.instance_type == "COLLECTION"} - {None}
        new = [part for source in sources for part in (source, *source.children_recursive) if part not in seen]
        new = sorted(dict.fromkeys(new), key=lambda part: (part not in sources, part.name))
        seen.update(new)
        yield from new
        objects = {item for part in new for item in part.objects}
