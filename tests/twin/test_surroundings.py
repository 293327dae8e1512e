"""Ground, plants and vehicles in the twins: where they are, how large, and the same in every format."""

from __future__ import annotations

from pathlib import Path

import ifcopenshell
import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.alignment import clip_offset
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import Vegetation
from synthroads_addon.road.things.vehicles import VEHICLE_TYPES
from synthroads_addon.twin.formats import write_twin
from synthroads_addon.twin.ground import GROUND_TOLERANCE
from synthroads_addon.twin.plants import PlacedPlant, placed_plants
from synthroads_addon.twin.surfaces import surface_points
from synthroads_addon.twin.vehicles import placed_vehicles
from tests.helpers.files.cityjson_files import City, read_city, triangles_of_rings
from tests.helpers.files.ifc_reading import body, named, parts, said
from tests.helpers.files.opendrive_reader import Roads
from tests.helpers.roads.twin_roads import one_of_many

TENTH = 1.5e-4
"""Rounding of a vertex in CityJSON, m."""


class Twins:
    """A short road in three formats."""

    def __init__(self, road: RoadParameters, folder: Path) -> None:
        self.road, self.geometry, self.folder = road, RoadGeometry(road), folder
        write_twin(road, folder, ["cityjson", "ifc", "opendrive"])
        self.city: City = read_city(folder / "twin.city.json")
        self.ifc = ifcopenshell.open(str(folder / "twin.ifc"))
        self.plants = list(placed_plants(self.geometry))
        self.origin = np.array(road.transform.translate)

    def corners(self, name: str) -> Float:
        """Return the local corners (N, 3) of a city object."""
        return np.concatenate(self.city.rings({"object": name})) - self.origin

    def triangles(self, name: str) -> Float:
        return triangles_of_rings(self.city.rings({"object": name})) - self.origin


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Twins:
    return Twins(one_of_many(3), tmp_path_factory.mktemp("twins"))


# --- ground ---------------------------------------------------------------------------------------------------------


def _heights(triangles: Float, points: Float) -> tuple[Float, Float]:
    """Return how far (N,) points lie above triangles (T, 3, 3), and how many of these are above or below each."""
    a, one, two = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    above, count = np.full(len(points), np.nan), np.zeros(len(points))
    for number, point in enumerate(points):
        x, y = (point[:2] - a[:, :2]).T
        u, v = (x * two[:, 1] - y * two[:, 0]) / area, (one[:, 0] * y - one[:, 1] * x) / area
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9)
        if inside.any():
            first = int(np.flatnonzero(inside)[0])
            above[number] = point[2] - a[first, 2] - u[first] * one[first, 2] - v[first] * two[first, 2]
            count[number] = inside.sum()
    return above, count


def test_the_ground_is_the_surface_beside_the_road(twins: Twins) -> None:
    """Within its tolerance, without a gap or an overlap, from the road's edge to the terrain's end."""
    geometry, item = twins.geometry, twins.city.objects["terrain"]
    triangles, half = twins.triangles("terrain"), twins.road.terrain.half_width
    rng = np.random.default_rng(1)
    station, offset = rng.uniform(0.05, geometry.length - 0.05, 400), rng.uniform(-half, half, 400)
    edges = geometry.offsets(station)
    beside = (offset > edges[:, 0] + 0.05) | (offset < edges[:, -1] - 0.05)
    beside &= clip_offset(offset, geometry.alignment.curvature(station)) == offset
    beside &= np.abs(offset) < half - 0.05
    above, count = _heights(triangles, surface_points(geometry, station[beside], offset[beside]))
    assert beside.sum() > 100
    assert set(count.tolist()) == {1.0}
    assert np.abs(above).max() < item["attributes"]["deviation"] * 1.2 + TENTH < GROUND_TOLERANCE
    corners = triangles.reshape(-1, 3)
    station, offset = geometry.alignment.project(corners[:, :2])
    known = surface_points(geometry, np.clip(station, 0.0, geometry.length), offset)
    assert np.linalg.norm(corners - known, axis=1).max() < 1e-3


def test_the_ground_begins_at_the_roads_edge(twins: Twins) -> None:
    """The road's outer vertices are the ground's."""
    ground = {tuple(np.rint(corner * 1e4).astype(int)) for corner in twins.corners("terrain")}
    station = np.unique(twins.geometry.alignment.project(twins.corners("terrain")[:, :2])[0].round(4))
    assert len(station) > 5
    for side, column in (("left", 0), ("right", -1)):
        verges = [
            ring - twins.origin
            for name, about, rings in twins.city.surfaces("AuxiliaryTrafficArea")
            if about["strip"] == "verge" and about["side"] == side
            for ring in rings
        ]
        points = np.concatenate(verges)
        s, offset = twins.geometry.alignment.project(points[:, :2])
        edge = twins.geometry.offsets(np.clip(s, 0.0, twins.geometry.length))[:, column]
        outer = points[np.abs(offset - edge) < 1e-3]
        assert len(outer) > 4
        assert {tuple(np.rint(corner * 1e4).astype(int)) for corner in outer} <= ground


def test_ground_far_off_is_seen(twins: Twins) -> None:
    triangles = twins.triangles("terrain") + (0.0, 0.0, 0.05)
    geometry = twins.geometry
    station = np.linspace(5.0, geometry.length - 5.0, 20)
    above, _ = _heights(triangles, surface_points(geometry, station, np.full(20, 50.0)))
    assert np.nanmax(np.abs(above)) > GROUND_TOLERANCE


def test_ifc_has_the_same_ground(twins: Twins) -> None:
    vertices, triangles = body(named(twins.ifc, "terrain"))
    mine = twins.triangles("terrain")
    assert len(triangles) == len(mine)
    theirs = vertices[triangles].reshape(-1, 3)
    one, two = (np.unique(np.round(points, 3), axis=0) for points in (theirs, mine.reshape(-1, 3)))
    assert abs(len(one) - len(two)) <= 3
    assert np.abs(one.sum(axis=0) - two.sum(axis=0)).max() / len(one) < 1e-3


# --- plants ---------------------------------------------------------------------------------------------------------


def _measures(corners: Float, plant: PlacedPlant) -> tuple[float, float, float]:
    """Return height, crown's diameter and how far its middle is from the foot in plan."""
    crown = corners[corners[:, 2] > plant.foot[2] + plant.height * plant.shape.crown_bottom - 1e-3]
    size, middle = np.ptp(crown, axis=0), (crown.max(axis=0) + crown.min(axis=0)) / 2.0
    aside = float(np.linalg.norm((middle - plant.foot)[:2]))
    return float(corners[:, 2].max() - plant.foot[2]), float(size[:2].max()), aside


def test_plants_have_their_places_and_measures_in_every_format(twins: Twins) -> None:
    roads = Roads.read(twins.folder / "twin.xodr")
    known = {item.attrib["name"]: item for item in roads.objects().values()}
    assert len(twins.plants) > 30
    for plant in twins.plants:
        attributes = twins.city.objects[plant.name]["attributes"]
        wide = 2.0 * plant.breadth * plant.shape.crown_radius
        assert (attributes["instance"], attributes["stand"]) == (plant.instance, plant.stand)
        assert attributes["height"] == pytest.approx(plant.height, abs=1e-4)
        assert attributes["crownDiameter"] == pytest.approx(wide, abs=1e-4)
        element = named(twins.ifc, plant.name)
        assert said(element)["instance"] == plant.instance
        for corners in (twins.corners(plant.name), body(element)[0]):
            height, diameter, aside = _measures(corners, plant)
            assert height == pytest.approx(plant.height, abs=5e-4)
            assert diameter == pytest.approx(wide, abs=5e-4)
            assert aside < wide * 0.01 + 5e-4
        item = known[plant.name]
        assert int(item.attrib["id"]) == plant.instance
        np.testing.assert_allclose(roads.place(item), plant.foot + twins.origin, rtol=0, atol=1e-3)
        assert float(item.attrib["height"]) == pytest.approx(plant.height, abs=1e-6)
        assert float(item.attrib["radius"]) == pytest.approx(wide / 2.0, abs=1e-6)


def test_plants_stand_on_the_ground_within_their_band(twins: Twins) -> None:
    geometry = twins.geometry
    for plant in twins.plants:
        station, offset = (float(value[0]) for value in geometry.alignment.project(plant.foot[None, :2]))
        surface = surface_points(geometry, np.array([station]), np.array([offset]))
        np.testing.assert_allclose(plant.foot, surface[0], rtol=0, atol=1e-6)
        edges = geometry.offsets(np.array([station]))[0]
        distance = max(offset - edges[0], edges[-1] - offset)
        assert plant.vegetation.band_start - 1e-6 <= distance <= plant.vegetation.band_end + 1e-6
        assert plant.vegetation.height_min <= plant.height <= plant.vegetation.height_max


def test_stands_hold_their_plants(twins: Twins) -> None:
    stands = twins.road.of_type(Vegetation)
    for name in stands:
        group = twins.city.objects[name]
        assert group["type"] == "CityObjectGroup"
        members = group["children"]
        assert members == [plant.name for plant in twins.plants if plant.stand == name] or stands[name].kind == "grass"
        assert {item.Name for item in parts(named(twins.ifc, name))} - {name} == set(members)


def test_grass_is_an_area_above_the_ground_for_each_strip(twins: Twins) -> None:
    strips = {name: item for name, item in twins.city.objects.items() if item["type"] == "PlantCover"}
    numbers = twins.geometry.numbers
    assert {name.partition("/")[2] for name in strips} == {
        "left-band",
        "right-band",
        "left-verge",
        "right-verge",
        "median",
    }
    for name, item in strips.items():
        assert numbers.name_of(item["attributes"]["instance"]) == name
        corners = twins.corners(name)
        station, offset = twins.geometry.alignment.project(corners[:, :2])
        level = surface_points(twins.geometry, np.clip(station, 0.0, twins.geometry.length), offset)[:, 2]
        height = corners[:, 2] - level
        assert height == pytest.approx(np.full(len(height), item["attributes"]["averageHeight"]), abs=2e-3)
        edges = twins.geometry.offsets(np.clip(station, 0.0, twins.geometry.length))
        strip = name.partition("/")[2]
        side = {"l": 1.0, "r": -1.0}.get(strip[0])
        if side:
            assert (side * offset > 0.0).all()
        if strip.endswith("band"):
            assert (np.maximum(offset - edges[:, 0], edges[:, -1] - offset) > -1e-3).all()


# --- vehicles -------------------------------------------------------------------------------------------------------


def test_vehicles_are_boxes_on_the_road(twins: Twins) -> None:
    placed = list(placed_vehicles(twins.geometry))
    assert placed
    for vehicle in placed:
        item = twins.city.objects[vehicle.name]
        assert item["type"] == "GenericCityObject"
        kind = VEHICLE_TYPES[vehicle.vehicle.model]
        seen = twins.corners(vehicle.name)
        ours = (seen - vehicle.place) @ vehicle.rotation
        np.testing.assert_allclose(np.ptp(ours, axis=0), (kind.length, kind.width, kind.height), rtol=0, atol=3e-4)
        low = seen[ours[:, 2] < 1e-3]
        station, offset = twins.geometry.alignment.project(low[:, :2])
        inside = (station > 0.0) & (station < twins.geometry.length)
        # Its lane is curved and its crossfall turns by millimetres below it.
        assert np.abs(low[inside, 2] - twins.geometry.elevation(station[inside], offset[inside])).max() < 0.03
        theirs = body(named(twins.ifc, vehicle.name))[0]
        assert np.abs(np.sort(theirs, axis=0)[[0, -1]] - np.sort(seen, axis=0)[[0, -1]]).max() < 1e-3
