"""The shipped weathers: clear air, haze, fog and dust by their visibility, rain and snow by that or by their rate."""

import math
from collections.abc import Mapping
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...base.schema import quantity
from ..effects import EchoChanges, EchoEffect, PulseHits
from .base import Weather
from .extinction import kim_exponent, kruse_exponent, per_metre, snow_extinction
from .particles import ParticleSpectrum, particle_echoes, rain_spectrum, snow_spectrum
from .soft_target import soft_echoes


class Clear(Weather):
    """Clear air, by its visibility; 23 km is the usual standard clear atmosphere."""

    order: ClassVar[int] = 1
    usual: ClassVar[Mapping[str, float]] = {"visibility": 23_000.0}

    condition: Literal["clear"] = Field("clear", description="Weather.")

    def exponent(self, visibility: float) -> float:
        """Return the exponent of the wavelength at a visibility (m), by Kim, McArthur and Korevaar."""
        return kim_exponent(visibility)


class Haze(Weather):
    """Haze, by its visibility."""

    order: ClassVar[int] = 2
    usual: ClassVar[Mapping[str, float]] = {"visibility": 4000.0}

    condition: Literal["haze"] = Field("haze", description="Weather.")

    def exponent(self, visibility: float) -> float:
        """Return the exponent of the wavelength at a visibility (m), by Kruse, for particles of haze and dust."""
        return kruse_exponent(visibility)


class Fog(Weather):
    """Fog, by its visibility; the same at every wavelength (Pierce; Kim below 500 m). Its droplets may give an echo."""

    order: ClassVar[int] = 3
    usual: ClassVar[Mapping[str, float]] = {"visibility": 400.0}
    name: ClassVar[str] = "fog"

    condition: Literal["fog"] = Field("fog", description="Weather.")
    echoes: bool = Field(False, description="Whether the droplets give an echo of their own.")

    def effects(self) -> tuple[EchoEffect, ...]:
        """Return the droplets' echo if it is switched on."""
        return (self,) if self.echoes else ()

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return the droplets' echo of each pulse; see `soft_target`."""
        return soft_echoes(self.extinction(hits.setting.device.wavelength_nm), hits)


class Dust(Weather):
    """Dust, by its visibility."""

    order: ClassVar[int] = 6
    usual: ClassVar[Mapping[str, float]] = {"visibility": 2000.0}

    condition: Literal["dust"] = Field("dust", description="Weather.")

    def exponent(self, visibility: float) -> float:
        """Return the exponent of the wavelength at a visibility (m), by Kruse, for particles of haze and dust."""
        return kruse_exponent(visibility)


class Precipitation(Weather):
    """Rain or snow, by its visibility or by its rate."""

    name: ClassVar[str]

    rate_mm_h: float | None = quantity(
        None, "mm/h", "Rain, or snow as water; instead of the visibility.", gt=0, le=200, unset="By the visibility"
    )
    echoes: bool = Field(False, description="Whether drops or flakes give echoes of their own.")

    @model_validator(mode="after")
    def _refuse_two_measures(self) -> Self:
        """Raise ValueError if both a rate and a visibility are given."""
        if self.rate_mm_h is not None and self.visibility is not None:
            raise ValueError("rate_mm_h and visibility can't both be given")
        return self

    def extinction(self, wavelength_nm: float) -> float:
        """Return the extinction coefficient, 1/m of path, by the rate if it is given, else by the visibility."""
        if self.rate_mm_h is None:
            return super().extinction(wavelength_nm)
        return self.rate_extinction(self.rate_mm_h, wavelength_nm)

    def rate_extinction(self, rate_mm_h: float, wavelength_nm: float) -> float:
        """Return the extinction coefficient, 1/m of path, at a rate in mm of water per hour."""
        raise NotImplementedError

    def spectrum(self, rate_mm_h: float) -> ParticleSpectrum:
        """Return the particles in the air at a rate in mm of water per hour."""
        raise NotImplementedError

    def rate(self, wavelength_nm: float) -> float:
        """Return the rate, mm of water per hour; without one that whose extinction is that of the visibility."""
        if self.rate_mm_h is not None:
            return self.rate_mm_h
        # Extinction is a R^b: two rates give a = extinction_at_1 and b, of which the rate follows.
        extinction_at_1, extinction_at_2 = (self.rate_extinction(rate, wavelength_nm) for rate in (1.0, 2.0))
        exponent = math.log2(extinction_at_2 / extinction_at_1)
        return float((self.extinction(wavelength_nm) / extinction_at_1) ** (1.0 / exponent))

    def effects(self) -> tuple[EchoEffect, ...]:
        """Return the particles' echoes if they are switched on."""
        return (self,) if self.echoes else ()

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return the particles' echoes; see `particles`."""
        return particle_echoes(self.spectrum(self.rate(hits.setting.device.wavelength_nm)), hits, random)


class Rain(Precipitation):
    """Rain, by its visibility or by its rate; the same at every wavelength."""

    order: ClassVar[int] = 4
    usual: ClassVar[Mapping[str, float]] = {"visibility": 7000.0}

    name: ClassVar[str] = "rain"

    condition: Literal["rain"] = Field("rain", description="Weather.")

    def rate_extinction(self, rate_mm_h: float, wavelength_nm: float) -> float:
        """Return the extinction at any wavelength, 1/m: 1.076 R^0.67 dB/km of Carbonneau and Wisely, R in mm/h.

        (1.076 R)^(2/3), which is in use as well, gives 2.4 % less.
        """
        return per_metre(1.076 * rate_mm_h**0.67)

    def spectrum(self, rate_mm_h: float) -> ParticleSpectrum:
        """Return the drops."""
        return rain_spectrum(rate_mm_h)


class Snow(Precipitation):
    """Snow, by its visibility, then the same at every wavelength, or by its rate, as wet snow."""

    order: ClassVar[int] = 5
    usual: ClassVar[Mapping[str, float]] = {"visibility": 1500.0}

    name: ClassVar[str] = "snow"

    condition: Literal["snow"] = Field("snow", description="Weather.")

    def rate_extinction(self, rate_mm_h: float, wavelength_nm: float) -> float:
        """Return the extinction coefficient of wet snow, 1/m of path, at a rate in mm of water per hour."""
        return snow_extinction(rate_mm_h, wavelength_nm)

    def spectrum(self, rate_mm_h: float) -> ParticleSpectrum:
        """Return the flakes."""
        return snow_spectrum(rate_mm_h)
