"""Intensities of single rays by the product's own functions, for tests of the whole laser equation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthroads_addon.materials.reflectance import facet_terms, returned_share
from synthroads_addon.scanning.receiving.radiometry import received_intensity


def intensity_of(
    reflectance: ArrayLike, cosine: ArrayLike, distance: ArrayLike, slope: ArrayLike = 0.0, attenuation: float = 0.0
) -> NDArray[np.float64]:
    """Return I = R (A cos t + B sin^2 t) / d^2 exp(-a d); 0 where the incidence is 90 degrees or more.

    Args:
        reflectance: R of the surface.
        cosine: cosine of the incidence angle.
        distance: range d, m.
        slope: standard deviation of the facets' slope angle, rad; 0 is Lambert's law.
        attenuation: a, 1/m of range.
    """
    parts = (cosine, reflectance, *facet_terms(slope))
    shape = np.broadcast_shapes(*(np.shape(part) for part in parts))
    flat = (np.broadcast_to(np.asarray(part, dtype=np.float64), shape).ravel() for part in parts)
    return received_intensity(returned_share(*flat).reshape(shape), distance, attenuation)
