"""The panel's jobs in a Blender that is ended in the middle, and cancelled in the middle: nothing is left.

What a Blender that is killed leaves of its own in the folder for temporary files is not the add-on's.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import pytest

from synthroads_addon.base.errors import Cancelled
from synthroads_addon.reconstruction.report import ReconstructionJob
from synthroads_addon.twin.formats import IfcSettings
from synthroads_addon.ui.panels.export import export_cloud, export_twin
from synthroads_addon.ui.panels.rules import edited_parameters
from synthroads_addon.ui.panels.scan_road import find_and_build
from synthroads_addon.ui.work.build import build_work, shown_place
from synthroads_addon.ui.work.job import PanelJob, running_job
from synthroads_addon.ui.work.scan import requested_scan, requested_visible_scan, scan_work
from synthroads_addon.ui.work.scene_scan import visible_scan_work
from tests.helpers.clouds.road_clouds import cloud_of, write
from tests.helpers.clouds.road_clouds import road as sampled
from tests.helpers.ended_commands import ROOT, processes_of, run_until
from tests.helpers.scenes.panel_road import (  # noqa: F401
    block_counts,
    cheap,
    choose,
    road,
    road_file,
    settings,
    wait_for_end,
)
from tests.helpers.scenes.scene_hash import changes, lines

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="signals as Linux has them"),
]
SEED = os.environ.get("KILL_SEED") or "1"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
_TRIES = 6
RENDERED = {"colour.source": "images", "colour.own_image_spacing": True, "colour.image_spacing": 60.0}
OVER_SCENE = {
    "scan.own_lines_per_second": True,
    "scan.lines_per_second": 50.0,
    "scan.platform.speed": 10.0,
    "scan.platform.own_height": True,
    "scan.platform.height": 12.0,
    "colour.source": "material",
}
JOBS: dict[str, tuple[dict[str, Any], str]] = {
    "build": ({"road.length": 150.0}, "bpy.ops.synthroads.build(); bpy.ops.wm.save_mainfile()"),
    "scan": ({"twin": {"geojson", "ifc"}}, "bpy.ops.synthroads.scan()"),
    "scan in a thread": ({}, "in_a_thread(PanelJob('Scan', scan_work(requested_scan(bpy.context))))"),
    "rendered scan": (RENDERED, "bpy.ops.synthroads.scan()"),
    "scan of a scene": (OVER_SCENE, "scene_without_road(); bpy.ops.synthroads.scan()"),
    "models": ({}, "bpy.ops.synthroads.export_twin(directory=OUT, formats={'cityjson', 'ifc', 'opendrive'}, **AGAIN)"),
    "cloud": ({}, "bpy.ops.synthroads.export_cloud(source=CLOUD, filepath=OUT + '/cloud.ply', check_existing=False)"),
    "road from a scan": ({}, "bpy.ops.synthroads.road_from_scan(filepath=CLOUD); bpy.ops.wm.save_mainfile()"),
}
"""Choices of the panel, and what is then called, with names of `START`."""
START = """
import os
import sys
import time
import traceback
import bpy
import synthroads_addon
from synthroads_addon.ui.work.job import PanelJob
from synthroads_addon.ui.work.scan import requested_scan, scan_work
from tests.helpers.scenes.panel_road import choose

AGAIN = {{"overwrite": True}}
FILE, OUT, CLOUD = {places!r}

def in_a_thread(job):
    job.start()
    while job.tick(0.02):
        time.sleep(0.002)
    assert job.error is None, job.error

def scene_without_road():
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=200, y_subdivisions=200, size=60.0)
    choose_all()

def choose_all():
    choose(bpy.context.scene.synthroads, output=OUT, overwrite=True, **{chosen!r})

code = 1
try:
    synthroads_addon.register()
    bpy.ops.wm.open_mainfile(filepath=FILE)
    choose_all()
    {called}
    code = 0
except BaseException:
    traceback.print_exc()
sys.stderr.flush()
os._exit(code)  # Blender's own way out can hang
"""


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("cloud") / "scan.laz", cloud_of(sampled("RQ31", "EKA1A", 100.0, 3), 15.0, 3))


class PanelRun:
    """Runs of a job of the panel, in a Blender of its own without a window."""

    def __init__(self, job: str, file: Path, cloud: Path, folder: Path) -> None:
        self.folder, self.out, self.file = folder, folder / "out", folder / "scene" / "road.blend"
        self.temporary = folder / "temporary"
        for path in (self.temporary, self.file.parent):
            path.mkdir()
        shutil.copy(file, self.file)
        chosen, called = JOBS[job]
        places = (str(self.file), str(self.out), str(cloud))
        text = START.format(places=places, chosen=chosen, called=called)
        self.words = [sys.executable, "-c", text]
        self.saves = "save_mainfile" in called

    def files(self) -> dict[str, bytes]:
        """Return what stands in the output's folder and beside the scene; empty what holds times or is the scene's."""
        found = {}
        for path in sorted([*self.out.rglob("*"), *self.file.parent.rglob("*")]):
            if path.is_file():
                timed = path.name == "report.json" or (self.saves and path.suffix.startswith(".blend"))
                found[path.relative_to(self.folder).as_posix()] = b"" if timed else path.read_bytes()
        return found

    def left(self) -> list[str]:
        """Return the add-on's own temporary folders."""
        return [path.name for path in self.temporary.iterdir() if path.name.startswith(("synthroads", ".partial"))]


@pytest.mark.parametrize("job", JOBS)
def test_a_blender_that_is_ended_in_the_middle_of_a_job_leaves_nothing_after_the_next(
    job: str,
    road_file: Path,  # noqa: F811
    cloud: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """KILL_SEED=N ends it at other moments than usual."""
    panel = PanelRun(job, road_file, cloud, tmp_path)
    monkeypatch.setenv("TMPDIR", str(panel.temporary))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    whole = run_until(panel.words, 0.0, None)
    assert whole.code == 0, whole.said
    assert panel.left() == []
    wanted, seconds = panel.files(), whole.seconds
    draw, ended = random.Random(f"{SEED} {job}"), Counter[str]()
    for sign in SIGNALS:
        for _ in range(_TRIES):
            found = run_until(panel.words, draw.uniform(0.2, 0.95) * seconds, sign)
            _see_that_all_is_whole(panel, wanted)
            if found.code != 0:
                ended[sign.name] += 1
                break
            seconds *= 0.8
    again = run_until(panel.words, 0.0, None)
    assert again.code == 0, again.said
    assert panel.files() == wanted
    assert panel.left() == []
    assert sum(ended.values()) == len(SIGNALS), ended
    print(job, dict(ended))


def _see_that_all_is_whole(panel: PanelRun, wanted: dict[str, bytes]) -> None:
    """See that each file under its final name is whole, and that no process is at work any more."""
    until = time.monotonic() + 60.0
    while processes_of(panel.temporary) and time.monotonic() < until:
        time.sleep(0.1)
    assert processes_of(panel.temporary) == []
    for name, content in panel.files().items():
        if not any(part.startswith(".") for part in Path(name).parts) and not name.endswith(".blend@"):
            assert content == wanted.get(name), name


# --- cancelled ------------------------------------------------------------------------------------------------------


def _scan(folder: Path, cloud: Path) -> PanelJob[Any]:
    return PanelJob("Scan", scan_work(requested_scan(bpy.context)))


def _scan_of_all(folder: Path, cloud: Path) -> PanelJob[Any]:
    return PanelJob("Scan", visible_scan_work(requested_visible_scan(bpy.context)))


def _models(folder: Path, cloud: Path) -> PanelJob[Any]:
    parameters, wanted = edited_parameters(bpy.context.scene), (["cityjson", "ifc", "opendrive"], 0.01)
    assert parameters
    return PanelJob.aside("Export", partial(export_twin, parameters, folder, *wanted, IfcSettings(), False, False))


def _cloud(folder: Path, cloud: Path) -> PanelJob[Any]:
    return PanelJob.aside("Export", partial(export_cloud, cloud, folder / "cloud.ply", None, 0.0))


def _road_from_scan(folder: Path, cloud: Path) -> PanelJob[Any]:
    place = replace(shown_place(bpy.context.scene), keep_moves=False)
    scenario = bpy.context.scene.synthroads.scenario()
    return PanelJob("Road from a Scan", find_and_build(ReconstructionJob(cloud=cloud), scenario, place))


def _build(folder: Path, cloud: Path) -> PanelJob[Any]:
    panel = bpy.context.scene.synthroads
    return PanelJob("Build", build_work(panel.scenario(), panel.road_values(), shown_place(bpy.context.scene)))


CANCELLED: dict[str, tuple[dict[str, Any], Callable[[Path, Path], PanelJob[Any]]]] = {
    "build": ({"road.length": 150.0}, _build),
    "scan": ({"twin": {"geojson", "ifc"}}, _scan),
    "rendered scan": (RENDERED, _scan),
    "scan of a scene": (OVER_SCENE, _scan_of_all),
    "models": ({}, _models),
    "cloud": ({}, _cloud),
    "road from a scan": ({}, _road_from_scan),
}
"""Choices of the panel, and the job that its button begins."""
STOPS = 5


@pytest.mark.parametrize("kind", CANCELLED)
def test_a_job_that_is_cancelled_in_the_middle_leaves_file_and_folders_as_they_were(
    kind: str,
    road: Any,  # noqa: F811
    cloud: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    chosen, begin = CANCELLED[kind]
    choose(road, **chosen)
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    counts = block_counts()
    draw, stopped = random.Random(f"{SEED} {kind}"), []
    for number in range(3 * STOPS):
        if len(stopped) == STOPS:
            break
        share, out = draw.uniform(0.0, 0.95), tmp_path / f"out{number}"
        road.output = str(out)
        state = lines()
        job = begin(out, cloud)
        job.start()
        while job.share < share and job.tick(0.0):
            time.sleep(0.001)
        job.stop()
        wait_for_end(job)
        assert running_job() is None
        if job.error is None:  # it was at its end
            assert kind not in ("build", "road from a scan"), "the file is another one now"
            continue
        assert isinstance(job.error, Cancelled), job.error
        stopped.append(round(share, 2))
        assert not out.exists(), list(out.rglob("*"))
        assert list(temporary.iterdir()) == []
        assert changes(state) == []
        assert block_counts() == counts
    assert len(stopped) == STOPS
    print(kind, stopped)
