"""The placement of furniture as a whole: rules, bodies, kinds, drawn values, extremes, and furniture at random."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from synthroads_addon.road.guidelines import StandardCrossSection
from synthroads_addon.road.objects import WidthPoint
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.things.beacon import ConstructionBeacon
from synthroads_addon.road.things.cabinet import Cabinet
from synthroads_addon.road.things.concrete_barrier import ConcreteBarrier
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.gutter import Gutter
from synthroads_addon.road.things.kilometre_board import KilometreBoard
from synthroads_addon.road.things.noise_barrier import NoiseBarrier
from synthroads_addon.road.things.overpass import Overpass
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.road.things.shaft import Shaft
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.temporary_barrier import TemporaryBarrier
from synthroads_addon.road.things.traffic_light import TrafficLight
from synthroads_addon.sampling.placing.site import PlacementSite
from tests.helpers.files.mutations import cases
from tests.helpers.roads.sites import (
    BODIES,
    EVERYTHING,
    NOTHING,
    bay_at,
    curve,
    entry_at,
    exit_at,
    faults,
    make_site,
    merged,
    of,
    place,
    straight,
)

SWITCHED_ON = merged(
    merged(NOTHING, EVERYTHING),
    {
        "furniture": {
            "signs": True,
            "delineators": True,
            "kilometre_boards": True,
            "emergency_phones": True,
            "gutters": True,
            "shafts": True,
            "cabinets_per_km": {"minimum": 0.0, "maximum": 3.0},
        }
    },
)
KINDS = {
    Cabinet,
    ConcreteBarrier,
    ConstructionBeacon,
    Delineator,
    Gantry,
    Guardrail,
    Gutter,
    KilometreBoard,
    LineMarking,
    NoiseBarrier,
    Overpass,
    Pole,
    Shaft,
    TemporaryBarrier,
    TrafficLight,
    TrafficSign,
}
DROP = (WidthPoint(station=700.0, width=3.75), WidthPoint(station=850.0, width=0.0))
ONE_LANE = StandardCrossSection((3.75,), 2.5, 0.5, 0.5, 3.0, verge=0.5)
NO_SHOULDER = StandardCrossSection((3.75, 3.5), 0.0, 0.5, 0.5, 4.0)
WIDE = StandardCrossSection((3.75, 3.5, 3.5, 3.5), 3.0, 0.75, 0.75, 12.0, verge=3.0)
URBAN = {"design_class": "EKA3", "cross_section": "RQ25"}
SITES: dict[str, dict[str, Any]] = {
    "straight": {"elements": straight(900.0)},
    "embankment": {"elements": straight(900.0), "embankment": 4.0},
    "curve": {"elements": curve(1000.0), "design_class": "EKA1A"},
    "tight": {"elements": curve(-300.0), **URBAN},
    "turnouts": {"elements": straight(2500.0), "turnouts": [exit_at(1200.0), entry_at(1700.0), bay_at(300.0)]},
    "left turnouts": {
        "elements": straight(2500.0),
        "embankment": 4.0,
        "turnouts": [exit_at(900.0, "left"), entry_at(400.0, "left"), bay_at(1800.0, "left")],
    },
    "crowded": {
        "elements": straight(1200.0),
        "embankment": 4.0,
        "turnouts": [exit_at(10.0), bay_at(460.0), entry_at(680.0)],
    },
    "close bays": {"elements": straight(600.0), "embankment": 4.0, "turnouts": [bay_at(100.0), bay_at(220.0)]},
    "lane drop": {"elements": straight(1500.0), "embankment": 4.0, "outer_lane": DROP},
    "narrow median": {"elements": straight(700.0), **URBAN},
    "one lane": {"elements": straight(700.0), "section": ONE_LANE},
    "no shoulder": {"elements": straight(1500.0), "section": NO_SHOULDER, "turnouts": [exit_at(800.0, shoulder=0.0)]},
    "wide": {"elements": straight(1500.0), "section": WIDE, "turnouts": [entry_at(300.0)]},
}


def site_of(name: str, seed: int, **changes: Any) -> PlacementSite:
    """Return one of `SITES` with all kinds of furniture switched on."""
    return make_site(**merged(SWITCHED_ON, SITES[name] | {"seed": seed} | changes))


@cases(8, 50)
@pytest.mark.parametrize("name", SITES)
def test_no_rule_is_broken(name: str, count: int) -> None:
    for seed in range(count):
        site = site_of(name, seed)
        assert faults(site, place(site)) == [], seed


@pytest.mark.parametrize("length", [1.0, 7.0, 40.0, 75.0, 150.0])
def test_no_rule_is_broken_on_a_short_road(length: float) -> None:
    for seed in range(10):
        site = site_of("straight", seed, elements=straight(length), embankment=4.0)
        assert faults(site, place(site)) == [], seed


def test_a_road_of_100_km() -> None:
    site = site_of("turnouts", 3, elements=straight(100_000.0))
    furniture = place(site)
    assert len(of(furniture, Delineator)) == 4000
    assert 390 <= len(of(furniture, KilometreBoard)) <= 400
    assert faults(site, furniture) == []


def test_the_same_seed_gives_the_same_furniture_and_another_one_other() -> None:
    first, again, other = (place(site_of("turnouts", seed)) for seed in (5, 5, 6))
    assert first == again
    assert list(first) == list(again)
    assert first != other
    assert all(item.instance == 1 for item in first.values())


@pytest.mark.parametrize("placement", ["rules", "random"])
def test_every_kind_occurs(placement: str) -> None:
    found = {
        type(item)
        for name in ("turnouts", "straight")
        for seed in range(20)
        for item in place(site_of(name, seed, placement=placement)).values()
    }
    assert found == KINDS


def test_nothing_that_is_switched_off_occurs() -> None:
    for placement in ("rules", "random"):
        furniture = place(make_site(straight(2500.0), turnouts=[exit_at(1200.0)], placement=placement))
        assert {type(item) for item in furniture.values()} <= {Guardrail}
        site = make_site(embankment=4.0, barriers={"median": False, "roadside": False}, placement=placement)
        assert place(site) == {}


def test_drawn_values_cover_their_intervals() -> None:
    drawn: dict[str, list[float]] = {}
    for seed in range(250):
        site = site_of("straight", seed)
        for item in place(site).values():
            for name, value in _drawn(item):
                drawn.setdefault(name, []).append(value)
    scenario = site_of("straight", 0).scenario
    for name, values in drawn.items():
        group, field = name.split(".")
        limits = getattr(getattr(scenario, group), field)
        assert limits.minimum <= min(values) <= max(values) <= limits.maximum, name
        assert max(values) - min(values) >= 0.9 * (limits.maximum - limits.minimum), name
    assert len(drawn) == 10


def _drawn(item: Any) -> list[tuple[str, float]]:
    """Return (interval, value) of an object's drawn numbers."""
    if isinstance(item, Guardrail):
        return [("barriers.guardrail_height", item.height)]
    if isinstance(item, NoiseBarrier):
        length = item.end_station - item.start_station
        return [("barriers.noise_barrier_height", item.height), ("barriers.noise_barrier_length", length)]
    if isinstance(item, Gantry):
        return [("furniture.gantry_clearance", item.clearance)]
    if isinstance(item, Overpass):
        return [("furniture.overpass_clearance", item.clearance), ("furniture.overpass_width", item.width)]
    if isinstance(item, Pole):
        return [(f"furniture.{item.kind}_height", item.height)]
    if isinstance(item, LineMarking):
        length = item.end_station - item.start_station
        return [("markings.film_thickness", item.film_thickness), ("furniture.construction_length", length)]
    return []


@cases(5, 30)
@pytest.mark.parametrize("name", SITES)
def test_at_random_nothing_collides_or_stands_on_the_pavement(name: str, count: int) -> None:
    for seed in range(count):
        site = site_of(name, seed, placement="random")
        assert faults(site, place(site), BODIES) == [], seed


def test_at_random_the_rules_are_not_kept() -> None:
    broken = Counter(
        fault.rule
        for seed in range(10)
        for site in [site_of("left turnouts", seed, placement="random")]
        for fault in faults(site, place(site))
    )
    assert {"median-barrier", "embankment-barrier", "delineator-spacing", "exit-sign-missing"} <= set(broken)
    stations, distances = [], set()
    for seed in range(10):
        site = site_of("straight", seed, placement="random")
        stations += [post.station for post in of(place(site), Delineator).values()]
        distances |= {round(abs(post.offset) - 14.0, 3) for post in of(place(site), Delineator).values()}
    assert np.histogram(stations, bins=6, range=(0.0, 900.0))[0].min() > 30
    assert len(distances) > 4
