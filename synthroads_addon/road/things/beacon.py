"""Beacons (Leitbaken) of construction zones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from ..objects import Side
from .thing import Block, StandingThing

BEACON_FOOT = (0.40, 0.80, 0.11)
"""A beacon's rubber foot: across the blade, along the road, height (m)."""
BEACON_BLADE_BOTTOM = 0.16
"""Lower edge of a beacon's blade above the surface, m."""
BEACON_BLADE = 0.045
"""Thickness of a beacon's blade, m."""
_REACH = 0.1
"""Half of the room along the road, m."""


class ConstructionBeacon(StandingThing):
    """A beacon (Leitbake) of a construction zone, red and white, its stripes falling to the side to pass it on."""

    points_class: ClassVar = "construction_barrier"
    order: ClassVar = 120
    type: Literal["ConstructionBeacon"] = "ConstructionBeacon"
    pass_side: Side = Field(description="Side, seen along the stations, on which traffic passes it.")
    width: float = quantity(0.25, ge=0.1, le=0.6, unit="m", description="Width of its blade.")
    height: float = quantity(1.0, ge=0.5, le=2, unit="m", description="Height of its blade.")

    def footprint(self) -> Iterator[Block]:
        """Yield the blade's box."""
        body = self.upright(self.width / 2.0, self.height)
        yield body._replace(start=self.station - _REACH, end=self.station + _REACH)
