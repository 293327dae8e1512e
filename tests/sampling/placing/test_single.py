"""One thing more beside a road: where the rules have it, whatever it is, and with what its model requires."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import LIMITS
from synthroads_addon.road.objects import LineObject, Side
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.things.field_entrance import FieldEntrance
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.sampling.placing.free_place import StandingBoxes
from synthroads_addon.sampling.placing.single import thing_by_rule
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import load_scenario

ACROSS = {"Gantry", "Overpass", "PowerLine", "TrafficIsland"}
"""Things that stand on both sides, or between them."""
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


@pytest.fixture(scope="module", params=["right", "left"])
def country(request: pytest.FixtureRequest) -> RoadGeometry:
    """A country road in a curve with ditches and nothing on it: of traffic on the right, and on the left."""
    limits = {"embankment_height": {"minimum": 0.6, "maximum": 0.6}, "ditch_width": {"minimum": 2.0, "maximum": 2.0}}
    scenario = RoadScenario.from_dict(limits | {"design_class": "EKL3", "traffic_side": request.param, "length": 300.0})
    elements = (HorizontalElement.between(300.0, 1 / 600, 1 / 600),)
    points = (VerticalPoint(station=0.0, elevation=0.0, radius=0.0),)
    place = {"start_x": 0.0, "start_y": 0.0, "start_heading_deg": 0.0}
    axis = AlignmentObject(instance=1, horizontal=elements, vertical=points, **place)
    road = sample_road(scenario, 4, axis=axis)
    kept = {name: item for name, item in road.objects.items() if not isinstance(item, tuple(THINGS.values()))}
    return RoadGeometry(road.model_copy(update={"objects": kept}))


def with_thing(geometry: RoadGeometry, kind: str, side: Side, **fields: object) -> RoadParameters:
    item = thing_by_rule(geometry, kind, side, 120.0, fields).model_copy(update={"instance": 900_000})
    data = geometry.parameters.to_dict()
    return RoadParameters.from_dict(data | {"objects": data["objects"] | {"new": item.to_dict()}})


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", [kind for kind in THINGS if kind != "FieldEntrance"])
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


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_entrance_joins_the_edge_of_a_country_road(country: RoadGeometry, side: Side) -> None:
    road = with_thing(country, "FieldEntrance", side)
    item = road.objects["new"]
    assert isinstance(item, FieldEntrance)
    assert (item.offset > 0.0) == (side == "left") == (item.rotation_deg == 180.0)
    # The left curve's edges are bent as the road is: to the entrance on its inner side, away from it on the outer one.
    bend = 1.0 / (600.0 - item.offset)
    assert item.curvature == pytest.approx(-bend if side == "left" else bend, rel=1e-6)
    known = {(v.rule, v.object) for v in check(country.parameters)}
    assert [v.text for v in check(road) if (v.rule, v.object) not in known] == []


@pytest.mark.parametrize("country", ["right"], indirect=True)
def test_an_entrance_has_a_pipe_where_it_crosses_a_ditch(country: RoadGeometry) -> None:
    pipes = {
        station: thing_by_rule(country, "FieldEntrance", "right", station, {"depth": 20.0}).pipe_diameter
        for station in (60.0, 120.0, 180.0)
    }
    assert max(pipes.values()) > 0.0
    assert max(pipes.values()) <= 0.4
    given = thing_by_rule(country, "FieldEntrance", "right", 120.0, {"depth": 20.0, "pipe_diameter": 0.0})
    assert given.pipe_diameter == 0.0
    level = country.parameters.objects["terrain"].model_copy(update={"ditch_width": 0.0, "undulation": 0.0})
    objects = country.parameters.objects | {"terrain": level}
    even = RoadGeometry(country.parameters.model_copy(update={"objects": objects}))
    assert thing_by_rule(even, "FieldEntrance", "right", 120.0, {"depth": 20.0}).pipe_diameter == 0.0


def test_an_entrance_to_a_motorway_is_placed_and_reported(bare: RoadGeometry) -> None:
    found = [v.text for v in check(with_thing(bare, "FieldEntrance", "right")) if v.object == "new"]
    assert found == ["A road of this class has no entrances to fields (RAA, EKA 1A)."]


def test_a_tree_stands_where_it_needs_no_barrier_or_behind_one(bare: RoadGeometry) -> None:
    edge = bare.sections["right"].paved_edge(np.array([120.0]))[0]
    free, stock = (thing_by_rule(bare, "Tree", "right", 120.0, {"stock": stock}) for stock in (False, True))
    limit = LIMITS[bare.parameters.design_class].obstacle_distance
    assert -free.offset - free.trunk_diameter / 2.0 - edge == pytest.approx(limit, abs=0.02)
    assert -stock.offset < edge + 3.0
    behind = thing_by_rule(RoadGeometry(with_thing(bare, "Guardrail", "right")), "Tree", "right", 130.0, {})
    assert edge + 1.25 < -behind.offset < edge + 3.0
    narrow = bare.parameters.terrain.model_copy(update={"half_width": edge + 10.0})
    objects = bare.parameters.objects | {"terrain": narrow}
    near = thing_by_rule(
        RoadGeometry(bare.parameters.model_copy(update={"objects": objects})), "Tree", "right", 120.0, {}
    )
    assert -near.offset < edge + 10.0


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
        thing_by_rule(bare, "Pole", "right", 50.0, {"offset": 1500.0})


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_gantry_has_no_post_where_a_barrier_stands_in_the_median(bare: RoadGeometry, side: Side) -> None:
    free = thing_by_rule(bare, "Gantry", side, 120.0, {})
    rail = thing_by_rule(bare, "Guardrail", "right", 100.0, {"offset": 0.0}).model_copy(update={"instance": 900_000})
    objects = bare.parameters.to_dict()["objects"] | {"rail": rail.to_dict()}
    railed = RoadGeometry(RoadParameters.from_dict(bare.parameters.to_dict() | {"objects": objects}))
    behind, before = (thing_by_rule(railed, "Gantry", side, station, {}) for station in (120.0, 90.0))
    assert isinstance(free, Gantry)
    assert isinstance(behind, Gantry)
    assert (free.kind, behind.kind, before) == ("one_sided", "cantilever", free.model_copy(update={"station": 90.0}))
    assert behind.post_side == side
    outer, inner = behind.post_offsets()[0], behind.left_offset if side == "right" else behind.right_offset
    lanes = railed.sections[side].lane_boundaries(120.0)[0]
    assert abs(inner) == pytest.approx(lanes[2])
    assert abs(outer) > lanes[0]
    assert behind.offset == pytest.approx((behind.left_offset + behind.right_offset) / 2.0)
    assert StandingBoxes(objects=railed.parameters.objects).obstacle(behind) == ("", 0.0)
    assert StandingBoxes(objects=railed.parameters.objects).obstacle(free)[0] == "rail"
