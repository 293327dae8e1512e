"""Saving Blender files."""

from __future__ import annotations

from pathlib import Path

import bpy


def save_scene(path: Path) -> None:
    """Save a compressed copy of the open file; the open file keeps its own name and state."""
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=True, check_existing=False)
