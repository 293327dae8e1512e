"""Motorways with an interchange, drawn or changed."""

from __future__ import annotations

from functools import cache
from typing import Any

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

LENGTH = 1300.0
"""Length of the roads, m: an interchange needs 1150 to 1250 m."""


@cache
def diamond(seed: int = 1, length: float = LENGTH) -> RoadParameters:
    """Return a drawn motorway with a diamond."""
    return sample_road(RoadScenario(length=length, interchange={"kind": "diamond"}), seed)


def with_changed(road: RoadParameters, name: str, **fields: Any) -> RoadParameters:
    """Return a road with fields of one object changed, or with one more object."""
    data = road.to_dict()
    data["objects"][name] = {**data["objects"].get(name, {}), **fields}
    return RoadParameters.from_dict(data)
