"""Delineators: every 50 m and closer in curves, on the outer side of either carriageway (HLB)."""

import math
from bisect import bisect_right
from collections.abc import Iterator
from itertools import accumulate

import numpy as np

from ...base.arrays import Float
from ...road.guidelines import DELINEATOR_SPACING
from ...road.other_roads.axis import HorizontalElement
from ...road.things.delineator import Delineator
from .layout import Roadside
from .ranges import Range

DELINEATOR_DISTANCE = 0.50
"""From the paved edge to the delineator's axis where there is no barrier (m)."""
DELINEATOR_BEHIND_BARRIER = 1.15
"""From the edge that a barrier was placed by to the axis of a delineator behind it (m)."""
_NEAR_POST = 1.0  # m along the road: a post so near beside an opening stands for one at its end
_REACH = 0.5  # m along the road: a post keeps clear of barriers and pavement over so much to either side


def delineators(roadside: Roadside, stations: Float) -> Iterator[tuple[str, Delineator]]:
    """Yield (id, delineator) at stations (P,) along one side, behind the barrier where one stands.

    Those that would stand in a side road's mouth stand at both its ends.
    """
    openings = sorted([*roadside.openings, *roadside.mouths.stretches])
    stations = _beside_openings(stations, openings, roadside.length)
    distances = roadside.edge.line_beside(stations, _REACH) + DELINEATOR_DISTANCE
    for piece in roadside.pieces:
        behind_barrier = (stations > piece.start - _REACH) & (stations < piece.end + _REACH)
        distances[behind_barrier] = np.maximum(distances[behind_barrier], piece.base + DELINEATOR_BEHIND_BARRIER)
    facing = roadside.facing
    places = zip(np.round(stations, 9).tolist(), np.round(roadside.sign * distances, 9).tolist(), strict=True)
    for number, (station, offset) in enumerate(places, start=1):
        post = Delineator(instance=1, station=station, offset=offset, rotation_deg=facing)
        yield f"delineator-{roadside.side}-{number:04d}", post


def _beside_openings(stations: Float, openings: list[Range], length: float) -> Float:
    """Return stations (P,), those in openings replaced by one on either side of each opening, m."""
    for start, end in openings:
        kept = stations[(stations <= start - _REACH) | (stations >= end + _REACH)]
        beside = [
            place
            for place in (start - _REACH, end + _REACH)
            if 0.0 <= place <= length and not (np.abs(kept - place) < _NEAR_POST).any()
        ]
        stations = np.sort(np.append(kept, beside))
    return stations


def delineator_stations(elements: tuple[HorizontalElement, ...]) -> Float:
    """Return the stations (P,) of delineators, m, from half a spacing after the beginning to the end.

    Between two posts lies the spacing of the table at the tightest curvature within the next 50 m, so that the posts
    come closer before a curve begins.
    """
    widest_radius, widest_spacing = DELINEATOR_SPACING[-1]
    largest_curvature = max(max(abs(e.curvature_start), abs(e.curvature_end)) for e in elements)
    if largest_curvature <= 1.0 / widest_radius:
        length = math.fsum(e.length for e in elements)
        first_station = min(widest_spacing, length) / 2.0
        return first_station + widest_spacing * np.arange(int((length - first_station) / widest_spacing) + 1)
    starts = [0.0, *accumulate(e.length for e in elements)]
    stations, station = [], min(_spacing_behind(elements, starts, 0.0), starts[-1]) / 2.0
    while station <= starts[-1]:
        stations.append(station)
        station += _spacing_behind(elements, starts, station)
    return np.array(stations)


def _spacing_behind(elements: tuple[HorizontalElement, ...], starts: list[float], station: float) -> float:
    """Return the spacing (m) behind a delineator: the table's at the tightest curvature within the widest spacing.

    Args:
        elements: of the centreline.
        starts: stations of their borders, m.
        station: of the post, m.
    """
    end = station + DELINEATOR_SPACING[-1][1]
    first_element, last_element = (min(bisect_right(starts, place) - 1, len(elements) - 1) for place in (station, end))
    # Curvature is linear along an element: its largest values stand at the ends of what lies ahead.
    curvatures_ahead = [
        _curvature(elements[i], place - starts[i]) for i, place in ((first_element, station), (last_element, end))
    ]
    curvatures_ahead += [element.curvature_end for element in elements[first_element:last_element]]
    curvatures_ahead += [element.curvature_start for element in elements[first_element + 1 : last_element + 1]]
    radii, spacings = zip(*DELINEATOR_SPACING, strict=True)
    return float(np.interp(1.0 / max(*map(abs, curvatures_ahead), 1e-9), radii, spacings))


def _curvature(element: HorizontalElement, distance: float) -> float:
    """Return the curvature (1/m) at a distance (m) from an element's begin; behind its end that of the end."""
    share = min(distance / element.length, 1.0)
    return element.curvature_start + share * (element.curvature_end - element.curvature_start)
