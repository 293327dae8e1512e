"""The button that scans: the library's bytes, messages, nothing half-written, and a scene that stays as it was."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.errors import Cancelled
from synthroads_addon.base.progress import Progress
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.store import find_road
from synthroads_addon.blender.things.model_builder import ROLE
from synthroads_addon.jobs import job_files
from synthroads_addon.jobs.generate import Job as PipelineJob
from synthroads_addon.jobs.generate import generate
from synthroads_addon.jobs.job_files import FILES
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.scanning import forecast
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.ui.work import scan
from synthroads_addon.ui.work.job import PanelJob, running_job
from synthroads_addon.ui.work.long_operator import draw_job
from synthroads_addon.ui.work.scan import scan_work
from synthroads_addon.ui.work.scan_steps import Written
from tests.helpers.scenes.fake_layout import FakeLayout
from tests.helpers.scenes.panel_road import (  # noqa: F401
    SAME,
    block_counts,
    cheap,
    choose,
    road,
    road_file,
    settings,
    small_pictures,
    wait_for_end,
)
from tests.helpers.scenes.scene_hash import digest

pytestmark = pytest.mark.usefixtures("small_pictures")

WRITTEN = sorted([n for o in ("parameters", "cloud", "centerline", "previews") for n in FILES[o]] + ["report.json"])


def test_buttons_give_the_same_bytes_as_the_library(cheap: Any, tmp_path: Path) -> None:  # noqa: F811
    cheap.output = str(tmp_path / "panel")
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    assert sorted(path.name for path in (tmp_path / "panel").iterdir()) == WRITTEN
    scenario = load_scenario("rq31-600m", SAME)
    report = generate(PipelineJob(scenario, tmp_path / "library", new_file=True))
    for name in set(WRITTEN) - {"report.json"}:
        assert (tmp_path / "panel" / name).read_bytes() == (tmp_path / "library" / name).read_bytes(), name
    written = json.loads((tmp_path / "panel" / "report.json").read_text())
    assert written["counts"] == json.loads(json.dumps(report["counts"]))
    assert written["counts"]["points"] > 10_000


def test_scan_is_of_the_road_that_was_built(road: Any, tmp_path: Path) -> None:  # noqa: F811
    choose(road, **{"road.length": 90.0, "seed": 4, "scan.platform.speed": 50.0})
    bpy.ops.synthroads.scan()
    scenario = json.loads((tmp_path / "out" / "report.json").read_text())["scenario"]
    assert (scenario["road"]["length"], scenario["seed"], scenario["scan"]["platform"]["speed"]) == (120.0, 3, 50.0)
    assert json.loads((tmp_path / "out" / "parameters.json").read_text())["metadata"]["seed"] == 3


def test_a_scan_writes_the_parameters_of_the_edited_road(road: Any, tmp_path: Path) -> None:  # noqa: F811
    set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", 4.5)
    road.output = str(tmp_path / "edited")
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    written = read_parameters(tmp_path / "edited" / "parameters.json")
    assert written.carriageway("right").lanes[0].width == 4.5
    assert written.carriageway("left").lanes[0].width != 4.5


def test_a_scan_leaves_the_scene_as_it_was(road: Any) -> None:  # noqa: F811
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    before, counts = digest(), block_counts()
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    assert block_counts() == counts
    assert digest() == before


def test_a_scan_is_cancelled_while_models_of_its_road_are_written(
    road: Any,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They come first: a long road's take minutes."""
    told: list[Any] = []

    def write(*_: Any, progress: Progress) -> None:
        progress("IFC", 0.5)
        told.append(job.share)
        job.stop()
        progress("IFC", 0.6)
        told.append("went on")

    monkeypatch.setattr(job_files, "write_twin", write)
    choose(road, twin={"geojson"}, output=str(tmp_path / "models"))
    before = digest()
    job = PanelJob("Scan", scan_work(scan.requested_scan(bpy.context)))
    with pytest.raises(Cancelled):
        job.run()
    assert told == [pytest.approx(0.1 + 0.9 * 0.5 * 0.02)]
    assert not (tmp_path / "models").exists()
    assert digest() == before


def test_without_a_road_that_is_still_there_only_what_is_visible_is_scanned(cheap: Any, tmp_path: Path) -> None:  # noqa: F811
    cheap.output = str(tmp_path / "out")
    with pytest.raises(RuntimeError, match="nothing visible has faces"):
        bpy.ops.synthroads.scan()
    cheap.output = ""
    bpy.ops.synthroads.build()
    with pytest.raises(RuntimeError, match="Output is '//synthroads': save the file first"):
        bpy.ops.synthroads.scan()
    for item in [item for item in bpy.data.objects if ROLE in item]:
        bpy.data.objects.remove(item)
    cheap.output = str(tmp_path / "out")
    with pytest.raises(RuntimeError, match="nothing visible has faces"):
        bpy.ops.synthroads.scan()


def _file_in_the_way(road: Any, folder: Path) -> None:  # noqa: F811
    (folder / "file").write_text("mine")
    road.output = str(folder / "file" / "out")


def _earlier_scan(road: Any, folder: Path) -> None:  # noqa: F811
    (folder / "cloud.laz").write_text("mine")
    road.output = str(folder)


def _hide_all(road: Any, folder: Path) -> None:  # noqa: F811
    bpy.context.view_layer.layer_collection.children["SynthRoads"].exclude = True


def _damage(road: Any, folder: Path) -> None:  # noqa: F811
    find_road(bpy.context.scene)["synthroads_parameters"] = "{"


def _wrong_seed(road: Any, folder: Path) -> None:  # noqa: F811
    stored = json.loads(find_road(bpy.context.scene)["synthroads_scenario"])
    find_road(bpy.context.scene)["synthroads_scenario"] = json.dumps(stored | {"seed": -1})


WRONG = {
    "no folder": (lambda panel, folder: setattr(panel, "output", " "), "Output: choose a folder"),
    "file in the way": (_file_in_the_way, "Output is .*cannot be written"),
    "files already there": (_earlier_scan, "already holds cloud.laz; tick Replace Files"),
    "nothing visible": (_hide_all, "nothing that could be scanned is visible"),
    "damaged set": (_damage, "Road: its parameter set in the file is damaged"),
    "damaged scenario": (_wrong_seed, "Road: seed is -1"),
}
"""How to do something wrong after a road was built, and what the message says."""


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_and_nothing_written(road: Any, tmp_path: Path, name: str) -> None:  # noqa: F811
    do_it, message = WRONG[name]
    do_it(road, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(RuntimeError, match=message) as caught:
        bpy.ops.synthroads.scan()
    assert "Traceback" not in str(caught.value)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.any_blender
def test_replacing_files_is_the_users_choice(road: Any, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "cloud.laz").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    choose(road, output=str(tmp_path), overwrite=True)
    bpy.ops.synthroads.scan()
    assert (tmp_path / "cloud.laz").read_bytes()[:4] == b"LASF"
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_output_beside_a_saved_file(road: Any, road_file: Path) -> None:  # noqa: F811
    road.output = "//synthroads"
    assert road.folder() == road_file.parent / "synthroads"
    assert not road.needs_saved_file()


def job_of_the_panel() -> PanelJob[Written]:
    return PanelJob("Scan", scan_work(scan.requested_scan(bpy.context)))


def tick_to_the_end(job: PanelJob[Any]) -> None:
    job.start()
    wait_for_end(job)


def test_a_scan_beside_the_window_gives_the_same_bytes(road: Any, tmp_path: Path) -> None:  # noqa: F811
    job = job_of_the_panel()
    tick_to_the_end(job)
    assert (job.error, job.share) == (None, 1.0)
    road.output = str(tmp_path / "again")
    bpy.ops.synthroads.scan()
    for name in set(WRITTEN) - {"report.json"}:
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    reports = [json.loads((tmp_path / name / "report.json").read_text()) for name in ("out", "again")]
    assert reports[0]["counts"] == reports[1]["counts"]


def test_the_thread_touches_no_data_of_blender(road: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """Once read, nothing more of the file is needed: it may be emptied, as by an undo, while the thread is at work."""
    job = job_of_the_panel()
    job.start()
    while job.touches_scene:
        job.tick(0.0)
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.materials, *bpy.data.node_groups])
    wait_for_end(job)
    assert job.error is None
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    bpy.context.scene.synthroads.output = str(tmp_path / "again")
    bpy.ops.synthroads.scan()
    assert (tmp_path / "out" / "cloud.laz").read_bytes() == (tmp_path / "again" / "cloud.laz").read_bytes()


@pytest.mark.parametrize("long", [True, False])
def test_a_long_scan_is_announced_below_its_progress(road: Any, monkeypatch: pytest.MonkeyPatch, long: bool) -> None:  # noqa: F811
    """The number of pulses, size, time and memory, as long as it lasts; of a short one nothing."""
    monkeypatch.setattr(forecast, "LONG", 0.0 if long else 1e9)
    job, shown = job_of_the_panel(), set()
    job.start()
    while job.tick(0.0):
        draw_job(layout := FakeLayout())
        shown |= {line for line in layout.lines if "pulses" in line}
    assert job.error is None
    assert bool(shown) == long
    assert job.notes == []


@pytest.mark.any_blender
def test_a_cancelled_scan_leaves_nothing(road: Any, tmp_path: Path) -> None:  # noqa: F811
    before, counts = digest(), block_counts()
    for ticks in (0, 3, 40):
        job = job_of_the_panel()
        job.start()
        for _ in range(ticks):
            job.tick(0.0)
        job.stop()
        wait_for_end(job)
        assert isinstance(job.error, Cancelled), ticks
        assert job.result is None
        assert not (tmp_path / "out").exists()
        assert block_counts() == counts
        assert digest() == before, ticks


@pytest.mark.any_blender
def test_a_change_while_the_scene_is_read_is_in_the_scan_or_not_but_never_half(road: Any, tmp_path: Path) -> None:  # noqa: F811
    """The user moves an object, whose mesh stays the same, between two steps: reading begins again."""
    axis = bpy.data.objects["Backbone"].data.vertices
    bpy.ops.mesh.primitive_cube_add(size=4.0, location=axis[len(axis) // 2].co)
    box = bpy.context.object
    job = job_of_the_panel()
    job.start()
    job.tick(0.0)
    job.tick(0.0)
    assert job.touches_scene
    box.location.z += 5.0
    bpy.context.view_layer.update()
    wait_for_end(job)
    assert job.error is None
    bpy.context.scene.synthroads.output = str(tmp_path / "again")
    bpy.ops.synthroads.scan()
    assert (tmp_path / "out" / "cloud.laz").read_bytes() == (tmp_path / "again" / "cloud.laz").read_bytes()


def test_undo_while_the_thread_scans_leaves_the_scan_alone(road: Any, tmp_path: Path) -> None:  # noqa: F811
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Delineators"].location.z += 0.5
    bpy.ops.ed.undo_push(message="moved")
    job = job_of_the_panel()
    job.start()
    while job.touches_scene:
        job.tick(0.0)
    bpy.ops.ed.undo()
    assert running_job() is job
    wait_for_end(job)
    assert job.error is None
    assert (tmp_path / "out" / "cloud.laz").exists()


def test_undo_while_the_scene_is_read_gives_the_scan_up(road: Any, tmp_path: Path) -> None:  # noqa: F811
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Delineators"].location.z += 0.5
    bpy.ops.ed.undo_push(message="moved")
    job = job_of_the_panel()
    job.start()
    assert job.touches_scene
    bpy.ops.ed.undo()
    assert isinstance(job.error, Cancelled)
    assert running_job() is None
    assert not (tmp_path / "out").exists()


def test_a_defect_in_the_thread_is_kept_and_leaves_nothing(
    road: Any,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Site, "plan", lambda *arguments: 1 / 0)
    job = job_of_the_panel()
    tick_to_the_end(job)
    assert isinstance(job.error, ZeroDivisionError)
    assert not (tmp_path / "out").exists()


def test_unregistering_stops_a_scan(road: Any, tmp_path: Path) -> None:  # noqa: F811
    job = job_of_the_panel()
    job.start()
    while job.touches_scene:
        job.tick(0.0)
    synthroads_addon.unregister()
    assert running_job() is None
    assert not (tmp_path / "out").exists()
    synthroads_addon.register()
