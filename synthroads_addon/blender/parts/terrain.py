"""The ground beside the road."""

from __future__ import annotations

import bpy
import numpy as np

from ..materials import material
from ..things.meshes import ground_mesh
from ..things.model_builder import ModelBuilder
from ..things.terrain import terrain_group


def build_terrain(builder: ModelBuilder) -> None:
    """Make the ground as it was, and the terrain that joins it to the road."""
    terrain = builder.parameters.terrain
    if terrain is None:
        return
    ground = ground_mesh(builder.geometry, terrain, builder.tolerance, builder.stretch, builder.origin)
    builder.add("Ground", ground, support=True)
    inputs = {
        **{role: builder.objects[role] for role in ("Backbone", "Road", "Ground")},
        "Half Width": terrain.half_width,
        "Batter Slope": terrain.batter_slope,
        "Columns": int(np.clip(terrain.half_width * 0.6, 12, 120)),
        "Instance": terrain.instance,
        "Material": material("grass_ground"),
    }
    builder.add("Terrain", bpy.data.meshes.new("SR Terrain"), terrain_group(), inputs)
