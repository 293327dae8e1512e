"""Surroundings of a sampled road: all within its limits, covering them, and nothing in each other's way."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.materials.variation import vary_material
from synthroads_addon.road.guidelines import LIMITS
from synthroads_addon.road.objects import width_at
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, Metadata, RoadParameters, Transform, read_parameters
from synthroads_addon.road.section import Carriageway
from synthroads_addon.road.surroundings import SPECIES, Environment, MaterialVariation, Terrain, Vegetation, Vehicle
from synthroads_addon.road.things.beacon import ConstructionBeacon
from synthroads_addon.road.things.limits import Interval
from synthroads_addon.road.things.temporary_barrier import TemporaryBarrier
from synthroads_addon.road.things.vehicles import COLORS, VEHICLE_TYPES
from synthroads_addon.sampling.forest import NEAREST
from synthroads_addon.sampling.placing.site import PlacementSite
from synthroads_addon.sampling.surroundings import (
    WEATHER,
    sample_environment,
    sample_materials,
    sample_terrain,
    sample_vegetation,
    sample_vehicles,
)
from synthroads_addon.scenario.road import EnvironmentLimits, RoadScenario
from tests.helpers.relative_speed import quiet_seconds

SEEDS = range(300)


def within(low: float, high: float) -> dict[str, float]:
    return {"minimum": low, "maximum": high}


def points(*pairs: tuple[float, float]) -> list[dict[str, float]]:
    return [{"station": station, "width": width} for station, width in pairs]


def carriageway(side: str, lanes: Iterable = (3.75, 3.5, 3.5), verge=1.5) -> Carriageway:
    return Carriageway.from_dict(
        {
            "instance": 1,
            "side": side,
            "inner_offset": 2.0,
            "hard_shoulder_width": 2.5,
            "outer_edge_strip_width": 0.5,
            "lanes": [{"width": width} for width in lanes],
            "inner_edge_strip_width": 0.75,
            "verge_width": verge,
            "crossfall": [{"station": 0.0, "crossfall_percent": 2.5}],
        }
    )


def site(scenario: RoadScenario, seed: int, lanes: Iterable = (3.75, 3.5, 3.5), verge=1.5) -> PlacementSite:
    """Return a straight road of the scenario's length without turnouts."""
    axis = AlignmentObject(
        instance=1,
        start_x=0.0,
        start_y=0.0,
        start_heading_deg=0.0,
        horizontal=(HorizontalElement.between(scenario.length, 0.0, 0.0),),
        vertical=(VerticalPoint(station=0.0, elevation=0.0),),
    )
    sides = {side: carriageway(side, lanes, verge) for side in ("right", "left")}
    return PlacementSite(scenario, seed, axis, sides, {}, sample_terrain(scenario, seed))


def assert_covers(values: Iterable[float], limits: Interval, share: float = 0.9) -> None:
    values = np.array(list(values))
    assert values.min() >= limits.minimum
    assert values.max() <= limits.maximum
    assert np.ptp(values) >= share * (limits.maximum - limits.minimum)


# --- ground, light, materials --------------------------------------------------------------------------------------


def test_terrain_covers_its_limits() -> None:
    scenario = RoadScenario()
    grounds = [sample_terrain(scenario, seed) for seed in SEEDS]
    shape = ("crest_length", "rounding_length", "swale_width", "ditch_width")
    for name in ("embankment_height", "undulation", "wavelength", "batter_slope", *shape):
        assert_covers((getattr(ground, name) for ground in grounds), getattr(scenario, name))
    assert {ground.half_width for ground in grounds} == {scenario.half_width}
    assert [ground.swale_depth for ground in grounds] == pytest.approx([g.swale_width / 5.0 for g in grounds])
    assert [ground.ditch_depth for ground in grounds] == pytest.approx([g.ditch_width / 5.0 for g in grounds])
    assert min(ground.ditch_width for ground in grounds if ground.ditch_width) >= 0.5
    assert {ground.instance for ground in grounds} == {1}
    assert len({ground.seed for ground in grounds}) == len(SEEDS)


def test_terrain_names_its_elevation_model() -> None:
    assert sample_terrain(RoadScenario(elevation_model="dem.tif"), 1).elevation_model == "dem.tif"
    assert sample_terrain(RoadScenario(), 1).elevation_model is None


def test_materials_cover_their_limits() -> None:
    scenario = RoadScenario()
    drawn = [sample_materials(scenario, seed) for seed in SEEDS]
    for name in MaterialVariation.model_fields.keys() - {"textures"}:
        assert_covers((getattr(item, name) for item in drawn), getattr(scenario.materials, name))


def test_environment_covers_its_limits() -> None:
    scenario = RoadScenario()
    drawn = [sample_environment(scenario, seed) for seed in range(1000)]
    for name in ("sun_azimuth_deg", "sun_elevation_deg", "cloud_cover"):
        assert_covers((getattr(item, name) for item in drawn), getattr(scenario.environment, name))
    assert_covers((item.wetness for item in drawn if item.wetness > 0.0), scenario.environment.wetness)
    weather = Counter(item.weather for item in drawn)
    assert set(weather) == {"clear", *WEATHER}
    assert 100 < 1000 - weather["clear"] < 200
    wet = [item.wetness > 0.0 for item in drawn if item.weather != "rain"]
    assert 0.1 < sum(wet) / len(wet) < 0.2
    assert all(item.wetness > 0.0 for item in drawn if item.weather == "rain")
    assert all((item.visibility < 23_000.0) == (item.weather != "clear") for item in drawn)


def test_probabilities_of_weather_are_kept() -> None:
    never = RoadScenario(environment=EnvironmentLimits(wet=0.0, bad_weather=0.0))
    always = RoadScenario(environment=EnvironmentLimits(wet=1.0, bad_weather=1.0))
    for seed in SEEDS:
        assert (sample_environment(never, seed).weather, sample_environment(never, seed).wetness) == ("clear", 0.0)
        assert sample_environment(always, seed).weather != "clear"
        assert sample_environment(always, seed).wetness > 0.0


def test_narrow_limits_give_their_value() -> None:
    third = within(1.0 / 3.0, 1.0 / 3.0)
    scenario = RoadScenario.from_dict({"undulation": third, "materials": {"paint_wear": third}})
    assert sample_terrain(scenario, 1).undulation == 1.0 / 3.0
    assert sample_materials(scenario, 1).paint_wear == 1.0 / 3.0


# --- plants --------------------------------------------------------------------------------------------------------


@cache
def gardens() -> list[dict[str, Vegetation]]:
    return [dict(sample_vegetation(site(RoadScenario(length=200.0), seed))) for seed in SEEDS]


def of_kind(plants: dict[str, Vegetation], kind: str) -> list[Vegetation]:
    return [item for item in plants.values() if item.kind == kind]


def test_every_species_grows_somewhere_and_several_along_one_road() -> None:
    for kind, species in SPECIES.items():
        assert {item.species for plants in gardens() for item in of_kind(plants, kind)} == set(species)
        numbers = {len(of_kind(plants, kind)) for plants in gardens()}
        assert numbers == {1, 2} if kind == "grass" else numbers == {1, 2, 3}


def test_only_species_of_the_scenario_grow() -> None:
    limits = {"trees": ["birch"], "shrubs": ["hazel", "hazel"], "grasses": ["reed"]}
    scenario = RoadScenario.from_dict({"vegetation": limits})
    for seed in range(10):
        names = [name for name, _ in sample_vegetation(site(scenario, seed))]
        assert names == ["grass-reed", "shrub-hazel", "tree-birch"]


def test_reed_is_never_the_most_of_several_grasses() -> None:
    for plants in gardens():
        grasses = of_kind(plants, "grass")
        assert max(grasses, key=lambda item: item.density).species != "reed"


def test_densities_are_shared_out() -> None:
    scenario = RoadScenario()
    for plants in gardens():
        assert sum(item.density for item in of_kind(plants, "grass")) == pytest.approx(scenario.grass_density)
        trees = sum(item.density for item in of_kind(plants, "tree"))
        assert trees == pytest.approx(scenario.trees_per_hectare / 10_000.0)
        assert all(item.density == scenario.shrubs_per_hectare / 10_000.0 for item in of_kind(plants, "shrub"))
        assert min(item.density for item in plants.values()) > 0.0


@pytest.mark.parametrize("kind", ["grass", "shrub", "tree"])
def test_heights_cover_their_limits(kind: str) -> None:
    limits = getattr(RoadScenario().vegetation, f"{kind}_height")
    chosen = [item for plants in gardens() for item in of_kind(plants, kind)]
    assert all(item.height_min < item.height_max for item in chosen)
    assert_covers([height for item in chosen for height in (item.height_min, item.height_max)], limits, 0.98)


def test_grass_is_everywhere_and_shrubs_follow_each_other_behind_the_verge() -> None:
    for plants in gardens():
        assert {(item.band_start, item.band_end) for item in of_kind(plants, "grass")} == {(0.0, 78.0)}
        shrubs = of_kind(plants, "shrub")
        assert shrubs[0].band_start == 2.0
        assert shrubs[-1].band_end == 78.0
        for before, after in pairwise(shrubs):
            assert before.band_start < before.band_end == after.band_start


@pytest.mark.parametrize("design_class", ["EKA1A", "EKA1B", "EKA2", "EKA3"])
@pytest.mark.parametrize("verge", [1.5, points((0.0, 3.0), (50.0, 1.0), (80.0, 2.0))])
def test_trees_are_no_obstacles(design_class: str, verge) -> None:
    sections = {"EKA2": "RQ28", "EKA3": "RQ25"}
    scenario = RoadScenario(design_class=design_class, cross_section=sections.get(design_class, "RQ31"), length=100.0)
    here = site(scenario, 3, verge=verge)
    narrowest = width_at(here.carriageways["left"].verge_width, np.linspace(0.0, 100.0, 1001)).min()
    trees = of_kind(dict(sample_vegetation(here)), "tree")
    assert trees
    for item in trees:
        assert narrowest + item.band_start == pytest.approx(LIMITS[design_class].obstacle_distance, abs=1e-9)


@pytest.mark.parametrize(
    ("room", "kinds"), [(0.4, {"grass"}), (5.0, {"grass", "shrub"}), (13.0, {"grass", "shrub", "tree"})]
)
def test_narrow_ground_has_fewer_kinds(room: float, kinds: set[str]) -> None:
    edge = 2.0 + 0.75 + 3.75 + 3.5 + 3.5 + 0.5 + 2.5 + 1.5
    plants = dict(sample_vegetation(site(RoadScenario(half_width=edge + room), 1)))
    assert {item.kind for item in plants.values()} == kinds


def test_no_plants_where_none_are_wanted() -> None:
    bare = RoadScenario(grass_density=0.0, shrubs_per_hectare=0.0, trees_per_hectare=0.0)
    assert not list(sample_vegetation(site(bare, 1)))


def test_one_kind_does_not_change_another() -> None:
    plants = dict(sample_vegetation(site(RoadScenario(), 1)))
    others = dict(sample_vegetation(site(RoadScenario(shrubs_per_hectare=0.0), 1)))
    assert others == {name: item for name, item in plants.items() if item.kind != "shrub"}


@cache
def forests() -> list[dict[str, Vegetation]]:
    limits = {"forest_edges_per_km": {"minimum": 6.0, "maximum": 10.0}}
    scenario = RoadScenario.from_dict({"length": 600.0, "vegetation": limits})
    return [
        {name: item for name, item in sample_vegetation(site(scenario, seed)) if name.startswith("forest")}
        for seed in range(20)
    ]


def test_a_forest_edge_is_a_mantle_of_shrubs_before_a_stand_of_trees() -> None:
    assert sum(map(len, forests())) > 20
    for plants in forests():
        stands = list(plants.values())
        for shrubs, trees in zip(stands[::2], stands[1::2], strict=True):
            assert (shrubs.kind, trees.kind) == ("shrub", "tree")
            assert (shrubs.side, shrubs.start_station) == (trees.side, trees.start_station)
            assert NEAREST <= shrubs.band_start < trees.band_start < shrubs.band_end < trees.band_end <= 78.0
            assert 0.0 <= shrubs.start_station < shrubs.end_station <= 600.0


def test_forest_edges_of_a_side_are_apart_and_all_else_stays() -> None:
    for seed, plants in enumerate(forests()):
        for side in ("left", "right"):
            trees = [item for item in of_kind(plants, "tree") if item.side == side]
            spans = sorted((item.start_station, item.end_station) for item in trees)
            assert all(before[1] < after[0] for before, after in pairwise(spans))
        without = dict(sample_vegetation(site(RoadScenario(length=600.0), seed)))
        assert not any(name.startswith("forest") for name in without)


@pytest.mark.parametrize("field", [{"side": "left"}, {"start_station": 5.0}, {"end_station": 50.0}])
def test_grass_grows_all_along(field: dict[str, Any]) -> None:
    grass = of_kind(gardens()[0], "grass")[0].to_dict()
    with pytest.raises(InputError, match="grass grows all along"):
        Vegetation.from_dict(grass | field)


# --- traffic -------------------------------------------------------------------------------------------------------


@cache
def traffic() -> list[list[Vehicle]]:
    return [[item for _, item in sample_vehicles(site(RoadScenario(length=600.0), seed), {})] for seed in SEEDS]


def least_gap(vehicles: Iterable[Vehicle], seconds: float = 0.0) -> float:
    """Return the least clear distance (m) between two vehicles of one lane, so many seconds after the beginning."""
    lanes = defaultdict(list)
    for item in vehicles:
        forwards = 1.0 if item.carriageway == "carriageway-right" else -1.0
        ahead = forwards * item.station + item.speed * seconds
        half = VEHICLE_TYPES[item.model].length / 2.0
        lanes[item.carriageway, item.lane].append((ahead - half, ahead + half))
    gaps = [np.inf]
    for queue in lanes.values():
        queue.sort()
        gaps += [after[0] - before[1] for before, after in pairwise(queue)]
    return min(gaps)


def lanes_used(scenario: RoadScenario, objects: dict, lanes: Iterable = (3.75, 3.5, 3.5)) -> dict[str, set[int]]:
    used = defaultdict(set)
    for seed in range(60):
        for _, item in sample_vehicles(site(scenario, seed, lanes), objects):
            used[item.carriageway.removeprefix("carriageway-")].add(item.lane)
    return used


def test_table_has_every_model() -> None:
    assert set(VEHICLE_TYPES) == set(get_args(Vehicle.model_fields["model"].annotation))
    assert sum(COLORS.values()) == pytest.approx(1.0)


def test_every_model_and_color_drives_somewhere() -> None:
    vehicles = [item for road in traffic() for item in road]
    assert {item.model for item in vehicles} == set(VEHICLE_TYPES)
    assert {item.color for item in vehicles} == set(COLORS)


def test_number_of_vehicles_follows_the_scenario() -> None:
    numbers = [len(road) / 1.2 for road in traffic()]
    assert np.mean(numbers) == pytest.approx(12.5, abs=1.5)
    assert_covers([len(road) / 1.2 for road in traffic()], Interval(minimum=0.0, maximum=25.0 + 1.7), 0.8)


def test_speeds_cover_their_limits_and_heavy_vehicles_are_slow() -> None:
    vehicles = [item for road in traffic() for item in road]
    assert_covers((item.speed for item in vehicles), RoadScenario().vehicles.speed, 0.95)
    heavy = [item.speed for item in vehicles if VEHICLE_TYPES[item.model].heavy]
    assert_covers(heavy, Interval(minimum=22.0, maximum=25.0), 0.95)
    share = len(heavy) / len(vehicles)
    assert 0.15 < share < 0.3


def test_heavy_vehicles_are_slow_even_where_all_others_race() -> None:
    scenario = RoadScenario.from_dict({"vehicles": {"speed": within(40.0, 60.0), "trucks": within(0.5, 0.5)}})
    vehicles = [item for seed in range(30) for _, item in sample_vehicles(site(scenario, seed), {})]
    for item in vehicles:
        assert item.speed == 25.0 if VEHICLE_TYPES[item.model].heavy else 40.0 <= item.speed <= 60.0


@pytest.mark.parametrize("seconds", [0.0, 10.0, 300.0])
def test_vehicles_keep_their_distance(seconds: float) -> None:
    assert min(least_gap(road, seconds) for road in traffic()) >= 15.0 - 1e-6


def test_vehicles_are_on_the_road() -> None:
    for road in traffic():
        for item in road:
            half = VEHICLE_TYPES[item.model].length / 2.0
            assert half - 1e-6 <= item.station <= 600.0 - half + 1e-6


def test_outer_lanes_have_more_vehicles_and_all_heavy_ones() -> None:
    vehicles = [item for road in traffic() for item in road]
    number = Counter(item.lane for item in vehicles)
    assert number[0] > number[1] > number[2] > 100
    heavy = Counter(item.lane for item in vehicles if VEHICLE_TYPES[item.model].heavy)
    assert set(heavy) == {0, 1}
    two = [item for seed in range(60) for _, item in sample_vehicles(site(RoadScenario(), seed, (3.75, 3.75)), {})]
    assert {item.lane for item in two} == {0, 1}
    assert {item.lane for item in two if VEHICLE_TYPES[item.model].heavy} == {0}


@pytest.mark.parametrize("length", [600.0, 40.0])
def test_a_crowded_road_is_full_and_nobody_collides(length: float) -> None:
    scenario = RoadScenario.from_dict({"length": length, "vehicles": {"per_km": within(900.0, 1000.0)}})
    for seed in range(20):
        vehicles = [item for _, item in sample_vehicles(site(scenario, seed), {})]
        assert len(vehicles) > length / 10.0
        assert least_gap(vehicles) >= 15.0 - 1e-6


def test_a_road_shorter_than_a_vehicle_has_none() -> None:
    scenario = RoadScenario.from_dict({"length": 2.0, "vehicles": {"per_km": within(1000.0, 1000.0)}})
    assert not list(sample_vehicles(site(scenario, 1), {}))


BUSY = RoadScenario.from_dict({"length": 600.0, "vehicles": {"per_km": within(20.0, 25.0)}})


def test_nobody_drives_in_narrow_lanes() -> None:
    assert lanes_used(BUSY, {}, (2.4, 3.5, 3.5)) == {"right": {1, 2}, "left": {1, 2}}
    assert lanes_used(BUSY, {}, (2.4, 2.4)) == {}


@pytest.mark.parametrize(
    ("width", "low", "high"),
    [
        (points((200.0, 3.5), (300.0, 0.0)), 0.0, 200.0 + 100.0 / 3.5),
        (points((200.0, 0.0), (300.0, 3.5)), 200.0 + 250.0 / 3.5, 600.0),
        (points((100.0, 3.5), (110.0, 0.0), (400.0, 0.0), (410.0, 3.5)), 400.0 + 25.0 / 3.5, 600.0),
        (points((-50.0, 3.5), (900.0, 2.6)), 0.0, 600.0),
    ],
)
def test_nobody_drives_where_a_lane_is_narrow(width: list, low: float, high: float) -> None:
    vehicles = [item for seed in range(100) for _, item in sample_vehicles(site(BUSY, seed, (3.5, 3.5, width)), {})]
    ends = [(item.station, VEHICLE_TYPES[item.model].length / 2.0) for item in vehicles if item.lane == 2]
    first, last = min(station - half for station, half in ends), max(station + half for station, half in ends)
    assert low - 1e-6 <= first < low + 20.0
    assert high - 20.0 < last <= high + 1e-6
    assert all(not VEHICLE_TYPES[item.model].heavy for item in vehicles if item.lane == 2)


def zone(*distances: float, side: str = "right") -> dict:
    """Return beacons so far outwards from the centreline, 10 m apart."""
    sign = -1.0 if side == "right" else 1.0
    return {
        f"beacon-{i}": ConstructionBeacon(instance=1, station=200.0 + 10.0 * i, offset=sign * d, pass_side="left")
        for i, d in enumerate(distances)
    }


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(
    ("distances", "is_open"),
    [
        ((16.0, 15.0, 14.0), {0, 1, 2}),  # hard shoulder: 14.0 to 16.5
        ((16.0, 13.0, 9.76, 9.76, 16.0), {1, 2}),  # up to the boundary of the outermost lane
        ((16.0, 12.0), {1, 2}),
        ((16.0, 13.0, 9.0, 9.0, 16.0), {2}),  # into the middle lane
        ((16.0, 3.0), set()),
        ((2.2, 4.0), {0, 1}),  # from the median
    ],
)
def test_construction_closes_lanes(side: str, distances: tuple[float, ...], is_open: set[int]) -> None:
    other = "left" if side == "right" else "right"
    used = lanes_used(BUSY, zone(*distances, side=side))
    assert used[other] == {0, 1, 2}
    assert used[side] == is_open


def test_each_carriageway_has_its_own_construction() -> None:
    both = zone(16.0, 12.0) | {f"left-{name}": item for name, item in zone(16.0, 12.0, side="left").items()}
    assert lanes_used(BUSY, both) == {"right": {1, 2}, "left": {1, 2}}


def test_temporary_barriers_close_lanes_too() -> None:
    barrier = TemporaryBarrier(instance=1, start_station=100.0, end_station=130.0, offset=-16.0, end_offset=-9.8)
    assert lanes_used(BUSY, {"barrier": barrier}) == {"right": {1, 2}, "left": {0, 1, 2}}


def test_no_heavy_vehicles_where_their_lanes_are_closed() -> None:
    scenario = RoadScenario.from_dict({"vehicles": {"per_km": within(25.0, 25.0), "trucks": within(1.0, 1.0)}})
    closed = zone(16.0, 6.5)
    right = [v for _, v in sample_vehicles(site(scenario, 1), closed) if v.carriageway == "carriageway-right"]
    assert {item.lane for item in right} == {2}
    assert not any(VEHICLE_TYPES[item.model].heavy for item in right)


# --- the whole set -------------------------------------------------------------------------------------------------


def test_same_seed_same_surroundings() -> None:
    scenario = RoadScenario()

    def everything(seed: int) -> list:
        here = site(scenario, seed)
        return [*sample_vegetation(here), *sample_vehicles(here, {}), sample_environment(scenario, seed), here.terrain]

    assert everything(7) == everything(7)
    assert everything(7) != everything(8)


def test_a_set_is_written_read_and_written_the_same(tmp_path: Path) -> None:
    scenario = RoadScenario(elevation_model="dem.tif")
    here = site(scenario, 11)
    objects = {"axis": here.alignment} | {f"carriageway-{side}": item for side, item in here.carriageways.items()}
    objects |= {"terrain": here.terrain} | dict(sample_vegetation(here)) | dict(sample_vehicles(here, {}))
    numbered = {name: item.model_copy(update={"instance": i}) for i, (name, item) in enumerate(objects.items(), 1)}
    first = RoadParameters(
        metadata=Metadata(
            identifier="a", generator="b", referenceSystem="https://www.opengis.net/def/crs/EPSG/0/25832"
        ),
        transform=Transform(translate=(0.0, 0.0, 0.0)),
        design_class="EKA1A",
        environment=sample_environment(scenario, 11),
        materials=sample_materials(scenario, 11),
        objects=numbered,
    )
    path = tmp_path / "parameters.json"
    path.write_text(first.to_json(), encoding="utf-8")
    assert read_parameters(path).to_json() == first.to_json()
    assert isinstance(read_parameters(path).terrain, Terrain)


def test_it_takes_no_time() -> None:
    """One set takes about 1.6 ms of a quiet core; building its road takes two seconds."""
    scenario = RoadScenario(length=600.0)
    sites = [site(scenario, seed) for seed in range(40)]

    def draw() -> None:
        for seed, here in enumerate(sites):
            sample_terrain(scenario, seed), sample_environment(scenario, seed), sample_materials(scenario, seed)
            list(sample_vegetation(here)), list(sample_vehicles(here, {}))

    assert quiet_seconds(draw, rounds=5) / len(sites) < 4e-3


def test_markings_of_nearly_all_roads_stand_out_from_asphalt_as_those_of_real_ones() -> None:
    """Airborne scans of real roads have 3.9 to 5.1 dB; the means of what 40 seeds' roads have, seen from above."""
    contrast = []
    for seed in range(1, 41):
        variation = sample_materials(RoadScenario(), seed)
        paint, asphalt = (vary_material(name, variation, Environment()) for name in ("paint_white", "asphalt"))
        contrast.append(10.0 * math.log10((paint.reflectivity + paint.retroreflection) / asphalt.reflectivity))
    assert 4.4 < np.median(contrast) < 4.9
    assert np.mean([3.9 < value < 5.15 for value in contrast]) >= 0.85
    assert max(contrast) < 7.0
