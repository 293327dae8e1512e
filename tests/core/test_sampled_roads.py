"""Sampled roads keep every rule of the checker, which shares nothing with the sampler but the table of limits."""

import pytest

from synthroads_addon.core.parameters.checker import check
from synthroads_addon.core.parameters.sampler import sample_road
from synthroads_addon.core.scenario import RoadScenario

ROADS = [("EKA1A", "RQ43.5"), ("EKA1A", "RQ36"), ("EKA1A", "RQ31"), ("EKA1B", "RQ31"), ("EKA2", "RQ28")]
ROADS += [("EKA3", "RQ38.5"), ("EKA3", "RQ31.5"), ("EKA3", "RQ25")]


def violations(design_class: str, cross_section: str, length: float, seeds: range) -> list:
    scenario = RoadScenario(design_class=design_class, cross_section=cross_section, length=length)
    return [(seed, found) for seed in seeds for found in check(sample_road(scenario, seed))]


@pytest.mark.parametrize(("design_class", "cross_section"), ROADS)
@pytest.mark.parametrize("length", [1, 20, 120, 600, 3000, 20_000])
def test_no_rule_is_broken(design_class: str, cross_section: str, length: int) -> None:
    assert violations(design_class, cross_section, length, range(20 if length < 20_000 else 3)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("design_class", "cross_section"), ROADS)
@pytest.mark.parametrize("length", [600, 3000])
def test_no_rule_is_broken_in_ten_thousand(design_class: str, cross_section: str, length: int) -> None:
    assert violations(design_class, cross_section, length, range(1000, 1625)) == []
