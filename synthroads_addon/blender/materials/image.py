"""The image that gives a Blender material its base colour."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.pictures import picture_kind
from ...scanning.colour.colour import decode_srgb

_SMALL = 64
"""Side of an image beyond which its mean is taken from a smaller copy, px; chosen."""


def color_image_node(item: bpy.types.Material) -> bpy.types.Node | None:
    """Return the image texture that is linked to the Principled BSDF's base colour; None if there is none."""
    nodes = item.node_tree.nodes if item.node_tree else ()
    shader = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    links = shader.inputs["Base Color"].links if shader is not None else ()
    node = links[0].from_node if links else None
    return node if node is not None and node.type == "TEX_IMAGE" and node.image is not None else None


def mean_color(node: bpy.types.Node) -> tuple[float, float, float] | None:
    """Return the mean linear colour of an image texture's image, from a small copy of it; None for other nodes."""
    return mean_pixel(node.image, _SMALL) if node.type == "TEX_IMAGE" and node.image is not None else None


def mean_pixel(image: bpy.types.Image, largest_side: int) -> tuple[float, float, float] | None:
    """Return the mean linear colour of an image, scaled to `largest_side` px if larger; None if it is damaged."""
    if not image.size[0] * image.size[1]:
        return None
    scaled_copy = image.copy() if max(image.size) > largest_side else None
    try:
        if scaled_copy is not None:
            scaled_copy.scale(*(min(largest_side, side) for side in image.size))
        red, green, blue = linear_pixels(scaled_copy or image).reshape(-1, 3).mean(axis=0).tolist()
    except RuntimeError:  # its file is damaged
        return None
    finally:
        if scaled_copy is not None:
            bpy.data.images.remove(scaled_copy)
    return red, green, blue


def base_color_image(item: bpy.types.Material) -> NDArray[np.float64] | None:
    """Return the linear colours (height, width, 3), 0 to 1, of the image of a material's base colour; None without one.

    The lowest row comes first. Whole numbers in sRGB are converted; images of floats are linear in Blender already.
    """
    node = color_image_node(item)
    return None if node is None or not node.image.size[0] * node.image.size[1] else linear_pixels(node.image)


def linear_pixels(image: bpy.types.Image) -> NDArray[np.float64]:
    """Return an image's linear colours (height, width, 3), 0 to 1, its lowest row first."""
    pixels = _pixels(image)
    colors = pixels[:, :, :3] if image.channels >= 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    linear: NDArray[np.float64] = np.clip(colors, 0.0, 1.0).astype(np.float64)
    return decode_srgb(linear) if not image.is_float and image.colorspace_settings.name == "sRGB" else linear


@dataclass(frozen=True)
class PixelPlane:
    """Values of an image's pixels.

    Attributes:
        values: (height, width, C) float32, the lowest row first.
    """

    values: NDArray[np.float32]

    def at(self, column: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the values (N, C) of pixels; 0 where a column or row is -1."""
        result = self.values[row, column].astype(np.float64)
        result[(row < 0) | (column < 0)] = 0.0
        return result


def alpha_plane(image: bpy.types.Image) -> PixelPlane:
    """Return an image's alpha, in one channel: 1 if it has no alpha or ignores it."""
    if image.channels < 4 or image.alpha_mode == "NONE":
        return PixelPlane(np.ones((1, 1, 1), np.float32))
    return PixelPlane(np.ascontiguousarray(_pixels(image)[:, :, 3:4]))


def color_planes(image: bpy.types.Image) -> PixelPlane:
    """Return an image's linear colours, in three channels."""
    return PixelPlane(linear_pixels(image).astype(np.float32))


def _pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    """Return an image's pixels (height, width, channels) as Blender stores them, the lowest row first."""
    values = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], image.channels)


def is_missing(image: bpy.types.Image | None) -> bool:
    """Return whether an image can't be shown: it is None, its file is missing, or isn't of `pictures.KINDS`."""
    if image is None:
        return True
    if image.packed_file is not None or image.source not in ("FILE", "SEQUENCE", "MOVIE", "TILED"):
        return False
    place = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "TILED":
        return not all(_is_picture(Path(place.replace("<UDIM>", str(tile.number)))) for tile in image.tiles)
    return not _is_picture(Path(place)) or (image.source == "FILE" and not image.size[0] * image.size[1])


def _is_picture(path: Path) -> bool:
    """Return whether a path is a regular file of a kind of picture that may be opened."""
    try:
        return path.is_file() and picture_kind(path) is not None
    except OSError:
        return False


def trees_below(
    tree: bpy.types.NodeTree, visited: set[bpy.types.NodeTree] | None = None
) -> Iterator[bpy.types.NodeTree]:
    """Yield a node tree and the groups in it, each once."""
    visited = set() if visited is None else visited
    if tree not in visited:
        visited.add(tree)
        yield tree
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree is not None:
                yield from trees_below(node.node_tree, visited)


def nodes_without_image(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Yield the image textures of one tree whose images are missing."""
    yield from (node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage" and is_missing(node.image))


def unlink_missing(tree: bpy.types.NodeTree) -> None:
    """Unlink the image textures of one tree whose images are missing: the fed sockets' unlinked values then count."""
    for node in list(nodes_without_image(tree)):
        for link in [link for output in node.outputs for link in output.links]:
            tree.links.remove(link)


@contextmanager
def missing_images_filled(trees: Iterable[bpy.types.NodeTree]) -> Iterator[None]:
    """Context in which missing images of trees show the unlinked colour of the socket they feed; undone on exit."""
    node_images: list[tuple[bpy.types.Node, bpy.types.Image | None]] = []
    substitutes: list[bpy.types.Image] = []
    try:
        for node in [node for tree in trees for node in nodes_without_image(tree)]:
            targets = [link.to_socket for link in node.outputs["Color"].links if link.to_socket.type == "RGBA"]
            color = tuple(targets[0].default_value[:3]) if targets else (0.8, 0.8, 0.8)
            substitute = bpy.data.images.new("SR Missing", 4, 4, alpha=True, float_buffer=True)
            substitute.pixels.foreach_set(np.tile(np.array([*color, 1.0], np.float32), 16))
            substitutes.append(substitute)
            node_images.append((node, node.image))
            node.image = substitute
        yield
    finally:
        for node, image in node_images:
            node.image = image
        bpy.data.batch_remove(substitutes)
