"""The two carriageways of a road on a map, and the axis midway between them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Bool, Float
from .way_chains import Chain, on_plane

_NEAREST, _FARTHEST = 4.0, 60.0
"""Least and largest distance of the lines of two carriageways, m (chosen)."""
_OPPOSITE = np.cos(np.radians(150.0))
"""Cosine up to which two directions are opposite."""
_REACH = 0.001
"""Degrees of latitude, more than `_FARTHEST` anywhere."""
_STEP = 5.0
"""Distance of the places at which two lines are compared, m."""
_MOST = 100_000
"""Most places of a line at which it is compared (chosen)."""
_SAFE = 0.8
"""Share of the shorter carriageway beside which the other one must run."""


@dataclass(frozen=True)
class Pair:
    """Two carriageways side by side.

    Attributes:
        one, other: of them; the axis runs in the direction of the first.
        points: (N, 2) of the axis midway, longitude and latitude, degrees.
        begin, end: stretch of the first one that the axis follows, m.
        spread: median distance of the two, m.
        spread_range: its 5th and 95th percentile, m.
        keeps_right: whether traffic does.
    """

    one: Chain
    other: Chain
    points: Float
    begin: float
    end: float
    spread: float
    spread_range: tuple[float, float]
    keeps_right: bool


@dataclass(frozen=True)
class _Dense:
    """A line with places every few metres: points (N, 2), directions (N, 2), stations (N,)."""

    points: Float
    directions: Float
    stations: Float

    @classmethod
    def of(cls, nodes: Float) -> _Dense:
        """Return a line through nodes (N, 2), m, as arcs: between two nodes it bends as `_bend_between` says."""
        length = np.hypot(*np.diff(nodes, axis=0).T)
        nodes = nodes[np.concatenate([[True], length > 0.0])]
        chord = np.diff(nodes, axis=0)
        length = np.hypot(*chord.T)
        chord_direction = chord / length[:, None]
        start = np.concatenate([[0.0], np.cumsum(length)])
        count = int(min(max(2, np.ceil(start[-1] / _STEP) + 1), _MOST))
        station = np.unique(np.concatenate([np.linspace(0.0, start[-1], count), start]))
        chord_index = np.clip(np.searchsorted(start, station, "right") - 1, 0, len(length) - 1)
        distance = station - start[chord_index]
        # A parabola in place of the arc: its offset from the chord L at a distance u is k u (L - u) / 2.
        bend = _bend_between(chord_direction, length)[chord_index]
        normal = np.column_stack([-chord_direction[:, 1], chord_direction[:, 0]])[chord_index]
        offset = -0.5 * bend * distance * (length[chord_index] - distance)
        points = nodes[chord_index] + distance[:, None] * chord_direction[chord_index] + offset[:, None] * normal
        slope = -0.5 * bend * (length[chord_index] - 2.0 * distance)
        direction = chord_direction[chord_index] + slope[:, None] * normal
        return cls(points, direction / np.hypot(*direction.T)[:, None], station)

    def feet(self, points: Float, directions: Float) -> tuple[Float, Bool]:
        """Return the feet (K, 2), m, of points (K, 2) on this line, and which are on the opposite carriageway (K,).

        A foot is on the opposite carriageway where this line runs against the directions (K, 2) of the points, and lies
        beside them at a distance that two carriageways have.
        """
        from scipy.spatial import cKDTree  # takes a tenth of a second, and few roads are of maps

        _, nearest = cKDTree(self.points).query(points)
        places, tangents = self.points[nearest], self.directions[nearest]
        distance = ((points - places) * tangents).sum(axis=1)
        feet = places + distance[:, None] * tangents
        gap = np.hypot(*(points - feet).T)
        is_opposite = (tangents * directions).sum(axis=1) < _OPPOSITE
        return feet, is_opposite & (np.abs(distance) <= _STEP) & (gap >= _NEAREST) & (gap <= _FARTHEST)


def _bend_between(directions: Float, lengths: Float) -> Float:
    """Return the curvature (K,), 1/m, between nodes: the lesser of those at both, 0 where they bend apart."""
    angle = np.arctan2(
        *(
            directions[:-1, 0] * directions[1:, 1] - directions[:-1, 1] * directions[1:, 0],
            (directions[:-1] * directions[1:]).sum(axis=1),
        )
    )
    node_bend = 2.0 * np.sin(angle) / np.maximum(lengths[:-1] + lengths[1:], 1e-9)
    start_bend, end_bend = np.concatenate([[0.0], node_bend]), np.concatenate([node_bend, [0.0]])
    smaller_bend = np.where(np.abs(start_bend) < np.abs(end_bend), start_bend, end_bend)
    return np.where(start_bend * end_bend > 0.0, smaller_bend, 0.0)


def paired(one: Chain, other: Chain) -> Pair | str:
    """Return two carriageways of a road as a pair, or the reason (text) why they are none; "" where they lie apart."""
    origin = one.points.mean(axis=0)
    nodes, other_nodes = on_plane(one.points, origin), on_plane(other.points, origin)
    line, other_line = _Dense.of(nodes), _Dense.of(other_nodes)
    feet, is_beside = other_line.feet(line.points, line.directions)
    if not is_beside.any():
        return ""
    is_left = _cross(line.directions, feet - line.points) > 0.0
    keeps_right = bool(is_left[is_beside].mean() >= 0.5)
    begin, end = _longest(is_beside & (is_left == keeps_right))
    common = float(line.stations[end] - line.stations[begin])
    shorter_length = min(line.stations[-1], other_line.stations[-1])
    if common < _SAFE * shorter_length:
        needed = f"{100.0 * _SAFE:.0f} % of {shorter_length:.0f} m are needed"
        return f"the two run beside each other over {common:.0f} m, {needed}"
    begin_station, end_station = float(line.stations[begin]), float(line.stations[end])
    points = _midway(line, other_line, nodes, other_nodes, (begin_station, end_station))
    spread = np.hypot(*(feet - line.points)[begin : end + 1].T)
    spread_5, spread_95 = np.percentile(spread, [5.0, 95.0]).tolist()
    metres_per_degree = on_plane(origin[None] + 1.0, origin)[0]
    degrees = origin + points / metres_per_degree
    return Pair(
        one, other, degrees, begin_station, end_station, float(np.median(spread)), (spread_5, spread_95), keeps_right
    )


def _midway(
    first: _Dense, second: _Dense, first_nodes: Float, second_nodes: Float, stretch: tuple[float, float]
) -> Float:
    """Return places (N, 2), m, midway between two lines, at the nodes of either, in order along a stretch of the first.

    `stretch` holds the stations (m) of the first line between which the places lie.
    """
    from scipy.spatial import cKDTree  # takes a tenth of a second, and few roads are of maps

    rows = []
    begin, end = stretch
    tree = cKDTree(first.points)
    ends = np.array([np.searchsorted(first.stations, begin), np.searchsorted(first.stations, end)])
    for nodes, line in ((np.concatenate([first_nodes, first.points[ends]]), second), (second_nodes, first)):
        node_line = first if line is second else second
        _, nearest_place = cKDTree(node_line.points).query(nodes)
        feet, is_beside = line.feet(nodes, node_line.directions[nearest_place])
        middles = 0.5 * (nodes + feet)[is_beside]
        _, nearest = tree.query(middles)
        station = first.stations[nearest] + ((middles - first.points[nearest]) * first.directions[nearest]).sum(axis=1)
        in_stretch = (station >= begin - _STEP) & (station <= end + _STEP)
        rows.append(np.column_stack([station[in_stretch], middles[in_stretch]]))
    places = np.concatenate(rows)
    places = places[np.argsort(places[:, 0], kind="stable")]
    # Places less than 1 m behind the one before, which come from nodes of both lines, are left out.
    gap_mask = np.concatenate([[True], np.diff(places[:, 0]) > 1.0])
    return places[gap_mask, 1:]


def _cross(vectors: Float, other_vectors: Float) -> Float:
    """Return the cross products (N,) of vectors (N, 2): positive where the other vector points to the left."""
    return vectors[:, 0] * other_vectors[:, 1] - vectors[:, 1] * other_vectors[:, 0]


def _longest(flags: Bool) -> tuple[int, int]:
    """Return the first and the last index of the longest run of True among flags (N,)."""
    longest, start = (0, 0), 0
    for value, group in itertools.groupby(flags.tolist()):
        count = len(list(group))
        if value and count - 1 > longest[1] - longest[0]:
            longest = (start, start + count - 1)
        start += count
    return longest


def pairs_of(chains: Sequence[Chain]) -> tuple[list[Pair], dict[int, tuple[int, str]]]:
    """Return the pairs of one road's carriageways, and why other chains that lie beside each other are no pair.

    A chain is in one pair at most, the longest ones first. The reasons are given by the number of a chain in `chains`,
    each with the number of the other chain.
    """
    order = sorted(range(len(chains)), key=lambda n: -chains[n].length)
    south_west = np.array([chains[n].points.min(axis=0) for n in order]).reshape(-1, 2)
    north_east = np.array([chains[n].points.max(axis=0) for n in order]).reshape(-1, 2)
    reach = (
        np.column_stack([1.0 / np.maximum(np.cos(np.radians(south_west[:, 1])), 0.01), np.ones(len(south_west))])
        * _REACH
    )
    pairs, paired_numbers, reasons = list[Pair](), set[int](), dict[int, tuple[int, str]]()
    # Only chains whose boxes (degrees), widened by the reach, overlap can lie beside each other.
    for rank, number in enumerate(order):
        in_reach = (south_west[rank] - reach[rank] <= north_east[rank + 1 :]).all(axis=1) & (
            north_east[rank] + reach[rank] >= south_west[rank + 1 :]
        ).all(axis=1)
        for other_number in (order[rank + 1 + int(n)] for n in np.flatnonzero(in_reach)):
            if number in paired_numbers or other_number in paired_numbers:
                continue
            pair = paired(chains[number], chains[other_number])
            if isinstance(pair, Pair):
                pairs.append(pair)
                paired_numbers |= {number, other_number}
            elif pair:
                reasons.setdefault(number, (other_number, pair))
                reasons.setdefault(other_number, (number, pair))
    return pairs, {n: reason for n, reason in reasons.items() if n not in paired_numbers}
