"""Reader of a node tree as a program: values of sockets, and their conversion between types of sockets.

Links, muted nodes, reroutes and groups are followed as Cycles does when it imports a Blender material: a value that
enters or leaves a group is converted to the type of the group's socket.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import bpy
import numpy as np
from numpy.typing import NDArray

from ....base.arrays import Float32
from ....scanning.kernels.program import ProgramBuilder
from ....scanning.scene.surface_values import SurfaceInput
from ..inputs import group_output, identified_socket
from .numbers import VECTORS_FUSED, Number, Vector

Path: TypeAlias = tuple[bpy.types.Node, ...]
Value: TypeAlias = "Number | Vector"
Pixels: TypeAlias = "Float32 | NDArray[np.uint8]"
LUMINANCE = (
    (0.21267404, 0.71515161, 0.07217542) if bpy.app.version < (5, 0, 0) else (0.21263909, 0.71516913, 0.07219274)
)
"""Weights of red, green and blue in the luminance, as Blender's configuration of colours has them."""
_VECTORS = ("VECTOR", "RGBA")
_NUMBERS = ("VALUE", "INT", "BOOLEAN")


class UnknownNodeError(Exception):
    """A node, or a setting of a node, that programs can't express; the text names it."""


Reader: TypeAlias = "Callable[[NodeReader], Value]"
READERS: dict[str, Reader] = {}
"""Functions that return the value of a node's output, by the node's type."""


def reads(*kinds: str) -> Callable[[Reader], Reader]:
    """Return a decorator that adds a function to `READERS` for node types."""

    def add(reader: Reader) -> Reader:
        READERS.update(dict.fromkeys((f"ShaderNode{kind}" for kind in kinds), reader))
        return reader

    return add


@dataclass
class TreeReader:
    """Reader of a material's nodes.

    Attributes:
        inputs: nodes that stand for inputs of the place, such as its position.
        builder: builder of the program.
    """

    inputs: dict[bpy.types.Node, SurfaceInput]
    builder: ProgramBuilder = field(default_factory=ProgramBuilder)
    _values: dict[tuple[object, ...], Value] = field(default_factory=dict)
    _pixels: dict[int, Pixels] = field(default_factory=dict)
    _sources: dict[int, dict[int, bpy.types.NodeSocket]] = field(default_factory=dict)

    def pixels_of(self, image: bpy.types.Image, read: Callable[[], Pixels]) -> Pixels:
        """Return the pixels of an image, read once."""
        if image.session_uid not in self._pixels:
            self._pixels[image.session_uid] = read()
        return self._pixels[image.session_uid]

    def number(self, value: float) -> Number:
        """Return a number of the program."""
        return Number(self.builder, self.builder.constant(value))

    def input_value(self, socket: bpy.types.NodeSocket, path: Path) -> Value:
        """Return the value of an input socket, in the socket's type: of the linked output, else the unlinked value.

        Raises:
            UnknownNodeError: the socket depends on a node that programs can't express.
        """
        output = self._source(socket)
        while output is not None and output.node.type == "REROUTE":
            output = self._source(output.node.inputs[0])
        if output is None:
            return self._default(socket)
        passes_on = socket.node.mute or socket.node.type in ("GROUP", "GROUP_OUTPUT")
        if passes_on and not VECTORS_FUSED and socket.type == "VALUE" and output.type in _VECTORS:
            # Since 5.0 Blender dissolves groups before Cycles sees them: such a conversion to a number then differs.
            raise UnknownNodeError(f"{socket.node.bl_rna.name}: {output.type.title()} as a number")
        return self.converted(self.output_value(output, path), output.type, socket.type)

    def _source(self, socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
        """Return the output that is linked to an input; None if none is."""
        tree = socket.id_data
        # `NodeSocket.links` searches all links of the tree at each access, which is slow: they are stored here.
        if (sources := self._sources.get(tree.as_pointer())) is None:
            sources = self._sources[tree.as_pointer()] = {
                link.to_socket.as_pointer(): link.from_socket
                for link in tree.links
                if link.is_valid and not link.is_muted
            }
        return sources.get(socket.as_pointer())

    def _default(self, socket: bpy.types.NodeSocket) -> Value:
        """Return the unlinked value of an input socket."""
        value = getattr(socket, "default_value", None)
        if socket.type in _NUMBERS and value is not None:
            return self.number(float(value))
        if socket.type in _VECTORS and value is not None:
            x, y, z = (self.number(float(part)) for part in list(value)[:3])
            return x, y, z
        raise UnknownNodeError(f"{socket.node.bl_rna.name}: {socket.name}")

    def output_value(self, socket: bpy.types.NodeSocket, path: Path) -> Value:
        """Return the value of an output socket, see `input_value`; each output is read once."""
        node = socket.node
        key = (*(outer.as_pointer() for outer in path), node.as_pointer(), socket.identifier)
        if key not in self._values:
            self._values[key] = self._read(node, socket, path)
        return self._values[key]

    def _read(self, node: bpy.types.Node, socket: bpy.types.NodeSocket, path: Path) -> Value:
        """Return the value of a node's output: of an input of the place, a muted node, a group, or one of `READERS`."""
        if node in self.inputs:
            surface_input = self.inputs[node]
            if socket.name == "Alpha":
                return Number(self.builder, self.builder.load(surface_input, 3))
            x, y, z = (Number(self.builder, self.builder.load(surface_input, part)) for part in range(3))
            return x, y, z
        if node.mute:
            inner = next((link.from_socket for link in node.internal_links if link.to_socket == socket), None)
            if inner is None:
                return self._zero(socket)
            return self.converted(self.input_value(inner, path), inner.type, socket.type)
        if node.type == "GROUP":
            output_node = group_output(node.node_tree) if node.node_tree is not None else None
            inner = identified_socket(output_node.inputs, socket.identifier) if output_node is not None else None
            if inner is None:
                return self._zero(socket)
            return self.converted(self.input_value(inner, (*path, node)), inner.type, socket.type)
        if node.type == "GROUP_INPUT" and path:
            inner = identified_socket(path[-1].inputs, socket.identifier)
            if inner is None:
                return self._zero(socket)
            return self.converted(self.input_value(inner, path[:-1]), inner.type, socket.type)
        reader = READERS.get(node.bl_idname)
        if reader is None:
            raise UnknownNodeError(str(node.bl_rna.name))
        return reader(NodeReader(self, node, socket, path))

    def _zero(self, socket: bpy.types.NodeSocket) -> Value:
        """Return 0 as a number, or as a vector for sockets of vectors."""
        zero = self.number(0.0)
        return (zero, zero, zero) if socket.type in _VECTORS else zero

    def converted(self, value: Value, source: str, target: str) -> Value:
        """Return a value of a socket of the type `source`, converted to the type `target`."""
        for kind in (source, target):
            if kind not in _VECTORS and kind not in ("VALUE",) and not (kind in _NUMBERS and source == target):
                raise UnknownNodeError(f"socket of type {kind.title()}")
        if target in _VECTORS:
            return value if isinstance(value, tuple) else (value, value, value)
        if not isinstance(value, tuple):
            return value
        return self.luminance(value) if source == "RGBA" else (value[0] + value[1] + value[2]) * (1.0 / 3.0)

    def luminance(self, color: Vector) -> Number:
        """Return the luminance of a linear colour."""
        red, green, blue = (part * weight for part, weight in zip(color, LUMINANCE, strict=True))
        return red + green + blue


@dataclass(frozen=True)
class NodeReader:
    """A node whose output is read.

    Attributes:
        tree: reader of all nodes.
        node: the node.
        socket: its output socket.
        path: the group nodes around it, outermost first.
    """

    tree: TreeReader
    node: Any
    socket: bpy.types.NodeSocket
    path: Path

    @property
    def builder(self) -> ProgramBuilder:
        """Return the program's builder."""
        return self.tree.builder

    def constant(self, value: float) -> Number:
        """Return a number of the program."""
        return self.tree.number(value)

    def number(self, key: int | str) -> Number:
        """Return the value of an input that is a number, given by position or identifier."""
        value = self.tree.input_value(self._input(key), self.path)
        assert isinstance(value, Number)
        return value

    def vector(self, key: int | str) -> Vector:
        """Return the value of an input that is a vector or colour, given by position or identifier."""
        value = self.tree.input_value(self._input(key), self.path)
        assert isinstance(value, tuple)
        return value

    def _input(self, key: int | str) -> bpy.types.NodeSocket:
        """Return an input socket by position or identifier."""
        if isinstance(key, int):
            return self.node.inputs[key]
        socket = identified_socket(self.node.inputs, key)
        if socket is None:
            raise UnknownNodeError(f"{self.node.bl_rna.name}: {key}")
        return socket

    def place(self) -> Vector:
        """Return the coordinates at which a texture is looked up."""
        mapping = self.node.texture_mapping
        has_transform = any(mapping.translation) or any(mapping.rotation) or tuple(mapping.scale) != (1.0, 1.0, 1.0)
        has_axes = (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z) != ("X", "Y", "Z")
        if has_transform or has_axes or mapping.use_min or mapping.use_max or mapping.mapping != "FLAT":
            raise UnknownNodeError(f"{self.node.bl_rna.name}: Texture Mapping")
        return self.vector("Vector")

    def refuse(self, setting: str) -> UnknownNodeError:
        """Return the error for a setting that programs can't express."""
        return UnknownNodeError(f"{self.node.bl_rna.name}: {setting.replace('_', ' ').title()}")
