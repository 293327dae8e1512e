"""Scenes and assets that are cut or flipped: Blender's importers, each file in a process of its own, as some crash."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from tests.blender.scene.opening_server import ANSWER
from tests.fuzz.test_bytes import mesh_file

ROOT = Path(__file__).resolve().parents[3]


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


@pytest.fixture(scope="module")
def opened() -> Iterator[Callable[[Path], str]]:
    """Return what opens a file in a process of its own and says what came of it."""
    command = [sys.executable, "-m", "tests.blender.scene.opening_server"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdin
        assert server.stdout

        def answer(path: Path) -> str:
            server.stdin.write(f"{path}\n")
            server.stdin.flush()
            return next(line[len(ANSWER) :].rstrip("\n") for line in server.stdout if line.startswith(ANSWER))

        yield answer
        server.stdin.close()


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
def test_scenes(opened: Callable[[Path], str], tmp_path: Path, ending: str, count: int) -> None:
    data = export(tmp_path / f"sound{ending}")
    path, rng = tmp_path / f"scene{ending}", np.random.default_rng(7)
    assert opened(tmp_path / f"sound{ending}") == "opened"
    for number in range(count):
        content = broken(data, rng)
        path.write_bytes(content)
        said = opened(path)
        assert said in ("opened", "refused"), f"file {number}: {said}"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="copies the process")
def test_a_face_that_names_no_vertex_does_not_crash_blender(opened: Callable[[Path], str], tmp_path: Path) -> None:
    path = mesh_file(tmp_path / "mesh.ply")
    assert opened(path) == "opened"
    path.write_bytes(path.read_bytes()[:-4] + (1_000_000).to_bytes(4, "little"))
    assert opened(path) == "refused"
