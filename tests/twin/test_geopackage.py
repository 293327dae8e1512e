"""GeoPackage and inventory: what GeoJSON has and damage besides, read back by GDAL and by the csv module."""

from __future__ import annotations

import csv
import json
import sqlite3
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road.things.thing import Thing
from synthroads_addon.twin.formats import write_twin
from synthroads_addon.twin.surfaces import surface_points
from tests.helpers.roads.twin_roads import full_road

ASIDE = 2e-4
"""Largest difference of coordinates, m: both are rounded to 0.1 mm."""


@pytest.fixture(scope="module")
def road() -> RoadParameters:
    return full_road()


@pytest.fixture(scope="module")
def folder(road: RoadParameters, tmp_path_factory) -> Path:
    pytest.importorskip("pyogrio")
    path = tmp_path_factory.mktemp("twins")
    write_twin(road, path, ["geopackage", "inventory", "geojson"])
    return path


def layer(path: Path, name: str) -> tuple[dict[str, Any], list[bytes], dict[str, list[Any]]]:
    import pyogrio.raw

    meta, _, shapes, columns = pyogrio.raw.read(str(path), layer=name)
    return meta, list(shapes), dict(zip(meta["fields"], map(list, columns), strict=True))


def points_of(shape: bytes) -> np.ndarray:
    """Return all points (N, 3) of a geometry in well-known binary."""
    (code,) = struct.unpack_from("<I", shape, 1)
    kind = code & 0xFF if code & 0x80000000 else code % 1000  # GDAL gives back the older codes of 2.5D
    if kind == 1:
        return np.frombuffer(shape, "<f8", 3, 5).reshape(1, 3)
    (count,) = struct.unpack_from("<I", shape, 5)
    if kind == 2:
        return np.frombuffer(shape, "<f8", 3 * count, 9).reshape(-1, 3)
    at, parts = 9, []
    for _ in range(count):
        if kind == 3:
            (length,) = struct.unpack_from("<I", shape, at)
            parts.append(np.frombuffer(shape, "<f8", 3 * length, at + 4).reshape(-1, 3))
            at += 4 + 24 * length
        else:
            parts.append(points_of(shape[at:]))
            at += 9 + 24 * len(parts[-1]) if kind == 5 else _length(shape[at:])
    return np.concatenate(parts)


def _length(polygon: bytes) -> int:
    (rings,) = struct.unpack_from("<I", polygon, 5)
    at = 9
    for _ in range(rings):
        at += 4 + 24 * struct.unpack_from("<I", polygon, at)[0]
    return at


def flat(coordinates: Any) -> list[list[float]]:
    return (
        [coordinates] if isinstance(coordinates[0], float) else [point for part in coordinates for point in flat(part)]
    )


def test_every_feature_of_geojson_is_there_at_its_place(road: RoadParameters, folder: Path) -> None:
    import pyogrio

    features = json.loads((folder / "twin.geojson").read_text(encoding="utf-8"))["features"]
    by_place: dict[tuple[int, int], list[np.ndarray]] = {}
    for feature in features:
        points = np.array(flat(feature["geometry"]["coordinates"]))
        by_place.setdefault((feature["properties"]["instance"], len(points)), []).append(points)
    found = 0
    for name, kind in pyogrio.list_layers(folder / "twin.gpkg"):
        if kind is None or name in ("rut", "pothole", "patch", "crack", "removed_marking"):
            continue
        meta, shapes, columns = layer(folder / "twin.gpkg", name)
        assert meta["crs"] == f"EPSG:{road.metadata.epsg}"
        for shape, instance in zip(shapes, columns["instance"], strict=True):
            points = points_of(shape)
            others = by_place[int(instance), len(points)]
            assert min(np.abs(points - other).max() for other in others) < ASIDE
            found += 1
    assert found == len(features)


def test_damage_lies_where_the_parameters_say(road: RoadParameters, folder: Path) -> None:
    geometry = RoadGeometry(road)
    origin = np.array(road.transform.translate)
    cracks = {}
    for name, carriageway in road.of_type(Carriageway).items():
        pavement = carriageway.pavement
        first = len(pavement.ruts) + len(pavement.potholes) + len(pavement.patches)
        for number, crack in enumerate(pavement.cracks, first):
            cracks[geometry.numbers.part(name, number)[1]] = crack
    assert cracks
    _, shapes, columns = layer(folder / "twin.gpkg", "crack")
    assert sorted(cracks) == sorted(columns["instance"])
    for shape, instance, width in zip(shapes, columns["instance"], columns["width"], strict=True):
        crack = cracks[int(instance)]
        places = np.array([corner for line in crack.lines for corner in line])
        expected = surface_points(geometry, places[:, 0], places[:, 1]) + origin
        assert np.abs(points_of(shape) - expected).max() < ASIDE
        assert width == crack.width
    _, shapes, columns = layer(folder / "twin.gpkg", "pothole")
    holes = [hole for item in road.of_type(Carriageway).values() for hole in item.pavement.potholes]
    assert len(holes) == len(shapes) > 0
    spans = sorted(float(np.ptp(points_of(shape)[:, :2], axis=0).max()) for shape in shapes)
    assert spans[-1] <= max(max(hole.length, hole.width) for hole in holes) + 0.01


def test_styles_and_types_of_fields(folder: Path) -> None:
    with sqlite3.connect(folder / "twin.gpkg") as database:
        tables = {
            name for (name,) in database.execute("SELECT table_name FROM gpkg_contents WHERE data_type='features'")
        }
        styled = dict(database.execute("SELECT f_table_name, styleQML FROM layer_styles WHERE useAsDefault = 1"))
    assert tables == set(styled)
    assert 'class="SimpleLine"' in styled["lane"]
    meta, _, columns = layer(folder / "twin.gpkg", "traffic_sign")
    kinds = dict(zip(meta["fields"], meta["dtypes"], strict=True))
    assert (kinds["instance"], kinds["station"], kinds["code"]) == ("int64", "float64", "object")
    assert list(meta["fields"][:3]) == ["id", "instance", "object_type"]
    assert all(isinstance(code, str) for code in columns["code"])


def test_the_same_road_gives_the_same_bytes(road: RoadParameters, folder: Path, tmp_path: Path) -> None:
    write_twin(road, tmp_path, ["geopackage", "inventory"])
    for name in ("twin.gpkg", "inventory.csv"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


def test_inventory_has_every_thing_once_by_station(road: RoadParameters, folder: Path) -> None:
    with (folder / "inventory.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    things = {name: item for name, item in road.objects.items() if isinstance(item, Thing)}
    assert sorted(row["id"] for row in rows) == sorted(things)
    stations = [float(row["station"]) for row in rows]
    assert stations == sorted(stations)
    geometry, origin = RoadGeometry(road), np.array(road.transform.translate)
    for row in rows:
        item: Any = things[row["id"]]
        station = item.start_station if row["end_station"] else item.station
        assert float(row["station"]) == pytest.approx(station, abs=1e-4)
        expected = surface_points(geometry, np.array([station]), np.array([item.offset]))[0] + origin
        assert np.abs(np.array([float(row["x"]), float(row["y"])]) - expected[:2]).max() < ASIDE
        assert json.loads(row["attributes"]).keys().isdisjoint({"station", "offset", "type", "instance"})
        assert row["side"] == ("left" if item.offset > 0 else "right" if item.offset < 0 else "middle")
