"""A short road with a few things on it, built fast and kept with its scene: for tests of roads in a file."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from synthroads_addon.blender.model.build import MEANT, RoadModel, build_road
from synthroads_addon.blender.model.roads import origin_of
from synthroads_addon.blender.model.store import find_road, objects_of, remember
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.roads.furnished_data import road_data

PARTS = ("road", "terrain", "guardrails", "signs", "delineators", "vehicles")
SCENARIO = load_scenario("rq31-600m-even", ["fidelity=draft"])
TOLERANCE = SCENARIO.settings().tolerance
OBJECTS: dict[str, dict[str, Any]] = {
    "rail-left": {"type": "Guardrail", "start_station": 5.0, "end_station": 30.0, "offset": 14.9, "faces": "right"},
    "rail-right": {"type": "Guardrail", "start_station": 10.0, "end_station": 45.0, "offset": -14.9, "faces": "left"},
    "sign": {"type": "TrafficSign", "station": 40.0, "offset": -16.5, "code": "274-120", "shape": "round"}
    | {"width": 0.75, "height": 0.75},
    "post-1": {"type": "Delineator", "station": 10.0, "offset": -15.0},
    "post-2": {"type": "Delineator", "station": 35.0, "offset": -15.0},
    "car": {"type": "Vehicle", "carriageway": "right", "lane": 0, "station": 20.0, "speed": 30.0, "model": "car"},
}


def small_parameters(length: float = 60.0, **more: dict[str, Any]) -> RoadParameters:
    """Return a road of a length (m) in a bend, rising, on uneven ground, with guardrails, a sign, posts and a car."""
    return RoadParameters.from_dict(road_data({**OBJECTS, **more}, length))


def build_small(parameters: RoadParameters | None = None, **further: Any) -> RoadModel:
    """Build a short road in the current scene, and keep what it was built from."""
    parameters = parameters or small_parameters()
    parts, place = further.pop("parts", PARTS), further.pop("place", MEANT)
    model = build_road(BuildRequest(parameters, TOLERANCE, 0.0, parts, **further), place)
    remember(getattr(model, "root", model.collection), parameters, SCENARIO, "")
    return model


@cache
def _small_file() -> Path:
    """Return a file with a short road, which is built once: to open it is much faster."""
    file = Path(tempfile.mkdtemp(prefix="synthroads-test-")) / "small.blend"
    build_small()
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


def open_small() -> RoadModel:
    """Return a short road in a file of its own, whose scene is the current one then."""
    bpy.ops.wm.open_mainfile(filepath=str(_small_file()))
    root = find_road(bpy.context.scene)
    assert root is not None
    return RoadModel(root, root.users_collection[0], objects_of(root), np.array(origin_of(root)))
