"""Files of meshes before Blender reads them: addresses that leave the folder, faces without vertices, pipes."""

from __future__ import annotations

import json
import os
import struct
import sys
from pathlib import Path
from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.scene.mesh_files import check_mesh_file


def document(**changes: Any) -> dict[str, Any]:
    """Return a glTF of one triangle whose buffer is beside it."""
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "part.bin"}],
        **changes,
    }


def write(folder: Path, ending: str = ".gltf", **changes: Any) -> Path:
    path = folder / f"thing{ending}"
    text = json.dumps(document(**changes)).encode()
    if ending == ".glb":
        text += b" " * (-len(text) % 4)
        text = struct.pack("<5I", 0x46546C67, 2, 20 + len(text), len(text), 0x4E4F534A) + text
    path.write_bytes(text)
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (folder := tmp_path / "scene").mkdir()
    (folder / "part.bin").write_bytes(bytes(36))
    (folder / "with space.bin").write_bytes(bytes(36))
    (tmp_path / "outside.bin").write_bytes(bytes(36))
    (folder / "link.bin").symlink_to(tmp_path / "outside.bin")
    (folder / "inside.bin").symlink_to(folder / "part.bin")
    return folder


@pytest.mark.parametrize("ending", [".gltf", ".glb"])
@pytest.mark.parametrize("address", ["part.bin", "./part.bin", "../scene/part.bin", "with%20space.bin", "inside.bin"])
def test_parts_in_the_file_s_folder_are_taken(folder: Path, ending: str, address: str) -> None:
    check_mesh_file(write(folder, ending, buffers=[{"byteLength": 36, "uri": address}]))


@pytest.mark.parametrize("ending", [".gltf", ".glb"])
@pytest.mark.parametrize("part", ["buffers", "images"])
@pytest.mark.parametrize(
    "address",
    [
        "/dev/zero",
        "../outside.bin",
        "..%2Foutside.bin",
        "a\\..\\..\\outside.bin",
        "link.bin",
        "file:///dev/zero",
        "http://x/y",
    ],
)
def test_addresses_that_leave_the_folder_are_refused(folder: Path, ending: str, part: str, address: str) -> None:
    path = write(folder, ending, **{part: [{"byteLength": 36, "uri": address}]})
    with pytest.raises(InputError, match="must stay in the file's folder"):
        check_mesh_file(path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")
@pytest.mark.parametrize("part", ["buffers", "images"])
def test_what_is_no_regular_file_is_refused(folder: Path, part: str) -> None:
    os.mkfifo(folder / "pipe")
    (folder / "below").mkdir()
    for name in ("pipe", "below"):
        path = write(folder, **{part: [{"byteLength": 36, "uri": name}]})
        with pytest.raises(InputError, match="a regular file is needed"):
            check_mesh_file(path)


def test_parts_that_are_missing_or_too_short_are_refused_and_pictures_are_not_needed(folder: Path) -> None:
    with pytest.raises(InputError, match="a regular file is needed"):
        check_mesh_file(write(folder, buffers=[{"byteLength": 36, "uri": "gone.bin"}]))
    with pytest.raises(InputError, match="has 36 bytes of 37"):
        check_mesh_file(write(folder, buffers=[{"byteLength": 37, "uri": "part.bin"}]))
    with pytest.raises(InputError, match="has 3 bytes of 36"):
        check_mesh_file(write(folder, buffers=[{"byteLength": 36, "uri": "data:;base64,AAAA"}]))
    check_mesh_file(write(folder, images=[{"uri": "gone.png"}]))


@pytest.mark.parametrize("levels", [200, 300, 100_000])
def test_nodes_that_lie_too_deep_are_refused(folder: Path, levels: int) -> None:
    path = write(folder, nodes=[*({"children": [n + 1]} for n in range(levels)), {"mesh": 0}])
    if levels == 200:
        check_mesh_file(path)
    else:
        with pytest.raises(InputError, match="more than 256 deep"):
            check_mesh_file(path)


def test_nodes_below_themselves_and_text_nested_without_end_are_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="lies below itself"):
        check_mesh_file(write(folder, nodes=[{"children": [1]}, {"children": [0]}]))
    (folder / "deep.gltf").write_text("[" * 100_000)
    with pytest.raises(InputError, match="nested too deeply"):
        check_mesh_file(folder / "deep.gltf")


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize(("count", "sign"), [("uchar", "B"), ("ushort", "H")])
def test_faces_of_a_binary_ply_name_vertices_that_are_there(tmp_path: Path, order: str, count: str, sign: str) -> None:
    """Faces of three and four corners, whose number is of another type than the corners are."""
    path, end = tmp_path / "thing.ply", {"little": "<", "big": ">"}[order]
    head = f"ply\nformat binary_{order}_endian 1.0\nelement vertex 5\nproperty float x\nelement face 2\n"
    head += f"property list {count} int vertex_indices\nend_header\n"
    for last in (4, 5):
        faces = struct.pack(f"{end}{sign}3i{sign}4i", 3, 0, 1, 2, 4, 0, 1, 3, last)
        path.write_bytes(head.encode() + struct.pack(f"{end}5f", *range(5)) + faces)
        if last == 4:
            check_mesh_file(path)
    with pytest.raises(InputError, match="a face names a vertex that is none of its 5"):
        check_mesh_file(path)
