"""`NearestSurface`: signed distances from points to the nearest of many triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ...base.arrays import Float, Index

_PIECE = 0.5
"""Longest edge, m, of the pieces that triangles are searched by; chosen."""
_MOST_PIECES = 64
"""Largest number of pieces along an edge: longer triangles have longer pieces."""
_NEIGHBOURS = 8
"""Pieces that are looked at first for each point; more where these don't suffice."""
_BLOCK = 4_000
"""Points that are looked at together: each is compared with dozens of pieces, which takes memory."""
_TIE = 1e-9
"""Difference of distances, m, within which two triangles share the nearest point."""


class _Pieces(NamedTuple):
    """Pieces of triangles, no two of which differ in size by more than a factor of 2.

    Attributes:
        tree: of their centroids, each a place on its triangle.
        owner: (P,) triangle of each.
        radius: (P,) m, of a sphere around the centroid that holds the piece.
    """

    tree: cKDTree
    owner: Index
    radius: Float


class NearestSurface:
    """Triangles among which the nearest one to a point is found exactly.

    Leaves of a few centimetres and panels of metres are searched apart: how many pieces have to be looked at goes by
    the largest of them.

    Args:
        corners: (T, 3, 3) corners of the triangles, against the clock seen from outside, m.
    """

    def __init__(self, corners: Float) -> None:
        edges = corners[:, 1:] - corners[:, :1]
        normal = np.cross(edges[:, 0], edges[:, 1])
        area = np.linalg.norm(normal, axis=1)
        kept = area > 0.0
        self.corners, self._normal = corners[kept], normal[kept] / area[kept, None]
        owner, centre, radius = _pieces(self.corners)
        size = np.ceil(np.log2(np.maximum(radius, _TIE)))
        groups = [np.flatnonzero(size == step) for step in np.unique(size)]
        # Most points are nearest to one of the many: the few are then soon seen to be too far.
        groups.sort(key=len, reverse=True)
        self._groups = [_Pieces(cKDTree(centre[rows]), owner[rows], radius[rows]) for rows in groups]

    def distance(self, points: Float, reach: float) -> Float:
        """Return the signed distances (N,), m, of points (N, 3) to the nearest triangle, positive outside.

        Farther than ``reach`` (m) from any they are that.
        """
        result = np.full(len(points), reach)
        for start in range(0, len(points), _BLOCK):
            block = slice(start, start + _BLOCK)
            result[block] = self._block_distance(points[block], reach)
        return result

    def _block_distance(self, points: Float, reach: float) -> Float:
        """Return `distance` (N,) of a block of points."""
        least = np.full(len(points), reach)
        side = np.zeros(len(points))
        for group in self._groups:
            self._search(group, points, least, side)
        return np.where(side < 0.0, -least, least)

    def _search(self, group: _Pieces, points: Float, least: Float, side: Float) -> None:
        """Look for nearer triangles among a group of pieces.

        Args:
            group: the pieces.
            points: (N, 3) m.
            least, side: (N,) distances to the nearest triangle so far, m, and how far outside of its plane the points
                are; renewed in place.
        """
        rows, count, in_all = np.arange(len(points)), 1, group.tree.n
        largest = float(group.radius.max())
        first = 0
        while len(rows):
            count = min(count, in_all)
            bound = float(least[rows].max()) + largest + _TIE
            far, piece = group.tree.query(points[rows], k=np.arange(first + 1, count + 1), distance_upper_bound=bound)
            # A centroid is a place on its triangle: none that is farther in all can be nearer.
            upper = np.minimum(least[rows], far[:, 0])
            radius = np.append(group.radius, 0.0)[piece]
            candidate, column = np.nonzero(far - radius <= upper[:, None] + _TIE)
            self._improve(points, rows[candidate], group.owner[piece[candidate, column]], least, side)
            # All nearer pieces were looked at where the last one's sphere is farther than the best.
            is_open = far[:, -1] - largest <= least[rows] + _TIE
            rows, first, count = rows[is_open], count, max(_NEIGHBOURS, count * 3)
            if first >= in_all:
                break

    def _improve(self, points: Float, rows: Index, owner: Index, least: Float, side: Float) -> None:
        """Renew distances and sides (see `_search`) by K pairs of a point and a triangle, in the order of the points.

        Args:
            points: (N, 3) m.
            rows, owner: (K,) points and triangles.
            least, side: (N,) renewed in place.
        """
        if not len(rows):
            return
        chosen = points[rows]
        arm = chosen - closest_points(self.corners[owner], chosen)
        distance, outside = np.sqrt(_dot(arm, arm)), _dot(arm, self._normal[owner])
        starts = np.flatnonzero(np.diff(rows, prepend=-1))
        point = rows[starts]
        nearest = np.minimum(np.minimum.reduceat(distance, starts), least[point])
        # Of triangles that share the nearest point, that which is seen most directly says on which side it is.
        ends = np.append(starts[1:], len(rows))
        ties = distance <= np.repeat(nearest, ends - starts) + _TIE
        weight = np.where(ties, outside, 0.0)
        highest, lowest = np.maximum.reduceat(weight, starts), np.minimum.reduceat(weight, starts)
        strongest = np.where(highest >= -lowest, highest, lowest)
        is_kept = least[point] <= nearest + _TIE  # the nearest one so far shares the nearest point
        is_stronger = np.abs(strongest) > np.abs(side[point])
        side[point] = np.where(~is_kept | is_stronger, strongest, side[point])
        least[point] = nearest


def closest_points(corners: Float, points: Float) -> Float:
    """Return the point (N, 3) of each triangle (N, 3, 3) that is nearest to a point (N, 3), m.

    Ericson 2005, Real-Time Collision Detection, section 5.1.5, for all triangles at once.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    bp, cp = points - b, points - c
    d3, d4, d5, d6 = _dot(ab, bp), _dot(ac, bp), _dot(ab, cp), _dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = a + ab * (vb / (va + vb + vc))[:, None] + ac * (vc / (va + vb + vc))[:, None]
        on_ab = a + ab * (d1 / (d1 - d3))[:, None]
        on_ac = a + ac * (d2 / (d2 - d6))[:, None]
        share = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        on_bc = b + (c - b) * share[:, None]
    result = inside
    cases = (
        ((va <= 0) & (d4 - d3 >= 0) & (d5 - d6 >= 0), on_bc),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), on_ac),
        ((d6 >= 0) & (d5 <= d6), c),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), on_ab),
        ((d3 >= 0) & (d4 <= d3), b),
        ((d1 <= 0) & (d2 <= 0), a),
    )
    for condition, place in cases:
        result = np.where(condition[:, None], place, result)
    return np.asarray(result)


def _dot(a: Float, b: Float) -> Float:
    """Return the scalar products (N,) of rows of vectors (N, 3)."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _pieces(corners: Float) -> tuple[Index, Float, Float]:
    """Return the triangle (P,) of each piece that triangles (T, 3, 3) are cut into, its centre (P, 3) and radius."""
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    counts = np.clip(np.ceil(longest / _PIECE), 1, _MOST_PIECES).astype(int)
    owners, centres, radii = [], [], []
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        weights = _centroids(count)
        centre = np.einsum("pk,tkx->tpx", weights, corners[rows])
        owners.append(np.repeat(rows, len(weights)))
        centres.append(centre.reshape(-1, 3))
        radii.append(np.repeat(longest[rows] / count * 0.75, len(weights)))
    if not owners:
        return np.empty(0, np.intp), np.empty((0, 3)), np.empty(0)
    return np.concatenate(owners), np.concatenate(centres), np.concatenate(radii)


def _centroids(count: int) -> Float:
    """Return the barycentric coordinates (count^2, 3) of the centroids of a triangle's pieces, alike in shape."""
    result = []
    for i in range(count):
        for j in range(count - i):
            result.append((i + 1 / 3, j + 1 / 3))
            if j < count - i - 1:
                result.append((i + 2 / 3, j + 2 / 3))
    first = np.array(result) / count
    return np.column_stack([1.0 - first.sum(axis=1), first])
