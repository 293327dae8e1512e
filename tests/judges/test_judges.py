"""Programs of others judge the files of one small road, and each refuses a file that is wrong."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.twin.ifc.writer import write_ifc
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.roads.sampled_parts import PAIRS, scenario
from tests.judges import JUDGES, Judge, libopendrive, registry, require, web_ifc
from tests.judges.__main__ import exit_code, judged, main, table
from tests.judges.samples import Samples

TESTS = Path(__file__).resolve().parents[1]
MODULES = {"eclipse-sumo": "sumo", "scikit-learn": "sklearn", "asam-qc-opendrive": "qc_opendrive"}
"""Names that judges are imported by, where they aren't their own."""


ELSEWHERE = ("ifcopenshell", "pyxodr")
"""Judges that quick tests of the twin ask the same, of other roads."""


def each(judges: list[Judge]) -> pytest.MarkDecorator:
    """Parametrize over judges, the slow ones marked so."""
    marked = []
    for item in judges:
        marks = [pytest.mark.slow] if item.slow or item.name in ELSEWHERE else []
        marks += [] if item.comes_with_pip() else [pytest.mark.first_python]
        marked.append(pytest.param(item, marks=marks, id=item.name))
    return pytest.mark.parametrize("judge", marked)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Samples:
    return Samples(tmp_path_factory.mktemp("judges"))


@each(list(JUDGES.values()))
def test_nothing_is_found(judge: Judge, samples: Samples) -> None:
    require(judge.name)
    assert judge.verdict(samples) == []


@each([judge for judge in JUDGES.values() if judge.spoil])
def test_a_wrong_file_is_found(judge: Judge, samples: Samples) -> None:
    require(judge.name)
    assert judge.spoil is not None
    assert judged(judge, judge.spoil(samples)).issues


@pytest.mark.slow
@pytest.mark.parametrize(("design_class", "section"), PAIRS)
def test_libopendrive_sees_the_pavement_of_every_cross_section(design_class: str, section: str, tmp_path: Path) -> None:
    require("libOpenDRIVE")
    limits = {"turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1}}
    road = sample_road(scenario(design_class=design_class, cross_section=section, length=1000.0, **limits), 3)
    write_opendrive(road, tmp_path / "twin.xodr", 0.005)
    assert libopendrive.surface_faults(tmp_path / "twin.xodr", RoadGeometry(road)) == []


@pytest.mark.slow
def test_web_ifc_puts_objects_where_they_stand_with_local_placement(samples: Samples, tmp_path: Path) -> None:
    require("web-ifc")
    write_ifc(samples.road, tmp_path / "local.ifc", placement="local")
    assert web_ifc.misplaced(tmp_path / "local.ifc") < 0.001
    # It takes of a linear placement the distance alone.
    assert web_ifc.misplaced(samples.file("twin.ifc")) > 1.0


# --- the list -----------------------------------------------------------------------------------------------------


def absent(name: str, **changes: object) -> Judge:
    return replace(JUDGES[name], version=lambda: None, **changes)


@pytest.mark.parametrize(("name", "required", "outcome"), [
    ("plyfile", "", pytest.skip.Exception),
    ("plyfile", "1", pytest.fail.Exception),
    ("cityjson-schema", "1", pytest.skip.Exception),
])  # fmt: skip
def test_a_judge_that_is_not_here(name: str, required: str, outcome: type[BaseException], monkeypatch) -> None:
    monkeypatch.setitem(JUDGES, name, absent(name))
    monkeypatch.setenv(registry.REQUIRED, required)
    with pytest.raises(outcome, match=f"{name} isn't here: {re.escape(JUDGES[name].install)}"):
        require(name)


def test_a_judge_for_another_python_is_not_required(monkeypatch) -> None:
    name = "plyfile"
    monkeypatch.setitem(registry._requirements(), name, [registry.Requirement("plyfile; python_version < '3'")])
    monkeypatch.setitem(JUDGES, name, absent(name))
    monkeypatch.setenv(registry.REQUIRED, "1")
    with pytest.raises(pytest.skip.Exception):
        require(name)


def test_a_judge_that_can_be_brought_is(monkeypatch) -> None:
    brought: list[str] = []
    judge = absent("web-ifc", bring=lambda: brought.append("web-ifc"))
    monkeypatch.setitem(JUDGES, "web-ifc", replace(judge, version=lambda: brought[0] if brought else None))
    assert require("web-ifc").version() == "web-ifc"


def test_what_pip_brings_is_in_the_extras_and_the_other_way_round() -> None:
    with_pip = {canonicalize_name(judge.name) for judge in JUDGES.values() if judge.manager == "pip"}
    project = registry.tomllib.loads((TESTS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extra = {registry.Requirement(text).name for text in project["optional-dependencies"]["judges"]}
    assert extra <= with_pip <= set(registry._requirements())


def test_every_file_has_a_judge_and_every_judge_of_files_a_wrong_one() -> None:
    judged_files = " ".join(judge.judges for judge in JUDGES.values())
    for kind in ("OpenDRIVE", "IFC", "CityJSON", "LAZ", "PLY", "E57", "parameter set"):
        assert kind in judged_files
    assert {judge.name for judge in JUDGES.values() if not judge.spoil} == {"scikit-learn", "openpoints"}


def test_no_test_skips_a_judge_by_itself() -> None:
    names = {MODULES.get(name, name.replace("-", "_")) for name in JUDGES}
    for path in TESTS.rglob("test_*.py"):
        skipped = set(re.findall(r'importorskip\("(\w+)', path.read_text(encoding="utf-8")))
        assert not skipped & names, path


# --- the command --------------------------------------------------------------------------------------------------


def test_the_command_prints_a_table_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    require("jsonschema")
    assert main(["jsonschema"]) == 0
    heading, row = capsys.readouterr().out.splitlines()
    assert heading.split() == ["judge", "version", "judges", "verdict"]
    assert row.startswith(f"jsonschema  {JUDGES['jsonschema'].version()}")
    assert row.endswith("  valid")
    assert main(["--json", "jsonschema"]) == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert (said["name"], said["version"], said["issues"]) == ("jsonschema", JUDGES["jsonschema"].version(), [])


def test_what_is_found_is_said_and_fails(samples: Samples, monkeypatch) -> None:
    def crash(samples: Samples) -> list[str]:
        raise ValueError("no such file")

    finding = replace(JUDGES["jsonschema"], verdict=lambda samples: ["first", "second"])
    verdicts = [judged(finding, samples), judged(replace(finding, verdict=crash), samples)]
    assert [exit_code([verdict]) for verdict in verdicts] == [1, 1]
    assert table(verdicts).splitlines()[1].endswith("  2 issues")
    assert table(verdicts).splitlines()[3:] == [
        "jsonschema: first",
        "jsonschema: second",
        "jsonschema: ValueError: no such file",
    ]
    missing = judged(absent("jsonschema"), samples)
    assert missing.summary() == f"not here: {missing.install}"
    monkeypatch.delenv(registry.REQUIRED, raising=False)
    assert exit_code([judged(absent("jsonschema"), samples)]) == 0
    monkeypatch.setenv(registry.REQUIRED, "1")
    assert exit_code([judged(absent("jsonschema"), samples)]) == 1


def test_unknown_names_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["jsonshema"])
    assert "no judge is called jsonshema" in capsys.readouterr().err
