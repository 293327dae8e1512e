"""The backbone's mesh: a polyline along the axis with what the nodes need to know at each station."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ....road.geometry import RoadGeometry
from ..meshes import attribute, fill
from .layout import varying_widths

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
