"""Roads that an older version has built: their inputs get the names that this version gives them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import bpy

from ...road.parameters import RoadParameters
from ...road.section import LineMarking, Turnout
from ..nodes.inputs import input_name
from ..things.road.layout import names_in_words, side_of
from ..things.road.road import MARKINGS

_FIELDS = {
    "Distance": "distance",
    "Width": "width",
    "Dash": "dash_length",
    "Gap": "gap_length",
    "Start Station": "start_station",
    "End Station": "end_station",
    "Film Thickness": "film_thickness",
    "Instance": "instance",
}
"""Names of the inputs of lines and turnouts behind the id, as they were, and their fields now."""


def rename_inputs(parameters: RoadParameters, objects: Mapping[str, bpy.types.Object]) -> None:
    """Name the inputs of lines and turnouts in words that older versions named by their ids; values stay.

    Args:
        parameters: what the road was built from.
        objects: the road's objects by role.
    """
    item = objects.get("Road")
    group = item.modifiers[0].node_group if item and item.modifiers else None
    if group is None:
        return
    interface, names = group.interface, dict(_names(parameters))
    older = [entry for entry in interface.items_tree if entry.name in names]
    if not older:
        return
    markings = interface.new_panel(MARKINGS, default_closed=True)
    for entry in older:
        if entry.item_type == "PANEL":
            interface.move_to_parent(entry, markings, len(markings.interface_items))
        entry.name = names[entry.name]


def _names(parameters: RoadParameters) -> Iterator[tuple[str, str]]:
    """Yield the old and the new name of panels and inputs of lines and turnouts."""
    words = names_in_words(parameters)
    for key, item in parameters.objects.items():
        if isinstance(item, LineMarking | Turnout):
            name = f"{side_of(parameters, item)} {words[key]}"
            yield f"Marking {key}", name
            yield from ((f"{key} {old}", input_name(field, name)) for old, field in _FIELDS.items())
