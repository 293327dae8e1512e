"""Values of a material's nodes as functions of the place, by NumPy alone, for use while rays are cast.

Colours and roughness of points are rendered after the rays have been cast (`blender.cameras.calculator`). Transparency
must be known before a ray goes on, in any thread. So the nodes that transparency usually consists of are evaluated
here as Cycles defines them; any other node raises `UnevaluatedError` with its name.
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
from .inputs import group_output, identified_socket, input_of

Values: TypeAlias = Mapping[SurfaceInput, Float]
Field: TypeAlias = Callable[[Values], Float]
"""Function from the inputs at N places to a value there: (N, 4), or (1, 4) if it is constant; a number is grey."""
Path: TypeAlias = tuple[bpy.types.Node, ...]
"""Group nodes around a socket, outermost first."""

_UNEVALUATED_INPUTS = ("normal", "object_normal", "true_normal", "incoming")
"""Kinds of inputs that aren't known while rays are cast."""
_GENERATED = SurfaceInput("generated")
"""Coordinates that textures use if their vector isn't linked."""
_SAMPLES = 1025
"""Samples that a curve, or a ramp that isn't linear, is interpolated between; chosen."""


class UnevaluatedError(Exception):
    """A node that can't be evaluated here; the text names it."""


def constant(*value: float) -> Field:
    """Return the field of a number or a colour that is the same everywhere."""
    # A number is grey; numbers and colours without alpha get alpha 1.
    parts = (*value[:3], 1.0) if len(value) == 3 else (value * 3 + (1.0,) if len(value) == 1 else value)
    array = np.array([parts], np.float64)
    return lambda values: array


@dataclass
class FieldReader:
    """Reader of nodes as fields.

    Attributes:
        inputs: inputs that the fields read so far need at the place.
        missing: images whose files are missing; the unlinked value of the socket that they feed is used instead.
    """

    inputs: set[SurfaceInput] = field(default_factory=set)
    missing: list[bpy.types.Image] = field(default_factory=list)

    def input_field(self, socket: bpy.types.NodeSocket, path: Path) -> Field:
        """Return the field of an input socket, in the socket's type: of the linked output, else of its unlinked value.

        Raises:
            UnevaluatedError: the socket depends on a node that can't be evaluated.
        """
        source = source_of(socket, path)
        if source.output is not None and _shows_missing(source.output):
            self.missing.append(source.output.node.image)
            source = Source(None, socket, path)
        if source.output is not None:
            return _converted(self.output_field(source.output, source.path), source.output.type, socket.type)
        value = getattr(source.input, "default_value", None)
        if value is None or isinstance(value, str):
            raise UnevaluatedError(f"{source.input.node.bl_rna.name}: {source.input.name}")
        constant_field = constant(*map(float, value)) if hasattr(value, "__len__") else constant(float(value))
        return _converted(constant_field, source.input.type, socket.type)

    def input_number(self, node: bpy.types.Node, name: str | int, path: Path) -> Callable[[Values], Float]:
        """Return an input of a node, given by name or position, as a function of the inputs to numbers (N,)."""
        # Looked up by hand: Blender's look-up by a key finds only sockets that are in use.
        socket = next(socket for number, socket in enumerate(node.inputs) if name in (number, socket.name))
        input_field = self.input_field(socket, path)
        return lambda values: input_field(values)[:, 0]

    def output_field(self, socket: bpy.types.NodeSocket, path: Path) -> Field:
        """Return the field of an output socket, see `input_field`."""
        node = socket.node
        if (surface_input := input_of(node, socket)) is not None:
            return self._read(surface_input, node, socket)
        read_node = _READERS.get(node.bl_idname)
        if read_node is None:
            raise UnevaluatedError(_label(node, socket))
        return read_node(self, node, socket, path)

    def _read(self, surface_input: SurfaceInput, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> Field:
        """Return the field of an output that gives an input of the place: position, UV map, attribute, ..."""
        if surface_input.kind in _UNEVALUATED_INPUTS:
            raise UnevaluatedError(_label(node, socket))
        self.inputs.add(surface_input)
        if socket.name == "Alpha":
            return lambda values: functions.grey(values[surface_input][:, 3])
        return lambda values: values[surface_input]

    def texture_place(self, node: bpy.types.Node, default_input: SurfaceInput, path: Path) -> Field:
        """Return the field of the coordinates (N, 4) at which a texture is looked up: linked, else the default."""
        if _moves_texture(node.texture_mapping):
            raise UnevaluatedError(f"{node.bl_rna.name}: Texture Mapping")
        vector = node.inputs["Vector"]
        source = source_of(vector, path)
        if source.output is not None or source.input != vector:
            return self.input_field(vector, path)
        self.inputs.add(default_input)
        return lambda values: values[default_input]


class Source(NamedTuple):
    """Source of an input socket's value.

    Attributes:
        output: the output that is linked to the input, through reroutes, muted nodes and groups; None if none is.
        input: the input whose unlinked value counts if no output is linked.
        path: the group nodes around both, outermost first.
    """

    output: bpy.types.NodeSocket | None
    input: bpy.types.NodeSocket
    path: Path


def source_of(socket: bpy.types.NodeSocket, path: Path) -> Source:
    """Return the output that an input socket's value comes from, or the input whose unlinked value it is."""
    while True:
        link = next((link for link in socket.links if not link.is_muted and link.is_valid), None)
        if link is None:
            return Source(None, socket, path)
        output = link.from_socket
        node, next_input = output.node, None
        if node.mute:
            next_input = next((link.from_socket for link in node.internal_links if link.to_socket == output), None)
        elif node.type == "REROUTE":
            next_input = node.inputs[0]
        elif node.type == "GROUP":
            # Enter the group: its output node has an input for each of the group's outputs.
            end = group_output(node.node_tree) if node.node_tree is not None else None
            next_input = identified_socket(end.inputs, output.identifier) if end is not None else None
            path = (*path, node)
        elif node.type == "GROUP_INPUT" and path:
            # Leave the group: the group node has an input for each of the group's inputs.
            next_input = identified_socket(path[-1].inputs, output.identifier)
            path = path[:-1]
        else:
            return Source(output, socket, path)
        if next_input is None:
            return Source(None, socket, path)
        socket = next_input


def _converted(source_field: Field, source: str, target: str) -> Field:
    """Return a field converted from one type of socket to another, as Cycles does: vectors and colours become grey."""
    if target in ("RGBA", "VECTOR") or source not in ("RGBA", "VECTOR"):
        return source_field
    to_number = functions.luminance if source == "RGBA" else functions.average
    return lambda values: functions.grey(to_number(source_field(values)))


def _shows_missing(source: bpy.types.NodeSocket) -> bool:
    """Return whether an output is that of an image texture whose image is missing."""
    node = source.node
    return node.bl_idname == "ShaderNodeTexImage" and (node.image is None or is_missing(node.image))


def _moves_texture(mapping: bpy.types.TexMapping) -> bool:
    """Return whether a texture's mapping panel of older versions moves, turns, scales or mirrors the texture."""
    has_shift = any(mapping.translation) or any(mapping.rotation)
    has_scale = tuple(mapping.scale) != (1.0, 1.0, 1.0)
    return has_shift or has_scale or (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z) != ("X", "Y", "Z")


def _label(node: bpy.types.Node, socket: bpy.types.NodeSocket) -> str:
    """Return a node's name for error texts, with the output's name if it has several."""
    return f"{node.bl_rna.name}: {socket.name}" if len(node.outputs) > 1 else str(node.bl_rna.name)


_Reader: TypeAlias = Callable[[FieldReader, Any, Any, Path], Field]
"""Function from (reader of all nodes, node, its output socket, group nodes around it) to the field of the output."""
_READERS: dict[str, _Reader] = {}
"""Readers by the node type's identifier."""


def _reads(*kinds: str) -> Callable[[_Reader], _Reader]:
    """Return a decorator that adds a reader of these node types to `_READERS`."""

    def add(reader: _Reader) -> _Reader:
        _READERS.update(dict.fromkeys(kinds, reader))
        return reader

    return add


@_reads("ShaderNodeValue", "ShaderNodeRGB")
def _value(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the constant field of a Value or RGB node."""
    value = socket.default_value
    return constant(*map(float, value)) if hasattr(value, "__len__") else constant(float(value))


@_reads("ShaderNodeTexImage")
def _image(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of an Image Texture node with flat projection."""
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
    """Return the field of an image's colours, grey if it has one channel, at the places of another field."""

    def evaluate(values: Values) -> Float:
        coordinates = place(values)
        pixels = functions.sample_image(planes, coordinates[:, 0], coordinates[:, 1], interpolation, extension)
        if pixels.shape[1] == 1:
            return functions.grey(pixels[:, 0])
        return np.pad(pixels, ((0, 0), (0, 1)), constant_values=1)  # alpha 1

    return evaluate


@_reads("ShaderNodeMath")
def _math(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Math node."""
    if node.operation not in functions.MATH:
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.operation.replace('_', ' ').title()}")
    count, function = functions.MATH[node.operation]
    parts = [reader.input_number(node, index, path) for index in range(count)]
    clamped = node.use_clamp

    def evaluate(values: Values) -> Float:
        with np.errstate(all="ignore"):
            result = np.asarray(function(*(part(values) for part in parts)), np.float64)
        return functions.grey(np.clip(result, 0.0, 1.0) if clamped else result)

    return evaluate


@_reads("ShaderNodeVectorMath")
def _vector_math(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Vector Math node."""
    function = functions.VECTOR_MATH.get(node.operation)
    if function is None:
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.operation.replace('_', ' ').title()}")
    by_name = {input_socket.identifier: input_socket for input_socket in node.inputs}
    sockets = by_name["Vector"], by_name["Vector_001"], by_name["Scale"]
    parts = [
        reader.input_field(input_socket, path) if input_socket.enabled else constant(0.0) for input_socket in sockets
    ]

    def evaluate(values: Values) -> Float:
        with np.errstate(all="ignore"):
            return np.asarray(function(*(part(values) for part in parts)), np.float64)

    return evaluate


@_reads("ShaderNodeMix", "ShaderNodeMixRGB")
def _mix(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Mix node, or of its older form, MixRGB."""
    if node.bl_idname == "ShaderNodeMixRGB":
        kind, blend, clamp_factor, clamp_result = "RGBA", node.blend_type, True, node.use_clamp
        sockets = tuple(node.inputs)
    else:
        kind, blend, clamp_factor, clamp_result = (
            node.data_type, node.blend_type if node.data_type == "RGBA" else "MIX", node.clamp_factor, node.clamp_result
        )  # fmt: skip
        sockets = tuple(input_socket for input_socket in node.inputs if input_socket.enabled)
    function = functions.BLEND.get(blend)
    if function is None or len(sockets) != 3 or kind == "ROTATION":
        raise UnevaluatedError(f"{node.bl_rna.name}: {blend.replace('_', ' ').title()}")
    factor, lower_color, upper_color = (reader.input_field(input_socket, path) for input_socket in sockets)

    def evaluate(values: Values) -> Float:
        share = factor(values)
        with np.errstate(all="ignore"):
            result = function(
                np.clip(share, 0.0, 1.0) if clamp_factor else share, lower_color(values), upper_color(values)
            )
        return np.asarray(np.clip(result, 0.0, 1.0) if clamp_result and kind == "RGBA" else result)

    return evaluate


@_reads("ShaderNodeValToRGB")
def _ramp(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Color Ramp node."""
    place, ramp = reader.input_number(node, 0, path), node.color_ramp
    elements = [(element.position, *element.color) for element in ramp.elements]
    stepped = ramp.interpolation == "CONSTANT"
    if not stepped and (ramp.interpolation != "LINEAR" or ramp.color_mode != "RGB"):
        elements = [(at, *ramp.evaluate(at)) for at in np.linspace(0.0, 1.0, _SAMPLES).tolist()]
    table = np.array(elements, np.float64)
    is_alpha = socket.name == "Alpha"

    def evaluate(values: Values) -> Float:
        result = functions.ramp(table, place(values), stepped)
        return functions.grey(result[:, 3]) if is_alpha else result

    return evaluate


@_reads("ShaderNodeFloatCurve", "ShaderNodeRGBCurve")
def _curve(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Float Curve node; RGB curves aren't evaluated."""
    if node.bl_idname == "ShaderNodeRGBCurve":
        raise UnevaluatedError(str(node.bl_rna.name))
    mapping = node.mapping
    mapping.initialize()
    at = np.linspace(0.0, 1.0, _SAMPLES)
    table = np.array([mapping.evaluate(mapping.curves[0], x) for x in at.tolist()])
    factor, value = reader.input_number(node, "Factor", path), reader.input_number(node, "Value", path)

    def evaluate(values: Values) -> Float:
        base = value(values)
        return functions.grey(base + factor(values) * (np.interp(base, at, table) - base))

    return evaluate


@_reads("ShaderNodeInvert")
def _invert(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of an Invert Color node."""
    factor, color = reader.input_field(node.inputs[0], path), reader.input_field(node.inputs[1], path)

    def evaluate(values: Values) -> Float:
        share, base = factor(values), color(values)
        return np.asarray(base + share * (1.0 - 2.0 * base))

    return evaluate


@_reads("ShaderNodeClamp")
def _clamp(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Clamp node."""
    parts = [reader.input_number(node, name, path) for name in ("Value", "Min", "Max")]
    swaps_limits = node.clamp_type == "RANGE"

    def evaluate(values: Values) -> Float:
        value, minimum, maximum = (part(values) for part in parts)
        if swaps_limits:
            minimum, maximum = np.minimum(minimum, maximum), np.maximum(minimum, maximum)
        return functions.grey(np.minimum(np.maximum(value, minimum), maximum))

    return evaluate


@_reads("ShaderNodeMapRange")
def _map_range(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Map Range node of numbers."""
    if node.data_type != "FLOAT":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.data_type.replace('_', ' ').title()}")
    names = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
    parts = [reader.input_number(node, name, path) for name in names]
    kind, clamped = node.interpolation_type, node.clamp

    def evaluate(values: Values) -> Float:
        return functions.grey(functions.map_range(kind, clamped, *(part(values) for part in parts)))

    return evaluate


@_reads("ShaderNodeSeparateXYZ", "ShaderNodeSeparateColor", "ShaderNodeSeparateRGB")
def _separate(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of one component of a vector or colour."""
    if getattr(node, "mode", "RGB") != "RGB":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.mode}")
    vector, number = reader.input_field(node.inputs[0], path), list(node.outputs).index(socket)
    return lambda values: functions.grey(vector(values)[:, number])


@_reads("ShaderNodeCombineXYZ", "ShaderNodeCombineColor", "ShaderNodeCombineRGB")
def _combine(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a vector or colour made of three numbers."""
    if getattr(node, "mode", "RGB") != "RGB":
        raise UnevaluatedError(f"{node.bl_rna.name}: {node.mode}")
    parts = [reader.input_number(node, index, path) for index in range(3)]

    def evaluate(values: Values) -> Float:
        columns = np.broadcast_arrays(*(part(values) for part in parts))
        return np.stack([*columns, np.ones_like(columns[0])], axis=1)

    return evaluate


@_reads("ShaderNodeRGBToBW")
def _to_grey(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of an RGB to BW node."""
    color = reader.input_field(node.inputs[0], path)
    return lambda values: functions.grey(functions.luminance(color(values)))


@_reads("ShaderNodeGamma")
def _gamma(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Gamma node: a colour to a power, unchanged where it is 0 or less."""
    color, gamma = reader.input_field(node.inputs[0], path), reader.input_field(node.inputs[1], path)

    def evaluate(values: Values) -> Float:
        base = color(values)
        with np.errstate(all="ignore"):
            return np.asarray(np.where(base > 0.0, np.maximum(base, 0.0) ** gamma(values), base))

    return evaluate


@_reads("ShaderNodeBrightContrast")
def _contrast(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Brightness/Contrast node."""
    color, brightness, contrast = (reader.input_field(input_socket, path) for input_socket in node.inputs)

    def evaluate(values: Values) -> Float:
        c = contrast(values)
        return np.maximum((1.0 + c) * color(values) + brightness(values) - 0.5 * c, 0.0)

    return evaluate


@_reads("ShaderNodeMapping")
def _mapping(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Mapping node."""
    kind = node.vector_type
    if kind == "NORMAL":
        raise UnevaluatedError(f"{node.bl_rna.name}: Normal")
    names = ("Vector", "Rotation", "Scale", *(("Location",) if kind != "VECTOR" else ()))
    vector, rotation, scale, *location = (reader.input_field(node.inputs[name], path) for name in names)

    def evaluate(values: Values) -> Float:
        shift = location[0](values)[:, :3] if location else 0.0
        vectors = (vector(values)[:, :3], rotation(values)[:, :3], scale(values)[:, :3])
        return np.pad(functions.mapped(kind == "TEXTURE", *vectors, shift), ((0, 0), (0, 1)))

    return evaluate


@_reads("ShaderNodeTexChecker")
def _checker(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Checker Texture node."""
    place, scale = reader.texture_place(node, _GENERATED, path), reader.input_field(node.inputs["Scale"], path)
    colors = [reader.input_field(node.inputs[name], path) for name in ("Color1", "Color2")]
    is_factor = socket.name in ("Fac", "Factor")

    def evaluate(values: Values) -> Float:
        is_first_color = functions.checker(place(values)[:, :3] * scale(values)[:, :3])
        if is_factor:
            return functions.grey(is_first_color.astype(np.float64))
        return np.asarray(np.where(is_first_color[:, None], *(color(values) for color in colors)))

    return evaluate


@_reads("ShaderNodeTexGradient")
def _gradient(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Gradient Texture node."""
    place, kind = reader.texture_place(node, _GENERATED, path), node.gradient_type
    return lambda values: functions.grey(functions.gradient(kind, place(values)[:, :3]))


@_reads("ShaderNodeLightPath")
def _light_path(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Light Path node for a laser beam."""
    return constant(1.0 if socket.name == "Is Camera Ray" else 0.0)  # a beam is traced as a camera's ray is


@_reads("ShaderNodeNewGeometry")
def _geometry(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Geometry node's output Backfacing: 1 on backs of faces, else 0."""
    if socket.name != "Backfacing":
        raise UnevaluatedError(_label(node, socket))
    reader.inputs.add(ALONG)
    return lambda values: functions.grey((values[ALONG][:, 0] > 0.0).astype(np.float64))


@_reads("ShaderNodeFresnel", "ShaderNodeLayerWeight")
def _facing(reader: FieldReader, node: Any, socket: Any, path: Path) -> Field:
    """Return the field of a Fresnel or Layer Weight node."""
    if source_of(node.inputs["Normal"], path).output is not None:
        raise UnevaluatedError(f"{node.bl_rna.name}: Normal")
    reader.inputs.add(ALONG)
    parameter = reader.input_number(node, 0, path)
    kind = socket.name if node.bl_idname == "ShaderNodeLayerWeight" else "IOR"
    return lambda values: functions.grey(functions.facing(kind, parameter(values), values[ALONG][:, 0]))
