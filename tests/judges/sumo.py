"""OpenDRIVE, judged by SUMO: what netconvert makes of a file, and vehicles that drive along it."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from tests.judges.samples import Samples

_OPTIONS = (
    # Local coordinates as in the file, and points every metre.
    *("--offset.disable-normalization", "--opendrive.curve-resolution", "1", "--precision", "6"),
    # Lanes that reach to the border of their section: SUMO makes a junction of each, which would cut them short.
    *("--default.junctions.radius", "0", "--junctions.small-radius", "0", "--opendrive.advance-stopline", "0"),
    "--no-internal-links",
)
_KNOWN = (
    # So it is where a lane begins.
    r"Lane '[^']+' is not connected from any incoming edge at junction '[^']+'\.",
    r"\d+ total messages of type: Lane '%' is not connected from any incoming edge at junction '%'\.",
)
_MILLIMETRE = 1e-3
_LANE, _ACROSS, _HIGH = _MILLIMETRE, 2.0 * _MILLIMETRE, 2.0 * _MILLIMETRE
"""How far (m) lanes and paths may be beside ours, and off in height: chords of a metre, and SUMO's own positions."""
_ADVISORY = 130.0 / 3.6
"""Speed on a motorway without a limit, m/s."""
_END = 1.0
"""How near (m) to the road's ends a vehicle has to begin and to arrive."""
_TURNED = np.radians(0.1)
_CAR = 4.0
"""Length of a vehicle, m."""


@dataclass(frozen=True)
class Net:
    """Network that netconvert made of a file.

    Attributes:
        path: the network.
        root: the same, read.
        said: errors and warnings.
    """

    path: Path
    root: ElementTree.Element
    said: list[str]

    def way(self, ahead: bool) -> list[ElementTree.Element]:
        """Return the edges along the road, with the stations or against them, from the first to the last."""
        edges = {
            edge.attrib["from"]: edge
            for edge in self.root.iter("edge")
            if edge.get("function") != "internal" and edge.attrib["id"].startswith("-") == ahead
        }
        (start,) = edges.keys() - {edge.attrib["to"] for edge in edges.values()}
        found = []
        while start in edges:
            found.append(edges[start])
            start = edges[start].attrib["to"]
        return found


def convert(path: Path, folder: Path) -> Net:
    """Let netconvert read a file."""
    net = folder / "road.net.xml"
    done = _run("netconvert", "--opendrive-files", str(path), "--output-file", str(net), *_OPTIONS)
    said = re.findall(r"^(?:Error|Warning): (.*)", done.stderr, re.MULTILINE)
    if done.returncode != 0:
        raise RuntimeError(done.stderr[-1000:])
    return Net(net, ElementTree.parse(net).getroot(), said)


def drive(net: Net, folder: Path) -> dict[str, np.ndarray]:
    """Return the paths (N, 4) of vehicles by name: x, y, z and heading (rad) of their front, every fifth of a second.

    One drives along each through lane, from end to end, without changing lanes. They are called ``right-0`` and so on,
    after their carriageway and how many lanes lie outside of theirs.
    """
    routes = ElementTree.Element("routes")
    # A vehicle stays in the lane in which it departs.
    stay = {"lcStrategic": "-1", "lcCooperative": "-1", "lcSpeedGain": "0", "lcKeepRight": "0"}
    ElementTree.SubElement(routes, "vType", {"id": "car", "length": str(_CAR), "sigma": "0", **stay})
    for side, ahead in (("right", True), ("left", False)):
        edges = net.way(ahead)
        ElementTree.SubElement(routes, "route", {"id": side, "edges": " ".join(edge.attrib["id"] for edge in edges)})
        for number, lane in enumerate(through_lanes(edges[0])):
            which = {"id": f"{side}-{number}", "type": "car", "route": side, "departLane": lane.attrib["index"]}
            ends = {"depart": "0", "departPos": "0", "departSpeed": "max", "arrivalPos": "max"}
            ElementTree.SubElement(routes, "vehicle", {**which, **ends})
    ElementTree.ElementTree(routes).write(folder / "road.rou.xml")
    seen = folder / "seen.xml"
    files = ["--net-file", str(net.path), "--route-files", str(folder / "road.rou.xml"), "--fcd-output", str(seen)]
    done = _run("sumo", *files, "--step-length", "0.2", "--precision", "6", "--no-step-log")
    if done.returncode != 0 or "Error" in done.stderr:
        raise RuntimeError(done.stderr[-1000:])
    paths: dict[str, list[list[float]]] = {}
    for item in ElementTree.parse(seen).getroot().iter("vehicle"):
        place = [float(item.attrib[name]) for name in "xyz"]
        # SUMO counts angles from north, clockwise, in degrees.
        paths.setdefault(item.attrib["id"], []).append([*place, np.radians(90.0 - float(item.attrib["angle"]))])
    return {name: np.array(rows) for name, rows in paths.items()}


def crowd(net: Net, folder: Path) -> set[str]:
    """Return the types of the lanes that cars drive on, in dense traffic that may choose its lanes."""
    routes = ElementTree.Element("routes")
    ElementTree.SubElement(routes, "vType", {"id": "car", "length": str(_CAR), "vClass": "passenger"})
    for side, ahead in (("right", True), ("left", False)):
        for edges in [" ".join(edge.attrib["id"] for edge in net.way(ahead))]:
            about = {"id": side, "type": "car", "begin": "0", "end": "20", "number": "20", "departLane": "random"}
            ElementTree.SubElement(ElementTree.SubElement(routes, "flow", about), "route", {"edges": edges})
    ElementTree.ElementTree(routes).write(folder / "crowd.rou.xml")
    seen = folder / "crowd.xml"
    files = ["--net-file", str(net.path), "--route-files", str(folder / "crowd.rou.xml"), "--fcd-output", str(seen)]
    done = _run("sumo", *files, "--step-length", "0.5", "--no-step-log")
    if done.returncode != 0 or "Error" in done.stderr:
        raise RuntimeError(done.stderr[-1000:])
    types = {lane.attrib["id"]: lane.get("type", "") for lane in net.root.iter("lane")}
    return {types[item.attrib["lane"]] for item in ElementTree.parse(seen).getroot().iter("vehicle")}


def _run(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    # Not imported: on import it has every other PROJ in this process take its tables of coordinate systems.
    spec = find_spec("sumo")
    assert spec is not None
    assert spec.origin is not None

    home = Path(spec.origin).parent
    environment = {**os.environ, "SUMO_HOME": str(home), "PROJ_DATA": str(home / "data" / "proj")}
    command = [str(home / "bin" / program), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def through_lanes(edge: ElementTree.Element) -> list[ElementTree.Element]:
    """Return an edge's lanes of the type that ours have, from outside in."""
    return [lane for lane in edge.findall("lane") if lane.get("type") == "driving"]


def verdict(samples: Samples) -> list[str]:
    """Return what netconvert complains of, lanes and paths that lie elsewhere than ours, vehicles that don't arrive."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        net = convert(samples.file("twin.xodr"), folder)
        found = [said for said in net.said if not any(re.fullmatch(known, said) for known in _KNOWN)]
        for side, ahead in (("right", True), ("left", False)):
            for edge in net.way(ahead):
                found += _wrong_lanes(samples, side, edge)
                found += _wrong_traffic(edge)
        paths = drive(net, folder)
        if (types := crowd(net, folder)) != {"driving"}:
            found.append(f"cars drove on lanes of the types {sorted(types)}")
    wanted = {f"{side}-{n}" for side, section in samples.geometry.sections.items() for n in range(_lanes(section))}
    if set(paths) != wanted:
        found.append(f"vehicles drove in {sorted(paths)} and not in {sorted(wanted)}")
    for name, path in paths.items():
        found += _wrong_path(samples, name, path)
    return found


def _lanes(section: object) -> int:
    return len(section.carriageway.lanes)


def _middle(samples: Samples, side: str, number: int, station: np.ndarray) -> np.ndarray:
    """Return the offset (N,) of the middle of a through lane, counted from outside, at stations (N,)."""
    section = samples.geometry.sections[side]
    boundaries = section.lane_boundaries(station)
    return section.carriageway.sign * (boundaries[:, number] + boundaries[:, number + 1]) / 2.0


def _wrong_lanes(samples: Samples, side: str, edge: ElementTree.Element) -> list[str]:
    """Return the through lanes of an edge that aren't where ours are."""
    through = through_lanes(edge)
    if len(through) != _lanes(samples.geometry.sections[side]):
        return [f"edge {edge.attrib['id']} has {len(through)} through lanes"]
    found = []
    for number, lane in enumerate(through):
        points = np.array([[float(value) for value in point.split(",")] for point in lane.attrib["shape"].split()])
        station, across, high = _off(samples, side, number, points)
        if across > _LANE or high > _HIGH:
            where = f"{station[0]:.0f} m to {station[-1]:.0f} m"
            away = f"{across:.4f} m beside ours and {high:.4f} m off in height"
            found.append(f"lane {lane.attrib['id']}, {where}: up to {away}")
    return found


def _wrong_traffic(edge: ElementTree.Element) -> list[str]:
    """Return the lanes of an edge that cars drive on at other speeds than on a motorway, or shouldn't drive on."""
    found = []
    for lane in edge.findall("lane"):
        if lane.get("type") == "driving" and abs(float(lane.attrib["speed"]) - _ADVISORY) > 0.01:
            found.append(f"lane {lane.attrib['id']} is for {lane.attrib['speed']} m/s")
        if lane.get("type") == "stop" and not set(lane.get("allow", "").split()) <= {"emergency", "authority"}:
            found.append(f"lane {lane.attrib['id']} is for {lane.get('allow')}")
    return found


def _off(samples: Samples, side: str, number: int, points: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return points' stations, and how far (m) they are at most beside a lane's middle and off its road's line.

    SUMO doesn't know that the road is tilted: it takes t, which lies in the tilted plane, for an offset in plan, and
    the elevation profile, the plane's line at the centreline, for the height of all.
    """
    geometry = samples.geometry
    station, offset = geometry.alignment.project(points[:, :2])
    inside = np.clip(station, 0.0, geometry.length)
    section = geometry.sections[side]
    rise = geometry.crossfall(section.carriageway, inside)
    middle = _middle(samples, side, number, inside)
    # Of lanes whose width changes with the tilt it takes one width: they lie between those without and with all of it.
    most = max(abs(point.crossfall_percent) for point in section.carriageway.crossfall) / 100.0
    ends = np.sort(np.stack([middle, middle * np.sqrt(1.0 + most**2)]), axis=0)
    across = np.maximum(ends[0] - offset, offset - ends[1]).max()
    line = geometry.profile.elevation(inside) - rise * section.carriageway.sign * section.pivot(inside)
    return station, float(across), float(np.abs(points[:, 2] - line).max())


def _wrong_path(samples: Samples, name: str, path: np.ndarray) -> list[str]:
    """Return where a vehicle left its lane, and whether it drove from end to end."""
    side, number = name.split("-")
    station, across, high = _off(samples, side, int(number), path)
    ahead = side == "right"
    along = station if ahead else samples.geometry.length - station
    found = []
    if along[0] > _END or along[-1] < samples.geometry.length - _step(along) - _END or np.any(np.diff(along) <= 0.0):
        found.append(f"vehicle {name} drove from {along[0]:.1f} m to {along[-1]:.1f} m")
    if across > _ACROSS or high > _HIGH:
        found.append(f"vehicle {name} was up to {across:.4f} m beside its lane and {high:.4f} m off in height")
    # Until its rear is on the road, too, SUMO has no heading for it.
    whole = along > _CAR
    heading = samples.geometry.alignment.heading(station[whole])
    turned = np.abs(np.angle(np.exp(1j * (path[whole, 3] - heading - (0.0 if ahead else np.pi)))))
    if turned.max() > _TURNED:
        found.append(f"vehicle {name} was turned by up to {np.degrees(turned.max()):.2f} degrees")
    return found


def _step(along: np.ndarray) -> float:
    """Return how far (m) a vehicle drives in a step: it arrives within its last."""
    return float(np.diff(along).max(initial=0.0))


def with_an_arc_the_wrong_way(samples: Samples) -> Samples:
    """Return files with an OpenDRIVE file whose first arc bends to the other side."""
    text = samples.text("twin.xodr")
    (curvature,) = re.findall(r'<arc curvature="([^"]*)"', text)[:1]
    return samples.with_text("twin.xodr", f'<arc curvature="{curvature}"', f'<arc curvature="{-float(curvature)}"')
