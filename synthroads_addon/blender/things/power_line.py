"""Power lines: one object for the pylons and conductors of a span, its mesh made from its solids."""

from __future__ import annotations

from ...road.things.power_line import PowerLine
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import add_solid


@model_part("power_lines", 162)
def build_power_lines(builder: ModelBuilder) -> None:
    """Add one object per span of a power line to the model."""
    for name, line in builder.parameters.of_type(PowerLine).items():
        add_solid(builder, name, line)
