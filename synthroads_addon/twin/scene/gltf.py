"""glTF 2.0, binary (.glb): a node for each object with its labels as extras, meshes shared by their places.

Axes are glTF's: y up; the root node turns the scene, in which z is up, to them. Faces have no normals: readers shade
them flat, as the format says. Source: Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float
from .labelled import LabelledPart, LabelledScene

_FLOAT, _UINT, _USHORT = 5126, 5125, 5123
_ARRAY, _INDICES = 34962, 34963
"""Targets of buffer views: attributes of vertices, and indices."""
_MOST_SHORT = 65_535
"""Vertices from which on indices have 32 bits: 65535 itself is kept for restarts."""
Z_UP_TO_Y_UP = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""Matrix of the root node, column by column: x, y, z become x, z, -y."""


class _Buffer:
    """Binary content of a file, with its views and accessors."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def vertices(self, places: AnyArray) -> int:
        """Return the accessor of vertices (V, 3), which are added."""
        data = np.ascontiguousarray(places, "<f4")
        bounds = {"min": data.min(axis=0).tolist(), "max": data.max(axis=0).tolist()}
        return self._add(data, _FLOAT, "VEC3", len(data), _ARRAY, bounds)

    def indices(self, triangles: AnyArray, vertex_count: int) -> int:
        """Return the accessor of triangles (T, 3), which are added."""
        is_short = vertex_count <= _MOST_SHORT
        data = np.ascontiguousarray(triangles.ravel(), "<u2" if is_short else "<u4")
        return self._add(data, _USHORT if is_short else _UINT, "SCALAR", len(data), _INDICES)

    def _add(
        self, data: AnyArray, kind: int, shape: str, count: int, target: int, more: dict[str, Any] | None = None
    ) -> int:
        """Return the accessor of data, which are added on a boundary of four bytes."""
        content = data.tobytes()
        view = {"buffer": 0, "byteOffset": self.size, "byteLength": len(content), "target": target}
        self.views.append(view)
        padded = content + bytes(-len(content) % 4)
        self._chunks.append(padded)
        self.size += len(padded)
        accessor = {"bufferView": len(self.views) - 1, "componentType": kind, "count": count, "type": shape}
        self.accessors.append(accessor | (more or {}))
        return len(self.accessors) - 1

    def content(self) -> bytes:
        """Return all bytes."""
        return b"".join(self._chunks)


def write_glb(scene: LabelledScene, path: Path) -> None:
    """Write a scene as binary glTF."""
    buffer = _Buffer()
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    roots: list[int] = []
    for mesh in scene.meshes:
        parts = list(mesh.parts())
        for part in parts:
            meshes.append(_mesh(buffer, mesh.name, part))
            for matrix, number in zip(mesh.matrices, mesh.numbers.tolist(), strict=True):
                instance = number if part.instance is None else part.instance
                labels = scene.properties(part.class_id, instance, part.vertices, matrix)
                node = {"name": labels.get("synthroads_name") or mesh.name, "mesh": len(meshes) - 1, "extras": labels}
                roots.append(len(nodes))
                nodes.append(node | _placement(matrix))
    nodes.append({"name": "SynthRoads", "matrix": Z_UP_TO_Y_UP, "children": roots})
    if not roots:
        del nodes[-1]["children"]
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": scene.generator, "extras": scene.about() | {"synthroads_up": "y"}},
        "scene": 0,
        "scenes": [{"name": scene.title or "road", "nodes": [len(nodes) - 1], "extras": scene.about()}],
        "nodes": nodes,
    }
    if meshes:
        content |= {
            "meshes": meshes,
            "materials": [_material(material) for material in scene.materials],
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "buffers": [{"byteLength": buffer.size}],
        }
    path.write_bytes(_container(content, buffer.content()))


def _mesh(buffer: _Buffer, name: str, part: LabelledPart) -> dict[str, Any]:
    """Return the mesh of a part: a primitive for each material, all with the same vertices."""
    position = buffer.vertices(part.vertices)
    primitives = [
        {
            "attributes": {"POSITION": position},
            "indices": buffer.indices(triangles, len(part.vertices)),
            "material": material,
        }
        for material, triangles in part.triangles.items()
    ]
    return {"name": name, "primitives": primitives}


def _placement(matrix: Float) -> dict[str, Any]:
    """Return a node's matrix, column by column; nothing where it is the identity, as the format wishes."""
    return {} if np.array_equal(matrix, np.eye(4)) else {"matrix": matrix.T.ravel().tolist()}


def _material(material: Any) -> dict[str, Any]:
    """Return a material; faces are seen from both sides, as leaves and panes are single sheets."""
    shading = {
        "baseColorFactor": [*material.color, material.alpha],
        "metallicFactor": material.metallic,
        "roughnessFactor": material.roughness,
    }
    entry: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": shading, "doubleSided": True}
    return entry | ({"alphaMode": "BLEND"} if material.alpha < 1.0 else {})


def _container(content: dict[str, Any], data: bytes) -> bytes:
    """Return the .glb of JSON content and binary data."""
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if data:
        chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
