"""A road comes back from its cloud: the command on clouds thrown onto analytic roads, which know no Blender."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from pyproj import CRS

from headless.cli import main
from synthroads_addon.base.maps.crs import wkt
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.reconstruction.comparison import compare_axis
from synthroads_addon.road.axes.centerline import read_axis
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import read_parameters
from tests.helpers.clouds.road_clouds import cloud_of, road, write

ROADS = [("RQ31", "EKA1A", 4), pytest.param(("RQ25", "EKA3", 9), marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=ROADS, ids=("RQ31", "RQ25"))
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a reconstruction, and what it says."""
    folder = tmp_path_factory.mktemp("reconstruct")
    section, design_class, seed = request.param
    truth = road(section, design_class, 300.0, seed)
    (folder / "truth.json").write_text(truth.to_json(), encoding="utf-8")
    cloud = write(folder / "cloud.laz", cloud_of(truth, 15.0, seed))
    words = ["reconstruct", str(cloud), "--output", str(folder / "out"), "--truth", str(folder / "truth.json")]
    assert main([*words, "--twin", "cityjson,opendrive", "--quiet"]) == 0
    return folder, json.loads((folder / "out/reconstruction.json").read_text())["comparison"]


def test_its_line_and_section_come_back(made: tuple[Path, dict[str, Any]]) -> None:
    _, found = made
    assert found["covered"] > 0.9
    assert found["centreline"]["largest"] < 0.10
    assert found["profile"]["largest"] < 0.05
    for side in ("left", "right"):
        carriageway = found["carriageways"][side]
        assert carriageway["lanes"][0] == carriageway["lanes"][-1]
        assert carriageway["lanes_right"] == 1.0
        assert abs(carriageway["width"]["mean"]) < 0.15


def test_its_furniture_comes_back(made: tuple[Path, dict[str, Any]]) -> None:
    _, found = made
    assert found["barriers"]["recall"] >= 0.8
    assert found["delineators"]["recall"] >= 0.8
    assert found["barriers"]["precision"] >= 0.8
    assert found["delineators"]["precision"] >= 0.8


def test_it_is_a_road_like_any_other(made: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = made
    parameters = read_parameters(folder / "out/parameters.json")
    assert RoadGeometry(parameters).length > 270.0
    names = {path.name for path in (folder / "out").iterdir()}
    assert names == {
        *("parameters.json", "reconstruction.json", "centerline.geojson", "reconstruction.png"),
        *("twin.city.json", "twin.xodr", "twin-cityjson-report.json", "twin-opendrive-report.json"),
    }
    assert (folder / "out/reconstruction.png").read_bytes().startswith(b"\x89PNG")


def test_a_known_axis_is_compared_with(made: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """The line alone, as a road network has it: the same offsets as from the parameters, and none from far away."""
    folder, from_parameters = made
    found, truth = read_parameters(folder / "out/parameters.json"), read_parameters(folder / "truth.json")
    geometry = RoadGeometry(truth)
    line = geometry.alignment.position(np.arange(0.0, geometry.length, 1.0)) + truth.transform.translate[:2]
    np.savetxt(tmp_path / "axis.csv", line, delimiter=",", header="x,y", comments="")
    one = compare_axis(found, read_axis(tmp_path / "axis.csv"))
    assert one["covered"] == from_parameters["covered"]
    assert one["centreline"]["mae"] == pytest.approx(from_parameters["centreline"]["mae"], abs=2e-4)
    assert compare_axis(found, read_axis(tmp_path / "axis.csv") + [0.0, 2.0, 0.0])["centreline"]["mae"] > 0.3
    before = np.column_stack([line[:2] - 60.0 * (line[1] - line[0]), np.zeros(2)])
    assert compare_axis(found, before) == {"covered": 0.0, "centreline": {}}


def test_wrong_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, message in (
        (["no-such.laz"], "no such file"),
        (["no-such.laz", "--fit-tolerance", "9"], "--fit-tolerance is 9.0"),
    ):
        assert main(["reconstruct", *words, "--output", str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert message in said
        assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def in_feet(path: Path, output: Path, system: str, unit: float) -> Path:
    """Write a cloud as others would have it in a system with another unit (m); return the path."""
    las = laspy.read(path)
    there = las.xyz / unit
    las.change_scaling(scales=[1e-4] * 3, offsets=np.floor(there.min(axis=0)))
    las.xyz = there
    (record,) = las.header.vlrs.get("WktCoordinateSystemVlr")
    record.string = CRS.from_user_input(system).to_wkt("WKT1_GDAL")
    las.write(output)
    return output


@pytest.fixture(scope="module")
def in_metres_and_feet(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return folders of reconstructions from one cloud in California, in metres and in US survey feet."""
    folder = tmp_path_factory.mktemp("units")
    truth = road("RQ31", "EKA1A", 200.0, 4)
    block = cloud_of(truth, 15.0, 4)
    block = replace(block, xyz=block.xyz - block.xyz[0] + [1_900_000.0, 640_000.0, 150.0])
    with open_writer(folder / "metres.las", None, block.xyz[0], 60_000.0, (), crs_text=wkt(26941, 5703)) as writer:
        writer.write(block)
    in_feet(folder / "metres.las", folder / "feet.las", "EPSG:2225+6360", 1200.0 / 3937.0)
    for name in ("metres", "feet"):
        words = ["reconstruct", str(folder / f"{name}.las"), "--output", str(folder / name), "--no-picture", "--quiet"]
        assert main([*words, "--twin", "cityjson,opendrive,geojson"]) in (0, 3)
    return {name: folder / name for name in ("metres", "feet")}


def test_a_cloud_in_feet_gives_the_road_of_one_in_metres(in_metres_and_feet: dict[str, Path]) -> None:
    lines = {name: read_axis(folder / "centerline.geojson") for name, folder in in_metres_and_feet.items()}
    apart = np.interp(lines["feet"][:, 0], *lines["metres"][np.argsort(lines["metres"][:, 0])][:, :2].T)
    assert np.abs(apart - lines["feet"][:, 1]).max() < 0.01


@pytest.mark.parametrize("name", ["metres", "feet"])
def test_both_codes_of_a_cloud_are_written_again(name: str, in_metres_and_feet: dict[str, Path]) -> None:
    folder = in_metres_and_feet[name]
    remarks = json.loads((folder / "reconstruction.json").read_text())["remarks"]
    assert ["EPSG:2225" in remark and "metres" in remark for remark in remarks] == [True] * (name == "feet")
    metadata = read_parameters(folder / "parameters.json").metadata
    assert (metadata.epsg, metadata.height_epsg) == (26941, 5703)
    for file in ("centerline.geojson", "twin.geojson"):
        named = json.loads((folder / file).read_text())["crs"]["properties"]["name"]
        assert named == "urn:ogc:def:crs,crs:EPSG::26941,crs:EPSG::5703"
    about = json.loads((folder / "twin.city.json").read_text())["metadata"]
    assert about["referenceSystem"].endswith("/26941")
    assert about["heightReferenceSystem"].endswith("/5703")
    assert 'code="height_epsg" value="5703"' in (folder / "twin.xodr").read_text()
