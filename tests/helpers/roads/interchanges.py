"""Motorways with an interchange, drawn or changed."""

from __future__ import annotations

from functools import cache
from typing import Any

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

LENGTH = 1300.0
"""Length of roads with a diamond, m: it needs 1150 to 1250 m."""
FORMS: dict[str, dict[str, Any]] = {
    "diamond": {"kind": "diamond"},
    "diamond-under": {"kind": "diamond", "crossing": "under"},
    "half-clover": {"kind": "half_clover"},
    "half-clover-under": {"kind": "half_clover", "crossing": "under"},
    "half-clover-entries": {"kind": "half_clover", "loops": "entries"},
    "half-clover-one-side": {"kind": "half_clover", "crossing": "under", "loops": "one_side"},
}
"""Fields of `road.interchange` by the name of a form."""


@cache
def interchange(form: str = "diamond", seed: int = 1, length: float | None = None) -> RoadParameters:
    """Return a drawn motorway with an interchange of a form."""
    usual = LENGTH if form.startswith("diamond") else LENGTH + 200.0
    return sample_road(RoadScenario(length=length or usual, interchange=FORMS[form]), seed)


def diamond(seed: int = 1, length: float = LENGTH) -> RoadParameters:
    """Return a drawn motorway with a diamond."""
    return interchange("diamond", seed, length)


def with_changed(road: RoadParameters, name: str, **fields: Any) -> RoadParameters:
    """Return a road with fields of one object changed, or with one more object."""
    data = road.to_dict()
    data["objects"][name] = {**data["objects"].get(name, {}), **fields}
    return RoadParameters.from_dict(data)
