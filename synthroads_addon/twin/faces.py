"""Polygons in space as arrays: the surfaces and bodies of a semantic model before they are written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]

FLAT = 0.001
"""A quadrilateral whose corner lies farther than this (m) from the plane of the others becomes two triangles."""

_NO_AREA = 1e-6  # twice the area in plan that a triangle of the ground has at least, m2


@dataclass(frozen=True)
class Faces:
    """Planar polygons without holes as arrays, each anticlockwise as seen from its outer (upper) side.

    Attributes:
        points: (N, 3) local coordinates, m.
        corners: (C,) indices into the points, polygon by polygon.
        sizes: (F,) number of corners of each polygon.
    """

    points: Float
    corners: Int
    sizes: Int

    def __len__(self) -> int:
        """Return the number of polygons, F."""
        return len(self.sizes)


def join_faces(parts: Sequence[Faces]) -> Faces:
    """Return all polygons of several parts as one `Faces`, the points concatenated and not merged."""
    if not parts:
        return Faces(np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.int64))
    starts = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    return Faces(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.corners + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.sizes for part in parts]),
    )


def ring_faces(points: Float, rings: Iterable[Sequence[int]]) -> Faces:
    """Return the polygons whose corners are given as rings of indices into points (N, 3)."""
    listed = [np.asarray(ring, dtype=np.int64) for ring in rings]
    sizes = np.array([len(ring) for ring in listed], dtype=np.int64)
    return Faces(points, np.concatenate(listed), sizes)


def drop_unused_points(faces: Faces) -> Faces:
    """Return the same polygons with points that no polygon uses removed and the corner indices renumbered."""
    used, corners = np.unique(faces.corners, return_inverse=True)
    return Faces(faces.points[used], corners, faces.sizes)


def quad_faces(points: Float, corners: Int) -> Faces:
    """Return quadrilaterals (Q, 4 indices) as polygons, those that aren't flat split into two triangles each."""
    flat = quad_twist(points, corners) <= FLAT
    # Six slots per quadrilateral: the ring of one and two slots left out, or two rings of three.
    slots = np.where(flat[:, None], corners[:, [0, 1, 2, 3, 0, 0]], corners[:, [0, 1, 2, 0, 2, 3]])
    keep = np.ones(slots.shape, dtype=bool)
    keep[flat, 4:] = False
    counts = np.where(flat, 1, 2)
    return Faces(points, slots[keep], np.repeat(np.where(flat, 4, 3), counts))


def quad_twist(points: Float, corners: Int) -> Float:
    """Return how far each quadrilateral is from planar: the distance (Q,) of its two diagonals, m.

    A quadrilateral without area (a strip that is nowhere wide there) has none.
    """
    a, b, c, d = (points[corners[:, i]] for i in range(4))
    # The distance of the diagonals: a volume through the area of their parallelogram.
    across = np.cross(c - a, d - b)
    area = np.linalg.norm(across, axis=1)
    volume = np.abs(np.einsum("ij,ij->i", across, b - a))
    return np.where(area > 1e-9, volume / np.maximum(area, 1e-9), 0.0)


def grid_corners(rows: int, columns: int) -> Int:
    """Return the (Q, 4) corners of a grid's quadrilaterals, row by row.

    Points are numbered row by row; rows follow each other forwards, columns from left to right, so that the
    quadrilaterals are anticlockwise from above.
    """
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return np.stack([first + 1, first + columns + 1, first + columns, first], axis=1)


def split_quads(corners: Int) -> Int:
    """Return quadrilaterals (Q, 4 indices) split into triangles (2 Q, 3): all first halves, then all second ones."""
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def upward_triangles(points: Float, corners: Int) -> Faces:
    """Return only those triangles (T, 3 indices) that are anticlockwise and not degenerate seen from above."""
    flat = points[corners][..., :2]
    one, two = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    kept = corners[one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0] > _NO_AREA]
    return drop_unused_points(Faces(points, kept.ravel(), np.full(len(kept), 3)))


def loft(sections: Float) -> Faces:
    """Return the closed body through cross-sections (R, K, 3) with its end caps; faces look outwards.

    Args:
        sections: R >= 2 outlines of K corners each, in the same order round.
    """
    rows, count = sections.shape[:2]
    points = sections.reshape(-1, 3)
    here = np.arange(count)
    after = np.roll(here, -1)
    start = (np.arange(rows - 1) * count)[:, None]
    sides = np.stack([start + here, start + after, start + count + after, start + count + here], axis=-1)
    last = (rows - 1) * count
    caps = Faces(points, np.concatenate([here[::-1], last + here]), np.array([count, count]))
    if max(_off_plane(sections[0]), _off_plane(sections[-1])) > FLAT / 2.0:
        triangles = triangulate(caps)
        caps = Faces(points, triangles.ravel(), np.full(len(triangles), 3))
    body = quad_faces(points, sides.reshape(-1, 4))
    closed = Faces(points, np.concatenate([body.corners, caps.corners]), np.concatenate([body.sizes, caps.sizes]))
    return closed if enclosed_volume(closed) >= 0.0 else flip_faces(closed)


def _off_plane(ring: Float) -> float:
    """Return the largest distance of a polygon's corners (K, 3) from its mean plane, m."""
    arms = ring - ring.mean(axis=0)
    normal = np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)
    return float(np.abs(arms @ normal).max() / max(float(np.linalg.norm(normal)), 1e-12))


def flip_faces(faces: Faces) -> Faces:
    """Return polygons with their orientation reversed, so that their normals point the other way."""
    return Faces(faces.points, faces.corners[::-1], faces.sizes[::-1])


def triangulate(faces: Faces) -> Int:
    """Triangulate polygons as strips between their first and last corners; return corner indices (T, 3).

    So a polygon needs not be convex if its corner i faces the last one but i.
    """
    triangles = []
    starts = np.cumsum(faces.sizes) - faces.sizes
    for size in np.unique(faces.sizes).tolist():
        rings = faces.corners[starts[faces.sizes == size][:, None] + np.arange(size)]
        order, low, high = [], 0, size - 1
        while high - low > 1:
            order.append((low, low + 1, high))
            if high - low > 2:
                order.append((low + 1, high - 1, high))
            low, high = low + 1, high - 1
        triangles.append(rings[:, order].reshape(-1, 3))
    return np.concatenate(triangles) if triangles else np.empty((0, 3), np.int64)


def enclosed_volume(faces: Faces) -> float:
    """Return the signed volume that closed polygons enclose, m3; negative where they look inwards."""
    if not len(faces):
        return 0.0
    points = faces.points - faces.points[faces.corners[0]]
    starts = np.cumsum(faces.sizes) - faces.sizes
    first = np.repeat(faces.corners[starts], faces.sizes)
    a, b, c = points[first], points[faces.corners], points[faces.corners[next_corner(faces.sizes)]]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def next_corner(sizes: Int) -> Int:
    """Return for each corner the index (C,) of the corner that follows it round its polygon."""
    following = np.arange(1, int(sizes.sum()) + 1)
    starts = np.cumsum(sizes) - sizes
    following[starts + sizes - 1] = starts
    return following


def polygon_areas(points: Float, corners: Int, sizes: Int) -> Float:
    """Return the areas (F,) of polygons, in the square of the unit of their points (N, 3)."""
    if not len(sizes):
        return np.empty(0)
    starts = np.cumsum(sizes) - sizes
    first = points[np.repeat(corners[starts], sizes)]
    arms = points[corners] - first, points[corners[next_corner(sizes)]] - first
    return np.asarray(np.linalg.norm(np.add.reduceat(np.cross(*arms), starts), axis=1) / 2.0)


def drop_polygons(corners: Int, sizes: Int, kept: NDArray[np.bool_]) -> tuple[Int, Int]:
    """Return corners and sizes of only those polygons that a mask (F,) keeps."""
    return corners[np.repeat(kept, sizes)], sizes[kept]


def drop_collapsed(corners: Int, sizes: Int) -> tuple[Int, Int, NDArray[np.bool_]]:
    """Merge equal neighbouring corners and drop polygons left with fewer than 3; return corners, sizes, kept (F,)."""
    distinct = corners != corners[next_corner(sizes)]
    polygon = np.repeat(np.arange(len(sizes)), sizes)
    left = np.bincount(polygon[distinct], minlength=len(sizes))
    kept = left >= 3
    return corners[distinct & kept[polygon]], left[kept], kept
