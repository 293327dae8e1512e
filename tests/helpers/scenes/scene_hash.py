"""A digest of everything in the open file, to prove that something left it as it was."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache
from operator import attrgetter
from typing import Any

import bpy
import numpy as np

_COLLECTIONS = """
    scenes objects meshes curves materials node_groups collections images textures worlds lights cameras texts
    actions armatures libraries metaballs lattices shape_keys fonts volumes hair_curves pointclouds
"""
_LEFT_OUT = {
    # follows from other data, or is Blender's own book-keeping
    "rna_type", "bl_rna", "is_evaluated", "is_runtime_data", "session_uid", "tag", "original", "id_data", "library",
    # of meshes: held by the attributes, or calculated from them
    "attributes", "vertices", "edges", "loops", "polygons", "loop_triangles", "loop_triangle_polygons",
    "vertex_normals", "polygon_normals", "corner_normals", "uv_layers",
    "vertex_colors", "color_attributes", "vertex_paint_masks",
    "uv_layer_stencil", "uv_layer_clone", "skin_vertices", "vertex_creases", "edge_creases", "normals_domain",
    # large or irrelevant
    "pixels", "preview", "depsgraph",
}  # fmt: skip

_STRUCT, _ID, _ENDS_OF_LINKS = bpy.types.bpy_struct, bpy.types.ID, (bpy.types.Node, bpy.types.NodeSocket)


def digest() -> str:
    """Return a digest of all data blocks of the open file: every property, array, node, link and custom property."""
    return hashlib.sha256("".join(lines()).encode()).hexdigest()


def changes(before: list[str]) -> list[str]:
    """Return what differs in the open file from what it was: lines that are gone, after "-", and new ones after "+"."""
    now = lines()
    was, being = set(before), set(now)
    return [f"-{line}" for line in before if line not in being] + [f"+{line}" for line in now if line not in was]


def lines() -> list[str]:
    """Return what the digest is made of, texts of one or several values each."""
    _kind.cache_clear()  # an add-on may have come or gone since, and its properties with it
    bpy.context.view_layer.update()
    found = [f"open scene {bpy.context.scene.name} {bpy.context.view_layer.name}\n"]
    for item in bpy.context.view_layer.objects:
        seen = f"hidden {item.hide_get()} seen {item.visible_get()}"
        found.append(f"{item.name} selected {item.select_get()} {seen}\n")
    found.append(f"active {bpy.context.view_layer.objects.active}\n")
    for name in _COLLECTIONS.split():
        for item in getattr(bpy.data, name, ()):
            _add_values(found, item, f"{name}[{item.name}]", {item.as_pointer()})
    return found


class _Kind:
    """How data of one kind is read: all properties that are single values at once, as there are very many of them."""

    def __init__(self, kind: type) -> None:
        properties = list(kind.bl_rna.properties)  # type: ignore[attr-defined]
        self.names = {prop.identifier for prop in properties}
        same_for_all = {name for name in self.names if name.startswith("bl_")} - {"bl_idname"}
        read = [prop for prop in properties if prop.identifier not in _LEFT_OUT | same_for_all]
        single = [prop.identifier for prop in read if _is_single(prop) and prop.identifier != "users"]
        self.single = attrgetter(*single) if len(single) > 1 else None
        self.others = [(p.identifier, p.type) for p in read if self.single is None or p.identifier not in single]
        self.all = [(prop.identifier, prop.type) for prop in read]
        self.has_keys = True


_kind = cache(_Kind)


def _is_single(prop: bpy.types.Property) -> bool:
    is_list = getattr(prop, "is_array", False) or getattr(prop, "is_enum_flag", False)
    return prop.type in ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM") and not is_list


def _add_values(found: list[str], item: Any, path: str, seen: set[int]) -> None:
    if isinstance(item, bpy.types.Mesh):
        found.extend(_arrays(item, path))
    kind = _kind(type(item))
    if kind.has_keys:
        _add_custom_properties(found, item, path, kind)
    for name, type_ in kind.others if _add_single(found, item, path, kind) else kind.all:
        try:
            value = getattr(item, name)
        except (AttributeError, RuntimeError, TypeError):
            continue
        if type_ == "COLLECTION":
            for number, entry in enumerate(value):
                _add_pointer(found, entry, f"{path}.{name}[{number}]", seen)
        elif type_ == "POINTER":
            _add_pointer(found, value, f"{path}.{name}", seen)
        elif not callable(value):
            found.append(f"{path}.{name} = {_plain(value)}\n")


def _add_single(found: list[str], item: Any, path: str, kind: _Kind) -> bool:
    """Add all single values at once; return whether that was possible: some can't be read everywhere."""
    if kind.single is None:
        return False
    try:
        found.append(f"{path} = {kind.single(item)}\n")
    except (AttributeError, RuntimeError, TypeError):
        return False
    return True


def _add_custom_properties(found: list[str], item: Any, path: str, kind: _Kind) -> None:
    if not (hasattr(item, "keys") and isinstance(item, bpy.types.bpy_struct)):
        return
    try:
        keys = sorted(set(item.keys()) - kind.names)
    except TypeError:  # this kind has no custom properties
        kind.has_keys = False
        return
    found.extend(f"{path}[{key!r}] = {_plain(item[key])}\n" for key in keys)


def _add_pointer(found: list[str], value: Any, path: str, seen: set[int]) -> None:
    if value is None or not isinstance(value, _STRUCT):
        found.append(f"{path} = {value}\n")
    elif isinstance(value, _ID) and not value.is_embedded_data:
        found.append(f"{path} -> {type(value).__name__} {value.name_full}\n")
    elif isinstance(value, _ENDS_OF_LINKS) and ".links" in path:
        found.append(f"{path} -> {value.name}\n")
    elif (pointer := value.as_pointer()) not in seen:
        _add_values(found, value, path, seen | {pointer})


def _arrays(mesh: bpy.types.Mesh, path: str) -> Iterator[str]:
    for attribute in mesh.attributes:
        fields = {"FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2), "FLOAT_COLOR": ("color", 4)}
        field, width = fields.get(attribute.data_type, ("value", 2 if attribute.data_type == "INT32_2D" else 1))
        values = np.zeros(len(attribute.data) * width, np.float64)
        if attribute.data_type not in ("STRING", "BYTE_COLOR", "QUATERNION", "FLOAT4X4", "INT16_2D"):
            attribute.data.foreach_get(field, values)
        kind = f"{attribute.name} {attribute.domain} {attribute.data_type}"
        yield f"{path} {kind} {hashlib.sha256(values.tobytes()).hexdigest()}\n"
    starts = np.zeros(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    yield f"{path} faces {hashlib.sha256(starts.tobytes()).hexdigest()}\n"


def _plain(value: Any) -> str:
    if isinstance(value, str | int | float | bool) or value is None:
        return repr(value)
    if hasattr(value, "to_dict"):
        value = value.to_dict()
    if hasattr(value, "to_list"):
        value = value.to_list()
    if isinstance(value, set | frozenset):
        value = sorted(value)
    if isinstance(value, dict):
        return repr(value)
    try:
        return repr([_plain(entry) for entry in value])
    except TypeError:
        return repr(value)
