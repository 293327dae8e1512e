"""Saving Blender files."""

from __future__ import annotations

from pathlib import Path

import pytest

from synthroads_addon.blender.files import save_scene


def test_relative_names_are_of_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender asks the environment's PWD, which is another folder where a program has set its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PWD", "/nowhere")
    save_scene(Path("scene.blend"))
    assert (tmp_path / "scene.blend").stat().st_size > 0
