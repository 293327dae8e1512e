"""Roads built by an older version: they are given a root object, and their inputs this version's names."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

import bpy

from ...road.parameters import RoadParameters
from ...road.section import LineMarking, Turnout
from ...road.things.registry import THINGS
from ..things.model_builder import ROLE
from ..things.road.layout import names_in_words, side_of
from ..things.road.road import MARKINGS
from .roads import BUILT_PARTS, FRAME, NAME, OF_ROAD, ORIGIN, ROAD, new_root

_SINGLE = {name for name in THINGS if name not in ("Delineator", "ConstructionBeacon")} | {"Vehicle"}
"""Types of the parameter set's objects that have an object in Blender each."""
PARAMETERS = "synthroads_parameters"
"""Custom property of a road's root, and in older files of its collection: the parameter set as JSON."""
_RENAMED = {"Dash": "Dash Length", "Gap": "Gap Length"}
"""Names of lines' inputs that have changed, apart from the line's id in front of them."""


def adopt_older_roads() -> list[bpy.types.Object]:
    """Give each road of a file of version 0.1, a collection, a root object with its data; return the new roots.

    In version 0.1 a road was a collection with its parameter set as a custom property. No object moves.
    """
    return [_adopt(collection) for collection in bpy.data.collections if _is_older_road(collection)]


def _is_older_road(collection: bpy.types.Collection) -> bool:
    """Return whether a collection is a road of version 0.1."""
    return PARAMETERS in collection and ORIGIN in collection and collection.library is None


def _adopt(collection: bpy.types.Collection) -> bpy.types.Object:
    """Give a road of version 0.1 a root object with the collection's custom properties; return it."""
    root = new_root()
    collection.objects.link(root)
    for key in [key for key in collection.keys() if key.startswith("synthroads_")]:  # noqa: SIM118
        root[key] = collection[key]
        del collection[key]
    root[FRAME] = list(root[ORIGIN])
    for item in collection.all_objects:
        if ROLE in item and item.library is None:
            if item.parent is None:
                item.parent = root
            item[OF_ROAD], item[NAME] = root[ROAD], item[ROLE]
    root[BUILT_PARTS] = json.dumps(sorted(_built_roles(root, collection)))
    return root


def _built_roles(root: bpy.types.Object, collection: bpy.types.Collection) -> set[str]:
    """Return the roles of an older road's parts as built: those present, and its parameter set's single objects."""
    roles = {str(item[ROLE]) for item in collection.all_objects if ROLE in item}
    try:
        objects = json.loads(root[PARAMETERS])["objects"]
        return roles | {name for name, item in objects.items() if item["type"] in _SINGLE}
    except (KeyError, TypeError, ValueError):  # the parameter set is damaged
        return roles


def rename_inputs(parameters: RoadParameters, objects: Mapping[str, bpy.types.Object]) -> None:
    """Rename a road's modifier inputs of lines and turnouts from older versions' ids to words, in place; values stay.

    Args:
        parameters: parameter set that the road was built from.
        objects: the road's objects by role.
    """
    item = objects.get("Road")
    group = item.modifiers[0].node_group if item and item.modifiers else None
    if group is None:
        return
    interface, words_by_id = group.interface, dict(_worded_ids(parameters))
    renamed_entries = [
        (entry, name) for entry in interface.items_tree if (name := _name_in_words(entry.name, words_by_id))
    ]
    if not renamed_entries:
        return
    marking_panel = interface.new_panel(MARKINGS, default_closed=True)
    for entry, name in renamed_entries:
        if entry.item_type == "PANEL":
            interface.move_to_parent(entry, marking_panel, len(marking_panel.interface_items))
        entry.name = name


def _name_in_words(name: str, words_by_id: Mapping[str, str]) -> str:
    """Return the name in words of a panel or input that is named by an id; empty for others."""
    key, _, field_name = name.removeprefix("Marking ").partition(" ")
    return f"{words_by_id[key]} {_RENAMED.get(field_name, field_name)}".strip() if key in words_by_id else ""


def _worded_ids(parameters: RoadParameters) -> Iterator[tuple[str, str]]:
    """Yield (id, name in words with the side) of the road's lines and turnouts."""
    words = names_in_words(parameters)
    for key, item in parameters.objects.items():
        if isinstance(item, LineMarking | Turnout):
            yield key, f"{side_of(parameters, item)} {words[key]}"
