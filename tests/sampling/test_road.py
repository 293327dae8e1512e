"""Sampled roads keep every rule of the checker, which shares nothing with the sampler but the table of limits."""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Collection
from typing import Any, NoReturn

import jsonschema_rs
import numpy as np
import pytest

from synthroads_addon.base.schema import ClosedModel
from synthroads_addon.checking.checker import check
from synthroads_addon.road.guidelines import DUAL_CLASSES, SECTIONS_OF_CLASS
from synthroads_addon.road.parameters import RoadParameters, parameters_schema
from synthroads_addon.road.things.limits import Interval
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario, VegetationLimits
from tests.helpers.files.mutations import cases
from tests.helpers.roads.country_values import AT_MOST, COUNTRY_EXTRACTORS, SPREAD, UNSEEN
from tests.helpers.roads.drawn_values import (
    COUNTED,
    EXTRACTORS,
    choices_in,
    choices_of,
    interval_at,
    intervals_of,
    joints,
    objects_by_type,
    truck_shares,
    turns,
)
from tests.helpers.roads.parameter_sets import OBJECTS
from tests.helpers.roads.structure_values import FEWER, MORE, STRUCTURE_EXTRACTORS

ROADS = [(design_class, section) for design_class, sections in SECTIONS_OF_CLASS.items() for section in sections]
DUAL_ROADS = [road for road in ROADS if road[0] in DUAL_CLASSES]
BY_HAND = {"Asset"}
"""Objects that only a scenario's own files bring."""
NOT_SAMPLED = {
    *(("Arrow", "kind", kind) for kind in ("left", "right", "straight", "straight_left")),
    ("Arrow", "color", "yellow"),
    ("Hatching", "color", "yellow"),
    ("Carriageway", "rotation_axis", "inner_edge"),
    ("Lane", "kind", "climbing"),
    ("TrafficSign", "shape", "octagon"),
}
"""Choices (class, field, value) that only sets made by hand have."""


WOODED = VegetationLimits(forest_edges_per_km=Interval(minimum=0.5, maximum=1.0))
"""Plants with forest edges among them, of which a road has none unless it is asked to."""


def scenario_of(design_class: str, cross_section: str, length: float, **limits: Any) -> RoadScenario:
    return RoadScenario(design_class=design_class, cross_section=cross_section, length=length, **limits)


@pytest.mark.parametrize(("design_class", "cross_section"), ROADS)
@pytest.mark.parametrize("length", [1, 20, 120, 600, 3000])
@cases(2, 5)
def test_no_rule_is_broken(design_class: str, cross_section: str, length: int, count: int) -> None:
    scenario = scenario_of(design_class, cross_section, length)
    assert [(seed, found) for seed in range(count) for found in check(sample_road(scenario, seed))] == []


@pytest.mark.parametrize(
    ("design_class", "cross_section"),
    [pytest.param(*road, marks=() if number % 4 == 0 else pytest.mark.slow) for number, road in enumerate(ROADS)],
)
def test_no_rule_is_broken_on_twenty_kilometres(design_class: str, cross_section: str) -> None:
    assert check(sample_road(scenario_of(design_class, cross_section, 20_000.0), 0)) == []


@pytest.mark.parametrize(("design_class", "cross_section"), ROADS)
def test_sampled_sets_are_written_and_read_to_the_same_bytes(design_class: str, cross_section: str) -> None:
    validator = jsonschema_rs.Draft202012Validator(parameters_schema())
    for seed, length in enumerate((1.0, 120.0, 600.0)):
        text = sample_road(scenario_of(design_class, cross_section, length), seed).to_json()
        assert RoadParameters.from_dict(json.loads(text)).to_json() == text
        validator.validate(json.loads(text))


def test_nothing_is_drawn_and_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sampler makes the same roads where whoever asks the checker fails."""
    cases = [(scenario_of(*road, length), seed) for road in ROADS for seed, length in enumerate((600.0, 3000.0))]
    before = [sample_road(*case).to_json() for case in cases]

    def refuse(*_: object) -> NoReturn:
        raise AssertionError("the sampler asked the checker")

    for name in [name for name in sys.modules if ".parameters.checker" in name]:
        for attribute, value in vars(sys.modules[name]).items():
            if callable(value) and getattr(value, "__module__", "") == name:
                monkeypatch.setattr(sys.modules[name], attribute, refuse)
    assert [sample_road(*case).to_json() for case in cases] == before


def test_every_interval_has_its_extractor() -> None:
    # These two become the sun's angles: `test_sun_place` has them.
    times = {"environment.time_of_day", "environment.day_of_year"}
    read = set(EXTRACTORS) | set(COUNTRY_EXTRACTORS) | set(STRUCTURE_EXTRACTORS)
    assert read | UNSEEN | times == set(intervals_of(RoadScenario))


def narrowed(limits: ClosedModel, without: Collection[str] = (), path: str = "") -> Any:
    """Return a scenario, or a part of it, with a tenth of every interval, and everything that may be there there.

    Args:
        limits: the scenario, or the part.
        without: paths of the probabilities that are 0.
        path: of the part.
    """
    changes: dict[str, Any] = {}
    for name, field in type(limits).model_fields.items():
        value = getattr(limits, name)
        if isinstance(value, Interval):
            width = value.maximum - value.minimum
            changes[name] = Interval(minimum=value.minimum + 0.7 * width, maximum=value.minimum + 0.8 * width)
        elif isinstance(value, ClosedModel):
            changes[name] = narrowed(value, without, f"{path}{name}.")
        elif (field.description or "").startswith("Probability"):
            changes[name] = 0.0 if path + name in without else 1.0
    return limits.model_copy(update=changes)


BAYS = ("turnouts.bus_bays", "turnouts.laybys")
OF_MOTORWAYS = ("turnouts.exits", "turnouts.entries", "turnouts.emergency_bays", "lane_changes.share")
OF_MOTORWAYS = (*OF_MOTORWAYS, "overtaking.share")
OF_MOTORWAYS = (*OF_MOTORWAYS, "furniture.construction_zone", "furniture.gantries", "furniture.overpass")
OF_MOTORWAYS = (*OF_MOTORWAYS, "furniture.lighting", "furniture.surveillance", "furniture.traffic_lights")


@pytest.mark.parametrize(("design_class", "cross_section"), DUAL_ROADS)  # only they have exits
def test_every_drawn_value_lies_within_its_interval(design_class: str, cross_section: str) -> None:
    without = ("villages.share", "overtaking.share", *BAYS)
    scenario = narrowed(scenario_of(design_class, cross_section, 8000.0, vegetation=WOODED), without)
    parameters = sample_road(scenario, 1)
    objects, drawn = objects_by_type(parameters), set()
    for path, extract in EXTRACTORS.items():
        low, high = interval_at(scenario, path)
        values = [] if path in COUNTED else list(extract(objects, parameters))
        drawn |= {path} if values else set()
        assert all(low - 1e-6 <= value <= high + 1e-6 for value in values), path
    # Two lanes don't change their number; a road whose lanes change has no room for a construction zone.
    assert len(set(EXTRACTORS) - COUNTED - drawn) == 1
    assert check(parameters) == []


@pytest.mark.parametrize(("design_class", "cross_section"), [("EKL3", "RQ11"), ("EKL4", "RQ9")])
def test_every_drawn_value_of_a_country_road_lies_within_its_interval(design_class: str, cross_section: str) -> None:
    drawn = set()
    side_roads = {"per_km": {"minimum": 2.0, "maximum": 6.0}}
    wanted = {"design_class": design_class, "cross_section": cross_section, "side_roads": side_roads}
    for seed, (length, lacking) in enumerate(
        ((2500.0, ("villages.share", "side_roads.tracks")), (2500.0, ("villages.share",)), (900.0, BAYS))
    ):
        scenario = narrowed(RoadScenario.from_dict(wanted | {"length": length}), (*OF_MOTORWAYS, *lacking))
        parameters = sample_road(scenario, seed)
        objects = objects_by_type(parameters)
        for path, extract in COUNTRY_EXTRACTORS.items():
            low, high = interval_at(scenario, path)
            least, most, margin = SPREAD.get(path, (1.0, 1.0, 0.0))
            low, high = (-np.inf if path in AT_MOST else low * least - margin), high * most + margin
            # Of what is counted per km, one more may be there for the rest of the last km.
            high += 1000.0 / length if path.endswith("per_km") else 0.0
            values = list(extract(objects, parameters))
            drawn |= {path} if values else set()
            # Stations, widths and offsets are rounded.
            assert all(low - 2e-3 <= value <= high + 2e-3 for value in values), (path, low, high, values)
        assert check(parameters) == []
    # Lanes of 2.5 m have no traffic islands between them.
    islands = {path for path in COUNTRY_EXTRACTORS if path.startswith("villages.island_")}
    assert drawn == set(COUNTRY_EXTRACTORS) - (islands if cross_section == "RQ9" else set())


@pytest.mark.parametrize("kind", ["bridges", "tunnels"])
@pytest.mark.parametrize("cross_section", ["RQ11", "RQ31"])
def test_every_drawn_value_of_a_structure_lies_within_its_interval(kind: str, cross_section: str) -> None:
    drawn = set()
    extractors = {path: extract for path, extract in STRUCTURE_EXTRACTORS.items() if path.startswith(kind)}
    for seed in range(3):
        wanted = {"cross_section": cross_section, "length": 2000.0, kind: {"per_km": {"minimum": 1.0, "maximum": 1.5}}}
        limits = RoadScenario.from_dict(wanted)
        scenario = limits.model_copy(update={kind: narrowed(getattr(limits, kind))})
        parameters = sample_road(scenario, seed)
        objects = objects_by_type(parameters)
        for path, extract in extractors.items():
            low, high = interval_at(scenario, path)
            # Of what is counted per km, one more may be there for the rest of the last km.
            high += 1000.0 / parameters.alignment.length if path.endswith("per_km") else 0.0
            low, high = -np.inf if path in FEWER else low, np.inf if path in MORE else high
            values = list(extract(objects, parameters))
            drawn |= {path} if values else set()
            assert all(low - 2e-3 <= value <= high + 2e-3 for value in values), (path, low, high, values)
    assert drawn == set(extractors)


def test_avenues_lack_the_share_of_trees_that_were_felled() -> None:
    def trees(share: float) -> int:
        roadside = {"avenues": 1.0, "avenue_unprotected": 1.0, "avenue_gaps": {"minimum": share, "maximum": share}}
        scenario = RoadScenario.from_dict({"design_class": "EKL4", "length": 1500.0, "roadside": roadside})
        return sum(len(objects_by_type(sample_road(scenario, seed))["Tree"]) for seed in range(6))

    assert trees(0.4) / trees(0.0) == pytest.approx(0.6, abs=0.08)


def test_avenues_stand_behind_the_barriers_along_a_taper() -> None:
    """Which run straight along it, so that a tree that keeps its distance from the pavement may stand before them."""
    roadside = {"avenues": 1.0}
    scenario = {"design_class": "EKA1A", "cross_section": "RQ36", "length": 1500.0, "roadside": roadside}
    objects = objects_by_type(sample_road(RoadScenario.from_dict(scenario), 4))
    assert objects["Tree"]
    for rail in objects["Guardrail"]:
        beside = [
            tree
            for tree in objects["Tree"]
            if rail.start_station < tree.station < rail.end_station and tree.offset * rail.offset > 0.0
        ]
        assert all(abs(tree.offset) - tree.trunk_diameter / 2.0 > abs(rail.offset) for tree in beside)


def test_pylons_stand_clear_of_a_bridges_embankment_far_from_the_road() -> None:
    """On one of two among ten thousand roads where one stood on it."""
    parameters = sample_road(scenario_of("EKA1B", "RQ36", 600.0, vegetation=WOODED), 40218)
    assert {"PowerLine", "Overpass"} <= set(objects_by_type(parameters))
    assert check(parameters) == []


@pytest.mark.slow
def test_the_share_of_trucks_varies_between_its_limits() -> None:
    """Which can't be read off a road: the spread is that of a uniform share and of counting."""
    shares, counted = [], []
    for seed in range(100):
        parameters = sample_road(scenario_of("EKA3", "RQ38.5", 8000.0), seed)
        for share, number in truck_shares(objects_by_type(parameters)):
            shares.append(share)
            counted.append(share * (1.0 - share) / number)
    limits = RoadScenario().vehicles.trucks
    assert np.mean(shares) == pytest.approx((limits.minimum + limits.maximum) / 2.0, abs=0.02)
    spread = np.sqrt(np.var(shares) - np.mean(counted))
    assert spread == pytest.approx((limits.maximum - limits.minimum) / np.sqrt(12.0), rel=0.15)


# --- ten thousand roads ----------------------------------------------------------------------------------------------


class Census:
    """Statistics of many roads."""

    def __init__(self) -> None:
        self.roads = 0
        self.violations: list[tuple[str, int, Any]] = []
        self.types: set[str] = set()
        self.choices: set[tuple[str, str, str]] = set()
        self.joints: set[str] = set()
        self.turns = np.zeros(2)
        self.shares: dict[str, tuple[float, float]] = defaultdict(lambda: (np.inf, -np.inf))

    def add(self, scenario: RoadScenario, seed: int) -> None:
        parameters = sample_road(scenario, seed)
        self.roads += 1
        name = f"{scenario.design_class} {scenario.cross_section} {scenario.length:g} m"
        self.violations += [(name, seed, found) for found in check(parameters)]
        objects = objects_by_type(parameters)
        self.types |= objects.keys()
        choices_in(parameters, self.choices)
        for item in parameters.objects.values():
            choices_in(item, self.choices)
        self.joints |= joints(parameters)
        self.turns += turns(parameters)
        for path, extract in EXTRACTORS.items():
            low, high = interval_at(scenario, path)
            values = [(value - low) / (high - low) for value in extract(objects, parameters)]
            least, most = self.shares[path]
            self.shares[path] = min(least, *values, least), max(most, *values, most)


@pytest.fixture(scope="module")
def census() -> Census:
    """Return what ten thousand roads of every design class and cross-section have."""
    found = Census()
    for number, road in enumerate(ROADS):
        for length, count in ((600.0, 400), (3000.0, 360), (8000.0, 12)):
            for seed in range(count):
                found.add(scenario_of(*road, length, vegetation=WOODED), 10_000 * number + seed)
    return found


@pytest.mark.slow
def test_ten_thousand_roads_break_no_rule(census: Census) -> None:
    assert census.roads >= 10_000
    assert census.violations == []


@pytest.mark.slow
def test_every_kind_of_object_occurs(census: Census) -> None:
    assert set(OBJECTS) - census.types == BY_HAND


@pytest.mark.slow
def test_every_choice_occurs(census: Census) -> None:
    possible = set().union(*(choices_of(OBJECTS[kind]) for kind in OBJECTS), choices_of(RoadParameters))
    assert possible - census.choices == NOT_SAMPLED


@pytest.mark.slow
def test_every_joint_occurs_and_both_directions_alike(census: Census) -> None:
    assert census.joints == {"lca", "acl", "aca", "acca"}
    assert 0.45 <= census.turns[0] / census.turns.sum() <= 0.55


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(set(EXTRACTORS) - {"vehicles.trucks"}))
def test_drawn_values_cover_their_interval(census: Census, path: str) -> None:
    least, most = census.shares[path]
    assert most - least >= 0.9
    assert path in COUNTED or (least >= -1e-6 and most <= 1.0 + 1e-6)
