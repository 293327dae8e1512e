"""Noise barriers."""

from __future__ import annotations

import bpy

from ...road.parameters import NoiseBarrier
from ..materials import material
from ..nodes.noise_panel import KINDS
from ..things.model_builder import ModelBuilder
from ..things.noise_barrier import noise_barrier_group

_MATERIALS = {
    "aluminium": ("noise_aluminium", "noise_aluminium"),
    "concrete": ("noise_concrete", "noise_concrete"),
    "wood": ("noise_wood", "noise_wood"),
    "glass": ("acrylic_glass", "galvanised_steel"),
}
"""Materials of a panel, and of its frame or cap."""


def build_noise_barriers(builder: ModelBuilder) -> None:
    """Make one object per noise barrier."""
    for name, wall in builder.parameters.of_type(NoiseBarrier).items():
        face, frame = _MATERIALS[wall.panel]
        inputs = {
            **builder.surfaces("Backbone"),
            "Start Station": builder.along(wall.start_station),
            "End Station": builder.along(min(wall.end_station, builder.geometry.length)),
            "Offset": wall.offset,
            "Height": wall.height,
            "Panel": KINDS.index(wall.panel),
            "Thickness": wall.thickness,
            "Post Spacing": wall.post_spacing,
            "Post Width": wall.post_width,
            "Instance": wall.instance,
            "Post Material": material("galvanised_steel"),
            "Panel Material": material(face),
            "Frame Material": material(frame),
            "Plinth Material": material("noise_concrete"),
        }
        builder.add(name, bpy.data.meshes.new("SR Noise Barrier"), noise_barrier_group(), inputs)
