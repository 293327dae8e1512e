"""Construction of a Blender material's nodes: layers that vary around the means of the material table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import bpy

from ...materials.table import Material
from ..nodes.builder import Operand, Tree, Value
from ..nodes.layout import arrange

LAYERS = {"base_color": "COLOR", "roughness": "VALUE", "metallic": "VALUE", "specular": "VALUE"}
"""Render layers (AOVs) that every material has, and their kinds."""


@dataclass
class Shade:
    """A material under construction.

    Attributes:
        tree: the material's nodes.
        mean: the table's entry; the base colour's mean must stay equal to it.
        place: position in the world, m.
        factor: field that the base colour is multiplied with; its mean is 1. None for no variation.
        roughness, metallic, specular: fields whose means are the table's values; None for these values everywhere.
        relief: height of the surface's fine relief, m; None if it is smooth.
        transparency: share of the light that passes straight through.
        images: values of texture images by layer; ``normal`` is the surface's normal. An image replaces the layer's
            mean and noises; variation by the road's parameters (wear, age) is applied to the image too.
    """

    tree: Tree
    mean: Material
    place: Value
    factor: Value | None = None
    roughness: Value | None = None
    metallic: Value | None = None
    specular: Value | None = None
    relief: Value | None = None
    transparency: float = 0.0
    images: Mapping[str, Value] = field(default_factory=dict)

    def noise(self, wavelength: float, detail: float = 2.0, stretch: tuple[float, float, float] = (1, 1, 1)) -> Value:
        """Return a noise from -1 to 1 of mean 0 whose features are about `wavelength` (m) large."""
        place = self.place * stretch
        node = self.tree.node("ShaderNodeTexNoise", place, scale=1.0 / wavelength, detail=detail)
        return node.value * 2.0 - 1.0

    def vary(self, amount: float | tuple[float, float, float], noise: Value) -> None:
        """Let the base colour vary by +- `amount` (a share, or one for each of red, green and blue) with a noise."""
        change = noise * amount
        self.scale_texture((1.0, 1.0, 1.0) + change if isinstance(amount, tuple) else 1.0 + change)

    def scale_texture(self, change: Value) -> None:
        """Multiply the base colour with a field of mean 1 that is texture: not if an image gives the base colour."""
        if "base_color" not in self.images:
            self.scale(change)

    def scale(self, change: Value) -> None:
        """Multiply the base colour with a field of mean 1."""
        self.factor = change if self.factor is None else self.factor * change

    def layer(self, name: str, texture: Value) -> Value:
        """Return a layer of one number: its image's value, else its mean plus `texture`."""
        return self.images.get(name) or texture + getattr(self.mean, name)


def shade(
    item: bpy.types.Material,
    mean: Material,
    build: Callable[[Shade], None],
    add_images: Callable[[Tree], Mapping[str, Value]] | None = None,
) -> None:
    """Give a new Blender material its nodes: a Principled BSDF with the table's values, varied by `build`.

    Args:
        item: the new material.
        mean: the table's values.
        build: function that adds the variation.
        add_images: function that adds nodes of texture images and returns `Shade.images`; None for no images.
    """
    if item.node_tree is None:
        item.use_nodes = True
    item.node_tree.nodes.clear()
    tree = Tree(item.node_tree)
    images = add_images(tree) if add_images else {}
    with tree.frame("Variation around the mean"):
        place = tree.node("ShaderNodeNewGeometry")["Position"]
        variation = Shade(tree, mean, place, images=images)
        build(variation)
    with tree.frame("Surface"):
        surface = tree.node(
            "ShaderNodeBsdfPrincipled",
            base_color=(*mean.base_color, 1.0),
            roughness=mean.roughness,
            metallic=mean.metallic,
            specular_ior_level=mean.specular,
        )
        color: Operand = images.get("base_color", mean.base_color)
        if variation.factor is not None:
            color = tree.node("ShaderNodeVectorMath", color, variation.factor, operation="MULTIPLY").value
        if isinstance(color, Value):
            tree.feed(surface.raw.inputs["Base Color"], color)
        values = {name: _layer_value(variation, name) for name in ("roughness", "metallic", "specular")}
        input_names = (("roughness", "Roughness"), ("metallic", "Metallic"), ("specular", "Specular IOR Level"))
        for name, input_name in input_names:
            if isinstance(value := values[name], Value):
                tree.feed(surface.raw.inputs[input_name], value)
        if (normal := _normal(variation)) is not None:
            tree.feed(surface.raw.inputs["Normal"], normal)
        closure = surface.value
        if variation.transparency:
            transparent_closure = tree.node("ShaderNodeBsdfTransparent").value
            closure = tree.node("ShaderNodeMixShader", variation.transparency, closure, transparent_closure).value
        tree.node("ShaderNodeOutputMaterial", closure)
    with tree.frame("Layers"):
        _layer(tree, "base_color", color=color)
        for name, value in values.items():
            _layer(tree, name, value=value)
    item.diffuse_color = (*mean.base_color, 1.0)
    item.roughness, item.metallic = mean.roughness, mean.metallic
    tree.finish()
    if images:
        _remove_unused(item.node_tree)
    arrange(item.node_tree)


def _layer_value(shade: Shade, name: str) -> Operand:
    """Return a layer of one number: as it varies, clamped to 0..1, else the table's value."""
    value: Value | None = getattr(shade, name) or shade.images.get(name)
    if value is None:
        return float(getattr(shade.mean, name))
    return shade.tree.node("ShaderNodeClamp", value).value


def _normal(shade: Shade) -> Value | None:
    """Return the surface's normal from its image and its relief; None for the mesh's normal."""
    image = shade.images.get("normal")
    if shade.relief is None:
        return image
    normal_input = {} if image is None else {"normal": image}
    return shade.tree.node("ShaderNodeBump", distance=1.0, height=shade.relief, **normal_input).value


def _layer(tree: Tree, name: str, **value: Operand) -> None:
    """Add an output (AOV) for a render layer."""
    if isinstance(value.get("color"), tuple):
        value["color"] = (*value["color"], 1.0)  # type: ignore[misc]
    output = tree.node("ShaderNodeOutputAOV", **value)
    output.raw.aov_name = name


def _remove_unused(tree: bpy.types.NodeTree) -> None:
    """Remove nodes whose results aren't used, such as noises that an image replaces."""
    ends = ("OUTPUT_MATERIAL", "OUTPUT_AOV", "FRAME")
    while unused_nodes := [
        node for node in tree.nodes if node.type not in ends and not any(output.is_linked for output in node.outputs)
    ]:
        for node in unused_nodes:
            tree.nodes.remove(node)
