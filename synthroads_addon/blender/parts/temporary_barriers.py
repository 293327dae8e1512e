"""Movable barriers of construction zones."""

from __future__ import annotations

import bpy

from ...road.parameters import TemporaryBarrier
from ...road.things.body_shapes import LONGEST_PLASTIC
from ..materials import material
from ..things.model_builder import ModelBuilder
from ..things.temporary_barrier import temporary_barrier_group


def build_temporary_barriers(builder: ModelBuilder) -> None:
    """Make one object per movable barrier."""
    for name, barrier in builder.parameters.of_type(TemporaryBarrier).items():
        plastic = barrier.segment_length <= LONGEST_PLASTIC
        inputs = {
            **builder.surfaces("Backbone"),
            "Start Station": builder.along(barrier.start_station),
            "End Station": builder.along(barrier.end_station),
            "Offset": barrier.offset,
            "End Offset": barrier.end_offset,
            "Height": barrier.height,
            "Base Width": barrier.base_width,
            "Segment Length": barrier.segment_length,
            "Plastic": plastic,
            "Instance": barrier.instance,
            "Material": material("plastic_red" if plastic else "galvanised_steel"),
            "Second Material": material("plastic_white" if plastic else "galvanised_steel"),
            "Reflector Material": material("reflector"),
        }
        builder.add(name, bpy.data.meshes.new("SR Temporary Barrier"), temporary_barrier_group(), inputs)
