"""Values that materials ask of a mesh and of its object, copied from Blender: attributes, maps, colours, names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import bpy
import numpy as np

from ...base.arrays import Float32
from ...scanning.scene.surface_values import MeshValues, SurfaceInput
from ..materials import scene_name
from ..materials.calculable import asked_inputs

OF_OBJECT = ("location", "object_color", "object_index", "random", "object_attribute", "object_attribute_fac")
"""Kinds of inputs that are the same all over an object."""
OF_FRAME = ("object", "object_normal", "normal")
"""Kinds of inputs that need the object's place."""

_READ = {
    "FLOAT": ("value", 1),
    "INT": ("value", 1),
    "INT8": ("value", 1),
    "BOOLEAN": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
}
"""Property of an attribute's values by its type, and its numbers."""
_BITS = 0xFFFFFFFF
_DOMAINS = {"POINT": "point", "CORNER": "corner", "FACE": "face"}


def asked_by_material() -> dict[str, frozenset[SurfaceInput]]:
    """Return the surface inputs that the open file's materials read, by the materials' names in the scene."""
    asked: dict[str, frozenset[SurfaceInput]] = {}
    for item in bpy.data.materials:
        if inputs := asked_inputs(item):
            asked[scene_name(item)] = asked.get(scene_name(item), frozenset()) | inputs
    return asked


def mesh_values(
    mesh: bpy.types.Mesh, asked: Iterable[SurfaceInput], undeformed: bool
) -> dict[SurfaceInput, MeshValues]:
    """Return the values of the asked inputs that an evaluated mesh has, by input; those of faces are by face.

    Args:
        mesh: the mesh.
        asked: inputs; those of its object are left out.
        undeformed: whether no modifier has changed it.
    """
    values = {}
    for what in sorted(asked):
        value = _mesh_value(mesh, what, undeformed)
        if value is not None:
            values[what] = value
    return values


def _mesh_value(mesh: bpy.types.Mesh, what: SurfaceInput, undeformed: bool) -> MeshValues | None:
    if what.kind in ("attribute", "attribute_fac"):
        return _attribute(mesh, what.name, what.kind == "attribute_fac")
    if what.kind == "uv":
        layers = mesh.uv_layers
        name = what.name or next((layer.name for layer in layers if layer.active_render), "")
        return _attribute(mesh, name) if name in layers else None
    if what.kind == "color":
        colors = mesh.color_attributes
        number = colors.render_color_index
        name = what.name or (colors[number].name if 0 <= number < len(colors) else "")
        return _attribute(mesh, name)
    if what.kind in ("normal", "object_normal"):
        normals = np.empty((len(mesh.loops), 3), np.float32)
        mesh.corner_normals.foreach_get("vector", normals.ravel())
        return MeshValues(_to_rgba(normals), "corner")
    if what.kind == "generated" and undeformed:
        places = np.empty((len(mesh.vertices), 3), np.float32)
        mesh.attributes["position"].data.foreach_get("vector", places.ravel())
        size = np.array(mesh.texspace_size)
        scale = np.where(size != 0.0, 0.5 / np.where(size != 0.0, size, 1.0), 0.0)
        return MeshValues(_to_rgba((places - np.array(mesh.texspace_location)) * scale + 0.5), "point")
    return None


def _attribute(mesh: bpy.types.Mesh, name: str, mean: bool = False) -> MeshValues | None:
    """Return a mesh attribute as RGBA, as renderers see it; None if it is missing or of another type or domain.

    Args:
        mesh: the mesh.
        name: of the attribute.
        mean: as one number: the mean of a vector or colour, the first of two.
    """
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type not in _READ or attribute.domain not in _DOMAINS:
        return None
    key, parts = _READ[attribute.data_type]
    flat = np.empty(len(attribute.data) * parts, np.float32)
    if attribute.data_type in ("INT", "INT8", "BOOLEAN"):
        whole = np.empty(len(flat), bool if attribute.data_type == "BOOLEAN" else np.int32)
        attribute.data.foreach_get(key, whole)
        flat[:] = whole
    else:
        attribute.data.foreach_get(key, flat)
    values = flat.reshape(-1, parts)
    if mean and parts > 1:
        values = values[:, :1] if parts == 2 else values[:, :3].mean(axis=1, keepdims=True)
    return MeshValues(_to_rgba(values), _DOMAINS[attribute.domain])


def _to_rgba(values: np.ndarray) -> Float32:
    """Return values (n, c), c from 1 to 4, as RGBA (n, 4): one number is grey, missing ones are 0, alpha 1."""
    result = np.zeros((len(values), 4), np.float32)
    result[:, 3] = 1.0
    if values.shape[1] == 1:
        result[:, :3] = values
    else:
        result[:, : values.shape[1]] = values
    return result


@dataclass(frozen=True)
class ObjectValues:
    """Reader of the values of one object, and of its instances, that materials read.

    Attributes:
        item: the object.
        asked: inputs.
    """

    item: bpy.types.Object
    asked: tuple[SurfaceInput, ...]

    def rows(self, random: int, location: tuple[float, float, float]) -> dict[SurfaceInput, tuple[float, ...]]:
        """Return (red, green, blue, alpha) by input for an instance with this random number and location."""
        rows = {}
        for what in self.asked:
            row = self._row(what, random, location)
            if row is not None:
                rows[what] = row
        return rows

    def _row(self, what: SurfaceInput, random: int, location: tuple[float, float, float]) -> tuple[float, ...] | None:
        if what.kind == "location":
            return (*location, 1.0)
        if what.kind == "object_color":
            return tuple(self.item.color)
        if what.kind == "object_index":
            return (float(self.item.pass_index),) * 3 + (1.0,)
        if what.kind == "random":
            return ((random % 2**32) / 0xFFFFFFFF,) * 3 + (1.0,)
        return _property(self.item, what)


def _property(item: bpy.types.Object, what: SurfaceInput) -> tuple[float, ...] | None:
    """Return a custom property of an object or its data as RGBA; None if neither has a fitting one."""
    for owner in (item, item.data):
        value = owner.get(what.name)
        if isinstance(value, int | float):
            return (float(value),) * 3 + (1.0,)
        if value is not None and hasattr(value, "__len__") and 1 < len(value) <= 4:
            numbers = [float(part) for part in value]
            if what.kind.endswith("_fac"):
                return (float(np.mean(numbers[:3])),) * 3 + (1.0,)
            return (*numbers, *(0.0, 0.0, 0.0, 1.0)[len(numbers) :])
    return None


def random_number(use: bpy.types.DepsgraphObjectInstance) -> int:
    """Return the 32-bit number that Cycles uses for *Object Info > Random*: an instance's, else the name's hash."""
    if use.is_instance:
        return int(use.random_id) % 2**32
    number = 0
    for byte in use.object.name.encode():
        number = (number * 37 + byte) & _BITS
    return _hash_number(number)


def _hash_number(number: int) -> int:
    """Return a number's hash with 0 by Bob Jenkins' lookup3, as Cycles has it."""
    c = b = (0xDEADBEEF + (2 << 2) + 13) & _BITS
    a = (b + number) & _BITS
    for into, turn in ((2, 14), (0, 11), (1, 25), (2, 16), (0, 4), (1, 14), (2, 24)):
        last = (c, a, b)[into]
        turned = ((last << turn) | (last >> (32 - turn))) & _BITS
        if into == 0:
            a = ((a ^ c) - turned) & _BITS
        elif into == 1:
            b = ((b ^ a) - turned) & _BITS
        else:
            c = ((c ^ b) - turned) & _BITS
    return c


def object_values(
    item: bpy.types.Object, names: Iterable[str], asked: Mapping[str, frozenset[SurfaceInput]]
) -> ObjectValues | None:
    """Return a reader of the object inputs that an object's materials read; None if they read none."""
    inputs = frozenset().union(*(asked.get(name, frozenset()) for name in names))
    mine = tuple(sorted(what for what in inputs if what.kind in OF_OBJECT))
    return ObjectValues(item, mine) if mine else None
