"""A picture of a material: how its brightness differs from pixel to pixel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from ..base.arrays import Float
from ..base.errors import InputError, MissingFileError
from ..materials.reflectance import reflectivity
from ..materials.table import Material
from ..scanning.colour.colour import decode_srgb


@dataclass(frozen=True)
class Texture:
    """Factors on a material's reflectivity over a surface; the picture is repeated beyond its edges.

    Attributes:
        values: (height, width) reflectivity over the picture's mean.
        size: width and height of the surface that it shows, m.
        mean_color: the mean of its linear red, green, blue.
    """

    values: Float
    size: tuple[float, float]
    mean_color: tuple[float, float, float]

    def factor(self, x: Float, y: Float) -> Float:
        """Return the factors at places (any shape), m: those of the pixels they lie in."""
        height, width = self.values.shape
        column = np.floor(x / self.size[0] * width).astype(np.intp) % width
        row = np.floor(y / self.size[1] * height).astype(np.intp) % height
        return np.asarray(self.values[row, column])


def texture_of(pixels: Float, width: float, material: Material) -> Texture:
    """Return the texture of a picture's linear colours.

    Args:
        pixels: (height, width, 3) linear RGB, 0 to 1.
        width: of the surface that it shows, m.
        material: whose metallic and specular it has.
    """
    values = reflectivity(pixels, material.metallic, material.specular)
    mean = pixels.reshape(-1, 3).mean(axis=0)
    return Texture(
        values=values / max(float(values.mean()), 1e-9),
        size=(width, width * pixels.shape[0] / pixels.shape[1]),
        mean_color=(float(mean[0]), float(mean[1]), float(mean[2])),
    )


def read_texture(path: Path, width: float, material: Material) -> Texture:
    """Return the texture of an image file in sRGB, see `texture_of`.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no image.
    """
    try:
        with Image.open(path) as image:
            stored = np.asarray(image.convert("RGB"), dtype=np.float64) / 255.0
    except FileNotFoundError:
        raise MissingFileError(str(path), None, "no such file") from None
    except Exception:  # each of PIL's formats has errors of its own for what is damaged
        raise InputError(str(path), None, "is no image that can be read") from None
    return texture_of(decode_srgb(stored), width, material)
