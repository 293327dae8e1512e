"""Ground, vehicles and plants of the twins against those of the built model."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.alignment import clip_offset
from synthroads_addon.road.things.vehicles import VEHICLE_TYPES
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.twin.ground import GROUND_TOLERANCE, triangulate_ground
from synthroads_addon.twin.plants import placed_plants
from synthroads_addon.twin.surfaces import road_stations, surface_points
from synthroads_addon.twin.vehicles import placed_vehicles
from tests.helpers.scenes.furnished_road import Data, FurnishedRoad, cast_down, tree_of
from tests.helpers.scenes.scan_scenes import mesh_of

pytestmark = pytest.mark.keep_scene

PLANTS: Data = {"type": "Vegetation", "band_start": 3.0, "band_end": 40.0, "seed": 3}
TREES: Data = {
    "maple": PLANTS | {"kind": "tree", "species": "maple", "density": 0.01, "height_min": 6.0, "height_max": 9.0},
    "hazel": PLANTS | {"kind": "shrub", "species": "hazel", "density": 0.02, "height_min": 1.0, "height_max": 2.0},
}
VEHICLES: Data = {
    f"{side}-{model}": {"type": "Vehicle", "model": model, "carriageway": side, "lane": 0, "speed": 0.0}
    | {"station": 12.0 + 20.0 * (number // 2)}
    for number, model in enumerate(VEHICLE_TYPES)
    for side in ("left" if number % 2 else "right",)
}
LENGTH = 90.0


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    return FurnishedRoad(TREES | VEHICLES, ("vegetation", "vehicles"), detail=0.2, length=LENGTH, curvature=1 / 400)


def ground_mesh(road: FurnishedRoad, raised: float = 0.0) -> tuple[SceneMesh, float]:
    """Return the twin's ground, in the scene's coordinates, and the deviation that it tells."""
    geometry = road.geometry
    ground = triangulate_ground(geometry, road.parameters.terrain, road_stations(geometry, 0.005), 0.005)
    points, polygons = [], []
    for faces in ground.faces:
        polygons += (faces.corners.reshape(-1, 3) + len(points)).tolist()
        points += (faces.points - road.origin + (0.0, 0.0, raised)).tolist()
    return mesh_of(points, polygons), ground.deviation


def ground_differences(road: FurnishedRoad, raised: float = 0.0) -> tuple[Float, Float, float]:
    """Return how far the twin's ground lies above the model's, and above the exact one, and what the twin tells."""
    mesh, told = ground_mesh(road, raised)
    rng = np.random.default_rng(2)
    station, offset = rng.uniform(1.0, LENGTH - 1.0, 3000), rng.uniform(-58.0, 58.0, 3000)
    edges = road.geometry.offsets(station)
    beside = (offset > edges[:, 0] + 0.1) | (offset < edges[:, -1] - 0.1)
    beside &= clip_offset(offset, road.geometry.alignment.curvature(station)) == offset
    exact = surface_points(road.geometry, station[beside], offset[beside]) - road.origin
    mine, model = cast_down(tree_of(mesh), exact[:, :2]), road.surface(exact[:, :2])
    there = np.isfinite(mine) & np.isfinite(model)
    assert there.sum() > 1500
    return (mine - model)[there], (mine - exact[:, 2])[there], told


def test_the_ground_is_the_models(road: FurnishedRoad) -> None:
    """Within the tolerance that the twin tells; both are chords of the same surface."""
    from_model, from_exact, told = ground_differences(road)
    assert np.abs(from_exact).max() < 1.2 * told + 2e-4 < GROUND_TOLERANCE
    assert np.abs(from_model).max() < GROUND_TOLERANCE


def test_ground_that_lies_higher_is_seen(road: FurnishedRoad) -> None:
    from_model, _, _ = ground_differences(road, 0.03)
    assert np.abs(from_model).max() > GROUND_TOLERANCE


def test_boxes_of_vehicles_are_around_the_models(road: FurnishedRoad) -> None:
    mesh = road.mesh(*VEHICLES)
    placed = list(placed_vehicles(road.geometry))
    assert len(placed) == len(VEHICLE_TYPES)
    for vehicle in placed:
        kind = VEHICLE_TYPES[vehicle.vehicle.model]
        corners = mesh.vertices[mesh.triangles[mesh.instance_id == vehicle.vehicle.instance]].reshape(-1, 3)
        ours = (corners + road.origin - vehicle.place) @ vehicle.rotation
        low, high = ours.min(axis=0), ours.max(axis=0)
        assert (low[0], high[0]) == pytest.approx((-kind.length / 2.0, kind.length / 2.0), abs=0.01)
        assert (low[2], high[2]) == pytest.approx((0.0, kind.height), abs=0.01)
        # Mirrors stick out.
        assert -0.25 < low[1] + kind.width / 2.0 < 0.01
        assert -0.01 < high[1] - kind.width / 2.0 < 0.25


def test_plants_are_the_models(road: FurnishedRoad) -> None:
    """The same numbers; heights within a hundredth, crowns within a quarter of their radius and the lean."""
    mesh = road.mesh("maple", "hazel")
    plants = list(placed_plants(road.geometry))
    assert {plant.instance for plant in plants} == set(np.unique(mesh.instance_id).tolist())
    assert len(plants) > 20
    for plant in plants:
        corners = mesh.vertices[mesh.triangles[mesh.instance_id == plant.instance]].reshape(-1, 3) + road.origin
        assert corners[:, 2].max() - plant.foot[2] == pytest.approx(plant.height, rel=0.02)
        reach = np.linalg.norm(corners[:, :2] - plant.foot[:2], axis=1)
        radius = plant.breadth * plant.shape.crown_radius
        assert 0.7 * radius < np.quantile(reach, 0.98) < 1.25 * radius + 0.05 * plant.height, plant.name
