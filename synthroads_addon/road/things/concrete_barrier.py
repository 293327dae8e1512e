"""Concrete barriers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, LengthwiseThing

CONCRETE_FLANKS = {
    "step": ((1.0, 0.0), (0.945, 0.275), (0.70, 0.29), (0.445, 0.972), (0.40, 1.0)),
    "new_jersey": ((1.0, 0.0), (1.0, 0.095), (0.44, 0.41), (0.31, 0.972), (0.265, 1.0)),
}
"""One flank of a concrete barrier from the foot to the top, as shares of half the foot's width and of the height
(EN 1317 barriers of 0.54 m x 0.90 m and 0.60 m x 0.81 m)."""
CONCRETE_TIP = 0.08
"""Height at which a concrete barrier's ramped end breaks off, m."""


class ConcreteBarrier(LengthwiseThing):
    """A concrete barrier, symmetric about its axis."""

    points_class: ClassVar = "barrier"
    order: ClassVar = 20
    type: Literal["ConcreteBarrier"] = "ConcreteBarrier"
    profile: Literal["new_jersey", "step"] = Field("step", description="Shape of its cross-section.")
    height: float = quantity(0.9, ge=0.4, le=2.0, unit="m", description="Top above the surface.")
    base_width: float = quantity(0.54, ge=0.3, le=1.2, unit="m", description="Width of its foot.")
    terminal_length: float = quantity(8.0, ge=0, le=50, unit="m", description="Length over which either end is ramped.")

    def footprint(self) -> Iterator[Block]:
        """Yield the barrier's box."""
        yield self.strip(self.base_width / 2.0, self.base_width / 2.0, self.height)
