"""A mirror that turns at a constant rate."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from ...base.schema import quantity
from .line import LinePattern


class RotatingMirror(LinePattern):
    """A mirror that turns at a constant rate; the laser fires only while the beam is within the field of view.

    With one face the beam turns by 360 degrees from one line to the next. A mirror with several faces turns it by less:
    a share field of view / turn per line of all pulses is fired.
    """

    order: ClassVar[int] = 1
    type: Literal["rotating_mirror"] = "rotating_mirror"
    turn_per_line_deg: float = quantity(
        360.0, gt=0, le=360, unit="deg", description="Angle by which the beam turns from one line to the next."
    )

    def sweep(self, field_of_view: float) -> float:
        """Return the turn per line."""
        return math.radians(self.turn_per_line_deg)

    def firing_share(self, field_of_view: float) -> float:
        """Return the share of the turn that lies within the field of view."""
        return field_of_view / math.radians(self.turn_per_line_deg)

    def fault(self, field_of_view_deg: float, pulse_rate: float) -> str:
        """Refuse a field of view wider than the turn."""
        if field_of_view_deg > self.turn_per_line_deg + 1e-9:
            return f"is wider than the {self.turn_per_line_deg:g} deg that the beam turns per line"
        return super().fault(field_of_view_deg, pulse_rate)
