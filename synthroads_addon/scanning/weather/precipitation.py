"""Base of rain and snow: a rate may be given instead of the visibility."""

from __future__ import annotations

from pydantic import model_validator

from ...base.schema import quantity
from .base import Weather


class Precipitation(Weather):
    """Rain or snow, by its visibility or by its rate."""

    rate_mm_h: float | None = quantity(
        None,
        gt=0,
        le=200,
        unit="mm/h",
        description="Rain, or snow as water; instead of the visibility.",
        unset="By the visibility",
    )

    @model_validator(mode="after")
    def _one_measure(self) -> Precipitation:
        if self.rate_mm_h is not None and self.visibility is not None:
            raise ValueError("rate_mm_h and visibility can't both be given")
        return self

    def extinction(self, wavelength_nm: float) -> float:
        """Return the extinction of the rate if there is one, else of the visibility, 1/m of path."""
        if self.rate_mm_h is None:
            return super().extinction(wavelength_nm)
        return self.rate_extinction(self.rate_mm_h, wavelength_nm)

    def rate_extinction(self, rate_mm_h: float, wavelength_nm: float) -> float:
        """Return the extinction of a rate in mm of water per hour, 1/m of path."""
        raise NotImplementedError
