"""A short road with a few things on it, built fast and kept with its scene: for tests of roads in a file."""

from __future__ import annotations

from typing import Any

from synthroads_addon.blender.model.build import RoadModel, build_road
from synthroads_addon.blender.model.store import remember
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.roads.furnished_data import road_data

PARTS = ("road", "terrain", "guardrails", "signs", "delineators", "vehicles")
TOLERANCE = 0.05
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
    model = build_road(parameters, TOLERANCE, 0.0, further.pop("parts", PARTS), **further)
    remember(getattr(model, "root", model.collection), parameters, load_scenario("rq31-600m", ["fidelity=draft"]), "")
    return model
