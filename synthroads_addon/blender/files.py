"""Opening and saving Blender files."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, suppress
from itertools import product
from pathlib import Path

import bpy
from mathutils import Matrix

from ..base.errors import OutputError


def empty_file() -> None:
    """Open a new empty Blender file and discard the open one.

    Not `read_factory_settings`: that would also disable the extension that this code may belong to.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def remove_startup_objects() -> None:
    """Remove the cube, the camera and the light that Blender begins with, where it is a Python package.

    A program has no window that shows the cube, which stands in the middle of a road. The objects stay if the file has
    other objects, if the cube was changed, and if the file was opened from a disk.
    """
    objects = bpy.data.objects
    if not bpy.app.module or bpy.data.is_saved or {item.name for item in objects} != {"Cube", "Camera", "Light"}:
        return
    cube = objects["Cube"]
    corners = {tuple(vertex.co) for vertex in cube.data.vertices}
    has_changes = cube.modifiers or "synthroads_class" in cube or cube.matrix_basis != Matrix()
    if corners == set(product((-1.0, 1.0), repeat=3)) and not has_changes:
        bpy.data.batch_remove(list(objects))


def save_scene(path: Path, compress: bool = True) -> None:
    """Save a copy of the open Blender file under a path, overwriting; the open file keeps its name and state.

    Raises:
        OutputError: the file can't be written.
    """
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.absolute()), copy=True, compress=compress, check_existing=False)
    except RuntimeError as error:
        raise OutputError(str(path), None, f"cannot be written ({error_line(error)})") from None


def error_line(error: Exception) -> str:
    """Return a Blender error's message as one line, without "Error:"; of a traceback only its last line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    if any("Traceback" in line for line in lines):
        lines = [line for line in lines if not line.startswith("Location:")][-1:]
    text = " ".join(lines)
    return text.removeprefix("Error:").strip() or type(error).__name__


@contextmanager
def stderr_if_it_succeeds() -> Iterator[None]:
    """Context that holds back standard error and prints it on success; drops it if an error is raised.

    Blender prints the whole traceback of an importer in Python besides raising it.
    """
    try:
        saved_descriptor = os.dup(2)
    except OSError:  # no standard error at all
        yield
        return
    with tempfile.TemporaryFile() as buffer, os.fdopen(saved_descriptor, "wb") as original_stderr:
        buffer_text = io.TextIOWrapper(buffer, encoding="utf-8", errors="backslashreplace", write_through=True)
        os.dup2(buffer.fileno(), 2)
        try:
            with redirect_stderr(buffer_text):  # Python's own, which needn't be the system's standard error
                yield
            buffer.seek(0)
            with suppress(OSError):  # the reader of standard error has gone
                shutil.copyfileobj(buffer, original_stderr)
        finally:
            os.dup2(original_stderr.fileno(), 2)
