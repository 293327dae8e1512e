"""How much the air attenuates the beam: extinction by visibility or rate, and twice that per metre of range.

Absorption by gases is left out (905, 1064 and 1550 nm lie in windows of the atmosphere), and so is the light that
droplets scatter back into the receiver.

- clear: by visibility, Kim.
- haze, dust: by visibility, Kruse: made for small particles of haze and dust.
- fog: by visibility, the same at every wavelength: its droplets are larger than that (Pierce; Kim below 500 m).
- rain, snow: by visibility, the same at every wavelength for the same reason; by rate, Carbonneau and Wisely, wet snow.

Sources: Kruse, McGlauchlin, McQuistan: Elements of Infrared Technology (1962); Kim, McArthur, Korevaar: Comparison of
laser beam propagation at 785 nm and 1550 nm in fog and haze, Proc. SPIE 4214 (2001); Pierce, Ramaprasad, Eisenberg:
Optical attenuation in fog and clouds, Proc. SPIE 4530 (2001); Carbonneau, Wisely: Opportunities and challenges for
optical wireless, Proc. SPIE 3532 (1998); Recommendation ITU-R P.1814 (2007), for snow.
"""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from ..base.schema import ClosedModel, quantity
from ..road.surroundings import Environment

USUAL_VISIBILITY = {
    "clear": 23_000.0,
    "haze": 4000.0,
    "fog": 400.0,
    "rain": 7000.0,
    "snow": 1500.0,
    "dust": 2000.0,
}
"""Visibility (m) where none is given; the same as of sampled roads. 23 km is the usual standard clear atmosphere."""

CONTRAST = 0.02
"""Contrast at which a black object is still seen against the horizon: what defines the visibility (Koschmieder)."""
_REFERENCE = 550.0
"""Wavelength (nm) for which the visibility holds."""
_PER_DECIBEL = math.log(10.0) / 10.0
_PER_KILOMETRE = 1e-3


class Weather(ClosedModel):
    """What attenuates the beam, in place of the road's own weather."""

    condition: Literal["clear", "haze", "fog", "rain", "snow", "dust"] = Field("clear", description="Weather.")
    visibility: float | None = quantity(
        None, ge=20, le=200_000, unit="m", description="Visibility; usual for the condition if not given."
    )
    rate_mm_h: float | None = quantity(
        None, gt=0, le=200, unit="mm/h", description="Rain, or snow as water; instead of the visibility."
    )

    @model_validator(mode="after")
    def _one_measure(self) -> Weather:
        if self.rate_mm_h is not None and self.condition not in ("rain", "snow"):
            raise ValueError(f"rate_mm_h can't be given for {self.condition}")
        if self.rate_mm_h is not None and self.visibility is not None:
            raise ValueError("rate_mm_h and visibility can't both be given")
        return self


def attenuation(weather: Weather, wavelength_nm: float) -> float:
    """Return the attenuation per metre of range, 1/m: the light goes there and back, so twice the extinction."""
    return 2.0 * extinction(weather, wavelength_nm)


def extinction(weather: Weather, wavelength_nm: float) -> float:
    """Return the extinction coefficient of the air, 1/m of path.

    Args:
        weather: condition with a visibility, or a rate of rain or snow; the usual visibility if neither is given.
        wavelength_nm: of the laser.
    """
    if weather.rate_mm_h is not None:
        if weather.condition == "rain":
            return rain_extinction(weather.rate_mm_h)
        return snow_extinction(weather.rate_mm_h, wavelength_nm)
    visibility = USUAL_VISIBILITY[weather.condition] if weather.visibility is None else weather.visibility
    if weather.condition == "clear":
        exponent = kim_exponent(visibility)
    elif weather.condition in ("haze", "dust"):
        exponent = kruse_exponent(visibility)
    else:
        exponent = 0.0
    return visibility_extinction(visibility, wavelength_nm, exponent)


def visibility_extinction(visibility: float, wavelength_nm: float, exponent: float) -> float:
    """Return the extinction -ln(0.02) / V (wavelength / 550 nm)^-q, 1/m (3.912 / V or 17.0 dB at 550 nm).

    Args:
        visibility: V, m.
        wavelength_nm: of the laser.
        exponent: q, see `kim_exponent` and `kruse_exponent`; 0 for drops that are larger than the wavelength.
    """
    return -math.log(CONTRAST) / visibility * (wavelength_nm / _REFERENCE) ** -exponent


def kim_exponent(visibility: float) -> float:
    """Return q of Kim, McArthur and Korevaar: 0 below 500 m, then growing to 1.3 at 6 km; 1.6 above 50 km."""
    kilometres = visibility * _PER_KILOMETRE
    if kilometres < 0.5:
        return 0.0
    if kilometres < 1.0:
        return kilometres - 0.5
    if kilometres < 6.0:
        return 0.16 * kilometres + 0.34
    return _clear_exponent(kilometres)


def kruse_exponent(visibility: float) -> float:
    """Return q of Kruse: 0.585 V^(1/3) below 6 km, with V in km, then 1.3, and 1.6 above 50 km."""
    kilometres = visibility * _PER_KILOMETRE
    return 0.585 * kilometres ** (1.0 / 3.0) if kilometres < 6.0 else _clear_exponent(kilometres)


def _clear_exponent(kilometres: float) -> float:
    return 1.6 if kilometres > 50.0 else 1.3


def rain_extinction(rate_mm_h: float) -> float:
    """Return the extinction of rain, 1/m: 1.076 R^0.67 dB/km of Carbonneau and Wisely, R in mm/h, at any wavelength.

    (1.076 R)^(2/3), which is in use as well, gives 2.4 % less.
    """
    return _per_metre(1.076 * rate_mm_h**0.67)


def snow_extinction(rate_mm_h: float, wavelength_nm: float, *, wet: bool = True) -> float:
    """Return the extinction of falling snow, 1/m: a S^b dB/km of ITU-R P.1814, S in mm/h of water.

    Wet snow, near 0 degrees C as snow on German motorways mostly is, has a = 1.023e-4 L + 3.786 and b = 0.72, dry
    snow a = 5.42e-5 L + 5.496 and b = 1.38, with the wavelength L in nm.
    """
    if wet:
        return _per_metre((1.023e-4 * wavelength_nm + 3.7855466) * rate_mm_h**0.72)
    return _per_metre((5.42e-5 * wavelength_nm + 5.4958776) * rate_mm_h**1.38)


def _per_metre(decibels_per_kilometre: float) -> float:
    return decibels_per_kilometre * _PER_DECIBEL * _PER_KILOMETRE


def weather_of(environment: Environment) -> Weather:
    """Return the weather that a road has.

    A visibility that its parameter set leaves at the default, that of a clear day, is the usual one of its condition:
    fog of 23 km is none.
    """
    given = environment.visibility != Environment.model_fields["visibility"].default
    visibility = environment.visibility if given else USUAL_VISIBILITY[environment.weather]
    return Weather(condition=environment.weather, visibility=visibility)
