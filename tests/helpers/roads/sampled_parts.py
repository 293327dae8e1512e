"""Roads that several tests of the sampler share, and how to read them without the code that they test."""

from functools import cache

import numpy as np

from synthroads_addon.checking import checker
from synthroads_addon.checking.rules import alignment as checker_alignment
from synthroads_addon.checking.rules import crossfall as checker_crossfall
from synthroads_addon.checking.rules import markings as checker_markings
from synthroads_addon.checking.rules import section as checker_section
from synthroads_addon.checking.rules import turnouts as checker_turnout
from synthroads_addon.road.guidelines import DUAL_CLASSES, SECTIONS_OF_CLASS
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, Turnout
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

PAIRS = [(name, section) for name in DUAL_CLASSES for section in SECTIONS_OF_CLASS[name]]
SEEDS = {1.0: 1, 5.0: 1, 50.0: 1, 600.0: 3, 3000.0: 1}
BLEND = 30.0
"""Behind a ramp's end the verge needs this length (m) to come back."""


def scenario(**changes: object) -> RoadScenario:
    return RoadScenario.from_dict(changes)


@cache
def sampled_roads() -> list[RoadParameters]:
    """Roads of every design class, cross-section and length."""
    return [
        sample_road(scenario(design_class=design_class, cross_section=section, length=length), seed)
        for design_class, section in PAIRS
        for length, seeds in SEEDS.items()
        for seed in range(seeds)
    ]


@cache
def full_road(design_class: str, section: str, seed: int) -> RoadParameters:
    """A road of which each carriageway has an exit, an entry, an emergency bay, and a lane that begins or ends."""
    everything = {"turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1}, "lane_changes": {"share": 1}}
    return sample_road(scenario(design_class=design_class, cross_section=section, length=2000.0, **everything), seed)


def full_roads(seeds: range = range(16)) -> list[RoadParameters]:
    """Such roads of two lanes and of four."""
    pairs = (("EKA1A", "RQ36"), ("EKA3", "RQ38.5"))
    return [full_road(design_class, section, seed) for design_class, section in pairs for seed in seeds]


def sides(road: RoadParameters) -> list[tuple[str, Carriageway, list[tuple[str, Turnout]]]]:
    """Return id, carriageway and turnouts (with ids, along the stations) of both sides."""
    turnouts = sorted(road.of_type(Turnout).items(), key=lambda item: item[1].start_station)
    return [
        (name, carriageway, [item for item in turnouts if item[1].carriageway == name])
        for name, carriageway in road.of_type(Carriageway).items()
    ]


def at(turnout: Turnout, w: float) -> float:
    """Return the station at a distance (m) from where an exit's or entry's taper, or a bay, begins."""
    forwards = (turnout.kind == "entry") != (turnout.carriageway == "carriageway-right")
    return turnout.start_station + w if forwards else turnout.end_station - w


def stretch(turnout: Turnout) -> tuple[float, float]:
    """Return the stations (m) between which a turnout changes the road, the blend behind its ramp included."""
    low, high = sorted((at(turnout, 0.0), at(turnout, turnout.length + (BLEND if turnout.ramp else 0.0))))
    return low, high


def tip(turnout: Turnout) -> float:
    """Return the distance (m) of the gore's tip from where the taper begins."""
    return turnout.taper_in_length + turnout.lane_length + turnout.taper_out_length


def broken(road: RoadParameters) -> list[checker.Violation]:
    """Return what the road itself breaks; furniture has tests of its own."""
    modules = (checker_alignment, checker_crossfall, checker_section, checker_turnout, checker_markings)
    rules = {rule.id for module in modules for rule in module.RULES}
    return [violation for violation in checker.check(road) if violation.rule in rules]


def nose(turnout: Turnout, carriageway: Carriageway) -> float:
    """Return the distance (m) of the nose from the gore's tip: 1 m and the hard shoulder lie between road and ramp."""
    assert turnout.ramp is not None
    return np.cbrt(6 * turnout.ramp.clothoid_parameter**2 * (carriageway.hard_shoulder_width + 1.0))


def changed_lane(carriageway: Carriageway) -> int | None:
    """Return the index of the lane that begins or ends."""
    changed = [i for i, lane in enumerate(carriageway.lanes) if isinstance(lane.width, tuple)]
    assert len(changed) <= 1
    return changed[0] if changed else None
