"""CityJSON: valid by the official schema and by index, as exact as the parameters, and open to other readers."""

from __future__ import annotations

import copy
import json
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema_rs
import numpy as np
import pytest

from synthroads_addon.base.classes import classes
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.instances import InstanceNumbers, damage_kinds
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.section import Carriageway, LineMarking, Median, Turnout
from synthroads_addon.road.surroundings import Terrain, Vegetation
from synthroads_addon.road.things.building import Building
from synthroads_addon.road.things.gutter import Gutter
from synthroads_addon.road.things.overpass import Overpass
from synthroads_addon.road.turnout_geometry import STEP
from synthroads_addon.twin.cityjson.writer import write_cityjson
from synthroads_addon.twin.plants import placed_plants
from tests.helpers.files.cityjson_files import City, faults_of, read_city, width_at
from tests.helpers.roads.twin_roads import NUMBER, full_road, one_of_many, road
from tests.judges import JUDGES, require
from tests.judges.cityjson import official_schema, unfitting_objects

TOLERANCE = 0.005
AREAS = ("TrafficArea", "AuxiliaryTrafficArea")


def city_of(parameters: RoadParameters, folder: Path, tolerance: float = TOLERANCE) -> City:
    write_cityjson(parameters, folder / "a.city.json", tolerance)
    return read_city(folder / "a.city.json")


@pytest.fixture(scope="module")
def full_city(tmp_path_factory: pytest.TempPathFactory) -> City:
    return city_of(full_road(), tmp_path_factory.mktemp("city"))


@pytest.fixture(scope="module")
def folder_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Return what makes a folder for one of the many roads."""
    return cache(lambda index: tmp_path_factory.mktemp(f"road-{index}"))


@pytest.fixture(scope="module")
def cities(folder_of: Callable[[int], Path]) -> Callable[[int], City]:
    """Return what writes and reads one of the many roads, each once."""
    return cache(lambda index: city_of(one_of_many(index), folder_of(index)))


@pytest.fixture(scope="module")
def schema() -> jsonschema_rs.Draft7Validator | None:
    """The official schema where it is there."""
    return jsonschema_rs.Draft7Validator(official_schema()) if JUDGES["cityjson-schema"].version() else None


# --- valid ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_roads_of_all_kinds_have_no_fault(
    share: int, schema: jsonschema_rs.Draft7Validator | None, cities: Callable[[int], City]
) -> None:
    """Of the fifty roads two at once, and the rest where there is time."""
    for number in range(NUMBER):
        if (0 if number in (0, 3) else 1 + number % 2) == share:
            city = cities(number)
            assert (number, faults_of(city)) == (number, [])
            if schema:
                assert (number, unfitting_objects(schema, city.data)) == (number, [])


@pytest.mark.slow
def test_the_roads_are_of_all_kinds() -> None:
    kinds = Counter(type(item).__name__ for i in range(NUMBER) for item in one_of_many(i).objects.values())
    wanted = {"Turnout", "Overpass", "Gantry", "NoiseBarrier", "TemporaryBarrier", "ConstructionBeacon", "Hatching"}
    assert wanted <= set(kinds)


def test_a_whole_file_fits_the_official_schema(
    schema: jsonschema_rs.Draft7Validator, full_city: City, cities: Callable[[int], City]
) -> None:
    require("cityjson-schema")
    assert unfitting_objects(schema, full_city.data) == []
    data = copy.deepcopy(cities(3).data)
    assert unfitting_objects(schema, data) == []
    name, road = next((name, item) for name, item in data["CityObjects"].items() if item["type"] == "Road")
    road["geometry"][0]["lod"] = 3
    assert unfitting_objects(schema, data) == [name]
    del data["version"], road["geometry"][0]
    assert unfitting_objects(schema, data | {"CityObjects": {}}) == ["the file"]


def test_what_the_checks_are_for_is_found(tmp_path: Path) -> None:
    plain = road(0, length=100.0)
    city = city_of(plain, tmp_path)

    def broken(change: Callable[[Any], Any]) -> str:
        data = json.loads(json.dumps(city.data))
        change(data)
        return " ".join(faults_of(City(data, city.vertices)))

    carriageway = next(name for name, item in plain.objects.items() if isinstance(item, Carriageway))
    rail = next(name for name, item in city.objects.items() if item["attributes"]["object_type"] == "Guardrail")

    def shape(data, name):
        return data["CityObjects"][name]["geometry"][0]

    assert "there twice" in broken(lambda data: data["vertices"].__setitem__(0, data["vertices"][1]))
    assert "of no use" in broken(lambda data: data["vertices"].append([0, 0, 0]))
    assert "semantic values" in broken(lambda data: shape(data, carriageway)["semantics"]["values"].pop())
    assert "a vertex twice" in broken(lambda data: shape(data, carriageway)["boundaries"][0][0].extend([0, 0]))
    assert "isn't closed" in broken(lambda data: shape(data, rail)["boundaries"][0][0].pop())
    assert "look inwards" in broken(lambda data: [r[0].reverse() for r in shape(data, rail)["boundaries"][0][0]])


def test_the_surface_has_no_gap_and_looks_up(full_city: City) -> None:
    """Every edge of a strip is the neighbour's edge, backwards, but for the road's outline: its sides and ends."""
    edges: Counter[tuple[int, int]] = Counter()
    for _, shape in full_city.geometries():
        if "semantics" not in shape:
            continue
        kinds = [surface["type"] for surface in shape["semantics"]["surfaces"]]
        for (ring,), value in zip(shape["boundaries"], shape["semantics"]["values"], strict=True):
            points = full_city.vertices[ring] - full_road().transform.translate
            x, y = points[:, 0], points[:, 1]
            # Slivers where a strip begins can lose what area they have by rounding.
            assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > -1e-4
            if kinds[value] in AREAS:
                edges.update(zip(ring, [*ring[1:], ring[0]], strict=True))
    assert max(edges.values()) == 1
    open_edges = [edge for edge in edges if edge[::-1] not in edges]
    geometry = RoadGeometry(full_road())
    ends = full_city.vertices[np.array(open_edges)] - full_road().transform.translate
    station, offset = geometry.alignment.project(ends.reshape(-1, 3)[:, :2])
    outline = geometry.offsets(station)
    away = np.min(np.abs(np.stack([offset - outline[:, 0], offset - outline[:, -1]])), axis=0)
    away = np.minimum(away, np.minimum(np.abs(station), np.abs(station - geometry.length)))
    # Beside a step of the outline (5 cm long) rounding along the road counts across it.
    assert away.max() < 0.02
    assert np.mean(away < 2e-4) > 0.98


# --- exact ------------------------------------------------------------------------------------------------------


def on_road(road: RoadParameters, rings: list[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return local points (N, 3) of rings, and their stations and offsets, clipped to the road."""
    local = np.concatenate(rings) - np.array(road.transform.translate)
    geometry = RoadGeometry(road)
    station, offset = geometry.alignment.project(local[:, :2])
    edges = geometry.offsets(station)
    return local, np.clip(station, 0.0, geometry.length), np.clip(offset, edges[:, -1], edges[:, 0])


@pytest.mark.parametrize("index", [2, None, pytest.param(22, marks=pytest.mark.slow)])
def test_vertices_lie_on_the_analytic_road_within_a_millimetre(
    index: int | None, full_city: City, cities: Callable[[int], City]
) -> None:
    road = full_road() if index is None else one_of_many(index)
    assert road.transform.translate[1] > 5e6  # a zone of UTM
    city, geometry = full_city if index is None else cities(index), RoadGeometry(road)
    films, rings = [], []
    for _, about, found in city.surfaces():
        if about.get("function") in ("crack", "removed marking"):  # as high as the films below, see the tests of damage
            continue
        rings += found
        films.append(np.full(sum(map(len, found)), about.get("film_thickness", 0.0)))
    local, station, offset = on_road(road, rings)
    truth = geometry.point(station, offset)
    truth[:, 2] += np.concatenate(films)
    assert np.linalg.norm(local - truth, axis=1).max() < 0.001


def test_the_transform_keeps_utm_coordinates(full_city: City) -> None:
    road = full_road()
    assert full_city.data["transform"] == {"scale": [1e-4] * 3, "translate": list(road.transform.translate)}
    metadata = full_city.data["metadata"]
    assert metadata["referenceSystem"] == road.metadata.referenceSystem
    extent = [*full_city.vertices.min(axis=0), *full_city.vertices.max(axis=0)]
    np.testing.assert_allclose(metadata["geographicalExtent"], extent, rtol=0, atol=6e-5)


@pytest.mark.parametrize("tolerance", [0.02, pytest.param(0.001, marks=pytest.mark.slow)])
def test_polygons_keep_the_tolerance(tolerance: float, tmp_path: Path) -> None:
    whole = full_road()
    # The surfaces of the carriageways and what lies between and beside them: nothing else has these tolerances.
    surface = (Carriageway, Gutter, LineMarking, Median, Turnout)
    objects = {name: item for name, item in whole.objects.items() if isinstance(item, (AlignmentObject, *surface))}
    road = whole.model_copy(update={"objects": objects})
    city, geometry = city_of(road, tmp_path, tolerance), RoadGeometry(road)
    rings = [ring for _, _, found in city.surfaces(*AREAS) for ring in found]
    middles = [np.concatenate([ring.mean(axis=0)[None], (ring + np.roll(ring, -1, axis=0)) / 2.0]) for ring in rings]
    local, station, offset = on_road(road, middles)
    away = np.abs(local[:, 2] - geometry.elevation(station, offset))
    # Between the two ends of a step (at a nose, at a ramp's end) the surface is skew over 5 cm.
    shapes = [shape for section in geometry.sections.values() for shape in section.turnouts]
    steps = np.array([kink for shape in shapes if shape.turnout.ramp for kink in shape.kinks()])
    between = np.min(np.abs(station[:, None] - steps), axis=1) < STEP
    assert away[~between].max() < tolerance
    assert between.mean() < 0.1


def test_lanes_are_as_wide_as_the_parameters_say(full_city: City) -> None:
    road = full_road()
    geometry = RoadGeometry(road)
    for name, carriageway in road.of_type(Carriageway).items():
        section = geometry.sections[carriageway.side]
        for _, about, rings in full_city.surfaces("TrafficArea"):
            if about["instance"] != carriageway.instance or about["strip"] != "lane":
                continue
            for station in (100.3, 471.9, 640.0, 1099.1):
                boundaries = section.lane_boundaries(station)[0]
                wanted = boundaries[about["lane"]] - boundaries[about["lane"] + 1]
                if wanted > 0.01:  # the lane is there
                    assert width_at(road, rings, station) == pytest.approx(wanted, abs=0.001), name


def test_dashes_begin_end_and_measure_as_the_parameters_say(full_city: City) -> None:
    road = full_road()
    geometry = RoadGeometry(road)
    found: dict[str, list[tuple[float, float]]] = {}
    for _, about, rings in full_city.surfaces("TransportationMarking"):
        owner = about["id"].partition("/")[0]
        item = road.objects[owner]
        if not isinstance(item, LineMarking):
            continue
        _, station, _ = on_road(road, rings)
        assert station.min() == pytest.approx(about["start_station"], abs=0.001)
        assert station.max() == pytest.approx(about["end_station"], abs=0.001)
        found.setdefault(owner, []).append((about["start_station"], about["end_station"]))
        ring = rings[0] - np.array(road.transform.translate)
        if len(ring) == 4:
            # From right to left behind, in the plane of the pavement.
            _, offset = geometry.alignment.project(ring[[0, 3], :2])
            assert offset[1] - offset[0] == pytest.approx(item.width, abs=2e-4)
    for name, line in road.of_type(LineMarking).items():
        np.testing.assert_allclose(np.array(found[name]), geometry.dashes(line), rtol=0, atol=1e-6)


# --- whole ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [0, None, 2])
def test_ids_and_instances_are_those_of_the_set_and_the_cloud(
    index: int | None, full_city: City, cities: Callable[[int], City]
) -> None:
    road = full_road() if index is None else one_of_many(index)
    city = full_city if index is None else cities(index)
    wanted = {name: item.instance for name, item in road.objects.items()}
    found = {name: item["attributes"]["instance"] for name, item in city.objects.items()}
    childless = {item["type"] for item in city.objects.values() if not item.get("children", True)}
    assert childless <= {"CityObjectGroup"}, "only a group says that it has no members"
    kinds = ("TransportationMarking", "TransportationHole", "+PavementDamage")
    surfaces = (about for kind in kinds for _, about, _ in city.surfaces(kind))
    painted = {about["id"]: about["instance"] for about in surfaces}
    fine = {name: painted.pop(name) for name in list(painted) if "/" in name}
    numbers = InstanceNumbers(road)
    assert {name: numbers.name_of(number) for name, number in fine.items()} == {name: name for name in fine}
    assert {name.partition("/")[0] for name in fine} == {
        *(name for name, line in road.of_type(LineMarking).items() if line.dash_length),
        *(
            name
            for name, item in road.of_type(Carriageway).items()
            if damage_kinds(item.pavement).count("rut") < len(damage_kinds(item.pavement))
        ),
    }
    wanted = {
        name: number
        for name, number in wanted.items()
        if not (isinstance(line := road.objects[name], LineMarking) and line.dash_length)
    }
    parts = {name: number for name, number in found.items() if "/" in name}
    assert {name: number for name, number in found.items() if name not in parts} | painted == wanted
    wholes = {*road.of_type(Overpass), *road.of_type(Building), *road.of_type(Vegetation)}
    # Terrain has swales where the road lies in a cutting.
    assert {name.split("/")[0] for name in parts} - {*road.of_type(Terrain)} == wholes
    growing = {name: number for name, number in parts.items() if road.objects[name.split("/")[0]].type == "Vegetation"}
    assert {name: numbers.name_of(number) for name, number in growing.items()} == {name: name for name in growing}
    assert {plant.name for plant in placed_plants(RoadGeometry(road))} <= set(growing)
    assert city.instances() == {*wanted.values(), *fine.values(), *growing.values()}


def test_classes_are_those_of_the_cloud(full_city: City) -> None:
    names = {row.name for row in classes()} | {"motorway"}
    assert {item["attributes"]["class"] for item in full_city.objects.values()} <= names


def test_overpass_keeps_its_clearance(full_city: City) -> None:
    road = full_road()
    geometry = RoadGeometry(road)
    ((name, bridge),) = road.of_type(Overpass).items()
    assert full_city.objects[name]["type"] == "Bridge"
    deck = full_city.objects[f"{name}/deck"]["geometry"][0]["boundaries"]
    points = full_city.vertices[sorted({index for (shell,) in deck for (ring,) in shell for index in ring})]
    underside = points[:, 2].min() - road.transform.translate[2]
    assert points[:, 2].max() - points[:, 2].min() == pytest.approx(bridge.deck_thickness, abs=2e-4)
    near = np.linspace(bridge.station - bridge.width / 2, bridge.station + bridge.width / 2, 9)
    edges = geometry.offsets(near)
    paved = [n for n, strip in enumerate(geometry.strips) if strip.class_name == "road"]
    heights = np.concatenate(
        [geometry.elevation(near, edges[:, n]) for n in (*paved, *(number + 1 for number in paved))]
    )
    assert underside - heights.max() == pytest.approx(bridge.clearance, abs=0.02)


def test_same_bytes_twice(cities: Callable[[int], City], folder_of: Callable[[int], Path], tmp_path: Path) -> None:
    cities(2)
    write_cityjson(one_of_many(2), tmp_path / "again", TOLERANCE)
    assert (tmp_path / "again").read_bytes() == (folder_of(2) / "a.city.json").read_bytes()
