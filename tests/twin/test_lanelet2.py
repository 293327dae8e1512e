"""Lanelet2's map, read as plain XML: shared lines, shared ends, and the lanelets that the report names."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.twin.formats import write_twin
from synthroads_addon.twin.speeds import SpeedLimits
from tests.helpers.roads.twin_roads import road


def test_lanes_share_lines_and_ends_and_are_in_the_report(tmp_path: Path) -> None:
    parameters = road(7, length=600.0)
    write_twin(parameters, tmp_path, ["lanelet2"])
    root = ElementTree.parse(tmp_path / "twin.osm").getroot()
    ways = {way.get("id"): [node.get("ref") for node in way.findall("nd")] for way in root.findall("way")}
    kinds = {way.get("id"): {tag.get("k"): tag.get("v") for tag in way.findall("tag")} for way in root.findall("way")}
    lanelets = {}
    for relation in root.findall("relation[member]"):
        sides = {member.get("role"): member.get("ref") for member in relation.findall("member")}
        tags = {tag.get("k"): tag.get("v") for tag in relation.findall("tag")}
        lanelets[relation.get("id")] = (sides["left"], sides["right"], tags)
    numbers = [node.get("id") for node in root.findall("node")] + list(ways) + list(lanelets)
    assert len(set(numbers)) == len(numbers)
    by_name: dict[str, list[str]] = {}
    for number, (_, _, tags) in lanelets.items():
        by_name.setdefault(tags["synthroads_id"], []).append(number)
    for name, item in parameters.of_type(Carriageway).items():
        for lane in range(len(item.lanes) - 1):
            for outer, inner in zip(by_name[f"{name}/lane-{lane}"], by_name[f"{name}/lane-{lane + 1}"], strict=True):
                assert lanelets[outer][0] == lanelets[inner][1]  # the line between them: left of the outer one
                assert kinds[lanelets[outer][0]]["subtype"] == "dashed"
        pieces = by_name[f"{name}/lane-0"]
        for before, behind in zip(pieces[:: item.traffic], pieces[:: item.traffic][1:], strict=False):
            for side in (0, 1):
                assert ways[lanelets[before][side]][-1] == ways[lanelets[behind][side]][0]
    report = json.loads((tmp_path / "twin-lanelet2-report.json").read_text())
    for row in report["instances"]:
        for entity in row["entities"]:
            assert lanelets[str(entity["lanelet"])][2]["synthroads_instance"] == str(row["instance"])
    assert {row["id"] for row in report["instances"]} >= set(parameters.of_type(Carriageway))


def lanes_of(path: Path) -> list[dict[str, str]]:
    """Return the tags of all lanelets of a map, with their lines (``left``, ``right``) and ``limit``."""
    root = ElementTree.parse(path).getroot()
    relations = {relation.get("id"): relation for relation in root.findall("relation")}
    found = []
    for relation in root.findall("relation[member]"):
        members = {member.get("role"): str(member.get("ref")) for member in relation.findall("member")}
        tags = {str(tag.get("k")): str(tag.get("v")) for tag in relation.findall("tag")} | members
        if limit := members.pop("regulatory_element", None):
            tags["limit"] = str(relations[limit].find("tag[@k='sign_type']").get("v"))  # type: ignore[union-attr]
        found.append(tags)
    return found


def village() -> RoadParameters:
    scenario = load_scenario("village-300m")
    return sample_road(scenario.road, scenario.seed)


def test_lanes_of_a_village_share_the_line_between_the_directions(tmp_path: Path) -> None:
    parameters = village()
    write_twin(parameters, tmp_path, ["lanelet2"])
    lanes = lanes_of(tmp_path / "twin.osm")
    by_line: dict[str, list[str]] = {}
    for lane in lanes:
        assert (lane["subtype"], lane["one_way"]) == ("road", "yes")
        by_line.setdefault(lane["left"], []).append(lane["synthroads_id"])
    assert len(by_line) == len(lanes) / 2
    assert {tuple(sorted(names)) for names in by_line.values()} == {
        ("carriageway-left/lane-0", "carriageway-right/lane-0")
    }
    root = ElementTree.parse(tmp_path / "twin.osm").getroot()
    lines = {way.get("id"): {tag.get("k"): tag.get("v") for tag in way.findall("tag")} for way in root.findall("way")}
    between = [lines[number] for number in by_line]
    assert {tags["subtype"] for tags in between} == {"solid", "dashed"}
    assert all(tags["synthroads_id"].startswith("centre-line") for tags in between)


def test_limits_and_towns_are_those_of_the_signs(tmp_path: Path) -> None:
    """In the town 50 km/h are the rule, outside 100 km/h: neither needs a limit of its own. Here 30 stands in it."""
    parameters = village()
    objects = dict(parameters.objects)
    town = next(
        item
        for item in objects.values()
        if isinstance(item, TrafficSign) and item.code == "310" and not item.rotation_deg
    )
    number = max(item.instance for item in objects.values()) + 100
    station = town.station + 60.0
    objects["limit"] = town.model_copy(update={"instance": number, "code": "274-30", "station": station})
    changed = parameters.model_copy(update={"objects": objects})
    write_twin(changed, tmp_path, ["lanelet2"])
    lanes = lanes_of(tmp_path / "twin.osm")
    right = [lane for lane in lanes if lane["synthroads_id"] == "carriageway-right/lane-0"]
    kinds = {(lane["location"], lane.get("limit")) for lane in right}
    assert kinds == {("nonurban", None), ("urban", None), ("urban", "30 km/h")}
    left = [lane for lane in lanes if lane["synthroads_id"] == "carriageway-left/lane-0"]
    assert {(lane["location"], lane.get("limit")) for lane in left} == {("nonurban", None), ("urban", None)}
    limits = SpeedLimits(RoadGeometry(changed), "right")
    assert [speed for _, _, speed in limits.stretches] == [100.0, 50.0, 30.0, 100.0]
    ((start, end),) = limits.towns
    assert start == pytest.approx(town.station)
    assert end > station


def test_a_town_that_the_road_begins_in_is_one() -> None:
    parameters = village()
    is_first = {
        name for name, item in parameters.objects.items() if isinstance(item, TrafficSign) and item.code == "310"
    }
    objects = {name: item for name, item in parameters.objects.items() if name not in is_first}
    limits = SpeedLimits(RoadGeometry(parameters.model_copy(update={"objects": objects})), "right")
    ((start, end),) = limits.towns
    assert start == 0.0
    assert 200.0 < end < 300.0
