"""The surface of everything that is built and of the ground around it, at any place.

`ground.main_surface` has the main road's and the side roads'; here are also roads that cross above or join by ramps.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import Float
from .geometry import RoadGeometry
from .ground.main_surface import GROUND_MARGIN as GROUND_MARGIN
from .ground.main_surface import LEAST_COVER as LEAST_COVER
from .ground.main_surface import SWALE_FROM as SWALE_FROM
from .ground.main_surface import SWALE_FULL as SWALE_FULL
from .ground.main_surface import VILLAGE_BLEND as VILLAGE_BLEND
from .ground.main_surface import VILLAGE_UNDULATION as VILLAGE_UNDULATION
from .ground.main_surface import batter_begin as batter_begin
from .ground.main_surface import batter_height as batter_height
from .ground.main_surface import ditch_share as ditch_share
from .ground.main_surface import fit_to_ground as fit_to_ground
from .ground.main_surface import foot_reach as foot_reach
from .ground.main_surface import ground_at as ground_at
from .ground.main_surface import ground_at_bridge as ground_at_bridge
from .ground.main_surface import ground_at_tunnel as ground_at_tunnel
from .ground.main_surface import ground_elevation as ground_elevation
from .ground.main_surface import highest_pavement as highest_pavement
from .ground.main_surface import is_shaped as is_shaped
from .ground.main_surface import main_surface_elevation as main_surface_elevation
from .ground.main_surface import road_elevation_model as road_elevation_model
from .ground.main_surface import rounding_height as rounding_height
from .ground.main_surface import shaped_width as shaped_width
from .ground.main_surface import side_road_surface_elevation
from .ground.main_surface import swale_share as swale_share
from .ground.main_surface import undulation as undulation
from .network.network import network_of
from .other_roads.parts import CrossingRoad

_BLOCK = 20_000
"""Places looked up at a time: each needs a row of all strips."""


def surface_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of road, batter or ground at stations and offsets (N,); no plants.

    A side road and a ramp have their own surfaces, and batters of their own beside them. Below a bridge it is what lies
    below.
    """
    height = side_road_surface_elevation(geometry, station, offset)
    if geometry.parameters.of_type(CrossingRoad):
        other = network_of(geometry).surface_height(geometry.alignment.place(station, offset))
        height = np.where(np.isnan(other), height, other)
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

    Elsewhere it is `known_elevation`.
    """
    height = known_elevation(geometry, station, offset)
    for structure in geometry.structures.values() if geometry.terrain else ():
        there = np.flatnonzero((station > structure.cap_start) & (station < structure.cap_end))
        height[there] = ground_at(geometry, structure, station[there], offset[there])
    return height
