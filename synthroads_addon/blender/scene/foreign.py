"""Scenes of other programs: opening or importing their files."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import bpy
import mathutils
import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError, MissingFileError
from ...base.scratch.opened_file import being_opened
from ...scanning.scene.map_coordinates import moved_copy, to_scene_axes
from ...scanning.scene.mesh_files import REMEDY, STAY, check_mesh_file, refuse_outside
from ..files import empty_file, error_line, stderr_if_it_succeeds
from ..materials.imported_alpha import mend_imported_alpha
from ..references import check_references
from .usd_trial import INSIDE, OUTSIDE

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
"""Kinds of files that don't declare which axis points up."""

_TRIAL = Path(__file__).with_name("usd_trial.py")
_CRASHING = (".usd", ".usda", ".usdc", ".usdz")
"""Kinds of files whose importer, USD's library, ends the process if they are damaged."""

SUFFIXES = (".blend", *_IMPORTERS)
"""Endings of the files that can be opened."""


def check_scene_file(path: Path, up: UpAxis | None = None) -> None:
    """Raise an error if a file can't be opened as a scene, judged by its path and ending alone.

    Raises:
        MissingFileError: there is no such file.
        InputError: its ending is unknown, or `up` is given although the file declares which axis points up.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError("SCENE", str(path), f"must end in one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise MissingFileError("SCENE", str(path), "is a folder" if path.is_dir() else "no such file")
    if up is not None and suffix not in _WITH_AXES:
        raise InputError(
            "--up",
            up,
            f"must be left out: a {suffix} file says itself which axis points up, unlike {', '.join(_WITH_AXES)}",
        )


def open_scene(path: Path, up: UpAxis | None = None, to_origin: bool = False, also_from: Sequence[Path] = ()) -> Float:
    """Open a .blend file, or import another format into a new empty file, discarding the open one.

    Scripts in a .blend aren't run; files that it refers to are read from anywhere, as in Blender. Files that a file of
    another format refers to must be in its folder.

    Args:
        path: the file.
        up: the axis that points up in an .obj, .ply or .stl; the usual one of its kind if None (y, z, z).
        to_origin: whether to move a scene in map coordinates to the origin before Blender reads it, if the file has
            more than single precision.
        also_from: further folders from which files may be read that the file refers to.

    Returns:
        the shift (3,) that was subtracted from the file's coordinates, m, in the scene's axes.

    Raises:
        InputError: see `check_scene_file`; or Blender can't read the file, or it refers to a file elsewhere.
    """
    check_scene_file(path, up)
    suffix = path.suffix.lower()
    # Absolute: Blender takes a leading "//" for the folder of the open file.
    absolute_path = str(path.resolve())
    try:
        if suffix == ".blend":
            with being_opened(path):
                bpy.ops.wm.open_mainfile(filepath=absolute_path, load_ui=False, use_scripts=False)
            return np.zeros(3)
        check_mesh_file(path, also_from)
        if to_origin and suffix in _WITH_AXES:
            with TemporaryDirectory() as folder:
                moved_file, shift = moved_copy(path, Path(folder))
                if moved_file != path:
                    open_scene(moved_file, up, also_from=(path.resolve().parent, *also_from))
                    return to_scene_axes(shift, suffix, up)
        module, name = _IMPORTERS[suffix]
        folders = (path.parent, *also_from)
        if suffix in _CRASHING:
            _try_in_a_process(path, f"{module}.{name}", folders)
        empty_file()
        options: dict[str, Any] = dict(_AXES[up]) if up else {}
        with being_opened(path), stderr_if_it_succeeds():
            getattr(getattr(bpy.ops, module), name)(filepath=absolute_path, **options)
        check_references(path, folders, REMEDY)
        mend_imported_alpha(path, bpy.data.materials)
        for item in bpy.data.objects:
            # Files have one state of visibility: importers set the viewport's, for example of an FBX's hidden parts.
            item.hide_render |= item.hide_viewport or item.hide_get()
    except (AttributeError, RuntimeError) as error:
        raise InputError("SCENE", str(path), f"can't be read by Blender: {error_line(error)}") from None
    return np.zeros(3)


def move_scene(shift: Float) -> None:
    """Move the open scene by a vector (3,) in its units: each object without a parent, with its children."""
    for item in bpy.context.scene.objects:
        if item.parent is None:
            item.matrix_world.translation += mathutils.Vector(shift.tolist())
    bpy.context.view_layer.update()


def _try_in_a_process(path: Path, importer: str, folders: Sequence[Path]) -> None:
    """Import a USD file in a separate process as a trial, see `usd_trial`.

    Args:
        path: the file.
        importer: name of Blender's operator.
        folders: folders from which files may be read.

    Raises:
        InputError: the process crashes, or the file or one of its layers refers to a file elsewhere.
    """
    script_globals = {
        "PATH": str(path.resolve()),
        "IMPORTER": importer,
        "FOLDERS": [str(folder.resolve()) for folder in folders],
    }
    code = f"import bpy, runpy; runpy.run_path({str(_TRIAL)!r}, {script_globals!r}, '__main__')"
    blender = bpy.app.binary_path  # empty where Blender is a Python package
    blender_command = [blender, "--background", "--factory-startup", "--python-expr", code]
    command = blender_command if blender else [sys.executable, "-c", code]
    process = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if not 0 <= process.returncode < 256:  # other failures are reported when the file is imported here
        raise InputError(
            "SCENE", str(path), "can't be read by Blender: the file is damaged, and makes the importer crash"
        )
    lines = process.stdout.decode(errors="replace").splitlines()
    for line in lines:
        if line.startswith(OUTSIDE):
            layer, address = json.loads(line.removeprefix(OUTSIDE))
            refuse_outside(Path(layer.partition("[")[0]), address.replace("<UDIM>", "1001"), folders, REMEDY)
            raise InputError(layer, address, f"{STAY}: {REMEDY}")
    if INSIDE not in lines:
        text = (
            "can't be searched for files that it refers to: the file is damaged, or this Blender lacks the module pxr"
        )
        raise InputError("SCENE", str(path), text)


def open_scene_warnings() -> list[str]:
    """Return warnings about missing linked files of the open scene, as sentences."""
    return [
        f"the linked file {library.filepath} is missing: its objects are not scanned"
        for library in bpy.data.libraries
        if not Path(bpy.path.abspath(library.filepath)).is_file()
    ]
