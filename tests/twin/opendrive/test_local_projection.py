"""OpenDRIVE in a projection about the site: readers of lat_0 and lon_0 alone find the road where the map has it."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from pyproj import Transformer

from headless.commands import command
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.twin.formats import write_twin
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.opendrive_reader import OpenDrive
from tests.helpers.roads.twin_roads import full_road

PLACES = {
    "west of the meridian": (25832, (294_000.0, 5_628_000.0, 180.0)),
    "on the meridian": (25832, (500_000.0, 5_628_000.0, 180.0)),
    "east of the meridian": (25832, (742_000.0, 5_330_000.0, 520.0)),
    "zone 33": (25833, (390_000.0, 5_820_000.0, 35.0)),
    "south of the equator": (32756, (334_000.0, 6_252_000.0, 20.0)),
    "Lambert": (2154, (652_000.0, 6_862_000.0, 60.0)),
}


def placed_road(name: str) -> RoadParameters:
    epsg, place = PLACES[name]
    data = full_road().to_dict()
    data["metadata"]["referenceSystem"] = f"https://www.opengis.net/def/crs/EPSG/0/{epsg}"
    data["transform"]["translate"] = list(place)
    return RoadParameters.from_dict(data)


def header_of(path: Path) -> tuple[ElementTree.Element, str]:
    header = ElementTree.parse(path).getroot().find("header")
    assert header is not None
    return header, header.findtext("geoReference", "")


@pytest.mark.parametrize("name", PLACES)
def test_the_line_is_where_the_map_has_it(tmp_path: Path, name: str) -> None:
    road = placed_road(name)
    write_opendrive(road, tmp_path / "twin.xodr", 0.01, local_projection=True)
    header, text = header_of(tmp_path / "twin.xodr")
    assert header.find("offset") is None
    into_map = Transformer.from_crs(text, road.metadata.epsg, always_xy=True)
    geometry, shift = RoadGeometry(road), np.array(road.transform.translate)
    stations = np.linspace(0.0, geometry.length, 50)
    for read in OpenDrive.read(tmp_path / "twin.xodr"):
        position, _ = read.reference(stations)
        found = np.column_stack(into_map.transform(*position.T[:2]))
        away = np.hypot(*(found - shift[:2] - geometry.alignment.position(stations)).T)
        far = np.hypot(*geometry.alignment.position(stations).T)
        assert (away < 0.001 + 5e-9 * far**2).all(), away.max()
        assert np.abs(read.elevation(stations) - geometry.profile.elevation(stations) - shift[2]).max() < 0.5


def test_only_the_plan_the_heights_and_the_header_differ(tmp_path: Path) -> None:
    road = placed_road("west of the meridian")
    write_opendrive(road, tmp_path / "a.xodr", 0.01)
    write_opendrive(road, tmp_path / "b.xodr", 0.01, local_projection=True)
    for path in ("a.xodr", "b.xodr"):
        text = (tmp_path / path).read_text()
        text = re.sub(r'<geometry [^>]*length="', '<geometry length="', text)
        text = re.sub(r"<elevation [^>]*>", "", text)
        text = re.sub(r"<header .*</geoReference>\s*(<offset[^>]*>)?", "", text, flags=re.DOTALL)
        (tmp_path / path).write_text(re.sub(r"\s+", " ", text))
    assert (tmp_path / "a.xodr").read_text() == (tmp_path / "b.xodr").read_text()


def test_readers_of_latitude_and_longitude_alone_find_the_site(tmp_path: Path) -> None:
    write_twin(placed_road("west of the meridian"), tmp_path, ["opendrive"], local_projection=True)
    _, text = header_of(tmp_path / "twin.xodr")
    found = [float(re.search(rf"\+{name}=(\S+)", text)[1]) for name in ("lat_0", "lon_0")]
    longitude, latitude = Transformer.from_crs(25832, 4326, always_xy=True).transform(294_000.0, 5_628_000.0)
    assert found == pytest.approx([latitude, longitude], abs=1e-9)


def test_the_command_has_it_as_an_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "road.json").write_text(placed_road("zone 33").to_json())
    words = [str(tmp_path / "road.json"), "--output", str(tmp_path / "out"), "--local-projection", "--twin"]
    assert command("twin", [*words, "opendrive"]) == 0
    assert "+proj=tmerc +lat_0=52." in header_of(tmp_path / "out/twin.xodr")[1]
    capsys.readouterr()
    assert command("twin", [*words, "geojson"]) == 2
    assert capsys.readouterr().err == "error: --local-projection: is for opendrive, which isn't among geojson\n"
