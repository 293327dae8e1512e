"""The instances of clouds are those of the twins of their roads, and the other way round; on all cross-sections."""

from __future__ import annotations

from pathlib import Path

import pytest

from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.road.things.thing import Thing
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from tests.helpers.files.twin_reports import TwinReport
from tests.helpers.scenes.panoptic import PanopticSet, panoptic_set

TWINS = 'twin=["cityjson","ifc","opendrive","geojson"]'
FILES = ('outputs=["parameters","cloud"]', 'cloud.formats=["npz"]', TWINS)
ALL = (
    *(f"road.furniture.{name}=1" for name in ("gantries", "lighting", "surveillance", "traffic_lights")),
    "road.furniture.cabinets_per_km.minimum=8",
    "road.furniture.cabinets_per_km.maximum=10",
    "road.barriers.noise_barrier=1",
    "road.pavement.rutted=1",
    "road.pavement.potholes_per_km.minimum=15",
    "road.pavement.potholes_per_km.maximum=20",
    "road.vehicles.per_km.minimum=20",
    "road.vehicles.per_km.maximum=30",
)
WORKS = ("road.furniture.construction_zone=1",)
ASSETS = ('road.assets=["roadside"]', "road.half_width=110")
VILLAGE = (
    *(f"road.roadside.buildings_per_km.{end}=12" for end in ("minimum", "maximum")),
    *(f"road.roadside.parked_per_building.{end}=2" for end in ("minimum", "maximum")),
    "road.roadside.walls=1",
)
BRIDGE = ("road.furniture.overpass=1", "road.barriers.concrete_median=1")
TURNOUTS = ("road.turnouts.exits=1", "road.turnouts.emergency_bays=1")
CURVED = ('road.radius={"minimum": 300, "maximum": 500}',)
"""So tight that a carriageway falls towards the median, where it has a gutter then."""
SETS = {
    "RQ43.5": ("EKA1A", 400, BRIDGE),
    "RQ36": ("EKA1A", 700, WORKS),
    "RQ31": ("EKA1B", 400, BRIDGE),
    "RQ28": ("EKA2", 300, (*ASSETS, *VILLAGE)),
    "RQ38.5": ("EKA3", 700, TURNOUTS),
    "RQ31.5": ("EKA3", 200, CURVED),
    "RQ25": ("EKA3", 200, ()),
}
"""Cross-section -> design class, length (m), and what it has besides."""


def scenario(section: str) -> Scenario:
    design, length, further = SETS[section]
    still = ("scan.traffic_speed_factor=0",) if design == "EKA3" else ()
    road = (f"road.design_class={design}", f"road.cross_section={section}", f"road.length={length}")
    small = ("road.half_width=35", "seed=2", "scan.platform.speed=40")
    return load_scenario("mobile-mapping-300m-even", [*road, *small, *ALL, *further, *still, *FILES])


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> PanopticSet:
    """A short road."""
    small = ("road.length=40", "road.half_width=30", "scan.platform.speed=40", "scan.traffic_speed_factor=0")
    small += ("road.vehicles.per_km.minimum=50", "road.vehicles.per_km.maximum=60")
    folder = tmp_path_factory.mktemp("short")
    return panoptic_set(load_scenario("mobile-mapping-300m-even", [*small, *FILES]), folder)


pytestmark = [pytest.mark.keep_scene, pytest.mark.any_blender]


def test_a_short_road_has_the_same_instances_in_cloud_and_twins(short: PanopticSet) -> None:
    assert len(short.cloud) > 40
    assert short.unknown() == {}
    assert short.not_in_the_scene() == []
    assert short.hidden_truth() == {}


def test_a_number_that_a_twin_drops_is_seen(short: PanopticSet) -> None:
    number = max(short.cloud & short.reports["cityjson"].entities.keys())
    kept = short.reports["cityjson"]
    rows = [row for row in kept.data["instances"] if row["instance"] != number]
    short.reports["cityjson"] = TwinReport(kept.data | {"instances": rows})
    try:
        assert short.unknown() == {"cityjson": [short.road.numbers.name_of(number)]}
    finally:
        short.reports["cityjson"] = kept


def test_a_number_that_the_cloud_drops_is_seen(short: PanopticSet) -> None:
    carriageway = short.road.parameters.carriageway("right").instance
    short.cloud.discard(carriageway)
    try:
        assert short.hidden_truth().keys() == {short.road.numbers.name_of(carriageway)}
    finally:
        short.cloud.add(carriageway)


@pytest.mark.slow
@pytest.mark.parametrize("section", list(SETS))
def test_sets_have_the_same_instances_in_cloud_and_twins(section: str, tmp_path: Path) -> None:
    found = panoptic_set(scenario(section), tmp_path)
    met = found.met()
    twins, names = found.solid_numbers(), found.road.numbers.name_of
    print(f"\n{section}: {len(found.cloud)} instances in the cloud, {len(twins)} in the twins,", end=" ")
    print(f"{len(twins - found.cloud)} of them without a point; of these met by pulses:", end=" ")
    print({names(number): times for number, times in met.items()})
    assert found.unknown() == {}
    assert found.not_in_the_scene() == []
    assert found.hidden_truth() == {}


@pytest.mark.slow
def test_the_sets_have_all_things() -> None:
    found: set[str] = set()
    for section in SETS:
        road = sample_road(scenario(section).road, 2)
        found |= {type(item).__name__ for item in road.of_type(Thing).values()}
    assert found == set(THINGS)
