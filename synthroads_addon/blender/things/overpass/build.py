"""Overpass bridges."""

from __future__ import annotations

import bpy
import numpy as np

from ....road.parameters import Overpass
from ...materials import material
from ..frames import stand
from ..meshes import fill
from ..model_builder import ModelBuilder
from .overpass import overpass_group

_LONGEST_APPROACH = 150.0
_APPROACH_ALONE = 20.0
"""Length (m) of the embankments where there is no terrain."""


def build_overpasses(builder: ModelBuilder) -> None:
    """Make one object per overpass."""
    terrain = builder.parameters.terrain
    for name, bridge in builder.parameters.of_type(Overpass).items():
        approaches = {}
        for side, face in (("Left", bridge.left_abutment), ("Right", -bridge.right_abutment)):
            # As far as there is ground.
            reach = terrain.half_width - face if terrain else _APPROACH_ALONE
            approaches[f"{side} Approach Length"] = float(np.clip(reach, 1.0, _LONGEST_APPROACH))
        inputs = {
            **builder.surfaces(),
            **approaches,
            "Left Abutment": bridge.left_abutment - bridge.offset,
            "Right Abutment": bridge.right_abutment - bridge.offset,
            "Skew": float(np.deg2rad(bridge.rotation_deg)),
            "Width": bridge.width,
            "Clearance": bridge.clearance,
            "Deck Thickness": bridge.deck_thickness,
            "Parapet Height": bridge.parapet_height,
            "Pier Width": bridge.pier_width,
            "Slope": terrain.batter_slope if terrain else 1.5,
            "Instance": bridge.instance,
            "Concrete Material": material("bridge_concrete"),
            "Edge Material": material("barrier_concrete"),
            "Steel Material": material("galvanised_steel"),
            "Pavement Material": material("asphalt"),
            "Ground Material": material("grass_ground"),
        }
        mesh = bpy.data.meshes.new("SR Overpass")
        across = np.array([bridge.offset - offset for offset in bridge.pier_offsets])
        fill(mesh, np.column_stack([across, np.zeros((len(across), 2))]))
        builder.add(name, mesh, overpass_group(), inputs)
        stand(builder, name, bridge)
