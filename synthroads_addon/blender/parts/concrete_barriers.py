"""Concrete barriers."""

from __future__ import annotations

import bpy

from ...road.parameters import ConcreteBarrier
from ..materials import material
from ..things.concrete_barrier import concrete_barrier_group
from ..things.model_builder import ModelBuilder


def build_concrete_barriers(builder: ModelBuilder) -> None:
    """Make one object per concrete barrier."""
    for name, barrier in builder.parameters.of_type(ConcreteBarrier).items():
        inputs = {
            **builder.surfaces("Backbone"),
            "Start Station": builder.along(barrier.start_station),
            "End Station": builder.along(min(barrier.end_station, builder.geometry.length)),
            "Offset": barrier.offset,
            "New Jersey": barrier.profile == "new_jersey",
            "Height": barrier.height,
            "Base Width": barrier.base_width,
            "Terminal Length": barrier.terminal_length,
            "Step": builder.step,
            "Instance": barrier.instance,
            "Material": material("barrier_concrete"),
        }
        builder.add(name, bpy.data.meshes.new("SR Concrete Barrier"), concrete_barrier_group(), inputs)
