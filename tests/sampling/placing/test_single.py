"""One thing more beside a road: where the rules have it, whatever it is, and with what its model requires."""

from __future__ import annotations

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import LineObject, Side
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.sampling.placing.single import thing_by_rule
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario

ACROSS = {"Gantry", "Overpass", "PowerLine"}
"""Things that stand on both sides."""
NEEDS_MORE = {"ConstructionBeacon", "TemporaryBarrier", "Guardrail", "ConcreteBarrier", "Gantry", "Overpass"}
NEEDS_MORE |= {"NoiseBarrier", "Pole", "Delineator"}
"""Things for which the rules ask for more than them alone: a barrier before them, a line of posts, a whole zone."""


@pytest.fixture(scope="module")
def bare() -> RoadGeometry:
    """A road with nothing on it, in cutting, so that no barrier is needed."""
    scenario = load_scenario(
        "rq31-600m", ["road.length=300", "road.embankment_height.minimum=-1", "road.embankment_height.maximum=-1"]
    )
    road = sample_road(scenario.road, 4)
    kept = {name: item for name, item in road.objects.items() if not isinstance(item, tuple(THINGS.values()))}
    return RoadGeometry(road.model_copy(update={"objects": kept}))


def with_thing(geometry: RoadGeometry, kind: str, side: Side, **fields: object) -> RoadParameters:
    item = thing_by_rule(geometry, kind, side, 120.0, fields).model_copy(update={"instance": 900_000})
    data = geometry.parameters.to_dict()
    return RoadParameters.from_dict(data | {"objects": data["objects"] | {"new": item.to_dict()}})


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", THINGS)
def test_it_stands_on_its_side_and_breaks_no_rule(bare: RoadGeometry, kind: str, side: Side) -> None:
    road = with_thing(bare, kind, side)
    item = road.objects["new"]
    where = item.start_station if isinstance(item, LineObject) else item.station
    assert where == 120.0
    if kind not in ACROSS:
        assert (item.offset > 0.0) == (side == "left")
    if kind not in NEEDS_MORE:
        known = {(v.rule, v.object) for v in check(bare.parameters)}
        assert [v.text for v in check(road) if (v.rule, v.object) not in known] == []


@pytest.mark.parametrize("kind", ["TrafficSign", "Pole", "Cabinet", "Delineator", "KilometreBoard"])
def test_it_stands_behind_a_barrier_that_is_there(bare: RoadGeometry, kind: str) -> None:
    road = with_thing(bare, "Guardrail", "right")
    rail = road.objects["new"]
    free, behind = (thing_by_rule(geometry, kind, "right", 130.0, {}).offset for geometry in (bare, RoadGeometry(road)))
    assert behind < rail.offset
    assert behind <= free


def test_given_fields_replace_the_usual_ones(bare: RoadGeometry) -> None:
    item = thing_by_rule(bare, "TrafficSign", "right", 50.0, {"code": "449", "text": ("A", "B"), "offset": -20.0})
    assert (item.code, item.text, item.offset, item.rotation_deg) == ("449", ("A", "B"), -20.0, 0.0)
    hedge = thing_by_rule(bare, "Hedge", "left", 290.0, {})
    assert hedge.end_station == bare.length


def test_a_field_out_of_its_limits_is_refused(bare: RoadGeometry) -> None:
    with pytest.raises(InputError, match="offset"):
        thing_by_rule(bare, "Pole", "right", 50.0, {"offset": 500.0})
