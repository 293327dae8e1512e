"""The checker as a whole: good roads, what it documents and imports, odd input, speed, and the command."""

import contextlib
import json
import math
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from headless.commands import command
from synthroads_addon.base.errors import InputError
from synthroads_addon.checking import checker
from synthroads_addon.checking.checker import RULES, check
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.checking.rules import test_alignment as test_checker_alignment
from tests.checking.rules import test_furniture as test_checker_furniture
from tests.checking.rules import test_section as test_checker_section
from tests.checking.rules.test_interchanges import BREACHES as OF_INTERCHANGES
from tests.checking.rules.test_side_roads import BREACHES as OF_SIDE_ROADS
from tests.checking.rules.test_structures import BREACHES as OF_STRUCTURES
from tests.helpers.files.mutations import cases, for_all
from tests.helpers.roads.checker_full_road import full, turned
from tests.helpers.roads.checker_roads import EGG, S_CURVE, changed, checked, good, mirrored, road
from tests.sampling.test_country_roads import BREACHES
from tests.sampling.test_other_countries import BREACHES as ELSEWHERE
from tests.sampling.test_overtaking_lanes import BREACHES as OF_OVERTAKING_LANES
from tests.sampling.test_villages import BREACHES as IN_VILLAGES

DOCS = Path(__file__).parents[2] / "docs" / "rules.md"


def test_every_rule_has_an_id_of_its_own_and_a_planted_violation() -> None:
    assert len(RULES) == sum(len(module.RULES) for module in checker.MODULES)
    tests = (test_checker_alignment, test_checker_section, test_checker_furniture)
    planted = {case.rule for module in tests for case in module.PLANTED}
    further = (IN_VILLAGES, OF_SIDE_ROADS, OF_OVERTAKING_LANES, OF_STRUCTURES, OF_INTERCHANGES, ELSEWHERE)
    assert planted.union(BREACHES, *further) == set(RULES)


def test_the_docs_list_every_rule() -> None:
    text = DOCS.read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    assert set(rows) == set(RULES)
    for name, rule in RULES.items():
        assert rule.sure in rows[name], name
        assert rule.source in rows[name], name


@pytest.mark.parametrize("make", [good, full])
def test_a_good_road_passes(make: Any) -> None:
    assert checked(make()) == []
    assert checked(mirrored(good())) == []
    assert checked(turned(full())) == []


def test_roads_without_furniture_and_with_one_carriageway() -> None:
    data = good()
    kinds = {"Guardrail", "Delineator", "Terrain", "Vegetation", "Median"}
    data["objects"] = {name: item for name, item in data["objects"].items() if item["type"] not in kinds}
    missing = {"median-barrier", "delineator-missing", "curve-barrier"}
    assert {v.rule for v in checked(data)} == missing
    data["objects"] = {name: item for name, item in data["objects"].items() if not name.startswith("left")}
    assert {v.rule for v in checked(data)} == missing - {"median-barrier"}


NUMBERS = st.floats(-1e15, 1e15) | st.sampled_from(
    [0.0, -0.0, 5e-324, 1e-300, 1e-9, 0.001, -0.1, 0.1, 1.0, 2.5, -2.5, 600.0, 1e8, 1e15, -1e15]
)


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all numbers."""
    if isinstance(data, dict | list):
        pairs = data.items() if isinstance(data, dict) else enumerate(data)
        return [found for key, value in pairs for found in places(value, (*path, key))]
    return [path] if isinstance(data, int | float) else []


@cases(80, 500)
def test_no_valid_set_makes_it_fail(count: int) -> None:
    changes = st.lists(st.tuples(st.integers(0, 10**6), NUMBERS), min_size=1, max_size=12)
    for_all(st.tuples(st.integers(0, 3), changes), count, _check_changed)


def _check_changed(case: tuple[int, list[tuple[int, float]]]) -> None:
    """Change a road's numbers one by one where it stays valid, and check it."""
    which, changes = case
    data = (good, lambda: road(EGG), lambda: road(S_CURVE, "EKA3"), full)[which]()
    spots = places(data["objects"])
    valid = 0
    for pick, value in changes:
        path = spots[pick % len(spots)]
        target = data["objects"]
        for part in path[:-1]:
            target = target[part]
        before = target[path[-1]]
        target[path[-1]] = int(min(abs(value), 12.0)) if isinstance(before, int) else value
        try:
            parameters = RoadParameters.from_dict(data)
            valid += 1
        except InputError:
            target[path[-1]] = before
    if not valid:
        return
    parameters = RoadParameters.from_dict(data)
    for violation in check(parameters):
        assert all(map(math.isfinite, (violation.station, violation.value, violation.limit)))
        assert violation.object in parameters.objects


def test_no_extreme_number_makes_it_fail() -> None:
    """Each field that is a number, of one object of each class, takes each of these values."""
    data, seen = full(), set()
    for path in places(data["objects"]):
        field = (data["objects"][path[0]]["type"], *(part for part in path[1:] if isinstance(part, str)))
        if field in seen:
            continue
        seen.add(field)
        target = data["objects"]
        for part in path[:-1]:
            target = target[part]
        before = target[path[-1]]
        for value in (0.0, 5e-324, 1e8, 1e15, -1e15) if isinstance(before, float) else (0, 1, 8):
            target[path[-1]] = value
            with contextlib.suppress(InputError):
                check(RoadParameters.from_dict(data))
        target[path[-1]] = before
    assert len(seen) > 100


@cases(50, 300)
def test_no_set_without_some_objects_makes_it_fail(count: int) -> None:
    names = sorted(full()["objects"])
    for_all(st.lists(st.sampled_from(names), max_size=40, unique=True), count, _check_without)


def _check_without(names: list[str]) -> None:
    """Check a road without some of its objects, if it is valid without them."""
    kept = full()
    for name in names:
        kept["objects"].pop(name)
    try:
        parameters = RoadParameters.from_dict(kept)
    except InputError:
        return
    check(parameters)


def test_a_check_takes_less_than_seven_times_as_long_as_reading_the_set() -> None:
    """Measured is 3.6 times, on an idle machine as on a busy one: both are timed by turns in one run."""
    parameters = sample_road(RoadScenario(cross_section="RQ36", length=600.0), 3)
    assert len(parameters.objects) >= 70
    data = parameters.to_dict()
    checking, reading = [], []
    for _ in range(8):
        for spent, action in ((checking, lambda: check(parameters)), (reading, lambda: RoadParameters.from_dict(data))):
            start = time.process_time()
            for _ in range(5):
                action()
            spent.append(time.process_time() - start)
    assert min(checking) < 7.0 * min(reading)


# --- the command --------------------------------------------------------------------------------------------------


def run(path: Path, *flags: str) -> int:
    return command("check", [str(path), *flags])


def test_command_on_a_good_road(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "good.json"
    path.write_text(RoadParameters.from_dict(good()).to_json(), encoding="utf-8")
    assert run(path) == 0
    assert capsys.readouterr().out == "no violations\n"
    assert run(path, "--json") == 0
    assert json.loads(capsys.readouterr().out) == {"violations": []}


def test_command_lists_violations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(changed(("left-post-5", None), ("left/lanes/1/width", 3.25))), encoding="utf-8")
    assert run(path) == 3
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["rule", "object", "station", "value", "limit"]
    assert lines[1].split()[:8] == ["lane-width", "left", "0.0", "m", "3.25", "m", "3.5", "m"]
    assert lines[2].split()[:8] == ["delineator-spacing", "left", "225.0", "m", "100", "m", "50", "m"]
    assert lines[-1] == "2 violations"
    assert run(path, "--json") == 3
    violations = json.loads(capsys.readouterr().out)["violations"]
    assert [v["rule"] for v in violations] == ["lane-width", "delineator-spacing"]
    assert set(violations[0]) == {"rule", "object", "station", "value", "limit", "unit", "text"}
    assert run(path, "--quiet") == 3
    assert capsys.readouterr().out.splitlines() == lines, "they are what was asked for"


def test_a_column_says_what_kilometres_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only where they count otherwise than stations do."""
    data = changed(("left-post-5", None))
    axis = next(item for item in data["objects"].values() if item["type"] == "Alignment")
    axis |= {"first_station": 12_340.0, "equations": [{"station": 200.0, "ahead": 900.0}]}
    (tmp_path / "bad.json").write_text(json.dumps(data), encoding="utf-8")
    assert run(tmp_path / "bad.json") == 3
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["rule", "object", "station", "counted", "value", "limit"]
    assert lines[1].split()[:8] == ["delineator-spacing", "left", "225.0", "m", "925.0", "m", "100", "m"]


@pytest.mark.parametrize("text", [None, "{", "[]", '{"type": "Scenario"}', '{"type": "RoadParameters"}'])
def test_command_on_a_bad_file(text: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "file.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    assert run(path, "--json") == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert shown.err.count("\n") == 1
