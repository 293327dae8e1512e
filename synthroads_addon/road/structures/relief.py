"""The ground at structures: valleys below bridges, hills above tunnels, and what meets their ends."""

from __future__ import annotations

import numpy as np

from ...base.arrays import Float
from .bridge import Bridge
from .tunnel import Tunnel

_SLOPE_LENGTH = 4.0
"""Length of a valley's slope per metre of its depth, m/m: on average 1 : 4, at its steepest 1 : 2.7. Chosen."""
_HILL_INSIDE = 0.4
"""Share of a hill's slope that lies inside of a tunnel: at the portal the hill has two thirds of its height. Chosen."""
_CHORD, _CLOSEST = 0.01, 0.5
"""Largest distance of a valley's slope from its chords along the road, and the least spacing of rows for it, m."""
_INSIDE_SHARE = 0.3
"""Share of a bridge's length that the slope reaches into it from either end, at most; chosen."""


def relief_height(structure: Bridge | Tunnel) -> float:
    """Return the height (m) of the generated ground above the road in a structure's middle; negative below bridges."""
    if isinstance(structure, Bridge):
        return -structure.valley_depth
    return structure.height + structure.wall_thickness + structure.cover


def relief_share(structure: Bridge | Tunnel, station: Float) -> Float:
    """Return the share (N,) of its depth that a valley, or of its height that a hill has at stations (N,).

    It is 1 in the middle. A part of either slope lies inside, as far as the structure is long enough.
    """
    length, inside = _slope(structure)
    outside = np.maximum(structure.start_station + inside - station, station - structure.end_station + inside)
    share = np.clip(1.0 - outside / length, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def relief_range(structure: Bridge | Tunnel) -> tuple[float, float]:
    """Return the stations (m) at which a structure's valley or hill begins and ends."""
    length, inside = _slope(structure)
    return structure.start_station + inside - length, structure.end_station - inside + length


def _slope(structure: Bridge | Tunnel) -> tuple[float, float]:
    """Return the length of a valley's or hill's slope, and how far it reaches into the structure, m."""
    length = max(_SLOPE_LENGTH * abs(relief_height(structure)), 1.0)
    share = 0.5 if isinstance(structure, Bridge) else _HILL_INSIDE
    return length, min(share * length, _INSIDE_SHARE * (structure.end_station - structure.start_station))


def relief_stations(structure: Bridge | Tunnel) -> Float:
    """Return the stations (N,), m, before and behind a structure at which rows follow its relief within `_CHORD`."""
    length, _ = _slope(structure)
    height = max(abs(relief_height(structure)), 0.1)
    # Of share = 3 x^2 - 2 x^3 the largest second derivative is 6; chord error of a curve: s = l^2 k / 8.
    spacing = max(float(np.sqrt(8.0 * _CHORD * length**2 / (6.0 * height))), _CLOSEST)
    first, last = relief_range(structure)
    pieces = []
    for start, end in ((first, structure.cap_start), (structure.cap_end, last)):
        if end > start:
            pieces.append(np.linspace(start, end, int(np.ceil((end - start) / spacing)) + 1))
    return np.concatenate([np.empty(0), *pieces])
