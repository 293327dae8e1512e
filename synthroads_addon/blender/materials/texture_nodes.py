"""Nodes of a material's textures: where each place lies on the images, and what they give there.

By station and offset an image's width lies along the road and its height to the left. By the place in the world it is
seen from above on what lies, and from the side on what stands: along the axis that the face turns to most.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..nodes import operations as op
from ..nodes.builder import Operand, Tree, Value
from .pavement import ATTRIBUTE
from .textures import Texture

_STEEPEST = 0.1
"""Least share of a normal image's blue: beyond it slopes would have no end."""


def texture_values(
    tree: Tree, texture: Texture, factors: Mapping[str, float | tuple[float, float, float]]
) -> dict[str, Value]:
    """Add the nodes of a material's textures; return what each layer's image gives, and the normal of its bump.

    Args:
        tree: the material's.
        texture: the images.
        factors: what the images are multiplied with, by layer.
    """
    with tree.frame("Place on the textures"):
        geometry = tree.node("ShaderNodeNewGeometry")
        mapping = _Mapping(tree, geometry["Position"], geometry["True Normal"], texture.along)
    values: dict[str, Value] = {}
    with tree.frame("Textures"):
        for layer, image in texture.images.items():
            place_on = mapping.place * (1.0 / texture.tile, image.size[0] / image.size[1] / texture.tile, 0.0)
            raw = tree.node("ShaderNodeTexImage", place_on, image=image, extension="REPEAT").raw
            # As a vector: a number taken from a colour is its luminance, whose weights don't add up to 1 exactly.
            color = Value(tree, raw.outputs["Color"], "VECTOR")
            if layer == "normal":
                values[layer] = mapping.turned(geometry["Normal"], color)
            else:
                values[layer] = _scaled(color if layer == "base_color" else op.component(color, "X"), factors[layer])
    return values


def _scaled(value: Value, factor: float | tuple[float, float, float]) -> Value:
    return value if factor in (1.0, (1.0, 1.0, 1.0)) else value * factor


class _Mapping:
    """Where places lie on the images, m, and which way the images' sides run there.

    Attributes:
        place: along the images' width and height.
    """

    def __init__(self, tree: Tree, place: Value, normal: Value, along: bool) -> None:
        self._tree, self._known, self._offset = tree, None, None
        x, y, z = (op.component(place, axis) for axis in "XYZ")
        turned = tree.node("ShaderNodeVectorMath", normal, operation="ABSOLUTE").value
        east, north, up = (op.component(turned, axis) for axis in "XYZ")
        self._lies = self._above(up, op.maximum(east, north))
        self._beside = self._above(east, north)
        across = _choose(self._lies, _choose(self._beside, x, y), x)
        upwards = _choose(self._lies, z, y)
        if along:
            place_on_road = tree.node("ShaderNodeAttribute", attribute_name=ATTRIBUTE)["Vector"]
            self._known = self._above(op.component(place_on_road, "Z"), 0.5)
            offset = tree.node("ShaderNodeAttribute", attribute_name="offset")["Vector"]
            self._offset = op.component(offset, "X")
            across = _choose(self._known, across, op.component(place_on_road, "X"))
            upwards = _choose(self._known, upwards, self._offset)
        self.place = op.vector(tree, across, upwards)

    def turned(self, normal: Value, color: Value) -> Value:
        """Add nodes for the surface's normal turned as a normal image's colour says (OpenGL: green is up)."""
        slopes = color * 2.0 - (1.0, 1.0, 1.0)
        steep = op.maximum(op.component(slopes, "Z"), _STEEPEST)
        width, height = self._sides(normal)
        bent = width * (op.component(slopes, "X") / steep) + height * (op.component(slopes, "Y") / steep)
        return op.normalize(normal + bent)

    def _sides(self, normal: Value) -> tuple[Value, Value]:
        """Add nodes for the directions in the world of an image's width and height, of length 1."""
        tree, lies, beside = self._tree, self._lies, self._beside
        stands = 1.0 - lies
        width = op.vector(tree, lies + stands * (1.0 - beside), stands * beside)
        height = op.vector(tree, 0.0, lies, stands)
        if self._known is None or self._offset is None:
            return width, height
        # A bump is turned from the normal by the slope of its height, here that of the offset: it rises to the left.
        bump = tree.node("ShaderNodeBump", distance=1.0, height=self._offset, normal=normal).value
        left = op.normalize(normal - bump * (1.0 / op.maximum(op.dot(bump, normal), _STEEPEST)))
        forwards = tree.node("ShaderNodeVectorMath", left, normal, operation="CROSS_PRODUCT").value
        return _choose(self._known, width, forwards), _choose(self._known, height, left)

    def _above(self, value: Value, other: Operand) -> Value:
        return self._tree.node("ShaderNodeMath", value, other, operation="GREATER_THAN").value


def _choose(flag: Value, no: Value, yes: Value) -> Value:
    """Add nodes for `yes` where a flag is 1, and `no` where it is 0: exactly, which a difference wouldn't be."""
    return no * (1.0 - flag) + yes * flag
