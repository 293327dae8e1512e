"""Lanelet2's map, judged by Lanelet2's own library."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import metadata
from typing import Any

import numpy as np

from synthroads_addon.road.section import Carriageway
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


def read(samples: Samples) -> dict[str, Any]:
    """Return what Lanelet2 reads of the map, and how its routing graph joins the lanes; in a process of its own."""
    script = f"import sys; sys.path.insert(0, {str(_FOLDER)!r})\n{_READER}"
    words = [sys.executable, "-c", script, str(samples.file("twin.osm"))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return (
        {"errors": [done.stderr[-400:]], "lanes": []} if done.returncode else json.loads(done.stdout.splitlines()[-1])
    )


def verdict(samples: Samples) -> list[str]:
    """Return errors of its reader, edges of lanes that lie elsewhere, and lanes that lead nowhere."""
    from pyproj import Transformer

    seen = read(samples)
    if seen["errors"]:
        return list(seen["errors"])
    to_map = Transformer.from_crs(4326, samples.road.metadata.epsg, always_xy=True)
    origin = np.array([*to_map.transform(*seen["first"]), 0.0]) - samples.road.transform.translate
    lanes = {lane["id"]: lane for lane in seen["lanes"]}
    found = []
    for lane in lanes.values():
        distance = _farthest(samples, lane, origin)
        if distance > _STEP:
            found.append(f"an edge of {lane['name']} is {distance:.3f} m off")
    ends = {lane["name"] for lane in lanes.values() if not lane["next"]}
    through = {
        f"{name}/lane-{number}"
        for name, item in samples.road.of_type(Carriageway).items()
        for number in range(len(item.lanes))
    }
    for name in sorted(through - ends):
        found.append(f"{name} has no end")
    for name in sorted(through):
        pieces = [lane for lane in lanes.values() if lane["name"] == name]
        if sum(not lane["next"] for lane in pieces) != 1:
            found.append(f"{name} is broken")
        if not all(lane["neighbours"] for lane in pieces):
            found.append(f"{name} has no neighbour")
    extra = [lane for lane in lanes.values() if lane["name"] not in through]
    if not any(lanes[other]["name"] in through for lane in extra for other in lane["neighbours"]):
        found.append("no through lane can be reached from an entry")
    return found


def _farthest(samples: Samples, lane: dict[str, Any], origin: np.ndarray) -> float:
    """Return how far (m) a through lane's edges are from the analytic ones; 0 for others."""
    name, _, number = lane["name"].partition("/lane-")
    if not number:
        return 0.0
    item = samples.road.objects[name]
    section = samples.geometry.sections[item.side]
    inner, outer = ("left", "right") if item.traffic * item.sign < 0 else ("right", "left")
    farthest = 0.0
    for edge, boundary in ((inner, int(number) + 1), (outer, int(number))):
        station, offset = samples.geometry.alignment.project(np.array(lane[edge])[:, :2] + origin[:2])
        wanted = item.sign * section.lane_boundaries(station)[:, boundary]
        farthest = max(farthest, float(np.abs(offset - wanted).max()))
    return farthest


def with_a_moved_node(samples: Samples) -> Samples:
    """Return files in which a node of a lane's edge lies some metres to the north."""
    head, _, rest = samples.text("twin.osm").partition('lat="')
    degrees, _, tail = rest.partition('"')
    return samples.with_file("twin.osm", f'{head}lat="{float(degrees) + 3e-5:.11f}"{tail}'.encode())
