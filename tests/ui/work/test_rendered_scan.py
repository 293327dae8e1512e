"""A scan from the panel that renders, in a Blender of its own: the library's bytes, one line of error, nothing left."""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import bpy
import pytest

from synthroads_addon.base.errors import Cancelled, InputError
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.jobs.generate import Job as PipelineJob
from synthroads_addon.jobs.generate import generate
from synthroads_addon.jobs.job_files import FILES
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.ui.fields.fields import checkbox_path
from synthroads_addon.ui.work import rendered_scan, scan
from synthroads_addon.ui.work.job import PanelJob
from synthroads_addon.ui.work.rendered_scan import MARK, SavedScene, _Messages
from synthroads_addon.ui.work.scan import scan_work
from synthroads_addon.ui.work.scan_steps import Written
from tests.helpers.scenes.panel_road import (  # noqa: F401
    SAME,
    block_counts,
    cheap,
    choose,
    road,
    road_file,
    settings,
    wait_for_end,
)
from tests.helpers.scenes.scene_hash import lines

COARSE = {"colour.image_spacing": 60.0, "colour.ground_sampling_distance": 1.0}
# Ticking a field fills in its usual value: it is ticked first.
RENDERED = {"colour.source": "images"} | dict.fromkeys(map(checkbox_path, COARSE), True) | COARSE
NO_PICTURES = RENDERED | {"outputs": {"cloud"}}
WRITTEN = sorted([n for o in ("parameters", "cloud", "centerline", "previews") for n in FILES[o]] + ["report.json"])


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """The processes that a test has started."""
    found: list[subprocess.Popen[bytes]] = []

    class Noted(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            found.append(self)

    monkeypatch.setattr(rendered_scan.subprocess, "Popen", Noted)
    return found


def content() -> list[str]:
    """Return what the open file holds, but for the counts of users: Blender 5.2 counts some twice when it saves."""
    return [line for line in lines() if ".users = " not in line]


def job_of_the_panel() -> PanelJob[Written]:
    return PanelJob("Scan", scan_work(scan.requested_scan(bpy.context)))


@pytest.mark.slow
def test_what_is_rendered_is_the_librarys(cheap: Any, tmp_path: Path) -> None:  # noqa: F811
    choose(cheap, **RENDERED, output=str(tmp_path / "panel"))
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    state, counts, name = content(), block_counts(), bpy.data.filepath
    shares = []
    job = job_of_the_panel()
    job.start()
    while job.tick(0.0):
        shares.append(job.share)
        time.sleep(0.002)
    assert job.error is None
    assert (content(), block_counts(), bpy.data.filepath) == (state, counts, name)
    assert sorted(path.name for path in (tmp_path / "panel").iterdir()) == WRITTEN
    assert shares == sorted(shares)
    assert any(0.1 < share < 1.0 for share in shares)
    changes = [*SAME, *(f"{path}={value}" for path, value in COARSE.items()), "colour.source=images"]
    report = generate(PipelineJob(load_scenario("rq31-600m", changes), tmp_path / "library", new_file=True))
    for name in set(WRITTEN) - {"report.json"}:
        assert (tmp_path / "panel" / name).read_bytes() == (tmp_path / "library" / name).read_bytes(), name
    written = json.loads((tmp_path / "panel" / "report.json").read_text())
    assert written["counts"] == json.loads(json.dumps(report["counts"]))
    assert written["counts"]["rendered"]["images"] > 0
    assert {"scene copy", "images", "scan"} <= written["stages"].keys()


@pytest.mark.any_blender
def test_nothing_is_rendered_where_no_colour_is_wanted(road: Any, started: list[Any]) -> None:  # noqa: F811
    choose(road, **{"colour.source": "images", "colour.rgb": False, "outputs": {"cloud"}})
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    assert not started


def test_the_scene_that_the_window_shows_is_scanned_as_it_is_now(road: Any, tmp_path: Path) -> None:  # noqa: F811
    """Unsaved changes count, in the view layer at hand; the file stays unsaved and its own."""
    choose(road, **NO_PICTURES)
    name, saved = bpy.data.filepath, Path(bpy.data.filepath).read_bytes()
    shown = len(scene_mesh().triangles)
    layer = bpy.context.scene.view_layers.new("Less")
    bpy.context.window.view_layer = layer
    posts, apart = bpy.data.objects["Delineators"], bpy.data.collections.new("Apart")
    bpy.context.scene.collection.children.link(apart)
    for collection in posts.users_collection:
        collection.objects.unlink(posts)
    apart.objects.link(posts)
    layer.layer_collection.children["Apart"].exclude = True
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    scanned = json.loads((tmp_path / "out" / "report.json").read_text())["counts"]["triangles"]
    assert scanned == len(scene_mesh().triangles) < shown
    assert (bpy.data.filepath, Path(name).read_bytes()) == (name, saved)


@pytest.mark.parametrize("when", ["begin", pytest.param("later", marks=pytest.mark.any_blender)])
def test_a_cancelled_scan_leaves_nothing_and_no_process(
    road: Any,  # noqa: F811
    tmp_path: Path,
    started: list[subprocess.Popen[bytes]],
    when: str,
) -> None:
    choose(road, **NO_PICTURES)
    job = job_of_the_panel()
    job.start()
    while not started or (when == "later" and job.share < 0.2):
        assert job.tick(0.0)
        time.sleep(0.002)
    job.stop()
    wait_for_end(job)
    assert isinstance(job.error, Cancelled)
    assert started[0].returncode not in (None, 0), "it is killed, not waited for"
    assert not (tmp_path / "out").exists()


@pytest.mark.any_blender
def test_its_error_is_one_line(road: Any, tmp_path: Path) -> None:  # noqa: F811
    choose(road, **NO_PICTURES)
    bpy.context.view_layer.layer_collection.children["SynthRoads"].exclude = True
    with pytest.raises(RuntimeError, match="Scene: nothing that could be scanned is visible") as caught:
        bpy.ops.synthroads.scan()
    assert "Traceback" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_blender_that_is_missing_dies_or_fails_is_reported(tmp_path: Path) -> None:
    def outcome(*command: str) -> SavedScene:
        (tmp_path / "place").mkdir()
        return SavedScene(tmp_path / "place", command)

    with pytest.raises(InputError, match="Blender is '/no/blender': can't be started in the background"):
        outcome("/no/blender").scan(lambda share: None)
    with pytest.raises(InputError, match="ended by signal 9"):
        outcome("sh", "-c", "kill -9 $$").scan(lambda share: None)
    with pytest.raises(RuntimeError, match="exit code 3: what went wrong"):
        outcome("sh", "-c", "echo what went wrong >&2; exit 3").scan(lambda share: None)
    assert not (tmp_path / "place").exists()


@pytest.mark.any_blender
def test_the_other_blender_ends_with_this_one(road: Any, tmp_path: Path) -> None:  # noqa: F811
    choose(road, **NO_PICTURES)
    asked = scan.requested_scan(bpy.context)
    (tmp_path / "files").mkdir()
    saved = rendered_scan.save_open_scene(
        asked.scenario, tmp_path / "files", {"parameters": asked.edited.parameters.to_dict(), "road": asked.road_id}
    )
    process = subprocess.Popen(saved.command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stdin
    process.stdin.close()
    assert process.wait(60.0) == 130


def test_what_it_says_is_read_however_it_comes_in() -> None:
    told = _Messages()
    for part in ("Fra:1 Mem", f'ory\nunfinished{MARK}{{"sha', 're": 0.5}\n', f"{MARK}", '{"share": 0.75', "}"):
        told.update(part)
    assert told.share == 0.5
    told.update(os.linesep)
    assert told.share == 0.75
