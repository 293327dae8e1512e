"""Triangles of the ground at structures of the road: below and beside bridges, above and beside tunnels."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Float, Int
from ..road.alignment import clip_offset
from ..road.geometry import RoadGeometry
from ..road.network.network import BURIED
from ..road.structures.bridge import Bridge
from ..road.structures.tunnel import Tunnel
from ..road.surroundings import Terrain
from ..road.terrain import ground_at
from .faces import grid_corners

_FINE_ROWS, _COARSE_ROWS, _FINE_REACH = 0.5, 2.0, 25.0
"""Spacing of rows near a bridge's ends and in between, and how far from an end they are close, m."""
_FINE_COLUMNS, _COARSE_COLUMNS, _FINE_WIDTH = 0.75, 2.5, 18.0
"""Spacing of columns beside the road's edges and farther out, and how far they are close, m."""
_UNDER_COLUMNS = 2.0
"""Spacing of columns below the deck, m."""


@dataclass(frozen=True)
class GroundPatch:
    """Ground between two stations, from one side of the terrain to the other.

    Attributes:
        points: (R, C, 3) local, m; columns from left to right.
        outwards: (R, C) distance from the road's edges, m; 0 below or above the road.
        quads: (Q, 4) corners as indices into the points, anticlockwise from above.
    """

    points: Float
    outwards: Float
    quads: Int


def structure_ground_patch(geometry: RoadGeometry, structure: Bridge | Tunnel, terrain: Terrain) -> GroundPatch | None:
    """Return the ground at a bridge or a tunnel, between the ends of its caps or its portals; None off the road.

    Args:
        geometry: the road.
        structure: one of its bridges or tunnels.
        terrain: the road's.
    """
    start, end = max(structure.cap_start, 0.0), min(structure.cap_end, geometry.length)
    if end - start < 2.0 * BURIED:
        return None
    station = _rows(start, end)
    edges = geometry.offsets(station)[:, [0, -1]]
    reach = terrain.half_width - np.abs(edges)
    near = np.arange(0.0, _FINE_WIDTH, _FINE_COLUMNS)
    far = np.arange(_FINE_WIDTH, max(float(reach.max()), _FINE_WIDTH), _COARSE_COLUMNS)
    distance = np.concatenate([near, far, [max(float(reach.max()), 0.0)]])
    width = float((edges[:, 0] - edges[:, 1]).max())
    share = np.linspace(0.0, 1.0, max(2, int(np.ceil(width / _UNDER_COLUMNS)) + 1))[1:-1]
    left = edges[:, :1] + np.minimum(distance[::-1], reach[:, :1])
    right = edges[:, 1:] - np.minimum(distance, reach[:, 1:])
    offset = np.concatenate([left, edges[:, :1] + share * (edges[:, 1:] - edges[:, :1]), right], axis=1)
    offset = clip_offset(offset, geometry.alignment.curvature(station)[:, None])
    columns = offset.shape[1]
    stations = np.repeat(station, columns)
    height = ground_at(geometry, structure, stations, offset.ravel())
    plan = geometry.alignment.place(stations, offset.ravel())
    points = np.column_stack([plan, height]).reshape(len(station), columns, 3)
    quads = grid_corners(len(station), columns)
    row, column = quads[:, 3] // columns, quads[:, 3] % columns
    is_under = (column >= len(distance) - 1) & (column < len(distance) + len(share))
    touches = (station[row] < start + BURIED - 1e-6) | (station[row + 1] > end - BURIED + 1e-6)
    has_area = np.abs(np.diff(offset, axis=1))[row, column] + np.abs(np.diff(offset, axis=1))[row + 1, column] > 1e-6
    if isinstance(structure, Tunnel):
        is_under &= False
    quads = quads[~(is_under & touches) & has_area]
    outwards = np.maximum(np.maximum(offset - edges[:, :1], edges[:, 1:] - offset), 0.0)
    return GroundPatch(points, outwards, quads)


def _rows(start: float, end: float) -> Float:
    """Return the stations (R,) of the rows between two stations, m."""
    marks = np.unique(
        np.clip([start, start + BURIED, start + _FINE_REACH, end - _FINE_REACH, end - BURIED, end], start, end)
    )
    pieces = []
    for first, last in pairwise(marks.tolist()):
        is_near = min(first - start, end - last) < _FINE_REACH - 1e-6
        spacing = _FINE_ROWS if is_near else _COARSE_ROWS
        pieces.append(np.linspace(first, last, max(2, int(np.ceil((last - first) / spacing)) + 1))[:-1])
    return np.append(np.concatenate(pieces), end)
