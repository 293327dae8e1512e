"""Side roads in OpenDRIVE: pieces of the main road, turns and junctions, read back and driven through by SUMO."""

from __future__ import annotations

import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.opendrive_reader import OpenDrive, Roads, number
from tests.helpers.roads.side_roads import drawn, in_britain, roof, with_side_road
from tests.judges import require
from tests.judges.opendrive import quality_faults

MILLIMETRE = 1e-3
TOLERANCE = 0.005
ROADS = {
    "right": lambda: roof(with_side_road()),
    "left": lambda: with_side_road(side="left", angle_deg=75.0, section="RQ9", grade_percent=-2.0),
    "farm road": lambda: with_side_road(lanes=1, lane_width=3.5, priority="none", angle_deg=105.0),
    "traffic on the left": lambda: in_britain(side="left", angle_deg=80.0),
    "drawn": lambda: drawn(length=450.0, per_km=8.0, tracks=0.0),
}


@pytest.fixture(
    params=[
        pytest.param(name, marks=pytest.mark.slow if name in ("left", "farm road", "right") else ()) for name in ROADS
    ],
    scope="module",
)
def road(request: pytest.FixtureRequest) -> RoadParameters:
    return ROADS[request.param]()


@pytest.fixture(scope="module")
def path(road: RoadParameters, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("junctions") / "road.xodr"
    write_opendrive(road, path, TOLERANCE)
    return path


def turns_and_others(read: Roads) -> tuple[list[OpenDrive], list[OpenDrive]]:
    """Return the roads with one lane, which are turns, and the others."""
    turns = [part for part in read.roads if part.road.get("name", "").endswith("-turn")]
    return turns, [part for part in read.roads if part not in turns]


def test_pieces_and_side_roads_lie_on_the_surface(road: RoadParameters, path: Path) -> None:
    geometry = RoadGeometry(road)
    _, others = turns_and_others(Roads.read(path))
    names = set(geometry.mouths)
    for part in others:
        mouth = geometry.mouths.get(part.road.get("name", ""))
        s = np.linspace(0.05, part.length - 0.05, 60)
        for section, own, points in part.border_points(s):
            for lane, place in points.items():
                local = place - road.transform.translate
                if mouth is None:
                    station, offset = geometry.alignment.project(local[:, :2])
                    away = np.abs(geometry.offsets(station) - offset[:, None])
                    border = away.argmin(axis=1)
                    height = np.take_along_axis(geometry.boundary_elevations(station), border[:, None], axis=1)[:, 0]
                    assert away.min(axis=1).max() < 0.2 * MILLIMETRE
                else:
                    u, v = mouth.local(local[:, :2])
                    widths = np.cumsum(
                        [0.0, *(float(section.lanes[n].width.at(own[:1])[0]) for n in _inside(section, lane))]
                    )
                    assert np.abs(np.abs(v) - widths[-1]).max() < MILLIMETRE
                    names.discard(part.road.get("name"))
                    if np.abs(v).max() > mouth.side_road.half_width + 1e-6:
                        continue
                    height = mouth.own_surface(u, v)
                assert np.abs(local[:, 2] - height).max() < MILLIMETRE, (part.road.get("name"), lane)
    assert not names


def _inside(section: object, lane: int) -> list[int]:
    """Return the lanes from the axis up to one, it included."""
    sign = 1 if lane > 0 else -1
    return [sign * n for n in range(1, abs(lane) + 1)]


def test_turns_begin_and_end_at_lanes(road: RoadParameters, path: Path) -> None:
    """Their borders meet those of the lanes that they join, in plan and in height.

    Where a tilted road climbs, its places lie some millimetres farther along it than their s says.
    """
    geometry, read = RoadGeometry(road), Roads.read(path)
    by_id = {part.road.attrib["id"]: part for part in read.roads}
    turns, _ = turns_and_others(read)
    assert len(turns) == 4 * len(geometry.mouths)
    for part in turns:
        for tag, lane_tag, end in (("predecessor", "predecessor", 0.0), ("successor", "successor", part.length)):
            link = part.road.find(f"link/{tag}")
            assert link is not None
            other = by_id[link.attrib["elementId"]]
            place = 0.0 if link.attrib["contactPoint"] == "start" else other.length
            lane = int(part.road.find(f".//lane[@type='driving']/link/{lane_tag}").attrib["id"])
            section = other.sections[0 if place == 0.0 else -1]
            at = np.array([min(max(place, 1e-7), other.length - 1e-7)])
            borders = section.borders(at, other.lane_offset(at))
            inner, outer = lane - int(np.sign(lane)), lane
            low, high = section.lanes[lane].height(at)
            wanted = [other.point(at, borders[inner], low)[0], other.point(at, borders[outer], high)[0]]
            own_at = np.array([min(max(end, 1e-7), part.length - 1e-7)])
            own = part.sections[0].borders(own_at, _turn_offset(part, own_at))
            found = [_turn_point(part, own_at, own[n])[0] for n in (0, max(own, key=abs))]
            apart = min(
                max(np.linalg.norm(a - b) for a, b in zip(found, order, strict=True))
                for order in (wanted, wanted[::-1])
            )
            assert apart < 5.0 * MILLIMETRE, (part.road.get("name"), tag)


def _turn_offset(part: OpenDrive, s: np.ndarray) -> np.ndarray:
    return part.lane_offset(s)


def _turn_point(part: OpenDrive, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return map points (N, 3) of a turn, whose reference line is one cubic over a normalised parameter."""
    item = part.road.find("planView/geometry")
    cubic = item.find("paramPoly3")
    share = np.linspace(0.0, 1.0, 20_001)
    values = {
        axis: sum(number(cubic, f"{letter}{axis}") * share**power for power, letter in enumerate("abcd"))
        for axis in "UV"
    }
    steps = np.hypot(np.diff(values["U"]), np.diff(values["V"]))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    assert along[-1] == pytest.approx(part.length, abs=1e-3)
    at = np.interp(s, along, share)
    u, v, du, dv = (
        sum((power if slope else 1) * number(cubic, f"{letter}{axis}") * at ** max(power - slope, 0)
            for power, letter in enumerate("abcd"))
        for slope in (0, 1) for axis in "UV"
    )  # fmt: skip
    heading = number(item, "hdg")
    x = number(item, "x") + u * np.cos(heading) - v * np.sin(heading)
    y = number(item, "y") + u * np.sin(heading) + v * np.cos(heading)
    turn = heading + np.arctan2(dv, du)
    tilt = part.superelevation(s)
    left = np.stack([-np.sin(turn), np.cos(turn)], axis=1)
    plan = np.column_stack([x, y]) + (t * np.cos(tilt))[:, None] * left
    return np.column_stack([plan, part.elevation(s) + t * np.sin(tilt)]) + part.offset


def test_junctions_connect_every_pair_of_arms(road: RoadParameters, path: Path) -> None:
    geometry, root = RoadGeometry(road), ElementTree.parse(path).getroot()
    roads = {item.attrib["id"]: item for item in root.findall("road")}
    junctions = root.findall("junction")
    assert junctions
    for junction in junctions:
        ways = set()
        for connection in junction.findall("connection"):
            turn = roads[connection.attrib["connectingRoad"]]
            assert turn.get("junction") == junction.get("id")
            tag = "successor" if connection.attrib["contactPoint"] == "start" else "predecessor"
            ways.add((connection.attrib["incomingRoad"], turn.find(f"link/{tag}").attrib["elementId"]))
            assert connection.findall("laneLink")
        arms = {arm for way in ways for arm in way}
        sides = {str(mouth.side_road.instance) for mouth in geometry.mouths.values()}
        wanted = {(a, b) for a in arms for b in arms if a != b and not (a in sides and b in sides)}
        assert ways == wanted


def test_quality_checker_finds_nothing(path: Path) -> None:
    require("asam-qc-opendrive")
    assert quality_faults(path) == []


def test_sumo_drives_through_the_mouth_both_ways(path: Path) -> None:
    """Flows between all arms: every vehicle arrives, none is teleported, and none stops but before the junction."""
    require("eclipse-sumo")
    from tests.judges import sumo

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        net = folder / "net.xml"
        files = ("--opendrive-files", str(path), "--output-file", str(net), "--offset.disable-normalization")
        # Each direction has half of a farm road's one lane; cars would be kept from lanes below 1.8 m.
        files += ("--opendrive.min-width", "1")
        done = sumo._run("netconvert", *files, "--no-turnarounds")
        assert done.returncode == 0
        assert "Error" not in done.stderr
        assert "Warning" not in done.stderr, done.stderr
        root = ElementTree.parse(net).getroot()
        edges = {e.attrib["id"]: e for e in root.iter("edge") if e.get("function") != "internal"}
        begun, ended = {e.attrib["from"] for e in edges.values()}, {e.attrib["to"] for e in edges.values()}
        routes = ElementTree.Element("routes")
        ElementTree.SubElement(routes, "vType", {"id": "car", "length": "4", "vClass": "passenger"})
        flows = 0
        for start, first in edges.items():
            for end, last in edges.items():
                is_way = len(_neighbours(edges, first, "to")) < 2 and len(_neighbours(edges, last, "from")) < 2
                if start.lstrip("-") == end.lstrip("-") or not is_way or first.attrib["from"] in ended - begun:
                    continue
                if not _is_end(first.attrib["from"]) or not _is_end(last.attrib["to"]):
                    continue
                flows += 1
                way = {"begin": "0", "end": "600", "period": "100", "from": start, "to": end, "departSpeed": "max"}
                ElementTree.SubElement(routes, "flow", {"id": f"flow-{flows}", "type": "car", **way})
        assert flows >= 6
        ElementTree.ElementTree(routes).write(folder / "routes.xml")
        seen, said = folder / "seen.xml", folder / "said.xml"
        options = ("--net-file", str(net), "--route-files", str(folder / "routes.xml"), "--fcd-output", str(seen))
        done = sumo._run(
            "sumo", *options, "--statistic-output", str(said), "--step-length", "0.5", "--no-step-log", "--end", "1500"
        )
        assert done.returncode == 0, done.stderr
        statistics = ElementTree.parse(said).getroot()
        vehicles, teleports = (statistics.find(tag).attrib for tag in ("vehicles", "teleports"))
        assert int(vehicles["inserted"]) == int(vehicles["loaded"]) == flows * 6
        assert (vehicles["running"], vehicles["waiting"], teleports["total"]) == ("0", "0", "0")
        lengths = {lane.attrib["id"]: float(lane.attrib["length"]) for lane in root.iter("lane")}
        for vehicle in ElementTree.parse(seen).getroot().iter("vehicle"):
            lane = vehicle.attrib["lane"]
            if float(vehicle.attrib["speed"]) < 0.1 and not lane.startswith(":"):
                # A queue before the junction: some car lengths.
                assert lengths[lane] - float(vehicle.attrib["pos"]) < 40.0


def _neighbours(edges: dict[str, ElementTree.Element], edge: ElementTree.Element, end: str) -> list[str]:
    """Return edges that end where an edge does, the opposite one of the same road left out."""
    own = edge.attrib["id"].lstrip("-")
    if _is_end(edge.attrib[end]):
        return [
            name for name, item in edges.items() if item.attrib[end] == edge.attrib[end] and name.lstrip("-") != own
        ]
    return []


def _is_end(node: str) -> bool:
    """Return whether a node is the end of the network: netconvert calls these by road and end."""
    return node.endswith((".begin", ".end"))
