"""GeoJSON: lines and places as exact as the parameters, with the instances of the set."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, LineMarking, Turnout
from synthroads_addon.road.surroundings import Landscape, Terrain, Vegetation
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.twin.geojson import write_geojson
from synthroads_addon.twin.plants import placed_plants
from tests.helpers.roads.twin_roads import full_road, one_of_many

Features = list[list[dict[str, Any]]]
ROADS = [full_road, lambda: one_of_many(2), lambda: one_of_many(3)]


def features_of(road: RoadParameters, folder: Path) -> list[dict[str, Any]]:
    write_geojson(road, folder / "a.geojson", 0.005)
    data = json.loads((folder / "a.geojson").read_text(encoding="utf-8"))
    assert data["type"] == "FeatureCollection"
    assert data["crs"]["properties"]["name"].endswith(f"::{road.metadata.epsg}")
    return data["features"]


@pytest.fixture(scope="module")
def features(tmp_path_factory: pytest.TempPathFactory) -> Features:
    """The features of each of the roads."""
    return [features_of(road(), tmp_path_factory.mktemp("geojson")) for road in ROADS]


def lines_of(feature: dict[str, Any]) -> list[np.ndarray]:
    """Return all lines, rings and points (K, 3) of a feature."""
    kind, coordinates = feature["geometry"]["type"], feature["geometry"]["coordinates"]
    nested = {"Point": [[coordinates]], "LineString": [coordinates], "MultiLineString": coordinates}
    nested |= {"Polygon": coordinates, "MultiPolygon": [ring for polygon in coordinates for ring in polygon]}
    return [np.array(line) for line in nested[kind]]


@pytest.mark.parametrize("index", range(len(ROADS)))
def test_every_object_is_there_with_its_instance(index: int, features: Features) -> None:
    road = ROADS[index]()
    found = {(f["properties"]["id"], f["properties"]["instance"]) for f in features[index]}
    bare = (Terrain, Vegetation, Landscape)
    wanted = {(name, item.instance) for name, item in road.objects.items() if not isinstance(item, bare)}
    assert found == wanted | {(plant.name, plant.instance) for plant in placed_plants(RoadGeometry(road))}


@pytest.mark.parametrize("index", range(len(ROADS)))
def test_points_lie_on_the_analytic_road_within_a_millimetre(index: int, features: Features) -> None:
    road = ROADS[index]()
    geometry, origin = RoadGeometry(road), np.array(road.transform.translate)
    for feature in features[index]:
        about = feature["properties"]
        if about["feature"] in ("furniture", "plant", "vehicle"):
            continue
        local = np.concatenate(lines_of(feature)) - origin
        station, offset = geometry.alignment.project(local[:, :2])
        edges = geometry.offsets(station)
        if about["feature"] == "centerline":
            truth = np.column_stack([geometry.alignment.position(station), geometry.profile.elevation(station)])
        else:
            truth = geometry.point(station, np.clip(offset, edges[:, -1], edges[:, 0]))
            truth[:, 2] += about.get("film_thickness", 0.0)
        assert np.linalg.norm(local - truth, axis=1).max() < 0.001, about["id"]


def test_lanes_and_boundaries_are_those_of_the_cross_section(features: Features) -> None:
    road = full_road()
    geometry = RoadGeometry(road)
    for feature in features[0]:
        about = feature["properties"]
        item = road.objects[about["id"].partition("/")[0]]
        if about["feature"] not in ("lane", "lane_boundary", "paved_edge") or isinstance(item, Turnout):
            continue
        assert isinstance(item, Carriageway)
        station, offset = geometry.alignment.project(lines_of(feature)[0][:, :2] - road.transform.translate[:2])
        np.testing.assert_allclose(station, about["stations"], rtol=0, atol=2e-4)
        section = geometry.sections[item.side]
        boundaries = item.sign * section.lane_boundaries(np.array(about["stations"]))
        if about["feature"] == "lane":
            outer, inner = boundaries[:, about["lane"]], boundaries[:, about["lane"] + 1]
            np.testing.assert_allclose(offset, (outer + inner) / 2.0, rtol=0, atol=3e-4)
            np.testing.assert_allclose(about["widths"], np.abs(outer - inner), rtol=0, atol=3e-4)
            assert np.all(np.array(about["widths"])[1:-1] > 0.0)
        elif about["feature"] == "lane_boundary":
            np.testing.assert_allclose(offset, boundaries[:, about["boundary"]], rtol=0, atol=3e-4)
        else:
            # A step of the pavement's edge is 5 cm long: rounding along the road counts many times across it.
            away = np.abs(offset - item.sign * section.paved_edge(station))
            assert np.quantile(away, 0.95) < 3e-4


def test_turnouts_have_the_lane_of_their_parameters(features: Features) -> None:
    road = full_road()
    for feature in features[0]:
        item = road.objects[feature["properties"]["id"].partition("/")[0]]
        if isinstance(item, Turnout) and item.ramp:
            about = feature["properties"]
            assert item.start_station - 1.0 < min(about["stations"])
            assert max(about["stations"]) < item.end_station + 1.0
            assert max(about["widths"]) == pytest.approx(max(item.lane_width, item.ramp.lane_width), abs=1e-3)


def test_dashes_are_those_of_the_marking(features: Features) -> None:
    road = full_road()
    geometry = RoadGeometry(road)
    lines = 0
    for feature in features[0]:
        item = road.objects[feature["properties"]["id"].partition("/")[0]]
        if isinstance(item, LineMarking):
            lines += 1
            np.testing.assert_allclose(feature["properties"]["dashes"], geometry.dashes(item), rtol=0, atol=6e-5)
            ends = np.concatenate([line[[0, -1], :2] for line in lines_of(feature)])
            station, _ = geometry.alignment.project(ends - road.transform.translate[:2])
            np.testing.assert_allclose(station.reshape(-1, 2), geometry.dashes(item), rtol=0, atol=5e-4)
    assert lines == len(road.of_type(LineMarking))


def test_furniture_stands_where_the_parameters_say(features: Features) -> None:
    road = full_road()
    geometry = RoadGeometry(road)
    for feature in features[0]:
        about = feature["properties"]
        if about["feature"] == "furniture" and feature["geometry"]["type"] == "Point":
            item = road.objects[about["id"]]
            plan = np.array(feature["geometry"]["coordinates"])[None, :2] - road.transform.translate[:2]
            station, offset = geometry.alignment.project(plan)
            assert (station[0], offset[0]) == pytest.approx((item.station, item.offset), abs=3e-4)
            for key in ("station", "offset", "rotation_deg"):
                assert about[key] == pytest.approx(getattr(item, key), abs=1e-6)
    assert road.of_type(Gantry)
