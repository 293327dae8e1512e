"""Overpass bridges."""

from __future__ import annotations

import bpy
import numpy as np

from ....road.parameters import Overpass
from ..meshes import fill
from ..model_builder import ModelBuilder
from .overpass import overpass_group

_LONGEST_APPROACH = 150.0
_APPROACH_ALONE = 20.0
"""Length (m) of the embankments where there is no terrain."""
_MATERIALS = {
    "concrete_material": "bridge_concrete",
    "edge_material": "barrier_concrete",
    "steel_material": "galvanised_steel",
    "pavement_material": "asphalt",
    "ground_material": "grass_ground",
}


def build_overpasses(builder: ModelBuilder) -> None:
    """Make one object per overpass."""
    terrain = builder.parameters.terrain
    for name, bridge in builder.parameters.of_type(Overpass).items():
        approaches = {}
        for side, face in (("left", bridge.left_abutment), ("right", -bridge.right_abutment)):
            # As far as there is ground.
            reach = terrain.half_width - face if terrain else _APPROACH_ALONE
            approaches[f"{side}_approach_length"] = float(np.clip(reach, 1.0, _LONGEST_APPROACH))
        mesh = bpy.data.meshes.new("SR Overpass")
        across = np.array([bridge.offset - offset for offset in bridge.pier_offsets])
        fill(mesh, np.column_stack([across, np.zeros((len(across), 2))]))
        builder.add_thing(
            name,
            bridge,
            overpass_group(),
            mesh,
            **approaches,
            left_abutment=bridge.left_abutment - bridge.offset,
            right_abutment=bridge.right_abutment - bridge.offset,
            skew=float(np.deg2rad(bridge.rotation_deg)),
            slope=terrain.batter_slope if terrain else 1.5,
            **_MATERIALS,
        )
        builder.stand(name, bridge)
