"""Stages of rendering: nothing of them is left, the memory of their pictures included."""

from __future__ import annotations

import gc
from pathlib import Path

import bpy
import pytest

from synthroads_addon.base.machine import release_memory
from synthroads_addon.blender.cameras.stage import Passes, new_stage
from tests.helpers.process_memory import memory_mb

SIDE = 512
PICTURE = SIDE * SIDE * (4 + 3 + 1) * 4 / 1e6
"""MB of a picture with a colour and a number beside the light."""


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="the system doesn't tell what is resident")
def test_a_stage_leaves_no_picture(tmp_path: Path) -> None:
    """In 5.2 each scene's last picture stays, at the scene's place in memory: here no two have the same."""
    memory = []
    for number in range(12):
        with new_stage(Passes(("base_color", "roughness"), lit=False), tmp_path) as stage:
            stage.render(SIDE, SIDE)
        bpy.data.scenes.new(f"In its place {number}")
        gc.collect()
        release_memory()
        memory.append(memory_mb())
    print([round(held) for held in memory])
    # One picture is sometimes still held, as the buffer of an image.
    assert min(memory[-4:]) < min(memory[:4]) + PICTURE
