"""Villages in OpenDRIVE, driven through by SUMO in both directions: no teleport, no stop, the village's speed."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.side_roads.side_road import SideRoad
from synthroads_addon.road.streets.street_side import StreetSide
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.judges import require

ROADS = {
    "RQ10.5": {"cross_section": "RQ10.5"},
    "slow": {"cross_section": "RQ9", "villages": {"share": 1.0, "slow": 1.0}},
    "Britain": {"design_class": "DMRB85"},
    "islands": {
        "cross_section": "RQ10.5",
        "villages": {"share": 1.0, "islands": 1.0, "length": {"minimum": 380.0, "maximum": 400.0}},
    },
}
LIMITS = {"RQ10.5": 50.0, "slow": 30.0, "Britain": 48.28, "islands": 50.0}
"""Speed limit in the village, km/h."""


def village(name: str) -> RoadParameters:
    limits = {"length": 700.0, "villages": {"share": 1.0, "crossing": 1.0, "bus_stop": 1.0}}
    side_roads = {"per_km": {"minimum": 4.0, "maximum": 4.0}, "tracks": 0.0}
    plants = {"trees_per_hectare": 0.0, "shrubs_per_hectare": 0.0, "grass_density": 0.0}
    scenario = limits | {"side_roads": side_roads} | plants | ROADS[name]
    return next(
        road
        for road in (sample_road(RoadScenario.from_dict(scenario), seed) for seed in range(9))
        if road.of_type(SideRoad)
    )


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "RQ10.5" else pytest.mark.slow) for name in ROADS]
)
def test_sumo_drives_through_both_ways_at_the_villages_speed(name: str, tmp_path: Path) -> None:
    require("eclipse-sumo")
    from tests.judges import sumo

    road = village(name)
    path, net = tmp_path / "road.xodr", tmp_path / "net.xml"
    write_opendrive(road, path, 0.01)
    # Cars would be kept from lanes below 1.8 m.
    files = ("--opendrive-files", str(path), "--output-file", str(net), "--opendrive.min-width", "1")
    done = sumo._run("netconvert", *files, "--offset.disable-normalization", "--no-turnarounds", "--precision", "4")
    assert done.returncode == 0
    assert "Error" not in done.stderr
    root = ElementTree.parse(net).getroot()
    geometry, length = RoadGeometry(road), road.alignment.length
    places = {n.attrib["id"]: _place(geometry, n) for n in root.iter("junction") if n.get("type") != "internal"}
    edges = [edge.attrib for edge in root.iter("edge") if edge.get("function") != "internal"]
    flows = []
    for begin, end in ((0.0, length), (length, 0.0)):
        (start,) = (edge["id"] for edge in edges if _is_at(places[edge["from"]], begin))
        (last,) = (edge["id"] for edge in edges if _is_at(places[edge["to"]], end))
        flows.append((start, last))
    routes = ElementTree.Element("routes")
    ElementTree.SubElement(
        routes,
        "vType",
        {"id": "car", "length": "4", "vClass": "passenger", "sigma": "0", "speedFactor": "1", "speedDev": "0"},
    )
    for number, (start, end) in enumerate(flows):
        way = {"begin": "0", "end": "200", "period": "20", "from": start, "to": end, "departSpeed": "max"}
        ElementTree.SubElement(routes, "flow", {"id": f"flow-{number}", "type": "car", **way})
    ElementTree.ElementTree(routes).write(tmp_path / "routes.xml")
    seen, said = tmp_path / "seen.xml", tmp_path / "said.xml"
    options = ("--net-file", str(net), "--route-files", str(tmp_path / "routes.xml"), "--fcd-output", str(seen))
    done = sumo._run(
        "sumo", *options, "--statistic-output", str(said), "--step-length", "0.5", "--no-step-log", "--end", "900"
    )
    assert done.returncode == 0, done.stderr
    statistics = ElementTree.parse(said).getroot()
    vehicles, teleports = (statistics.find(tag).attrib for tag in ("vehicles", "teleports"))
    assert int(vehicles["inserted"]) == int(vehicles["loaded"]) == 20
    assert (vehicles["running"], vehicles["waiting"], teleports["total"]) == ("0", "0", "0")
    items = list(ElementTree.parse(seen).iter("vehicle"))
    rows = np.array([[float(item.attrib[key]) for key in ("x", "y", "speed")] for item in items])
    assert rows[:, 2].min() > 1.0
    station, _ = geometry.alignment.project(rows[:, :2])
    street = next(iter(road.of_type(StreetSide).values()))
    # Vehicles brake before the village, and keep its speed up to its end.
    inside = (station > street.start_station + 15.0) & (station < street.end_station - 15.0)
    fastest = 3.6 * rows[inside, 2].max()
    assert 0.85 * LIMITS[name] < fastest < 1.03 * LIMITS[name]
    assert 3.6 * rows[~inside, 2].max() > 1.2 * LIMITS[name]


def _place(geometry: RoadGeometry, node: ElementTree.Element) -> tuple[float, float]:
    """Return station and offset of a node, m."""
    point = np.array([[float(node.attrib["x"]), float(node.attrib["y"])]])
    station, offset = geometry.alignment.project(point)
    return float(station[0]), float(offset[0])


def _is_at(place: tuple[float, float], station: float) -> bool:
    """Return whether a node lies at one end of the main road."""
    return abs(place[0] - station) < 1.0 and abs(place[1]) < 8.0
