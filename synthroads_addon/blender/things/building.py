"""Buildings: one object each, its mesh made from its solids."""

from __future__ import annotations

from ...road.things.building import Building
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import add_solid


@model_part("buildings", 160)
def build_buildings(builder: ModelBuilder) -> None:
    """Add one object per building to the model."""
    for name, building in builder.parameters.of_type(Building).items():
        add_solid(builder, name, building)
