"""Dust."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from .base import Weather
from .extinction import kruse_exponent


class Dust(Weather):
    """Dust, by its visibility."""

    order: ClassVar[int] = 6
    usual: ClassVar[Mapping[str, float]] = {"visibility": 2000.0}

    condition: Literal["dust"] = Field("dust", description="Weather.")

    def exponent(self, visibility: float) -> float:
        """Return Kruse's exponent, made for small particles of haze and dust."""
        return kruse_exponent(visibility)
