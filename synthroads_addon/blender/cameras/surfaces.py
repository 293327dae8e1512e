"""Material layers that vary over surfaces, and the outputs (AOVs) that show them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeAlias

import bpy
import numpy as np

from ...scanning.colour.colour import MATERIAL_LAYERS, SurfaceConstants, surface_constants
from ..materials import PROPERTY, constants, table_name

NUMBER = "sr_material"
"""Output that shows the material's number, for renderers that have no pass for it."""
_PRINCIPLED = {"base_color": "Base Color", "roughness": "Roughness", "metallic": "Metallic"}
"""Inputs of a Principled BSDF by layer; its specular isn't the scanner's, see `blender.materials.constants`."""


def scene_constants(names: Sequence[str]) -> SurfaceConstants:
    """Return the means of a scene mesh's materials and which of their layers vary."""
    varies = {layer: np.zeros(len(names), bool) for layer in MATERIAL_LAYERS}
    for index, item in _materials(names):
        for layer in MATERIAL_LAYERS:
            varies[layer][index] |= _source(item, layer) is not None
    return surface_constants([constants(names)[name] for name in names], varies)


_Added: TypeAlias = "tuple[bpy.types.NodeTree, bpy.types.Node, bpy.types.Node | None]"
"""A node that was added, its tree, and the node that was active there before."""


@contextmanager
def prepared_materials(names: Sequence[str], layers: Sequence[str], numbers: bool) -> Iterator[None]:
    """Number the materials, give those that lack them outputs for layers, and undo it afterwards.

    Args:
        names: the scene mesh's materials; their numbers, as pass index, are their indices plus 1.
        layers: those that are rendered.
        numbers: whether the materials' numbers need an output as well.
    """
    before: list[tuple[bpy.types.Material, int]] = []
    added: list[_Added] = []
    try:
        for index, item in _materials(names):
            before.append((item, item.pass_index))
            item.pass_index = index + 1
            added += [_output(item, layer) for layer in layers if _needs_output(item, layer)]
            if numbers and item.node_tree:
                added.append(_new_output(item, NUMBER))
                added[-1][1].inputs["Value"].default_value = index + 1
        yield
    finally:
        for tree, node, active in reversed(added):
            tree.nodes.remove(node)
            tree.nodes.active = active
        for item, number in before:
            item.pass_index = number


def _materials(names: Sequence[str]) -> Iterator[tuple[int, bpy.types.Material]]:
    index = {name: number for number, name in enumerate(names)}
    for item in bpy.data.materials:
        if (name := table_name(item)) in index:
            yield index[name], item


def _node(item: bpy.types.Material, kind: str, name: str = "") -> bpy.types.Node | None:
    nodes = item.node_tree.nodes if item.node_tree else ()
    return next((node for node in nodes if node.type == kind and name in ("", getattr(node, "aov_name", ""))), None)


def _source(item: bpy.types.Material, layer: str) -> bpy.types.NodeSocket | None:
    """Return the socket that a layer of a material comes from, or None where it is a constant."""
    if (output := _node(item, "OUTPUT_AOV", layer)) is not None:
        socket = output.inputs["Color" if MATERIAL_LAYERS[layer] == 3 else "Value"]
    elif PROPERTY not in item and layer in _PRINCIPLED and (shader := _node(item, "BSDF_PRINCIPLED")) is not None:
        socket = shader.inputs[_PRINCIPLED[layer]]
    else:
        return None
    return socket.links[0].from_socket if socket.links else None


def _needs_output(item: bpy.types.Material, layer: str) -> bool:
    return _node(item, "OUTPUT_AOV", layer) is None and _source(item, layer) is not None


def _output(item: bpy.types.Material, layer: str) -> _Added:
    source = _source(item, layer)
    tree, node, active = _new_output(item, layer)
    tree.links.new(source, node.inputs["Color" if MATERIAL_LAYERS[layer] == 3 else "Value"])
    return tree, node, active


def _new_output(item: bpy.types.Material, name: str) -> _Added:
    tree = item.node_tree
    active = tree.nodes.active
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name, node.select = name, False
    tree.nodes.active = active
    return tree, node, active
