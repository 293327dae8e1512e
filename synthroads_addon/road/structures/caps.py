"""The caps of a bridge as a surface: concrete with a kerb in place of the verges and the median."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ...base.arrays import Float

CAP_RISE = 0.04
"""Rise of outer caps away from the pavement, m/m (C: 4 % is usual)."""
KERB_LEAN = 0.015
"""Width over which a kerb comes to its height, m; chosen."""
CAP_RAMP = 1.0
"""Length over which caps come to their height at either end, m; chosen."""
NARROWEST_CAP = 0.3
"""Width of a median from which it has a cap, m; chosen."""


class Capped(Protocol):
    """The values of a structure on which its caps depend."""

    @property
    def kerb_height(self) -> float:
        """Return the height of the kerbs above the pavement, m."""

    @property
    def cap_start(self) -> float:
        """Return the station at which the caps begin, m."""

    @property
    def cap_end(self) -> float:
        """Return the station at which the caps end, m."""


def cap_share(structure: Capped, station: Float) -> Float:
    """Return the share (N,) of their height that caps have at stations (N,): 0 beyond their ends."""
    to_end = np.minimum(station - structure.cap_start, structure.cap_end - station)
    return np.clip(to_end / CAP_RAMP, 0.0, 1.0)


def outer_cap_height(structure: Capped, distance: Float) -> Float:
    """Return the height (N,) of an outer cap above the pavement's edge at distances (N,) outwards from it, m."""
    kerb = structure.kerb_height * np.clip(distance / KERB_LEAN, 0.0, 1.0)
    return kerb + CAP_RISE * np.maximum(distance - KERB_LEAN, 0.0)


def median_cap_height(structure: Capped, width: Float, distance: Float) -> Float:
    """Return the height (N,) of the median's cap above the line between both pavements' edges, m.

    Args:
        structure: the bridge.
        width: (N,) of the median, m.
        distance: (N,) from its left edge, m.
    """
    to_edge = np.minimum(distance, width - distance)
    height = structure.kerb_height * np.clip(to_edge / KERB_LEAN, 0.0, 1.0)
    return np.where(width >= NARROWEST_CAP, height, 0.0)


def capped_elevation(
    structure: Capped, height: Float, place: tuple[Float, Float], section: tuple[Float, Float], median: int | None
) -> Float:
    """Return the surface's elevations (N,), m, with a structure's caps where they lie.

    Args:
        structure: the bridge.
        height: (N,) elevations without caps, m.
        place: stations and offsets (N,), m.
        section: offsets and elevations (N, B) of the strips' boundaries there, from the left, m; the outermost strips
            are verges.
        median: index of the median among the strips, if there is one.
    """
    station, offset = place
    offsets, heights = section
    result = height.copy()
    share = cap_share(structure, station)
    for distance, edge in ((offset - offsets[:, 1], heights[:, 1]), (offsets[:, -2] - offset, heights[:, -2])):
        on_cap = np.flatnonzero((share > 0.0) & (distance > 0.0) & ~np.isnan(height))
        cap = edge[on_cap] + outer_cap_height(structure, distance[on_cap])
        result[on_cap] += share[on_cap] * (cap - height[on_cap])
    if median is not None:
        left, right = offsets[:, median], offsets[:, median + 1]
        on_cap = np.flatnonzero((share > 0.0) & (offset < left) & (offset > right))
        lift = median_cap_height(structure, (left - right)[on_cap], (left - offset)[on_cap])
        result[on_cap] += share[on_cap] * lift
    return result
