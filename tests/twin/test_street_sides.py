"""Street sides in CityJSON and IFC: valid, on the analytic surface, in the classes that those formats have for them."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.streets.street_side import StreetSide
from synthroads_addon.road.things.bus_shelter import BusShelter
from synthroads_addon.road.things.traffic_island import TrafficIsland
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.cityjson.writer import write_cityjson
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.cityjson_files import City, faults_of, read_city
from tests.helpers.files.ifc_reading import named, said, whole_body, written
from tests.helpers.roads.villages import village_road
from tests.judges.ifc import issues

TOLERANCE = 0.001
MILLIMETRE = 1e-3


@pytest.fixture(scope="module")
def road() -> RoadParameters:
    return village_road()


@pytest.fixture(scope="module")
def city(road: RoadParameters, tmp_path_factory: pytest.TempPathFactory) -> City:
    path = tmp_path_factory.mktemp("city") / "a.city.json"
    write_cityjson(road, path, TOLERANCE)
    return read_city(path)


@pytest.fixture(scope="module")
def file(road: RoadParameters, tmp_path_factory: pytest.TempPathFactory) -> Any:
    return written(road, tmp_path_factory.mktemp("ifc"), TOLERANCE)


def off_the_road(road: RoadParameters, points: np.ndarray) -> float:
    """Return the largest distance (m) in height of points (N, 3), on edges of strips, from the analytic surface."""
    geometry = RoadGeometry(road)
    local = points - np.array(road.transform.translate)
    station, offset = geometry.alignment.project(local[:, :2])
    offsets, heights = geometry.boundaries(station)
    beside, above = np.abs(offsets - offset[:, None]), np.abs(heights - local[:, 2:])
    return float(np.hypot(beside, above).min(axis=1).max())


def test_cityjson_has_areas_for_traffic_and_beside_it(road: RoadParameters, city: City) -> None:
    assert faults_of(city) == []
    sides = road.of_type(StreetSide)
    found = {}
    for name, about, rings in city.surfaces():
        if name in sides:
            found[name, about["strip"]] = about
            assert off_the_road(road, np.concatenate(rings)) < MILLIMETRE
    kinds = {"gutter", "parking_bay", "kerb_face", "kerb", "footway"}
    assert {kind for name, kind in found if name == "street-left"} == kinds
    assert {kind for name, kind in found if name == "street-right-2"} == kinds - {"gutter", "parking_bay"}
    for (name, kind), about in found.items():
        assert about["type"] == ("TrafficArea" if kind in ("footway", "parking_bay") else "AuxiliaryTrafficArea")
        assert about["instance"] == sides[name].instance
    assert found["street-right", "footway"]["surfaceMaterial"] == ["asphalt"]
    assert found["street-right-2", "footway"]["surfaceMaterial"] == ["setts"]
    assert found["street-right-2", "kerb"]["surfaceMaterial"] == ["concrete"]


def test_ifc_has_kerbs_and_pavements(road: RoadParameters, file: Any) -> None:
    assert issues(file) == []
    for name, side in road.of_type(StreetSide).items():
        kerb, footway = named(file, f"{name}/kerb", "IfcKerb"), named(file, f"{name}/footway", "IfcPavement")
        assert said(kerb)["instance"] == said(footway)["instance"] == side.instance
        for item in (kerb, footway):
            assert off_the_road(road, whole_body(item).reshape(-1, 3) + np.array(road.transform.translate)) < MILLIMETRE
        # The kerb's face belongs to it: between them they rise by the kerb's height.
        parts = [part for part in file.by_type("IfcRoadPart") if part.Name == f"{name}/footway"]
        assert [part.PredefinedType for part in parts] == ["SIDEWALK"]
    bays = [part for part in file.by_type("IfcRoadPart") if part.PredefinedType == "PARKINGBAY"]
    assert [part.Name for part in bays] == ["street-left/parking-bay"]


@pytest.fixture(scope="module")
def island_road() -> RoadParameters:
    limits = {
        "share": 1.0,
        "islands": 1.0,
        "shelters": 1.0,
        "bus_stop": 1.0,
        "length": {"minimum": 200.0, "maximum": 200.0},
    }
    plain = {"trees_per_hectare": 0.0, "shrubs_per_hectare": 0.0, "grass_density": 0.0}
    scenario = {"cross_section": "RQ10.5", "length": 260.0, "villages": limits | {"one_sided_islands": 0.0}, **plain}
    return next(
        road
        for road in (sample_road(RoadScenario.from_dict(scenario), seed) for seed in range(9))
        if road.of_type(TrafficIsland) and road.of_type(BusShelter)
    )


def test_islands_and_shelters_are_valid_in_cityjson_and_ifc(island_road: RoadParameters, tmp_path: Path) -> None:
    write_cityjson(island_road, tmp_path / "a.city.json", 0.01)
    assert faults_of(read_city(tmp_path / "a.city.json")) == []
    file = written(island_road, tmp_path, 0.01)
    assert issues(file) == []
    kerb, paving = named(file, "island-1/kerb", "IfcKerb"), named(file, "island-1/paving", "IfcPavement")
    island = island_road.objects["island-1"]
    rise = np.ptp(whole_body(paving).reshape(-1, 3)[:, 2]) - np.ptp(whole_body(kerb).reshape(-1, 3)[:, 2])
    assert abs(rise) < 0.05
    assert said(kerb)["instance"] == island.instance


def test_opendrive_has_the_island_between_lanes_that_keep_their_width(
    island_road: RoadParameters, tmp_path: Path
) -> None:
    path = tmp_path / "a.xodr"
    write_opendrive(island_road, path, 0.01)
    road = ElementTree.parse(path).getroot().find("road")
    assert road is not None
    types = [item.get("type") for item in road.iter("object") if item.get("name", "").startswith("island-1")]
    assert "trafficIsland" in types
    island = island_road.objects["island-1"]
    sections = [item for item in road.findall("lanes/laneSection") if float(item.get("s", 0)) <= island.station]
    lanes = {lane.get("type"): lane for lane in sections[-1].iter("lane")}
    local = island.station - float(sections[-1].get("s", 0))

    def width(lane: ElementTree.Element) -> float:
        """Return a lane's width at the island, m."""
        pieces = [item for item in lane.findall("width") if float(item.get("sOffset", 0)) <= local]
        ds = local - float(pieces[-1].get("sOffset", 0))
        return sum(float(pieces[-1].get(name, 0)) * ds**power for power, name in enumerate("abcd"))

    assert width(lanes["driving"]) == pytest.approx(3.5, abs=0.01)
    inner = [lane for lane in sections[-1].iter("lane") if abs(int(lane.get("id", 0))) == 1]
    assert sum(width(lane) for lane in inner) == pytest.approx(island.width + 0.5, abs=0.01)
