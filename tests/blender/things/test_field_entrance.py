"""No grass grows through the tracks of field entrances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.things.field_entrance import FieldEntrance
from tests.helpers.roads.thing_variants import straight_road
from tests.helpers.scenes.furnished_road import FurnishedRoad

GRASS: dict[str, Any] = {"type": "Vegetation", "kind": "grass", "species": "meadow", "density": 0.4, "seed": 1} | {
    "band_start": 0.0,
    "band_end": 30.0,
    "height_min": 0.1,
    "height_max": 0.4,
}
ENTRANCE: dict[str, Any] = {"type": "FieldEntrance", "station": 150.0, "offset": -15.5, "rotation_deg": 0.0}


def tufts_on_the_track(things: dict[str, Any]) -> int:
    """Return the number of grass's triangles with their middle on the entrance's track."""
    road = FurnishedRoad(straight_road({"grass": GRASS, **things}), ["field_entrances", "vegetation"], detail=1.0)
    mesh = road.mesh("grass")
    middles = mesh.vertices[mesh.triangles].mean(axis=1)
    station, offset = road.located(middles)
    item = FieldEntrance.from_dict({"instance": 1, **ENTRANCE})
    is_on_track = (np.abs(station - item.station) < item.width / 2.0 - 0.01) & (offset < item.offset - 0.01)
    assert len(middles) > 1000
    return int(np.count_nonzero(is_on_track & (offset > item.offset - item.depth + 0.01)))


@pytest.mark.keep_scene
def test_grass_grows_beside_an_entrance_and_not_on_it() -> None:
    assert tufts_on_the_track({}) > 20
    assert tufts_on_the_track({"entrance": ENTRANCE}) == 0
