"""The height of what lies open to the sky at a station and offset: the road, its batter, or the ground beside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import RoadGeometry
from .terrain import ground_elevation

Float = NDArray[np.float64]


def surface_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,) of the surface at stations and offsets (N,), without plants and furniture.

    Beside the road the batter rises or falls from the verge's edge until it meets the ground; without a terrain the
    road's edge goes on level.
    """
    edges = geometry.offsets(station)
    within = np.clip(offset, edges[:, -1], edges[:, 0])
    height = geometry.elevation(station, within)
    terrain = geometry.parameters.terrain
    beside = np.flatnonzero(within != offset)
    if terrain is not None and len(beside):
        reach = np.abs(offset - within)[beside] / terrain.batter_slope
        ground = ground_elevation(geometry, terrain, station[beside], offset[beside])
        height[beside] = np.clip(ground, height[beside] - reach, height[beside] + reach)
    return height
