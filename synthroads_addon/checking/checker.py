"""Which rules of the guidelines (RAA, RAL, RMS, RPS) a road breaks, hand-made or sampled."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..road.parameters import AlignmentObject, RoadParameters
from .rules import (
    alignment,
    barriers,
    crossfall,
    furniture,
    interchanges,
    markings,
    roadside,
    section,
    side_roads,
    sight,
    signs,
    streets,
    structures,
    traffic,
    turnouts,
)
from .rules.rule import Road, Rule, Violation

__all__ = ["RULES", "Rule", "Violation", "check", "check_axis"]

MODULES = (
    *(
        alignment,
        sight,
        crossfall,
        section,
        turnouts,
        side_roads,
        interchanges,
        markings,
        barriers,
        signs,
        furniture,
        roadside,
    ),
    *(streets, traffic, structures),
)
"""Where the rules are, in the order of their findings."""
RULES: dict[str, Rule] = {rule.id: rule for module in MODULES for rule in module.RULES}
"""All rules by id, in the order of their findings."""


def check(parameters: RoadParameters, rules: Mapping[str, Rule] = RULES) -> list[Violation]:
    """Return all violations in the order of the rules, then along the road; an empty list if it keeps them all.

    Args:
        parameters: the road.
        rules: those that are checked, by id.

    Example:
        >>> from synthroads_addon import load_scenario, sample_road
        >>> check(sample_road(load_scenario("rq31-600m").road, seed=7))
        []
    """
    return _violations(parameters, rules.values())


def check_axis(axis: AlignmentObject, design_class: str) -> list[Violation]:
    """Return the violations of the rules for centrelines, as `check` does, by an axis that has no road yet.

    Args:
        axis: its horizontal elements and profile.
        design_class: of the RAA, e.g. EKA1A.

    Example:
        >>> from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
        >>> arc = HorizontalElement.between(300.0, 1 / 500, 1 / 500)
        >>> level = (VerticalPoint(station=0.0, elevation=0.0),)
        >>> place = {"instance": 1, "start_x": 0.0, "start_y": 0.0, "start_heading_deg": 0.0}
        >>> axis = AlignmentObject(horizontal=(arc,), vertical=level, **place)
        >>> [violation.rule for violation in check_axis(axis, "EKA1A")]
        ['radius-minimum']
    """
    values: dict[str, Any] = {"design_class": design_class, "objects": {"alignment": axis}}
    return _violations(RoadParameters.model_construct(**values), alignment.RULES)  # no valid road: it has no pavement


def _violations(parameters: RoadParameters, rules: Iterable[Rule]) -> list[Violation]:
    """Return the violations of some rules, in their order, then along the road."""
    violations: list[Violation] = []
    with np.errstate(all="ignore"):
        road = Road(parameters)
        for rule in rules:
            findings = [
                Violation(rule.id, name, _finite(station), _finite(value), _finite(limit), rule.unit, text)
                for name, station, value, limit, text in rule.find(road)
            ]
            violations += sorted(findings, key=lambda violation: violation.station)
    return violations


def _finite(value: float) -> float:
    """Return a number that JSON can hold: NaN as 0, and what overflowed as the largest number."""
    return float(np.nan_to_num(value))
