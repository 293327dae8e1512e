"""Scenarios: changes by path, and what is read is what was written."""

import pytest

from synthroads_addon.core.errors import InputError
from synthroads_addon.core.scenario import Scenario, apply_change, load_scenario


def test_changes_are_applied_and_unknown_keys_named() -> None:
    data = apply_change({"a": {"b": 1}}, "a.c=[1,2]")
    assert data == {"a": {"b": 1, "c": [1, 2]}}
    with pytest.raises(InputError, match="did you mean 'platform'"):
        load_scenario("rq31-600m", ["scan.platfrom.height=3"])
    assert Scenario.from_dict(load_scenario("rq31-600m").to_dict()) == load_scenario("rq31-600m")
