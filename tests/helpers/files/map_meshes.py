"""Small ground meshes whose vertices stand in map coordinates, in the formats that people export."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Float

GRID = np.stack(np.meshgrid(np.arange(0.0, 20.1, 2.5), np.arange(0.0, 10.1, 2.5), indexing="ij"), -1).reshape(-1, 2)
GROUND: Float = np.column_stack([GRID, 0.05 * GRID[:, 0] + 0.02 * GRID[:, 1]]) + 0.123
"""Vertices (45, 3) of a sloping plane, m, z up."""
_COLUMNS = 5
FACES = np.array(
    [
        face
        for i in range(8)
        for j in range(4)
        for a in [i * _COLUMNS + j]
        for face in ((a, a + _COLUMNS, a + _COLUMNS + 1), (a, a + _COLUMNS + 1, a + 1))
    ]
)
PLACES = {
    "UTM": np.array([294_000.0, 5_628_000.0, 180.0]),
    "LV95": np.array([2_600_000.0, 1_200_000.0, 540.0]),
    "Britain": np.array([530_000.0, 180_000.0, 12.0]),
    "Lambert-93": np.array([652_000.0, 6_862_000.0, 35.0]),
}


def write_mesh(path: Path, origin: Float, kind: str) -> Path:
    """Write the ground about a map origin; return the path.

    Args:
        path: the file.
        origin: (3,) map coordinates, m.
        kind: obj, obj y up, ply text, ply double, ply double big, ply float, stl text, stl or glb.
    """
    points = GROUND + origin
    writers = {
        "obj": _obj,
        "obj y up": _obj_y_up,
        "ply text": _ply_text,
        "stl text": _stl_text,
        "stl": _stl,
        "glb": _glb,
    }
    if kind in writers:
        writers[kind](path, points)
    else:
        _ply(path, points, {"ply double": "<f8", "ply double big": ">f8"}.get(kind, "<f4"))
    return path


def _obj(path: Path, points: Float) -> None:
    lines = ["mtllib ground.mtl", "usemtl Earth", *(f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in points.tolist())]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES.tolist()]
    path.write_text("\n".join(lines) + "\n")
    path.with_name("ground.mtl").write_text("newmtl Earth\nKd 0.3 0.2 0.1\n")


def _obj_y_up(path: Path, points: Float) -> None:
    _obj(path, np.column_stack([points[:, 0], points[:, 2], -points[:, 1]]))


def _ply_head(kind: str, word: str) -> bytes:
    lines = ["ply", f"format {kind} 1.0", "comment a ground", f"element vertex {len(GROUND)}"]
    lines += [f"property {word} {axis}" for axis in "xyz"] + [f"element face {len(FACES)}"]
    return "\n".join([*lines, "property list uchar int vertex_indices", "end_header", ""]).encode()


def _ply_text(path: Path, points: Float) -> None:
    rows = [f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in points.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in FACES.tolist()]
    path.write_bytes(_ply_head("ascii", "double") + ("\n".join(rows) + "\n").encode())


def _ply(path: Path, points: Float, kind: str) -> None:
    faces = np.zeros(len(FACES), [("count", "u1"), ("corners", f"{kind[0]}i4", 3)])
    faces["count"], faces["corners"] = 3, FACES
    word, order = "double" if kind[1:] == "f8" else "float", "little" if kind[0] == "<" else "big"
    path.write_bytes(_ply_head(f"binary_{order}_endian", word) + points.astype(kind).tobytes() + faces.tobytes())


def _stl_text(path: Path, points: Float) -> None:
    lines = ["solid ground"]
    for face in FACES:
        corners = "\n".join("vertex {:.4f} {:.4f} {:.4f}".format(*points[corner]) for corner in face)
        lines.append(f"facet normal 0 0 1\nouter loop\n{corners}\nendloop\nendfacet")
    path.write_text("\n".join([*lines, "endsolid ground"]) + "\n")


def _stl(path: Path, points: Float) -> None:
    rows = np.zeros(len(FACES), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    rows["normal"], rows["corners"] = (0.0, 0.0, 1.0), points[FACES]
    path.write_bytes(b"ground".ljust(80) + len(FACES).to_bytes(4, "little") + rows.tobytes())


def _glb(path: Path, points: Float) -> None:
    turned = np.column_stack([points[:, 0], points[:, 2], -points[:, 1]]).astype("<f4")
    faces = FACES.astype("<u2").tobytes()
    blob = turned.tobytes() + faces + b"\0" * (-len(faces) % 4)
    low, high = turned.min(axis=0).tolist(), turned.max(axis=0).tolist()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(turned), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": FACES.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": turned.nbytes},
            {"buffer": 0, "byteOffset": turned.nbytes, "byteLength": len(faces)},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(blob))
    path.write_bytes(
        head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    )
