"""The small vocabulary that the materials are written in: a colour that varies around the table's mean."""

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
        tree: its nodes.
        mean: the table's entry; the base colour's mean must stay equal to it.
        place: position in the world, m.
        factor: what the base colour is multiplied with; its mean is 1.
        roughness, metallic, specular: what takes the place of the table's values; their means are these.
        relief: height that the surface stands out by, m; nothing for a smooth one.
        transparency: share of the light that passes straight through.
        images: what images give, by layer; ``normal`` is the surface's normal. They take the place of the mean and of
            what is only texture; what the road's parameters say of a place stays.
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
        """Let the base colour vary by +- `amount` (a share, or one for each of red, green and blue) with the noise."""
        change = noise * amount
        self.scale_texture((1.0, 1.0, 1.0) + change if isinstance(amount, tuple) else 1.0 + change)

    def scale_texture(self, change: Value) -> None:
        """Multiply the base colour with a field of mean 1 that is texture: unless an image gives it."""
        if "base_color" not in self.images:
            self.scale(change)

    def scale(self, change: Value) -> None:
        """Multiply the base colour with a field of mean 1."""
        self.factor = change if self.factor is None else self.factor * change

    def layer(self, name: str, texture: Value) -> Value:
        """Return a layer of one number: its mean and what texture adds, or what an image gives in place of both."""
        return self.images.get(name) or texture + getattr(self.mean, name)


def shade(
    item: bpy.types.Material,
    mean: Material,
    build: Callable[[Shade], None],
    add_images: Callable[[Tree], Mapping[str, Value]] | None = None,
) -> None:
    """Give a new Blender material its nodes: a Principled BSDF with the table's values, varied by `build`.

    Args:
        item: the material.
        mean: the values.
        build: adds what varies.
        add_images: adds the nodes of the images that take layers' places, and returns `Shade.images`.
    """
    if item.node_tree is None:
        item.use_nodes = True
    item.node_tree.nodes.clear()
    tree = Tree(item.node_tree)
    images = add_images(tree) if add_images else {}
    with tree.frame("Variation around the mean"):
        place = tree.node("ShaderNodeNewGeometry")["Position"]
        varied = Shade(tree, mean, place, images=images)
        build(varied)
    with tree.frame("Surface"):
        surface = tree.node(
            "ShaderNodeBsdfPrincipled",
            base_color=(*mean.base_color, 1.0),
            roughness=mean.roughness,
            metallic=mean.metallic,
            specular_ior_level=mean.specular,
        )
        color: Operand = images.get("base_color", mean.base_color)
        if varied.factor is not None:
            color = tree.node("ShaderNodeVectorMath", color, varied.factor, operation="MULTIPLY").value
        if isinstance(color, Value):
            tree.feed(surface.raw.inputs["Base Color"], color)
        values = {name: _varied(varied, name) for name in ("roughness", "metallic", "specular")}
        entries = (("roughness", "Roughness"), ("metallic", "Metallic"), ("specular", "Specular IOR Level"))
        for name, entry in entries:
            if isinstance(value := values[name], Value):
                tree.feed(surface.raw.inputs[entry], value)
        if (normal := _normal(varied)) is not None:
            tree.feed(surface.raw.inputs["Normal"], normal)
        seen = surface.value
        if varied.transparency:
            clear = tree.node("ShaderNodeBsdfTransparent").value
            seen = tree.node("ShaderNodeMixShader", varied.transparency, seen, clear).value
        tree.node("ShaderNodeOutputMaterial", seen)
    with tree.frame("Layers"):
        _layer(tree, "base_color", color=color)
        for name, value in values.items():
            _layer(tree, name, value=value)
    item.diffuse_color = (*mean.base_color, 1.0)
    item.roughness, item.metallic = mean.roughness, mean.metallic
    tree.finish()
    if images:
        _remove_idle(item.node_tree)
    arrange(item.node_tree)


def _varied(shade: Shade, name: str) -> Operand:
    """Return a layer of one number: as it varies, kept between 0 and 1, else the table's value."""
    value: Value | None = getattr(shade, name) or shade.images.get(name)
    if value is None:
        return float(getattr(shade.mean, name))
    return shade.tree.node("ShaderNodeClamp", value).value


def _normal(shade: Shade) -> Value | None:
    """Return the normal of the surface as its relief and its image turn it; None for the mesh's own."""
    image = shade.images.get("normal")
    if shade.relief is None:
        return image
    turned = {} if image is None else {"normal": image}
    return shade.tree.node("ShaderNodeBump", distance=1.0, height=shade.relief, **turned).value


def _layer(tree: Tree, name: str, **value: Operand) -> None:
    """Add an output for a render layer of this name."""
    if isinstance(value.get("color"), tuple):
        value["color"] = (*value["color"], 1.0)  # type: ignore[misc]
    output = tree.node("ShaderNodeOutputAOV", **value)
    output.raw.aov_name = name


def _remove_idle(tree: bpy.types.NodeTree) -> None:
    """Remove nodes whose results nothing takes, as of noises whose place an image has."""
    ends = ("OUTPUT_MATERIAL", "OUTPUT_AOV", "FRAME")
    while idle := [
        node for node in tree.nodes if node.type not in ends and not any(out.is_linked for out in node.outputs)
    ]:
        for node in idle:
            tree.nodes.remove(node)
