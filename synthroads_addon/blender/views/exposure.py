"""Exposure of pictures, as of an automatic camera: level ground is nearly as bright at a low sun as at a high one."""

import math

import numpy as np

from ...base.arrays import Float
from ...road.surroundings import Environment
from ...scanning.colour.twilight import sky_share
from ..cameras.light import sky_radiance
from ..sky import sun_irradiance
from .lamps import LUX

_REFERENCE = Environment(sun_elevation_deg=42.0)
"""Environment whose light needs no correction; chosen."""
_CORRECTED_SHARE = 0.85
"""Share of a change of light, in stops, that is corrected: a dull day stays duller than a bright one; chosen."""
_LEAST_STOPS = -1.0
"""Least correction, stops; chosen."""
_LAMPLIGHT = 40.0 / LUX
"""Least irradiance that is exposed for. Chosen: by night the ground some 20 m ahead has 40 lx of the headlights."""


def sun_and_sky(environment: Environment) -> tuple[Float, Float]:
    """Return the sun's irradiance normal to its rays, and the sky's on level ground, (3,) each: red, green, blue."""
    sky = math.pi * np.array(sky_radiance(environment)) * sky_share(environment.sun_elevation_deg)
    return sun_irradiance(environment), sky


def level_irradiance(environment: Environment) -> Float:
    """Return the irradiance (3,) of level ground under a clear sky: red, green, blue."""
    sun, sky = sun_and_sky(environment)
    return np.asarray(sun * max(math.sin(math.radians(environment.sun_elevation_deg)), 0.0) + sky)


def stops_for(irradiance: Float) -> float:
    """Return the exposure (stops) for level ground under an irradiance (3,), compared with the reference light."""
    reference = float(level_irradiance(_REFERENCE).mean())
    stops = _CORRECTED_SHARE * math.log2(reference / max(float(np.mean(irradiance)), _LAMPLIGHT))
    return max(stops, _LEAST_STOPS)
