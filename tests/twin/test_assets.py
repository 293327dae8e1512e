"""Assets in the twins: what their library says they are, else what things of their class are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ifcopenshell
import jsonschema_rs
import pytest

from synthroads_addon.base.classes import classes
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.asset import AssetTypes, class_types
from synthroads_addon.scenario.assets import read_asset_library
from synthroads_addon.twin.formats import write_twin
from tests.helpers.files.cityjson_files import faults_of, read_city
from tests.helpers.files.ifc_reading import named
from tests.helpers.files.twin_reports import read_report
from tests.helpers.roads.furnished_data import road_data
from tests.helpers.roads.thing_variants import straight_road
from tests.judges import JUDGES
from tests.judges.cityjson import official_schema, unfitting_objects
from tests.judges.ifc import issues

OWN: dict[str, dict[str, str]] = {
    "fence": {"ifc": "IfcRailing.FENCE", "opendrive": "barrier.fence"},
    "station": {"ifc": "IfcTransformer.VOLTAGE", "cityjson": "OtherConstruction"},
}


def road(**more: dict[str, str]) -> RoadParameters:
    """Return a road with an asset of every class, some whose library says what they are, and one of no known class."""
    assets = {f"a-{name}": {"class_name": name} for name in class_types()}
    assets |= {name: {"class_name": "utility", "twin_types": types} for name, types in (OWN | more).items()}
    assets["bench"] = {"class_name": "bench"}
    for number, (name, item) in enumerate(assets.items()):
        place = {"station": 10.0 + 10.0 * number, "offset": -22.0, "library": "roadside", "name": name}
        assets[name] = {"type": "Asset", **place, **item}
    return RoadParameters.from_dict(road_data(straight_road(assets), 300.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    write_twin(road(), folder, ["cityjson", "ifc", "opendrive"])
    return folder


def test_every_class_says_what_its_things_are() -> None:
    assert set(class_types()) == {row.name for row in classes()}
    for types in class_types().values():
        assert AssetTypes.from_dict(types).to_dict() == types


def test_they_are_what_their_class_or_their_library_says(folder: Path) -> None:
    file = ifcopenshell.open(str(folder / "twin.ifc"))
    objects = json.loads((folder / "twin.city.json").read_text())["CityObjects"]
    drive = {item.get("name"): item for item in ElementTree.parse(folder / "twin.xodr").iter("object")}
    wanted: dict[str, dict[str, Any]] = {f"a-{name}": types for name, types in class_types().items()}
    wanted |= {name: class_types()["utility"] | types for name, types in OWN.items()}
    for name, types in wanted.items():
        element = named(file, name)
        assert f"{element.is_a()}.{element.PredefinedType}" == types["ifc"]
        assert element.ObjectType == name
        assert objects[name]["type"] == types["cityjson"]
        told = ".".join(filter(None, (drive[name].get("type"), drive[name].get("subtype"))))
        assert told == types["opendrive"]
    assert {item.Name for item in file.by_type("IfcBuildingElementProxy")} == {"bench"}


def test_what_nothing_is_known_of_is_told(folder: Path) -> None:
    reduced = [(row["id"], row["reason"]) for row in read_report(folder, "ifc").data["reduced"]]
    assert [name for name, reason in reduced if "a proxy" in reason] == ["bench"]
    assert {name for name, reason in reduced if "its place alone" in reason} >= {"bench", *OWN}


def test_cityjson_with_assets_is_valid(folder: Path) -> None:
    city = read_city(folder / "twin.city.json")
    assert faults_of(city) == []
    if JUDGES["cityjson-schema"].version():
        assert unfitting_objects(jsonschema_rs.Draft7Validator(official_schema()), city.data) == []


@pytest.mark.slow
def test_ifc_with_assets_keeps_the_rules(folder: Path) -> None:
    assert issues(ifcopenshell.open(str(folder / "twin.ifc"))) == []


@pytest.mark.parametrize("ifc", ["IfcFence.FENCE", "IfcRailing.HEDGE", "IfcProject.NONE", "IfcElement.USERDEFINED"])
def test_types_that_ifc_does_not_have_are_refused_by_name(ifc: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"objects\.odd\.twin_types\.ifc is .*: must be an element of IFC 4\.3"):
        write_twin(road(odd={"ifc": ifc}), tmp_path, ["ifc"])


def test_the_shipped_library_says_what_its_assets_are() -> None:
    fence = read_asset_library("roadside").assets["wildlife_fence"]
    assert fence.twin_types == AssetTypes(ifc="IfcRailing.FENCE", opendrive="barrier.fence")
