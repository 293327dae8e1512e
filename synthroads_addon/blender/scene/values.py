"""Values of meshes and objects that materials read, copied from Blender: attributes, UV maps, colours, properties."""

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
"""Kinds of inputs that are constant over an object."""
OF_FRAME = ("object", "object_normal", "normal")
"""Kinds of inputs that need the object's matrix."""

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
"""Property of an attribute's values, and its number of components, by the attribute's type."""
_BITS = 0xFFFFFFFF
"""Mask of 32 bits."""
_DOMAINS = {"POINT": "point", "CORNER": "corner", "FACE": "face"}


def inputs_by_material() -> dict[str, frozenset[SurfaceInput]]:
    """Return the surface inputs that the open file's materials read, by the materials' names in the scene."""
    inputs_by_name: dict[str, frozenset[SurfaceInput]] = {}
    for item in bpy.data.materials:
        if inputs := asked_inputs(item):
            inputs_by_name[scene_name(item)] = inputs_by_name.get(scene_name(item), frozenset()) | inputs
    return inputs_by_name


def mesh_values(
    mesh: bpy.types.Mesh, inputs: Iterable[SurfaceInput], undeformed: bool
) -> dict[SurfaceInput, MeshValues]:
    """Return an evaluated mesh's values of some inputs, by input; inputs that the mesh lacks are left out.

    Args:
        mesh: the mesh.
        inputs: the inputs; those of the object are left out.
        undeformed: whether the object has no modifiers.
    """
    values = {}
    for surface_input in sorted(inputs):
        value = _mesh_value(mesh, surface_input, undeformed)
        if value is not None:
            values[surface_input] = value
    return values


def _mesh_value(mesh: bpy.types.Mesh, surface_input: SurfaceInput, undeformed: bool) -> MeshValues | None:
    """Return an evaluated mesh's values of an input; None if the mesh lacks it."""
    if surface_input.kind in ("attribute", "attribute_fac"):
        return _attribute(mesh, surface_input.name, surface_input.kind == "attribute_fac")
    if surface_input.kind == "uv":
        layers = mesh.uv_layers
        name = surface_input.name or next((layer.name for layer in layers if layer.active_render), "")
        return _attribute(mesh, name) if name in layers else None
    if surface_input.kind == "color":
        colors = mesh.color_attributes
        number = colors.render_color_index
        name = surface_input.name or (colors[number].name if 0 <= number < len(colors) else "")
        return _attribute(mesh, name)
    if surface_input.kind in ("normal", "object_normal"):
        normals = np.empty((len(mesh.loops), 3), np.float32)
        mesh.corner_normals.foreach_get("vector", normals.ravel())
        return MeshValues(_to_rgba(normals), "corner")
    if surface_input.kind == "generated" and undeformed:
        places = np.empty((len(mesh.vertices), 3), np.float32)
        mesh.attributes["position"].data.foreach_get("vector", places.ravel())
        # Generated coordinates run from 0 to 1 across the mesh's texture space.
        size = np.array(mesh.texspace_size)
        scale = np.where(size != 0.0, 0.5 / np.where(size != 0.0, size, 1.0), 0.0)
        return MeshValues(_to_rgba((places - np.array(mesh.texspace_location)) * scale + 0.5), "point")
    return None


def _attribute(mesh: bpy.types.Mesh, name: str, mean: bool = False) -> MeshValues | None:
    """Return a mesh attribute as RGBA, as renderers see it; None if it is missing or of another type or domain.

    Args:
        mesh: the mesh.
        name: name of the attribute.
        mean: whether to return one number: the mean of a vector or colour, the first of two components.
    """
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type not in _READ or attribute.domain not in _DOMAINS:
        return None
    key, components = _READ[attribute.data_type]
    flat_values = np.empty(len(attribute.data) * components, np.float32)
    if attribute.data_type in ("INT", "INT8", "BOOLEAN"):
        integers = np.empty(len(flat_values), bool if attribute.data_type == "BOOLEAN" else np.int32)
        attribute.data.foreach_get(key, integers)
        flat_values[:] = integers
    else:
        attribute.data.foreach_get(key, flat_values)
    values = flat_values.reshape(-1, components)
    if mean and components > 1:
        values = values[:, :1] if components == 2 else values[:, :3].mean(axis=1, keepdims=True)
    return MeshValues(_to_rgba(values), _DOMAINS[attribute.domain])


def _to_rgba(values: np.ndarray) -> Float32:
    """Return values (N, C), C from 1 to 4, as RGBA (N, 4): one component is grey, missing ones are 0, alpha is 1."""
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
        inputs: the inputs to read.
    """

    item: bpy.types.Object
    inputs: tuple[SurfaceInput, ...]

    def rows(self, random: int, location: tuple[float, float, float]) -> dict[SurfaceInput, tuple[float, ...]]:
        """Return (red, green, blue, alpha) by input for an instance with this random number and location."""
        rows = {}
        for surface_input in self.inputs:
            row = self._row(surface_input, random, location)
            if row is not None:
                rows[surface_input] = row
        return rows

    def _row(
        self, surface_input: SurfaceInput, random: int, location: tuple[float, float, float]
    ) -> tuple[float, ...] | None:
        """Return (red, green, blue, alpha) of one input for an instance; None if the object lacks it."""
        if surface_input.kind == "location":
            return (*location, 1.0)
        if surface_input.kind == "object_color":
            return tuple(self.item.color)
        if surface_input.kind == "object_index":
            return (float(self.item.pass_index),) * 3 + (1.0,)
        if surface_input.kind == "random":
            return ((random % 2**32) / 0xFFFFFFFF,) * 3 + (1.0,)
        return _property(self.item, surface_input)


def _property(item: bpy.types.Object, surface_input: SurfaceInput) -> tuple[float, ...] | None:
    """Return a custom property of an object or its data as RGBA; None if neither has one of 1 to 4 numbers."""
    for owner in (item, item.data):
        value = owner.get(surface_input.name)
        if isinstance(value, int | float):
            return (float(value),) * 3 + (1.0,)
        if value is not None and hasattr(value, "__len__") and 1 < len(value) <= 4:
            numbers = [float(part) for part in value]
            if surface_input.kind.endswith("_fac"):
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
    """Return the hash of (number, 0) by Bob Jenkins' lookup3, as Cycles' hash_uint2."""
    c = b = (0xDEADBEEF + (2 << 2) + 13) & _BITS
    a = (b + number) & _BITS
    # The function's final mixing: each step changes one word by another one, rotated to the left by some bits.
    for target, bits in ((2, 14), (0, 11), (1, 25), (2, 16), (0, 4), (1, 14), (2, 24)):
        word = (c, a, b)[target]
        rotated_word = ((word << bits) | (word >> (32 - bits))) & _BITS
        if target == 0:
            a = ((a ^ c) - rotated_word) & _BITS
        elif target == 1:
            b = ((b ^ a) - rotated_word) & _BITS
        else:
            c = ((c ^ b) - rotated_word) & _BITS
    return c


def object_values(
    item: bpy.types.Object, names: Iterable[str], material_inputs: Mapping[str, frozenset[SurfaceInput]]
) -> ObjectValues | None:
    """Return a reader of the object inputs that an object's materials read; None if they read none."""
    inputs = frozenset().union(*(material_inputs.get(name, frozenset()) for name in names))
    object_inputs = tuple(sorted(surface_input for surface_input in inputs if surface_input.kind in OF_OBJECT))
    return ObjectValues(item, object_inputs) if object_inputs else None
