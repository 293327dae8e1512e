"""Values of a material's nodes as functions of the place, by NumPy alone: for what rays must know as they go.

Colours and roughness of points are worked out by rendering (`blender.cameras.calculator`), after the rays have been
cast. What lets a ray through must be known before it goes on, in any thread. So the nodes that transparency is usually
made of are evaluated here as Cycles defines them; any other is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import bpy
import numpy as np

from ...base.arrays import Float
from ...scanning.scene.surface_values import ALONG, SurfaceInput
from . import field_functions as functions
from .image import PixelPlane, alpha_plane, color_planes, is_missing
from .inputs import group_output, input_of

Values: TypeAlias = Mapping[SurfaceInput, Float]
Field: TypeAlias = Callable[[Values], Float]
"""A value at N places by what is read there: (N, 4), or (1, 4) where it is the same everywhere; a number is grey."""
Path: TypeAlias = tuple[bpy.types.Node, ...]

_UNEVALUATED_INPUTS = ("normal", "object_normal", "true_normal", "incoming")
"""Kinds of inputs that rays can't be told."""
_GENERATED = SurfaceInput("generated")


class UnevaluatedError(Exception):
    """A node that can't be evaluated here; the text names it."""


def constant(*value: float) -> Field:
    """Return the field of a number, or of a colour, that is the same everywhere."""
    parts = (*value[:3], 1.0) if len(value) == 3 else (value * 3 + (1.0,) if len(value) == 1 else value)
    array = np.array([parts], np.float64)
    return lambda values: array


@dataclass
class FieldReader:
    """Reader of nodes as fields.

    Attributes:
        inputs: what the fields read so far ask of the place.
        missing: images that can't be shown: what stands in the socket that they feed takes their place.
    """

    inputs: set[SurfaceInput] = field(default_factory=set)
    missing: list[bpy.types.Image] = field(default_factory=list)

    def entry(self, socket: bpy.types.NodeSocket, path: Path) -> Field:
        """Return the value of an input socket: of what is linked to it, in its own type, else its own.

        Raises:
            UnevaluatedError: a node that it depends on can't be evaluated.
        """
        source = source_of(socket, path)
        if source.output is not None and _shows_missing(source.output):
            self.missing.append(source.output.node.image)
            source = Source(None, socket, path)
        if source.output is not None:
            return _converted(self.output(source.output, source.path), source.output.type, socket.type)
        value = getattr(source.entry, "default_value", None)
        if value is None or isinstance(value, str):
            raise UnevaluatedError(f"{source.entry.node.bl_rna.name}: {source.entry.name}")
        constant_field = constant(*map(float, value)) if hasattr(value, "__len__") else constant(float(value))
        return _converted(constant_field, source.entry.type, socket.type)

    def number(self, node: bpy.types.Node, name: str | int, path: Path) -> Callable[[Values], Float]:
        """Return an input of a node, by its name or number, as numbers (N,)."""
        # By a key only those in use are found.
        entry = next(one for number, one in enumerate(node.inputs) if name in (number, one.name))
        whole = self.entry(entry, path)
        return lambda values: whole(values)[:, 0]

    def output(self, socket: bpy.types.NodeSocket, path: Path) -> Field:
        """Return the value of an output socket, see `entry`."""
        node = socket.node
        if (what := input_of(node, socket)) is not None:
            return self._read(what, node, socket)
        read = _READERS.get(node.bl_idname)
        if read is None:
            raise UnevaluatedError(_label(node, socket))
        return read(self, node, socket, path)

    def _read(self, what: SurfaceInput, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> Field:
        if what.kind in _UNEVALUATED_INPUTS:
            raise UnevaluatedError(_label(node, socket))
        self.inputs.add(what)
        if socket.name == "Alpha":
            return lambda values: functions.grey(values[what][:, 3])
        return lambda values: values[what]

    def texture_place(self, node: bpy.types.Node, usual: SurfaceInput, path: Path) -> Field:
        """Return the coordinates that a texture is looked up at."""
        if any(_bends(node.texture_mapping)):
            raise UnevaluatedError(f"{node.bl_rna.name}: Texture Mapping")
        vector = node.inputs["Vector"]
        source = source_of(vector, path)
        if source.output is not None or source.entry != vector:
            return self.entry(vector, path)
        self.inputs.add(usual)
        return lambda values: values[usual]


class Source(NamedTuple):
    """Source of an input socket's value.

    Attributes:
        output: the output that is linked to it, through reroutes, muted nodes and groups; None if none is.
        entry: the input whose own value counts where none is.
        path: the group nodes around them, outermost first.
    """

    output: bpy.types.NodeSocket | None
    entry: bpy.types.NodeSocket
    path: Path


def source_of(socket: bpy.types.NodeSocket, path: Path) -> Source:
    """Return what an input socket's value comes from."""
    while True:
        link = next((link for link in socket.links if not link.is_muted and link.is_valid), None)
        if link is None:
            return Source(None, socket, path)
        output = link.from_socket
        node, onward = output.node, None
        if node.mute:
            onward = next((inner.from_socket for inner in node.internal_links if inner.to_socket == output), None)
        elif node.type == "REROUTE":
            onward = node.inputs[0]
        elif node.type == "GROUP":
            end = group_output(node.node_tree) if node.node_tree is not None else None
            onward = next((one for one in end.inputs if one.identifier == output.identifier), None) if end else None
            path = (*path, node)
        elif node.type == "GROUP_INPUT" and path:
            onward = next((one for one in path[-1].inputs if one.identifier == output.identifier), None)
            path = path[:-1]
        else:
            return Source(output, socket, path)
        if onward is None:
            return Source(None, socket, path)
        socket = onward


def _converted(whole: Field, source: str, target: str) -> Field:
    """Return a field as another type of socket takes it, as Cycles converts them."""
    if target in ("RGBA", "VECTOR") or source not in ("RGBA", "VECTOR"):
        return whole
    weigh = functions.luminance if source == "RGBA" else functions.average
    return lambda values: functions.grey(weigh(whole(values)))


def _shows_missing(source: bpy.types.NodeSocket) -> bool:
    node = source.node
    return node.bl_idname == "ShaderNodeTexImage" and (node.image is None or is_missing(node.image))


def _bends(mapping: bpy.types.TexMapping) -> tuple[bool, ...]:
    """Return what of a texture's old mapping panel moves it."""
    return (
        any(mapping.translation),
        any(mapping.rotation),
        tuple(mapping.scale) != (1.0, 1.0, 1.0),
        (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z) != ("X", "Y", "Z"),
    )


def _label(node: bpy.types.Node, socket: bpy.types.NodeSocket) -> str:
    return f"{node.bl_rna.name}: {socket.name}" if len(node.outputs) > 1 else str(node.bl_rna.name)


_Reader: TypeAlias = Callable[[FieldReader, Any, Any, Path], Field]
_READERS: dict[str, _Reader] = {}


def _reads(*kinds: str) -> Callable[[_Reader], _Reader]:
    def add(read: _Reader) -> _Reader:
        _READERS.update(dict.fromkeys(kinds, read))
        return read

    return add


@_reads("ShaderNodeValue", "ShaderNodeRGB")
def _value(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    value = socket.default_value
    return constant(*map(float, value)) if hasattr(value, "__len__") else constant(float(value))


@_reads("ShaderNodeTexImage")
def _image(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    image = node.image
    if node.projection != "FLAT":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.projection.title()}")
    if image is None or is_missing(image):
        reader.missing.append(image)
        return constant(1.0 if socket.name == "Alpha" else 0.8)
    if image.source not in ("FILE", "GENERATED"):
        raise UnevaluatedError(f"{node.bl_rna.name}: {image.source.title()}")
    place = reader.texture_place(node, SurfaceInput("uv"), path)
    planes = alpha_plane(image) if socket.name == "Alpha" else color_planes(image)
    return _lookup(planes, place, node.interpolation, node.extension)


def _lookup(planes: PixelPlane, place: Field, interpolation: str, extension: str) -> Field:
    def read(values: Values) -> Float:
        at = place(values)
        pixels = functions.sample_image(planes, at[:, 0], at[:, 1], interpolation, extension)
        return (
            functions.grey(pixels[:, 0])
            if pixels.shape[1] == 1
            else np.pad(pixels, ((0, 0), (0, 1)), constant_values=1)
        )

    return read


@_reads("ShaderNodeMath")
def _math(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if node.operation not in functions.MATH:
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.operation.replace('_', ' ').title()}")
    count, function = functions.MATH[node.operation]
    parts = [reader.number(node, index, path) for index in range(count)]
    clamped = node.use_clamp

    def read(values: Values) -> Float:
        with np.errstate(all="ignore"):
            result = np.asarray(function(*(part(values) for part in parts)), np.float64)
        return functions.grey(np.clip(result, 0.0, 1.0) if clamped else result)

    return read


@_reads("ShaderNodeVectorMath")
def _vector_math(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    function = functions.VECTOR_MATH.get(node.operation)
    if function is None:
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.operation.replace('_', ' ').title()}")
    by_name = {entry.identifier: entry for entry in node.inputs}
    entries = by_name["Vector"], by_name["Vector_001"], by_name["Scale"]
    parts = [reader.entry(entry, path) if entry.enabled else constant(0.0) for entry in entries]

    def read(values: Values) -> Float:
        with np.errstate(all="ignore"):
            return np.asarray(function(*(part(values) for part in parts)), np.float64)

    return read


@_reads("ShaderNodeMix", "ShaderNodeMixRGB")
def _mix(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if node.bl_idname == "ShaderNodeMixRGB":
        kind, blend, clamp_factor, clamp_result = "RGBA", node.blend_type, True, node.use_clamp
        entries = tuple(node.inputs)
    else:
        kind, blend, clamp_factor, clamp_result = (
            node.data_type, node.blend_type if node.data_type == "RGBA" else "MIX", node.clamp_factor, node.clamp_result
        )  # fmt: skip
        entries = tuple(entry for entry in node.inputs if entry.enabled)
    function = functions.BLEND.get(blend)
    if function is None or len(entries) != 3 or kind == "ROTATION":
        raise UnevaluatedError(f"{node.bl_rna.name}: {blend.replace('_', ' ').title()}")
    factor, first, second = (reader.entry(entry, path) for entry in entries)

    def read(values: Values) -> Float:
        share = factor(values)
        with np.errstate(all="ignore"):
            result = function(np.clip(share, 0.0, 1.0) if clamp_factor else share, first(values), second(values))
        return np.asarray(np.clip(result, 0.0, 1.0) if clamp_result and kind == "RGBA" else result)

    return read


@_reads("ShaderNodeValToRGB")
def _ramp(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    place, ramp = reader.number(node, 0, path), node.color_ramp
    elements = [(element.position, *element.color) for element in ramp.elements]
    stepped = ramp.interpolation == "CONSTANT"
    if not stepped and (ramp.interpolation != "LINEAR" or ramp.color_mode != "RGB"):
        elements = [(at, *ramp.evaluate(at)) for at in np.linspace(0.0, 1.0, 1025).tolist()]
    table = np.array(elements, np.float64)
    alone = socket.name == "Alpha"

    def read(values: Values) -> Float:
        result = functions.ramp(table, place(values), stepped)
        return functions.grey(result[:, 3]) if alone else result

    return read


@_reads("ShaderNodeFloatCurve", "ShaderNodeRGBCurve")
def _curve(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if node.bl_idname == "ShaderNodeRGBCurve":
        raise UnevaluatedError(str(node.bl_rna.name))
    mapping = node.mapping
    mapping.initialize()
    at = np.linspace(0.0, 1.0, 1025)
    table = np.array([mapping.evaluate(mapping.curves[0], x) for x in at.tolist()])
    factor, value = reader.number(node, "Factor", path), reader.number(node, "Value", path)

    def read(values: Values) -> Float:
        base = value(values)
        return functions.grey(base + factor(values) * (np.interp(base, at, table) - base))

    return read


@_reads("ShaderNodeInvert")
def _invert(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    factor, color = reader.entry(node.inputs[0], path), reader.entry(node.inputs[1], path)

    def read(values: Values) -> Float:
        share, base = factor(values), color(values)
        return np.asarray(base + share * (1.0 - 2.0 * base))

    return read


@_reads("ShaderNodeClamp")
def _clamp(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    parts = [reader.number(node, name, path) for name in ("Value", "Min", "Max")]
    ranged = node.clamp_type == "RANGE"

    def read(values: Values) -> Float:
        value, low, high = (part(values) for part in parts)
        if ranged:
            low, high = np.minimum(low, high), np.maximum(low, high)
        return functions.grey(np.minimum(np.maximum(value, low), high))

    return read


@_reads("ShaderNodeMapRange")
def _map_range(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if node.data_type != "FLOAT":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.data_type.replace('_', ' ').title()}")
    names = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
    parts = [reader.number(node, name, path) for name in names]
    kind, clamped = node.interpolation_type, node.clamp

    def read(values: Values) -> Float:
        return functions.grey(functions.map_range(kind, clamped, *(part(values) for part in parts)))

    return read


@_reads("ShaderNodeSeparateXYZ", "ShaderNodeSeparateColor", "ShaderNodeSeparateRGB")
def _separate(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if getattr(node, "mode", "RGB") != "RGB":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.mode}")
    whole, number = reader.entry(node.inputs[0], path), list(node.outputs).index(socket)
    return lambda values: functions.grey(whole(values)[:, number])


@_reads("ShaderNodeCombineXYZ", "ShaderNodeCombineColor", "ShaderNodeCombineRGB")
def _combine(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if getattr(node, "mode", "RGB") != "RGB":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.mode}")
    parts = [reader.number(node, index, path) for index in range(3)]

    def read(values: Values) -> Float:
        columns = np.broadcast_arrays(*(part(values) for part in parts))
        return np.stack([*columns, np.ones_like(columns[0])], axis=1)

    return read


@_reads("ShaderNodeRGBToBW")
def _to_grey(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    color = reader.entry(node.inputs[0], path)
    return lambda values: functions.grey(functions.luminance(color(values)))


@_reads("ShaderNodeGamma")
def _gamma(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    color, gamma = reader.entry(node.inputs[0], path), reader.entry(node.inputs[1], path)

    def read(values: Values) -> Float:
        base = color(values)
        with np.errstate(all="ignore"):
            return np.asarray(np.where(base > 0.0, np.maximum(base, 0.0) ** gamma(values), base))

    return read


@_reads("ShaderNodeBrightContrast")
def _contrast(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    color, bright, contrast = (reader.entry(entry, path) for entry in node.inputs)

    def read(values: Values) -> Float:
        c = contrast(values)
        return np.maximum((1.0 + c) * color(values) + bright(values) - 0.5 * c, 0.0)

    return read


@_reads("ShaderNodeMapping")
def _mapping(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    kind = node.vector_type
    if kind == "NORMAL":
        raise UnevaluatedError(f"{node.bl_rna.name}: Normal")
    names = ("Vector", "Rotation", "Scale", *(("Location",) if kind != "VECTOR" else ()))
    vector, rotation, scale, *shift = (reader.entry(node.inputs[name], path) for name in names)

    def read(values: Values) -> Float:
        move = shift[0](values)[:, :3] if shift else 0.0
        vectors = (vector(values)[:, :3], rotation(values)[:, :3], scale(values)[:, :3])
        return np.pad(functions.mapped(kind == "TEXTURE", *vectors, move), ((0, 0), (0, 1)))

    return read


@_reads("ShaderNodeTexChecker")
def _checker(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    place, scale = reader.texture_place(node, _GENERATED, path), reader.entry(node.inputs["Scale"], path)
    colors = [reader.entry(node.inputs[name], path) for name in ("Color1", "Color2")]
    alone = socket.name in ("Fac", "Factor")

    def read(values: Values) -> Float:
        first = functions.checker(place(values)[:, :3] * scale(values)[:, :3])
        if alone:
            return functions.grey(first.astype(np.float64))
        return np.asarray(np.where(first[:, None], *(color(values) for color in colors)))

    return read


@_reads("ShaderNodeTexGradient")
def _gradient(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    place, kind = reader.texture_place(node, _GENERATED, path), node.gradient_type
    return lambda values: functions.grey(functions.gradient(kind, place(values)[:, :3]))


@_reads("ShaderNodeLightPath")
def _light_path(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    return constant(1.0 if socket.name == "Is Camera Ray" else 0.0)  # a beam looks as a camera does


@_reads("ShaderNodeNewGeometry")
def _geometry(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if socket.name != "Backfacing":
        raise UnevaluatedError(_label(node, socket))
    reader.inputs.add(ALONG)
    return lambda values: functions.grey((values[ALONG][:, 0] > 0.0).astype(np.float64))


@_reads("ShaderNodeFresnel", "ShaderNodeLayerWeight")
def _facing(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    if source_of(node.inputs["Normal"], path).output is not None:
        raise UnevaluatedError(f"{node.bl_rna.name}: Normal")
    reader.inputs.add(ALONG)
    given = reader.number(node, 0, path)
    kind = socket.name if node.bl_idname == "ShaderNodeLayerWeight" else "IOR"
    return lambda values: functions.grey(functions.facing(kind, given(values), values[ALONG][:, 0]))
