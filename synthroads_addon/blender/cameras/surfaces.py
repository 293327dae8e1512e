"""Materials of a scene as they are rendered: their constants, and outputs for their layers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import bpy
import numpy as np

from ...base.arrays import Bool
from ...scanning.colour.colour import MATERIAL_LAYERS, SurfaceConstants, surface_constants
from ...scanning.colour.transparency import Transparency
from ...scanning.relief.normal_images import NormalImage
from ..materials import constants, scene_name
from ..materials.image import linear_pixels, missing_images_filled, trees_below
from ..materials.surface_layers import LayerNodes, layer_expressions, varies
from ..materials.textures import NORMAL_IMAGE, is_normal_image
from ..materials.transparency import read_transparency

NUMBER = "sr_material"
"""Name of the output that shows the material's number plus 1, for renderers without a pass for it."""


def scene_constants(names: Sequence[str]) -> SurfaceConstants:
    """Return the mean layers of the named materials, and which layers vary on which."""
    means = constants(names)  # all at once, so that each image is averaged once: that takes 0.05 s and more
    return surface_constants([means[name] for name in names], varying_materials_by_layer(names))


def varying_materials_by_layer(names: Sequence[str]) -> dict[str, Bool]:
    """Return masks (M,) of the M named materials on which each layer of `MATERIAL_LAYERS` varies, by its name."""
    varying = {layer: np.zeros(len(names), bool) for layer in MATERIAL_LAYERS}
    for index, item in numbered_materials(names):
        for layer, expression in layer_expressions(item).items():
            varying[layer][index] |= varies(expression)
    return varying


def normal_images(names: Sequence[str]) -> dict[int, NormalImage]:
    """Return the normal images of a road's textures on the named materials, by the material's index."""
    normals = {}
    for index, item in numbered_materials(names):
        if NORMAL_IMAGE in item:
            tile, along_road = item[NORMAL_IMAGE]
            nodes = item.node_tree.nodes if item.node_tree else ()
            images = [node.image for node in nodes if node.type == "TEX_IMAGE" and is_normal_image(node.image)]
            if images:
                normals[index] = NormalImage.of(linear_pixels(images[0]), tile, bool(along_road))
    return normals


def transparencies(names: Sequence[str]) -> dict[int, Transparency]:
    """Return the share of light that the named materials let through at each place, by the material's index."""
    transparency_by_index = {index: read_transparency(item).transparency for index, item in numbered_materials(names)}
    return {index: transparency for index, transparency in transparency_by_index.items() if transparency is not None}


@contextmanager
def prepared_materials(names: Sequence[str], layers: Sequence[str], numbers: bool) -> Iterator[None]:
    """Context in which the named materials have pass indices and outputs for the layers; undone on exit.

    Args:
        names: names of the scene mesh's materials; a material's pass index is its index among them plus 1.
        layers: names of the layers to render.
        numbers: whether the materials' numbers need an output as well.
    """
    pass_indices: list[tuple[bpy.types.Material, int]] = []
    layer_nodes: list[LayerNodes] = []
    items = [item for _, item in numbered_materials(names) if item.node_tree]
    trees = {tree for item in items for tree in trees_below(item.node_tree)}
    stack = ExitStack()
    try:
        stack.enter_context(missing_images_filled(trees))
        for index, item in numbered_materials(names):
            pass_indices.append((item, item.pass_index))
            item.pass_index = index + 1
            if item.node_tree:
                layer_nodes.append(LayerNodes(item.node_tree))
                add_layer_outputs(item, layers, layer_nodes[-1])
                layer_nodes[-1].hide_transparency()
                if numbers:
                    layer_nodes[-1].new_output(NUMBER).inputs["Value"].default_value = index + 1
        yield
    finally:
        for nodes in reversed(layer_nodes):
            nodes.remove()
        for item, number in pass_indices:
            item.pass_index = number
        stack.close()


def add_layer_outputs(item: bpy.types.Material, layers: Sequence[str], nodes: LayerNodes) -> None:
    """Add AOV outputs to a material for the layers that vary on it and lack one; `nodes` keeps what was added."""
    expressions = layer_expressions(item)
    outputs = {node.aov_name for node in item.node_tree.nodes if node.type == "OUTPUT_AOV"}
    for layer in layers:
        if layer in expressions and layer not in outputs and varies(expressions[layer]):
            nodes.add_output(layer, expressions[layer])


def numbered_materials(names: Sequence[str]) -> Iterator[tuple[int, bpy.types.Material]]:
    """Yield (index in `names`, material) of those of the open file's materials whose scene names are in `names`."""
    index = {name: number for number, name in enumerate(names)}
    for item in bpy.data.materials:
        if (name := scene_name(item)) in index:
            yield index[name], item
