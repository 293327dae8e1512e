"""Saving Blender files."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from synthroads_addon.blender.files import remove_startup_objects, save_scene
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario


def test_relative_names_are_of_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender asks the environment's PWD, which is another folder where a program has set its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PWD", "/nowhere")
    save_scene(Path("scene.blend"))
    assert (tmp_path / "scene.blend").stat().st_size > 0


@pytest.mark.any_blender
def test_the_file_of_a_road_is_small(tmp_path: Path) -> None:
    """It holds what modifiers make the surfaces of, and not these: a kilometre would be hundreds of megabytes."""
    build_road(BuildRequest(sample_road(RoadScenario(length=150.0), 1), 0.005))
    save_scene(tmp_path / "scene.blend")
    megabytes = (tmp_path / "scene.blend").stat().st_size / 1e6
    print(f"{megabytes:.2f} MB")
    assert megabytes < 5.0


@pytest.mark.any_blender
@pytest.mark.parametrize("change", ["none", "moved", "named", "reshaped", "modified", "beside", "saved"])
def test_only_the_cube_that_nobody_made_is_removed(change: str, tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    cube = bpy.data.objects["Cube"]
    if change == "moved":
        cube.location.x = 5.0
    elif change == "named":
        cube["synthroads_class"] = "pole"
    elif change == "reshaped":
        cube.data.vertices[0].co.x = 2.0
    elif change == "modified":
        cube.modifiers.new("Rounded", "BEVEL")
    elif change == "beside":
        bpy.data.objects.new("Mine", None)
    elif change == "saved":
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "mine.blend"))
    before = {item.name for item in bpy.data.objects}
    remove_startup_objects()
    assert {item.name for item in bpy.data.objects} == (set() if change == "none" else before)
