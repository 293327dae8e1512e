"""The evaluated scene as meshes with labels at their places, for files of other programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import bpy
import numpy as np

from ...base.classes import ClassScheme
from ...base.version import generator
from ...materials.table import Material, entry_of, materials
from ...road.geometry import RoadGeometry
from ...twin.scene.labelled import LabelledMesh, LabelledScene, SceneMaterial
from .evaluated import copied_parts
from .reading import MeshPart, Places, SceneTables

_GREY = (0.5, 0.5, 0.5)


def labelled_scene(
    road: RoadGeometry,
    scheme: ClassScheme,
    user_materials: Mapping[str, Material] | None = None,
    title: str = "",
    road_id: str = "",
) -> LabelledScene:
    """Return the open file's evaluated scene, as it stands, as meshes with labels at their places.

    Args:
        road: that the scene shows.
        scheme: of its classes.
        user_materials: that replace those of the same names in the table.
        title: for people.
        road_id: of the road in the file; that of the one that is meant in it if empty.
    """
    pairs, tables = copied_parts(class_ids=scheme.source_ids(), road=road_id)
    meshes: list[LabelledMesh] = []
    while pairs:
        name, part, places = pairs.pop(0)
        meshes += _meshes(name, part, places, tables)
    table = materials() | dict(user_materials or {})
    origin = np.asarray(tables.origin, dtype=np.float64)
    shift = origin - np.array(road.parameters.transform.translate)
    return LabelledScene(
        tuple(meshes),
        tuple(_material(name, table) for name in tables.materials),
        scheme.sources().names(),
        origin,
        road.parameters.metadata.epsg,
        title,
        generator(),
        road.numbers.name_of,
        lambda plan: road.alignment.project(plan + shift[:2])[0],
        road.parameters.metadata.height_epsg,
    )


def _meshes(name: str, part: MeshPart, places: Places, tables: SceneTables) -> Iterator[LabelledMesh]:
    """Yield a part at its places: a mesh for all places whose faces have the same classes."""
    matrices = np.array(places.matrices, dtype=np.float64).reshape(-1, 4, 4)
    labels = [tables.labels[index] for index in places.labels]
    numbers = np.array([max(label.instance, 0) for label in labels], np.uint32)
    triangle_count = len(part.triangles)
    if not triangle_count:
        return
    material = np.broadcast_to(np.asarray(part.material, np.uint16), (triangle_count,))
    groups: dict[tuple[int, int], list[int]] = {}
    for index, label in enumerate(labels):
        groups.setdefault((-1, -1) if part.class_id is not None else (label.strong, label.weak), []).append(index)
    for (strong, weak), rows in groups.items():
        if part.class_id is not None:
            class_id = part.class_id
        else:
            by_material = np.full(triangle_count, -1, np.int16)
            if part.material_class is not None:
                by_material = part.material_class[material]
            class_id = np.where(strong >= 0, strong, np.where(by_material >= 0, by_material, weak)).astype(np.uint8)
            class_id = np.broadcast_to(class_id, (triangle_count,))
        yield LabelledMesh(
            name, part.vertices, part.triangles, material, class_id, part.instance_id, matrices[rows], numbers[rows]
        )


def _material(name: str, table: Mapping[str, Material]) -> SceneMaterial:
    """Return the mean of a material: the table's, else what Blender shows of it in the viewport."""
    row = table.get(entry_of(name))
    if row is not None:
        return SceneMaterial(name, row.base_color, row.roughness, row.metallic)
    material = bpy.data.materials.get(name)
    if material is None:
        return SceneMaterial(name, _GREY)
    red, green, blue, alpha = material.diffuse_color
    return SceneMaterial(name, (red, green, blue), material.roughness, material.metallic, alpha)
