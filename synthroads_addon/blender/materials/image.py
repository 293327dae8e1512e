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
    """Return an image's alpha: 1 where it has none, or is not to have any."""
    if image.channels < 4 or image.alpha_mode == "NONE":
        return PixelPlane(np.ones((1, 1, 1), np.float32))
    return PixelPlane(np.ascontiguousarray(_pixels(image)[:, :, 3:4]))


def color_planes(image: bpy.types.Image) -> PixelPlane:
    """Return an image's linear colours."""
    return PixelPlane(linear_pixels(image).astype(np.float32))


def _pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    flat = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(image.size[1], image.size[0], image.channels)


def is_missing(image: bpy.types.Image | None) -> bool:
    """Return whether an image has nothing to show: none is there, its file isn't, or isn't of `pictures.KINDS`."""
    if image is None:
        return True
    if image.packed_file is not None or image.source not in ("FILE", "SEQUENCE", "MOVIE", "TILED"):
        return False
    place = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "TILED":
        return not all(_is_picture(Path(place.replace("<UDIM>", str(tile.number)))) for tile in image.tiles)
    return not _is_picture(Path(place)) or (image.source == "FILE" and not image.size[0] * image.size[1])


def _is_picture(path: Path) -> bool:
    """Return whether a regular file is there of a kind of picture that is opened."""
    try:
        return path.is_file() and picture_kind(path) is not None
    except OSError:
        return False


def trees_below(tree: bpy.types.NodeTree, seen: set[bpy.types.NodeTree] | None = None) -> Iterator[bpy.types.NodeTree]:
    """Yield a node tree and the groups in it, each once."""
    seen = set() if seen is None else seen
    if tree not in seen:
        seen.add(tree)
        yield tree
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree is not None:
                yield from trees_below(node.node_tree, seen)


def nodes_without_image(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Yield the image textures of one tree that have nothing to show."""
    yield from (node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage" and is_missing(node.image))


def unlink_missing(tree: bpy.types.NodeTree) -> None:
    """Have what stands in the sockets that missing images feed take their place, in one tree."""
    for node in list(nodes_without_image(tree)):
        for link in [link for output in node.outputs for link in output.links]:
            tree.links.remove(link)


@contextmanager
def missing_images_filled(trees: Iterable[bpy.types.NodeTree]) -> Iterator[None]:
    """Context in which missing images of trees show the colour of the socket that they feed; undone on exit."""
    before: list[tuple[bpy.types.Node, bpy.types.Image | None]] = []
    added: list[bpy.types.Image] = []
    try:
        for node in [node for tree in trees for node in nodes_without_image(tree)]:
            targets = [link.to_socket for link in node.outputs["Color"].links if link.to_socket.type == "RGBA"]
            color = tuple(targets[0].default_value[:3]) if targets else (0.8, 0.8, 0.8)
            filled = bpy.data.images.new("SR Missing", 4, 4, alpha=True, float_buffer=True)
            filled.pixels.foreach_set(np.tile(np.array([*color, 1.0], np.float32), 16))
            added.append(filled)
            before.append((node, node.image))
            node.image = filled
        yield
    finally:
        for node, image in before:
            node.image = image
        bpy.data.batch_remove(added)
