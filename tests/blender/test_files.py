"""Saving Blender files."""

from __future__ import annotations

from pathlib import Path

import pytest

from synthroads_addon.blender.files import save_scene
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
