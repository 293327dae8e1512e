"""The road in a scene: what it was built from is kept with its collection, so that it is undone and deleted with it."""

from __future__ import annotations

import json
from typing import Any

import bpy

from ...base.errors import InputError
from ...road.parameters import RoadParameters
from ...scenario.scenario import Scenario
from ..things.model_builder import ROLE
from .build import COLLECTION

PARAMETERS = "synthroads_parameters"
SCENARIO = "synthroads_scenario"
BUILT_FROM = "synthroads_built_from"


def find_road(scene: bpy.types.Scene) -> bpy.types.Collection | None:
    """Return the collection of the road in a scene, or None if there is no road or nothing is left of it."""
    for collection in scene.collection.children_recursive:
        if collection.name == COLLECTION and PARAMETERS in collection:
            return collection if any(ROLE in item for item in collection.all_objects) else None
    return None


def open_road() -> RoadParameters | None:
    """Return the parameter set of the road in the open scene, if there is one; raise `InputError` if it is damaged."""
    collection = find_road(bpy.context.scene)
    return recall_parameters(collection) if collection else None


def remember(collection: bpy.types.Collection, parameters: RoadParameters, scenario: Scenario, built_from: str) -> None:
    """Keep what a road was built from."""
    collection[PARAMETERS] = parameters.to_json()
    collection[SCENARIO] = scenario.to_json()
    collection[BUILT_FROM] = built_from


def objects_of(collection: bpy.types.Collection) -> dict[str, bpy.types.Object]:
    """Return the road's objects by role."""
    return {str(item[ROLE]): item for item in collection.all_objects if ROLE in item}


def recall(collection: bpy.types.Collection) -> tuple[RoadParameters, Scenario]:
    """Return what a road was built from; raise `InputError` if that can't be read."""
    return recall_parameters(collection), Scenario.from_dict(_stored(collection, SCENARIO), "Road")


def recall_parameters(collection: bpy.types.Collection) -> RoadParameters:
    """Return the parameter set of a road; raise `InputError` if it can't be read."""
    return RoadParameters.from_dict(_stored(collection, PARAMETERS), "Road")


def _stored(collection: bpy.types.Collection, key: str) -> Any:
    try:
        return json.loads(collection[key])
    except (KeyError, TypeError, ValueError):
        raise InputError("Road", None, "its parameter set in the file is damaged; build it again") from None
