"""How bright an echo is: the laser equation and the detector.

An echo's intensity is ``I0 * share / d^2 * exp(-a d)``; `returned_share` is what the surface does
(`materials.reflectance`), `received_intensity` the rest. An ideal white target, struck at a right angle at 1 m, gives
1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..materials.reflectance import facet_terms, returned_share

Float = NDArray[np.float64]


NEAREST = 1e-3
"""Nearer than this, m, 1/d^2 doesn't grow on: the law holds far from the aperture only, and stays finite."""


def received_intensity(share: ArrayLike, distance: ArrayLike, attenuation: float = 0.0, emitted: float = 1.0) -> Float:
    """Return the intensity I0 share / d^2 exp(-a d); 0 where the range isn't a finite number above 0.

    Args:
        share: brightness of the surface, see `returned_share`, times the ray's share of the pulse's energy.
        distance: range d, m; below `NEAREST` it counts as this.
        attenuation: a, 1/m of range, not negative; the light goes there and back, so it is twice the extinction.
        emitted: I0.
    """
    distance = np.asarray(distance, dtype=np.float64)
    far = bool(np.all(distance >= NEAREST))
    reach = distance if far else np.maximum(distance, NEAREST)
    # Underflow in dense fog is a true zero, and so is what comes back from infinitely far away.
    with np.errstate(under="ignore", over="ignore"):
        intensity = np.asarray(np.asarray(share, dtype=np.float64) / (reach * reach))
        if emitted != 1.0:
            intensity *= emitted
        if attenuation > 0.0:
            left = np.asarray(reach * -attenuation)
            intensity *= np.exp(left, out=left)
    return intensity if far else np.where(distance > 0.0, intensity, 0.0)


def lambert_intensity(
    reflectance: ArrayLike, cosine: ArrayLike, distance: ArrayLike, attenuation: float = 0.0, emitted: float = 1.0
) -> Float:
    """Return I = I0 R cos t / d^2 exp(-a d); 0 where the range is not positive or the incidence is 90 degrees or more.

    Args:
        reflectance: R of the surface.
        cosine: cosine of the incidence angle.
        distance: range d, m.
        attenuation: a, 1/m of range.
        emitted: I0; with 1 an ideal white target at 1 m returns 1.
    """
    return oren_nayar_intensity(reflectance, cosine, distance, 0.0, attenuation, emitted)


def oren_nayar_intensity(
    reflectance: ArrayLike,
    cosine: ArrayLike,
    distance: ArrayLike,
    slope: ArrayLike,
    attenuation: float = 0.0,
    emitted: float = 1.0,
) -> Float:
    """Return I = I0 R (A cos t + B sin^2 t) / d^2 exp(-a d); 0 where Lambert's is.

    Args:
        reflectance, cosine, distance, attenuation, emitted: see `lambert_intensity`.
        slope: standard deviation of the facets' slope angle, rad; with 0 this is `lambert_intensity`, to the bit.
    """
    parts = (cosine, reflectance, *facet_terms(slope))
    shape = np.broadcast_shapes(*(np.shape(part) for part in parts))
    flat = (np.broadcast_to(np.asarray(part, dtype=np.float64), shape).ravel() for part in parts)
    return received_intensity(returned_share(*flat).reshape(shape), distance, attenuation, emitted)


def saturate(intensity: Float, limit: float) -> tuple[Float, int]:
    """Return the intensities (N,) that a detector gives, and how many of them it clipped.

    Args:
        intensity: (N,) that reach the detector.
        limit: largest that it tells apart; inf clips nothing.
    """
    clipped = int(np.count_nonzero(intensity > limit))
    return (np.minimum(intensity, limit), clipped) if clipped else (intensity, 0)
