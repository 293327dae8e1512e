"""Constant materials as the scanner's loop reads them, one array per property; and how their brightness varies.

Patches, wheel tracks, worn and dirty paint, grain: every place of a material has a factor on what it gives back. Its
logarithm is normal on either side of the median, with a spread of its own below and above it (a two-piece lognormal
distribution): ``f = exp(sigma z) / M``, z being a field of mean 0 and variance 1, sigma ``spread_below`` where z is
negative and ``spread_above`` elsewhere. M makes the mean of the factor 1, so that a material's reflectivity stays the
mean over its surface. Two spreads are what it takes to hold the quartiles and the 90th percentile of real asphalt and
real markings; see `docs/calibration.md`.

The field is `noise_field`, of position alone: a place has the same factor in every strip, for every scanner
and every order of the blocks. It is evaluated once per return, where the ray met the surface that gave most of it: the
factor is that of the footprint as a whole, and grain much finer than the footprint is not described by it.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..base.arithmetic.noise import noise_field
from ..base.arrays import Float
from .reflectance import facet_terms, reflectivity, returned_share
from .table import Material

Reflection = Literal["lambert", "oren_nayar"]
OCTAVES = 3
"""The fewest with which the field is nearly normal."""
_PURPOSE = 0x5F3D
"""Part of the seed: the field of the brightness is not that of the relief."""


@dataclass
class Surfaces:
    """Properties of M materials as arrays (M,), in the order of the scene mesh's; ``base_color`` is (M, 3).

    Attributes:
        base_color: linear RGB.
        roughness, metallic, specular: 0 to 1.
        transmission: share of the light that goes on through, 0 to 1.
        gap_size: of the leaves and gaps of what lets light through, m; 0: the light is weakened evenly.
        slope: of the facets, rad; 0 reflects as Lambert says.
        retro: effective reflectance of the retro-reflection at a right angle.
        lobe: angle at which it has fallen to 1/e, rad.
        spread_below, spread_above: one sigma of the brightness's logarithm below and above its median.
        spread_wavelength: longest wavelength of its variation, m.
        clear: whether the light that goes on through differs from place to place, see `scanning.colour.transparency`.

    The rest follows from these: reflectivity R, Oren and Nayar's A and B, the lobe as 1/rad^2, which materials retro-
    reflect (``shining``), let light through (``pervious``), through gaps (``gappy``), or vary (``uneven``), the factor
    that makes the mean of their variation 1 (``spread_scale``), and whether any does, or is rough.
    """

    base_color: Float
    roughness: Float
    metallic: Float
    specular: Float
    transmission: Float
    gap_size: Float
    slope: Float
    retro: Float
    lobe: Float
    spread_below: Float
    spread_above: Float
    spread_wavelength: Float
    clear: NDArray[np.bool_]

    def __post_init__(self) -> None:
        self.reflectivity = reflectivity(self.base_color, self.metallic, self.specular)
        self.facet_a, self.facet_b = facet_terms(self.slope)
        self.inverse_lobe_squared: Float = 1.0 / np.maximum(self.lobe, 1e-3) ** 2
        self.shining, self.pervious = self.retro > 0.0, (self.transmission > 0.0) | self.clear
        self.gappy = (self.transmission > 0.0) & (self.gap_size > 0.0)
        self.uneven = (self.spread_below > 0.0) | (self.spread_above > 0.0)
        self.spread_scale: Float = 1.0 / mean_over_median(self.spread_below, self.spread_above)
        self.permeable, self.retroreflective = bool(self.pervious.any()), bool(self.shining.any())
        self.rough, self.varying = bool((self.slope > 0.0).any()), bool(self.uneven.any())


def surfaces_of(
    rows: Iterable[Material], reflection: Reflection = "lambert", spread: bool = True, clear: Iterable[int] = ()
) -> Surfaces:
    """Return the properties of materials as arrays.

    Args:
        rows: M materials.
        reflection: "lambert" drops the facets.
        spread: False drops the variation.
        clear: indices of those whose transparency differs from place to place.
    """
    rows = list(rows)

    def column(name: str) -> Float:
        """Return a property of all materials as an array."""
        return np.array([getattr(row, name) for row in rows], dtype=np.float64)

    slope = np.zeros(len(rows)) if reflection == "lambert" else column("slope")
    return Surfaces(
        base_color=np.array([row.base_color for row in rows], dtype=np.float64).reshape(-1, 3),
        roughness=column("roughness"),
        metallic=column("metallic"),
        specular=column("specular"),
        transmission=column("transmission"),
        gap_size=column("gap_size"),
        slope=slope,
        retro=column("retroreflection"),
        lobe=np.deg2rad(column("retro_lobe_deg")),
        spread_below=column("spread_below") * spread,
        spread_above=column("spread_above") * spread,
        spread_wavelength=column("spread_wavelength"),
        clear=np.isin(np.arange(len(rows)), list(clear)),
    )


def brightness_of(surfaces: Surfaces, material: NDArray[np.integer], cosine: Float) -> Float:
    """Return the brightness (N,) of hits by material and cosine of incidence, before range and attenuation.

    Args:
        surfaces: the materials.
        material: (N,) indices; any of a ray that hits nothing.
        cosine: (N,) of the incidence angle.
    """
    reflectance = np.take(surfaces.reflectivity, material)
    facets = (np.take(surfaces.facet_a, material), np.take(surfaces.facet_b, material)) if surfaces.rough else ()
    result = returned_share(cosine, reflectance, *facets)
    if surfaces.retroreflective:
        shining_rows = np.flatnonzero(np.take(surfaces.shining, material))
        indices = material[shining_rows]
        result[shining_rows] = returned_share(
            cosine[shining_rows],
            reflectance[shining_rows],
            surfaces.facet_a[indices],
            surfaces.facet_b[indices],
            surfaces.retro[indices],
            surfaces.inverse_lobe_squared[indices],
        )
    return result


def mean_over_median(sigma_below: Float | float, sigma_above: Float | float) -> Float:
    """Return exp(b^2 / 2) P(-b) + exp(a^2 / 2) P(a), mean over median of a two-piece lognormal distribution."""
    sigmas_below, sigmas_above = np.asarray(sigma_below, dtype=np.float64), np.asarray(sigma_above, dtype=np.float64)
    return np.exp(0.5 * sigmas_below * sigmas_below) * _normal_cdf(-sigmas_below) + np.exp(
        0.5 * sigmas_above * sigmas_above
    ) * _normal_cdf(sigmas_above)


def spread_factors(surfaces: Surfaces, material: NDArray[np.integer], position: Float, seed: int) -> Float:
    """Return the factors (N,), 1 on average, by which the brightness of materials varies from place to place.

    Args:
        surfaces: the materials.
        material: (N,) indices of materials that have a spread.
        position: (N, 3) local, in the scene as it stands at the time 0, m.
        seed: the scene's.
    """
    field = noise_field(position, surfaces.spread_wavelength[material], seed ^ _PURPOSE, OCTAVES)
    scale = surfaces.spread_scale[material]
    sigma = np.where(field < 0.0, surfaces.spread_below[material], surfaces.spread_above[material])
    return np.asarray(np.exp(field * sigma) * scale)


def _normal_cdf(value: Float) -> Float:
    """Return the cumulative distribution of the standard normal one at values."""
    return np.array([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in np.ravel(value)]).reshape(np.shape(value))
