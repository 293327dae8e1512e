"""Hedges and parked vehicles against their outlines, fences' mesh for the beam, and plants that keep clear."""

import numpy as np
import pytest

from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.materials.table import materials
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import Terrain, Vegetation
from synthroads_addon.road.things.building import Building
from synthroads_addon.road.things.hedge import Hedge
from synthroads_addon.road.vegetation.plants import plant_places
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.twin.things import placed_things
from tests.helpers.roads.furnished_data import road_data
from tests.helpers.roads.thing_variants import straight_road
from tests.helpers.scenes.furnished_road import Float, FurnishedRoad, corners

KINDS = ["Hedge", "ParkedVehicle"]
HEDGE = {"type": "Hedge", "start_station": 20.0, "end_station": 50.0, "offset": -30.0, "height": 2.0, "width": 1.4}


@pytest.fixture(scope="module")
def built() -> tuple[FurnishedRoad, SceneMesh]:
    """Variants of hedges and parked vehicles on a straight road, and their mesh."""
    car = {"type": "ParkedVehicle", "station": 60.0, "offset": -30.0, "elevation": 0.1, "rotation_deg": 20.0}
    things = {"hedge": HEDGE, "car": car, "van": car | {"model": "van", "station": 80.0}}
    road = FurnishedRoad(straight_road(things), ["hedges", "parked_vehicles"], detail=1.0)
    shown = [item for role, item in road.model.objects.items() if role in road.geometry.parameters.objects]
    return road, scene_mesh(objects=[item for item in shown if item.name != "Terrain"])


def corners_of(road: FurnishedRoad, mesh: SceneMesh, number: int) -> Float:
    return mesh.vertices[mesh.triangles[mesh.instance_id == number]].astype(np.float64) + road.origin


def along_the_road(road: FurnishedRoad, points: Float) -> Float:
    """Return points (N, 3) as station, offset and height above the road's grade of 3 %."""
    station, offset = road.geometry.alignment.project(points[:, :2])
    return np.column_stack([station, offset, points[:, 2] - 0.03 * station])


@pytest.mark.keep_scene
def test_leaves_fill_the_outline_and_vehicles_their_box(built: tuple[FurnishedRoad, SceneMesh]) -> None:
    road, mesh = built
    seen = set()
    for found in placed_things(road.geometry, 0.005):
        seen_at = corners_of(road, mesh, found.thing.instance).reshape(-1, 3)
        solid = np.concatenate([found.local_sections(body).reshape(-1, 3) for body in found.bodies])
        room = 0.25 if found.thing.type == "ParkedVehicle" else 0.2
        if found.frame is None:  # a hedge runs along the road: its outline in station, offset, height
            solid, seen_at = (along_the_road(road, points) for points in (solid, seen_at))
        assert np.all(seen_at.min(axis=0) > solid.min(axis=0) - room), found.name
        assert np.all(seen_at.max(axis=0) < solid.max(axis=0) + room), found.name
        assert np.all(np.ptp(seen_at, axis=0) > 0.85 * np.ptp(solid, axis=0)), found.name
        seen.add(found.thing.type)
    assert seen == set(KINDS)


def test_a_stretch_has_the_whole_hedge_s_leaves() -> None:
    data = straight_road({"hedge": HEDGE})
    leaves = []
    for stretch in (None, (30.0, 40.0)):
        road = FurnishedRoad(data, ["hedges"], stretch, 1.0)
        assert isinstance(road.geometry.parameters.objects["hedge"], Hedge)
        leaves.append(corners(road.mesh("hedge")) + road.origin)
    found = {tuple(middle) for middle in leaves[1].mean(axis=1).round(3).tolist()}
    assert len(found) > 500
    assert found <= {tuple(middle) for middle in leaves[0].mean(axis=1).round(3).tolist()}


def test_a_wire_mesh_lets_the_beam_through() -> None:
    """Wires of 2.5 mm, 15 cm apart both ways, at the foot of a fence 5 cm: 3 to 7 % of the light meets one."""
    covered = [1.0 - (1.0 - 0.0025 / 0.15) * (1.0 - 0.0025 / pitch) for pitch in (0.15, 0.05)]
    assert covered[0] < 1.0 - materials()["wire_mesh"].transmission < covered[1]


def test_no_tree_grows_in_a_building() -> None:
    house = {"type": "Building", "station": 100.0, "offset": -40.0, "width": 12.0, "depth": 10.0}
    trees = {"type": "Vegetation", "kind": "tree", "species": "birch", "density": 0.5, "band_start": 0.0}
    trees |= {"band_end": 50.0, "height_min": 4.0, "height_max": 5.0, "seed": 3}
    road = FurnishedRoad(straight_road({"house": house, "trees": trees}), [])
    parameters = road.geometry.parameters
    plants, terrain = (next(iter(parameters.of_type(kind).values())) for kind in (Vegetation, Terrain))
    places = plant_places(road.geometry, plants, terrain)
    near = np.hypot(places.station - 100.0, places.offset + 40.0) < 8.0
    assert next(iter(parameters.of_type(Building).values())).clearing
    assert near.sum() > 50
    assert not places.stands[near].any()
    assert places.stands[~near].any()


def test_bare_plants_have_twigs_of_bark_where_leaves_were() -> None:
    stand = {"type": "Vegetation", "kind": "tree", "density": 0.005, "band_start": 1.0, "band_end": 20.0}
    stand |= {"height_min": 8.0, "height_max": 9.0, "seed": 3}
    trees = {species: stand | {"species": species} for species in ("maple", "birch", "spruce")} | {"hedge": HEDGE}
    area: dict[tuple[str, str], float] = {}
    for season in ("summer", "winter"):
        parameters = RoadParameters.from_dict(
            road_data(straight_road(trees), 300.0) | {"environment": {"season": season}}
        )
        model = build_road(
            BuildRequest(parameters, 0.02, 0.3, {"road", "terrain", "vegetation", "hedges"}, (0.0, 60.0))
        )
        for name in trees:
            mesh = scene_mesh(objects=[model.objects[name]])
            names = [mesh.materials[number] for number in np.unique(mesh.material)]
            leafy = name == "spruce" or season == "summer"
            assert any("leaves" in material for material in names) == leafy, (name, season)
            if name == "birch":
                assert ("hazel_bark" in names) == (not leafy), "a birch's twigs aren't white as its trunk"
            a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(np.float64), 1, 0)
            area[name, season] = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    assert area["spruce", "winter"] == pytest.approx(area["spruce", "summer"])
    assert all(0.04 < area[name, "winter"] / area[name, "summer"] < 0.4 for name in ("maple", "birch", "hedge"))
