"""Image Texture nodes: an image's pixels as Cycles stores them, and their look-up."""

from __future__ import annotations

import bpy
import numpy as np

from ....scanning.kernels.program import Op, Picture
from ..image import is_missing
from .numbers import Number, each
from .tree import NodeReader, Pixels, UnknownNodeError, Value, reads

_INTERPOLATIONS = {"Closest": 0, "Linear": 1, "Cubic": 2, "Smart": 2}
_EXTENSIONS = {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}
_LINEAR = ("Linear Rec.709", "Linear", "Non-Color", "Raw")
"""Colour spaces whose numbers are used unchanged."""


@reads("TexImage")
def _image(node: NodeReader) -> Value:
    """Return the result of an Image Texture node with flat projection: colour, or alpha."""
    texture_node, image = node.node, node.node.image
    if texture_node.projection != "FLAT":
        raise node.refuse(texture_node.projection)
    if image is None or is_missing(image):
        raise node.refuse("no image")
    if image.source not in ("FILE", "GENERATED") or image.is_multiview or image.type not in ("IMAGE", "UV_TEST"):
        raise node.refuse(image.source)
    is_encoded = _is_encoded(node, image)
    pixels = node.tree.pixels_of(image, lambda: _pixels(image))
    opaque = 255 if pixels.dtype == np.uint8 else 1.0
    if image.alpha_mode not in ("NONE", "CHANNEL_PACKED") and (pixels[:, :, 3] != opaque).any():
        raise node.refuse("transparent image")
    number = node.builder.picture(
        Picture(pixels, _INTERPOLATIONS[texture_node.interpolation], _EXTENSIONS[texture_node.extension])
    )
    u, v, _ = node.place()
    first_result = node.builder.add(Op.IMAGE, u.value, v.value, settings=(number,), results=4)
    red, green, blue, alpha = (Number(node.builder, first_result + part) for part in range(4))
    if node.socket.identifier == "Alpha":
        return alpha
    color = red, green, blue
    return each(lambda part: part.apply(Op.TO_LINEAR), color) if is_encoded else color


def _is_encoded(node: NodeReader, image: bpy.types.Image) -> bool:
    """Return whether an image's numbers are encoded as sRGB, which Cycles decodes after interpolation."""
    space = image.colorspace_settings.name
    if space in _LINEAR:
        return False
    if space == "sRGB" and not image.is_float:
        return True
    raise node.refuse(f"colours of {space}")


def _pixels(image: bpy.types.Image) -> Pixels:
    """Return an image's pixels (height, width, 4), float32 or 8 bits as the image has them; alpha is 1 if it has none.

    Raises:
        UnknownNodeError: the image is empty, or has two channels.
    """
    width, height = image.size
    count = image.channels
    if not width * height or count not in (1, 3, 4):
        raise UnknownNodeError(f"Image Texture: {count} channels")
    pixel_values = np.empty(width * height * count, np.float32)
    image.pixels.foreach_get(pixel_values)
    values = pixel_values.reshape(height, width, count)
    used_channels = count if image.alpha_mode != "NONE" else min(count, 3)
    if image.is_float:
        result: Pixels = np.ones((height, width, 4), np.float32)
    else:  # a quarter of the memory
        result = np.full((height, width, 4), 255, np.uint8)
        np.rint(np.multiply(values, np.float32(255.0), out=values), out=values)
    result[:, :, :3] = values[:, :, : min(count, 3)]
    if used_channels == 4:
        result[:, :, 3] = values[:, :, 3]
    return result
