"""Villages on country roads: no rule broken, every layout fits, what stands where; and each breach is found."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking, Turnout
from synthroads_addon.road.side_roads.side_road import SideRoad
from synthroads_addon.road.streets.street_side import StreetSide
from synthroads_addon.road.terrain import ground_elevation
from synthroads_addon.road.things.building import Building
from synthroads_addon.road.things.bus_shelter import BusShelter
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.field_entrance import FieldEntrance
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.parked_vehicle import ParkedVehicle
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.traffic_island import TrafficIsland
from synthroads_addon.road.things.tree import Tree
from synthroads_addon.road.things.vehicles import VEHICLE_TYPES
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import load_scenario

SECTIONS = ("RQ11", "RQ9", "RQ10.5", "RQ9.5", "RQ7.5", "W5.5")
"""Cross-sections of roads that lead through villages."""
ALL = {"share": 1.0, "crossing": 1.0, "bus_stop": 1.0, "parking": 1.0, "gutters": 1.0, "islands": 1.0, "shelters": 1.0}


def village(
    section: str = "RQ10.5", seed: int = 1, length: float = 300.0, village_length: float | None = None, **limits: Any
) -> RoadParameters:
    if village_length is not None:
        limits["length"] = {"minimum": village_length, "maximum": village_length}
    scenario = {"cross_section": section, "length": length, "villages": {"share": 1.0} | limits}
    return sample_road(RoadScenario.from_dict(scenario), seed)


def full_village() -> RoadParameters:
    return village(**ALL, one_sided_islands=0.0, village_length=245.0)


@pytest.fixture(scope="module")
def full() -> RoadParameters:
    return full_village()


def changed(parameters: RoadParameters, edit: Callable[[dict[str, Any]], None]) -> RoadParameters:
    data = json.loads(parameters.to_json())
    edit(data["objects"])
    return RoadParameters.from_dict(data)


@pytest.mark.parametrize("section", SECTIONS)
def test_no_rule_is_broken(section: str) -> None:
    for seed in range(9):
        broken = check(village(section, 100 + seed, 250.0 + 60.0 * (seed % 4)))
        assert broken == [], (seed, broken)


def test_the_scenario_has_a_village_that_keeps_the_rules() -> None:
    scenario = load_scenario("village-300m")
    road = sample_road(scenario.road, scenario.seed)
    assert len(road.of_type(StreetSide)) == 2
    assert {sign.code for sign in road.of_type(TrafficSign).values()} >= {"310", "311", "350-10"}
    assert check(road) == []


def test_roads_without_a_village_are_as_before() -> None:
    scenario = {"cross_section": "RQ11", "length": 400.0}
    plain = sample_road(RoadScenario.from_dict(scenario), 5)
    assert not plain.of_type(StreetSide)
    assert plain == sample_road(
        RoadScenario.from_dict(scenario | {"villages": {"length": {"minimum": 60.0, "maximum": 60.0}}}), 5
    )


def test_a_road_with_a_village_has_no_bays() -> None:
    scenario: dict[str, Any] = {"cross_section": "RQ9", "length": 600.0, "turnouts": {"bus_bays": 0.9, "laybys": 0.9}}
    seeds = range(3)
    assert all(sample_road(RoadScenario.from_dict(scenario), seed).of_type(Turnout) for seed in seeds)
    for seed in seeds:
        road = sample_road(RoadScenario.from_dict(scenario | {"villages": {"share": 1.0}}), seed)
        assert road.of_type(StreetSide)
        assert not road.of_type(Turnout)
    for kind in ("bus_bays", "laybys"):
        both = scenario | {"villages": {"share": 1.0}, "turnouts": {kind: 1.0}}
        with pytest.raises(InputError, match=f"turnouts.{kind} is 1"):
            sample_road(RoadScenario.from_dict(both), 1)


def test_nothing_of_the_open_road_stands_in_a_village(full: RoadParameters) -> None:
    start, end = next((item.start_station, item.end_station) for item in full.of_type(StreetSide).values())
    for kind in (Delineator, Guardrail):
        for item in full.of_type(kind).values():
            first = getattr(item, "start_station", getattr(item, "station", 0.0))
            last = getattr(item, "end_station", first)
            assert last <= start or first >= end
    for line in full.of_type(LineMarking).values():
        inside = line.end_station > start + 0.01 and line.start_station < end - 0.01
        assert line.kind == "free" or not inside
        if inside and line.width < 0.2 and line.dash_length:
            assert (line.dash_length, line.gap_length) == (3.0, 6.0)


CROWDED = {
    "furniture": {"town_signs": 1.0, "entrances_per_km": {"minimum": 15.0, "maximum": 20.0}},
    "roadside": {"avenues": 1.0, "hedges_per_km": {"minimum": 4.0, "maximum": 8.0}},
    "side_roads": {"per_km": {"minimum": 6.0, "maximum": 8.0}},
    "turnouts": {"bus_bays": 0.9, "laybys": 0.9},
}
"""Limits of a road that has as much beside it as it can."""


@pytest.mark.parametrize("section", ["RQ11", "RQ7.5"])
def test_what_stands_beside_the_open_road_gives_way(section: str) -> None:
    scenario = {"cross_section": section, "length": 900.0, "villages": {"share": 1.0}, **CROWDED}
    kinds: set[type] = set()
    for seed in range(5):
        road = sample_road(RoadScenario.from_dict(scenario), seed)
        start, end = next((item.start_station, item.end_station) for item in road.of_type(StreetSide).values())
        kinds |= {type(item) for item in road.objects.values()}
        for mouth in RoadGeometry(road).mouths.values():
            assert mouth.high.start_station < start or mouth.low.start_station > end
        for item in road.of_type(FieldEntrance).values():
            reach = item.width / 2.0 + item.radius
            assert item.station + reach < start or item.station - reach > end
        for item in road.of_type(Tree).values():
            assert not start < item.station < end
        assert sorted(s.code for s in road.of_type(TrafficSign).values() if s.code in ("310", "311")) == (
            ["310", "310", "311", "311"]
        )
        assert check(road) == []
    assert kinds >= {SideRoad, FieldEntrance, Tree}
    assert Turnout not in kinds


def test_bays_give_way_to_a_village_alone() -> None:
    """A road without a village has the bays that it has where villages may be, seed by seed."""
    scenario = {"cross_section": "RQ11", "length": 400.0, "turnouts": {"bus_bays": 0.9, "laybys": 0.9}}
    roads = [
        [sample_road(RoadScenario.from_dict(scenario | {"villages": {"share": share}}), seed) for share in (0.0, 0.5)]
        for seed in range(8)
    ]
    assert any(plain.of_type(Turnout) and mixed.of_type(StreetSide) for plain, mixed in roads)
    for plain, mixed in roads:
        expected = {} if mixed.of_type(StreetSide) else plain.of_type(Turnout)
        assert mixed.of_type(Turnout) == expected


def test_kerbs_are_lowered_at_drives_and_the_crossing_and_raised_at_stops(full: RoadParameters) -> None:
    geometry = RoadGeometry(full)
    (crossing,) = {line.start_station + 2.0 for name, line in full.objects.items() if name == "crossing-1"}
    for street in full.of_type(StreetSide).values():
        section = geometry.sections[full.carriageway_of(street).side]
        for level in street.kerb_levels:
            lift = section.street_fields(np.array([level.station])).lifts["kerb_face"][0]
            rise = street.crossfall_percent / 100.0 * street.kerb_batter * level.height
            assert lift == pytest.approx(level.height + rise, abs=1e-9)
        heights = [level.height for level in street.kerb_levels]
        assert 0.18 in heights
        assert heights.count(0.03) >= 3
        assert any(level.station == pytest.approx(crossing) and level.height == 0.03 for level in street.kerb_levels)


def test_crossings_reach_from_kerb_to_kerb(full: RoadParameters) -> None:
    bars = [line for name, line in full.objects.items() if name.startswith("crossing-")]
    edges = {side: s.main_edge([bars[0].start_station])[0] for side, s in RoadGeometry(full).sections.items()}
    places = sorted(full.carriageway_of(line).sign * line.offset for line in bars if isinstance(line.offset, float))
    assert np.diff(places) == pytest.approx(1.0, abs=1e-6)
    assert {line.width for line in bars} == {0.5}
    assert {round(line.end_station - line.start_station, 6) for line in bars} == {4.0}
    assert places[0] - 0.25 + edges["right"] < 0.75
    assert edges["left"] - places[-1] - 0.25 < 0.75


def test_vehicles_stand_in_bays_and_lights_behind_footways(full: RoadParameters) -> None:
    geometry = RoadGeometry(full)
    stands = {name: item for name, item in full.of_type(ParkedVehicle).items() if name.startswith("stand-")}
    assert stands
    for item in stands.values():
        side = "left" if item.offset > 0.0 else "right"
        inner, outer = geometry.sections[side].boundaries_of("parking_bay", [item.station])
        half, distance = VEHICLE_TYPES[item.model].width / 2.0, abs(item.offset)
        assert inner[0] - 0.5 < distance - half
        assert distance + half < outer[0] + 0.1
    for pole in full.of_type(Pole).values():
        side = "left" if pole.offset > 0.0 else "right"
        assert abs(pole.offset) > geometry.sections[side].paved_edge([pole.station])[0] + 0.1


def test_houses_stand_on_level_ground_behind_the_footway(full: RoadParameters) -> None:
    geometry, terrain = RoadGeometry(full), full.terrain
    assert terrain is not None
    houses = full.of_type(Building).values()
    assert len(houses) > 8
    for house in houses:
        edge = np.abs(geometry.offsets([house.station])[0]).max()
        assert abs(house.offset) - house.depth / 2.0 > edge
        place = np.array([house.station]), np.array([house.offset])
        above = ground_elevation(geometry, terrain, *place) - geometry.profile.elevation(place[0])
        assert abs(above[0]) < 1.0


@pytest.mark.parametrize(
    ("scenario", "named"),
    [
        ({"cross_section": "RQ31", "villages": {"share": 0.5}}, "EKA1A leads through no village: 0 is allowed"),
        ({"cross_section": "RQ15.5", "villages": {"share": 0.5}}, "EKL1 leads through no village"),
        (
            {"cross_section": "RQ11", "villages": {"share": 0.5}, "turnouts": {"bus_bays": 1.0}},
            "turnouts.bus_bays is 1: a road through a village has no bays, make one of the two 0",
        ),
        (
            {
                "cross_section": "RQ11",
                "villages": {"share": 1.0},
                "turnouts": {"places": [{"kind": "exit", "side": "right", "station": 50.0}]},
            },
            "EKL3 has no exits, entries and bays: 0 places are allowed",
        ),
        ({"cross_section": "RQ11", "length": 80.0, "villages": {"share": 1.0}}, "100 m are needed"),
        ({"cross_section": "RQ11", "half_width": 10.0, "villages": {"share": 1.0}}, "a village needs"),
        (
            {"cross_section": "RQ11", "villages": {"kerb_height": {"minimum": 0.5, "maximum": 0.5}}},
            "road.villages.kerb_height",
        ),
    ],
)
def test_limits_that_no_village_keeps_are_refused(scenario: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        sample_road(RoadScenario.from_dict(scenario), 1)


# --- islands and shelters ------------------------------------------------------------------------------------------


def with_islands(seed: int = 1, one_sided: float = 0.0, section: str = "RQ10.5", **limits: Any) -> RoadParameters:
    limits = {"islands": 1.0, "one_sided_islands": one_sided} | limits
    return village(section, seed, 450.0, 380.0, **limits)


@pytest.mark.parametrize("section", ["RQ11", "RQ9.5", "RQ7.5"])
@pytest.mark.parametrize("one_sided", [0.0, 1.0])
def test_islands_keep_the_rules_and_have_two_signs(section: str, one_sided: float) -> None:
    for seed in range(4):
        road = with_islands(seed, one_sided, section, shelters=1.0, bus_stop=1.0, crossing=1.0, slow=1.0)
        islands = road.of_type(TrafficIsland)
        assert islands
        assert len([sign for sign in road.of_type(TrafficSign).values() if sign.code == "222-20"]) == 2 * len(islands)
        assert check(road) == []


@pytest.mark.parametrize("one_sided", [0.0, 1.0])
def test_lanes_keep_their_width_beside_islands_and_move_by_what_these_take(one_sided: float) -> None:
    road = with_islands(2, one_sided)
    geometry, usual = RoadGeometry(road), RoadGeometry(with_islands(2, one_sided, islands=0.0))
    islands = sorted(road.of_type(TrafficIsland).values(), key=lambda item: item.station)
    assert len(islands) == 2
    for number, island in enumerate(islands):
        moved = {}
        for side, section in geometry.sections.items():
            lane, usual_lane = (s.lane_boundaries([island.station])[0] for s in (section, usual.sections[side]))
            assert np.ptp(lane) == pytest.approx(np.ptp(usual_lane))
            moved[side] = float(lane[-1] - usual_lane[-1])
            reach = (1.0 if side == "left" else -1.0) * island.offset + island.width / 2.0
            assert float(lane[-1]) - reach == pytest.approx(0.25, abs=1e-6)
        assert sum(moved.values()) == pytest.approx(island.width + 0.5)
        # Traffic leads in on the right at the beginning, on the left at the end.
        leading_in = "left" if number else "right"
        assert moved[leading_in] == pytest.approx((island.width + 0.5) * (1.0 if one_sided else 0.5))
    ends = geometry.sections["right"].lane_boundaries([0.0, road.alignment.length])
    assert ends[:, -1] == pytest.approx(0.0)


def test_lines_lead_past_an_island_and_the_middle_one_ends_before_it() -> None:
    road = with_islands()
    lines = road.of_type(LineMarking)
    for number in (1, 2):
        sides = [lines[f"island-{number}-line-{side}"] for side in ("left", "right")]
        (start,), (end,) = ({getattr(line, name) for line in sides} for name in ("start_station", "end_station"))
        for name, line in lines.items():
            is_middle = name.startswith("centre-line")
            assert not (is_middle and line.start_station < end - 0.01 and line.end_station > start + 0.01)
        assert any(name.startswith(f"island-{number}-stripe") for name in lines)


def test_short_villages_and_narrow_lanes_have_no_islands() -> None:
    assert not village("RQ9", 1, 450.0, islands=1.0).of_type(TrafficIsland)
    assert not village("RQ10.5", 1, 450.0, 120.0, islands=1.0).of_type(TrafficIsland)


def test_shelters_stand_behind_the_footway_at_stops_and_open_to_the_road() -> None:
    road = village(bus_stop=1.0, shelters=1.0, seed=4)
    geometry = RoadGeometry(road)
    shelters = road.of_type(BusShelter)
    assert len(shelters) == 2
    for item in shelters.values():
        side = "left" if item.offset > 0.0 else "right"
        back = geometry.sections[side].paved_edge([item.station])[0]
        assert back < abs(item.offset) - item.depth / 2.0 < back + 0.5
        stop = next(
            sign
            for sign in road.of_type(TrafficSign).values()
            if sign.code == "224" and (sign.offset > 0.0) == (item.offset > 0.0)
        )
        assert abs(stop.station - item.station) < 10.0
        # Its front, where bodies have a negative y, looks at the axis.
        assert item.rotation_deg == (90.0 if item.offset > 0.0 else -90.0)


# --- planted breaches ----------------------------------------------------------------------------------------------


def _narrow_bay(objects: dict[str, Any]) -> None:
    street = next(item for item in objects.values() if item["type"] == "StreetSide" and item["bays"])
    street["bays"][0]["width"] = 1.9


def _without_footway(objects: dict[str, Any]) -> None:
    del objects["street-left-1"]


def _two_lanes(objects: dict[str, Any]) -> None:
    lane = objects["carriageway-left"]["lanes"][0]
    objects["carriageway-left"]["lanes"] = [lane, lane]


def _faster(objects: dict[str, Any]) -> None:
    sign = next(item for name, item in objects.items() if item.get("code") == "350-10" and item["rotation_deg"] == 0.0)
    number = 1 + max(item["instance"] for item in objects.values())
    objects["faster"] = sign | {"instance": number, "code": "274-70", "station": sign["station"] - 20.0}


def _dark(objects: dict[str, Any]) -> None:
    for name in [name for name in objects if name.startswith("street-light-")]:
        del objects[name]


def _narrow_street(objects: dict[str, Any]) -> None:
    for name in ("carriageway-left", "carriageway-right"):
        objects[name]["lanes"][0]["width"] = 2.75


def _island_in_the_lane(objects: dict[str, Any]) -> None:
    objects["island-1"]["offset"] += 0.4


def _island_without_sign(objects: dict[str, Any]) -> None:
    del objects["island-1-sign-2"]


BREACHES: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "parking-width": (_narrow_bay, "1.90 m wide; 2.00 m are needed (RASt: RASt 06 and EAR 23"),
    "crossing-footways": (_without_footway, "a footway on 1 of 2 sides (R-FGUE"),
    "crossing-lanes": (_two_lanes, "leads over 2 lanes of one direction"),
    "crossing-speed": (_faster, "70 km/h; 50 are allowed"),
    "crossing-light": (_dark, "which has to be lit"),
    "island-lane": (_island_in_the_lane, "The island reaches 0.15 m into a lane."),
    "island-sign": (_island_without_sign, "No sign 222-20 on the island faces the traffic of carriageway-left (StVO"),
    "bus-carriageway": (_narrow_street, "6.00 m wide; 6.50 m are needed (RASt: textbook"),
}
"""Rule -> what breaks it in the full village, and part of the sentence that names the source and how sure it is."""


@pytest.fixture(scope="module")
def high() -> RoadParameters:
    """Return a road on an embankment that needs barriers, with a village."""
    limits = {"cross_section": "RQ11", "length": 800.0, "villages": {"share": 1.0}}
    return sample_road(RoadScenario.from_dict(limits | {"embankment_height": {"minimum": 4.0, "maximum": 5.0}}), 2)


@pytest.mark.parametrize(("distance", "missing"), [(5.0, 0.0), (4.0, 0.0), (5.5, 0.5), (9.0, 4.0)])
def test_barriers_of_embankments_end_up_to_five_metres_beside_a_village(
    distance: float, missing: float, high: RoadParameters
) -> None:
    street = next(iter(high.of_type(StreetSide).values()))
    rails = {name: item for name, item in high.of_type(Guardrail).items() if item.offset > 0.0}
    before = max(rails, key=lambda n: (rails[n].end_station <= street.start_station, rails[n].end_station))
    behind = min(rails, key=lambda n: (rails[n].start_station < street.end_station, rails[n].start_station))
    assert rails[before].end_station == pytest.approx(street.start_station - 5.0)

    def move_ends(objects: dict[str, Any]) -> None:
        objects[before]["end_station"] = street.start_station - distance
        objects[behind]["start_station"] = street.end_station + distance

    found = [item for item in check(changed(high, move_ends)) if item.rule == "embankment-barrier"]
    assert [item.value for item in found] == pytest.approx([missing] * 2 if missing else [], abs=0.01)


def broken_village(rule: str) -> RoadParameters:
    """Return the full village with the planted breach of a rule."""
    return changed(full_village(), BREACHES[rule][0])


@pytest.mark.parametrize("rule", BREACHES)
def test_each_breach_is_found(rule: str, full: RoadParameters) -> None:
    edit, sentence = BREACHES[rule]
    assert not [found for found in check(full) if found.rule == rule]
    found = [item for item in check(changed(full, edit)) if item.rule == rule]
    assert found
    assert sentence in found[0].text


def test_no_barrier_is_missing_where_the_ground_is_level(high: RoadParameters) -> None:
    """A road on a high embankment comes down to its village; elsewhere a missing barrier is still found."""
    road = high
    assert check(road) == []
    bare = changed(road, lambda objects: [objects.pop(n) for n in list(objects) if n.startswith("guardrail-left")])
    found = [item for item in check(bare) if item.rule == "embankment-barrier"]
    street = next(iter(road.of_type(StreetSide).values()))
    assert found
    for item in found:
        assert item.station + item.value <= street.start_station or item.station >= street.end_station
