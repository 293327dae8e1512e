"""The rule that the documentation has its readers add."""

from __future__ import annotations

import pytest

from synthroads_addon.checking.rules import section
from synthroads_addon.checking.rules.rule import Road
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.page_modules import block_of_page
from tests.helpers.roads.checker_roads import Planted, changed, good

PAGE = "extend/rule.md"


def test_the_rule_of_the_page_finds_its_planted_violation() -> None:
    names = dict(vars(section))
    exec(block_of_page(PAGE, "python"), names)
    (rule,) = eval(f"({block_of_page(PAGE, 'text')})", names)
    (case,) = eval(f"({block_of_page(PAGE, 'text', 2)})", {"Planted": Planted, "changed": changed})
    assert list(rule.find(Road(RoadParameters.from_dict(good())))) == []
    (found,) = rule.find(Road(RoadParameters.from_dict(case.make())))
    assert (rule.id, *found[:4]) == (case.rule, case.object, case.station, pytest.approx(case.value), case.limit)
    assert f"| `{rule.id}` |" in block_of_page(PAGE, "text", 3)
