"""Every field of a parameter set changes the model or the points, but for those that are listed."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.effects.field_paths import SchemaField, fields_of, other_values, value_at, with_value
from tests.helpers.effects.looks import LABEL, Look, changes, look_at
from tests.helpers.effects.road_cases import CASES, Case, RoadScene, scene_of
from tests.helpers.effects.scans import SCAN
from tests.helpers.effects.without_effect import DERIVED, SAYS
from tests.helpers.roads.parameter_sets import OBJECTS

pytestmark = [pytest.mark.any_blender, pytest.mark.keep_scene]


def _all_fields() -> Iterator[SchemaField]:
    yield from (field for field in fields_of(RoadParameters) if field.path != "objects")
    for kind, model in OBJECTS.items():
        yield from fields_of(model, kind)


FIELDS = {field.path: field for field in _all_fields()}
LABELS = {path for path in FIELDS if path.endswith(".instance")} | {"part_numbers"}
RENDERED = {"colour.source": "images"}
"""Changes of the scan for what the means of materials don't show."""


@cache
def changed_road(path: str) -> tuple[Case, RoadScene, dict[str, Any]]:
    """Return how a field is looked at: its case, the road on which it matters, and that road with another value.

    Raises:
        AssertionError: nobody said on which road it matters, or what other value it may have.
    """
    case = CASES.get(path, Case())
    if path in LABELS and case.value is None:
        case = replace(case, value=1000)
    try:
        scene = scene_of(path, case)
    except LookupError:
        raise AssertionError(f"say in tests/helpers/effects/road_cases.py on which road {path} matters") from None
    place = case.at or path
    if scene.owner:
        place = f"objects.{scene.owner}.{place.partition('.')[2]}"
    values = [case.value] if case.value is not None else other_values(FIELDS[path].info, value_at(scene.data, place))
    for value in values:
        data = with_value(scene.data, place, value)
        for name, further in case.also.items():
            data = with_value(data, name, further)
        try:
            RoadParameters.from_dict(data)
        except InputError:
            continue
        return case, scene, data
    raise AssertionError(f"say in tests/helpers/effects/road_cases.py which other value {path} may have")


@pytest.mark.parametrize("path", sorted(FIELDS.keys() - DERIVED))
def test_every_field_has_a_road_on_which_it_matters(path: str) -> None:
    _, scene, data = changed_road(path)
    assert RoadParameters.from_dict(data) != RoadParameters.from_dict(scene.data)


def test_no_list_names_a_field_that_there_is_none_of() -> None:
    assert {*CASES, *SAYS, *DERIVED} <= FIELDS.keys()


@pytest.mark.parametrize("path", sorted(DERIVED))
def test_a_value_that_follows_from_others_can_t_be_another(path: str) -> None:
    with pytest.raises(AssertionError, match="which other value"):
        changed_road(path)


@pytest.fixture(scope="module")
def looks() -> dict[str, Look]:
    """Looks at roads as they are, by road and scan."""
    return {}


def seen(looks: dict[str, Look], path: str, further: dict[str, Any]) -> tuple[set[str], RoadParameters, RoadParameters]:
    """Return the names of what a field changes, and the road before and after."""
    case, scene, data = changed_road(path)
    scan: Any = SCAN
    for name, value in (further | case.scan).items():
        scan = with_value(scan, name, value)
    scenario, before, after = Scenario.from_dict(scan), *map(RoadParameters.from_dict, (scene.data, data))
    key = scenario.to_json() + before.to_json()
    if key not in looks:
        looks[key] = look_at(scenario, before)
    return changes(looks[key], look_at(scenario, after)), before, after


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(FIELDS.keys() - DERIVED - SAYS.keys() - LABELS))
def test_every_field_changes_the_model_or_the_points(looks: dict[str, Look], path: str) -> None:
    for further in ({}, RENDERED):
        changed, _, _ = seen(looks, path, further)
        if any(not name.endswith(LABEL) for name in changed):
            return
    raise AssertionError(f"nothing shows {path}")


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(LABELS))
def test_an_instance_number_changes_nothing_but_numbers(looks: dict[str, Look], path: str) -> None:
    changed, _, _ = seen(looks, path, {})
    assert all(name.endswith(LABEL) for name in changed)
    # An axis has no faces, and a stand none of its own: each plant has a number that follows from those of all.
    assert changed or path in ("Alignment.instance", "Vegetation.instance")


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(SAYS))
def test_what_only_says_something_is_seen_there_alone(looks: dict[str, Look], path: str) -> None:
    changed, before, after = seen(looks, path, RENDERED)
    assert not changed
    assert SAYS[path](before) != SAYS[path](after)
