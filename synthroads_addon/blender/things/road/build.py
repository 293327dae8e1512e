"""The road's surface."""

from __future__ import annotations

import bpy
import numpy as np

from ....base.stepper import aside
from ..meshes import attribute, fill
from ..model_builder import ModelBuilder
from .backbone import backbone_mesh
from .layout import detail_points, road_inputs, road_layout
from .road import road_group

_MATERIALS = {
    "Marking Material": "paint_white",
    "Yellow Marking Material": "paint_yellow",
    "Verge Material": "verge",
    "Median Material": "median",
}


def build_surface(builder: ModelBuilder) -> None:
    """Make the backbone and the road's surface."""
    station = builder.stations
    backbone = backbone_mesh(builder.geometry, station, builder.origin, builder.zero)
    builder.add("Backbone", backbone, support=True)
    materials = {
        f"{side.title()} Pavement Material": section.carriageway.pavement.kind
        for side, section in builder.geometry.sections.items()
    }
    details = aside(lambda: detail_points(builder.geometry, station, builder.tolerance))
    for name, (share, depth) in details.items():
        mesh = bpy.data.meshes.new("SR Detail")
        fill(mesh, np.column_stack([share, depth, 0.0 * share]))
        attribute(mesh, "share", share)
        attribute(mesh, "depth", depth)
        builder.add(f"{name} Detail", mesh, support=True)
    inputs = {**_MATERIALS, **materials, **road_inputs(builder.parameters, builder.zero)}
    builder.add("Road", None, road_group(road_layout(builder.parameters)), inputs)
