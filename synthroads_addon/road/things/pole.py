"""Lighting and surveillance poles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, StandingThing


class Pole(StandingThing):
    """A lighting pole, or one for surveillance cameras; its arm points away from rotation 0's traffic to the left."""

    points_class: ClassVar = "pole"
    order: ClassVar = 80
    obstacle: ClassVar = "pole"
    type: Literal["Pole"] = "Pole"
    kind: Literal["lighting", "surveillance"] = Field("lighting", description="What it carries.")
    height: float = quantity(12.0, ge=2, le=30, unit="m", description="Top above the surface.")
    diameter: float = quantity(0.2, ge=0.05, le=0.6, unit="m", description="Diameter at its foot.")
    arm_length: float = quantity(1.5, ge=0, le=6, unit="m", description="Length of its arm; 0 for none.")

    def footprint(self) -> Iterator[Block]:
        """Yield the box of its mast."""
        yield self.upright(self.diameter / 2.0, self.height)
