"""Emergency phones and utility cabinets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, StandingThing


class Cabinet(StandingThing):
    """An emergency phone or a utility cabinet."""

    points_class: ClassVar = "utility"
    order: ClassVar = 110
    type: Literal["Cabinet"] = "Cabinet"
    kind: Literal["emergency_phone", "utility"] = Field(description="What it is.")
    width: float = quantity(0.3, ge=0.1, le=3, unit="m", description="Width, seen by the traffic beside it.")
    depth: float = quantity(0.3, ge=0.1, le=3, unit="m", description="Depth.")
    height: float = quantity(1.6, ge=0.4, le=3, unit="m", description="Top above the surface.")

    def footprint(self) -> Iterator[Block]:
        """Yield a box that holds it, however it is turned."""
        yield self.upright(max(self.width, self.depth) / 2.0, self.height)
