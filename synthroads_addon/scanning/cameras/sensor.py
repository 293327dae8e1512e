"""The sensor: from the light of pixels to the 8-bit numbers of a picture, with its noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float32, UInt8, UInt16
from ..colour.colour import decode_srgb
from .rig import Camera

_LINEAR: Float32 = decode_srgb(np.arange(65_536) / 65_535.0).astype(np.float32)
"""Linear value of each 16-bit sRGB number."""
_CODES = 4096
"""Linear values that are looked up for their 8-bit sRGB numbers; with the square root's spacing, so that dark ones are
told apart."""


def linear_colours(rgb: UInt16) -> Float32:
    """Return the linear values (N, 3), 0 to 1, of 16-bit sRGB colours (N, 3)."""
    return np.asarray(np.take(_LINEAR, rgb))


def sensed(linear: Float32, camera: Camera, noise: float, stops: float, random: np.random.Generator) -> Float32:
    """Return the linear values (N, 3) that a sensor reads out.

    A value of 1 is a full pixel; exposing it longer or shorter by a number of stops, its gain stays. The noise is that
    of the photons (its variance is the number of electrons) and of reading the pixel (Janesick 2007, Photon Transfer).

    Args:
        linear: (N, 3) light of pixels; 0.9 is a white level surface in the sun.
        camera: full well and noise of its sensor.
        noise: factor on the standard deviation; 0 is none.
        stops: so many times twice the light.
        random: the stream of the noise.
    """
    exposed = linear * np.float32(2.0**stops)
    if not noise:
        return exposed
    electrons = np.maximum(exposed, 0.0) * np.float32(camera.full_well)
    sigma = np.float32(noise) * np.sqrt(electrons + np.float32(camera.read_noise**2))
    electrons += sigma * random.standard_normal(linear.shape, dtype=np.float32)
    return np.asarray(electrons / np.float32(camera.full_well))


def encode_8_bit(linear: NDArray[np.floating]) -> UInt8:
    """Return linear values (..., 3) as 8-bit sRGB numbers (IEC 61966-2-1), clipped to what that can show."""
    root = np.sqrt(np.clip(linear, 0.0, 1.0)) * np.float32(_CODES - 1)
    return np.asarray(np.take(_ENCODED, np.rint(root).astype(np.int32)))


def _encoded() -> UInt8:
    """Return the 8-bit sRGB numbers (`_CODES`,) of squares of even steps from 0 to 1."""
    linear = (np.arange(_CODES) / (_CODES - 1)) ** 2
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.rint(curve * 255.0).astype(np.uint8)


_ENCODED: UInt8 = _encoded()
