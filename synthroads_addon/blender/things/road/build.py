"""The road's surface."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ....base.stepper import aside
from ...materials import material
from ..meshes import attribute, fill
from ..model_builder import ModelBuilder
from .backbone import backbone_mesh
from .layout import detail_points, road_inputs, road_layout
from .road import road_group

_MATERIALS = {"Marking": "paint_white", "Yellow Marking": "paint_yellow", "Verge": "verge", "Median": "median"}


def build_surface(builder: ModelBuilder) -> None:
    """Make the backbone and the road's surface."""
    station = builder.stations
    backbone = backbone_mesh(builder.geometry, station, builder.origin, builder.zero)
    builder.add("Backbone", backbone, support=True)
    inputs: dict[str, Any] = {"Backbone": builder.objects["Backbone"]}
    inputs |= {f"{name} Material": material(entry) for name, entry in _MATERIALS.items()}
    for side, section in builder.geometry.sections.items():
        inputs[f"{side.title()} Pavement Material"] = material(section.carriageway.pavement.kind)
    details = aside(lambda: detail_points(builder.geometry, station, builder.tolerance))
    for name, (share, depth) in details.items():
        mesh = bpy.data.meshes.new("SR Detail")
        fill(mesh, np.column_stack([share, depth, 0.0 * share]))
        attribute(mesh, "share", share)
        attribute(mesh, "depth", depth)
        role = f"{name} Detail"
        builder.add(role, mesh, support=True)
        inputs[role] = builder.objects[role]
    inputs |= road_inputs(builder.parameters, builder.zero)
    builder.add("Road", bpy.data.meshes.new("SR Road"), road_group(road_layout(builder.parameters)), inputs)
