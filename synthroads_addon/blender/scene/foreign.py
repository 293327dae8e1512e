"""Scenes that others made: opening or importing their files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import bpy

from ...base.errors import InputError, MissingFileError
from ...scanning.scene.mesh_files import check_mesh_file
from ..files import empty_file, error_line, stderr_if_it_succeeds

UpAxis = Literal["y", "z"]

_IMPORTERS: dict[str, tuple[str, str]] = {
    ".glb": ("import_scene", "gltf"),
    ".gltf": ("import_scene", "gltf"),
    ".obj": ("wm", "obj_import"),
    ".ply": ("wm", "ply_import"),
    ".stl": ("wm", "stl_import"),
    ".fbx": ("wm", "fbx_import"),
    ".usd": ("wm", "usd_import"),
    ".usda": ("wm", "usd_import"),
    ".usdc": ("wm", "usd_import"),
    ".usdz": ("wm", "usd_import"),
}
_AXES = {"y": {"up_axis": "Y", "forward_axis": "NEGATIVE_Z"}, "z": {"up_axis": "Z", "forward_axis": "Y"}}
_WITH_AXES = (".obj", ".ply", ".stl")
"""Kinds of files that don't say which axis points up."""

_CRASHING = (".usd", ".usda", ".usdc", ".usdz")
"""Kinds of files whose importer, USD's library, ends the process where they are damaged."""

SUFFIXES = (".blend", *_IMPORTERS)
"""Endings of the files that can be opened."""


def check_scene_file(path: Path, up: UpAxis | None = None) -> None:
    """Raise an error if a file can't be opened as a scene, judged by its path and ending alone.

    Raises:
        MissingFileError: there is no such file.
        InputError: its ending is unknown, or it says itself which axis points up.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError("SCENE", str(path), f"must end in one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise MissingFileError("SCENE", str(path), "is a folder" if path.is_dir() else "no such file")
    if up is not None and suffix not in _WITH_AXES:
        raise InputError("--up", up, f"only for {', '.join(_WITH_AXES)}: a {suffix} file says itself what is up")


def open_scene(path: Path, up: UpAxis | None = None) -> None:
    """Open a .blend file, or import another format into a new empty file, discarding the open one.

    Scripts in a .blend aren't run.

    Args:
        path: the file.
        up: the axis that points up in an .obj, .ply or .stl; what is usual for its kind if None (y, z, z).

    Raises:
        InputError: see `check_scene_file`; or Blender can't read it.
    """
    check_scene_file(path, up)
    suffix = path.suffix.lower()
    # Blender takes "//" for the folder of the open file, and everything else relative to the working directory.
    place = str(path.resolve())
    try:
        if suffix == ".blend":
            bpy.ops.wm.open_mainfile(filepath=place, load_ui=False, use_scripts=False)
            return
        check_mesh_file(path)
        module, name = _IMPORTERS[suffix]
        if suffix in _CRASHING:
            _try_in_a_process(path, f"{module}.{name}")
        empty_file()
        options: dict[str, Any] = dict(_AXES[up]) if up else {}
        with stderr_if_it_succeeds():
            getattr(getattr(bpy.ops, module), name)(filepath=place, **options)
    except (AttributeError, RuntimeError) as error:
        raise InputError("SCENE", str(path), f"can't be read by Blender: {error_line(error)}") from None


def _try_in_a_process(path: Path, importer: str) -> None:
    """Import a file in a separate process as a trial; raise `InputError` if that process crashes.

    Args:
        path: the file.
        importer: name of Blender's operator.
    """
    code = f"import bpy; bpy.ops.{importer}(filepath={str(path.resolve())!r})"
    blender = bpy.app.binary_path  # none where Blender is a Python package
    inside = [blender, "--background", "--factory-startup", "--python-expr", code]
    alone = inside if blender else [sys.executable, "-c", code]
    done = subprocess.run(alone, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if not 0 <= done.returncode < 256:  # what went wrong in an orderly way is told when it does so here
        raise InputError("SCENE", str(path), "can't be read by Blender: it is damaged so that its importer crashes")


def open_scene_warnings() -> list[str]:
    """Return warnings about missing linked files and a unit scale other than 1 m in the open scene, as sentences."""
    warnings = [
        f"the linked file {library.filepath} is missing: what it holds is not scanned"
        for library in bpy.data.libraries
        if not Path(bpy.path.abspath(library.filepath)).is_file()
    ]
    units = bpy.context.scene.unit_settings
    scale = units.scale_length
    if units.system != "NONE" and abs(scale - 1.0) > 1e-6:
        warnings.append(f"the scene's unit scale is {scale:g}: it is scanned as if a unit were 1 m")
    return warnings
