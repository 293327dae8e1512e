"""How a surface reflects a laser: reflectivity, facets, retro-reflection.

Lambert's and Oren and Nayar's surfaces and retro-reflection are in it. Mirror-like reflection and refraction are left
out on purpose.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Float

Number = Float | float

LUMINANCE = np.array([0.3, 0.59, 0.11])
EDGE_ON = 1e-12
"""A cosine of the incidence angle up to this is one of 90 degrees or more: it is what rounding leaves of 0."""


def reflectivity(base_color: ArrayLike, metallic: ArrayLike, specular: ArrayLike) -> Float:
    """Return the reflectivity R = (1 - m)(s + 0.5 L) + m L, with luma L = 0.3 r + 0.59 g + 0.11 b, linear.

    Args:
        base_color: (..., 3) linear RGB, 0 to 1.
        metallic: (...,) 0 to 1.
        specular: (...,) 0 to 1. R can exceed 1 where it is over 0.5.

    Example:
        >>> float(reflectivity([0.5, 0.5, 0.5], metallic=0.0, specular=0.05).round(3))
        0.3
    """
    luminance = np.asarray(base_color, dtype=np.float64) @ LUMINANCE
    metal = np.asarray(metallic, dtype=np.float64)
    return (1.0 - metal) * (np.asarray(specular, dtype=np.float64) + 0.5 * luminance) + metal * luminance


def facet_slope(roughness: ArrayLike) -> Float:
    """Return the standard deviation of the facets' slope angle, rad, from a renderer's roughness.

    A renderer's roughness r stands for the Beckmann distribution with alpha = r^2, whose slopes have a standard
    deviation of alpha / sqrt 2 along each axis (Beckmann & Spizzichino 1963; Walter et al. 2007).
    """
    return np.asarray(np.arctan(np.square(np.asarray(roughness, dtype=np.float64)) / np.sqrt(2.0)))


def facet_terms(slope: ArrayLike) -> tuple[Float, Float]:
    """Return A = 1 - 0.5 v / (v + 0.33), B = 0.45 v / (v + 0.09) of Oren and Nayar's model, v being ``slope`` squared.

    Args:
        slope: (...,) standard deviation of the facets' slope angle sqrt(v), rad; for 0 they are exactly 1 and 0.

    Example:
        >>> [float(term) for term in facet_terms(0.0)]
        [1.0, 0.0]
        >>> [round(float(term), 3) for term in facet_terms(0.3)]
        [0.893, 0.225]
    """
    # Beyond 1e6 nothing changes any more, and the square stays finite.
    variance = np.square(np.minimum(np.abs(np.asarray(slope, dtype=np.float64)), 1e6))
    return 1.0 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)


def returned_share(
    cosine: Number,
    reflectance: Number,
    facet_a: Number = 1.0,
    facet_b: Number = 0.0,
    retro: Number = 0.0,
    inverse_lobe_squared: Number = 0.0,
) -> Float:
    """Return the brightness of surfaces before distance and attenuation: R (A c + B (1 - c^2)) + r exp(-t^2 / l^2).

    c is the cosine of the incidence angle t. The first term is Oren and Nayar's for a scanner, where light and eye are
    in the same place: their A + B sin t tan t, times cos t, has no tangent any more. It tends to R B at a grazing
    angle, so back faces and angles of 90 degrees or more give 0. With A = 1 and B = 0 it is Lambert's R c, to the bit.

    The second term is retro-reflection. What beads and prisms send back leaves them in a lobe of a few tenths of a
    degree around the way that the light came; the receiver sits within it at every range, so the lobe's width doesn't
    matter and only the fall-off with the entrance angle is left, a Gaussian.

    Args:
        cosine: (N,) of the incidence angle; not more than 1.
        reflectance: R, (N,) or one number.
        facet_a, facet_b: see `facet_terms`; the number 0 for ``facet_b`` leaves out the facets.
        retro: r, effective reflectance at a right angle; the number 0 leaves the term out.
        inverse_lobe_squared: 1 / l^2, 1/rad^2, of the entrance angle l at which it has fallen to 1/e.

    Returns:
        (N,) float64, all finite and not negative.

    Example:
        >>> import numpy as np
        >>> incidence = np.radians([0.0, 60.0])
        >>> returned_share(np.cos(incidence), 0.2).round(3).tolist()  # Lambert
        [0.2, 0.1]
        >>> returned_share(np.cos(incidence), 0.2, *facet_terms(0.3)).round(3).tolist()  # rough: Oren and Nayar
        [0.179, 0.123]
    """
    lit_cosine: Float = np.atleast_1d(np.asarray(cosine, dtype=np.float64))
    result: Float = lit_cosine * facet_a
    if not _is_zero(facet_b):
        sine_squared = np.square(lit_cosine)
        np.subtract(1.0, sine_squared, out=sine_squared)
        sine_squared *= facet_b
        result += sine_squared
    result *= reflectance
    if not _is_zero(retro):
        _add_retroreflection(result, lit_cosine, retro, inverse_lobe_squared)
    if len(lit_cosine) and not lit_cosine.min() > EDGE_ON:
        result[~(lit_cosine > EDGE_ON)] = 0.0
    return result


def _is_zero(value: Number) -> bool:
    """Return whether a value is the one number 0, not an array."""
    return np.ndim(value) == 0 and bool(value == 0.0)


def _add_retroreflection(result: Float, cosine: Float, retro: Number, inverse_lobe_squared: Number) -> None:
    """Add, in place, the retro-reflective term to brightnesses (N,), where the material has one."""
    strength = np.broadcast_to(np.asarray(retro, dtype=np.float64), result.shape)
    shining_rows = np.flatnonzero(strength)
    if not len(shining_rows):
        return
    lobe = np.broadcast_to(np.asarray(inverse_lobe_squared, dtype=np.float64), result.shape)[shining_rows]
    result[shining_rows] += retroreflection(cosine[shining_rows], strength[shining_rows], lobe)


def retroreflection(cosine: Float, retro: Float, inverse_lobe_squared: Float) -> Float:
    """Return the retro-reflective terms (N,) of surfaces' brightness: r exp(-t^2 / l^2), see `returned_share`."""
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    with np.errstate(under="ignore"):
        return np.asarray(retro * np.exp(-angle * angle * inverse_lobe_squared))
