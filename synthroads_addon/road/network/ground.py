"""The ground between several roads as triangles: their edges are edges of triangles, so that nothing gapes.

Beside every road the ground falls or rises from its edge with the terrain's batter until it meets the ground of the
main road: the ground's height is limited from below by the cones that fall from all edges, and from above by those
that rise from them. On an edge it is the edge's own height as long as no other edge stands steeper above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from ...base.arrays import Bool, Float, Int

_MERGED = 1e-6
"""Points closer in plan than this (m) are one."""
EDGE_CLEARANCE = 0.6
"""Share of the spacing of points around that a free point keeps from edges."""
_SPLITS = 14
"""Rounds in which edges that aren't edges of triangles are divided; beyond, edges are millimetres long."""
_BLOCK = 4_000_000
"""Numbers computed at a time."""
_TILE = 12.0
"""Size (m) of the squares of the ground that are computed at a time."""


@dataclass(frozen=True)
class Limit:
    """An outline from which the ground begins: points (N, 3) in order, local, m; closed if wanted."""

    points: Float
    closed: bool = True

    @cached_property
    def segments(self) -> Float:
        """The segments (S, 2, 3) between its points, without those of no length."""
        ends = np.roll(self.points, -1, axis=0) if self.closed else self.points[1:]
        pairs = np.stack([self.points if self.closed else self.points[:-1], ends], axis=1)
        return pairs[np.linalg.norm(pairs[:, 1, :2] - pairs[:, 0, :2], axis=1) > _MERGED]


def inside(polygon: Float, points: Float) -> Bool:
    """Return whether points (N, 2) lie in a polygon (K, 2 or 3), by the number of its edges to their right."""
    result = np.zeros(len(points), dtype=bool)
    low, high = polygon[:, :2].min(axis=0), polygon[:, :2].max(axis=0)
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    if not len(near):
        return result
    a, b = polygon[:, :2], np.roll(polygon[:, :2], -1, axis=0)
    step = max(1, _BLOCK // len(polygon))
    for begin in range(0, len(near), step):
        rows = near[begin : begin + step]
        x, y = points[rows, 0, None], points[rows, 1, None]
        crosses = (a[:, 1] > y) != (b[:, 1] > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            place = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
        result[rows] = np.count_nonzero(crosses & (x < place), axis=1) % 2 == 1
    return result


def cone_limits(points: Float, edges: Float, slope: float, reach: float) -> tuple[Float, Float]:
    """Return the least and the largest height (N,) that edges leave the ground at points (N, 2), m.

    Args:
        points: (N, 2) local, m.
        edges: (E, 3) points of the roads' edges, local, m.
        slope: run of a batter per metre of height.
        reach: distance (m) from an edge up to which it matters.
    """
    low, high = np.full(len(points), -np.inf), np.full(len(points), np.inf)
    if not len(edges):
        return low, high
    tiles = np.floor(points / _TILE).astype(np.int64)
    keys, members = np.unique(tiles, axis=0, return_inverse=True)
    order = np.argsort(members.ravel(), kind="stable")
    starts = np.searchsorted(members.ravel()[order], np.arange(len(keys) + 1))
    for tile, begin, end in zip(keys, starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        corner = tile * _TILE
        near = edges[((edges[:, :2] > corner - reach) & (edges[:, :2] < corner + _TILE + reach)).all(axis=1)]
        if not len(near):
            continue
        rows = order[begin:end]
        run = np.linalg.norm(points[rows, None] - near[None, :, :2], axis=2)
        height = np.where(run <= reach, run / slope, np.inf)
        low[rows], high[rows] = (near[:, 2] - height).max(axis=1), (near[:, 2] + height).min(axis=1)
    return low, high


@dataclass(frozen=True)
class Triangles:
    """A surface of triangles.

    Attributes:
        points: (N, 3) local, m.
        corners: (T, 3) anticlockwise from above.
    """

    points: Float
    corners: Int

    @cached_property
    def _bins(self) -> tuple[Float, float, Int, Int, Int, tuple[int, int]]:
        """Triangles by square cells of the plan."""
        xy = self.points[self.corners][..., :2]
        low, high = xy.min(axis=1), xy.max(axis=1)
        origin = low.min(axis=0) - 1e-6
        cell = 2.0
        first, last = ((low - origin) / cell).astype(np.int64), ((high - origin) / cell).astype(np.int64)
        shape = tuple((last.max(axis=0) + 1).tolist())
        spans = last - first + 1
        counts = spans.prod(axis=1)
        index = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        cells = first[index, 0] + number // spans[index, 1], first[index, 1] + number % spans[index, 1]
        key = cells[0] * shape[1] + cells[1]
        order = np.argsort(key, kind="stable")
        starts = np.searchsorted(key[order], np.arange(shape[0] * shape[1] + 1))
        return origin, cell, index[order], starts, counts, shape

    def height(self, points: Float) -> Float:
        """Return the heights (N,) at places (N, 2), m; NaN where there is no triangle."""
        result = np.full(len(points), np.nan)
        origin, cell, index, starts, _, shape = self._bins
        place = np.floor((points - origin) / cell).astype(np.int64)
        rows = np.flatnonzero(((place >= 0) & (place < shape)).all(axis=1))
        key = place[rows, 0] * shape[1] + place[rows, 1]
        counts = starts[key + 1] - starts[key]
        of_point = np.repeat(rows, counts)
        number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        triangle = index[np.repeat(starts[key], counts) + number]
        a, b, c = (self.points[self.corners[triangle, k]] for k in range(3))
        p = points[of_point]
        area = _cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = _cross(p - a[:, :2], c - a) / area, _cross(b - a, p - a[:, :2]) / area
        hits = (area > 0.0) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9)
        height = a[:, 2] + u * (b[:, 2] - a[:, 2]) + v * (c[:, 2] - a[:, 2])
        result[of_point[hits]] = height[hits]
        return result


def _cross(first: Float, second: Float) -> Float:
    """Return the cross products (N,) of vectors (N, 2 or 3) in plan."""
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


def triangulated(limits: list[Limit], free: Float) -> tuple[Float, Int, Int]:
    """Return points (N, 3), triangles (T, 3) among them, and which points (L,) are of limits: Delaunay's.

    Heights are those of the limits; those of free points are NaN. Segments of limits that aren't edges of triangles are
    divided until they are.

    Args:
        limits: outlines.
        free: (F, 2) further points, local, m, not too near the limits.
    """
    segments = np.concatenate([limit.segments for limit in limits])
    points, corners = _merged(segments)
    corners = _without_doubles(corners)
    origin = points[:, :2].mean(axis=0)
    triangles = np.zeros((0, 3), dtype=np.int64)
    for _ in range(_SPLITS):
        every = np.concatenate([points[:, :2], free]) - origin
        triangles = Delaunay(every, qhull_options="Qbb Qc Qz Q12").simplices
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        known = np.unique(edges[:, 0] * np.int64(len(every)) + edges[:, 1])
        ordered = np.sort(corners, axis=1)
        missing = ~np.isin(ordered[:, 0] * np.int64(len(every)) + ordered[:, 1], known)
        if not missing.any():
            break
        middle = points[corners[missing]].mean(axis=1)
        number = len(points) + np.arange(len(middle))
        ends = corners[missing]
        points = np.concatenate([points, middle])
        halves = np.concatenate([np.column_stack([ends[:, 0], number]), np.column_stack([number, ends[:, 1]])])
        corners = np.concatenate([corners[~missing], halves])
    points = np.concatenate([points, np.column_stack([free, np.full(len(free), np.nan)])])
    a, b, c = (points[triangles[:, k]] for k in range(3))
    turned = _cross(b - a, c - a) < 0.0
    triangles[turned] = triangles[turned][:, ::-1]
    return points, triangles.astype(np.int64), np.unique(corners)


def _merged(segments: Float) -> tuple[Float, Int]:
    """Return the distinct points (P, 3) of segments (S, 2, 3), and the segments as pairs of them."""
    every = segments.reshape(-1, 3)
    tree = cKDTree(every[:, :2])
    first = np.arange(len(every))
    for a, b in tree.query_pairs(1e-4):
        root = min(first[a], first[b])
        first[a] = first[b] = root
    while not np.array_equal(first, first[first]):
        first = first[first]
    kept, inverse = np.unique(first, return_inverse=True)
    return every[kept], inverse.reshape(-1, 2)


def _without_doubles(corners: Int) -> Int:
    """Return pairs (S, 2) of different points, each pair once."""
    ordered = np.sort(corners, axis=1)
    return np.unique(ordered[ordered[:, 0] != ordered[:, 1]], axis=0)
