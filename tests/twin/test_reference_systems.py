"""Map and vertical coordinate system through every format of the geometric-semantic model, and back."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from synthroads_addon.base.maps.crs import EPSG_URI, MapSystem
from synthroads_addon.road.parameters import RoadParameters, read_parameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.formats import FORMATS, write_twin

Codes = tuple[int, int | None]


def road(epsg: int, height_epsg: int | None) -> RoadParameters:
    bare = {"shrubs_per_hectare": 0.0, "trees_per_hectare": 0.0, "grass_density": 0.0}
    return sample_road(RoadScenario(length=40.0, epsg=epsg, height_epsg=height_epsg, **bare), 3)


def of_system(system: MapSystem) -> Codes:
    assert system.epsg is not None
    return system.epsg, system.height_epsg


def of_geojson(path: Path) -> Codes:
    return of_system(MapSystem.read(json.loads(path.read_text())["crs"]["properties"]["name"]))


def of_cityjson(path: Path) -> Codes:
    metadata = json.loads(path.read_text())["metadata"]
    epsg, height = of_system(MapSystem.read(metadata["referenceSystem"]))
    beside = metadata.get("heightReferenceSystem")
    assert height is None or beside is None or beside.endswith(f"/{height}")
    return epsg, int(beside.rsplit("/", 1)[1]) if beside else height


def of_ifc(path: Path) -> Codes:
    text = path.read_text()
    name = re.search(r"IFCPROJECTEDCRS\('([^']*)'", text)
    assert name
    beside = re.search(r"'heightReferenceSystem',\$,IFC\w+\('([^']*)'\)", text)
    epsg, height = of_system(MapSystem.read(name[1]))
    return epsg, int(beside[1].rsplit("/", 1)[1]) if beside else height


def of_opendrive(path: Path) -> Codes:
    header = ElementTree.parse(path).getroot().find("header")
    assert header is not None
    told = {item.get("code"): item.get("value") for item in header.iter("userData")}
    epsg, height = of_system(MapSystem.of(int(str(told["epsg"]))))
    return epsg, int(told["height_epsg"]) if told.get("height_epsg") else height


def of_opencrg(path: Path) -> Codes:
    head = path.read_bytes().split(b"$\n")[0].decode("ascii", "replace")
    plan = re.search(r"^in \S+/(\d+)", head, re.M)
    heights = re.search(r"^heights in \S+/(\d+)", head, re.M)
    assert plan
    epsg, height = of_system(MapSystem.of(int(plan[1])))
    return epsg, int(heights[1]) if heights else height


def of_geopackage(path: Path) -> Codes:
    import pyogrio

    return of_system(MapSystem.read(pyogrio.read_info(path, layer="centerline")["crs"]))


READ: dict[str, Callable[[Path], Codes]] = {
    "geojson": of_geojson,
    "geopackage": of_geopackage,
    "cityjson": of_cityjson,
    "ifc": of_ifc,
    "opendrive": of_opendrive,
    "opencrg": of_opencrg,
}
PAIRS = {
    "map alone": ((25832, None), (25832, None)),
    "pair without a code": ((25832, 7837), (25832, 7837)),
    "pair with a code": ((25832, 5783), (25832, 5783)),
    "code of a pair": ((5555, None), (25832, 5783)),
    "Swiss": ((2056, 5728), (2056, 5728)),
    "French": ((2154, 5720), (2154, 5720)),
    "American": ((26941, 5703), (26941, 5703)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_both_codes_come_back_from_every_format(name: str, tmp_path: Path) -> None:
    given, wanted = PAIRS[name]
    write_twin(road(*given), tmp_path, tuple(READ), 0.02)
    read = {kind: reader(tmp_path / FORMATS[kind].file) for kind, reader in READ.items()}
    assert read == dict.fromkeys(READ, wanted)


@pytest.mark.parametrize("name", PAIRS)
def test_both_codes_come_back_from_parameters(name: str, tmp_path: Path) -> None:
    given, wanted = PAIRS[name]
    (tmp_path / "parameters.json").write_text(road(*given).to_json())
    metadata = read_parameters(tmp_path / "parameters.json").metadata
    assert (metadata.epsg, metadata.height_epsg) == given
    assert of_system(metadata.system) == wanted


def test_a_pair_that_has_a_code_is_named_by_it(tmp_path: Path) -> None:
    write_twin(road(25832, 5783), tmp_path, ("cityjson", "ifc"), 0.02)
    metadata = json.loads((tmp_path / "twin.city.json").read_text())["metadata"]
    assert metadata["referenceSystem"] == EPSG_URI.format(5555)
    assert "IFCPROJECTEDCRS('EPSG:5555'" in (tmp_path / "twin.ifc").read_text()
    assert "'Deutsches Haupthoehennetz 1992'" in (tmp_path / "twin.ifc").read_text()
