"""A mirror that swings to and fro."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from .base import Float, Numbers, PulseTiming
from .line import LinePattern


class OscillatingMirror(LinePattern):
    """A mirror that swings to and fro; a line is one swing, so that two lines are a period of the motion."""

    order: ClassVar[int] = 3
    type: Literal["oscillating_mirror"] = "oscillating_mirror"
    motion: Literal["triangular", "sinusoidal"] = Field(
        "triangular", description="At a constant rate, turning back at once; or as a sine of time."
    )

    @property
    def cycle_lines(self) -> int:
        """Return the lines of a period: the swings alternate."""
        return 2

    def sweep(self, field_of_view: float) -> float:
        """Return the field of view; a sine is pi / 2 times as fast in the middle as on average."""
        return field_of_view * (0.5 * math.pi if self.motion == "sinusoidal" else 1.0)

    def angles(self, timing: PulseTiming, line: Numbers, place: Float) -> Float:
        """Return the angles (P,) of the mirror's motion, every second line in the other direction, rad."""
        np.negative(place, where=line % 2 == 1, out=place)
        if self.motion == "triangular":
            return super().angles(timing, line, place)
        swing = place * (math.pi * timing.lines_per_second / timing.pulse_rate)
        return timing.field_of_view / 2.0 * np.sin(swing)
