"""Parts of a road that an IFC file of ours carries in its property sets, as objects of a parameter set again."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, cast

from ...base.errors import InputError
from ...road.given_road import GivenRoad
from ...road.objects import RoadObject, Side
from ...road.parameters import OBJECT_ID
from ...road.section import Arrow, Carriageway, Hatching, LineMarking, Turnout
from ...road.things.registry import THINGS
from ...road.things.thing import Thing

_SET = "SynthRoads"
"""Name of the property sets with all fields of an object (`twin.ifc.scene.Scene.add_parameters`)."""
_PAINT: dict[str, type[RoadObject]] = {"LineMarking": LineMarking, "Arrow": Arrow, "Hatching": Hatching}
_KINDS: dict[str, type[RoadObject]] = {"Carriageway": Carriageway, "Turnout": Turnout, **_PAINT, **THINGS}
_SURFACE = {"IfcRoadPart", "IfcPavement", "IfcCourse", "IfcKerb"}
"""Classes of what a road's surface is made of."""


def own_parts(model: Any) -> tuple[GivenRoad | None, Counter[str], list[str]]:
    """Return the carriageways, turnouts, markings and things of a model of ours, their numbers, and what is left out.

    Args:
        model: of ifcopenshell.

    Returns:
        the parts, None where no carriageway is among them, as in files of other programs; their numbers by kind; texts
        on what is left out: without a carriageway all of the road's surface and objects, by class.
    """
    items: dict[str, RoadObject] = {}
    misfits: Counter[str] = Counter()
    for relation in model.by_type("IfcRelDefinesByProperties"):
        definition = relation.RelatingPropertyDefinition
        if getattr(definition, "Name", None) != _SET:
            continue
        values = _values(definition)
        kind = str(values.get("type"))
        if kind not in _KINDS:
            continue
        name = str(relation.RelatedObjects[0].Name)
        fields = {key: value for key, value in values.items() if key in _KINDS[kind].model_fields}
        try:
            item = _KINDS[kind].from_dict(fields | {"instance": 1})
        except InputError:
            misfits[kind] += 1
            continue
        if re.fullmatch(OBJECT_ID, name):
            items[name] = item
        else:
            misfits[kind] += 1
    carriageways = {name: item for name, item in items.items() if isinstance(item, Carriageway)}
    by_side: dict[Side, Carriageway] = {item.side: item for item in carriageways.values()}
    if not by_side or len(by_side) < len(carriageways):
        return None, Counter(), _of_others(model)
    ids = {name: f"carriageway-{item.side}" for name, item in carriageways.items()}
    other_parts = {name: _with_carriageway(item, ids) for name, item in items.items() if name not in ids}
    turnouts = {
        name: item for name, item in other_parts.items() if isinstance(item, Turnout) and _refers(item, by_side, {})
    }
    markings = {
        name: item
        for name, item in other_parts.items()
        if isinstance(item, tuple(_PAINT.values())) and _refers(item, by_side, turnouts)
    }
    things = {name: cast(Thing, item) for name, item in other_parts.items() if type(item).__name__ in THINGS}
    misfits += Counter(type(item).__name__ for item in items.values())
    parts: list[RoadObject] = [*by_side.values(), *turnouts.values(), *markings.values(), *things.values()]
    counts = Counter(type(item).__name__ for item in parts)
    left_out = [
        f"{_word(kind)}: {n} {kind} with other values than ours" for kind, n in sorted((misfits - counts).items())
    ]
    return GivenRoad(by_side, turnouts, markings, things), counts, left_out


def _refers(item: RoadObject, by_side: Mapping[Side, Carriageway], turnouts: Mapping[str, Turnout]) -> bool:
    """Return whether the set has the carriageway, the lane boundary and the turnout that an object names."""
    carriageways = {f"carriageway-{side}": carriageway for side, carriageway in by_side.items()}
    # Not every kind of object has all three fields; one that it lacks refers to nothing.
    carriageway_id, turnout_id = getattr(item, "carriageway", None), getattr(item, "turnout", None)
    boundary = getattr(item, "boundary", 0)
    if carriageway_id is not None and (
        carriageway_id not in carriageways or boundary > len(carriageways[carriageway_id].lanes)
    ):
        return False
    return turnout_id is None or (turnout_id in turnouts and turnouts[turnout_id].ramp is not None)


def _word(kind: str) -> str:
    """Return the heading under which a kind of object is listed: ``lanes`` or ``objects``."""
    return "lanes" if kind in ("Carriageway", "Turnout") else "objects"


def _with_carriageway(item: RoadObject, ids: Mapping[str, str]) -> RoadObject:
    """Return an object whose carriageway has the set's id in place of the file's, by `ids` (file's id -> set's id)."""
    carriageway_id = str(getattr(item, "carriageway", ""))
    return item.model_copy(update={"carriageway": ids[carriageway_id]}) if carriageway_id in ids else item


def _values(definition: Any) -> dict[str, Any]:
    """Return the values of a property set by name, structures read from their JSON text."""
    values: dict[str, Any] = {}
    for each in definition.HasProperties or ():
        value = getattr(getattr(each, "NominalValue", None), "wrappedValue", None)
        if isinstance(value, str) and value[:1] in ("[", "{"):
            with suppress(ValueError, RecursionError):  # a text that begins so
                value = json.loads(value)
        values[each.Name] = value
    return values


def _of_others(model: Any) -> list[str]:
    """Return texts with the numbers, by class, of surface parts, objects and events of a model of another program."""
    counts = Counter(each.is_a() for each in (*model.by_type("IfcElement"), *model.by_type("IfcRoadPart")))
    texts = []
    for word, is_surface in (("lanes", True), ("objects", False)):
        rows = [f"{count} {kind}" for kind, count in sorted(counts.items()) if (kind in _SURFACE) == is_surface]
        texts += [f"{word}: {', '.join(rows)}"] if rows else []
    kinds = Counter(_kind(each) for name in ("IfcReferent", "IfcAnnotation") for each in model.by_type(name))
    for kind, text in (
        ("SUPERELEVATIONEVENT", "crossfall: {} superelevation events, which don't say about which line it turns"),
        ("WIDTHEVENT", "lanes: {} width events, which say the width of the pavement alone"),
    ):
        texts += [text.format(kinds[kind])] if kinds[kind] else []
    return texts


def _kind(each: Any) -> str:
    """Return an object's predefined type, empty where it has none, as in files of the schema's candidates."""
    try:
        return str(each.PredefinedType)
    except (AttributeError, IndexError, RuntimeError):
        return ""
