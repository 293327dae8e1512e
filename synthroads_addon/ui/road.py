"""The road in a scene: what it was built from is kept with its collection, so that it is undone and deleted with it."""

from __future__ import annotations

import json

import bpy

from ..blender.model import COLLECTION
from ..blender.model_builder import ROLE
from ..core.errors import InputError
from ..core.parameters.model import RoadParameters
from ..core.scenario import Scenario

PARAMETERS = "synthroads_parameters"
SCENARIO = "synthroads_scenario"
BUILT_FROM = "synthroads_built_from"


def find_road(scene: bpy.types.Scene) -> bpy.types.Collection | None:
    """Return the collection of the road in a scene, or None if there is no road or nothing is left of it."""
    for collection in scene.collection.children_recursive:
        if collection.name == COLLECTION and PARAMETERS in collection:
            return collection if any(ROLE in item for item in collection.all_objects) else None
    return None


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
    try:
        parameters, scenario = json.loads(collection[PARAMETERS]), json.loads(collection[SCENARIO])
    except (KeyError, TypeError, ValueError):
        raise InputError("Road", None, "its parameter set in the file is damaged; build it again") from None
    return RoadParameters.from_dict(parameters, "Road"), Scenario.from_dict(scenario, "Road")
