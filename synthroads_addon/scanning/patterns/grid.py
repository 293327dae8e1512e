"""Rows of equal angle steps."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from ...base.schema import quantity
from .base import Float, Numbers
from .line import LinePattern


class Grid(LinePattern):
    """Rows of equal angle steps, one after the other: a line is a row, whose plane is tilted forward row by row."""

    order: ClassVar[int] = 4
    type: Literal["grid"] = "grid"
    rows: int = quantity(ge=1, le=100_000, unit="1", description="Rows of a frame, from the rearmost to the foremost.")
    along_field_deg: float = quantity(
        ge=0, le=170, unit="deg", description="Field of view along the forward direction, centred on the nadir."
    )

    @property
    def cycle_lines(self) -> int:
        """Return the rows of a frame."""
        return self.rows

    def tilts(self, line: Numbers) -> Float:
        """Return the angles (P,) by which the planes of rows are tilted forward, rad."""
        row = line % self.rows - (self.rows - 1) / 2.0
        return row * (math.radians(self.along_field_deg) / self.rows)
