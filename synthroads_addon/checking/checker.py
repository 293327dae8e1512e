"""Which rules of the guidelines (RAA, RAL, RMS, RPS) a road breaks, hand-made or sampled."""

import numpy as np

from ..road.parameters import RoadParameters
from .rules import alignment, barriers, crossfall, furniture, markings, section, sight, signs, traffic, turnouts
from .rules.rule import Road, Rule, Violation

__all__ = ["RULES", "Rule", "Violation", "check"]

MODULES = (alignment, sight, crossfall, section, turnouts, markings, barriers, signs, furniture, traffic)
"""Where the rules are, in the order of their findings."""
RULES: dict[str, Rule] = {rule.id: rule for module in MODULES for rule in module.RULES}
"""All rules by id, in the order of their findings."""


def check(parameters: RoadParameters) -> list[Violation]:
    """Return all violations in the order of `RULES`, then along the road; an empty list if it keeps all rules.

    Example:
        >>> from synthroads_addon import load_scenario, sample_road
        >>> check(sample_road(load_scenario("rq31-600m").road, seed=7))
        []
    """
    violations: list[Violation] = []
    with np.errstate(all="ignore"):
        road = Road(parameters)
        for rule in RULES.values():
            findings = [
                Violation(rule.id, name, _finite(station), _finite(value), _finite(limit), rule.unit, text)
                for name, station, value, limit, text in rule.find(road)
            ]
            violations += sorted(findings, key=lambda violation: violation.station)
    return violations


def _finite(value: float) -> float:
    """Return a number that JSON can hold: NaN as 0, and what overflowed as the largest number."""
    return float(np.nan_to_num(value))
