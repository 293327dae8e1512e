"""Street sides in CityJSON and IFC: valid, on the analytic surface, in the classes that those formats have for them."""

from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.streets.street_side import StreetSide
from synthroads_addon.twin.cityjson.writer import write_cityjson
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
