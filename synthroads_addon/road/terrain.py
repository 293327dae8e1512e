"""The surface of everything that is built and of the ground around it, at any place.

`ground.main_surface` has the main road's and the side roads'; here are also roads that cross above or join by ramps.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import Float
from .geometry import RoadGeometry
from .ground.main_surface import (
    GROUND_MARGIN,
    LEAST_COVER,
    SWALE_FROM,
    SWALE_FULL,
    VILLAGE_BLEND,
    VILLAGE_UNDULATION,
    batter_begin,
    batter_height,
    ditch_share,
    fit_to_ground,
    foot_reach,
    ground_at,
    ground_at_bridge,
    ground_at_tunnel,
    ground_elevation,
    highest_pavement,
    is_shaped,
    main_surface_elevation,
    road_elevation_model,
    rounding_height,
    shaped_width,
    side_road_surface_elevation,
    swale_share,
    undulation,
)
from .network.network import network_of

__all__ = [
    "GROUND_MARGIN",
    "LEAST_COVER",
    "SWALE_FROM",
    "SWALE_FULL",
    "VILLAGE_BLEND",
    "VILLAGE_UNDULATION",
    "batter_begin",
    "batter_height",
    "ditch_share",
    "fit_to_ground",
    "foot_reach",
    "ground_at",
    "ground_at_bridge",
    "ground_at_tunnel",
    "ground_below",
    "ground_elevation",
    "highest_pavement",
    "is_shaped",
    "known_elevation",
    "main_surface_elevation",
    "road_elevation_model",
    "rounding_height",
    "shaped_width",
    "surface_elevation",
    "swale_share",
    "undulation",
]

_BLOCK = 20_000
"""Places looked up at a time: each needs a row of all strips."""


def surface_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of road, batter or ground at stations and offsets (N,); no plants.

    A side road and a ramp have their own surfaces, and batters of their own beside them. Below an overpass it is what
    lies below; on a bridge of the road it is the bridge.
    """
    height = side_road_surface_elevation(geometry, station, offset)
    if geometry.crossing_roads:
        other = network_of(geometry).surface_height(geometry.alignment.place(station, offset))
        height = np.where(np.isnan(other) | geometry.is_carried(station, offset), height, other)
    return height


def known_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the surface's local elevation (N,), m, with the road's edge going on where an elevation model ends."""
    height = np.empty(station.shape)
    for begin in range(0, len(station), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        height[block] = surface_elevation(geometry, station[block], offset[block])
    unknown_rows = np.flatnonzero(np.isnan(height))
    if len(unknown_rows):
        edges = geometry.offsets(station[unknown_rows])
        edge_offset = np.clip(offset[unknown_rows], edges[:, -1], edges[:, 0])
        height[unknown_rows] = geometry.elevation(station[unknown_rows], edge_offset)
    return height


def ground_below(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of the ground at stations and offsets (N,), below bridges, above tunnels.

    Elsewhere it is `known_elevation`. A crossing road below a bridge belongs to the ground.
    """
    height = known_elevation(geometry, station, offset)
    for structure in geometry.structures.values() if geometry.terrain else ():
        there = np.flatnonzero((station > structure.cap_start) & (station < structure.cap_end))
        height[there] = ground_at(geometry, structure, station[there], offset[there])
        if geometry.crossing_roads and len(there):
            places = geometry.alignment.place(station[there], offset[there])
            other = network_of(geometry).surface_height(places)
            height[there] = np.where(np.isnan(other), height[there], other)
    return height
