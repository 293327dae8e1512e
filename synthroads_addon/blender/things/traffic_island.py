"""Traffic islands, made from their bodies (SR Solid)."""

from __future__ import annotations

from ...road.things.traffic_island import TrafficIsland
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import add_solid


@model_part("traffic_islands", 70)
def build_traffic_islands(builder: ModelBuilder) -> None:
    """Add one object per traffic island to the model."""
    for name, island in builder.parameters.of_type(TrafficIsland).items():
        add_solid(builder, name, island)
