"""Roads of OpenStreetMap: ways chained, carriageways paired, tags read, and what a map doesn't know told."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.jobs.generate import RoadSource
from synthroads_addon.road.geometry import RoadGeometry, alignment_of, profile_of
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road_files.carriageway_pairs import Pair, paired
from synthroads_addon.road_files.osm import read_osm, read_pbf
from synthroads_addon.road_files.osm_tags import driving_direction, kilometres_per_hour, lanes_each_way, metres
from synthroads_addon.road_files.way_chains import Chain
from synthroads_addon.scenario.road import FreeCrossSection, RoadScenario
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from synthroads_addon.scenario.without import scenario_without
from tests.helpers.roads.written_lines import Walk
from tests.helpers.roads.written_maps import Map, beside, motorway


def away(axis: object, scenario: RoadScenario, walk: Walk) -> float:
    """Return the largest distance of the true axis from the one that was found, m."""
    _, points = walk.points(5.0)
    alignment = alignment_of(axis)  # type: ignore[arg-type]
    station, offset = alignment.project(points - np.array(scenario.map_origin[:2]))
    return float(np.abs(offset[(station > 0.0) & (station < alignment.length)]).max())


def told(path: Path, scenario: RoadScenario | None = None, name: str | None = None) -> tuple[object, RoadScenario, str]:
    with collected_remarks() as remarks:
        axis, limits, report = axis_from_file(path, scenario or RoadScenario(), 1, name)
    return axis, limits, " | ".join([*remarks, *report["left_out"]])


def test_two_carriageways_are_a_road_whose_axis_lies_midway(tmp_path: Path) -> None:
    """Of four ways in any order, whose nodes lie at different places of the two sides."""
    written, walk = motorway()
    lines = {line.name: line for line in read_osm(written.xml(tmp_path / "a.osm"))}
    assert set(lines) == {"A 9", "A 9 northeast", "A 9 southwest"} or set(lines) == {"A 9", "A 9 north", "A 9 south"}
    assert [line.carriageway for line in lines.values()].count(True) == 2
    section = lines["A 9"].section
    assert section is not None
    assert section.spread == pytest.approx(13.0, abs=0.1)
    assert (section.lanes, section.one_way) == (2, False)
    axis, scenario, text = told(tmp_path / "a.osm")
    assert away(axis, scenario, walk) < 0.25
    assert axis.length == pytest.approx(walk.starts[-1], abs=12.0)  # type: ignore[attr-defined]
    assert scenario.epsg == 32632
    assert "midway between its carriageways" in text
    assert scenario.cross_section == "RQ31"


def test_a_carriageway_can_be_chosen_and_the_axis_put_aside(tmp_path: Path) -> None:
    written, walk = motorway()
    path = written.xml(tmp_path / "a.osm")
    names = sorted(line.name for line in read_osm(path) if line.carriageway)
    found = {}
    for name in names:
        axis, scenario, text = told(path, None, name)
        assert "--offset-from-path 6.5 leaves the right one where the map has it" in text
        found[name] = away(axis, scenario, walk)
    assert all(6.0 < distance < 7.0 for distance in found.values())
    command = ["road", str(path), "--output", str(tmp_path / "out"), "--axis-name", names[0]]
    assert main([*command, "--offset-from-path", "6.5"]) == 3
    report = json.loads((tmp_path / "out" / "road.json").read_text())
    assert any(text.startswith("lanes of one carriageway") for text in report["left_out"])
    line = json.loads((tmp_path / "out" / "centerline.geojson").read_text())
    points = np.array(line["features"][0]["geometry"]["coordinates"])[:, :2]
    _, true = walk.points(1.0)
    assert np.hypot(*(points[:, None] - true[None]).transpose(2, 0, 1)).min(axis=1).max() < 1.1


def test_carriageways_that_part_are_no_pair(tmp_path: Path) -> None:
    """The second runs beside the first over half of its length, then away from it."""
    written, walk = Map(), motorway()[1]
    station = np.linspace(0.0, walk.starts[-1], 25)
    written.way(written.line(beside(walk, station.tolist(), -9.0)), {"ref": "A 9", "lanes": "2"})
    offset = 9.0 + np.maximum(station - 600.0, 0.0) * 0.5
    rows = [beside(walk, [s], o)[0] for s, o in zip(station.tolist(), offset.tolist(), strict=True)]
    written.way(written.line(np.array(rows))[::-1], {"ref": "A 9", "lanes": "2"})
    lines = read_osm(written.xml(tmp_path / "a.osm"))
    assert len(lines) == 2
    names = {line.name for line in lines}
    for line in lines:
        (other,) = names - {line.name}
        assert f"{other} isn't paired with it: the two run beside each other over" in " ".join(line.remarks)
    assert "80 % of" in told(tmp_path / "a.osm")[2]


def test_ways_are_chained_by_their_name_and_direction(tmp_path: Path) -> None:
    """Two ways are driven both ways and drawn against each other; a third one of another name ends at their joint."""
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 900.0, 31).tolist()))
    side = written.line(beside(walk, [450.0], 80.0))
    tags = {"highway": "primary", "name": "Long Street", "lanes": "4"}
    written.way(nodes[:16], tags)
    written.way(nodes[15:][::-1], tags)
    written.way([nodes[15], *side], {"highway": "primary", "name": "Side Street"})
    written.way([nodes[15], nodes[16]], {"highway": "footway", "name": "Long Street"})
    lines = {line.name: line for line in read_osm(written.xml(tmp_path / "a.osm"))}
    assert set(lines) == {"Long Street", "Side Street"}
    long = lines["Long Street"]
    assert len(long.points) == 31
    ends = {tuple(long.points[0, :2].tolist()), tuple(long.points[-1, :2].tolist())}
    assert ends == {written.nodes[nodes[0]], written.nodes[nodes[-1]]}
    assert long.section is not None
    assert long.section.lanes == 2, "lanes are counted over both directions"


@pytest.mark.parametrize(
    ("tags", "section", "design_class", "lane", "left_out"),
    [
        ({"lanes": "2"}, "RQ11", "EKL3", 3.5, []),
        ({"lanes": "2", "width": "5.5"}, "RQ7.5", "EKL4", 2.75, []),
        ({"lanes": "2", "width": "6.5"}, "RQ11", "EKL3", 3.25, []),
        ({"lanes": "2", "width": "8"}, "RQ11", "EKL3", 3.5, ["lane width: 4 m"]),
    ],
)
def test_a_road_of_one_lane_each_way_is_a_country_road(
    tmp_path: Path, tags: dict[str, str], section: str, design_class: str, lane: float, left_out: list[str]
) -> None:
    """Its class, section and lines are those of one carriageway, not of a motorway with its lanes taken away."""
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 900.0, 31).tolist()))
    written.way(nodes, {"highway": "secondary", "name": "Long Road"} | tags)
    with collected_remarks() as remarks:
        road, told_of = RoadSource(Scenario.from_dict({}), axis=written.xml(tmp_path / "a.osm")).read()
    assert told_of["axis"]["left_out"] == left_out
    assert any(f"cross-section {section}" in text for text in remarks)
    assert road.design_class == design_class
    for side in ("left", "right"):
        assert road.carriageway(side).inner_offset == 0.0
        assert road.carriageway(side).rotation_axis == "centreline"
        assert [width.width for width in road.carriageway(side).lanes] == [lane]
    assert not [name for name in road.objects if name.startswith(("gantry", "guardrail-median", "median"))]


def test_both_directions_of_one_line_lie_side_by_side(tmp_path: Path) -> None:
    """They meet at the map's line, without a median, where the scenario asks for none."""
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 900.0, 31).tolist()))
    written.way(nodes, {"highway": "primary", "name": "Long Street", "lanes": "4"})
    path, scenario = written.xml(tmp_path / "a.osm"), Scenario.from_dict({})
    with collected_remarks() as remarks:
        road, told_of = RoadSource(scenario, axis=path).read()
    assert told_of["axis"]["left_out"] == []
    assert any("2 lanes each way" in text and "no median" in text for text in remarks)
    geometry = RoadGeometry(road)
    station = np.linspace(0.0, geometry.length, 50)
    for side in ("left", "right"):
        distances = geometry.sections[side].distances(station)
        assert np.abs(distances[:, 0]).max() == 0.0
        assert len(road.carriageway(side).lanes) == 2
        heights = geometry.sections[side].elevations(station, geometry.crossfall(road.carriageway(side), station))
        assert np.abs(heights[:, 0]).max() < 1e-12, "the line keeps its heights"
    centre = [item for item in road.of_type(LineMarking).values() if item.kind in ("free", "inner_edge")]
    (line,) = centre
    left, right = geometry.marking_edges(line, station)
    assert np.abs(left + right).max() < 1e-9
    assert line.dash_length > 0.0
    assert not [name for name in road.objects if name.startswith(("guardrail-median", "concrete-barrier-median"))]

    parted = Scenario.from_dict({"road": {"median_width": 3.0}})
    with collected_remarks():
        road, told_of = RoadSource(parted, axis=path).read()
    assert road.carriageway("right").inner_offset == 1.5
    assert told_of["axis"]["left_out"] == ["lanes side by side: road.median_width=3 m parts them instead"]


def test_one_way_roads_are_chained_in_their_direction_alone(tmp_path: Path) -> None:
    """Two ways that both end at a node don't follow each other; one drawn against its direction does."""
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 900.0, 31).tolist()))
    written.way(nodes[:11], {"ref": "B 1", "oneway": "yes", "highway": "trunk"})
    written.way(nodes[10:21][::-1], {"ref": "B 1", "oneway": "-1", "highway": "trunk"})
    written.way(nodes[20:][::-1], {"ref": "B 1", "oneway": "yes", "highway": "trunk"})
    lines = read_osm(written.xml(tmp_path / "a.osm"))
    assert sorted(len(line.points) for line in lines) == [11, 21]


def test_the_straightest_way_goes_on_where_a_name_forks(tmp_path: Path) -> None:
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 250.0, 11).tolist()))
    fork = written.line(beside(walk, [170.0, 200.0], 30.0))
    tags = {"highway": "primary", "ref": "B 1"}
    written.way([nodes[5], *fork], tags)
    written.way(nodes[:6], tags)
    written.way(nodes[5:], tags)
    lines = read_osm(written.xml(tmp_path / "a.osm"))
    assert [len(line.points) for line in lines] == [11, 3]


def test_points_too_far_apart_for_their_bend_are_told_with_a_figure(tmp_path: Path) -> None:
    """Nodes 111 m apart: what is told bounds how far the road is off, and nothing is told of close ones."""
    for step, expected in ((111.0, True), (15.0, False)):
        written, walk = motorway(steps=(step, step))
        axis, scenario, text = told(written.xml(tmp_path / "a.osm"))
        figure = re.search(r"points are (\d+) m apart at .* up to ([0-9.]+) m beside the chord", text)
        assert (figure is not None) is expected, text
        if figure:
            assert int(figure[1]) == pytest.approx(111, abs=3)
            assert 1.5 < float(figure[2]) < 2.5, "111 m by 111 m over 8 times 800 m"
            assert away(axis, scenario, walk) < float(figure[2])


def test_the_options_of_a_scenario_leave_a_road_where_its_map_has_it(tmp_path: Path) -> None:
    """A change of a scenario writes all of its fields anew: the usual coordinate system isn't meant by that."""
    path = motorway()[0].xml(tmp_path / "a.osm")
    for changes, epsg in (
        ([], 32632),
        (["seed=3"], 32632),
        (["road.half_width=40"], 32632),
        (["road.epsg=25832"], 25832),
    ):
        assert told(path, load_scenario("rq31-600m", changes).road)[1].epsg == epsg
    scenario = scenario_without(load_scenario("rq31-600m", ["seed=3"]), ["relief"])
    assert told(path, scenario.road)[1].epsg == 32632


def test_many_roads_of_one_name_are_paired_quickly(tmp_path: Path) -> None:
    """A name that a map has everywhere: only what lies near each other is compared."""
    written, walk = Map(), motorway()[1]
    for n in range(60):
        for side in (-6.5, 6.5):
            points = beside(walk, [0.0, 60.0, 120.0], side) + (2000.0 * (n % 8), 2000.0 * (n // 8))
            written.way(written.line(points)[:: 1 if side < 0 else -1], {"ref": "A 9", "lanes": "2"})
    compared = []

    def counted(one: Chain, other: Chain) -> Pair | str:
        compared.append(1)
        return paired(one, other)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("synthroads_addon.road_files.carriageway_pairs.paired", counted)
        lines = read_osm(written.xml(tmp_path / "a.osm"))
    assert sum(not line.carriageway for line in lines) == 60
    assert len(compared) == 60, "of 7140 pairs of carriageways"


def test_bridges_lanes_and_limits_are_told_by_their_stations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 300.0, 31).tolist(), -9.0))
    common = {"ref": "A 9", "maxspeed": "65 mph", "surface": "concrete"}
    written.way(nodes[:11], {**common, "lanes": "3"})
    written.way(nodes[10:16], {**common, "lanes": "3", "bridge": "viaduct", "layer": "1"})
    written.way(nodes[15:], {**common, "lanes": "4", "maxspeed": "DE:urban"})
    path = written.xml(tmp_path / "a.osm")
    (line,) = read_osm(path)
    text = " | ".join(line.left_out)
    assert "bridge=viaduct layer=1 from 100 m to 150 m" in text
    assert "3 lanes from 0 m to 150 m, 4 lanes from 150 m to 300 m" in text
    assert "maxspeed=65 mph from 0 m to 150 m, maxspeed=DE:urban from 150 m to 300 m" in text
    assert main(["road", str(path), "--output", str(tmp_path / "out")]) == 3, "lanes of the surface are left out"
    assert "left out: structures: bridge=viaduct layer=1" in capsys.readouterr().out
    _, scenario, _ = told(path)
    assert scenario.pavement.concrete == 1.0
    assert scenario.vehicles.speed.maximum * 3.6 in (pytest.approx(104.6, abs=0.1), pytest.approx(50.0, abs=0.1))


@pytest.mark.parametrize(
    ("lanes", "spread", "section"),
    [("2", 13.0, "RQ31"), ("3", 16.5, "RQ36"), ("4", 20.0, "RQ43.5"), ("2", 24.0, (3.75, 3.75, 15.0)), ("5", 27.0, 5)],
)
def test_lanes_and_distance_give_the_cross_section(
    tmp_path: Path, lanes: str, spread: float, section: str | int | tuple[float, float, float]
) -> None:
    written, _ = motorway(offset=0.5 * spread, steps=(40.0, 40.0), lanes=lanes)
    _, scenario, text = told(written.xml(tmp_path / "a.osm"))
    assert f"{lanes} lanes each way" in text
    found = scenario.cross_section
    if isinstance(section, str):
        assert found == section
        return
    assert isinstance(found, FreeCrossSection)
    assert len(found.lanes) == int(lanes)
    if isinstance(section, tuple):
        assert (*found.lanes, found.median) == pytest.approx(section, abs=0.3)


def test_the_lanes_of_the_scenario_are_kept_if_it_names_them(tmp_path: Path) -> None:
    written, _ = motorway(lanes="3")
    _, scenario, text = told(written.xml(tmp_path / "a.osm"), load_scenario("rq31-600m", ["road.lanes=2"]).road)
    assert scenario.cross_section == "RQ31"
    assert "lanes: 3 each way, road.lanes=2 is taken instead" in text


def test_a_width_gives_the_lanes_if_lanes_can_be_so_wide(tmp_path: Path) -> None:
    for width, lanes in (("7.0", (3.5, 3.5)), ("23 ft", (3.505, 3.505)), ("30", (3.75, 3.75))):
        written, _ = motorway(lanes="2", width=width)
        _, scenario, text = told(written.xml(tmp_path / "a.osm"))
        found = scenario.cross_section
        assert (found.lanes if isinstance(found, FreeCrossSection) else (3.75, 3.75)) == pytest.approx(lanes)
        assert ("lanes would be 15.00 m wide" in text) == (width == "30")


def test_heights_follow_an_elevation_model_or_are_drawn(tmp_path: Path) -> None:
    written, walk = motorway()
    path = written.xml(tmp_path / "a.osm")
    axis, _, text = told(path)
    assert "a.osm has no heights: they are drawn" in text
    assert len(axis.vertical) > 1  # type: ignore[attr-defined]
    x, y = walk.poses[0][:2]
    head = f"ncols 60\nnrows 60\nxllcenter {x - 600}\nyllcenter {y - 600}\ncellsize 50\n"
    rows = "\n".join(" ".join(f"{200.0 + 0.02 * 50 * n:.3f}" for n in range(60)) for _ in range(60))
    (tmp_path / "ground.asc").write_text(head + rows + "\n")
    axis, scenario, text = told(path, RoadScenario(elevation_model=str(tmp_path / "ground.asc")))
    assert "they follow ground.asc" in text
    station, points = walk.points(20.0)
    there, _ = alignment_of(axis).project(points - np.array(scenario.map_origin[:2]))  # type: ignore[arg-type]
    found = profile_of(axis).elevation(there) + scenario.map_origin[2]  # type: ignore[arg-type]
    assert np.abs(found - (200.0 + 0.02 * (points[:, 0] - x + 600.0))).max() < 1.5
    assert len(station) > 50


def test_binary_maps_hold_the_same_roads(tmp_path: Path) -> None:
    pytest.importorskip("osmium")
    written, _ = motorway(maxspeed="120")
    texts = read_osm(written.xml(tmp_path / "a.osm"))
    binary = read_pbf(written.pbf(tmp_path / "a.osm.pbf"))
    assert [line.name for line in binary] == [line.name for line in texts]
    for one, other in zip(texts, binary, strict=True):
        assert np.array_equal(one.points, other.points)
        assert one.section == other.section
    renamed = tmp_path / "map.bin"
    renamed.write_bytes((tmp_path / "a.osm.pbf").read_bytes())
    assert axis_from_file(renamed, RoadScenario(), 1)[2]["name"] == "A 9", "the content says the format"


def test_what_lies_beyond_an_extracts_edge_is_told(tmp_path: Path) -> None:
    written, walk = Map(), motorway()[1]
    nodes = written.line(beside(walk, np.linspace(0.0, 300.0, 31).tolist()))
    written.way([*nodes[:20], 7001, 7002, *nodes[20:]], {"ref": "A 9", "lanes": "2"})
    lines = read_osm(written.xml(tmp_path / "a.osm"))
    assert sorted(len(line.points) for line in lines) == [11, 20]
    assert all("nodes that the file lacks: 2" in line.left_out for line in lines)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm version="0.6"/>', "document type is 'osm'"),
        ('<osm><node id="1" lon="200" lat="0"/></osm>', "longitude and a latitude"),
        ('<osm><node id="1" lon="x" lat="0"/></osm>', "node 1 lon is 'x'"),
        ('<osm><node id="1e5" lon="1" lat="0"/></osm>', "whole number"),
        ("<osm><way id='1'><nd ref='1'/><nd ref='2'/><tag k='highway' v='primary'/></way></osm>", "no line of two"),
        ("<osm>", "valid XML"),
        ("<a><osm/></a>", "must have osm as its root element"),
    ],
)
def test_what_is_no_map_is_one_line_of_error(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.osm").write_text(text)
    with pytest.raises(InputError, match=message):
        axis_from_file(tmp_path / "a.osm", RoadScenario(), 1)


def test_names_of_several_lines_are_told_on_one(tmp_path: Path) -> None:
    path = motorway()[0].xml(tmp_path / "a.osm")
    path.write_text(path.read_text().replace('v="A 9"', 'v="A&#10;9&#x85;"'))
    assert {line.name for line in read_osm(path) if not line.carriageway} == {"A 9"}
    with collected_remarks() as remarks:
        axis_from_file(path, RoadScenario(), 1)
    assert all(text.isprintable() for text in remarks)


def test_values_of_tags() -> None:
    assert metres("3.5") == 3.5
    assert metres("12 ft") == pytest.approx(3.6576)
    assert metres("12'6\"") == pytest.approx(3.81)
    assert metres("wide") is None
    assert kilometres_per_hour("65 mph")[0] == pytest.approx(104.607, abs=1e-3)
    assert kilometres_per_hour("120") == (120.0, None)
    assert kilometres_per_hour("DE:urban") == (50.0, "maxspeed='de:urban' is read as 50 km/h")
    for word in ("none", "signals", "DE:motorway", "", None, "fast"):
        assert kilometres_per_hour(word) == (None, None)
    assert driving_direction({"highway": "motorway"}) == 1
    assert driving_direction({"highway": "motorway", "oneway": "no"}) == 0
    assert driving_direction({"highway": "primary", "oneway": "-1"}) == -1
    assert driving_direction({"highway": "primary", "junction": "roundabout"}) == 1
    assert lanes_each_way({"highway": "motorway", "lanes": "4"}) == (4, None)
    assert lanes_each_way({"highway": "primary", "lanes": "4"}) == (2, None)
    assert lanes_each_way({"highway": "primary", "lanes": "3"})[0] == 2
    assert lanes_each_way({"highway": "primary", "lanes": "3", "lanes:forward": "2", "lanes:backward": "1"})[0] == 2
    assert lanes_each_way({"highway": "primary", "lanes": "many"}) == (None, "lanes='many' is no number")
