"""Snow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from .extinction import per_metre
from .precipitation import Precipitation


class Snow(Precipitation):
    """Snow, by its visibility, then the same at every wavelength, or by its rate, as wet snow."""

    order: ClassVar[int] = 5
    usual: ClassVar[Mapping[str, float]] = {"visibility": 1500.0}

    condition: Literal["snow"] = Field("snow", description="Weather.")

    def rate_extinction(self, rate_mm_h: float, wavelength_nm: float) -> float:
        """Return the extinction of wet snow, 1/m."""
        return snow_extinction(rate_mm_h, wavelength_nm)


def snow_extinction(rate_mm_h: float, wavelength_nm: float, *, wet: bool = True) -> float:
    """Return the extinction of falling snow, 1/m: a S^b dB/km of ITU-R P.1814, S in mm/h of water.

    Wet snow, near 0 degrees C as snow on German motorways mostly is, has a = 1.023e-4 L + 3.786 and b = 0.72, dry
    snow a = 5.42e-5 L + 5.496 and b = 1.38, with the wavelength L in nm.
    """
    if wet:
        return per_metre((1.023e-4 * wavelength_nm + 3.7855466) * rate_mm_h**0.72)
    return per_metre((5.42e-5 * wavelength_nm + 5.4958776) * rate_mm_h**1.38)
