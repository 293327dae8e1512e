"""The ground at structures: valleys below bridges, hills above tunnels, and what meets their ends."""

from __future__ import annotations

import numpy as np

from ...base.arrays import Float
from .bridge import Bridge

_SLOPE_LENGTH = 4.0
"""Length of a valley's slope per metre of its depth, m/m: on average 1 : 4, at its steepest 1 : 2.7. Chosen."""
_CHORD, _CLOSEST = 0.01, 0.5
"""Largest distance of a valley's slope from its chords along the road, and the least spacing of rows for it, m."""
_INSIDE_SHARE = 0.3
"""Share of a bridge's length that the slope reaches into it from either end, at most; chosen."""


def valley_share(bridge: Bridge, station: Float) -> Float:
    """Return the share (N,) of its depth that the valley below a bridge has at stations (N,): 1 in the middle.

    Half of either slope lies below the bridge, as far as that is long enough.
    """
    length, inside = _slope(bridge)
    outside = np.maximum(bridge.start_station + inside - station, station - bridge.end_station + inside)
    share = np.clip(1.0 - outside / length, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def valley_range(bridge: Bridge) -> tuple[float, float]:
    """Return the stations (m) at which the valley below a bridge begins and ends."""
    length, inside = _slope(bridge)
    return bridge.start_station + inside - length, bridge.end_station - inside + length


def _slope(bridge: Bridge) -> tuple[float, float]:
    """Return the length of a valley's slope, and how far it reaches below the bridge, m."""
    length = max(_SLOPE_LENGTH * bridge.valley_depth, 1.0)
    return length, min(length / 2.0, _INSIDE_SHARE * (bridge.end_station - bridge.start_station))


def valley_stations(bridge: Bridge) -> Float:
    """Return the stations (N,), m, before and behind a bridge at which rows follow its valley within `_CHORD`."""
    length, _ = _slope(bridge)
    # Of share = 3 x^2 - 2 x^3 the largest second derivative is 6; chord error of a curve: s = l^2 k / 8.
    spacing = max(float(np.sqrt(8.0 * _CHORD * length**2 / (6.0 * max(bridge.valley_depth, 0.1)))), _CLOSEST)
    first, last = valley_range(bridge)
    pieces = []
    for start, end in ((first, bridge.cap_start), (bridge.cap_end, last)):
        if end > start:
            pieces.append(np.linspace(start, end, int(np.ceil((end - start) / spacing)) + 1))
    return np.concatenate([np.empty(0), *pieces])
