"""Layers of a material (base colour, roughness, metallic, specular) as expressions of its shaders' inputs.

An expression consists of constants and sockets, mixed as the shaders are. It can be averaged, or built as nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

import bpy
import numpy as np

from ...scanning.colour.colour import MATERIAL_LAYERS
from .image import is_missing, mean_color
from .inputs import group_output, identified_socket

PROPERTY = "synthroads_material"
"""Custom property of a Blender material: its name in the table."""


@dataclass(frozen=True)
class Constant:
    """An expression with the same value everywhere: red, green, blue, or a number three times."""

    value: tuple[float, float, float]


@dataclass(frozen=True)
class Linked:
    """An expression that is the value of an output socket.

    Attributes:
        output: the socket.
        path: the group nodes around it, outermost first.
        default: unlinked value of the input that the socket is linked to; used where the mean of the socket is unknown.
    """

    output: bpy.types.NodeSocket
    path: tuple[bpy.types.Node, ...]
    default: tuple[float, float, float]


@dataclass(frozen=True)
class Mixture:
    """Two expressions mixed by a factor: (1 - factor) a + factor b."""

    factor: Constant | Linked
    a: Expression
    b: Expression


Expression: TypeAlias = "Constant | Linked | Mixture"

_COLORS = {
    "BSDF_PRINCIPLED": "Base Color",
    **dict.fromkeys(("BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_ANISOTROPIC", "BSDF_GLASS"), ""),
    **dict.fromkeys(("BSDF_TRANSLUCENT", "BSDF_REFRACTION", "BSDF_SHEEN", "BSDF_TOON", "SUBSURFACE_SCATTERING"), ""),
    **dict.fromkeys(("EMISSION", "EEVEE_SPECULAR"), ""),
}
"""Shaders by type and the input of their colour, if it isn't ``Color`` or ``Base Color``."""
_METALS = ("BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_ANISOTROPIC")
_ROUGH_REFLECTORS = (*_METALS, "BSDF_PRINCIPLED", "BSDF_GLASS", "BSDF_REFRACTION", "EEVEE_SPECULAR")
"""Shaders whose input Roughness is that of their reflection; in matt shaders the name means something else."""


def layer_expressions(item: bpy.types.Material) -> dict[str, Expression]:
    """Return the expressions of those layers that a material's nodes define, by the layer's name.

    A material of the table, which has the custom property `PROPERTY`, has an AOV output node for each of its layers.
    Layers for which another material has none come from its shaders: mixed as the shaders are, without shaders that
    only let light through. Specular never comes from shaders, see `blender.materials.constants`.
    """
    if item.node_tree is None:
        return {}
    aov_inputs = {
        node.aov_name: node.inputs["Color" if MATERIAL_LAYERS[node.aov_name] == 3 else "Value"]  # 3 channels, or 1
        for node in item.node_tree.nodes
        if node.type == "OUTPUT_AOV" and node.aov_name in MATERIAL_LAYERS
    }
    no_groups = ()  # path of group nodes around what lies in the material's own tree
    layers: dict[str, Expression] = {name: _of_input(socket, no_groups) for name, socket in aov_inputs.items()}
    is_of_table = PROPERTY in item
    if is_of_table:
        return layers
    surface_input = surface_socket(item.node_tree)
    if surface_input is None or not surface_input.links:
        return layers
    closure = surface_input.links[0].from_socket
    for name in ("base_color", "roughness", "metallic"):
        expression = _of_shader(closure, no_groups, name)
        if expression is not None:
            layers.setdefault(name, expression)
    return layers


def material_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Return the output node of a material that Cycles uses; None if it has none."""
    output_nodes = [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL" and node.target in ("ALL", "CYCLES")]
    return next((node for node in output_nodes if node.is_active_output), output_nodes[0] if output_nodes else None)


def surface_socket(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket | None:
    """Return the input Surface of the output node that Cycles uses; None if the material has none."""
    output_node = material_output(tree)
    return None if output_node is None else output_node.inputs["Surface"]


def _of_shader(socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...], layer: str) -> Expression | None:
    """Return the expression of a layer of the shader at an output socket; None if the shader reflects nothing."""
    node = socket.node
    if node.type == "REROUTE":
        return _of_linked(node.inputs[0], path, layer)
    if node.type == "GROUP" and node.node_tree is not None:
        end = group_output(node.node_tree)
        inner = identified_socket(end.inputs, socket.identifier) if end else None
        return None if inner is None else _of_linked(inner, (*path, node), layer)
    if node.type == "GROUP_INPUT" and path:
        outer = identified_socket(path[-1].inputs, socket.identifier)
        return None if outer is None else _of_linked(outer, path[:-1], layer)
    if node.type in ("MIX_SHADER", "ADD_SHADER"):
        a, b = (_of_linked(shader, path, layer) for shader in node.inputs[-2:])
        if a is None or b is None or a == b:  # no mixture is needed
            return b if a is None else a
        factor = _of_input(node.inputs[0], path) if node.type == "MIX_SHADER" else Constant((0.5, 0.5, 0.5))
        assert not isinstance(factor, Mixture)
        return Mixture(factor, a, b)
    return _of_closure(node, path, layer)


def _of_linked(input_socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...], layer: str) -> Expression | None:
    """Return the expression of a layer of the shader that is linked to an input; None if none is."""
    links = input_socket.links
    return _of_shader(links[0].from_socket, path, layer) if links else None


def _of_closure(node: bpy.types.Node, path: tuple[bpy.types.Node, ...], layer: str) -> Expression | None:
    """Return the expression of a layer of a single shader; None if it reflects nothing."""
    if node.type not in _COLORS:
        return None
    if layer == "base_color":
        input_socket = node.inputs.get(_COLORS[node.type] or "Color") or node.inputs.get("Base Color")
        return None if input_socket is None else _of_input(input_socket, path)
    input_socket = node.inputs.get(layer.capitalize())
    if input_socket is not None and (layer == "metallic" or node.type in _ROUGH_REFLECTORS):
        return _of_input(input_socket, path)
    # Shaders without such an input: metallic by their type, and otherwise as rough as can be.
    value = float(node.type in _METALS) if layer == "metallic" else 1.0
    return Constant((value, value, value))


def _of_input(input_socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> Constant | Linked:
    """Return the expression of an input of a shader: its unlinked value, or the output that is linked to it."""
    value = input_socket.default_value
    default = tuple(float(part) for part in value[:3]) if hasattr(value, "__len__") else (float(value),) * 3
    links = input_socket.links
    if not links or _is_missing_image(links[0].from_node):
        return Constant(default)  # type: ignore[arg-type]
    return Linked(links[0].from_socket, path, default)  # type: ignore[arg-type]


def _is_missing_image(node: bpy.types.Node) -> bool:
    """Return whether a node is an image texture whose image is missing: then the fed socket's unlinked value counts."""
    return node.bl_idname == "ShaderNodeTexImage" and is_missing(node.image)


def sockets_of(expression: Expression) -> Iterator[Linked]:
    """Yield all `Linked` parts of an expression."""
    if isinstance(expression, Linked):
        yield expression
    elif isinstance(expression, Mixture):
        for part in (expression.factor, expression.a, expression.b):
            yield from sockets_of(part)


def varies(expression: Expression) -> bool:
    """Return whether an expression may have different values at different places."""
    return any(True for _ in sockets_of(expression))


def mean_value(expression: Expression) -> tuple[float, float, float]:
    """Return the mean of an expression as known without rendering: of images by their pixels, else defaults."""
    if isinstance(expression, Constant):
        return expression.value
    if isinstance(expression, Linked):
        return mean_color(expression.output.node) or expression.default
    share = min(1.0, max(0.0, mean_value(expression.factor)[0])) if isinstance(expression.factor, Constant) else 0.5
    a, b = np.array(mean_value(expression.a)), np.array(mean_value(expression.b))
    red, green, blue = ((1.0 - share) * a + share * b).tolist()
    return red, green, blue


@dataclass
class LayerNodes:
    """Nodes and sockets that are added to a material's trees for its layers, and removed again.

    Attributes:
        tree: the material's node tree.
    """

    tree: bpy.types.NodeTree
    _undo: list[Callable[[], None]] = field(default_factory=list)

    def add_output(self, layer: str, expression: Expression) -> bpy.types.Node:
        """Add an output (AOV) for a layer with its expression; return the output's node."""
        output = self.new_output(layer)
        layer_input = output.inputs["Color" if MATERIAL_LAYERS.get(layer) == 3 else "Value"]
        self.tree.links.new(self.socket(expression), layer_input)
        return output

    def new_output(self, name: str) -> bpy.types.Node:
        """Add an output (AOV) with a name to the material; return its node."""
        node = self._new(self.tree, "ShaderNodeOutputAOV")
        node.aov_name = name
        return node

    def hide_transparency(self) -> None:
        """Make surfaces opaque for camera rays that go straight through them; light still comes through.

        Else a renderer adds up the layers of all surfaces along a ray.
        """
        visited: set[bpy.types.NodeTree] = set()
        trees = [self.tree]
        while trees:
            tree = trees.pop()
            if tree in visited:
                continue
            visited.add(tree)
            for node in list(tree.nodes):
                if node.type == "MIX_SHADER":
                    for shader_input, opaque_factor in zip(node.inputs[1:3], (1.0, 0.0), strict=True):
                        if shader_input.is_linked and shader_input.links[0].from_node.type == "BSDF_TRANSPARENT":
                            self._set_for_camera(tree, node.inputs[0], opaque_factor)
                elif node.type == "BSDF_PRINCIPLED":
                    alpha = node.inputs["Alpha"]
                    if alpha.is_linked or alpha.default_value < 1.0:
                        self._set_for_camera(tree, alpha, 1.0)
                elif node.type == "GROUP" and node.node_tree is not None:
                    trees.append(node.node_tree)

    def _set_for_camera(self, tree: bpy.types.NodeTree, input_socket: bpy.types.NodeSocket, value: float) -> None:
        """Give an input a constant value for camera rays, and the value that it had for other rays."""
        source, default = (
            (input_socket.links[0].from_socket if input_socket.is_linked else None),
            input_socket.default_value,
        )
        if source is not None:
            self._undo.append(lambda: tree.links.new(source, input_socket))
        path, mix = self._new(tree, "ShaderNodeLightPath"), self._new(tree, "ShaderNodeMix")
        factor, other_value, camera_value = mix.inputs["Factor"], mix.inputs["A"], mix.inputs["B"]
        other_value.default_value, camera_value.default_value = default, value
        tree.links.new(path.outputs["Is Camera Ray"], factor)
        if source is not None:
            tree.links.new(source, other_value)
        tree.links.new(mix.outputs["Result"], input_socket)

    def socket(self, expression: Expression) -> bpy.types.NodeSocket:
        """Return an output socket of the material's own tree that has an expression's value."""
        if isinstance(expression, Linked):
            result = expression.output
            for group in reversed(expression.path):
                result = self._group_output(group, result)
            return result
        if isinstance(expression, Constant):
            node = self._new(self.tree, "ShaderNodeRGB")
            node.outputs[0].default_value = (*expression.value, 1.0)
            return node.outputs[0]
        node = self._new(self.tree, "ShaderNodeMix")
        node.data_type, node.blend_type, node.clamp_factor = "RGBA", "MIX", True
        factor, a, b = (
            next(part_socket for part_socket in node.inputs if part_socket.identifier == name)
            for name in ("Factor_Float", "A_Color", "B_Color")
        )
        for part, part_socket in ((expression.factor, factor), (expression.a, a), (expression.b, b)):
            self.tree.links.new(self.socket(part), part_socket)
        return next(part_socket for part_socket in node.outputs if part_socket.identifier == "Result_Color")

    def _group_output(self, group: bpy.types.Node, inner_socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Add an output to a group node that passes on a socket inside the group; return it."""
        tree = group.node_tree
        output_node = group_output(tree)
        assert output_node is not None
        is_color = inner_socket.type != "VALUE"
        interface_socket = tree.interface.new_socket(
            "SR Layer", in_out="OUTPUT", socket_type=f"NodeSocket{'Color' if is_color else 'Float'}"
        )
        self._undo.append(lambda: tree.interface.remove(interface_socket))
        identifier = interface_socket.identifier
        tree.links.new(inner_socket, identified_socket(output_node.inputs, identifier))
        result = identified_socket(group.outputs, identifier)
        assert result is not None
        return result

    def _new(self, tree: bpy.types.NodeTree, kind: str) -> bpy.types.Node:
        """Add a node to a tree; note how to remove it. The tree's active node, which the user chose, stays active."""
        active_node = tree.nodes.active
        node = tree.nodes.new(kind)
        node.select = False
        tree.nodes.active = active_node
        self._undo.append(lambda: self._drop(tree, node, active_node))
        return node

    @staticmethod
    def _drop(tree: bpy.types.NodeTree, node: bpy.types.Node, active_node: bpy.types.Node | None) -> None:
        """Remove a node from a tree, and make another the active one."""
        tree.nodes.remove(node)
        tree.nodes.active = active_node

    def remove(self) -> None:
        """Remove all nodes and sockets that were added, the latest first."""
        while self._undo:
            self._undo.pop()()
