"""Fog."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from .base import Weather


class Fog(Weather):
    """Fog, by its visibility; the same at every wavelength (Pierce; Kim below 500 m)."""

    order: ClassVar[int] = 3
    usual: ClassVar[Mapping[str, float]] = {"visibility": 400.0}

    condition: Literal["fog"] = Field("fog", description="Weather.")
