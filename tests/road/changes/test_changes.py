"""Changes as data: what is drawn is what the difference of two sets gives back, and the sets are the same bytes."""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from typing import Any

import jsonschema
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import PRESETS
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.road.changes.change import ChangeList, changes_schema, read_changes
from synthroads_addon.road.changes.diff import diff_roads
from synthroads_addon.road.changes.edits import apply_changes
from synthroads_addon.road.instances import InstanceNumbers
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.changes import next_epoch, sample_changes
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.changes import DRAWN_KINDS, ChangeLimits
from synthroads_addon.scenario.road import RoadScenario

SEEDS = 200
OFTEN: dict[str, Any] = {
    "cut_back": 1.0,
    "settlements": 1.0,
    "overlays": 1.0,
    "marked_anew": 1.0,
    "construction_zones": 1.0,
    "hits_per_km": {"minimum": 5.0, "maximum": 9.0},
    "patches_per_km": {"minimum": 5.0, "maximum": 20.0},
}


@cache
def road(seed: int) -> RoadParameters:
    """Return one of ten roads, of motorways and a country road by turns."""
    limits = RoadScenario(length=260.0 + 10.0 * (seed % 3))
    if seed % 5 == 4:
        limits = RoadScenario.from_dict({"design_class": "EKL3", "length": 260.0})
    return sample_road(limits, seed)


def test_the_difference_gives_the_drawn_list_back_for_200_seeds() -> None:
    kinds: Counter[str] = Counter()
    for seed in range(SEEDS):
        limits = ChangeLimits.from_dict(OFTEN if seed % 2 else {})
        before = road(seed % 10)
        drawn = sample_changes(before, limits, seed)
        after = apply_changes(before, drawn)
        back = diff_roads(before, after, limits.years)
        assert back.to_json() == drawn.to_json(), seed
        assert apply_changes(before, back).to_json() == after.to_json(), seed
        kinds.update(change.kind + change.detail for change in drawn.changes)
    assert {name for kind in DRAWN_KINDS for name in kinds if name.startswith(kind)} == set(kinds)
    assert all(any(name.startswith(kind) for name in kinds) for kind in DRAWN_KINDS), kinds
    assert {"damagedbent", "damagedleaning", "damagedturned", "damagedpanel_missing"} <= set(kinds)


def test_no_kinds_leave_the_road_as_it_is() -> None:
    before = road(1)
    after, changes = next_epoch(before, ChangeLimits(kinds=()), 5)
    assert not changes.changes
    assert after.to_dict() | {"metadata": None} == before.to_dict() | {"metadata": None}


def test_a_kind_left_out_changes_no_other() -> None:
    before = road(2)
    whole = sample_changes(before, ChangeLimits(), 3)
    less = sample_changes(before, ChangeLimits(kinds=tuple(kind for kind in DRAWN_KINDS if kind != "added")), 3)
    kept = [(c.kind, c.things, c.size) for c in whole.changes if c.kind != "added"]
    assert kept == [(c.kind, c.things, c.size) for c in less.changes]


def _names(numbers: InstanceNumbers, most: int) -> dict[int, str]:
    """Return the names of objects and parts by number, without later passes of vehicles, which are traffic."""
    names = {number: numbers.name_of(number) for number in range(1, most)}
    return {number: name for number, name in names.items() if name and "/pass-" not in name}


def test_what_stays_keeps_its_numbers() -> None:
    for seed in range(6):
        before = road(seed)
        after, changes = next_epoch(before, ChangeLimits.from_dict(OFTEN), seed)
        assert after.part_numbers
        first, second = _names(InstanceNumbers(before), 20_000), _names(InstanceNumbers(after), 20_000)
        for number in first.keys() & second.keys():
            assert first[number].partition("/")[0] == second[number].partition("/")[0]
            assert first[number].rpartition("-")[0] == second[number].rpartition("-")[0], first[number]
        gone = {edit.thing for edit in changes.edits if edit.path == "" and edit.after is None}
        lost = {name for number, name in first.items() if number not in second}
        assert {name.partition("/")[0] for name in lost if not name.startswith("carriageway")} == gone


def test_two_roads_of_other_seeds_differ_by_a_list_as_well() -> None:
    first, second = road(0), road(3)
    changes = diff_roads(first, second)
    assert apply_changes(first, changes).to_json() == second.to_json()
    assert {change.kind for change in changes.changes} >= {"altered", "added"}


def test_a_list_is_read_back_and_is_valid(tmp_path: Any) -> None:
    _, changes = next_epoch(road(1), ChangeLimits.from_dict(OFTEN), 1)
    path = tmp_path / "changes.json"
    path.write_text(changes.to_json(), encoding="utf-8")
    assert read_changes(path) == changes
    jsonschema.Draft202012Validator(changes_schema()).validate(json.loads(changes.to_json()))
    limits = ChangeLimits(list_of=str(path))
    assert sample_changes(road(1), limits, 99) == changes


def test_a_list_of_another_road_is_refused() -> None:
    _, changes = next_epoch(road(1), ChangeLimits.from_dict(OFTEN), 1)
    with pytest.raises(InputError, match=r"changes: .*(isn't in the first set|of another)"):
        apply_changes(road(2), changes)


def test_two_changes_of_one_number_are_refused() -> None:
    _, changes = next_epoch(road(1), ChangeLimits.from_dict(OFTEN), 1)
    data = changes.to_dict()
    data["changes"][1]["number"] = 1
    with pytest.raises(InputError, match="two have the same number"):
        ChangeList.from_dict(data)


def test_the_published_schema_is_that_of_the_code() -> None:
    published = (PRESETS / "changes.schema.json").read_text(encoding="utf-8")
    assert published == canonical_json(changes_schema())
