"""Data sets from the window: the recipe's scenes, resumed after a stop, with pictures, in the panel's words."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.errors import Cancelled
from synthroads_addon.dataset.changes import change_recipe, resize_recipe
from synthroads_addon.dataset.manifest import read_manifest
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.ui.panels import dataset
from synthroads_addon.ui.work.dataset import DatasetWork
from tests.helpers.scenes.fake_layout import drawn

SMALL = ("road.length=40", "road.half_width=20", "vegetation_detail=0.05")


@pytest.fixture
def panel() -> Iterator[Any]:
    """Register the add-on for one test; return the panel's settings of a data set."""
    synthroads_addon.register()
    yield bpy.context.scene.synthroads_dataset
    synthroads_addon.unregister()
    dataset.latest = None


def recipe_file(folder: Path) -> Path:
    path = folder / "Rezept für zwei.json"
    path.write_text(change_recipe(load_recipe("small-roads"), SMALL).to_json(), encoding="utf-8")
    return path


def test_two_scenes_are_made_stopped_and_continued(panel: Any, tmp_path: Path) -> None:
    folder = tmp_path / "Straßen 1"
    panel.recipe, panel.file, panel.scenes, panel.folder = dataset.OWN, str(recipe_file(tmp_path)), 2, str(folder)
    shares: list[float] = []

    def stop_after_one(share: float) -> None:
        shares.append(share)
        if share >= 0.5:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        panel.work().make(stop_after_one)
    assert [scene.status for scene in read_manifest(folder).scenes] == ["done"]
    assert shares[0] == 0.0
    first = (folder / "manifest.json").read_text(encoding="utf-8")
    assert bpy.ops.synthroads.make_dataset() == {"FINISHED"}
    manifest = read_manifest(folder)
    assert manifest.complete
    assert [scene.status for scene in manifest.scenes] == ["done", "done"]
    assert manifest.scenes[0].to_dict() == read_first(first)
    work = dataset.latest
    assert isinstance(work, DatasetWork)
    assert (work.done, work.total, work.failed) == (2, 2, 0)
    assert sorted(work.pictures) == [scene.name for scene in manifest.scenes]
    assert all(path.stat().st_size > 500 for path in work.pictures.values())
    text = "\n".join(drawn(dataset.SYNTHROADS_PT_dataset, bpy.context).lines)
    assert "2 of 2 scenes done" in text
    assert "roads-02" in text


def read_first(text: str) -> Any:
    import json

    return json.loads(text)["scenes"][0]


def test_a_stop_between_scenes_ends_within_a_scene(panel: Any, tmp_path: Path) -> None:
    panel.recipe, panel.scenes, panel.folder = "small-roads", 1, str(tmp_path / "a")
    calls: list[float] = []

    def stop(share: float) -> None:
        calls.append(share)
        if len(calls) == 3:  # the first is told before scenes begin, the others while the scene is made
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        panel.work().make(stop)
    assert calls == [0.0, 0.0, 0.0]
    assert read_manifest(tmp_path / "a").scenes == ()


def test_what_is_missing_is_said_in_the_panels_words(panel: Any, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Folder: choose a folder for the data set"):
        bpy.ops.synthroads.make_dataset()
    panel.folder, panel.recipe = str(tmp_path), dataset.OWN
    with pytest.raises(RuntimeError, match="Recipe File: choose the recipe's file"):
        bpy.ops.synthroads.make_dataset()
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    panel.recipe = "small-roads"
    with pytest.raises(RuntimeError, match=r"Folder.*holds other files"):
        bpy.ops.synthroads.make_dataset()


@pytest.mark.parametrize("scenes", [1, 3, 8, 9, 20])
@pytest.mark.parametrize("name", ["small-roads", "reference"])
def test_scenes_are_divided_as_before(name: str, scenes: int) -> None:
    recipe = load_recipe(name)
    resized = resize_recipe(recipe, scenes)
    assert sum(group.scenes for group in resized.groups) == scenes
    whole = sum(group.scenes for group in recipe.groups)
    before = {group.name: group.scenes for group in recipe.groups}
    assert all(abs(group.scenes - before[group.name] * scenes / whole) < 1.0 for group in resized.groups)
    by_name = {job.name: job for job in scene_jobs(recipe)}
    same = [job for job in scene_jobs(resized) if job.name in by_name]
    assert all(job.scenario == by_name[job.name].scenario for job in same)
    assert resize_recipe(recipe, whole).to_json() == recipe.to_json()
