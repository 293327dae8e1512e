"""No surface in CityJSON is too small to have a direction, and no piece of the ground faces down once it is rounded."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.surroundings import Terrain
from synthroads_addon.twin.cityjson.model import SLIVER, CityGeometry, CityModel, CityObject
from synthroads_addon.twin.cityjson.surroundings import _terrain
from synthroads_addon.twin.faces import Faces, polygon_areas, ring_faces
from synthroads_addon.twin.ground import GroundMesh
from synthroads_addon.twin.trace import Trace
from tests.helpers.roads.twin_roads import one_of_many

NARROW = [[2.0, 0.0, 0.0], [2.9, 0.0, 0.0], [2.9, 0.000_1, 0.0]]
SQUARE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
SMALL = [[3.0, 0.0, 0.0], [3.001, 0.0, 0.0], [3.001, 0.000_9, 0.0], [3.0, 0.000_9, 0.0]]


def faces(*rings: list[list[float]]) -> Faces:
    ends = np.cumsum([0, *map(len, rings)])
    return ring_faces(np.concatenate(rings), [range(a, b) for a, b in pairwise(ends)])


def test_areas_are_those_of_polygons() -> None:
    some = faces(SQUARE, SMALL, NARROW, [[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [2.0, 3.0, 4.0]])
    assert polygon_areas(some.points, some.corners, some.sizes) == pytest.approx([1.0, 0.9e-6, 45e-6, 5.0])


def written(tmp_path: Path, *shapes: CityGeometry) -> list[dict]:
    model = CityModel((0.0, 0.0, 0.0), Trace(RoadGeometry(one_of_many(3))))
    model.add(CityObject("thing", "Road", {"instance": 1}, shapes))
    model.write(tmp_path / "twin.json", {})
    return json.loads((tmp_path / "twin.json").read_text())["CityObjects"]["thing"]["geometry"]


@pytest.mark.parametrize("kind", ["MultiSurface", "CompositeSurface"])
def test_surfaces_lose_their_slivers_and_keep_their_semantics(tmp_path: Path, kind: str) -> None:
    semantics = ({"type": "TrafficArea", "instance": 1}, {"type": "AuxiliaryTrafficArea", "instance": 2})
    told = {"semantics": semantics, "values": np.array([0, 1, 1])} if kind == "MultiSurface" else {}
    (shape,) = written(tmp_path, CityGeometry(kind, "2", (faces(SQUARE, SMALL, NARROW),), **told))
    assert [len(polygon[0]) for polygon in shape["boundaries"]] == [4, 3]
    if told:
        assert shape["semantics"]["values"] == [0, 1]


def test_bodies_stay_closed(tmp_path: Path) -> None:
    (shape,) = written(tmp_path, CityGeometry("Solid", "2", (faces(SQUARE, SMALL),)))
    assert len(shape["boundaries"][0]) == 2


def test_triangles_of_the_ground_that_rounding_turns_over_are_left_out(tmp_path: Path) -> None:
    thin = [[0.0, 0.0, 0.0], [10.0, 0.000_06, 0.0], [5.0, 0.000_04, 0.0]]
    part = faces(SQUARE[:3], thin)
    ground = GroundMesh((None, None), (part, faces(SQUARE[:3])), 0.0)  # type: ignore[arg-type]
    terrain = next(iter(one_of_many(3).of_type(Terrain).values()))
    shapes = _terrain("ground", terrain, ground).geometry
    assert [len(shape.parts[0]) for shape in shapes] == [1, 1]


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 5, 6])
def test_no_road_has_any(tmp_path: Path, number: int) -> None:
    from synthroads_addon.twin.cityjson.writer import write_cityjson

    write_cityjson(one_of_many(number), tmp_path / "twin.json", 0.005)
    data = json.loads((tmp_path / "twin.json").read_text())
    vertices = np.array(data["vertices"]) * data["transform"]["scale"]
    for item in data["CityObjects"].values():
        for shape in item.get("geometry", ()):
            if not shape["type"].endswith("Surface"):
                continue
            for ring, *_ in shape["boundaries"]:
                arms = vertices[ring] - vertices[ring[0]]
                area = np.cross(arms[:-1], arms[1:]).sum(axis=0) / 2.0
                assert np.linalg.norm(area) >= SLIVER * (1.0 - 1e-9)
                assert item["type"] != "TINRelief" or area[2] > 0.0
