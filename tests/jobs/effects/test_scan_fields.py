"""Every field of a scenario but its road's limits changes the points, or says how, or what is written."""

import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import StageTimer, silent
from synthroads_addon.jobs.choose.options import Option, cheapest
from synthroads_addon.jobs.choose.search import choose_settings
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.effects.field_paths import fields_of, other_values, value_at, with_value
from tests.helpers.effects.looks import Look, changes, look_at, look_at_cloud, look_at_files
from tests.helpers.effects.scan_cases import CASES, ROAD, ScanCase
from tests.helpers.effects.scans import SCAN
from tests.helpers.effects.written_fields import OF_OTHER_SCENES, WRITTEN

pytestmark = [pytest.mark.any_blender, pytest.mark.keep_scene]

FIELDS = {field.path: field for field in fields_of(Scenario) if not field.path.startswith("road.")}
SAY = "say in tests/helpers/effects/scan_cases.py"
OF_FILES = {path for path in FIELDS if path.startswith("cloud.")}
"""Fields whose effect is in the cloud's file alone."""
OF_OTHER_FILES = {path for path in FIELDS if path.startswith(("scan.cameras.", "sweeps.", "scene_formats"))}
"""Fields whose effect is in pictures, sweeps or the scene's file alone."""


@cache
def changed_scan(path: str) -> tuple[Scenario, Scenario]:
    """Return a scenario in which a field matters, before and after it changes.

    Raises:
        AssertionError: nobody said in which scan it matters, or what other value it may have.
    """
    case, data = CASES.get(path, ScanCase()), SCAN
    for name, value in case.given.items():
        data = with_value(data, name, value)
    try:
        before = Scenario.from_dict(data)
    except InputError as error:
        raise AssertionError(f"{SAY} in which scan {path} matters: {error}") from None
    whole: Any = before.to_dict()
    values: Iterator[Any] = iter([case.value])
    if case.value is None:
        values = other_values(FIELDS[path].info, value_at(whole, path))
    for value in values:
        try:
            after = Scenario.from_dict(with_value(whole, path, value))
        except InputError:
            continue
        if after != before:
            return before, after
    raise AssertionError(f"{SAY} which other value {path} may have")


@pytest.mark.parametrize("path", sorted(FIELDS.keys() - WRITTEN.keys() - OF_OTHER_SCENES))
def test_every_field_has_a_scan_in_which_it_matters(path: str) -> None:
    before, after = changed_scan(path)
    assert before != after


def test_no_list_names_a_field_that_there_is_none_of() -> None:
    made = {f"scan.{part}[" for part in ("platform", "weather")}  # fields that not each kind has
    assert {path for path in CASES if not any(map(path.startswith, made))} <= FIELDS.keys()
    assert WRITTEN.keys() <= FIELDS.keys()


@pytest.mark.parametrize("path", sorted(OF_OTHER_SCENES))
def test_a_tolerance_that_matters_in_scenes_of_others_chooses(path: str) -> None:
    """The cheapest settings that keep it are others where layers vary."""
    kind = path.rpartition(".")[2]
    coarse, fine = Option({"a": 1}, {kind: (0.4, 0.5)}, cost=1.0), Option({"a": 2}, {kind: (0.0, 0.1)}, cost=2.0)
    chosen = [cheapest([[coarse, fine]], {kind: limit}).changes for limit in (1.0, 0.2)]
    assert chosen == [coarse.changes, fine.changes]


@pytest.fixture(scope="module")
def looks() -> dict[str, Look]:
    """Looks at scans as they are, by scenario."""
    return {}


def seen(scenario: Scenario, path: str, folder: Path) -> Look:
    """Return what is seen in a scan of `ROAD`; in the cloud's file, where a field is seen there alone."""
    road = RoadParameters.from_dict(ROAD)
    if path in OF_FILES:
        return look_at_cloud(scenario, road, folder)
    if path in OF_OTHER_FILES:
        return look_at_files(scenario, road, folder)
    if scenario.chooses:
        scene = RoadScene.of(scenario, RoadGeometry(road))
        scenario = choose_settings(scene, time.perf_counter(), StageTimer(silent))[0].scenario
    return look_at(scenario, road)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(FIELDS.keys() - WRITTEN.keys() - OF_OTHER_SCENES))
def test_every_field_changes_the_points(looks: dict[str, Look], path: str, tmp_path: Path) -> None:
    before, after = changed_scan(path)
    key = before.to_json() + str(path in OF_FILES) + str(path in OF_OTHER_FILES)
    if key not in looks:
        looks[key] = seen(before, path, tmp_path / "before")
    assert changes(looks[key], seen(after, path, tmp_path / "after"))
