"""Traffic lights."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from ...base.schema import quantity
from .thing import Block, StandingThing

TRAFFIC_LIGHT_POST = 0.089
"""Diameter of a traffic light's post, m."""


class TrafficLight(StandingThing):
    """A traffic light on its post, e.g. where an entry is metered."""

    points_class: ClassVar = "traffic_light"
    order: ClassVar = 90
    type: Literal["TrafficLight"] = "TrafficLight"
    height: float = quantity(3.2, ge=1.5, le=8, unit="m", description="Top above the surface.")
    lights: int = quantity(3, ge=1, le=4, unit="1", description="Number of lights.")
    light_diameter: float = quantity(0.2, ge=0.1, le=0.4, unit="m", description="Diameter of a light.")

    def footprint(self) -> Iterator[Block]:
        """Yield the box of its post."""
        yield self.upright(self.light_diameter / 2.0, self.height)
