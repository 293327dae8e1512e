"""Delineator posts, Leitpfosten."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from ...base.schema import quantity
from .thing import Block, StandingThing

DELINEATOR = (
    (-0.06, -0.050), (-0.045, -0.055), (0.05, -0.014), (0.06, 0.0), (0.05, 0.014), (-0.045, 0.055), (-0.06, 0.05),
)  # fmt: skip
"""A delineator's cross-section from above, x away from the road, y along the driver's way: a triangle 0.12 m wide."""
DELINEATOR_REACH = 0.06
"""Half the width of a delineator, m."""


class Delineator(StandingThing):
    """A delineator post (Leitpfosten) beside the road."""

    points_class: ClassVar = "warning_post"
    order: ClassVar = 50
    type: Literal["Delineator"] = "Delineator"
    height: float = quantity(1.0, ge=0.3, le=1.5, unit="m", description="Top above the surface.")

    def footprint(self) -> Iterator[Block]:
        """Yield the post's box."""
        yield self.upright(DELINEATOR_REACH, self.height)
