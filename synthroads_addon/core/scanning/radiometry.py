"""How bright an echo is: reflectivity, the laser equation, and the colours of constant materials."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

LUMINANCE = np.array([0.3, 0.59, 0.11])


def reflectivity(base_color: ArrayLike, metallic: ArrayLike, specular: ArrayLike) -> Float:
    """Return R = (1 - m)(s + 0.5 L) + m L with L = 0.3 r + 0.59 g + 0.11 b of the linear base colour.

    Args:
        base_color: (..., 3) linear RGB, 0 to 1.
        metallic: (...,) 0 to 1.
        specular: (...,) 0 to 1. R can exceed 1 where it is over 0.5.
    """
    luminance = np.asarray(base_color, dtype=np.float64) @ LUMINANCE
    metal = np.asarray(metallic, dtype=np.float64)
    return (1.0 - metal) * (np.asarray(specular, dtype=np.float64) + 0.5 * luminance) + metal * luminance


def lambert_intensity(
    reflectance: ArrayLike, cosine: ArrayLike, distance: ArrayLike, attenuation: float = 0.0, emitted: float = 1.0
) -> Float:
    """Return I = I0 R cos t / d^2 exp(-a d); 0 where the range is not positive or the incidence is 90 degrees or more.

    Args:
        reflectance: R of the surface.
        cosine: cosine of the incidence angle.
        distance: range d, m.
        attenuation: a, 1/m of range; the light goes there and back, so it is twice the extinction.
        emitted: I0; with 1 an ideal white target at 1 m returns 1.
    """
    distance = np.asarray(distance, dtype=np.float64)
    usable = np.where(distance > 0.0, distance, np.inf)
    cosine = np.clip(cosine, 0.0, 1.0)
    # Underflow in dense fog is a true zero; exp() of a negative number never overflows.
    with np.errstate(under="ignore"):
        damping = np.exp(-attenuation * np.where(np.isfinite(usable), usable, 0.0))
        return np.asarray(emitted * np.asarray(reflectance) * cosine / usable / usable * damping)


SUN = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
_SKY = 0.45


def lit_color(base_color: ArrayLike, normals: Float) -> NDArray[np.uint16]:
    """Return (N, 3) 16-bit sRGB of constant materials under sun and sky, without shadows.

    Args:
        base_color: (N, 3) linear RGB.
        normals: (N, 3) unit normals towards the viewer.
    """
    irradiance = _SKY + (1.0 - _SKY) * np.clip(normals @ SUN, 0.0, 1.0)
    linear = np.clip(np.asarray(base_color) * irradiance[:, None], 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(encoded * 65535.0 + 0.5, dtype=np.uint16)
