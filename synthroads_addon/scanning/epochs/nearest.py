"""`NearestSurface`: signed distances from points to the nearest of many triangles."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ...base.arrays import Float, Index

_PIECE = 0.5
"""Longest edge, m, of the pieces that triangles are searched by; chosen."""
_MOST_PIECES = 64
"""Largest number of pieces along an edge: longer triangles have longer pieces."""
_NEIGHBOURS = 12
"""Pieces that are looked at first for each point; more where these don't suffice."""
_BLOCK = 20_000


class NearestSurface:
    """Triangles among which the nearest one to a point is found exactly.

    Args:
        corners: (T, 3, 3) corners of the triangles, against the clock seen from outside, m.
    """

    def __init__(self, corners: Float) -> None:
        edges = corners[:, 1:] - corners[:, :1]
        normal = np.cross(edges[:, 0], edges[:, 1])
        area = np.linalg.norm(normal, axis=1)
        kept = area > 0.0
        self.corners, self._normal = corners[kept], normal[kept] / area[kept, None]
        self._owner, pieces, radii = _pieces(self.corners)
        self._radius = float(radii.max(initial=0.0))
        self._tree = cKDTree(pieces) if len(pieces) else None

    def distance(self, points: Float, reach: float) -> Float:
        """Return the signed distances (N,), m, of points (N, 3) to the nearest triangle, positive outside.

        Farther than ``reach`` (m) from any they are that.
        """
        result = np.full(len(points), reach)
        if self._tree is None:
            return result
        for start in range(0, len(points), _BLOCK):
            block = slice(start, start + _BLOCK)
            result[block] = self._block_distance(points[block], reach)
        return result

    def _block_distance(self, points: Float, reach: float) -> Float:
        """Return `distance` (N,) of a block of points."""
        assert self._tree is not None
        result, rows, count = np.full(len(points), reach), np.arange(len(points)), _NEIGHBOURS
        pieces_in_all = self._tree.n
        while len(rows):
            count = min(count, pieces_in_all)
            far, piece = self._tree.query(points[rows], k=count, distance_upper_bound=reach + self._radius)
            far, piece = far.reshape(len(rows), count), piece.reshape(len(rows), count)
            best = self._best(points[rows], piece)
            # All nearer pieces were looked at where the last one's whole sphere is farther than the best.
            done = (far[:, -1] - self._radius >= np.abs(best)) | ~np.isfinite(far[:, -1]) | (count == pieces_in_all)
            result[rows[done]] = np.clip(best[done], -reach, reach)
            rows, count = rows[~done], count * 4
        return result

    def _best(self, points: Float, piece: Index) -> Float:
        """Return the signed distances (N,) of points to the nearest of the triangles of some pieces (N, K)."""
        is_there = piece < len(self._owner)
        owner = self._owner[np.minimum(piece, len(self._owner) - 1)]
        shape = owner.shape
        flat = owner.ravel()
        repeated = np.repeat(points, shape[1], axis=0)
        nearest = closest_points(self.corners[flat], repeated)
        arm = repeated - nearest
        distance = np.linalg.norm(arm, axis=1).reshape(shape)
        distance[~is_there] = np.inf
        side = np.einsum("ij,ij->i", arm, self._normal[flat]).reshape(shape)
        # Of triangles that share the nearest point, that which is seen most directly says on which side it is.
        least = distance.min(axis=1)
        ties = distance <= least[:, None] + 1e-9
        number = np.argmax(np.where(ties, np.abs(side), -1.0), axis=1)
        rows = np.arange(shape[0])
        return np.where(side[rows, number] < 0.0, -least, least)


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
