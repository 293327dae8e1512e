"""Parts of the parameter set for an axis: elements in plan, points of the profile."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from ...base.schema import Model, quantity, when

LONGEST_ROAD = 1e6
"""Longest alignment, m: its tables grow with its length, so that a slip in a number would fill the memory."""


class HorizontalElement(Model):
    """A line, arc or clothoid; the curvature changes linearly with the station."""

    conditions = (when({"kind": {"const": "line"}}, {"curvature_start": {"const": 0}, "curvature_end": {"const": 0}}),)
    kind: Literal["line", "arc", "clothoid"] = Field(description="What the two curvatures make it.")
    length: float = quantity(gt=0, le=LONGEST_ROAD, unit="m", description="Length along the centreline.")
    curvature_start: float = quantity(ge=-0.1, le=0.1, unit="1/m", description="Positive to the left.")
    curvature_end: float = quantity(ge=-0.1, le=0.1, unit="1/m", description="Positive to the left.")

    @model_validator(mode="after")
    def _kind_fits(self) -> HorizontalElement:
        """Return the element unchanged; ValueError if its kind contradicts its curvatures."""
        is_straight = self.curvature_start == 0.0 == self.curvature_end
        fits = {"line": is_straight, "arc": self.curvature_start == self.curvature_end and not is_straight}
        if not fits.get(self.kind, self.curvature_start != self.curvature_end):
            raise ValueError(f"kind '{self.kind}' contradicts its curvatures")
        return self

    @classmethod
    def between(cls, length: float, curvature_start: float, curvature_end: float) -> HorizontalElement:
        """Return the line, arc or clothoid of a length (m) with the curvatures at its ends (1/m).

        Example:
            >>> HorizontalElement.between(120.0, 0.0, 1 / 800).kind
            'clothoid'
        """
        is_constant = curvature_start == curvature_end
        kind: Literal["line", "arc", "clothoid"] = (
            "clothoid" if not is_constant else "arc" if curvature_start else "line"
        )
        return cls(kind=kind, length=length, curvature_start=curvature_start, curvature_end=curvature_end)


class VerticalPoint(Model):
    """A point of vertical intersection with its parabolic rounding."""

    station: float = quantity(unit="m", description="Where the two tangents intersect.")
    elevation: float = quantity(ge=-500, le=9000, unit="m", description="Local elevation of the intersection.")
    radius: float = quantity(0.0, ge=0, unit="m", description="Radius of the crest or sag; 0 leaves a kink.")
