"""Lanelet2's map, judged by Lanelet2's own library."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import Carriageway
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.twin.formats import write_twin
from synthroads_addon.twin.speeds import SpeedLimits
from tests.judges import bringing
from tests.judges.samples import Samples

VERSION = "1.2.3"
_FOLDER = bringing.BUILD / "lanelet2"
_STEP = 0.01
"""Largest distance (m) of a lane's edge from the analytic one: chords, and two libraries' map projections."""

_READER = """
import json, sys
import xml.etree.ElementTree as tree
import lanelet2
from lanelet2 import io, projection, routing, traffic_rules
first = tree.parse(sys.argv[1]).getroot().find("node")
origin = io.Origin(float(first.get("lat")), float(first.get("lon")))
content, errors = io.loadRobust(sys.argv[1], projection.UtmProjector(origin))
rules = traffic_rules.create(traffic_rules.Locations.Germany, traffic_rules.Participants.Vehicle)
graph = routing.RoutingGraph(content, rules)
lanes = []
for lane in content.laneletLayer:
    left, right = graph.left(lane), graph.right(lane)
    lanes.append({
        "id": lane.id, "name": lane.attributes["synthroads_id"],
        "instance": int(lane.attributes["synthroads_instance"]),
        "left": [[point.x, point.y, point.z] for point in lane.leftBound],
        "right": [[point.x, point.y, point.z] for point in lane.rightBound],
        "next": [other.id for other in graph.following(lane)],
        "neighbours": [other.id for other in (left, right) if other],
        "limit": rules.speedLimit(lane).speedLimit, "mandatory": rules.speedLimit(lane).isMandatory,
    })
print(json.dumps({"errors": list(errors), "lanes": lanes, "first": [float(first.get("lon")), float(first.get("lat"))]}))
"""


def version() -> str | None:
    """Return its version; None if it isn't here."""
    found = metadata.distributions(name="lanelet2", path=[str(_FOLDER)])
    return next((item.version for item in found), None)


def bring() -> None:
    """Download it; it is built for some Pythons on Linux alone."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
    bringing.install(_FOLDER, [*pip, "--target", "{}", f"lanelet2=={VERSION}"])


def read(path: Path) -> dict[str, Any]:
    """Return what Lanelet2 reads of a map, and how its routing graph joins the lanes; in a process of its own."""
    script = f"import sys; sys.path.insert(0, {str(_FOLDER)!r})\n{_READER}"
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    return (
        {"errors": [done.stderr[-400:]], "lanes": []} if done.returncode else json.loads(done.stdout.splitlines()[-1])
    )


def verdict(samples: Samples) -> list[str]:
    """Return errors of its reader, edges of lanes that lie elsewhere, lanes that lead nowhere, and wrong limits.

    Besides the motorway's map that of a village is judged.
    """
    scenario = load_scenario("village-300m")
    village = sample_road(scenario.road, scenario.seed)
    (samples.folder / "village").mkdir(exist_ok=True)
    write_twin(village, samples.folder / "village", ["lanelet2"])
    return [
        *_faults(samples.file("twin.osm"), samples.geometry),
        *_faults(samples.folder / "village" / "twin.osm", RoadGeometry(village)),
    ]


def _faults(path: Path, geometry: RoadGeometry) -> list[str]:
    """Return what is wrong with the map of a road as Lanelet2 reads it."""
    from pyproj import Transformer

    seen, road = read(path), geometry.parameters
    if seen["errors"]:
        return list(seen["errors"])
    to_map = Transformer.from_crs(4326, road.metadata.epsg, always_xy=True)
    origin = np.array([*to_map.transform(*seen["first"]), 0.0]) - road.transform.translate
    lanes = {lane["id"]: lane for lane in seen["lanes"]}
    found = []
    carriageways = road.of_type(Carriageway)
    limits = {name: SpeedLimits(geometry, item.side) for name, item in carriageways.items()}
    for lane in lanes.values():
        distance, middle = _farthest(geometry, lane, origin)
        if distance > _STEP:
            found.append(f"an edge of {lane['name']} is {distance:.3f} m off")
        name = lane["name"].partition("/")[0]
        if name in limits:
            wanted = next(speed for start, end, speed in limits[name].stretches if start <= middle <= end)
            if abs(lane["limit"] - wanted) > 0.01:
                found.append(f"{lane['name']} has {lane['limit']:g} km/h at {middle:.0f} m, not {wanted:g}")
    return [*found, *_faults_of_ways(lanes, carriageways)]


def _faults_of_ways(lanes: dict[int, dict[str, Any]], carriageways: dict[str, Carriageway]) -> list[str]:
    """Return which lanes of the routing graph don't lead from one end of the road to the other, or lie alone."""
    found = []
    ends = {lane["name"] for lane in lanes.values() if not lane["next"]}
    through = {f"{name}/lane-{number}" for name, item in carriageways.items() for number in range(len(item.lanes))}
    for name in sorted(through - ends):
        found.append(f"{name} has no end")
    for name in sorted(through):
        pieces = [lane for lane in lanes.values() if lane["name"] == name]
        if sum(not lane["next"] for lane in pieces) != 1:
            found.append(f"{name} is broken")
        is_alone = len(carriageways[name.partition("/")[0]].lanes) == 1
        if any(bool(lane["neighbours"]) == is_alone for lane in pieces):
            found.append(f"{name} has {'a' if is_alone else 'no'} neighbour")
    extra = [lane for lane in lanes.values() if lane["name"] not in through]
    if extra and not any(lanes[other]["name"] in through for lane in extra for other in lane["neighbours"]):
        found.append("no through lane can be reached from an entry")
    return found


def _farthest(geometry: RoadGeometry, lane: dict[str, Any], origin: np.ndarray) -> tuple[float, float]:
    """Return how far (m) a through lane's edges are from the analytic ones, and its mean station; 0 for others."""
    name, _, number = lane["name"].partition("/lane-")
    if not number:
        return 0.0, 0.0
    item = geometry.parameters.objects[name]
    section = geometry.sections[item.side]
    inner, outer = ("left", "right") if item.traffic * item.sign < 0 else ("right", "left")
    farthest, middle = 0.0, 0.0
    for edge, boundary in ((inner, int(number) + 1), (outer, int(number))):
        station, offset = geometry.alignment.project(np.array(lane[edge])[:, :2] + origin[:2])
        wanted = item.sign * section.lane_boundaries(station)[:, boundary]
        farthest = max(farthest, float(np.abs(offset - wanted).max()))
        middle = float(station.min() + station.max()) / 2.0
    return farthest, middle


def with_a_moved_node(samples: Samples) -> Samples:
    """Return files in which a node of a lane's edge lies some metres to the north."""
    head, _, rest = samples.text("twin.osm").partition('lat="')
    degrees, _, tail = rest.partition('"')
    return samples.with_file("twin.osm", f'{head}lat="{float(degrees) + 3e-5:.11f}"{tail}'.encode())
