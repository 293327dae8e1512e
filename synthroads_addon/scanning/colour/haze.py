"""Haze: the air's light that distant things fade into, and sunlight and skylight below a layer of haze.

A radiance L is seen through d metres of air as L exp(-s d) + A (1 - exp(-s d)) with the extinction s = 3.912 /
visibility (Koschmieder 1924). The air's radiance A, and the light on the road, follow from two-stream theory for a
layer that scatters but doesn't absorb (Bohren 1987, Multiple scattering of light and some of its observable
consequences, Am. J. Phys. 55): fog reflects a part of the light, transmits the rest diffusely, and is bright itself. A
renderer that follows single scattering only would show fog as dark as the asphalt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...base.arrays import Float
from .light import GROUND_ALBEDO, SunAndSky

HEIGHT = 300.0
"""Height (m) of a layer of haze above the road; chosen."""
_FORWARD = 0.85
"""Asymmetry parameter g of fog's droplets: mean cosine of their scattering angles."""
_DIFFUSIVITY = 1.66
"""Diffusivity factor: mean path of light from the whole sky through a layer, divided by its height (Elsasser 1942)."""
_LOWEST = 0.02
"""Least sine of the sun's elevation in the path of its rays through the layer; chosen."""


class HazeLight(NamedTuple):
    """Light within and below a layer of haze.

    Attributes:
        sun: share of the sunlight that passes the layer unscattered.
        sky: share of the skylight that passes the layer unscattered.
        diffuse: (3,) radiance, red, green and blue, of scattered light, added to all of the sky as seen from below.
        air: (3,) radiance of the air itself, in views along the road.
    """

    sun: float
    sky: float
    diffuse: Float
    air: Float


def haze_light(extinction: float, elevation: float, sun: Float, sky: Float) -> HazeLight:
    """Return the light within and below a layer of haze.

    Args:
        extinction: of the haze, 1/m.
        elevation: elevation of the sun, rad.
        sun: (3,) irradiance by the sun normal to its rays, above the layer.
        sky: (3,) irradiance by the sky on a level surface above the layer.
    """
    depth, sine = extinction * HEIGHT, max(math.sin(elevation), _LOWEST)
    # Similarity: forward scattering counts as none, so that the depth is (1 - g) tau.
    scaled_depth = (1.0 - _FORWARD) * depth
    # Two-stream transmittance T = 2 / (2 + (1 - g) tau) of a layer that doesn't absorb (Bohren 1987). Light goes back
    # and forth between the layer and the ground of albedo r: down = T E / (1 - r (1 - T)).
    transmittance = 2.0 / (2.0 + scaled_depth)
    down_irradiance = transmittance * (sun * sine + sky) / (1.0 - GROUND_ALBEDO * (1.0 - transmittance))
    sun_share, sky_share = math.exp(-depth / sine), math.exp(-_DIFFUSIVITY * depth)
    diffuse = (down_irradiance - sun * sine * sun_share - sky * sky_share) / math.pi
    beam = sun * math.exp(-scaled_depth / sine)
    air = beam / (4.0 * math.pi) + (down_irradiance * (1.0 + GROUND_ALBEDO) - beam * sine) / (2.0 * math.pi)
    return HazeLight(sun_share, sky_share, np.maximum(diffuse, 0.0), np.maximum(air, 0.0))


def below_haze(light: SunAndSky, extinction: float) -> tuple[SunAndSky, HazeLight]:
    """Return sun and sky as they light the road below a layer of haze, and what the layer makes of them.

    Args:
        light: above the layer.
        extinction: of the haze, beyond that of the clear air that the light has come through, 1/m.
    """
    elevation = math.asin(min(max(float(light.direction[2]), -1.0), 1.0))
    # A white matt surface of irradiance E has the radiance E / pi.
    haze = haze_light(extinction, elevation, math.pi * light.sun, math.pi * light.above)
    sun, above = light.sun * haze.sun, light.above * haze.sky + haze.diffuse
    below = GROUND_ALBEDO * (sun * max(float(light.direction[2]), 0.0) + above)
    return SunAndSky(light.direction, sun, above, below), haze
