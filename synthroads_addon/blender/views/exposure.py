"""Exposure of pictures, as of an automatic camera: level ground is nearly as bright at a low sun as at a high one."""

import math

import numpy as np

from ...base.arrays import Float
from ...road.surroundings import Environment
from ..cameras.light import sky_radiance
from ..sky import SUN_COLOR, SUN_STRENGTH

_REFERENCE = Environment(sun_elevation_deg=42.0)
"""Environment whose light needs no correction; chosen."""
_CORRECTED_SHARE = 0.85
"""Share of a change of light, in stops, that is corrected: a dull day stays duller than a bright one; chosen."""
_STOPS = (-1.0, 4.0)
"""Limits of the correction, stops; chosen."""


def sun_and_sky(environment: Environment) -> tuple[Float, Float]:
    """Return the sun's irradiance normal to its rays, and the sky's on level ground, (3,) each: red, green, blue."""
    sun = np.array(SUN_COLOR) * SUN_STRENGTH * environment.sun_strength
    return sun, math.pi * np.array(sky_radiance(environment))


def level_irradiance(environment: Environment) -> Float:
    """Return the irradiance (3,) of level ground under a clear sky: red, green, blue."""
    sun, sky = sun_and_sky(environment)
    return np.asarray(sun * max(math.sin(math.radians(environment.sun_elevation_deg)), 0.0) + sky)


def stops_for(irradiance: Float) -> float:
    """Return the exposure (stops) for level ground under an irradiance (3,), compared with the reference light."""
    reference = float(level_irradiance(_REFERENCE).mean())
    stops = _CORRECTED_SHARE * math.log2(reference / max(float(np.mean(irradiance)), 1e-6))
    return min(max(stops, _STOPS[0]), _STOPS[1])
