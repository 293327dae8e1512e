"""Light of a low sun, of twilight and of the night sky: how bright it is, and in what colour, by the sun's height."""

import math

import numpy as np

from ...base.arrays import Float

LOWEST_SKY_SUN = 1.0
"""Least elevation of the sun, deg, for which a model of the sky by day is used; below, its light fades into night."""
FADING_FROM = 5.0
"""Elevation of the sun, deg, below which its direct light fades. Chosen: above, the strength is the environment's."""
_RADIUS = 0.27
"""Radius of the sun's disc, deg."""
_DEPTH = np.array([0.08, 0.12, 0.2])
"""Optical depth of clear air straight up for red, green and blue. Chosen: Rayleigh's scattering, and some dust."""
_LEAST_LEVEL = 0.002
"""Least illuminance, lx. Chosen: stars, airglow, and the glow of distant towns."""
_LEVELS = (
    (20.0, (3.74, 3.97, -4.07, 1.47)),
    (5.0, (3.05, 13.28, -45.98, 64.33)),
    (-0.8, (2.88, 22.26, -207.64, 1034.30)),
    (-5.0, (2.88, 21.81, -258.11, -858.36)),
    (-12.0, (2.70, 12.17, -431.69, -1899.83)),
    (-18.0, (13.84, 262.72, 1447.42, 2797.93)),
)
"""Least elevation (deg), and coefficients of log10 of the illuminance (lx) by powers of elevation / 90 degrees
(Janiczek and DeYoung 1987, Computer programs for sun and moon illuminance, U.S. Naval Observatory Circular 171)."""
_BLUE_HOUR = np.array([0.55, 0.85, 1.9])
"""Colour of the sky's light from civil twilight on, as a factor on a low sun's sky, of mean 1.1. Chosen."""
_BLUE_FROM, _BLUE_AT = 1.0, -6.0
"""Elevations (deg) at which that colour begins, and is reached: the end of civil twilight."""


def level_illuminance(elevation_deg: float) -> float:
    """Return the illuminance (lx) of level ground by sun and clear sky without a moon.

    Args:
        elevation_deg: of the sun, degrees, -90 to 90.

    Example:
        >>> [round(level_illuminance(elevation), 3) for elevation in (42.0, 0.0, -6.0, -40.0)]
        [71730.964, 758.578, 3.412, 0.002]
    """
    for least_elevation, (constant, linear, square, cubic) in _LEVELS:
        if elevation_deg >= least_elevation:
            x = elevation_deg / 90.0
            return max(10.0 ** (constant + linear * x + square * x**2 + cubic * x**3), _LEAST_LEVEL)
    return _LEAST_LEVEL


def sun_share(elevation_deg: float) -> Float:
    """Return the share (3,) of the direct sunlight, red, green and blue, that is left of a high sun's: 0 below ground.

    It is 1 from `FADING_FROM` on. Below, it follows from the longer way through the air, and sets with the disc.
    """
    if elevation_deg >= FADING_FROM:
        return np.ones(3)
    above_horizon = min(max((elevation_deg + _RADIUS) / (2.0 * _RADIUS), 0.0), 1.0)
    path_excess = _air_mass(max(elevation_deg, 0.0)) - _air_mass(FADING_FROM)
    return np.asarray(np.exp(-_DEPTH * path_excess) * above_horizon)


def sky_share(elevation_deg: float) -> float:
    """Return the brightness of the sky as a share of that at the lowest sun of a model by day; 1 above it."""
    if elevation_deg >= LOWEST_SKY_SUN:
        return 1.0
    return level_illuminance(elevation_deg) / level_illuminance(LOWEST_SKY_SUN)


def sky_tint(elevation_deg: float) -> Float:
    """Return the factor (3,) on red, green and blue of a low sun's sky: 1 by day, blue after sunset."""
    blue_share = min(max((_BLUE_FROM - elevation_deg) / (_BLUE_FROM - _BLUE_AT), 0.0), 1.0)
    return 1.0 + blue_share * (_BLUE_HOUR - 1.0)


def _air_mass(elevation_deg: float) -> float:
    """Return the way of sunlight through the air as a multiple of that straight down (Kasten and Young 1989)."""
    sine = math.sin(math.radians(elevation_deg))
    return 1.0 / (sine + 0.50572 * (elevation_deg + 6.07995) ** -1.6364)
