"""Scenes and assets that are cut or flipped: Blender's importers, each file in a process of its own, as some crash."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.scene.foreign import open_scene
from tests.fuzz.test_bytes import mesh_file

PEAK_MB = 1500
SECONDS = 20


def export(path: Path) -> bytes:
    """Return a file of a cube with a material."""
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    bpy.context.object.data.materials.append(bpy.data.materials.new("M"))
    if path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=False)
    elif path.suffix in (".glb", ".gltf"):
        kind = "GLB" if path.suffix == ".glb" else "GLTF_SEPARATE"
        bpy.ops.export_scene.gltf(filepath=str(path), export_format=kind)
    else:
        names = {".obj": "obj_export", ".ply": "ply_export", ".stl": "stl_export", ".usdc": "usd_export"}
        getattr(bpy.ops.wm, names[path.suffix])(filepath=str(path))
    return path.read_bytes()


def in_a_process(path: Path) -> str:
    """Open a file in a copy of this process; return what came of it."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        try:
            open_scene(path)
            said = "opened"
        except InputError as error:
            said = "refused" if str(error).isprintable() else f"not one line: {error!r}"
        except BaseException as error:
            said = f"{type(error).__name__}: {error}"
        if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3 > PEAK_MB:
            said = "took too much memory"
        os.write(write, said[:500].encode())
        os._exit(0)
    os.close(write)
    said = os.read(read, 1000).decode()
    os.close(read)
    _, status = os.waitpid(child, 0)
    return said if status == 0 else f"ended by {status}"


def broken(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a file that is cut, or of which up to five bytes are flipped, half of them near its start."""
    if rng.random() < 0.25:
        return data[: rng.integers(len(data))]
    flipped = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5])):
        at = rng.integers(min(600, len(data)) if rng.random() < 0.5 else len(data))
        flipped[at] ^= int(rng.choice([1, 0x80, 0xFF, 0x10]))
    return bytes(flipped)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="copies the process")
@pytest.mark.parametrize(
    ("ending", "count"),
    [
        (".glb", 3),
        (".ply", 3),
        (".stl", 3),
        pytest.param(".glb", 300, marks=pytest.mark.fuzz),
        pytest.param(".ply", 300, marks=pytest.mark.fuzz),
        pytest.param(".stl", 300, marks=pytest.mark.fuzz),
        pytest.param(".gltf", 300, marks=pytest.mark.fuzz),
        pytest.param(".obj", 200, marks=pytest.mark.fuzz),
        pytest.param(".blend", 200, marks=pytest.mark.fuzz),
        pytest.param(".usdc", 40, marks=pytest.mark.fuzz),
    ],
)
def test_scenes(tmp_path: Path, ending: str, count: int) -> None:
    data = export(tmp_path / f"sound{ending}")
    path, rng = tmp_path / f"scene{ending}", np.random.default_rng(7)
    assert in_a_process(tmp_path / f"sound{ending}") == "opened"
    for number in range(count):
        content = broken(data, rng)
        path.write_bytes(content)
        said = in_a_process(path)
        assert said in ("opened", "refused"), f"file {number}: {said}"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="copies the process")
def test_a_face_that_names_no_vertex_does_not_crash_blender(tmp_path: Path) -> None:
    path = mesh_file(tmp_path / "mesh.ply")
    assert in_a_process(path) == "opened"
    path.write_bytes(path.read_bytes()[:-4] + (1_000_000).to_bytes(4, "little"))
    assert in_a_process(path) == "refused"
