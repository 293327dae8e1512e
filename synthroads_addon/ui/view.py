"""A view of the road that shows what was built."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

from ..core.parameters.geometry import RoadGeometry
from ..core.parameters.model import RoadParameters

_FARTHEST = 800.0
"""Of a longer road only this much, m, is looked at."""


def look_along(space: bpy.types.SpaceView3D, parameters: RoadParameters) -> None:
    """Turn a 3D view to look along the road from behind its beginning, and make it reach that far."""
    geometry = RoadGeometry(parameters)
    reach = min(geometry.length, _FARTHEST)
    stations = np.array([0.0, 0.3 * reach])
    plan, heading, _ = geometry.alignment.frame(stations)
    begin, target = (Vector(point) for point in np.column_stack([plan, geometry.profile.elevation(stations)]))
    back = Vector((np.cos(heading[0]), np.sin(heading[0]), 0.0)) * (0.10 * reach + 10.0)
    eye = begin - back + Vector((0.0, 0.0, 0.12 * reach + 5.0))
    region = space.region_3d
    region.view_perspective = "PERSP"
    region.view_location = target
    region.view_rotation = (target - eye).to_track_quat("-Z", "Y")
    region.view_distance = (target - eye).length
    # Blender's own clip start of 1 cm leaves too little depth to tell paint from asphalt some hundred metres away.
    space.clip_start = max(space.clip_start, 0.5)
    space.clip_end = max(space.clip_end, 5.0 * reach)
