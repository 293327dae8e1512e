"""Bus shelters, made from their bodies (SR Solid)."""

from __future__ import annotations

from ...road.things.bus_shelter import BusShelter
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import add_solid


@model_part("bus_shelters", 161)
def build_bus_shelters(builder: ModelBuilder) -> None:
    """Add one object per bus shelter to the model."""
    for name, shelter in builder.parameters.of_type(BusShelter).items():
        add_solid(builder, name, shelter)
