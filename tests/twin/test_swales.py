"""Swales of cuttings as surfaces of their own in CityJSON and IFC."""

from __future__ import annotations

from pathlib import Path

import ifcopenshell
import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.terrain import surface_elevation
from synthroads_addon.twin.formats import write_twin
from synthroads_addon.twin.ground import swales, triangulate_ground
from tests.helpers.files.cityjson_files import read_city
from tests.helpers.files.ifc_reading import body, named
from tests.helpers.roads.furnished_data import road_data

SHAPE = {"crest_length": 0.8, "rounding_length": 3.0, "swale_width": 2.0, "swale_depth": 0.4}


def test_swales_are_surfaces_beside_the_verge(tmp_path: Path) -> None:
    """On the ground's analytic surface, from the verge's edge on as wide as they are; none beside embankments."""
    data = road_data({}, length=40.0)
    data["objects"]["terrain"] |= {"embankment_height": -3.0, "undulation": 0.0, "half_width": 26.0} | SHAPE
    road = RoadParameters.from_dict(data)
    write_twin(road, tmp_path, ["cityjson", "ifc"])
    city, geometry = read_city(tmp_path / "twin.city.json"), RoadGeometry(road)
    ifc = ifcopenshell.open(str(tmp_path / "twin.ifc"))
    origin = np.array(road.transform.translate)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        swale = city.objects[f"terrain/swale-{side}"]
        about = swale["attributes"]
        assert (swale["type"], about["function"], about["side"]) == ("LandUse", "swale", side)
        assert (about["width"], about["depth"]) == (2.0, 0.4)
        assert about["instance"] == road.terrain.instance  # type: ignore[union-attr]
        points = np.concatenate(city.rings({"object": f"terrain/swale-{side}"})) - origin
        station, offset = geometry.alignment.project(points[:, :2])
        station = np.clip(station, 0.0, geometry.length)
        edge = geometry.offsets(station)[:, 0 if sign > 0.0 else -1]
        beyond = (offset - edge) * sign
        assert (beyond.min(), beyond.max()) == (pytest.approx(0.0, abs=1e-3), pytest.approx(2.0, abs=1e-3))
        assert np.abs(points[:, 2] - surface_elevation(geometry, station, edge + sign * beyond)).max() < 2e-3
        middle = np.abs(beyond - 1.0) < 1e-3
        deepest = geometry.elevation(station[middle], edge[middle]) - points[middle, 2]
        assert np.abs(deepest - 0.4).max() < 2e-3
        element = named(ifc, f"terrain/swale-{side}")
        assert (element.PredefinedType, element.ObjectType) == ("USERDEFINED", "Swale")
        vertices, _ = body(element)
        assert np.abs(np.sort(vertices[:, 2])[[0, -1]] - np.sort(points[:, 2])[[0, -1]]).max() < 2e-3
    data["objects"]["terrain"]["embankment_height"] = 3.0
    (tmp_path / "bank").mkdir()
    write_twin(RoadParameters.from_dict(data), tmp_path / "bank", ["cityjson"])
    assert not [name for name in read_city(tmp_path / "bank" / "twin.city.json").objects if "swale" in name]


def test_swales_end_where_the_terrain_does() -> None:
    data = road_data({}, length=40.0)
    data["objects"]["terrain"] |= {"embankment_height": -3.0, "undulation": 0.0} | SHAPE
    road = RoadGeometry(RoadParameters.from_dict(data))
    edge = float(road.offsets(np.zeros(1))[0, 0])
    data["objects"]["terrain"]["half_width"] = edge + 1.2
    road = RoadGeometry(RoadParameters.from_dict(data))
    terrain = road.parameters.terrain
    assert terrain is not None
    ground = triangulate_ground(road, terrain, np.array([0.0, 40.0]), 0.01)
    faces = dict(swales("terrain", terrain, ground))["terrain/swale-left"]
    _, offset = road.alignment.project(faces.points[:, :2])
    assert offset.max() == pytest.approx(edge + 1.2, abs=1e-3)
