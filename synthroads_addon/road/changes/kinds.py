"""Kinds of changes: which kind an edit of a parameter set is of, and which edits are one change together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..things.registry import THINGS
from .change import Edit, Kind

CONDITIONS = ("metadata", "environment", "part_numbers")
"""Fields of a set that say nothing of the road itself: names, light, weather and season, numbers."""
_GRASS = "materials.grass_dryness"
"""A field of the materials that changes with the season."""
_TRAFFIC = "Vehicle"
_PLANTS = ("Vegetation", "Hedge", "Tree")
_PLACES = ("station", "offset", "elevation", "rotation_deg", "start_station", "end_station", "end_offset", "lane")
"""Fields of things that say where they are."""
_MARKINGS = ("LineMarking", "Hatching", "Arrow")
_HEIGHTS = ("height", "height_min", "height_max", "crown_diameter", "width")
_TEMPORARY = ("ConstructionBeacon", "TemporaryBarrier")
_TOUCH = 1e-6
"""Tolerance (m) of what lies within something."""


@dataclass(frozen=True)
class EditKind:
    """Kind of an edit, and the key of the change that it belongs to: edits of one key are one change."""

    kind: Kind
    detail: str = ""
    key: tuple[str, ...] = ()


def is_condition(edit: Edit, objects: Mapping[str, Any]) -> bool:
    """Return whether an edit is of the conditions: names, light, weather, season and traffic.

    Args:
        edit: the edit.
        objects: data of the objects of both sets by id.
    """
    if edit.thing == "":
        return edit.path.partition(".")[0] in CONDITIONS or edit.path == _GRASS
    return bool(objects[edit.thing]["type"] == _TRAFFIC)


def kind_of(edit: Edit, objects: Mapping[str, Any], all_edits: Sequence[Edit]) -> EditKind:
    """Return the kind of an edit that is no condition.

    Args:
        edit: the edit.
        objects: data of the objects of both sets by id, those of the second first.
        all_edits: all edits of the two sets, among which those that belong together are found.
    """
    if edit.thing == "":
        return EditKind("worn" if edit.path.startswith("materials.") else "altered", key=("road",))
    item = objects[edit.thing]
    kind = item["type"]
    if kind == "Carriageway":
        return _of_carriageway(edit, objects, all_edits)
    if kind in _MARKINGS:
        return _of_marking(edit, item)
    if kind in _PLANTS:
        return _of_plants(edit)
    if kind in THINGS or kind == "SideRoad":
        return _of_thing(edit, kind)
    return EditKind("altered", key=(edit.thing,))


def _of_thing(edit: Edit, kind: str) -> EditKind:
    """Return the kind of an edit of something that stands on or beside the road."""
    if edit.path == "":
        is_added = edit.before is None
        if edit.before is not None and edit.after is not None:
            return EditKind("altered", key=(edit.thing,))
        if kind == "ParkedVehicle":
            return EditKind("parked", key=(edit.thing,))
        if kind in _TEMPORARY:
            detail = "set_up" if is_added else "taken_away"
            return EditKind("construction_zone", detail, (detail,))
        return EditKind("added" if is_added else "removed", key=(edit.thing,))
    field = edit.path.partition(".")[0]
    details = {"dents": "bent", "lean_deg": "leaning", "lean_direction_deg": "leaning"}
    details |= {"missing_panels": "panel_missing"}
    if field in details:
        return EditKind("damaged", details[field], (edit.thing, details[field]))
    if field == "rotation_deg" and kind == "TrafficSign":
        return EditKind("damaged", "turned", (edit.thing, "turned"))
    if field in _PLACES:
        return EditKind("moved", key=(edit.thing,))
    return EditKind("altered", key=(edit.thing,))


def _of_plants(edit: Edit) -> EditKind:
    """Return the kind of an edit of plants: grown where a height or a density is larger, cut back where smaller."""
    if edit.path == "":
        is_whole = (edit.before is None) != (edit.after is None)
        return EditKind(("added" if edit.before is None else "removed") if is_whole else "altered", key=(edit.thing,))
    if edit.path in (*_HEIGHTS, "density", "mown_width") and edit.before is not None and edit.after is not None:
        has_more = (edit.after > edit.before) != (edit.path == "mown_width")
        return EditKind("grown" if has_more else "cut_back", key=(edit.thing,))
    return EditKind("moved" if edit.path in _PLACES else "altered", key=(edit.thing,))


def _of_marking(edit: Edit, item: Mapping[str, Any]) -> EditKind:
    """Return the kind of an edit of a marking: of a zone where it is yellow, worn where its film is thinner."""
    if edit.path == "" and item.get("color") == "yellow" and (edit.before is None) != (edit.after is None):
        detail = "set_up" if edit.before is None else "taken_away"
        return EditKind("construction_zone", detail, (detail,))
    if edit.path == "film_thickness" and edit.after < edit.before:
        return EditKind("worn", key=(edit.thing,))
    return EditKind("marked_anew", key=(edit.thing,))


def _of_carriageway(edit: Edit, objects: Mapping[str, Any], all_edits: Sequence[Edit]) -> EditKind:
    """Return the kind of an edit of a carriageway: of its pavement's damages, else it is altered."""
    part, _, rest = edit.path.partition(".")
    name, _, place = rest.partition(".")
    if part != "pavement" or not place:
        return EditKind("altered", key=(edit.thing,))
    value = edit.after if edit.after is not None else edit.before
    if (course := _covering(edit, name, value, all_edits)) is not None:
        return EditKind("overlaid", key=(edit.thing, course.path))
    if name == "removed_markings" and (line := _ground_line(edit, value, objects, all_edits)) is not None:
        return EditKind("marked_anew", key=(line,))
    if (patch := _patch_over(edit, name, value, all_edits)) is not None:
        return EditKind("patched", key=(edit.thing, patch.path))
    key = (edit.thing, edit.path, "added" if edit.before is None else "before")
    kinds: dict[str, EditKind] = {
        "ruts": EditKind("rutted", key=key),
        "settlements": EditKind("settled", key=key),
        "cracks": EditKind("cracked", key=key),
        "potholes": EditKind("damaged", "spalled", key),
        "patches": EditKind("patched", key=(edit.thing, edit.path)),
        "overlays": EditKind("overlaid", key=(edit.thing, edit.path)),
        "removed_markings": EditKind("marked_anew", key=key),
    }
    return kinds.get(name, EditKind("altered", key=(edit.thing,)))


def _covering(edit: Edit, name: str, value: Mapping[str, Any], all_edits: Sequence[Edit]) -> Edit | None:
    """Return the edit that adds the new course below which an edit's damage vanishes, or whose patch it is."""
    is_taken = edit.after is None and name in ("ruts", "potholes", "cracks", "patches", "removed_markings")
    is_patch = edit.before is None and name == "patches"
    if not (is_taken or is_patch):
        return None
    low, high = stretch_of(name, value)
    for other in all_edits:
        if other.thing == edit.thing and other.path.startswith("pavement.overlays.") and other.before is None:
            start, end = other.after["start_station"], other.after["end_station"]
            if low >= start - _TOUCH and high <= end + _TOUCH and (is_taken or (low, high) == (start, end)):
                return other
    return None


def _patch_over(edit: Edit, name: str, value: Mapping[str, Any], all_edits: Sequence[Edit]) -> Edit | None:
    """Return the edit that adds the patch under which an edit's crack or pothole vanishes."""
    if edit.after is not None or name not in ("cracks", "potholes"):
        return None
    low, high = stretch_of(name, value)
    for other in all_edits:
        if other.thing == edit.thing and other.path.startswith("pavement.patches.") and other.before is None:
            start, end = stretch_of("patches", other.after)
            if low >= start - _TOUCH and high <= end + _TOUCH:
                return other
    return None


def _ground_line(
    edit: Edit, value: Mapping[str, Any], objects: Mapping[str, Any], all_edits: Sequence[Edit]
) -> str | None:
    """Return the id of the line that was ground off where it was, and painted anew; None if it is none of today's."""
    fields = ("dash_length", "gap_length", "width")
    for other in all_edits:
        item = objects.get(other.thing)
        if not item or item["type"] != "LineMarking" or item["carriageway"] != edit.thing or not other.path:
            continue
        is_alike = all(item[field] == value[field] for field in fields) and other.path == "start_station"
        if is_alike and other.before == value["start_station"]:
            return other.thing
    return None


def stretch_of(name: str, value: Mapping[str, Any]) -> tuple[float, float]:
    """Return the stations (m) between which an element of a pavement's list lies, by its JSON data."""
    if "start_station" in value:
        return value["start_station"], value["end_station"]
    if name == "patches":
        stations = [corner[0] for corner in value["outline"]]
    elif name == "cracks":
        stations = [corner[0] for line in value["lines"] for corner in line]
    else:
        return value["station"] - value["length"] / 2.0, value["station"] + value["length"] / 2.0
    return min(stations), max(stations)
