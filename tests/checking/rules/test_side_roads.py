"""Rules for side roads: drawn ones keep them, and each planted breach is found."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.checking.rules.rule import Road
from synthroads_addon.checking.rules.side_roads import RULES, mouth_spans
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.side_roads import changed, drawn, with_side_road

SECTIONS = ("RQ11.5+", "RQ11", "RQ10.5", "RQ9.5", "RQ9", "RQ7.5", "W5.5")


@pytest.mark.parametrize("section", SECTIONS)
def test_drawn_side_roads_break_no_rule(section: str) -> None:
    for seed in range(4):
        road = drawn(section, seed, 900.0)
        assert check(road) == []


def test_motorway_class_roads_have_none() -> None:
    for fields in ({"cross_section": "RQ15.5"}, {"cross_section": "RQ31"}):
        scenario = RoadScenario.from_dict({**fields, "side_roads": {"per_km": {"minimum": 1.0, "maximum": 2.0}}})
        with pytest.raises(InputError, match="side_roads"):
            sample_road(scenario, 1)


def _second(**fields: object) -> RoadParameters:
    """Return a road with a second side road 30 m behind the first."""
    road = with_side_road()
    first = road.objects["side-road-1"].to_dict()
    number = max(item.instance for item in road.objects.values()) + 1
    return changed(road, "side-road-2", **{**first, "instance": number, "station": 170.0, **fields})


def test_a_mouth_beside_a_bay_is_found() -> None:
    road = with_side_road()
    fields = {"type": "Turnout", "instance": 9999, "carriageway": "carriageway-right", "kind": "bus_bay"}
    lengths = {"taper_in_length": 15.0, "lane_length": 20.0, "taper_out_length": 15.0, "lane_width": 3.0}
    for start, is_breach in ((150.0, True), (200.0, False)):
        beside = changed(road, "bus-bay", **fields, **lengths, start_station=start)
        found = [item.object for item in check(beside) if item.rule == "side-road-room"]
        assert found == (["side-road-1"] if is_breach else [])


BREACHES: dict[str, Callable[[], RoadParameters]] = {
    "side-road-grade": lambda: with_side_road("RQ15.5"),
    "side-road-line-narrow": lambda: with_side_road(lane_width=2.7),
    "side-road-room": _second,
    "mouth-sign": lambda: without(drawn(tracks=0.0, stop_lines=0.0, per_km=5.0, length=600.0), "205"),
    "object-on-side-road": lambda: changed(
        with_side_road(), "pole", type="Pole", instance=9999, station=150.3, offset=-20.0, kind="lighting", height=4.0
    ),
}


def test_every_rule_has_a_planted_breach() -> None:
    assert set(BREACHES) == {rule.id for rule in RULES}


@pytest.mark.parametrize("rule", BREACHES)
def test_a_planted_breach_is_found(rule: str) -> None:
    found = [violation for violation in check(BREACHES[rule]()) if violation.rule == rule]
    assert len(found) == 1
    if rule != "mouth-sign":
        assert found[0].station == pytest.approx(150.0, abs=30.0)
    sound = {violation.rule for violation in check(with_side_road(priority="none"))}
    assert rule not in sound


@pytest.mark.parametrize(("distance", "missing"), [(2.9, 0.0), (3.4, 0.4)])
def test_barriers_of_embankments_end_up_to_three_metres_beside_a_mouth(distance: float, missing: float) -> None:
    plain = with_side_road()
    ((start, end),) = mouth_spans(Road(plain), "carriageway-right")
    low, high = RoadGeometry(plain).mouths["side-road-1"].low, RoadGeometry(plain).mouths["side-road-1"].high
    assert (start, end) == pytest.approx((low.start_station, high.start_station), abs=0.5)
    rail = {"type": "Guardrail", "offset": -6.0, "faces": "left"}
    spans = {"low": (0.0, start - distance), "high": (end + distance, plain.alignment.length)}
    road = changed(plain, "terrain", **plain.objects["terrain"].to_dict() | {"embankment_height": 5.0})
    for number, (name, (first, last)) in enumerate(spans.items(), 9001):
        road = changed(road, name, **rail, instance=number, start_station=first, end_station=last)
    found = [item for item in check(road) if item.rule == "embankment-barrier" and item.object == "carriageway-right"]
    assert [item.value for item in found] == pytest.approx([missing] * 2 if missing else [], abs=0.01)


def without(road: RoadParameters, code: str) -> RoadParameters:
    """Return a road without the first of its signs with a code."""
    data = json.loads(road.to_json())
    name = next(n for n, item in data["objects"].items() if item.get("code") == code)
    del data["objects"][name]
    return RoadParameters.from_dict(data)


def test_a_sign_counts_where_it_faces_those_who_come() -> None:
    road = drawn(tracks=0.0, stop_lines=0.0, per_km=5.0, length=600.0)
    name = next(n for n, sign in road.of_type(TrafficSign).items() if sign.code == "205")
    sign = road.objects[name]
    assert check(road) == []
    for fields in (
        {"rotation_deg": sign.rotation_deg + 90.0},
        {"station": sign.station + 40.0},
        {"code": "206"},
    ):
        rules = {item.rule for item in check(changed(road, name, **fields))}
        assert "mouth-sign" in rules


def test_priority_roads_have_their_sign_behind_each_mouth() -> None:
    road = drawn(tracks=0.0, per_km=4.0, length=600.0)
    mouths = RoadGeometry(road).mouths.values()
    places = [s.station for s in road.of_type(TrafficSign).values() if s.code == "306"]
    assert places
    for mouth in mouths:
        assert any(mouth.high.start_station < place < mouth.high.start_station + 60.0 for place in places)
        assert any(mouth.low.start_station - 60.0 < place < mouth.low.start_station for place in places)
