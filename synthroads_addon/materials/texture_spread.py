"""How the brightness of one material differs from place to place: patches, wheel tracks, worn and dirty paint, grain.

Every place of a material has a factor on what it gives back. Its logarithm is normal on either side of the median,
with a spread of its own below and above it (a two-piece lognormal distribution): ``f = exp(sigma z) / M``, z being a
field of mean 0 and variance 1, sigma ``spread_below`` where z is negative and ``spread_above`` elsewhere. M makes the
mean of the factor 1, so that a material's reflectivity stays the mean over its surface. Two spreads are what it takes
to hold the quartiles and the 90th percentile of real asphalt and real markings; see `docs/calibration.md`.

The field is `base.noise.field`, of position alone: a place has the same factor in every strip, for every scanner and
every order of the blocks. It is evaluated once per return, where the ray met the surface that gave most of it: the
factor is that of the footprint as a whole, and grain much finer than the footprint is not described by it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Float
from ..base.noise import field

if TYPE_CHECKING:
    from .surfaces import Surfaces


OCTAVES = 3
"""The fewest with which the field is nearly normal."""
_PURPOSE = 0x5F3D
"""Part of the seed: the field of the brightness is not that of the relief."""


def factor(normal: Float, below: Float | float, above: Float | float) -> Float:
    """Return the factor on the brightness: a two-piece lognormal variable of mean 1.

    Args:
        normal: (N,) of mean 0 and variance 1, normal.
        below, above: (N,) or one number; one sigma of the logarithm below and above the median.
    """
    return np.asarray(np.exp(normal * np.where(normal < 0.0, below, above)) / mean_over_median(below, above))


def mean_over_median(below: Float | float, above: Float | float) -> Float:
    """Return M = exp(b^2 / 2) P(-b) + exp(a^2 / 2) P(a), the mean of exp(sigma z); P is the normal distribution's."""
    low, high = np.asarray(below, dtype=np.float64), np.asarray(above, dtype=np.float64)
    return np.exp(0.5 * low * low) * _normal(-low) + np.exp(0.5 * high * high) * _normal(high)


def spread_factors(surfaces: Surfaces, material: NDArray[np.integer], position: Float, seed: int) -> Float:
    """Return the factors (N,) at places of materials.

    Args:
        surfaces: the materials.
        material: (N,) indices of materials that have a spread.
        position: (N, 3) local, in the scene as it stands at the time 0, m.
        seed: the scene's.
    """
    normal = field(position, surfaces.spread_wavelength[material], seed ^ _PURPOSE, OCTAVES)
    scale = surfaces.spread_scale[material]
    sigma = np.where(normal < 0.0, surfaces.spread_below[material], surfaces.spread_above[material])
    return np.asarray(np.exp(normal * sigma) * scale)


def _normal(value: Float) -> Float:
    return np.array([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in np.ravel(value)]).reshape(np.shape(value))
