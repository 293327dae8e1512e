"""The small vocabulary that the materials are written in: a colour that varies around the table's mean."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy

from ...core.materials import Material
from ..nodes.builder import Tree, Value
from ..nodes.layout import arrange


@dataclass
class Shade:
    """A material under construction.

    Attributes:
        tree: its nodes.
        mean: the table's entry; the base colour's mean must stay equal to it.
        place: position in the world, m.
        factor: what the base colour is multiplied with; its mean is 1.
        tint: second base colour to mix towards and its share (a field of mean 0.5), or None.
    """

    tree: Tree
    mean: Material
    place: Value
    factor: Value | None = None
    roughness: Value | None = None

    def noise(
        self, wavelength: float, detail: float = 2.0, stretch: tuple[float, float, float] = (1, 1, 1)
    ) -> Value:
        """Return a noise from -1 to 1 of mean 0 whose features are about `wavelength` (m) large."""
        place = self.tree.node("ShaderNodeVectorMath", self.place, stretch, operation="MULTIPLY").value
        node = self.tree.node("ShaderNodeTexNoise", place, scale=1.0 / wavelength, detail=detail)
        return node.value * 2.0 - 1.0

    def vary(self, amount: float, noise: Value) -> None:
        """Let the base colour vary by +- `amount` (a share) with the noise."""
        change = 1.0 + noise * amount
        self.factor = change if self.factor is None else self.factor * change


def shade(item: bpy.types.Material, mean: Material, build: Callable[[Shade], None] | None) -> None:
    """Give a new Blender material its nodes: a Principled BSDF with the table's values, varied by `build`."""
    if item.node_tree is None:
        item.use_nodes = True
    item.node_tree.nodes.clear()
    tree = Tree(item.node_tree)
    with tree.frame("Variation around the mean"):
        place = tree.node("ShaderNodeNewGeometry")["Position"]
        varied = Shade(tree, mean, place)
        if build:
            build(varied)
    with tree.frame("Surface"):
        surface = tree.node(
            "ShaderNodeBsdfPrincipled",
            base_color=(*mean.base_color, 1.0),
            roughness=mean.roughness,
            metallic=mean.metallic,
            specular_ior_level=mean.specular,
        )
        if varied.factor is not None:
            scaled = tree.node(
                "ShaderNodeVectorMath", mean.base_color, scale=varied.factor, operation="SCALE"
            ).value
            tree.group.links.new(scaled.source(), surface.raw.inputs["Base Color"])
        tree.node("ShaderNodeOutputMaterial", surface.value)
    item.diffuse_color = (*mean.base_color, 1.0)
    item.roughness, item.metallic = mean.roughness, mean.metallic
    arrange(item.node_tree)
