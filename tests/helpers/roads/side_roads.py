"""Country roads with side roads."""

from __future__ import annotations

import json
from typing import Any

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

BARE = {"trees_per_hectare": 0.0, "shrubs_per_hectare": 0.0, "grass_density": 0.0}
NO_BAYS = {"turnouts": {"bus_bays": 0.0, "laybys": 0.0}}
"""A road that gets things at given stations has no bays of its own there."""


def with_side_road(
    section: str = "RQ11", seed: int = 3, side: str = "right", design_class: str | None = None, **fields: Any
) -> RoadParameters:
    """Return a country road of 300 m with one side road, ``side-road-1``, at 150 m; its other fields as given."""
    class_ = {} if design_class is None else {"design_class": design_class}
    scenario = {"cross_section": section, "length": 300.0, **class_, **BARE, **NO_BAYS}
    road = sample_road(RoadScenario.from_dict(scenario), seed)
    data = json.loads(road.to_json())
    number = max(item["instance"] for item in data["objects"].values()) + 1
    own = {"type": "SideRoad", "instance": number, "carriageway": f"carriageway-{side}", "station": 150.0}
    data["objects"]["side-road-1"] = own | fields
    return RoadParameters.from_dict(data)


def in_britain(**fields: Any) -> RoadParameters:
    """Return a British road of 300 m, with traffic on the left, with one side road, ``side-road-1``."""
    return with_side_road("S2", design_class="DMRB85", **fields)


def drawn(
    section: str = "RQ11", seed: int = 5, length: float = 300.0, per_km: float = 5.0, **limits: Any
) -> RoadParameters:
    """Return a drawn country road with side roads."""
    side_roads = {"per_km": {"minimum": per_km, "maximum": per_km}, **limits}
    scenario = {"cross_section": section, "length": length, "side_roads": side_roads, **BARE}
    return sample_road(RoadScenario.from_dict(scenario), seed)


SHAPES: dict[str, dict[str, Any]] = {
    "right angle": {},
    "oblique": {"angle_deg": 70.0, "side": "left", "grade_percent": 3.0, "section": "RQ9"},
    "farm road": {
        "angle_deg": 115.0,
        "near_radius": 15.0,
        "far_radius": 6.0,
        "lanes": 1,
        "seed": 5,
        "priority": "none",
    },
    "beside two lanes": {"section": "RQ15.5", "near_radius": 20.0, "length": 100.0, "priority": "stop"},
}
"""Side roads of different shapes."""


def changed(road: RoadParameters, name: str, **fields: Any) -> RoadParameters:
    """Return a road of which one object has other values."""
    data = json.loads(road.to_json())
    data["objects"][name] = data["objects"].get(name, {}) | fields
    return RoadParameters.from_dict(data)


def roof(road: RoadParameters) -> RoadParameters:
    """Return a country road that is a roof at first, one plane at last, and turns from one to the other."""
    falls = {"right": (2.5, 2.5), "left": (-2.5, 2.5)}
    for side, (first, last) in falls.items():
        points = [(0.0, first), (180.0, first), (220.0, last)]
        crossfall = [{"station": s, "crossfall_percent": q} for s, q in points]
        road = changed(road, f"carriageway-{side}", crossfall=crossfall)
    return road
