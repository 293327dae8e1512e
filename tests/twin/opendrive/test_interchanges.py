"""Interchanges in OpenDRIVE: lanes that meet within a millimetre, and traffic of SUMO through all ramps."""

from __future__ import annotations

import os
import subprocess
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.opendrive_reader import OpenDrive, Roads
from tests.helpers.roads.interchanges import interchange
from tests.judges import require
from tests.twin.opendrive.test_junctions import _turn_point

MILLIMETRE = 1e-3
HOUR = 2000
"""Vehicles an hour."""


ROADS = [("diamond", 1), ("half-clover-under", 1), pytest.param(("half-clover", 2), marks=pytest.mark.slow)]


@pytest.fixture(params=ROADS, scope="module")
def path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("interchange") / f"{request.param[0]}.xodr"
    write_opendrive(interchange(*request.param), path, 0.005)
    return path


def _middle(part: OpenDrive, lane: int, place: float) -> np.ndarray:
    """Return the map point in the middle of a lane at a road's begin (0) or end."""
    s = np.array([min(max(place, 1e-7), part.length - 1e-7)])
    section = part.sections[0 if place == 0.0 else -1]
    borders = section.borders(s, part.lane_offset(s))
    inner, outer = section.lanes[lane].height(s)
    t = (borders[lane - int(np.sign(lane))] + borders[lane]) / 2.0
    if part.road.find("planView/geometry/paramPoly3") is not None:
        return _turn_point(part, s, t)[0]
    return part.point(s, t, (inner + outer) / 2.0)[0]


def _end(part: OpenDrive, contact: str) -> float:
    return 0.0 if contact == "start" else part.length


def test_linked_lanes_meet(path: Path) -> None:
    roads = Roads.read(path)
    by_id = {part.road.attrib["id"]: part for part in roads.roads}
    gaps = []
    for part in roads.roads:
        for tag, place, section in (("predecessor", 0.0, 0), ("successor", part.length, -1)):
            link = part.road.find(f"link/{tag}")
            if link is None or link.attrib["elementType"] != "road":
                continue
            other = by_id[link.attrib["elementId"]]
            for lane in part.sections[section].lanes.values():
                if (linked := lane.item.find(f"link/{tag}")) is not None:
                    end = _middle(other, int(linked.attrib["id"]), _end(other, link.attrib["contactPoint"]))
                    gaps.append(float(np.linalg.norm(_middle(part, lane.number, place) - end)))
    assert len(gaps) > 60
    assert max(gaps) < MILLIMETRE
    names = {part.road.attrib["name"] for part in roads.roads}
    assert {
        "crossing-road",
        *(f"ramp-{kind}-{side}" for kind in ("exit", "entry") for side in ("left", "right")),
    } <= names


def test_the_lanes_of_junctions_meet(path: Path) -> None:
    roads = Roads.read(path)
    by_id = {part.road.attrib["id"]: part for part in roads.roads}
    junctions = roads.root.findall("junction")
    # Of a diamond two mouths are opposite each other; of a half clover two are so near that their junctions can be one.
    assert 4 + 2 <= len(junctions) <= 4 + (2 if path.stem == "diamond" else 4)
    for junction in junctions:
        for connection in junction.findall("connection"):
            incoming, inside = (by_id[connection.attrib[name]] for name in ("incomingRoad", "connectingRoad"))
            ends = [
                place
                for tag, place in (("predecessor", 0.0), ("successor", incoming.length))
                if (link := incoming.road.find(f"link/{tag}")) is not None
                and (link.attrib["elementType"], link.attrib["elementId"]) == ("junction", junction.attrib["id"])
            ]
            for link in connection.findall("laneLink"):
                begin = _middle(inside, int(link.attrib["to"]), _end(inside, connection.attrib["contactPoint"]))
                gaps = [np.linalg.norm(_middle(incoming, int(link.attrib["from"]), end) - begin) for end in ends]
                assert min(gaps) < MILLIMETRE


def test_traffic_drives_through_all_ramps(path: Path, tmp_path: Path) -> None:
    """2000 vehicles an hour between all ends that are linked: all arrive, none is moved by force."""
    require("eclipse-sumo")
    net = tmp_path / "road.net.xml"
    _run("netconvert", "--opendrive", str(path), "-o", str(net))
    root = ElementTree.parse(net).getroot()
    onward: dict[str, set[str]] = {}
    for item in root.findall("connection"):
        if not item.attrib["from"].startswith(":"):
            onward.setdefault(item.attrib["from"], set()).add(item.attrib["to"])
    edges = {item.attrib["id"] for item in root.findall("edge") if item.get("function") != "internal"}
    begins = sorted(edges - set().union(*onward.values()))
    ends = sorted(edges - set(onward))
    assert len(begins) == len(ends) == 2
    routes = ElementTree.Element("routes")
    pairs = [(begin, end) for begin in begins for end in ends]
    for number, (begin, end) in enumerate(pairs):
        about = {"id": str(number), "from": begin, "to": end, "begin": "0", "end": "600", "departLane": "best"}
        ElementTree.SubElement(routes, "flow", {**about, "vehsPerHour": str(HOUR // len(pairs))})
    ElementTree.ElementTree(routes).write(tmp_path / "road.rou.xml")
    statistics = tmp_path / "statistics.xml"
    files = ["-n", str(net), "-r", str(tmp_path / "road.rou.xml"), "--statistic-output", str(statistics)]
    _run("sumo", *files, "--end", "1500", "--no-step-log")
    seen = ElementTree.parse(statistics).getroot()
    vehicles = seen.find("vehicles").attrib
    assert int(vehicles["inserted"]) == int(vehicles["loaded"]) >= HOUR // 6 - 8
    assert vehicles["running"] == vehicles["waiting"] == "0"
    assert seen.find("teleports").attrib["total"] == "0"


def _run(program: str, *arguments: str) -> None:
    home = Path(find_spec("sumo").origin).parent
    environment = {**os.environ, "SUMO_HOME": str(home), "PROJ_DATA": str(home / "data" / "proj")}
    done = subprocess.run(
        [str(home / "bin" / program), *arguments], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr[-1000:]
