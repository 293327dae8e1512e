"""Clear air."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from .base import Weather
from .extinction import kim_exponent


class Clear(Weather):
    """Clear air, by its visibility; 23 km is the usual standard clear atmosphere."""

    order: ClassVar[int] = 1
    usual: ClassVar[Mapping[str, float]] = {"visibility": 23_000.0}

    condition: Literal["clear"] = Field("clear", description="Weather.")

    def exponent(self, visibility: float) -> float:
        """Return Kim's exponent."""
        return kim_exponent(visibility)
