"""Names of what has no class in a scene that others made, and a file of classes by these names, to be filled in."""

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
"""Names of each kind that are told; the file has all."""
_COPY = re.compile(r"(.+)\.\d+")
"""Name of one of several things that are numbered, as Blender numbers copies."""


@dataclass(frozen=True)
class Unlabelled:
    """Things of a scene without a class, by name.

    Attributes:
        names: per kind of `KINDS` the names, copies of a thing together as a pattern, sorted.
        count: number of objects without a class.
        total: number of objects with faces.
    """

    names: Mapping[str, tuple[str, ...]]
    count: int
    total: int

    def mapping(self) -> ClassMapping:
        """Return a class mapping of these names in which every class is left open."""
        return ClassMapping.from_dict({kind: dict.fromkeys(self.names[kind], "") for kind in KINDS})

    def text(self) -> str:
        """Return the first names of each kind in words."""
        told = [f"{kind} {_first_names(self.names[kind])}" for kind in KINDS if self.names[kind]]
        what = f"{self.count:,} of {self.total:,} objects have no class, and their points will have none"
        return f"{what}: {'; '.join(told)}"


def unlabelled_things(mapping: ClassMapping | None, class_ids: Mapping[str, int] | None) -> Unlabelled:
    """Return what is visible in the open file, has faces, and has no class by attribute, property or name.

    Args:
        mapping: classes by name; none if None.
        class_ids: ``class_id`` by the names of classes that objects may have; that of the full table if None.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    labels = Labels(depsgraph.scene, mapping, class_ids)
    patterns: dict[str, set[str]] = {kind: set() for kind in KINDS}
    bare: set[bpy.types.Object] = set()
    uses = ((use.object, use.parent if use.is_instance else use.object) for use in depsgraph.object_instances)
    seen: set[tuple[bpy.types.Object, bpy.types.Object]] = set()
    for shown, by in uses:
        item, owner = shown.original, by.original
        if shown.type != "MESH" or not len(shown.data.polygons) or SUPPORT in owner or (item, owner) in seen:
            continue
        seen.add((item, owner))
        label = labels.label_of(item, owner)
        slots = [name for name in slot_names(shown) if labels.by_name.find("materials", name) is None]
        if label.strong >= 0 or label.weak != UNLABELLED or "class_id" in shown.data.attributes or not slots:
            continue
        bare.add(item)
        patterns["objects"].add(_pattern(item.name))
        patterns["materials"] |= {_pattern(name) for name in slots if bpy.data.materials.get(name)}
        inside = [part.name for part in item.users_collection]
        patterns["collections"] |= {escape(name) for name in inside if name in bpy.data.collections}
    return Unlabelled(
        {kind: tuple(sorted(patterns[kind])) for kind in KINDS}, len(bare), len({item for item, _ in seen})
    )


def _pattern(name: str) -> str:
    """Return the pattern that a name and its copies fit: of ``Lamp.001`` ``Lamp.*``."""
    copy = _COPY.fullmatch(name)
    return f"{escape(copy[1])}.*" if copy else escape(name)


def _first_names(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
