"""By mouse in the window of a real Blender: from Install from Disk to a scanned cloud, and roads dropped as files.

SYNTHROADS_BLENDER_ROOT names a folder that holds a whole Linux with a Blender 5.2 of its own, and
SYNTHROADS_BLENDER_SCRIPTS one with two programs: ``enter.sh ROOT FOLDER COMMAND...`` runs a command within the first,
where the folder is shown as /mnt/project; ``window.sh SCRIPT OUTPUT`` gives Blender a screen there and has it run a
script. Each run has a new home folder.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from synthroads_addon.jobs.whole_road import differences_from
from synthroads_addon.sampling.road import sample_alignment, sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.twin.formats import write_twin
from tests.doors.documented import ROOT
from tests.road_files.test_round_trip import landxml

HERE = Path(__file__).parent
BLENDER_ROOT, SCRIPTS = (os.environ.get(f"SYNTHROADS_BLENDER_{name}", "") for name in ("ROOT", "SCRIPTS"))
INSIDE = "/mnt/project"
"""Where enter.sh shows the folder."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (BLENDER_ROOT and SCRIPTS), reason="SYNTHROADS_BLENDER_ROOT and _SCRIPTS name no Blender"),
    pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="a root of its own needs Linux and root"),
    pytest.mark.skipif(
        importlib.util.find_spec("bpy") is None, reason="Blender's own tool, which packs, comes with bpy"
    ),
]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the extensions' zips."""
    folder = tmp_path_factory.mktemp("dist")
    build = ["tools/build_extension.py", "--platform", "linux-x64", "--blender", "5.2-debian"]
    _run([sys.executable, *build, "--output-dir", folder], 1200.0)
    return folder


@pytest.fixture(scope="module")
def worked(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which `scan_by_mouse` was run: with ``home`` and ``out``."""
    folder = tmp_path_factory.mktemp("window")
    (folder / "home").mkdir()
    return _work(built, folder, "scan_by_mouse.py")


@pytest.fixture(scope="module")
def dropped(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which `roads_by_mouse` was run, with roads of three formats in ``home/roads``."""
    folder = tmp_path_factory.mktemp("roads")
    roads = folder / "home" / "roads"
    roads.mkdir(parents=True)
    limits = RoadScenario(length=120.0)
    write_twin(sample_road(limits, 3), roads, ("opendrive", "ifc"), 0.02)
    landxml(roads / "twin.xml", sample_alignment(limits, 4))
    for report in roads.glob("*.json"):
        report.unlink()
    _lay_ifc(built, folder)
    return _work(built, folder, "roads_by_mouse.py")


@pytest.fixture(scope="module")
def walked(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which `walk_by_mouse` was run, with what it wrote in ``home/walk``."""
    folder = tmp_path_factory.mktemp("walk")
    (folder / "home").mkdir()
    _lay_ifc(built, folder)
    return _work(built, folder, "walk_by_mouse.py", 7200.0)


def _lay_ifc(built: Path, folder: Path) -> None:
    """Copy the zip of SynthRoads IFC into a run's ``home/ifc``."""
    (folder / "home" / "ifc").mkdir()
    for archive in built.glob("synthroads_ifc-*.zip"):
        shutil.copyfile(archive, folder / "home" / "ifc" / archive.name)


RECIPE = """
type: Recipe
version: "1.0"
title: Three short roads
description: Short motorways for a trial.
licence: CC-BY-4.0
seed: 11
scenario: rq31-600m
set:
  fidelity: draft
  outputs: [parameters, cloud, centerline]
  road.length: 60
  road.half_width: 25
draw:
  scan.platform.height: {minimum: 54, maximum: 66}
groups:
  - {name: roads, scenes: 3, split: {train: 3}}
"""


@pytest.fixture(scope="module")
def made(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which `dataset_by_mouse` was run, with the data set in ``home/set``."""
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "home").mkdir()
    (folder / "home" / "recipe.yaml").write_text(RECIPE, encoding="utf-8")
    return _work(built, folder, "dataset_by_mouse.py")


def _work(built: Path, folder: Path, script: str, seconds: float = 3600.0) -> Path:
    """Run a script in the window of a Blender whose home folder is the folder's ``home``; return the folder."""
    (archive,) = built.glob("synthroads-*.zip")
    shutil.copyfile(archive, folder / "home" / archive.name)
    for file in (
        Path(SCRIPTS, "window.sh"),
        *(HERE / f"{name}_by_mouse.py" for name in ("scan", "roads", "dataset", "walk")),
    ):
        shutil.copyfile(file, folder / file.name)
    shutil.copyfile(HERE / "by_mouse.py", folder / "by_mouse.py")
    inside = [
        "env",
        f"HOME={INSIDE}/home",
        "bash",
        f"{INSIDE}/window.sh",
        f"{INSIDE}/{script}",
        f"{INSIDE}/out",
    ]
    said = _run(["bash", Path(SCRIPTS, "enter.sh"), BLENDER_ROOT, folder, *inside], seconds, may_fail=True)
    assert (folder / "out" / "answers.json").exists(), said
    return folder


def _run(command: list[str | Path], seconds: float, *, may_fail: bool = False) -> str:
    """Run a command from the repository's root, and end it with all that it started where it takes too long."""
    words = list(map(str, command))
    process = subprocess.Popen(
        words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        said, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        pytest.fail(f"{' '.join(words)}: not within {seconds:.0f} s\n{process.communicate()[0]}")
    assert may_fail or process.returncode == 0, said
    return said


def test_a_user_gets_from_the_zip_to_a_shown_cloud_by_mouse(worked: Path) -> None:
    answers: dict[str, Any] = json.loads((worked / "out" / "answers.json").read_text(encoding="utf-8"))
    assert answers.get("failed") is None, answers["failed"]
    assert "bl_ext.user_default.synthroads" in answers["enabled"]
    assert answers["road"] > 5, "no road in the scene"
    with laspy.open(worked / "home" / "scan" / "cloud.laz") as file:
        cloud = file.read()
    assert len(cloud) > 10_000
    assert len(np.unique(cloud.classification)) > 5
    length = np.ptp(np.column_stack([cloud.x, cloud.y]), axis=0).max()
    assert 50.0 < length < 250.0, "the length that was typed: 60 m"
    assert answers["shown"] == [len(cloud), len(cloud)]


def test_files_of_roads_are_built_where_they_are_dropped(dropped: Path) -> None:
    """Dragged from Blender's file browser into the view: the road in the scene is the file's, read back exactly."""
    answers: dict[str, Any] = json.loads((dropped / "out" / "answers.json").read_text(encoding="utf-8"))
    assert answers.get("failed") is None, answers["failed"]
    assert sorted(answers["roads"]) == ["twin.ifc", "twin.xml", "twin.xodr"]
    for name, found in answers["roads"].items():
        assert found["same"], name
        assert found["objects"] > 20
        path = dropped / "home" / "roads" / name
        rows, _ = differences_from(path, dropped / "out" / f"{name}.json", Scenario.from_dict({}))
        assert rows == [], name


def test_a_data_set_is_made_stopped_and_continued(made: Path) -> None:
    """With the packages that the installed extension brings; what was done before the stop isn't made again."""
    answers: dict[str, Any] = json.loads((made / "out" / "answers.json").read_text(encoding="utf-8"))
    assert answers.get("failed") is None, answers["failed"]
    done, failed, total = answers["stopped"]
    assert 1 <= done < 3
    assert (failed, total) == (0, 3)
    assert answers["made"] == [3, 0, 3]
    assert answers["pictures"] == sorted(answers["times"])
    assert answers["kept"].items() <= answers["times"].items()
    assert len(list((made / "home" / "set").glob("scenes/*/cloud.laz"))) == 3


def test_a_road_is_drawn_furnished_scanned_and_pictured_by_night_in_60_actions(walked: Path) -> None:
    """The steps are those of the guide, docs/guide/blender.md."""
    answers: dict[str, Any] = json.loads((walked / "out" / "answers.json").read_text(encoding="utf-8"))
    assert answers.get("failed") is None, answers["failed"]
    assert len(answers["actions"]) <= 60
    assert [abs(radius) for radius in answers["radii"]] == [900.0, 900.0, 900.0]
    kinds = [thing["type"] for thing in answers["things"].values()]
    assert kinds.count("Gantry") == 1
    assert kinds.count("Turnout") == 1
    placed = {tuple(thing["text"]) for thing in answers["things"].values() if thing["code"] == "448"}
    assert {("11", "Aalen", "1000 m"), ("11", "Aalen", "500 m")} <= placed
    _, before, after = answers["guardrail"]
    assert abs(after - before) > 5.0
    points, by = answers["shown"]
    assert points > 100_000
    assert by == "class"
    assert {"cloud.laz", "twin.ifc"} <= set(answers["files"])
    assert not answers["cube"]
    assert answers["sun"] == -20.0
    assert answers["size"] == 25
    assert answers["rendered"]


@pytest.mark.parametrize("run", ["worked", "dropped", "made", "walked"])
def test_blender_writes_no_traceback(run: str, request: pytest.FixtureRequest) -> None:
    log = request.getfixturevalue(run) / "out" / "blender.log"
    assert "Traceback" not in log.read_text(encoding="utf-8", errors="replace")
