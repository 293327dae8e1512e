"""Roads that an older version has built: they get a root, and inputs the names that this version gives them."""

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
"""Types in the parameter set of what has an object of its own."""
PARAMETERS = "synthroads_parameters"
"""Custom property of a road's root, and in older files of its collection: the parameter set as JSON."""
_RENAMED = {"Dash": "Dash Length", "Gap": "Gap Length"}
"""Inputs of lines that also have another name behind the id or the words."""


def adopt_older_roads() -> list[bpy.types.Object]:
    """Give each road of a file of version 0.1, a collection, a root object with its data; return the new roots.

    Up to version 0.1 a road was a collection with its parameter set, whatever its name is now. Nothing moves.
    """
    return [_adopt(collection) for collection in bpy.data.collections if _is_older_road(collection)]


def _is_older_road(collection: bpy.types.Collection) -> bool:
    return PARAMETERS in collection and ORIGIN in collection and collection.library is None


def _adopt(collection: bpy.types.Collection) -> bpy.types.Object:
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
    root[BUILT_PARTS] = json.dumps(sorted(_built_before(root, collection)))
    return root


def _built_before(root: bpy.types.Object, collection: bpy.types.Collection) -> set[str]:
    """Return the roles of an older road's parts as built: those present, and its parameter set's single objects."""
    there = {str(item[ROLE]) for item in collection.all_objects if ROLE in item}
    try:
        objects = json.loads(root[PARAMETERS])["objects"]
        return there | {name for name, item in objects.items() if item["type"] in _SINGLE}
    except (KeyError, TypeError, ValueError):  # it is damaged
        return there


def rename_inputs(parameters: RoadParameters, objects: Mapping[str, bpy.types.Object]) -> None:
    """Rename a road's modifier inputs of lines and turnouts from older versions' ids to words, in place; values stay.

    Args:
        parameters: what the road was built from.
        objects: the road's objects by role.
    """
    item = objects.get("Road")
    group = item.modifiers[0].node_group if item and item.modifiers else None
    if group is None:
        return
    interface, words = group.interface, dict(_worded_ids(parameters))
    older = [(entry, name) for entry in interface.items_tree if (name := _name_in_words(entry.name, words))]
    if not older:
        return
    markings = interface.new_panel(MARKINGS, default_closed=True)
    for entry, name in older:
        if entry.item_type == "PANEL":
            interface.move_to_parent(entry, markings, len(markings.interface_items))
        entry.name = name


def _name_in_words(name: str, words: Mapping[str, str]) -> str:
    """Return the name in words of a panel or input that is named by an id; empty for others."""
    key, _, rest = name.removeprefix("Marking ").partition(" ")
    return f"{words[key]} {_RENAMED.get(rest, rest)}".strip() if key in words else ""


def _worded_ids(parameters: RoadParameters) -> Iterator[tuple[str, str]]:
    """Yield (id, name in words with side) of the road's lines and turnouts."""
    words = names_in_words(parameters)
    for key, item in parameters.objects.items():
        if isinstance(item, LineMarking | Turnout):
            yield key, f"{side_of(parameters, item)} {words[key]}"
