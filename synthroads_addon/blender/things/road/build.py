"""The backbone, a polyline along the axis with what the nodes need to know at each station, and the road's surface."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ....base.stepper import run_aside
from ....road.geometry import RoadGeometry
from ..meshes import attribute, fill
from ..model_builder import ModelBuilder
from .layout import detail_points, road_inputs, road_layout, varying_widths
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
    details = run_aside(lambda: detail_points(builder.geometry, station, builder.tolerance))
    for name, (share, depth) in details.items():
        mesh = bpy.data.meshes.new("SR Detail")
        fill(mesh, np.column_stack([share, depth, 0.0 * share]))
        attribute(mesh, "share", share)
        attribute(mesh, "depth", depth)
        builder.add(f"{name} Detail", mesh, support=True)
    inputs = {**_MATERIALS, **materials, **road_inputs(builder.parameters, builder.zero)}
    builder.add("Road", None, road_group(road_layout(builder.parameters)), inputs)


Float = NDArray[np.float64]


def backbone_mesh(geometry: RoadGeometry, station: Float, origin: Float, zero: float = 0.0) -> bpy.types.Mesh:
    """Return a polyline with one vertex per station (N,) and the attributes that `nodes.backbone` lists.

    Args:
        geometry: the road.
        station: (N,) m.
        origin: (3,) local coordinates of the scene's origin, m.
        zero: station (m) that the nodes count theirs from: as float32 they are exact near it only.
    """
    position, heading, curvature = geometry.alignment.frame(station)
    elevation = geometry.profile.elevation(station)
    values = {"station": station - zero, "curvature": curvature}
    for side in ("left", "right"):
        carriageway = geometry.parameters.carriageway(side)
        values[f"crossfall_{side}"] = geometry.crossfall(carriageway, station) if carriageway else 0.0 * station
    values |= varying_widths(geometry, station)
    mesh = bpy.data.meshes.new("SR Backbone")
    first = np.arange(len(station) - 1)
    fill(mesh, np.column_stack([position, elevation]) - origin, edges=np.column_stack([first, first + 1]))
    left = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(len(station))])
    attribute(mesh, "left", left)
    for name, value in values.items():
        attribute(mesh, name, value)
    return mesh
