"""The height of what lies open to the sky at a station and offset: the road, its batter, or the ground beside it."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Float
from .geometry import RoadGeometry
from .terrain import ground_elevation

_BLOCK = 20_000
"""Places looked up at a time: each needs a row of all strips."""


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


def known_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return `surface_elevation` in bounded memory, with the road's edge going on where an elevation model ends."""
    height = np.empty(station.shape)
    for first in range(0, len(station), _BLOCK):
        part = slice(first, first + _BLOCK)
        height[part] = surface_elevation(geometry, station[part], offset[part])
    unknown = np.flatnonzero(np.isnan(height))
    if len(unknown):
        edges = geometry.offsets(station[unknown])
        within = np.clip(offset[unknown], edges[:, -1], edges[:, 0])
        height[unknown] = geometry.elevation(station[unknown], within)
    return height


def highest_pavement(geometry: RoadGeometry, station: Float, offset: Float) -> float | None:
    """Return the largest local elevation of those places (N,) that are paved, m; None without any."""
    strip = geometry.strip_index(station, offset)
    paved = np.array([item.class_name == "road" for item in geometry.strips])
    on = (strip >= 0) & paved[strip] & (station >= 0.0) & (station <= geometry.length)
    return float(np.max(geometry.elevation(station[on], offset[on]))) if on.any() else None
