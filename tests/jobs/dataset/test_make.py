"""Data sets made from Python: what is asked for is checked first, and scenes have processes of their own."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import pytest

from synthroads_addon import Cluster, make_dataset
from synthroads_addon.base.errors import InputError
from synthroads_addon.dataset.manifest import read_manifest
from synthroads_addon.dataset.recipe import Recipe
from synthroads_addon.jobs.dataset import processes
from synthroads_addon.jobs.dataset.scene_files import FAILED, TASK

SCENE = {"fidelity": "draft", "road.length": 30, "road.half_width": 20, "colour.source": "material"}
SCENE |= {"scan.lines_per_second": 20, "scan.platform.lateral_offsets": [5]}


def recipe(scenes: int = 1) -> Recipe:
    groups = [{"name": "a", "scenes": scenes, "set": SCENE, "split": {"train": scenes}}]
    return Recipe.from_dict({"title": "small", "groups": groups})


def test_a_scene_is_made_from_any_folder_whatever_lies_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("synthroads_addon", "numpy", "bpy"):
        (tmp_path / "here" / name).mkdir(parents=True)
        (tmp_path / "here" / name / "__init__.py").write_text("raise RuntimeError('taken for another')\n")
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    shares: list[float] = []
    manifest = make_dataset(recipe(), Path("set"), progress=lambda stage, share: shares.append(share))
    (scene,) = manifest.scenes
    assert (scene.status, scene.error) == ("done", None)
    assert manifest.complete
    assert scene.points
    assert shares == [0.0, 1.0]
    assert (tmp_path / "here" / "set" / "scenes" / scene.name / "cloud.laz").is_file()
    assert make_dataset(recipe(), Path("set"), resume=True) == read_manifest(Path("set")) == manifest


def test_a_scene_that_fails_stands_in_the_manifest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    seeds: list[Any] = []

    def failing(folder: Path, threads: int, stopping: Any) -> int:
        seeds.append(json.loads((folder / TASK).read_text())["scenario"]["cloud"]["classes"])
        (folder / "log.txt").touch()
        (folder / FAILED).write_text(json.dumps({"error": "no road fits"}))
        return 2

    monkeypatch.setattr(processes, "_run_process", failing)
    caplog.set_level(logging.ERROR, "synthroads")
    manifest = make_dataset(recipe(3), tmp_path / "set", jobs=2, changes=["cloud.classes=5"])
    assert [(scene.name, scene.status, scene.error) for scene in manifest.scenes] == [
        (f"a-0{number}", "failed", "no road fits") for number in (1, 2, 3)
    ]
    assert not manifest.complete
    assert seeds == ["5"] * 3, "the changes come last"
    assert {record.getMessage() for record in caplog.records} == {f"failed: a-0{n}: no road fits" for n in (1, 2, 3)}


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"jobs": 0}, "--jobs is 0: must be 1 to 1024"),
        ({"jobs": 1025}, "--jobs is 1025"),
        ({"resume": True, "overwrite": True}, "can't be given with --resume, which keeps existing scenes"),
        ({"splits": ["no-such"]}, "--splits is 'no-such': must be splits of the recipe: train"),
        ({"changes": ["no.such=1"]}, "unknown key"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_touched(asked: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        make_dataset(recipe(), tmp_path / "set", **asked)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("seconds", [0.5, 1e9, float("nan")])
def test_the_patience_with_a_cluster_has_limits(seconds: float) -> None:
    with pytest.raises(InputError, match=r"--worker-timeout is .*must be 1 s or more"):
        Cluster("tcp://here:1", seconds)
