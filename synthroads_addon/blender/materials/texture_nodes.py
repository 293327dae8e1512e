"""Nodes of a material's textures: coordinates of each place on the images, and the images' values there.

With station and offset, an image's width lies along the road and its height points to the left. Elsewhere coordinates
follow from the place in the world (box projection): from above on faces that lie flat, else along the horizontal axis
that the face is most nearly perpendicular to.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..nodes import operations as op
from ..nodes.builder import Operand, Tree, Value
from .pavement import ATTRIBUTE
from .textures import Texture

_LEAST_COSINE = 0.1
"""Least cosine between a bump's normal and the surface's, which slopes are divided by; chosen."""


def texture_values(
    tree: Tree, texture: Texture, factors: Mapping[str, float | tuple[float, float, float]]
) -> dict[str, Value]:
    """Add the nodes of a material's textures; return the value of each layer, and the surface's normal as ``normal``.

    Args:
        tree: the material's nodes.
        texture: the images.
        factors: factors of the images' values, by layer.
    """
    with tree.frame("Place on the textures"):
        geometry = tree.node("ShaderNodeNewGeometry")
        mapping = _Mapping(tree, geometry["Position"], geometry["True Normal"], texture.along)
    values: dict[str, Value] = {}
    with tree.frame("Textures"):
        for layer, image in texture.images.items():
            image_place = mapping.place * (1.0 / texture.tile, image.size[0] / image.size[1] / texture.tile, 0.0)
            image_node = tree.node("ShaderNodeTexImage", image_place, image=image, extension="REPEAT").raw
            # As a vector: a number taken from a colour is its luminance, whose weights don't add up to 1 exactly.
            color = Value(tree, image_node.outputs["Color"], "VECTOR")
            if layer == "normal":
                values[layer] = mapping.tilted_normal(geometry["Normal"], color)
            else:
                values[layer] = _scaled(color if layer == "base_color" else op.component(color, "X"), factors[layer])
    return values


def _scaled(value: Value, factor: float | tuple[float, float, float]) -> Value:
    """Return a value times a factor, without a node if the factor is 1."""
    return value if factor in (1.0, (1.0, 1.0, 1.0)) else value * factor


class _Mapping:
    """Coordinates of places on the images, and the directions of the images' sides there.

    Args:
        tree: the material's nodes.
        place: position in the world, m.
        normal: normal of the face.
        along_road: whether to use station and offset where the mesh has them.

    Attributes:
        place: coordinates along the images' width and height, m.
    """

    def __init__(self, tree: Tree, place: Value, normal: Value, along_road: bool) -> None:
        self._tree, self._has_station, self._offset = tree, None, None
        x, y, z = (op.component(place, axis) for axis in "XYZ")
        absolute_normal = tree.node("ShaderNodeVectorMath", normal, operation="ABSOLUTE").value
        east, north, up = (op.component(absolute_normal, axis) for axis in "XYZ")
        # Box projection: from above where the normal is nearest to the vertical, else along x or y.
        self._is_flat = self._is_greater(up, op.maximum(east, north))
        self._faces_east = self._is_greater(east, north)
        u = _choose(self._is_flat, _choose(self._faces_east, x, y), x)
        v = _choose(self._is_flat, z, y)
        if along_road:
            road_place = tree.node("ShaderNodeAttribute", attribute_name=ATTRIBUTE)["Vector"]
            # The third component is the code of strip and lane width: 0 where the mesh has no station.
            self._has_station = self._is_greater(op.component(road_place, "Z"), 0.5)
            offset = tree.node("ShaderNodeAttribute", attribute_name="offset")["Vector"]
            self._offset = op.component(offset, "X")
            u = _choose(self._has_station, u, op.component(road_place, "X"))
            v = _choose(self._has_station, v, self._offset)
        self.place = op.vector(tree, u, v)

    def tilted_normal(self, normal: Value, color: Value) -> Value:
        """Add nodes for the surface's normal tilted by a normal image's colour (OpenGL convention: green is up)."""
        slopes = color * 2.0 - (1.0, 1.0, 1.0)
        cosine = op.maximum(op.component(slopes, "Z"), _LEAST_COSINE)
        width, height = self._sides(normal)
        slope = width * (op.component(slopes, "X") / cosine) + height * (op.component(slopes, "Y") / cosine)
        return op.normalize(normal + slope)

    def _sides(self, normal: Value) -> tuple[Value, Value]:
        """Add nodes for the directions in the world of an image's width and height, of length 1."""
        tree, is_flat, faces_east = self._tree, self._is_flat, self._faces_east
        is_upright = 1.0 - is_flat
        width = op.vector(tree, is_flat + is_upright * (1.0 - faces_east), is_upright * faces_east)
        height = op.vector(tree, 0.0, is_flat, is_upright)
        if self._has_station is None or self._offset is None:
            return width, height
        # A bump is turned from the normal by the slope of its height, here that of the offset: it rises to the left.
        bump = tree.node("ShaderNodeBump", distance=1.0, height=self._offset, normal=normal).value
        left_direction = op.normalize(normal - bump * (1.0 / op.maximum(op.dot(bump, normal), _LEAST_COSINE)))
        forward_direction = tree.node("ShaderNodeVectorMath", left_direction, normal, operation="CROSS_PRODUCT").value
        return _choose(self._has_station, width, forward_direction), _choose(self._has_station, height, left_direction)

    def _is_greater(self, value: Value, limit: Operand) -> Value:
        """Add a node that gives 1 where a value exceeds another, else 0."""
        return self._tree.node("ShaderNodeMath", value, limit, operation="GREATER_THAN").value


def _choose(flag: Value, value_if_0: Value, value_if_1: Value) -> Value:
    """Add nodes for `value_if_1` where a flag is 1, `value_if_0` where it is 0: exact, as no difference is rounded."""
    return value_if_0 * (1.0 - flag) + value_if_1 * flag
