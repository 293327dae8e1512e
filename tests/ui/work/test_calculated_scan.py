"""A scan from the panel whose colours the window's thread works out in turns: the command's bytes, and no process."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import bpy
import pytest

from synthroads_addon.base.errors import Cancelled
from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA
from synthroads_addon.blender.cameras.snapshot import SnapshotCalculator
from synthroads_addon.jobs.generate import Job as PipelineJob
from synthroads_addon.jobs.generate import generate
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.ui.work import rendered_scan, scan, scene_scan
from synthroads_addon.ui.work.job import PanelJob
from synthroads_addon.ui.work.scan import scan_work
from synthroads_addon.ui.work.scan_steps import Written
from synthroads_addon.ui.work.scene_scan import visible_scan_work
from tests.helpers.scenes.checkered_scene import build_checkered_scene
from tests.helpers.scenes.panel_road import SAME, block_counts, cheap, choose, settings, wait_for_end  # noqa: F401
from tests.helpers.scenes.scene_hash import digest

PLACE = (15.0, -9.0, 7.0)
CHEAP = {
    "scan.own_lines_per_second": True,
    "scan.lines_per_second": 40.0,
    "scan.platform.kind": "tripod",
    "scan.platform.turn_seconds": 2.0,
    "colour.source": "auto",
    "outputs": {"cloud"},
}


@pytest.fixture(autouse=True)
def no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the start of a process be an error."""

    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("a process is started")

    monkeypatch.setattr(rendered_scan.subprocess, "Popen", refuse)


@pytest.fixture
def boards(settings: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: F811
    """Boards with checkers by maps and by attribute, and a scanner above them; many turns even for few points."""
    monkeypatch.setattr(SnapshotCalculator, "at_once", 3000)
    build_checkered_scene(tmp_path)
    _set_up(settings, tmp_path)
    return settings


def _set_up(settings: Any, folder: Path) -> None:  # noqa: F811
    choose(settings, **CHEAP)
    settings.output = str(folder / "out")
    eye = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    eye.location = PLACE
    bpy.context.scene.collection.objects.link(eye)
    bpy.context.scene.synthroads_scene_scan.guide = eye
    bpy.context.view_layer.update()


def job_of_the_panel() -> PanelJob[Written]:
    return PanelJob("Scan", visible_scan_work(scan.requested_visible_scan(bpy.context)))


def cloud(folder: Path) -> bytes:
    return (folder / "cloud.laz").read_bytes()


@pytest.mark.parametrize("suffix", [".blend", ".glb"])
def test_the_panels_colours_are_the_commands(boards: Any, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"scene{suffix}"
    if suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    else:
        bpy.ops.export_scene.gltf(filepath=str(path))
        bpy.data.batch_remove(bpy.data.objects)
        bpy.ops.import_scene.gltf(filepath=str(path))
        _set_up(boards, tmp_path)
    state, counts, busy = digest(), block_counts(), 0
    job = job_of_the_panel()
    scenario = scan.requested_visible_scan(bpy.context).scenario
    job.start()
    while job.tick(0.0):
        assert block_counts() == counts or job.touches_scene
        busy += 0.1 < job.share < 1.0
        time.sleep(0.002)
    assert job.error is None
    assert (digest(), block_counts()) == (state, counts)
    assert busy > 3
    report = scan_scene(SceneScan(scenario, tmp_path / "command", path, tripods=(PLACE,)))
    assert cloud(tmp_path / "out") == cloud(tmp_path / "command")
    written = json.loads((tmp_path / "out" / "report.json").read_text())
    assert written["counts"] == json.loads(json.dumps(report["counts"]))
    assert written["counts"]["points_by_colour_source"] == {"nodes": 1.0}


def test_what_the_user_changes_meanwhile_is_not_in_the_scan(boards: Any, tmp_path: Path) -> None:
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    boards.output = str(tmp_path / "again")
    job = job_of_the_panel()
    job.start()
    while job.touches_scene:
        job.tick(0.0)
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.materials])
    wait_for_end(job)
    assert job.error is None
    assert cloud(tmp_path / "out") == cloud(tmp_path / "again")


@pytest.mark.parametrize("kernels", ["auto", "off"])
def test_an_image_that_is_gone_ends_the_scan_if_cycles_shows_it(boards: Any, tmp_path: Path, kernels: str) -> None:
    choose(boards, **{"scan.kernels": kernels})
    job = job_of_the_panel()
    job.start()
    while job.touches_scene:
        job.tick(0.0)
    bpy.data.images.remove(bpy.data.images["Fields"])
    wait_for_end(job)
    if kernels == "auto":
        assert job.error is None
        assert (tmp_path / "out" / "cloud.laz").exists()
        return
    assert "image of its material" in str(job.error)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("wait", [False, True])
def test_a_cancelled_scan_leaves_nothing(boards: Any, tmp_path: Path, wait: bool) -> None:
    state, counts = digest(), block_counts()
    for shares in (0.0, 0.1, 0.12):
        job = job_of_the_panel()
        job.start()
        while job.share < shares:
            assert job.tick(0.0)
        job.stop(wait)
        wait_for_end(job)
        assert isinstance(job.error, Cancelled)
        assert not (tmp_path / "out").exists()
        assert (digest(), block_counts()) == (state, counts)


def test_what_cant_be_worked_out_is_left_to_another_blender(boards: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that renders a pixel per return; where none can, such a material has its mean."""
    item = bpy.data.materials["Turned"]
    shader = next(node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    edge = item.node_tree.nodes.new("ShaderNodeAmbientOcclusion")
    item.node_tree.links.new(edge.outputs["Color"], shader.inputs["Base Color"])
    asked: list[str] = []

    def save(*_: Any) -> None:
        asked.append("saved")
        raise InterruptedError

    monkeypatch.setattr(scene_scan, "save_open_scene", save)
    job = job_of_the_panel()
    if HAS_RETURN_CAMERA:
        with pytest.raises(InterruptedError):
            job.run()
        assert asked == ["saved"]
    else:
        assert job.run().points > 0


@pytest.mark.slow
def test_a_roads_colours_are_the_librarys(cheap: Any, tmp_path: Path) -> None:  # noqa: F811
    choose(cheap, **{"colour.source": "auto"}, output=str(tmp_path / "panel"))
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    job = PanelJob("Scan", scan_work(scan.requested_scan(bpy.context)))
    job.start()
    wait_for_end(job)
    assert job.error is None
    report = generate(
        PipelineJob(load_scenario("rq31-600m", [*SAME, "colour.source=auto"]), tmp_path / "library", new_file=True)
    )
    for path in (tmp_path / "panel").iterdir():
        if path.name != "report.json":
            assert path.read_bytes() == (tmp_path / "library" / path.name).read_bytes(), path.name
    written = json.loads((tmp_path / "panel" / "report.json").read_text())
    assert written["counts"] == json.loads(json.dumps(report["counts"]))
