"""Country roads that lead through a village: street sides of both kinds, with what they may have."""

import json
from typing import Any

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.side_roads import NO_BAYS

STREETS: dict[str, dict[str, Any]] = {
    "left": {
        "start_station": 20.3,
        "end_station": 110.0,
        "footway_width": 4.5,
        "gutter_rows": 1,
        "kerb_levels": [{"station": 60.0}, {"station": 80.0, "length": 12.0, "height": 0.18}],
        "bays": [{"start_station": 32.0, "end_station": 52.0}],
    },
    "right": {
        "start_station": 15.0,
        "end_station": 80.0,
        "footway_material": "asphalt",
        "kerb_levels": [{"station": 60.0, "height": 0.0}],
    },
    "right-2": {
        "start_station": 84.0,
        "end_station": 130.0,
        "transition_length": 2.0,
        "gutter_rows": 0,
        "kerb_material": "concrete",
        "footway_material": "setts",
        "verge_width": 2.5,
    },
}
"""Street sides of the road, by name; the first word is the side."""


def village_road(length: float = 150.0, seed: int = 3, section: str = "RQ9", **limits: Any) -> RoadParameters:
    """Return a curved country road with two street sides on its right, and one with bay and bus stop on its left."""
    scenario = RoadScenario.from_dict({"cross_section": section, "length": length, **NO_BAYS, **limits})
    data = json.loads(sample_road(scenario, seed).to_json())
    first = 1 + max(item["instance"] for item in data["objects"].values())
    ids = {item["side"]: name for name, item in data["objects"].items() if item["type"] == "Carriageway"}
    for number, (name, fields) in enumerate(STREETS.items(), first):
        street = {"type": "StreetSide", "instance": number, "carriageway": ids[name.partition("-")[0]]}
        data["objects"][f"street-{name}"] = street | fields
    return RoadParameters.from_dict(data)
