"""Street sides in the model: kerb faces, gutters, bays and footways on the analytic surface, and what a scan sees."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.streets.street_side import StreetSide
from synthroads_addon.road.surroundings import Vegetation
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.roads.villages import village_road

Float = np.ndarray
TOLERANCE = 0.001
STEEP = 0.3
"""Cosine of a face's slope below which it is a kerb's face."""


class Village:
    """The village of the tests, built, with its road's and terrain's triangles in local coordinates."""

    def __init__(self, stretch: tuple[float, float] | None = None) -> None:
        self.parameters = village_road()
        self.geometry = RoadGeometry(self.parameters)
        model = build_road(BuildRequest(self.parameters, TOLERANCE, 0.0, {"road", "terrain"}, stretch))
        self.origin = model.origin - np.array(self.parameters.transform.translate)
        self.road = scene_mesh(objects=[model.objects["Road"]])
        self.terrain = scene_mesh(objects=[model.objects["Terrain"]])

    def triangles(self, mesh: SceneMesh) -> Float:
        return mesh.vertices[mesh.triangles].astype(np.float64) + self.origin


@pytest.fixture(scope="module")
def village() -> Village:
    return Village()


def off_the_surface(geometry: RoadGeometry, triangles: Float) -> tuple[Float, Float]:
    """Return how far (T,) triangles (T, 3, 3) lie from the analytic surface, square to them, and the slope's cosine."""
    shares = np.random.default_rng(1).dirichlet([1.0, 1.0, 1.0], size=(len(triangles), 6))
    points = np.einsum("nkc,ncd->nkd", shares, triangles)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    cosines = normals[:, 2] / np.linalg.norm(normals, axis=1)
    station, offset = geometry.alignment.project(points.reshape(-1, 3)[:, :2])
    off = (points[..., 2].ravel() - geometry.elevation(station, offset)).reshape(points.shape[:2]) * cosines[:, None]
    return np.abs(off).max(axis=1), cosines


@pytest.mark.keep_scene
def test_faces_lie_on_the_analytic_surface(village: Village) -> None:
    mesh, streets = village.road, village.parameters.of_type(StreetSide)
    triangles = village.triangles(mesh)
    off, cosines = off_the_surface(village.geometry, triangles)
    assert cosines.min() > 0.0
    for name, street in streets.items():
        chosen = mesh.instance_id == street.instance
        assert np.nanmax(off[chosen]) < TOLERANCE, name
        faces = chosen & (cosines < STEEP)
        # The face leans back by the batter: its slope has that cosine where it runs along the road.
        usual = street.kerb_batter / np.hypot(1.0, street.kerb_batter)
        assert np.median(cosines[faces]) == pytest.approx(usual, abs=0.003), name
        area = np.linalg.norm(
            np.cross(triangles[faces, 1] - triangles[faces, 0], triangles[faces, 2] - triangles[faces, 0]), axis=1
        ).sum()
        assert area / 2.0 > 0.9 * street.kerb_height * (street.end_station - street.start_station - 20.0), name


@pytest.mark.keep_scene
def test_materials_and_classes_are_those_of_the_side(village: Village) -> None:
    mesh = village.road
    names = np.array(mesh.materials)[mesh.material]
    found = {
        name: {(str(material), int(class_)) for material, class_ in zip(names[at], mesh.class_id[at], strict=True)}
        for name, street in village.parameters.of_type(StreetSide).items()
        for at in [mesh.instance_id == street.instance]
    }
    road, beside = class_id("road"), class_id("roadside")
    assert found["street-left"] == {("setts", road), ("granite", beside), ("concrete_pavers", beside)}
    assert found["street-right"] == {("setts", road), ("granite", beside), ("asphalt", beside)}
    assert found["street-right-2"] == {("concrete", beside), ("setts", beside)}


@pytest.mark.keep_scene
def test_the_terrain_begins_behind_the_footway_without_a_gap(village: Village) -> None:
    points = village.terrain.vertices.astype(np.float64) + village.origin
    station, offset = village.geometry.alignment.project(points[:, :2])
    edges = village.geometry.offsets(station)[:, [0, -1]]
    on_edge = np.abs(edges - offset[:, None]).min(axis=1) < 1e-3
    assert np.count_nonzero(on_edge) > 200
    inside = np.clip(offset[on_edge], edges[on_edge, 1], edges[on_edge, 0])
    assert np.abs(points[on_edge, 2] - village.geometry.elevation(station[on_edge], inside)).max() < TOLERANCE


@pytest.mark.keep_scene
def test_a_stretch_has_the_whole_road_s_kerbs(village: Village) -> None:
    part = Village((50.0, 100.0))
    whole = {tuple(p) for p in village.triangles(village.road).reshape(-1, 3).round(3).tolist()}
    found = {tuple(p) for p in part.triangles(part.road).reshape(-1, 3).round(3).tolist()}
    assert len(found - whole) < 0.05 * len(found)  # rounded to another millimetre
    street = part.parameters.of_type(StreetSide)["street-right"]
    assert np.any(part.road.instance_id == street.instance)


def test_no_grass_grows_on_kerbs_and_footways() -> None:
    road = village_road(grass_density=3.0, trees_per_hectare=0.0, shrubs_per_hectare=0.0)
    geometry = RoadGeometry(road)
    model = build_road(BuildRequest(road, 0.02, 0.3, None, (60.0, 100.0)))
    origin = model.origin - np.array(road.transform.translate)
    names = {name: item for name, item in road.of_type(Vegetation).items() if item.kind == "grass"}
    assert names
    tufts = [scene_mesh(objects=[model.objects[name]]) for name in names]
    points = np.concatenate([mesh.vertices.astype(np.float64) for mesh in tufts]) + origin
    assert len(points) > 500
    station, offset = geometry.alignment.project(points[:, :2])
    kinds = np.array([*(strip.kind for strip in geometry.strips), "beside"])[geometry.strip_index(station, offset)]
    # Blades of tufts beside it lean over the footway's edge; far from it there are none.
    section = geometry.sections["left"]
    inner, outer = section.boundaries_of("footway", station)
    within = (offset > inner + 0.4) & (offset < outer - 0.4)
    assert np.count_nonzero(within & (kinds == "footway")) == 0
    assert np.count_nonzero((offset > outer) & (offset < outer + 5.0)) > 20


def test_roads_whose_street_sides_do_not_fit_are_refused() -> None:
    road = village_road()
    data = road.to_dict()

    def broken(name: str, **fields: object) -> dict[str, object]:
        return data | {"objects": data["objects"] | {name: data["objects"][name] | fields}}

    for name, fields, fault in (
        ("street-right-2", {"start_station": 75.0}, "two StreetSides of"),
        ("street-right", {"carriageway": "nowhere"}, "must name a Carriageway"),
        ("street-left", {"footway_width": 2.0}, "bays must leave at least 0.5 m of footway_width"),
        ("street-left", {"end_station": 25.0, "bays": [], "kerb_levels": []}, "two transition_lengths"),
        ("street-left", {"bays": [{"start_station": 22.0, "end_station": 40.0}]}, "between the transitions"),
        (
            "street-right",
            {"kerb_width": 0.08, "kerb_batter": 0.5, "kerb_height": 0.2},
            "kerb_width must be at least 2 cm more",
        ),
    ):
        with pytest.raises(Exception, match=fault):
            RoadParameters.from_dict(broken(name, **fields))
