"""Every rule of country roads and villages has a planted breach, which is found with its source and how sure it is."""

import re
from collections.abc import Callable, Iterator

import pytest

from synthroads_addon.checking.checker import RULES, check
from synthroads_addon.checking.rules import structures
from synthroads_addon.road.parameters import RoadParameters
from tests.checking.rules.test_side_roads import BREACHES as OF_SIDE_ROADS
from tests.checking.test_checker import DOCS
from tests.sampling.test_country_roads import BREACHES as OF_COUNTRY_ROADS
from tests.sampling.test_other_countries import BREACHES as ELSEWHERE
from tests.sampling.test_overtaking_lanes import BREACHES as OF_OVERTAKING_LANES
from tests.sampling.test_villages import BREACHES as IN_VILLAGES
from tests.sampling.test_villages import broken_village

SURE = ("unconfirmed", "confirmed", "derived", "chosen")
GERMAN = ("RAL", "RMS", "RASt", "RPS", "StVO", "R-FGUE", "Lichtraumprofil")
SOURCES = (*GERMAN, "DMRB", "Traffic Signs Manual", "TSRGD", "Highway Code")
BY_STRUCTURES = {rule.id for rule in structures.RULES}
"""Rules that motorways share, with breaches of their own in tests/checking/rules/test_structures.py."""
FAMILIES: tuple[dict[str, Callable[[], RoadParameters]], ...] = (
    OF_COUNTRY_ROADS,
    OF_SIDE_ROADS,
    OF_OVERTAKING_LANES,
    ELSEWHERE,
    {rule: lambda rule=rule: broken_village(rule) for rule in IN_VILLAGES},  # type: ignore[misc]
)
PLANTED = [(rule, make) for family in FAMILIES for rule, make in family.items()]


def documented() -> Iterator[str]:
    """Yield the ids of the rules that the pages list under country roads and villages."""
    text = DOCS.read_text(encoding="utf-8")
    for title in ("Country roads", "Villages"):
        (section,) = re.findall(rf"^## {title}\n(.*?)^## ", text, flags=re.M | re.S)
        yield from re.findall(r"^\| `([a-z-]+)`", section, flags=re.M)


def test_every_documented_rule_has_a_planted_breach() -> None:
    rules = set(documented())
    assert len(rules) > 20
    assert rules - BY_STRUCTURES == rules & {rule for rule, _ in PLANTED}


@pytest.mark.parametrize(("rule", "make"), PLANTED, ids=[rule for rule, _ in PLANTED])
def test_a_breach_names_its_source_and_how_sure_it_is(rule: str, make: Callable[[], RoadParameters]) -> None:
    found = [violation.text for violation in check(make()) if violation.rule == rule]
    assert found
    if RULES[rule].sure == "definition":  # it follows from what the thing is
        return
    for text in found:
        if rule == "lane-width":  # whose source are the sections that it names; their file says how sure each is
            assert "RQ" in text
            continue
        assert any(sure in text for sure in SURE), text
        assert any(name in text for name in SOURCES), text
