"""Every limit changes sampled roads in fields that have an effect, but for those that are listed."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.jobs.generate import FROM_AXIS
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.changes import next_epoch
from synthroads_addon.sampling.road import sample_alignment, sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.effects import without_effect
from tests.helpers.effects.field_paths import fields_of, other_values, value_at, with_value
from tests.helpers.effects.limit_cases import CASES, SAYS, SEEDS, LimitCase

OF_CLOUDS = {"changes.unchanged_below"}
"""Limits that no road shows, but the clouds of its epochs: `tests/jobs/epochs/test_epochs.py` has them."""
FIELDS = {field.path: field for field in fields_of(RoadScenario) if field.path not in OF_CLOUDS}
SAY = "say in tests/helpers/effects/limit_cases.py"


def _end_of_interval(data: Any, path: str) -> Iterator[Any]:
    """Yield the middle of the interval that a field is an end of."""
    whole, _, end = path.rpartition(".")
    if end in ("minimum", "maximum"):
        yield (value_at(data, f"{whole}.minimum") + value_at(data, f"{whole}.maximum")) / 2.0


@cache
def changed_limits(path: str) -> tuple[RoadScenario, RoadScenario]:
    """Return limits on which a field matters, before and after it changes.

    Raises:
        AssertionError: nobody said on which limits it matters, or what other value it may have.
    """
    case = CASES.get(path, LimitCase())
    before = RoadScenario.from_dict(case.given)
    data: Any = before.to_dict()
    if case.value is not None:
        values: Iterator[Any] = iter([case.value])
    else:
        try:
            value = value_at(data, path)
        except LookupError:
            raise AssertionError(f"{SAY} on which limits {path} matters") from None
        values = iter([*_end_of_interval(data, path), *other_values(FIELDS[path].info, value)])
    for value in values:
        try:
            after = RoadScenario.from_dict(with_value(data, path, value))
            sample_road(after, SEEDS[0])
        except InputError:
            continue
        if after != before:
            return before, after
    raise AssertionError(f"{SAY} which other value {path} may have")


def drawn(path: str, limits: RoadScenario, seed: int, *axis: Any) -> RoadParameters:
    """Return a drawn road, of limits of changes its next epoch."""
    road = sample_road(limits, seed, *axis)
    return next_epoch(road, limits.changes, seed)[0] if path.startswith("changes.") else road


def with_effect(parameters: RoadParameters) -> str:
    """Return a parameter set as text, less the fields that have no effect."""
    data: Any = parameters.to_dict()
    data.pop("part_numbers", None)
    listed = without_effect.SAYS
    for path in (path for path in listed if not path[0].isupper()):
        part, _, name = path.rpartition(".")
        (data[part] if part else data).pop(name, None)
    for item in data["objects"].values():
        item.pop("instance")
        for path in (path for path in listed if path.partition(".")[0] == item["type"]):
            *way, name = path.split(".")[1:]
            if not way or not way[0].endswith("[]"):  # what a list holds goes with the list
                (item[way[0]] if way else item).pop(name, None)
    return canonical_json(data)


AXIS_FIELDS = sorted({path.partition(".")[0] for path in FIELDS} - SAYS - {"cross_section", "elevation_model"})
"""Limits that are looked at beside an axis: not what an axis may have anywhere, and what takes free cross-sections."""


@pytest.mark.parametrize("name", AXIS_FIELDS)
def test_beside_an_axis_all_limits_have_an_effect_but_those_that_are_refused(name: str) -> None:
    """The axis is another road's own, put elsewhere; `FROM_AXIS` says what is refused beside it."""
    shown = any(
        _differ_beside_axis(path, seed) for path in FIELDS if path.partition(".")[0] == name for seed in SEEDS[:8]
    )
    assert shown != (name in FROM_AXIS)


def _differ_beside_axis(path: str, seed: int) -> bool:
    """Return whether roads along one axis differ where a limit does; not where one of the two can't be had."""
    before, after = changed_limits(path)
    axis = sample_alignment(before, 5)
    given = {"length": axis.length, "map_origin": (1.0, 2.0, 3.0)}  # as `axis_of_points` has them
    try:
        roads = [drawn(path, limits.model_copy(update=given), seed, "", axis) for limits in (before, after)]
    except InputError:
        return False
    return with_effect(roads[0]) != with_effect(roads[1])


def seeds_that_show(path: str) -> Iterator[int]:
    """Yield the seeds with which a limit changes fields that have an effect."""
    before, after = changed_limits(path)
    for seed in SEEDS:
        if with_effect(drawn(path, before, seed)) != with_effect(drawn(path, after, seed)):
            yield seed


def test_no_list_names_a_limit_that_there_is_none_of() -> None:
    assert {*CASES, *SAYS} <= FIELDS.keys()


@pytest.mark.slow
@pytest.mark.any_blender
@pytest.mark.parametrize("path", sorted(FIELDS))
def test_every_limit_changes_roads(path: str) -> None:
    shown = next(seeds_that_show(path), None)
    if path in SAYS:
        assert shown is None, f"{path} has an effect: take it from the list of what has none"
    else:
        assert shown is not None, f"no road shows {path}"


@pytest.mark.slow
@pytest.mark.any_blender
@pytest.mark.parametrize("path", sorted(SAYS))
def test_a_limit_without_effect_is_written(path: str) -> None:
    before, after = changed_limits(path)
    assert any(sample_road(before, seed).to_dict() != sample_road(after, seed).to_dict() for seed in SEEDS)
