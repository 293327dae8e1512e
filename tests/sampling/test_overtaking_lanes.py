"""Overtaking lanes that change sides: where they are, what is painted there, what is refused, and a planted breach."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import check
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import width_at, width_kinks
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Arrow, LineMarking, Turnout
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.opendrive.writer import write_opendrive

SECTIONS = ("RQ15.5", "RQ11.5+")
LENGTHS = {"minimum": 300.0, "maximum": 400.0}


def road(section: str, seed: int = 1, length: float = 1500.0, **limits: Any) -> RoadParameters:
    overtaking = {"share": 1.0, "section_length": LENGTHS} | limits.pop("overtaking", {})
    scenario = {"cross_section": section, "length": length, "overtaking": overtaking, **limits}
    return sample_road(RoadScenario.from_dict(scenario), seed)


def ramps(parameters: RoadParameters, side: str) -> list[tuple[float, float, bool]]:
    """Return start and end (m) of where a side's overtaking lane ends (True) or begins (False) for its traffic."""
    carriageway = parameters.carriageway(side)
    width = carriageway.lanes[-1].width
    rows: list[tuple[float, float, bool]] = []
    for a, b in pairwise(width):
        if a.width == b.width:
            continue
        is_end = (b.width < a.width) == (carriageway.traffic > 0)
        if rows and rows[-1][2] == is_end and rows[-1][1] == a.station:
            rows[-1] = (rows[-1][0], b.station, is_end)
        else:
            rows.append((a.station, b.station, is_end))
    return rows


@pytest.mark.parametrize("section", SECTIONS)
def test_no_rule_is_broken(section: str) -> None:
    for seed in range(6):
        for side in ("right", "left") if seed == 0 else ("right",):
            broken = check(road(section, seed, traffic_side=side))
            assert [item for item in broken if item.rule != "traffic-side"] == []


@pytest.mark.parametrize("section", SECTIONS)
def test_lanes_begin_and_end_over_the_lengths_that_are_given(section: str) -> None:
    parameters = road(section, 2, 3000.0, overtaking={"critical_length": 150.0, "uncritical_length": 70.0})
    kinds = set()
    for side in ("right", "left"):
        for start, end, is_end in ramps(parameters, side):
            kinds.add(is_end)
            assert end - start == pytest.approx(75.0 if is_end else 70.0, abs=0.01)
    assert kinds == {True, False}
    # Two lanes that end towards each other leave as much as both tapers between them.
    if section == "RQ15.5":
        right = {round(end, 3) for _, end, is_end in ramps(parameters, "right") if is_end}
        left = {round(start, 3) for start, _, is_end in ramps(parameters, "left") if is_end}
        assert right == left


def test_the_pavement_of_three_lanes_keeps_its_edges() -> None:
    parameters = road("RQ15.5", 3)
    geometry = RoadGeometry(parameters)
    stations = np.linspace(0.0, 1500.0, 1501)
    edges = {side: section.paved_edge(stations) for side, section in geometry.sections.items()}
    assert {round(float(np.ptp(edge)), 6) for edge in edges.values()} == {0.0}
    assert sum(edge[0] for edge in edges.values()) == pytest.approx(12.5)
    # The inner edges meet all along.
    inner = [width_at(parameters.carriageway(side).inner_offset, stations) for side in ("right", "left")]
    assert np.abs(inner[0] + inner[1]).max() < 2e-3
    assert np.ptp(inner[0]) == pytest.approx(3.0, abs=1e-3)


def test_the_pavement_widens_beside_the_overtaking_lane_of_a_road_of_two() -> None:
    parameters = road("RQ11.5+", 3)
    geometry, stations = RoadGeometry(parameters), np.linspace(0.0, 1500.0, 1501)
    right, left = (geometry.sections[side].paved_edge(stations) for side in ("right", "left"))
    assert set(np.round([right.min(), left.min()], 3)) == {4.25}
    assert set(np.round([right.max(), left.max()], 3)) == {7.5}
    assert not ((right > 4.3) & (left > 4.3)).any()


def test_sections_are_as_long_as_drawn() -> None:
    right = ramps(road("RQ15.5", 4, 4000.0), "right")
    # A lane begins about a border, and ends before one.
    ends = sorted(b if is_end else (a + b) / 2.0 for a, b, is_end in right if a > 0.0 and b < 4000.0)
    assert len(ends) > 6
    assert all(LENGTHS["minimum"] - 0.1 <= b - a <= LENGTHS["maximum"] + 0.1 for a, b in pairwise(ends))


def test_the_barred_area_arrows_and_lane_lines() -> None:
    parameters = road("RQ15.5", 2)
    geometry = RoadGeometry(parameters)
    stripes = {n: m for n, m in parameters.of_type(LineMarking).items() if n.startswith("barred-")}
    assert stripes
    for name, stripe in stripes.items():
        section = geometry.sections["right" if "-right-" in name else "left"]
        for point in stripe.offset:
            inner, outer = (edge[0] for edge in section.boundaries_of("inner_edge_strip", [point.station]))
            assert inner - 1e-3 <= point.width - stripe.width / 2.0
            assert point.width + stripe.width / 2.0 <= outer + 1e-3
    arrows = [arrow.station for n, arrow in parameters.of_type(Arrow).items() if "-end-" in n]
    for side in ("right", "left"):
        carriageway = parameters.carriageway(side)
        for start, end, is_end in ramps(parameters, side):
            begin = start if carriageway.traffic > 0 else end
            if is_end and 150.0 < begin < 1350.0:
                ahead = [carriageway.traffic * (begin - station) for station in arrows]
                assert any(0.0 < distance < 90.0 for distance in ahead)
        lines = [
            m for m in parameters.of_type(LineMarking).values() if m.kind == "lane" and m.carriageway.endswith(side)
        ]
        width = carriageway.lanes[-1].width
        for line in lines:
            middle = (line.start_station + line.end_station) / 2.0
            assert width_at(width, middle) > 1.0
        assert sum(line.end_station - line.start_station for line in lines) > 400.0


def test_no_bay_lies_where_a_lane_begins_or_ends() -> None:
    for seed in range(8):
        parameters = road("RQ11.5+", seed, turnouts={"bus_bays": 1.0, "laybys": 1.0})
        for turnout in parameters.of_type(Turnout).values():
            side = turnout.carriageway.removeprefix("carriageway-")
            for start, end, _ in ramps(parameters, side):
                assert turnout.end_station <= start or turnout.start_station >= end


def test_roads_whose_lanes_do_not_change_are_as_before() -> None:
    scenario = {"cross_section": "RQ15.5", "length": 400.0}
    lengths = {"overtaking": {"section_length": {"minimum": 100.0, "maximum": 200.0}, "critical_length": 100.0}}
    plain = sample_road(RoadScenario.from_dict(scenario), 5)
    assert plain.objects == sample_road(RoadScenario.from_dict(scenario | lengths), 5).objects
    assert not width_kinks(plain.carriageway("right").inner_offset)


@pytest.mark.parametrize(
    ("scenario", "sentence"),
    [
        ({"cross_section": "RQ11"}, "overtaking.share is 1, the cross-section has no overtaking lane: 0 is allowed"),
        ({"cross_section": "RQ15.5", "section_length": {"minimum": 100.0, "maximum": 200.0}}, "need 150 m"),
    ],
)
def test_what_cannot_change_is_refused(scenario: dict[str, Any], sentence: str) -> None:
    section_length = scenario.pop("section_length", LENGTHS)
    limits = scenario | {"overtaking": {"share": 1.0, "section_length": section_length}}
    with pytest.raises(InputError, match=sentence):
        sample_road(RoadScenario.from_dict(limits), 1)


def _both_overtake() -> RoadParameters:
    """Return a road on which one direction has its overtaking lane all along."""
    data = json.loads(road("RQ11.5+", 1).to_json())
    data["objects"]["carriageway-left"]["lanes"][-1]["width"] = 3.25
    return RoadParameters.from_dict(data)


BREACHES = {"overtaking-lanes": _both_overtake}
"""Rule -> a road that breaks it."""


def test_two_overtaking_lanes_beside_each_other_are_found() -> None:
    found = [item for item in check(BREACHES["overtaking-lanes"]()) if item.rule == "overtaking-lanes"]
    assert found
    assert "a road of three lanes has one (RAL, EKL 2; confirmed)" in found[0].text


def test_opendrive_links_the_lanes_that_go_on(tmp_path: Path) -> None:
    """Each overtaking lane begins and ends within the road, and is linked in between."""
    path = tmp_path / "road.xodr"
    write_opendrive(road("RQ11.5+", 2), path, 0.01)
    sections = ElementTree.parse(path).getroot().findall("road/lanes/laneSection")
    numbers = [sum(lane.get("type") == "driving" for lane in section.iter("lane")) for section in sections]
    assert set(numbers) >= {2, 3}
    for before, after in pairwise(sections):
        ids = {lane.get("id") for lane in after.iter("lane")}
        links = [lane.find("link/successor") for lane in before.iter("lane") if lane.get("type") == "driving"]
        linked = [link.attrib["id"] for link in links if link is not None]
        assert set(linked) <= ids
        assert len(linked) >= min(2, len(links))
