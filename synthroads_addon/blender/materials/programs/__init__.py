"""Materials as programs for the kernel (`scanning.kernels.materials`), where all of their nodes are known."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ....scanning.colour.colour import MATERIAL_LAYERS
from ....scanning.kernels.program import ProgramBuilder
from ....scanning.scene.surface_values import SurfaceInput

# Each of these modules adds its readers of nodes to `tree.READERS` when it is imported.
from . import arithmetic, colours, pictures, textures
from .tree import TreeReader, UnknownNodeError

__all__ = ["UnknownNodeError", "arithmetic", "colours", "compile_material", "pictures", "textures"]


def compile_material(
    tree: bpy.types.NodeTree, inputs: Sequence[tuple[SurfaceInput, bpy.types.Node]], layers: Sequence[str]
) -> ProgramBuilder:
    """Return the builder of a program that evaluates a material's layers.

    Args:
        tree: the material's nodes, with an output (AOV) for each layer that they define.
        inputs: pairs of an input of the place and the node that stands for it.
        layers: names of the layers to compile; layers that the material doesn't define are left out.

    Raises:
        UnknownNodeError: the material has a node, or a setting of one, that programs can't express.
    """
    reader = TreeReader({node: surface_input for surface_input, node in inputs})
    for node in tree.nodes:
        if node.type == "OUTPUT_AOV" and node.aov_name in layers:
            parts = MATERIAL_LAYERS[node.aov_name]
            value = reader.input_value(node.inputs["Color" if parts == 3 else "Value"], ())
            numbers = value if isinstance(value, tuple) else (value,)
            reader.builder.output(node.aov_name, [number.value for number in numbers])
    return reader.builder
