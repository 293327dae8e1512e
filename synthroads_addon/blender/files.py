"""Opening and saving Blender files."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..base.errors import OutputError


def empty_file() -> None:
    """Begin a new file with nothing in it; what was open is lost.

    Not `read_factory_settings`: that would also disable the extension that this code may belong to.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def save_scene(path: Path, compress: bool = True) -> None:
    """Save a copy of the open file, compressed if not told otherwise; the open file keeps its own name and state.

    Raises:
        OutputError: it can't be written.
    """
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.absolute()), copy=True, compress=compress, check_existing=False)
    except RuntimeError as error:
        raise OutputError(str(path), None, f"cannot be written ({complaint(error)})") from None


def complaint(error: Exception) -> str:
    """Return what Blender complains of in one line, without its prefix; of a traceback the last line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    text = lines[-1] if any("Traceback" in line for line in lines) else " ".join(lines)
    return text.removeprefix("Error:").strip() or type(error).__name__
