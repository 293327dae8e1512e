"""Vector files of geographic information systems: lines by name, systems, heights, parts, and listed formats alone."""

from __future__ import annotations

import shutil
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError, MissingPackageError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_source import axis_from_file, listed_lines
from synthroads_addon.road.geometry import alignment_of, profile_of
from synthroads_addon.road_files.read import format_of
from synthroads_addon.road_files.vector import DRIVERS, _line_of
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.written_maps import Points, bend, degrees, several_parts, vector_file, well_known_binary

ENDINGS = {"GPKG": ".gpkg", "ESRI Shapefile": ".shp", "FlatGeobuf": ".fgb"}


@pytest.fixture(autouse=True)
def _library() -> None:
    pytest.importorskip("pyogrio")


def line() -> Points:
    station, points = bend().points(5.0)
    return np.column_stack([points, 100.0 + 0.01 * station])


def deviation(path: Path, scenario: RoadScenario | None = None) -> tuple[float, float, RoadScenario]:
    axis, there, _ = axis_from_file(path, scenario or RoadScenario(), 1)
    points = line()
    station, offset = alignment_of(axis).project(points[:, :2] - np.array(there.map_origin[:2]))
    height = profile_of(axis).elevation(station) + there.map_origin[2]
    return float(np.abs(offset).max()), float(np.abs(height - points[:, 2]).max()), there


@pytest.mark.parametrize("driver", list(ENDINGS))
def test_a_line_is_taken_with_its_system_and_heights(tmp_path: Path, driver: str) -> None:
    shapes = {"short": well_known_binary(line()[:20]), "axis": well_known_binary(line())}
    path = vector_file(tmp_path / f"a{ENDINGS[driver]}", driver, shapes, crs="EPSG:25833")
    assert DRIVERS[format_of(path) or ""] == driver
    plan, height, scenario = deviation(path)
    assert max(plan, height) < 0.01
    assert scenario.epsg == 25833
    rows = sorted(listed_lines(path), key=lambda row: int(row["points"]))  # an index has its own order
    assert [(row["name"], row["points"], row["heights"], row["system"]) for row in rows] == [
        ("short", 20, True, "EPSG:25833"),
        ("axis", len(line()), True, "EPSG:25833"),
    ]
    assert axis_from_file(path, RoadScenario(), 1, "short")[2]["name"] == "short"
    with pytest.raises(InputError, match=r"must be one of the roads in the file: ('short', 'axis'|'axis', 'short')"):
        axis_from_file(path, RoadScenario(), 1, "long")


def test_degrees_and_systems_in_feet_become_metres(tmp_path: Path) -> None:
    points = line()
    rows = np.column_stack([degrees(points), points[:, 2]])
    path = vector_file(tmp_path / "a.gpkg", "GPKG", {"axis": well_known_binary(rows)}, crs="EPSG:4326")
    plan, height, scenario = deviation(path)
    assert scenario.epsg == 32632
    assert max(plan, height) < 0.01
    from pyproj import Transformer

    rows[:, :2] = np.column_stack(Transformer.from_crs(32610, 2926, always_xy=True).transform(*points[:, :2].T))
    path = vector_file(tmp_path / "feet.gpkg", "GPKG", {"axis": well_known_binary(rows)}, crs="EPSG:2926")
    with collected_remarks() as remarks:
        axis, there, _ = axis_from_file(path, RoadScenario(), 1)
    assert there.epsg == 32610
    assert "the road lies in EPSG:32610" in " ".join(remarks)
    assert axis.length == pytest.approx(bend().starts[-1], abs=5.1)


def test_zero_everywhere_is_no_height(tmp_path: Path) -> None:
    flat = line() * (1.0, 1.0, 0.0)
    for name, points in (("z.gpkg", flat), ("xy.gpkg", flat[:, :2])):
        kind = "LineString Z" if points.shape[1] == 3 else "LineString"
        path = vector_file(tmp_path / name, "GPKG", {"axis": well_known_binary(points)}, kind=kind)
        with collected_remarks() as remarks:
            axis, _, report = axis_from_file(path, RoadScenario(), 1)
        assert f"{name} has no heights: they are drawn" in " ".join(remarks)
        assert len(axis.vertical) == report["heights"]["points"]


def test_measures_are_no_heights() -> None:
    """In well-known binary with Z, M or both, in either order of bytes, and in the older way with flags."""
    rows = np.column_stack([line(), np.arange(len(line()), dtype=float)])
    for code, columns in ((3002, [0, 1, 2, 3]), (2002, [0, 1, 3]), (0xC0000002, [0, 1, 2, 3]), (0x40000002, [0, 1, 3])):
        for order in "<>":
            shape = (
                struct.pack(order + "BII", order == "<", code, len(rows))
                + rows[:, columns].astype(order + "f8").tobytes()
            )
            ((points, fault),) = _line_of("a", shape)
            assert fault is None
            assert np.array_equal(points, rows[:, :3] if 2 in columns else rows[:, :2])


def test_parts_that_meet_are_one_line_and_others_are_refused(tmp_path: Path) -> None:
    points = line()
    shapes = {
        "meet": several_parts([points[:50], points[49:]]),
        "apart": several_parts([points[:50], points[60:]]),
    }
    path = vector_file(tmp_path / "a.gpkg", "GPKG", shapes, kind="MultiLineString Z")
    found = axis_from_file(path, RoadScenario(), 1)
    assert found[2]["name"] == "meet"
    assert found[0].length == pytest.approx(bend().starts[-1], abs=5.1)
    with pytest.raises(InputError, match="apart: parts is 2: must be one line, or parts"):
        axis_from_file(path, RoadScenario(), 1, "apart")
    assert [bool(row["fault"]) for row in listed_lines(path)] == [False, True]


def test_layers_stand_before_names(tmp_path: Path) -> None:
    import pyogrio

    for layer, number in (("roads", 40), ("rails", 80)):
        shape = np.array([well_known_binary(line()[:number])], dtype=object)
        names = [np.array(["axis"], dtype=object)]
        options = {"driver": "GPKG", "geometry_type": "LineString Z", "crs": "EPSG:25832"}
        pyogrio.raw.write(tmp_path / "a.gpkg", shape, names, ["name"], layer=layer, append=layer == "rails", **options)
    assert [row["name"] for row in listed_lines(tmp_path / "a.gpkg")] == ["roads: axis", "rails: axis"]
    assert axis_from_file(tmp_path / "a.gpkg", RoadScenario(), 1)[2]["name"] == "rails: axis"


def test_a_shapefile_needs_its_parts(tmp_path: Path) -> None:
    path = vector_file(tmp_path / "a.shp", "ESRI Shapefile", {"axis": well_known_binary(line())})
    (tmp_path / "alone").mkdir()
    shutil.copy(path, tmp_path / "alone" / "a.shp")
    with pytest.raises(InputError, match=r"is missing: this part of the shapefile must be in the same folder"):
        axis_from_file(tmp_path / "alone" / "a.shp", RoadScenario(), 1)
    shutil.copy(path, tmp_path / "a.bin")
    with pytest.raises(InputError, match=r"must end in \.shp"):
        axis_from_file(tmp_path / "a.bin", RoadScenario(), 1)
    (tmp_path / "a.prj").unlink()
    with collected_remarks() as remarks:
        axis_from_file(path, RoadScenario(epsg=25833), 1)
    assert "a.shp names no system: its coordinates are read as EPSG:25833" in remarks


def test_other_formats_are_opened_by_nobody(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A virtual format of GDAL names another file, which mustn't be read: neither under its own name nor another."""
    there = vector_file(tmp_path / "there.gpkg", "GPKG", {"axis": well_known_binary(line())})
    layer = f'<OGRVRTLayer name="there"><SrcDataSource>{there}</SrcDataSource></OGRVRTLayer>'
    text = f"<OGRVRTDataSource>{layer}</OGRVRTDataSource>"
    for name in ("a.vrt", "a.gpkg", "a.shp"):
        (tmp_path / name).write_text(text)
        assert main(["road", str(tmp_path / name), "--list"]) == 2
        assert "error: " in capsys.readouterr().err
        assert format_of(tmp_path / name) is None


def test_without_the_library_one_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = vector_file(tmp_path / "a.gpkg", "GPKG", {"axis": well_known_binary(line())})
    monkeypatch.setitem(sys.modules, "pyogrio", None)
    with pytest.raises(MissingPackageError, match=r"a\.gpkg is 'GeoPackage': needs the package pyogrio: .*\[maps\]"):
        axis_from_file(path, RoadScenario(), 1)
    (tmp_path / "a.pbf").write_bytes(b"\0\0\0\x0d\x0a\x09OSMHeader\x18\x01")
    monkeypatch.setitem(sys.modules, "osmium", None)
    with pytest.raises(MissingPackageError, match=r"needs the package osmium: .*\[maps\]"):
        axis_from_file(tmp_path / "a.pbf", RoadScenario(), 1)
