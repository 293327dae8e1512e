"""The sun's place in the sky by time of day, day of the year and latitude."""

import math

_DECLINATION = ((0.006918, 0.0), (-0.399912, 0.070257), (-0.006758, 0.000907), (-0.002697, 0.00148))
"""Cosine's and sine's coefficients (rad) of the sun's declination, by multiples of the year's angle (Spencer 1971,
Fourier series representation of the position of the sun, Search 2(5)); within 0.04 degrees."""


def sun_angles(hour: float, day: int, latitude_deg: float) -> tuple[float, float]:
    """Return azimuth (0 to 360, clockwise from north) and elevation (-90 to 90) of the sun's middle, degrees.

    The air's refraction, up to 0.6 degrees at the horizon, is left out.

    Args:
        hour: true solar time, h: at 12 the sun is in the south (north of the tropics).
        day: day of the year, from 1 on.
        latitude_deg: degrees, negative in the south.

    Example:
        >>> azimuth, elevation = sun_angles(12.0, 172, 51.0)
        >>> round(azimuth), round(elevation)
        (180, 62)
    """
    year_angle = 2.0 * math.pi * (day - 1) / 365.0
    declination = sum(
        cosine * math.cos(k * year_angle) + sine * math.sin(k * year_angle)
        for k, (cosine, sine) in enumerate(_DECLINATION)
    )
    hour_angle, latitude = math.radians(15.0 * (hour - 12.0)), math.radians(latitude_deg)
    # The unit vector towards the sun: east, north and up.
    east = -math.cos(declination) * math.sin(hour_angle)
    north = math.cos(latitude) * math.sin(declination) - math.sin(latitude) * math.cos(declination) * math.cos(
        hour_angle
    )
    up = math.sin(latitude) * math.sin(declination) + math.cos(latitude) * math.cos(declination) * math.cos(hour_angle)
    azimuth = math.degrees(math.atan2(east, north)) % 360.0
    return azimuth, math.degrees(math.asin(min(max(up, -1.0), 1.0)))
