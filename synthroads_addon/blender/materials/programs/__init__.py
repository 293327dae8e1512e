"""Materials as programs for the kernel (`scanning.kernels.materials`), where all of their nodes are known."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ....scanning.colour.colour import MATERIAL_LAYERS
from ....scanning.kernels.program import ProgramBuilder
from ....scanning.scene.surface_values import SurfaceInput

# Each adds what it reads to the table of all.
from . import arithmetic, colours, pictures, textures
from .tree import TreeReader, UnknownNodeError

__all__ = ["UnknownNodeError", "arithmetic", "colours", "compile_material", "pictures", "textures"]


def compile_material(
    tree: bpy.types.NodeTree, inputs: Sequence[tuple[SurfaceInput, bpy.types.Node]], layers: Sequence[str]
) -> ProgramBuilder:
    """Return what makes the program that gives a material's layers, or some of them.

    Args:
        tree: its nodes, with an output for each of the layers that they say something of.
        inputs: nodes that stand for what is read of the places.
        layers: names of those that are asked for; what the material says nothing of is left out.

    Raises:
        UnknownNodeError: a node, or a setting of one, that programs aren't made of.
    """
    reader = TreeReader({node: what for what, node in inputs})
    for node in tree.nodes:
        if node.type == "OUTPUT_AOV" and node.aov_name in layers:
            parts = MATERIAL_LAYERS[node.aov_name]
            value = reader.entry(node.inputs["Color" if parts == 3 else "Value"], ())
            numbers = value if isinstance(value, tuple) else (value,)
            reader.builder.output(node.aov_name, [number.value for number in numbers])
    return reader.builder
