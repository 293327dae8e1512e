"""Meshes of an evaluated scene as arrays, and their placement in one mesh; used by `evaluated`."""

from __future__ import annotations

import ctypes
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.class_mapping import NameClasses
from ...base.classes import UNLABELLED
from ...base.errors import InputError
from ...base.machine import linear_algebra_on_one_thread
from ...base.remarks import warn
from ...materials.table import entry_of
from ...scanning.scene.mesh import SceneMesh, empty_scene_mesh
from ...scanning.scene.surface_values import MeshValues, PartValues, SurfaceInput, ValuesBuilder
from ..labels import Label
from ..materials import scene_name
from .values import OF_FRAME, OF_OBJECT, mesh_values

Float = NDArray[np.float64]

_SMALLEST_AREA = 1e-12
"""Area, m2, up to which a triangle counts as having none; chosen."""
_LARGEST_LABEL = 2.0**31
"""Limit of labels that are stored as floats: 32-bit integers."""
_BLOCK = 1 << 17
"""Largest number of triangles or vertices that one step processes; chosen."""
_PER_FACE = ("class_id", "instance_id", "material")
_IDENTITY = array("d", np.eye(4).ravel().tolist())


@dataclass
class MeshPart:
    """Labelled triangles of one mesh in its own frame.

    Attributes:
        vertices: (V, 3) float32.
        triangles: (T, 3) int32.
        material: (T,) uint16 indices into the scene's materials, or the one index that all have.
        class_id, instance_id: (T,) labels of the triangles, or None if the mesh has none.
        material_class: (M,) int16 classes of the scene's materials by a class mapping, -1 for none; None if the mapping
            has none of this mesh's materials.
        inputs: inputs that its materials read.
        values: the mesh's values of these inputs.
        corners: (T, 3) corners of the triangles; None if no input is read.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material: NDArray[np.uint16] | int
    class_id: NDArray[np.uint8] | None
    instance_id: NDArray[np.uint32] | None
    material_class: NDArray[np.int16] | None
    inputs: frozenset[SurfaceInput] = frozenset()
    values: dict[SurfaceInput, MeshValues] = field(default_factory=dict)
    corners: NDArray[np.int32] | None = None


@dataclass
class Places:
    """Placements of a mesh part: for each a matrix (16 numbers, row by row), a label's index and the object's values.

    There are values only if materials read them.
    """

    matrices: array[float] = field(default_factory=lambda: array("d"))
    labels: array[int] = field(default_factory=lambda: array("l"))
    objects: list[dict[SurfaceInput, tuple[float, ...]]] = field(default_factory=list)


@dataclass(frozen=True)
class SceneTables:
    """Labels, materials and origin that the meshes of a scene share.

    Attributes:
        labels: labels of all objects.
        materials: names of the materials.
        origin: (3,) map coordinates of the local origin, m.
        reserved: values of ``class_id`` that faces may not have as a number, see `Labels`.
        unit: length of the scene's unit, m.
    """

    labels: Sequence[Label]
    materials: tuple[str, ...]
    origin: Float
    reserved: frozenset[int] = frozenset()
    unit: float = 1.0


def slot_names(item: bpy.types.Object) -> list[str]:
    """Return the scene names of an evaluated object's materials by slot; one name, of no material, without slots."""
    names = [scene_name(material) for material in item.data.materials]
    for index, slot in enumerate(item.material_slots[: len(names)]):
        if slot.link == "OBJECT":
            names[index] = scene_name(slot.material)
    return names or [scene_name(None)]


@dataclass
class MeshCopy:
    """Raw arrays of an evaluated mesh, copied fast; `part` converts them without Blender.

    Attributes:
        name: the object's name for messages.
        vertices: (V, 3) float32.
        corners: (C,) int32 vertices of the faces' corners.
        triangles: (T, 3) int32 corners of the triangles; None if all faces are triangles.
        face: (T,) int32 face of each triangle; None if all faces are triangles.
        slot, class_id, instance_id: (F,) int32 values of the faces, or None if the mesh has none.
        materials: (S,) uint16 indices of the slots' materials into the scene's.
        material_class, inputs, values: see `MeshPart`; values of faces are by face here.
    """

    name: str
    vertices: NDArray[np.float32]
    corners: NDArray[np.int32]
    triangles: NDArray[np.int32] | None
    face: NDArray[np.int32] | None
    slot: NDArray[np.int32] | None
    class_id: NDArray[np.int32] | None
    instance_id: NDArray[np.int32] | None
    materials: NDArray[np.uint16]
    material_class: NDArray[np.int16] | None
    inputs: frozenset[SurfaceInput] = frozenset()
    values: dict[SurfaceInput, MeshValues] = field(default_factory=dict)

    def part(self) -> MeshPart:
        """Return the mesh as labelled triangles; raise `InputError` if its vertices aren't finite."""
        if not np.isfinite(self.vertices).all():
            raise InputError(f"{self.name}: vertices", None, "must have finite coordinates: mend or remove the object")
        corners, face, class_numbers, instance_numbers = self.corners, self.face, self.class_id, self.instance_id
        material: NDArray[np.uint16] | int = int(self.materials[0])
        if self.slot is not None:
            material = _by_triangle(self.materials[np.clip(self.slot, 0, len(self.materials) - 1)], face)
        labels = None
        if class_numbers is not None:
            labels = np.where((class_numbers >= 0) & (class_numbers <= UNLABELLED), class_numbers, UNLABELLED).astype(
                np.uint8
            )
            labels = _by_triangle(labels, face)
        numbers = None if instance_numbers is None else _by_triangle(instance_numbers.view(np.uint32), face)
        triangles = corners.reshape(-1, 3) if self.triangles is None else corners[self.triangles]
        part = MeshPart(self.vertices, triangles, material, labels, numbers, self.material_class, self.inputs)
        if self.inputs:
            values = {
                surface_input: replace(input_values, values=_by_triangle(input_values.values, face))
                if input_values.domain == "face"
                else input_values
                for surface_input, input_values in self.values.items()
            }
            part.values, part.corners = values, self.triangles
            if part.corners is None:
                part.corners = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        return part


def copy_mesh(
    name: str,
    mesh: bpy.types.Mesh,
    slots: Sequence[str],
    materials: dict[str, int],
    by_name: NameClasses,
    inputs: frozenset[SurfaceInput] = frozenset(),
    undeformed: bool = False,
) -> MeshCopy:
    """Copy an evaluated mesh's geometry, face labels, materials and the values its materials read.

    Args:
        name: the object's name for messages.
        mesh: the mesh.
        slots: names of its materials.
        materials: indices of all materials so far, by name; new names are added.
        by_name: lookup of classes by materials' names.
        inputs: inputs that its materials read.
        undeformed: whether the object has no modifiers.
    """
    # Attributes are copied as blocks of memory; Blender would read `vertices` and `loops` one by one.
    vertices = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", vertices.ravel())
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", corners)
    triangles = face = None
    if len(corners) != 3 * len(mesh.polygons):
        mesh.calc_loop_triangles()
        triangles = triangle_corners(mesh)
        face = np.empty(len(triangles), np.int32)
        mesh.loop_triangle_polygons.foreach_get("value", face)
    return MeshCopy(
        name,
        vertices,
        corners,
        triangles,
        face,
        _face_values(mesh, "material_index") if len(set(slots)) > 1 else None,
        _face_labels(name, mesh, "class_id", corners),
        _face_labels(name, mesh, "instance_id", corners),
        np.array([materials.setdefault(slot, len(materials)) for slot in slots], np.uint16),
        _material_classes(slots, materials, by_name),
        inputs,
        mesh_values(mesh, inputs, undeformed),
    )


def triangle_corners(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """Return the corner indices (T, 3) int32 of a mesh's calculated loop triangles, copied as a block of memory.

    Blender stores them as an array of three 32-bit numbers each, but returns them one by one, a hundred times slower
    than a copy of the memory. So the memory at the first one's address is copied, if probes show that layout.
    """
    triangles = mesh.loop_triangles
    count = len(triangles)
    result = np.empty((count, 3), np.int32)
    first_address = triangles[0].as_pointer() if count else 0
    probes = {0, 1, count // 2, count - 1} & set(range(count))
    if any(triangles[i].as_pointer() != first_address + result.strides[0] * i for i in probes):
        triangles.foreach_get("loops", result.ravel())
        return result
    ctypes.memmove(result.ctypes.data, first_address, result.nbytes)
    if any(tuple(result[i]) != tuple(triangles[i].loops) for i in probes):
        triangles.foreach_get("loops", result.ravel())
    return result


def _by_triangle(values: NDArray[Any], face: NDArray[np.int32] | None) -> NDArray[Any]:
    """Return values of faces (F, ...) as values of triangles (T, ...)."""
    return values if face is None else values[face]


def _material_classes(
    slots: Iterable[str], materials: dict[str, int], by_name: NameClasses
) -> NDArray[np.int16] | None:
    """Return the classes (M,) of materials that a class mapping names, -1 for none; None if it names no slot's."""
    classes = {materials[name]: by_name.find("materials", entry_of(name)) for name in slots}
    if all(number is None for number in classes.values()):
        return None
    result = np.full(max(classes) + 1, -1, np.int16)
    for index, number in classes.items():
        result[index] = -1 if number is None else number
    return result


def _face_values(mesh: bpy.types.Mesh, name: str) -> NDArray[Any] | None:
    """Return an integer or boolean face attribute (F,) as int32; None if the mesh has none of that name."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.domain != "FACE" or attribute.data_type not in ("INT", "INT8", "BOOLEAN"):
        return None
    values = np.empty(len(mesh.polygons), np.int32)
    attribute.data.foreach_get("value", values)
    return values


def _face_labels(owner: str, mesh: bpy.types.Mesh, name: str, corners: NDArray[np.int32]) -> NDArray[np.int32] | None:
    """Return the labels (F,) of a mesh's faces, from faces or, as in glTF and PLY files, vertices; None if it has none.

    Custom attributes of glTF begin with an underscore, by convention in capitals; scalars of CloudCompare's files with
    ``scalar_``. A face gets the label of its first vertex; a warning says how many faces' vertices differ.

    Args:
        owner: name of the mesh's object, for messages.
        mesh: the mesh.
        name: name of the label.
        corners: (C,) vertices of the mesh's corners.
    """
    values = _face_values(mesh, name)
    if values is not None:
        return values
    attribute = next((mesh.attributes[spelling] for spelling in _spellings(name) if spelling in mesh.attributes), None)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type not in ("INT", "INT8", "FLOAT"):
        return None
    if not len(mesh.polygons):
        return np.zeros(0, np.int32)
    vertex_labels = np.empty(len(mesh.vertices), np.float32 if attribute.data_type == "FLOAT" else np.int32)
    attribute.data.foreach_get("value", vertex_labels)
    corner_labels = np.rint(np.where(np.abs(vertex_labels) < _LARGEST_LABEL, vertex_labels, -1.0)).astype(np.int32)[
        corners
    ]
    first_corners = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", first_corners)
    is_mixed = np.minimum.reduceat(corner_labels, first_corners) != np.maximum.reduceat(corner_labels, first_corners)
    if is_mixed.any():
        text = f"{np.count_nonzero(is_mixed):,} faces have vertices of several {name}: the first vertex's is taken"
        warn(f"{owner}: {text}")
    return corner_labels[first_corners]


def _spellings(name: str) -> tuple[str, ...]:
    """Return the possible names of a label's attribute: this package's, glTF's by its convention, CloudCompare's."""
    return name, f"_{name.upper()}", f"_{name}", f"scalar_{name}"


@linear_algebra_on_one_thread()  # thousands of small products
def join_parts(pairs: list[tuple[MeshPart, Places]], tables: SceneTables, frame: Float | None = None) -> SceneMesh:
    """Return all placed parts as one mesh, without triangles of no area; empties `pairs`.

    Args:
        pairs: parts and their places; emptied, so that the memory of each part is freed early.
        tables: labels, materials and origin of the scene.
        frame: (4, 4) matrix from the scene's frame, m, to the mesh's own, whose origin is then 0; None for the scene's.
    """
    origin = tables.origin if frame is None else np.zeros(3)
    if tables.unit != 1.0:
        frame = (np.eye(4) if frame is None else frame) @ np.diag([*[tables.unit] * 3, 1.0])
    uses = np.array([len(places.labels) for _, places in pairs], dtype=np.int64)
    sizes = np.array([(len(part.vertices), len(part.triangles)) for part, _ in pairs], dtype=np.int64).reshape(-1, 2)
    counts = uses @ sizes  # vertices and triangles of all uses together
    if not counts[1]:
        return empty_scene_mesh(origin, tables.materials)
    if counts.max() >= 2**31:
        raise InputError(
            "scene",
            int(counts.max()),
            "must have less than 2**31 vertices and triangles, instances included: leave objects out",
        )
    # A single part in the scene's own frame needs no copy of its vertices and triangles.
    unchanged_part = pairs[0][0] if len(pairs) == 1 and frame is None and pairs[0][1].matrices == _IDENTITY else None
    arrays: dict[str, NDArray[Any]] = {
        "vertices": unchanged_part.vertices if unchanged_part else np.empty((counts[0], 3), np.float32),
        "triangles": unchanged_part.triangles if unchanged_part else np.empty((counts[1], 3), np.int32),
        "class_id": np.empty(counts[1], np.uint8),
        "instance_id": np.empty(counts[1], np.uint32),
        "material": np.empty(counts[1], np.uint16),
    }
    pairs.reverse()  # so that popping from the end keeps the order
    first_vertex = first_triangle = 0
    surface = ValuesBuilder()
    while pairs:
        part, places = pairs.pop()
        if part.inputs:
            surface.parts.append(_part_values(part, places, first_triangle, frame))
        for matrices, labels in _blocks(part, places):
            next_starts = (
                first_vertex + len(matrices) * len(part.vertices),
                first_triangle + len(matrices) * len(part.triangles),
            )
            part_arrays = {name: arrays[name][first_triangle : next_starts[1]] for name in ("triangles", *_PER_FACE)}
            _label(part, [tables.labels[i] for i in labels], tables.reserved, part_arrays)
            if not unchanged_part:
                placements = matrices if frame is None else frame @ matrices
                _place(
                    part,
                    placements,
                    arrays["vertices"][first_vertex : next_starts[0]],
                    part_arrays["triangles"],
                    first_vertex,
                )
            first_vertex, first_triangle = next_starts
    keep = _with_area(arrays["vertices"], arrays["triangles"])
    if keep is not None:
        for name in ("triangles", *_PER_FACE):
            arrays[name] = arrays[name][keep]
    surfaces = surface.table(keep)
    return SceneMesh(**arrays, materials=tables.materials, origin=origin, surface=surfaces, unit=tables.unit)


def _part_values(part: MeshPart, places: Places, first_triangle: int, frame: Float | None) -> PartValues:
    """Return a part's material input values at all its places; its first triangle has the index ``first_triangle``."""
    assert part.corners is not None
    matrices = np.frombuffer(places.matrices).reshape(-1, 4, 4)
    values = dict(part.values)
    for surface_input in sorted(part.inputs):
        if surface_input.kind in OF_OBJECT and len(places.objects) == len(matrices):
            rows = [object_rows.get(surface_input) for object_rows in places.objects]
            if None not in rows:
                values[surface_input] = MeshValues(np.array(rows, np.float32), "object")
    needs_matrices = any(surface_input.kind in OF_FRAME for surface_input in part.inputs)
    placements = matrices if frame is None else frame @ matrices
    mirrored = np.linalg.det(matrices[:, :3, :3]) < 0.0
    return PartValues(
        first_triangle,
        part.corners,
        part.triangles,
        len(matrices),
        mirrored,
        np.array(placements) if needs_matrices else None,
        values,
    )


def _blocks(part: MeshPart, places: Places) -> Iterator[tuple[Float, array[int]]]:
    """Yield a part's places in blocks of bounded size: matrices (N, 4, 4) and label indices (N,)."""
    matrices = np.frombuffer(places.matrices).reshape(-1, 4, 4)
    size = max(1, _BLOCK // max(len(part.vertices), len(part.triangles), 1))
    for start in range(0, len(matrices), size):
        yield matrices[start : start + size], places.labels[start : start + size]


def _place(
    part: MeshPart, matrices: Float, vertices: NDArray[np.float32], triangles: NDArray[np.int32], first_vertex: int
) -> None:
    """Write a part's vertices and triangles at N places (matrices (N, 4, 4)) into the given arrays, in place."""
    count, size = len(matrices), len(part.vertices)
    placed = vertices.reshape(count, size, 3)
    step = max(1, _BLOCK // count)  # vertices per step, in float64
    for start in range(0, size, step):
        block = part.vertices[start : start + step].astype(np.float64)
        placed[:, start : start + step] = block @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
    is_mirrored = np.linalg.det(matrices[:, :3, :3]) < 0.0
    numbers = triangles.reshape(count, -1, 3)
    numbers[...] = part.triangles
    # Mirrored triangles are reversed, so that their fronts stay in front.
    numbers[is_mirrored] = part.triangles[:, ::-1]
    numbers += (first_vertex + size * np.arange(count, dtype=np.int64)).astype(np.int32)[:, None, None]


def _label(part: MeshPart, labels: list[Label], reserved: frozenset[int], arrays: dict[str, NDArray[Any]]) -> None:
    """Write class, instance and material (N * T,) of a part's triangles at N places into arrays, in place."""
    count = len(labels)
    arrays["material"].reshape(count, -1)[...] = part.material
    number = arrays["instance_id"].reshape(count, -1)
    if part.instance_id is not None:
        number[...] = part.instance_id
    else:
        number[...] = np.array([max(label.instance, 0) for label in labels], np.uint32)[:, None]
    class_id = arrays["class_id"].reshape(count, -1)
    if part.class_id is not None:
        class_id[...] = part.class_id
        if reserved:
            class_id[np.isin(class_id, list(reserved))] = UNLABELLED
        return
    strong_classes, weak_classes = np.array([(label.strong, label.weak) for label in labels], np.int16).T[:, :, None]
    material_classes = np.int16(-1) if part.material_class is None else part.material_class[part.material]
    # The object's strong class counts first, then the material's, then the object's weak class.
    class_id[...] = np.where(
        strong_classes >= 0, strong_classes, np.where(material_classes >= 0, material_classes, weak_classes)
    )


def _with_area(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.bool_] | None:
    """Return a mask (T,) of the triangles larger than 1e-12 m2; None if all are."""
    keep = np.empty(len(triangles), bool)
    for start in range(0, len(triangles), _BLOCK):
        corner = vertices[triangles[start : start + _BLOCK]]
        a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        # Squared length of the cross product of two edges: (2 A)^2.
        squared_product = sum((a[:, i] * b[:, j] - a[:, j] * b[:, i]) ** 2 for i, j in ((1, 2), (2, 0), (0, 1)))
        keep[start : start + _BLOCK] = squared_product > (2.0 * _SMALLEST_AREA) ** 2
    return None if keep.all() else keep
