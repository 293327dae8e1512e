"""Places where nothing stands: judged by the checker, which looks for overlaps by itself."""

from __future__ import annotations

import pytest

from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.placing.free_place import FreePlace, thing_at_free_place
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario

SMALL = ("TrafficSign", "Pole", "Cabinet", "Delineator", "KilometreBoard", "Shaft", "Building", "ParkedVehicle")


@pytest.fixture(scope="module")
def furnished() -> RoadParameters:
    """Return a sampled road of 300 m with all that the scenario puts onto it."""
    return sample_road(load_scenario("rq31-600m", ["road.length=300"]).road, 3)


def with_thing(road: RoadParameters, place: FreePlace, name: str) -> RoadParameters:
    data = road.to_dict()
    item = place.thing.model_copy(update={"instance": 900_000 + len(road.objects)})
    return RoadParameters.from_dict(data | {"objects": data["objects"] | {name: item.to_dict()}})


def overlaps(road: RoadParameters, name: str) -> list[str]:
    return [v.text for v in check(road) if v.rule == "object-overlap" and (v.object == name or name in v.text)]


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", SMALL)
def test_the_same_thing_again_is_put_behind_the_first(furnished: RoadParameters, kind: str, side: str) -> None:
    first = thing_at_free_place(RoadGeometry(furnished), kind, side, 120.0, {})  # type: ignore[arg-type]
    assert first.is_free
    road = with_thing(furnished, first, "first")
    assert overlaps(road, "first") == []
    again = thing_at_free_place(RoadGeometry(road), kind, side, first.thing.station, {})  # type: ignore[arg-type, attr-defined]
    assert (again.obstacle, again.is_free) == ("first", True)
    assert first.thing.station < again.thing.station <= first.thing.station + 50.0  # type: ignore[attr-defined]
    assert overlaps(with_thing(road, again, "second"), "second") == []


def test_where_nothing_stands_it_is_put_where_it_was_asked_for(furnished: RoadParameters) -> None:
    bare = furnished.model_copy(
        update={"objects": {k: v for k, v in furnished.objects.items() if not hasattr(v, "footprint")}}
    )
    for station in (0.0, 77.25, 300.0):
        place = thing_at_free_place(RoadGeometry(bare), "Pole", "right", station, {})
        assert (place.thing.station, place.obstacle, place.is_free) == (station, "", True)  # type: ignore[attr-defined]


def test_what_finds_no_place_stays_and_names_what_stands_there(furnished: RoadParameters) -> None:
    geometry = RoadGeometry(furnished)
    end = thing_at_free_place(geometry, "Pole", "right", 300.0, {})
    crowded = with_thing(furnished, end, "at-end")
    place = thing_at_free_place(RoadGeometry(crowded), "Pole", "right", 300.0, {})
    assert (place.obstacle, place.is_free, place.thing.station) == ("at-end", False, 300.0)  # type: ignore[attr-defined]
    first = thing_at_free_place(geometry, "Pole", "right", 120.0, {})
    near = with_thing(furnished, first, "near")
    asked = first.thing.station  # type: ignore[attr-defined]
    place = thing_at_free_place(RoadGeometry(near), "Pole", "right", asked, {}, farthest_move=0.05)
    assert (place.is_free, place.thing.station) == (False, asked)  # type: ignore[attr-defined]


def test_what_runs_along_the_road_is_not_moved(furnished: RoadParameters) -> None:
    fence = thing_at_free_place(RoadGeometry(furnished), "Fence", "left", 100.0, {})
    road = with_thing(furnished, fence, "fence")
    place = thing_at_free_place(RoadGeometry(road), "Fence", "left", 110.0, {})
    assert (place.obstacle, place.is_free, place.thing.start_station) == ("fence", False, 110.0)  # type: ignore[attr-defined]
