"""The image that gives a Blender material its base colour."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...scanning.colour.colour import decode_srgb

_SMALL = 64
"""Largest side of the copy that an image's mean is taken of, px."""


def color_image_node(item: bpy.types.Material) -> bpy.types.Node | None:
    """Return the image texture that feeds the Principled BSDF's base colour directly; None if there is none."""
    nodes = item.node_tree.nodes if item.node_tree else ()
    shader = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    links = shader.inputs["Base Color"].links if shader is not None else ()
    node = links[0].from_node if links else None
    return node if node is not None and node.type == "TEX_IMAGE" and node.image is not None else None


def mean_color(node: bpy.types.Node) -> tuple[float, float, float] | None:
    """Return the mean linear colour of an image texture's image, of a small copy of it; None of other nodes."""
    return mean_pixel(node.image, _SMALL) if node.type == "TEX_IMAGE" and node.image is not None else None


def mean_pixel(image: bpy.types.Image, largest: int) -> tuple[float, float, float] | None:
    """Return the mean linear colour of an image, of a copy where a side has over `largest` px; None if it has none."""
    if not image.size[0] * image.size[1]:
        return None
    small = image.copy() if max(image.size) > largest else None
    try:
        if small is not None:
            small.scale(*(min(largest, side) for side in image.size))
        red, green, blue = linear_pixels(small or image).reshape(-1, 3).mean(axis=0).tolist()
    except RuntimeError:  # its file is damaged
        return None
    finally:
        if small is not None:
            bpy.data.images.remove(small)
    return red, green, blue


def base_color_image(item: bpy.types.Material) -> NDArray[np.float64] | None:
    """Return the linear colours (height, width, 3) of that image, 0 to 1, its lowest row first; None without.

    Images of whole numbers in sRGB are turned linear; those of floats are linear in Blender already.
    """
    node = color_image_node(item)
    return None if node is None or not node.image.size[0] * node.image.size[1] else linear_pixels(node.image)


def linear_pixels(image: bpy.types.Image) -> NDArray[np.float64]:
    """Return an image's linear colours (height, width, 3), 0 to 1, its lowest row first."""
    flat = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
    image.pixels.foreach_get(flat)
    pixels = flat.reshape(image.size[1], image.size[0], image.channels)
    colors = pixels[:, :, :3] if image.channels >= 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    linear: NDArray[np.float64] = np.clip(colors, 0.0, 1.0).astype(np.float64)
    return decode_srgb(linear) if not image.is_float and image.colorspace_settings.name == "sRGB" else linear
