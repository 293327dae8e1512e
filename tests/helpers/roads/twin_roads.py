"""Roads of all kinds that the tests of the twin share."""

from __future__ import annotations

from functools import cache

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.sampled_parts import PAIRS

EVERYTHING = {
    "turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1},
    "lane_changes": {"share": 1},
    "furniture": {"overpass": 1, "gantries": 1, "lighting": 1, "surveillance": 1, "traffic_lights": 1},
    "barriers": {"noise_barrier": 1, "concrete_median": 0.5, "concrete_roadside": 0.5},
    "pavement": {"rutted": 1, "potholes_per_km": {"minimum": 4, "maximum": 8}},
}
WORKS = {"furniture": {"construction_zone": 1, "overpass": 0}, "pavement": {"concrete": 1}}


def road(seed: int, **limits: object) -> RoadParameters:
    return sample_road(RoadScenario.from_dict(limits), seed)


@cache
def full_road() -> RoadParameters:
    """A road with turnouts, damage, an overpass, a gantry and barriers."""
    return road(11, design_class="EKA1A", cross_section="RQ36", length=1100.0, **EVERYTHING)


NUMBER = 50
"""Of the roads that `one_of_many` makes."""


@cache
def one_of_many(number: int) -> RoadParameters:
    """One of fifty roads: every design class with its cross-sections; plain, full, with a construction zone, short."""
    design_class, section = PAIRS[number % len(PAIRS)]
    kind = number % 4
    length = (200.0, 1100.0, 600.0, 40.0)[kind]
    limits = ({}, EVERYTHING, WORKS, {})[kind]
    return road(number, design_class=design_class, cross_section=section, length=length, **limits)
