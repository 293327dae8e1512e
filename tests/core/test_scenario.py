"""Scenarios: changes by path, and what is read is what was written."""

import pytest

from synthroads_addon.core.errors import InputError
from synthroads_addon.core.scenario import Scenario, apply_change, load_scenario, parsed_change


def test_changes_are_applied_and_unknown_keys_named() -> None:
    data = apply_change({"a": {"b": 1}}, "a.c=[1,2]")
    assert data == {"a": {"b": 1, "c": [1, 2]}}
    with pytest.raises(InputError, match="did you mean 'platform'"):
        load_scenario("rq31-600m", ["scan.platfrom.height=3"])
    assert Scenario.from_dict(load_scenario("rq31-600m").to_dict()) == load_scenario("rq31-600m")


TYPED = {
    "cloud.classes=5": "5",
    'cloud.classes="5"': "5",
    "title=007": "007",
    "title=7": "7",
    "title=1e5": "1e5",
    "title=true": "true",
    "title=[1]": "[1]",
    'title="in quotes"': "in quotes",
    "materials_table=null": None,
    "seed=7": 7,
    "road.length=8e2": 800.0,
    "time_budget=2min": "2min",
    "time_budget=60": 60,
    "tolerance.height=5mm": "5mm",
    "colour.rgb=false": False,
    "scan.rays_per_pulse=19": 19,
    "scan.weather.visibility=300": 300,
    "outputs=[]": [],
    "road.radius.minimum=900": 900,
    "road.cross_section=RQ31": "RQ31",
    'road.cross_section={"lanes": [3.5]}': {"lanes": [3.5]},
    'road.cross_section={"lane": [3.5]}': {"lane": [3.5]},
    "no.such.field=5": 5,
    "road.length=long": "long",
    "seed=1.5": 1.5,
    "title=null": None,
}
"""Change -> its value: of the field's type, and where the field takes neither form, what names the fault best."""


@pytest.mark.parametrize("change", TYPED)
def test_values_are_of_the_type_of_their_field(change: str) -> None:
    path, value = parsed_change(change)
    assert path == change.partition("=")[0]
    assert value == TYPED[change]
    assert type(value) is type(TYPED[change])


def test_a_number_for_text_needs_no_quotes() -> None:
    scenario = load_scenario("rq31-600m", ["cloud.classes=5", "title=007", "road.length=800"])
    assert (scenario.cloud.classes, scenario.title, scenario.road.length) == ("5", "007", 800.0)
    with pytest.raises(InputError, match="is 'RQ31': must be a JSON object before its field lanes can be set"):
        load_scenario("rq31-600m", ["road.cross_section.lanes=[3.5]"])
