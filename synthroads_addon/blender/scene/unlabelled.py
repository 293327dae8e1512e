"""Names of the things without a class in a user's scene, as a class mapping to be filled in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from glob import escape

import bpy

from ...base.class_mapping import KINDS, ClassMapping
from ...base.classes import UNLABELLED
from ..labels import Labels
from ..things.model_builder import SUPPORT
from .reading import slot_names

_SHOWN = 6
"""Largest number of names of each kind in a text; the mapping has all."""
_COPY = re.compile(r"(.+)\.\d+")
"""Name of a numbered copy, as Blender numbers copies."""


@dataclass(frozen=True)
class Unlabelled:
    """Things of a scene without a class, by name.

    Attributes:
        names: sorted names by kind of `KINDS`; copies of a thing are one pattern.
        count: number of objects without a class.
        total: number of objects with faces.
    """

    names: Mapping[str, tuple[str, ...]]
    count: int
    total: int

    def mapping(self) -> ClassMapping:
        """Return a class mapping of these names in which every class is empty, to be filled in."""
        return ClassMapping.from_dict({kind: dict.fromkeys(self.names[kind], "") for kind in KINDS})

    def text(self) -> str:
        """Return the first names of each kind in words."""
        lists = [f"{kind} {_first_names(self.names[kind])}" for kind in KINDS if self.names[kind]]
        sentence = f"{self.count:,} of {self.total:,} objects have no class, and their points will have none"
        return f"{sentence}: {'; '.join(lists)}"


def unlabelled_things(mapping: ClassMapping | None, class_ids: Mapping[str, int] | None) -> Unlabelled:
    """Return the visible things of the open file that have faces, but no class by attribute, property or name.

    Args:
        mapping: classes by name; none if None.
        class_ids: ``class_id`` by the names of classes that objects may have; that of the full table if None.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    labels = Labels(depsgraph.scene, mapping, class_ids)
    patterns: dict[str, set[str]] = {kind: set() for kind in KINDS}
    unlabelled_items: set[bpy.types.Object] = set()
    uses = ((use.object, use.parent if use.is_instance else use.object) for use in depsgraph.object_instances)
    visited: set[tuple[bpy.types.Object, bpy.types.Object]] = set()
    for evaluated_item, owner_item in uses:
        item, owner = evaluated_item.original, owner_item.original
        if (
            evaluated_item.type != "MESH"
            or not len(evaluated_item.data.polygons)
            or SUPPORT in owner
            or (item, owner) in visited
        ):
            continue
        visited.add((item, owner))
        label = labels.label_of(item, owner)
        slots = [name for name in slot_names(evaluated_item) if labels.by_name.find("materials", name) is None]
        if label.strong >= 0 or label.weak != UNLABELLED or "class_id" in evaluated_item.data.attributes or not slots:
            continue
        unlabelled_items.add(item)
        patterns["objects"].add(_pattern(item.name))
        patterns["materials"] |= {_pattern(name) for name in slots if bpy.data.materials.get(name)}
        collection_names = [part.name for part in item.users_collection]
        patterns["collections"] |= {escape(name) for name in collection_names if name in bpy.data.collections}
    return Unlabelled(
        {kind: tuple(sorted(patterns[kind])) for kind in KINDS},
        len(unlabelled_items),
        len({item for item, _ in visited}),
    )


def _pattern(name: str) -> str:
    """Return the pattern that a name and its numbered copies match: ``Lamp.*`` for ``Lamp.001``."""
    copy = _COPY.fullmatch(name)
    return f"{escape(copy[1])}.*" if copy else escape(name)


def _first_names(names: tuple[str, ...]) -> str:
    """Return the first names as a list in words, with the number of further ones."""
    rest = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + rest
