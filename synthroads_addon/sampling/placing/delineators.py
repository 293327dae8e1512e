"""Delineators: every 50 m and closer in curves, on the outer side of either carriageway (HLB)."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator

import numpy as np

from ...base.arrays import Float
from ...road.guidelines import DELINEATOR_SPACING
from ...road.parameters import HorizontalElement
from ...road.things.delineator import Delineator
from .layout import Roadside

DELINEATOR_DISTANCE = 0.50
"""From the paved edge to the delineator's axis where there is no barrier (m)."""
DELINEATOR_BEHIND_BARRIER = 1.15
"""From the edge that a barrier was placed by to the axis of a delineator behind it (m)."""
_REACH = 0.5  # m along the road: a post keeps clear of barriers and pavement over so much to either side


def delineators(roadside: Roadside, stations: Float) -> Iterator[tuple[str, Delineator]]:
    """Yield (id, post) at stations (P,) along one side, behind the barrier where one stands."""
    distances = roadside.edge.line_beside(stations, _REACH) + DELINEATOR_DISTANCE
    for piece in roadside.pieces:
        covered = (stations > piece.start - _REACH) & (stations < piece.end + _REACH)
        distances[covered] = np.maximum(distances[covered], piece.base + DELINEATOR_BEHIND_BARRIER)
    facing = roadside.facing
    places = zip(np.round(stations, 9).tolist(), np.round(roadside.sign * distances, 9).tolist(), strict=True)
    for number, (station, offset) in enumerate(places, start=1):
        post = Delineator(instance=1, station=station, offset=offset, rotation_deg=facing)
        yield f"delineator-{roadside.side}-{number:04d}", post


def delineator_stations(elements: tuple[HorizontalElement, ...]) -> Float:
    """Return stations of delineators, from half a spacing after the beginning to the end.

    Between two posts lies the spacing of the table at the tightest curvature within the next 50 m, so that the posts
    come closer before a curve begins.
    """
    widest_radius, widest = DELINEATOR_SPACING[-1]
    tightest = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in elements)
    if tightest <= 1.0 / widest_radius:
        length = math.fsum(e.length for e in elements)
        first = min(widest, length) / 2.0
        return first + widest * np.arange(int((length - first) / widest) + 1)
    spacing = _PostSpacing(elements, widest)
    stations, station = [], min(spacing.at(0.0), spacing.length) / 2.0
    while station <= spacing.length:
        stations.append(station)
        station += spacing.at(station)
    return np.array(stations)


class _PostSpacing:
    """Spacing of delineators by station.

    Attributes:
        length: of the road, m.
    """

    def __init__(self, elements: tuple[HorizontalElement, ...], reach: float) -> None:
        self._elements, self._reach = elements, reach
        self._starts = np.concatenate([[0.0], np.cumsum([e.length for e in elements])]).tolist()
        self._radii, self._spacings = np.array(DELINEATOR_SPACING).T
        self.length = self._starts[-1]

    def at(self, station: float) -> float:
        """Return the spacing (m) behind a post: the table's at the tightest curvature within the reach."""
        last = len(self._elements) - 1
        first = min(bisect_right(self._starts, station) - 1, last)
        final = min(bisect_right(self._starts, station + self._reach) - 1, last)
        # Curvature is linear along an element: its largest values stand at the ends of what lies ahead.
        ahead = [abs(self._curvature(first, station)), abs(self._curvature(final, station + self._reach))]
        ahead += [abs(element.curvature_end) for element in self._elements[first:final]]
        ahead += [abs(element.curvature_start) for element in self._elements[first + 1 : final + 1]]
        return float(np.interp(1.0 / max(*ahead, 1e-9), self._radii, self._spacings))

    def _curvature(self, index: int, station: float) -> float:
        element = self._elements[index]
        share = min((station - self._starts[index]) / element.length, 1.0)
        return element.curvature_start + share * (element.curvature_end - element.curvature_start)
