"""The two carriageways of a road on a map, and the axis midway between them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Bool, Float
from .way_chains import Chain, on_plane

_NEAREST, _FARTHEST = 4.0, 60.0
"""Distance of the two carriageways' lines, m."""
_OPPOSITE = np.cos(np.radians(150.0))
"""Cosine up to which two directions are opposite."""
_REACH = 0.001
"""Degrees of latitude, more than `_FARTHEST` anywhere."""
_STEP = 5.0
"""Distance of the places at which they are compared, m."""
_MOST = 100_000
_SAFE = 0.8
"""Share of the shorter carriageway beside which the other one must run."""
_AROUND = 200.0
"""Nodes this far from the stretch still bend it, m."""


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
        """Return a line (N, 2), m, bent between its nodes as they turn at least on either side."""
        length = np.hypot(*np.diff(nodes, axis=0).T)
        nodes = nodes[np.concatenate([[True], length > 0.0])]
        chord = np.diff(nodes, axis=0)
        length = np.hypot(*chord.T)
        unit = chord / length[:, None]
        start = np.concatenate([[0.0], np.cumsum(length)])
        count = int(min(max(2, np.ceil(start[-1] / _STEP) + 1), _MOST))
        station = np.unique(np.concatenate([np.linspace(0.0, start[-1], count), start]))
        at = np.clip(np.searchsorted(start, station, "right") - 1, 0, len(length) - 1)
        along = station - start[at]
        bend = _bend_between(unit, length)[at]
        normal = np.column_stack([-unit[:, 1], unit[:, 0]])[at]
        out = -0.5 * bend * along * (length[at] - along)
        points = nodes[at] + along[:, None] * unit[at] + out[:, None] * normal
        slope = -0.5 * bend * (length[at] - 2.0 * along)
        direction = unit[at] + slope[:, None] * normal
        return cls(points, direction / np.hypot(*direction.T)[:, None], station)

    def feet(self, points: Float, directions: Float) -> tuple[Float, Bool]:
        """Return where points (K, 2) with directions have their feet (K, 2), and whether the line runs against them."""
        from scipy.spatial import cKDTree  # takes a tenth of a second, and few roads are of maps

        _, near = cKDTree(self.points).query(points)
        here, way = self.points[near], self.directions[near]
        along = ((points - here) * way).sum(axis=1)
        feet = here + along[:, None] * way
        away = np.hypot(*(points - feet).T)
        opposite = (way * directions).sum(axis=1) < _OPPOSITE
        return feet, opposite & (np.abs(along) <= _STEP) & (away >= _NEAREST) & (away <= _FARTHEST)


def _bend_between(unit: Float, length: Float) -> Float:
    """Return the curvature (K,), 1/m, between nodes: the lesser of those at both, 0 where they bend apart."""
    turn = np.arctan2(*(unit[:-1, 0] * unit[1:, 1] - unit[:-1, 1] * unit[1:, 0], (unit[:-1] * unit[1:]).sum(axis=1)))
    at_nodes = 2.0 * np.sin(turn) / np.maximum(length[:-1] + length[1:], 1e-9)
    before, after = np.concatenate([[0.0], at_nodes]), np.concatenate([at_nodes, [0.0]])
    less = np.where(np.abs(before) < np.abs(after), before, after)
    return np.where(before * after > 0.0, less, 0.0)


def paired(one: Chain, other: Chain) -> Pair | str:
    """Return two carriageways of a road as a pair, or why they are none; an empty text where they lie apart."""
    origin = one.points.mean(axis=0)
    here, there = on_plane(one.points, origin), on_plane(other.points, origin)
    first, second = _Dense.of(here), _Dense.of(there)
    feet, beside = second.feet(first.points, first.directions)
    if not beside.any():
        return ""
    left = _cross(first.directions, feet - first.points) > 0.0
    keeps_right = bool(left[beside].mean() >= 0.5)
    begin, end = _longest(beside & (left == keeps_right))
    run = float(first.stations[end] - first.stations[begin])
    shorter = min(first.stations[-1], second.stations[-1])
    if run < _SAFE * shorter:
        return f"the two run beside each other over {run:.0f} m, {100.0 * _SAFE:.0f} % of {shorter:.0f} m are needed"
    low, high = float(first.stations[begin]), float(first.stations[end])
    points = _midway(first, second, here, there, (low, high))
    width = np.hypot(*(feet - first.points)[begin : end + 1].T)
    lowest, highest = np.percentile(width, [5.0, 95.0]).tolist()
    scale = on_plane(origin[None] + 1.0, origin)[0]
    degrees = origin + points / scale
    return Pair(one, other, degrees, low, high, float(np.median(width)), (lowest, highest), keeps_right)


def _midway(first: _Dense, second: _Dense, here: Float, there: Float, stretch: tuple[float, float]) -> Float:
    """Return places (N, 2), m, midway between nodes of either line and the other one, along the first's stretch."""
    from scipy.spatial import cKDTree  # takes a tenth of a second, and few roads are of maps

    rows = []
    low, high = stretch
    tree = cKDTree(first.points)
    ends = np.array([np.searchsorted(first.stations, low), np.searchsorted(first.stations, high)])
    for nodes, line in ((np.concatenate([here, first.points[ends]]), second), (there, first)):
        node_line = first if line is second else second
        _, at = cKDTree(node_line.points).query(nodes)
        feet, beside = line.feet(nodes, node_line.directions[at])
        middle = 0.5 * (nodes + feet)[beside]
        _, near = tree.query(middle)
        station = first.stations[near] + ((middle - first.points[near]) * first.directions[near]).sum(axis=1)
        keep = (station >= low - _STEP) & (station <= high + _STEP)
        rows.append(np.column_stack([station[keep], middle[keep]]))
    places = np.concatenate(rows)
    places = places[np.argsort(places[:, 0], kind="stable")]
    gap_mask = np.concatenate([[True], np.diff(places[:, 0]) > 1.0])
    return places[gap_mask, 1:]


def _cross(first: Float, second: Float) -> Float:
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


def _longest(flags: Bool) -> tuple[int, int]:
    """Return the first and last index of the longest run of flags that are set."""
    best, at = (0, 0), 0
    for value, group in itertools.groupby(flags.tolist()):
        count = len(list(group))
        if value and count - 1 > best[1] - best[0]:
            best = (at, at + count - 1)
        at += count
    return best


def pairs_of(chains: Sequence[Chain]) -> tuple[list[Pair], dict[int, tuple[int, str]]]:
    """Return the pairs of one road's carriageways, each in one pair at most, and what others lie beside in vain.

    The latter by the number of a chain: the number of the other one, and why the two are no pair.
    """
    order = sorted(range(len(chains)), key=lambda n: -chains[n].length)
    low = np.array([chains[n].points.min(axis=0) for n in order]).reshape(-1, 2)
    high = np.array([chains[n].points.max(axis=0) for n in order]).reshape(-1, 2)
    reach = np.column_stack([1.0 / np.maximum(np.cos(np.radians(low[:, 1])), 0.01), np.ones(len(low))]) * _REACH
    pairs, taken, why = list[Pair](), set[int](), dict[int, tuple[int, str]]()
    for row, first in enumerate(order):
        near = (low[row] - reach[row] <= high[row + 1 :]).all(axis=1) & (high[row] + reach[row] >= low[row + 1 :]).all(
            axis=1
        )
        for second in (order[row + 1 + int(n)] for n in np.flatnonzero(near)):
            if first in taken or second in taken:
                continue
            pair = paired(chains[first], chains[second])
            if isinstance(pair, Pair):
                pairs.append(pair)
                taken |= {first, second}
            elif pair:
                why.setdefault(first, (second, pair))
                why.setdefault(second, (first, pair))
    return pairs, {n: reason for n, reason in why.items() if n not in taken}
