"""Country roads and motorways with bridges and tunnels."""

from __future__ import annotations

import json
from typing import Any

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

BARE = {"trees_per_hectare": 0.0, "shrubs_per_hectare": 0.0, "grass_density": 0.0}
BRIDGE = {
    "type": "Bridge",
    "start_station": 90.0,
    "end_station": 138.0,
    "barrier": "h2",
    "pier_stations": [106.0, 122.0],
}
TUNNEL = {"type": "Tunnel", "start_station": 90.0, "end_station": 170.0}
KEPT = ("Alignment", "Carriageway", "Median", "LineMarking", "Terrain")
"""Types of what a road with a structure keeps: nothing stands beside it."""


def with_structure(base: dict[str, Any], cross_section: str = "RQ11", seed: int = 3, **fields: Any) -> RoadParameters:
    """Return a bare road of 260 m with one structure, ``structure``; its other fields as given."""
    ground = {"embankment_height": {"minimum": 1.0, "maximum": 1.0}, "half_width": 50.0}
    scenario = {"cross_section": cross_section, "length": 260.0, **ground, **BARE}
    road = sample_road(RoadScenario.from_dict(scenario), seed)
    data = json.loads(road.to_json())
    objects = {name: item for name, item in data["objects"].items() if item["type"] in KEPT}
    number = max(item["instance"] for item in objects.values()) + 1
    data["objects"] = objects | {"structure": base | {"instance": number} | fields}
    return RoadParameters.from_dict(data)


def with_bridge(cross_section: str = "RQ11", **fields: Any) -> RoadParameters:
    """Return a road with one bridge from 90 to 138 m."""
    return with_structure(BRIDGE, cross_section, **fields)


def with_tunnel(cross_section: str = "RQ11", **fields: Any) -> RoadParameters:
    """Return a road with one tunnel from 90 to 170 m."""
    return with_structure(TUNNEL, cross_section, **fields)


def changed(road: RoadParameters, name: str, **fields: Any) -> RoadParameters:
    """Return a road of which one object has other values, or that has one more."""
    data = json.loads(road.to_json())
    number = max(item["instance"] for item in data["objects"].values()) + 1
    data["objects"][name] = {"instance": number} | data["objects"].get(name, {}) | fields
    return RoadParameters.from_dict(data)
