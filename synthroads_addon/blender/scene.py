"""Evaluated scene -> triangles with class, instance and material. Any scene, not only ours."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.cloud.labels import UNLABELLED, classes
from ..core.errors import InputError
from ..core.scene_mesh import SceneMesh, empty_scene_mesh
from .materials import table_name
from .model import ORIGIN
from .model_builder import SUPPORT
from .scene_labels import CLASS_PROPERTY, INSTANCE_PROPERTY

_SMALLEST_AREA = 1e-12


@dataclass
class _Part:
    """Triangles of one mesh, and the places where it stands.

    Attributes:
        vertices: (V, 3) float32 in the mesh's own frame.
        triangles: (T, 3) int32.
        material: (T,) uint16 indices into the scene's materials.
        class_id, instance_id: (T,) labels of the faces, or None if the mesh has none.
        places: per use: matrix (4, 4) float64, class and instance of the object.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material: NDArray[np.uint16]
    class_id: NDArray[np.uint8] | None
    instance_id: NDArray[np.uint32] | None
    places: list[tuple[NDArray[np.float64], int, int]] = field(default_factory=list)


def scene_mesh(
    source: bpy.types.Depsgraph | bpy.types.Scene | None = None,
    objects: Collection[bpy.types.Object] | None = None,
) -> SceneMesh:
    """Return the triangles of the evaluated scene: everything that is visible in it and has faces.

    A face's class is its attribute ``class_id``, else its object's custom property ``synthroads_class``, else
    the class that a collection of the object is named after, else unlabelled; its instance likewise is the
    attribute ``instance_id`` or the property ``synthroads_instance``, else 0. Triangles without area are left
    out.

    Args:
        source: a depsgraph, or a scene (its first view layer); the current scene if None.
        objects: only these and what they instance; all if None.

    Raises:
        InputError: an object's vertices aren't finite, or its class is unknown; names the object.
    """
    depsgraph = _depsgraph(source)
    scene = depsgraph.scene
    by_collection = _classes_by_collection(scene)
    chosen = None if objects is None else {item.original for item in objects}
    parts: dict[tuple[object, ...], _Part] = {}
    materials: dict[str, int] = {}
    for use in depsgraph.object_instances:
        # Curves, texts, surfaces and metaballs come a second time as the mesh that they make.
        item, owner = use.object, (use.parent if use.is_instance else use.object)
        if item.type != "MESH" or not len(item.data.polygons) or SUPPORT in owner.original:
            continue
        if chosen is not None and owner.original not in chosen:
            continue
        slots = _slot_names(item)
        # Materials may be linked to the object, so that the same mesh can look different.
        key = (item.data.as_pointer(), *slots)
        if key not in parts:
            parts[key] = _read(item.name, item.data, slots, materials)
        label = _object_class(item, owner, by_collection)
        number = item.original.get(INSTANCE_PROPERTY, owner.original.get(INSTANCE_PROPERTY, 0))
        parts[key].places.append((np.array(use.matrix_world), label, int(number)))
    return _assemble(list(parts.values()), tuple(materials), _origin(scene))


def _depsgraph(source: bpy.types.Depsgraph | bpy.types.Scene | None) -> bpy.types.Depsgraph:
    if isinstance(source, bpy.types.Depsgraph):
        return source
    if source is None or source == bpy.context.scene:
        return bpy.context.evaluated_depsgraph_get()
    layer = source.view_layers[0]
    layer.update()
    return layer.depsgraph


def _origin(scene: bpy.types.Scene) -> NDArray[np.float64]:
    for collection in scene.collection.children_recursive:
        if ORIGIN in collection:
            return np.array(collection[ORIGIN], dtype=np.float64)
    return np.zeros(3)


def _classes_by_collection(scene: bpy.types.Scene) -> dict[str, int]:
    """Return the class of each object (by name) that is in a collection named after a class."""
    ids = {row.name: row.id for row in classes()}
    result: dict[str, int] = {}
    for collection in scene.collection.children_recursive:
        if collection.name in ids:
            result |= {item.name: ids[collection.name] for item in collection.all_objects}
    return result


def _object_class(item: bpy.types.Object, owner: bpy.types.Object, by_collection: dict[str, int]) -> int:
    for candidate in (item.original, owner.original):
        name = candidate.get(CLASS_PROPERTY)
        if name is None:
            continue
        ids = {row.name: row.id for row in classes()}
        if name not in ids:
            raise InputError(f"{candidate.name}: {CLASS_PROPERTY}", name, f"must be one of {', '.join(ids)}")
        return ids[name]
    return by_collection.get(item.original.name, by_collection.get(owner.original.name, UNLABELLED))


def _slot_names(item: bpy.types.Object) -> list[str]:
    names = [table_name(material) for material in item.data.materials]
    for index, slot in enumerate(item.material_slots[: len(names)]):
        if slot.link == "OBJECT":
            names[index] = table_name(slot.material)
    return names or [table_name(None)]


def _read(name: str, mesh: bpy.types.Mesh, slots: list[str], materials: dict[str, int]) -> _Part:
    vertices = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", vertices.ravel())
    if not np.isfinite(vertices).all():
        raise InputError(f"{name}: vertices", None, "must be finite numbers")
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    triangles, face = np.empty((count, 3), np.int32), np.empty(count, np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
    mesh.loop_triangle_polygons.foreach_get("value", face)
    slot = _face_values(mesh, "material_index")
    index = np.array([materials.setdefault(entry, len(materials)) for entry in slots], np.uint16)
    material = (
        np.zeros(count, np.uint16) + index[0]
        if slot is None
        else index[np.clip(slot, 0, len(index) - 1)][face]
    )
    label, number = _face_values(mesh, "class_id"), _face_values(mesh, "instance_id")
    if label is not None:
        label = np.where((label >= 0) & (label <= UNLABELLED), label, UNLABELLED).astype(np.uint8)[face]
    if number is not None:
        number = number.view(np.uint32)[face]
    return _Part(vertices, triangles, material, label, number)


def _face_values(mesh: bpy.types.Mesh, name: str) -> NDArray[Any] | None:
    """Return the (F,) int32 values of a face attribute, or None."""
    attribute = mesh.attributes.get(name)
    if (
        attribute is None
        or attribute.domain != "FACE"
        or attribute.data_type not in ("INT", "INT8", "BOOLEAN")
    ):
        return None
    values = np.empty(len(mesh.polygons), np.int32)
    attribute.data.foreach_get("value", values)
    return values


def _assemble(parts: list[_Part], materials: tuple[str, ...], origin: NDArray[np.float64]) -> SceneMesh:
    """Place all parts and join them."""
    vertex_count = sum(len(part.vertices) * len(part.places) for part in parts)
    triangle_count = sum(len(part.triangles) * len(part.places) for part in parts)
    if not triangle_count:
        return empty_scene_mesh(origin)
    mesh: dict[str, NDArray[Any]] = {
        "vertices": np.empty((vertex_count, 3), np.float32),
        "triangles": np.empty((triangle_count, 3), np.int32),
        "class_id": np.empty(triangle_count, np.uint8),
        "instance_id": np.empty(triangle_count, np.uint32),
        "material": np.empty(triangle_count, np.uint16),
    }
    vertex = triangle = 0
    for part in parts:
        for matrix, label, number in part.places:
            faces = slice(triangle, triangle + len(part.triangles))
            mesh["vertices"][vertex : vertex + len(part.vertices)] = _moved(part.vertices, matrix)
            mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
            mesh["triangles"][faces] = (part.triangles[:, ::-1] if mirrored else part.triangles) + vertex
            mesh["class_id"][faces] = label if part.class_id is None else part.class_id
            mesh["instance_id"][faces] = number if part.instance_id is None else part.instance_id
            mesh["material"][faces] = part.material
            vertex, triangle = vertex + len(part.vertices), faces.stop
    keep = _with_area(mesh["vertices"], mesh["triangles"])
    if not keep.all():
        mesh |= {name: array[keep] for name, array in mesh.items() if name != "vertices"}
    return SceneMesh(**mesh, materials=materials, origin=origin)


def _moved(vertices: NDArray[np.float32], matrix: NDArray[np.float64]) -> NDArray[Any]:
    if np.array_equal(matrix, np.eye(4)):
        return vertices
    return vertices @ matrix[:3, :3].T + matrix[:3, 3]


def _with_area(
    vertices: NDArray[np.float32], triangles: NDArray[np.int32], block: int = 1 << 18
) -> NDArray[np.bool_]:
    """Return which triangles have an area (T,)."""
    keep = np.empty(len(triangles), bool)
    for start in range(0, len(triangles), block):
        corner = vertices[triangles[start : start + block]]
        a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        cross = np.stack([a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))])
        keep[start : start + block] = (cross * cross).sum(axis=0) > (2.0 * _SMALLEST_AREA) ** 2
    return keep
