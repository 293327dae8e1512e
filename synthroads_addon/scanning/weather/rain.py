"""Rain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from .extinction import per_metre
from .precipitation import Precipitation


class Rain(Precipitation):
    """Rain, by its visibility or by its rate; the same at every wavelength."""

    order: ClassVar[int] = 4
    usual: ClassVar[Mapping[str, float]] = {"visibility": 7000.0}

    condition: Literal["rain"] = Field("rain", description="Weather.")

    def rate_extinction(self, rate_mm_h: float, wavelength_nm: float) -> float:
        """Return the extinction at any wavelength, 1/m: 1.076 R^0.67 dB/km of Carbonneau and Wisely, R in mm/h.

        (1.076 R)^(2/3), which is in use as well, gives 2.4 % less.
        """
        return per_metre(1.076 * rate_mm_h**0.67)
