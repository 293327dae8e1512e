"""Lanelet2's map, read as plain XML: shared lines, shared ends, and the lanelets that the report names."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

from synthroads_addon.road.section import Carriageway
from synthroads_addon.twin.formats import write_twin
from tests.helpers.roads.twin_roads import road


def test_lanes_share_lines_and_ends_and_are_in_the_report(tmp_path: Path) -> None:
    parameters = road(7, length=600.0)
    write_twin(parameters, tmp_path, ["lanelet2"])
    root = ElementTree.parse(tmp_path / "twin.osm").getroot()
    ways = {way.get("id"): [node.get("ref") for node in way.findall("nd")] for way in root.findall("way")}
    kinds = {way.get("id"): {tag.get("k"): tag.get("v") for tag in way.findall("tag")} for way in root.findall("way")}
    lanelets = {}
    for relation in root.findall("relation"):
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
