"""Exits, entries and bays that a scenario states at stations."""

from __future__ import annotations

from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.section import Turnout
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

LENGTH = 1500.0


def stated_road(places: list[dict[str, Any]], seed: int = 7, **values: Any) -> dict[str, Turnout]:
    """Return the turnouts of a road with stated places, which keeps all rules."""
    road = sample_road(RoadScenario(length=LENGTH, turnouts={"places": places} | values), seed)
    assert check(road) == []
    return road.of_type(Turnout)


def test_turnouts_are_where_they_are_stated_and_no_others_are_on_that_side() -> None:
    places = [
        {"kind": "exit", "side": "left", "station": 700.0},
        {"kind": "entry", "side": "left", "station": 200.0, "lane_length": 260.0},
    ]
    chances = {"exits": 1.0, "entries": 1.0, "emergency_bays": 0.0}
    turnouts = stated_road(places, **chances)
    left = {name: item.start_station for name, item in turnouts.items() if item.carriageway.endswith("left")}
    assert left == {"exit-left": 700.0, "entry-left": 200.0}
    assert turnouts["entry-left"].lane_length == 260.0
    assert {item.kind for item in turnouts.values() if item.carriageway.endswith("right")} == {"exit", "entry"}


def test_two_of_a_kind_get_numbers_and_unstated_sizes_are_the_least() -> None:
    places = [{"kind": "emergency_bay", "station": station} for station in (200.0, 400.0)]
    turnouts = stated_road(places, exits=0.0, entries=0.0)
    bays = [turnouts[name] for name in ("emergency-bay-right", "emergency-bay-right-2")]
    assert [bay.start_station for bay in bays] == [200.0, 400.0]
    assert {(bay.taper_in_length, bay.lane_length, bay.lane_width) for bay in bays} == {(20.0, 40.0, 3.0)}


def test_roads_without_places_are_as_before() -> None:
    scenario = RoadScenario(length=LENGTH)
    assert scenario.turnouts.places == ()
    assert sample_road(scenario, 3) == sample_road(RoadScenario(length=LENGTH, turnouts={"places": []}), 3)


@pytest.mark.parametrize(
    ("places", "reason"),
    [
        ([{"kind": "exit", "station": 1400.0}], "choose a station from 0 to 1105 m"),
        ([{"kind": "exit", "station": 700.0}, {"kind": "entry", "station": 400.0}], "less than 20 m from places.0."),
        ([{"kind": "exit", "station": 100.0, "lane_length": 30.0}], "lane's length is 30 m: 250 m are needed"),
        ([{"kind": "emergency_bay", "station": 100.0, "lane_width": 2.5}], "width is 2.5 m: 3 m are needed"),
        ([{"kind": "exit", "station": 0.0}, {"kind": "exit", "station": 600.0}], "are needed between two of a kind"),
    ],
)
def test_places_without_room_are_refused_in_one_line(places: list[dict[str, Any]], reason: str) -> None:
    with pytest.raises(InputError, match=reason) as error:
        stated_road(places)
    assert "road.turnouts.places[" in str(error.value)
    assert "\n" not in str(error.value)
