"""Folders of textures for tests, and what their images give at a place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from synthroads_addon.base.arrays import AnyArray, Float

DARK, BRIGHT = (51, 102, 153), (204, 153, 102)
"""The checkerboard's colours, sRGB of 8 bits."""
SMOOTH, ROUGH = 64, 191
"""The two roughnesses, of 255."""
CELLS, SIZE = 2, 64
"""Fields of the checkerboard along each side, and the side, px."""


def checkerboard() -> AnyArray:
    """Return the image of a checkerboard (SIZE, SIZE, 3), its lowest row first; its first field is dark."""
    number = np.arange(SIZE) * CELLS // SIZE
    dark = (number[:, None] + number[None, :]) % 2 == 0
    return np.where(dark[..., None], np.uint8(DARK), np.uint8(BRIGHT))


def halves() -> AnyArray:
    """Return an image (SIZE, SIZE, 3) that is smooth in its left half and rough in its right one."""
    value = np.where(np.arange(SIZE) < SIZE // 2, np.uint8(SMOOTH), np.uint8(ROUGH))
    return np.broadcast_to(value[None, :, None], (SIZE, SIZE, 3))


def plain(red: int, green: int, blue: int) -> AnyArray:
    """Return an image (4, 4, 3) of one colour."""
    return np.broadcast_to(np.uint8([red, green, blue]), (4, 4, 3))


def write_png(path: Path, pixels: AnyArray) -> None:
    """Write pixels (height, width, 3) of 8 bits, the lowest row first, as PNG; makes the folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.ascontiguousarray(pixels[::-1])).save(path, format="PNG")


def write_set(folder: Path, tile: float | None = None, **images: AnyArray) -> None:
    """Write a set of images, each under the name of its layer, and how large they are (m) if that is given."""
    for layer, pixels in images.items():
        write_png(folder / f"{layer}.png", pixels)
    if tile is not None:
        (folder / "texture.json").write_text(f'{{"tile": {tile}}}', encoding="utf-8")


def linear(color: tuple[int, ...]) -> Float:
    """Return sRGB of 8 bits as linear numbers (IEC 61966-2-1)."""
    share = np.array(color) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def fields_at(across: Float, upwards: Float, tile: float) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return whether places on a texture (m) are dark, whether they are smooth, and whether they lie off all edges.

    Off an edge is half a pixel and more: between two fields pixels are mixed.
    """
    u, v = across / tile % 1.0, upwards / tile % 1.0
    dark = (np.floor(u * CELLS) + np.floor(v * CELLS)) % 2 == 0
    edge = [np.abs(side * CELLS - np.round(side * CELLS)) / CELLS for side in (u, v)]
    return dark, u < 0.5, np.minimum(*edge) > 1.0 / SIZE
