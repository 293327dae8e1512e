"""Where a material's layers come from: base colour, roughness, metallic and specular of its shaders, mixed as they are.

A layer is an expression of constants and sockets, which is looked at, averaged, or built as nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

import bpy
import numpy as np

from ...scanning.colour.colour import MATERIAL_LAYERS
from .image import is_missing, mean_color
from .inputs import group_output

PROPERTY = "synthroads_material"
"""Custom property of a Blender material: its name in the table."""


@dataclass(frozen=True)
class Constant:
    """A value that is the same everywhere: red, green, blue, or one number three times."""

    value: tuple[float, float, float]


@dataclass(frozen=True)
class Linked:
    """A value that a socket gives.

    Attributes:
        output: the socket.
        path: the group nodes around it, outermost first.
        usual: what stands in the input that it is linked to.
    """

    output: bpy.types.NodeSocket
    path: tuple[bpy.types.Node, ...]
    usual: tuple[float, float, float]


@dataclass(frozen=True)
class Mixture:
    """Two values mixed by a factor: 0 is the first alone."""

    factor: Constant | Linked
    first: Expression
    second: Expression


Expression: TypeAlias = "Constant | Linked | Mixture"

_COLORS = {
    "BSDF_PRINCIPLED": "Base Color",
    **dict.fromkeys(("BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_ANISOTROPIC", "BSDF_GLASS"), ""),
    **dict.fromkeys(("BSDF_TRANSLUCENT", "BSDF_REFRACTION", "BSDF_SHEEN", "BSDF_TOON", "SUBSURFACE_SCATTERING"), ""),
    **dict.fromkeys(("EMISSION", "EEVEE_SPECULAR"), ""),
}
"""Shaders by type and the input of their colour, if it isn't ``Color`` or ``Base Color``."""
_METALS = ("BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_ANISOTROPIC")
_ROUGH = (*_METALS, "BSDF_PRINCIPLED", "BSDF_GLASS", "BSDF_REFRACTION", "EEVEE_SPECULAR")
"""Shaders whose roughness is that of their reflection; matt ones have another by that name."""


def layer_expressions(item: bpy.types.Material) -> dict[str, Expression]:
    """Return the layers of a material that its nodes say something of, by name.

    A material of the table has outputs for its layers. Of others it is what their shaders have: mixed where they are
    mixed, and without those that only let light through. Their specular isn't the scanner's, see
    `blender.materials.constants`.
    """
    if item.node_tree is None:
        return {}
    outputs = {
        node.aov_name: node.inputs["Color" if MATERIAL_LAYERS[node.aov_name] == 3 else "Value"]
        for node in item.node_tree.nodes
        if node.type == "OUTPUT_AOV" and node.aov_name in MATERIAL_LAYERS
    }
    layers: dict[str, Expression] = {name: _of_input(socket, ()) for name, socket in outputs.items()}
    if PROPERTY in item:
        return layers
    entry = surface_socket(item.node_tree)
    if entry is None or not entry.links:
        return layers
    surface = entry.links[0].from_socket
    for name in ("base_color", "roughness", "metallic"):
        expression = _of_shader(surface, (), name)
        if expression is not None:
            layers.setdefault(name, expression)
    return layers


def material_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Return the node that gives a material to Cycles; None if it has none."""
    ends = [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL" and node.target in ("ALL", "CYCLES")]
    return next((node for node in ends if node.is_active_output), ends[0] if ends else None)


def surface_socket(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket | None:
    """Return the input that takes a material's surface for Cycles; None if it has none."""
    end = material_output(tree)
    return None if end is None else end.inputs["Surface"]


def _of_shader(socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...], layer: str) -> Expression | None:
    """Return a layer of a shader; None of one that has none, as what only lets light through."""
    node = socket.node
    if node.type == "REROUTE":
        return _of_linked(node.inputs[0], path, layer)
    if node.type == "GROUP" and node.node_tree is not None:
        end = group_output(node.node_tree)
        entry = next((one for one in end.inputs if one.identifier == socket.identifier), None) if end else None
        return None if entry is None else _of_linked(entry, (*path, node), layer)
    if node.type == "GROUP_INPUT" and path:
        entry = next((one for one in path[-1].inputs if one.identifier == socket.identifier), None)
        return None if entry is None else _of_linked(entry, path[:-1], layer)
    if node.type in ("MIX_SHADER", "ADD_SHADER"):
        first, second = (_of_linked(entry, path, layer) for entry in node.inputs[-2:])
        if first is None or second is None or first == second:
            return second if first is None else first
        factor = _of_input(node.inputs[0], path) if node.type == "MIX_SHADER" else Constant((0.5, 0.5, 0.5))
        assert not isinstance(factor, Mixture)
        return Mixture(factor, first, second)
    return _of_closure(node, path, layer)


def _of_linked(entry: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...], layer: str) -> Expression | None:
    links = entry.links
    return _of_shader(links[0].from_socket, path, layer) if links else None


def _of_closure(node: bpy.types.Node, path: tuple[bpy.types.Node, ...], layer: str) -> Expression | None:
    if node.type not in _COLORS:
        return None
    if layer == "base_color":
        entry = node.inputs.get(_COLORS[node.type] or "Color") or node.inputs.get("Base Color")
        return None if entry is None else _of_input(entry, path)
    entry = node.inputs.get(layer.capitalize())
    if entry is not None and (layer == "metallic" or node.type in _ROUGH):
        return _of_input(entry, path)
    usual = float(node.type in _METALS) if layer == "metallic" else 1.0
    return Constant((usual, usual, usual))


def _of_input(entry: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> Constant | Linked:
    value = entry.default_value
    usual = tuple(float(part) for part in value[:3]) if hasattr(value, "__len__") else (float(value),) * 3
    links = entry.links
    if not links or _is_missing_image(links[0].from_node):
        return Constant(usual)  # type: ignore[arg-type]
    return Linked(links[0].from_socket, path, usual)  # type: ignore[arg-type]


def _is_missing_image(node: bpy.types.Node) -> bool:
    """Return whether a node would show a missing image: what stands in the socket that it feeds takes its place."""
    return node.bl_idname == "ShaderNodeTexImage" and is_missing(node.image)


def sockets_of(expression: Expression) -> Iterator[Linked]:
    """Yield all sockets that an expression reads."""
    if isinstance(expression, Linked):
        yield expression
    elif isinstance(expression, Mixture):
        for part in (expression.factor, expression.first, expression.second):
            yield from sockets_of(part)


def varies(expression: Expression) -> bool:
    """Return whether an expression may have other values at other places."""
    return any(True for _ in sockets_of(expression))


def mean_value(expression: Expression) -> tuple[float, float, float]:
    """Return the mean of an expression, as well as it can be told without rendering: images by their pixels."""
    if isinstance(expression, Constant):
        return expression.value
    if isinstance(expression, Linked):
        return mean_color(expression.output.node) or expression.usual
    share = min(1.0, max(0.0, mean_value(expression.factor)[0])) if isinstance(expression.factor, Constant) else 0.5
    first, second = np.array(mean_value(expression.first)), np.array(mean_value(expression.second))
    red, green, blue = ((1.0 - share) * first + share * second).tolist()
    return red, green, blue


@dataclass
class LayerNodes:
    """Nodes and sockets that are added to a material's trees for its layers, and removed again.

    Attributes:
        tree: the material's own.
    """

    tree: bpy.types.NodeTree
    _undo: list[Callable[[], None]] = field(default_factory=list)

    def add_output(self, layer: str, expression: Expression) -> bpy.types.Node:
        """Add an output for a layer, and return it."""
        output = self.new_output(layer)
        entry = output.inputs["Color" if MATERIAL_LAYERS.get(layer) == 3 else "Value"]
        self.tree.links.new(self.socket(expression), entry)
        return output

    def new_output(self, name: str) -> bpy.types.Node:
        """Add an output of a name to the material."""
        node = self._new(self.tree, "ShaderNodeOutputAOV")
        node.aov_name = name
        return node

    def hide_transparency(self) -> None:
        """Have a camera's rays end on what else lets them straight through; light still comes through.

        Else a renderer adds up the layers of all surfaces along a ray, and says whichever of them it likes.
        """
        seen: set[bpy.types.NodeTree] = set()
        waiting = [self.tree]
        while waiting:
            tree = waiting.pop()
            if tree in seen:
                continue
            seen.add(tree)
            for node in list(tree.nodes):
                if node.type == "MIX_SHADER":
                    for entry, factor in zip(node.inputs[1:3], (1.0, 0.0), strict=True):
                        if entry.is_linked and entry.links[0].from_node.type == "BSDF_TRANSPARENT":
                            self._give_camera(tree, node.inputs[0], factor)
                elif node.type == "BSDF_PRINCIPLED":
                    alpha = node.inputs["Alpha"]
                    if alpha.is_linked or alpha.default_value < 1.0:
                        self._give_camera(tree, alpha, 1.0)
                elif node.type == "GROUP" and node.node_tree is not None:
                    waiting.append(node.node_tree)

    def _give_camera(self, tree: bpy.types.NodeTree, entry: bpy.types.NodeSocket, value: float) -> None:
        """Have an input be a value for a camera's rays, and what it was for others."""
        source, usual = (entry.links[0].from_socket if entry.is_linked else None), entry.default_value
        if source is not None:
            self._undo.append(lambda: tree.links.new(source, entry))
        path, mix = self._new(tree, "ShaderNodeLightPath"), self._new(tree, "ShaderNodeMix")
        factor, first, second = mix.inputs["Factor"], mix.inputs["A"], mix.inputs["B"]
        first.default_value, second.default_value = usual, value
        tree.links.new(path.outputs["Is Camera Ray"], factor)
        if source is not None:
            tree.links.new(source, first)
        tree.links.new(mix.outputs["Result"], entry)

    def socket(self, expression: Expression) -> bpy.types.NodeSocket:
        """Return a socket of the material's own tree that gives an expression."""
        if isinstance(expression, Linked):
            result = expression.output
            for group in reversed(expression.path):
                result = self._through(group, result)
            return result
        if isinstance(expression, Constant):
            node = self._new(self.tree, "ShaderNodeRGB")
            node.outputs[0].default_value = (*expression.value, 1.0)
            return node.outputs[0]
        node = self._new(self.tree, "ShaderNodeMix")
        node.data_type, node.blend_type, node.clamp_factor = "RGBA", "MIX", True
        factor, first, second = (
            next(entry for entry in node.inputs if entry.identifier == name)
            for name in ("Factor_Float", "A_Color", "B_Color")
        )
        for part, entry in ((expression.factor, factor), (expression.first, first), (expression.second, second)):
            self.tree.links.new(self.socket(part), entry)
        return next(entry for entry in node.outputs if entry.identifier == "Result_Color")

    def _through(self, group: bpy.types.Node, inside: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return an output of a group node that gives a socket inside of the group."""
        tree = group.node_tree
        end = group_output(tree)
        assert end is not None
        color = inside.type != "VALUE"
        entry = tree.interface.new_socket(
            "SR Layer", in_out="OUTPUT", socket_type=f"NodeSocket{'Color' if color else 'Float'}"
        )
        self._undo.append(lambda: tree.interface.remove(entry))
        identifier = entry.identifier
        tree.links.new(inside, next(one for one in end.inputs if one.identifier == identifier))
        return next(one for one in group.outputs if one.identifier == identifier)

    def _new(self, tree: bpy.types.NodeTree, kind: str) -> bpy.types.Node:
        active = tree.nodes.active
        node = tree.nodes.new(kind)
        node.select = False
        tree.nodes.active = active
        self._undo.append(lambda: self._drop(tree, node, active))
        return node

    @staticmethod
    def _drop(tree: bpy.types.NodeTree, node: bpy.types.Node, active: bpy.types.Node | None) -> None:
        tree.nodes.remove(node)
        tree.nodes.active = active

    def remove(self) -> None:
        """Remove all that was added."""
        while self._undo:
            self._undo.pop()()
