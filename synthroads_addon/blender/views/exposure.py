"""Exposure of pictures: as an automatic camera's, so that level ground is as bright at a low sun as at a high one."""

import math

import numpy as np

from ...base.arrays import Float
from ...road.surroundings import Environment
from ..cameras.light import sky_radiance
from ..sky import SUN_COLOR, SUN_STRENGTH

_REFERENCE = Environment(sun_elevation_deg=42.0)
"""Light at which pictures need no correction."""
_FOLLOWS = 0.85
"""Share of a change of light, in stops, that is made up for: a dull day stays duller than a bright one."""
_STOPS = (-1.0, 4.0)


def sun_and_sky(environment: Environment) -> tuple[Float, Float]:
    """Return the sun's irradiance (3,) across its rays, and that of level ground by the sky (3,): red, green, blue."""
    sun = np.array(SUN_COLOR) * SUN_STRENGTH * environment.sun_strength
    return sun, math.pi * np.array(sky_radiance(environment))


def level_irradiance(environment: Environment) -> Float:
    """Return the irradiance (3,) of level ground under a clear sky: red, green, blue."""
    sun, sky = sun_and_sky(environment)
    return np.asarray(sun * max(math.sin(math.radians(environment.sun_elevation_deg)), 0.0) + sky)


def stops_for(irradiance: Float) -> float:
    """Return the exposure (stops) at which level ground under an irradiance (3,) is as bright as usual."""
    usual = float(level_irradiance(_REFERENCE).mean())
    stops = _FOLLOWS * math.log2(usual / max(float(np.mean(irradiance)), 1e-6))
    return min(max(stops, _STOPS[0]), _STOPS[1])
