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
    corners_of_rings = [np.asarray(ring, dtype=np.int64) for ring in rings]
    sizes = np.array([len(ring) for ring in corners_of_rings], dtype=np.int64)
    return Faces(points, np.concatenate(corners_of_rings), sizes)


def drop_unused_points(faces: Faces) -> Faces:
    """Return the same polygons with points that no polygon uses removed and the corner indices renumbered."""
    used_points, corners = np.unique(faces.corners, return_inverse=True)
    return Faces(faces.points[used_points], corners, faces.sizes)


def quad_faces(points: Float, corners: Int) -> Faces:
    """Return quadrilaterals (Q, 4 indices) as polygons, those that aren't flat split into two triangles each."""
    is_flat = quad_twist(points, corners) <= FLAT
    # Six slots per quadrilateral: the ring of one and two slots left out, or two rings of three.
    slots = np.where(is_flat[:, None], corners[:, [0, 1, 2, 3, 0, 0]], corners[:, [0, 1, 2, 0, 2, 3]])
    keep_mask = np.ones(slots.shape, dtype=bool)
    keep_mask[is_flat, 4:] = False
    counts = np.where(is_flat, 1, 2)
    return Faces(points, slots[keep_mask], np.repeat(np.where(is_flat, 4, 3), counts))


def quad_twist(points: Float, corners: Int) -> Float:
    """Return how far each quadrilateral is from planar: the distance (Q,) of its two diagonals, m.

    A quadrilateral without area (a strip that is nowhere wide there) has none.
    """
    a, b, c, d = (points[corners[:, i]] for i in range(4))
    # Distance of two skew lines, the diagonals: volume of the parallelepiped over the area of its base.
    normal = np.cross(c - a, d - b)
    area = np.linalg.norm(normal, axis=1)
    volume = np.abs(np.einsum("ij,ij->i", normal, b - a))
    return np.where(area > 1e-9, volume / np.maximum(area, 1e-9), 0.0)


def grid_corners(rows: int, columns: int) -> Int:
    """Return the (Q, 4) corners of a grid's quadrilaterals, row by row.

    Points are numbered row by row; rows follow each other forwards, columns from left to right, so that the
    quadrilaterals are anticlockwise from above.
    """
    # Index of each cell's corner in the rear row and the left column.
    rear_left = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return np.stack([rear_left + 1, rear_left + columns + 1, rear_left + columns, rear_left], axis=1)


def split_quads(corners: Int) -> Int:
    """Return quadrilaterals (Q, 4 indices) split into triangles (2 Q, 3): all first halves, then all second ones."""
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def upward_triangles(points: Float, corners: Int) -> Faces:
    """Return only those triangles (T, 3 indices) that are anticlockwise and not degenerate seen from above."""
    xy = points[corners][..., :2]
    first_edge, second_edge = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
    upward_corners = corners[first_edge[:, 0] * second_edge[:, 1] - first_edge[:, 1] * second_edge[:, 0] > _NO_AREA]
    return drop_unused_points(Faces(points, upward_corners.ravel(), np.full(len(upward_corners), 3)))


def loft(sections: Float) -> Faces:
    """Return the closed body through cross-sections (R, K, 3) with its end caps; faces look outwards.

    Args:
        sections: R >= 2 outlines of K corners each, in the same order round.
    """
    sections_count, count = sections.shape[:2]
    points = sections.reshape(-1, 3)
    corner = np.arange(count)
    next_corner_index = np.roll(corner, -1)
    row_start = (np.arange(sections_count - 1) * count)[:, None]
    sides = np.stack(
        [
            row_start + corner,
            row_start + next_corner_index,
            row_start + count + next_corner_index,
            row_start + count + corner,
        ],
        axis=-1,
    )
    last_row_start = (sections_count - 1) * count
    caps = Faces(points, np.concatenate([corner[::-1], last_row_start + corner]), np.array([count, count]))
    if max(_off_plane(sections[0]), _off_plane(sections[-1])) > FLAT / 2.0:
        triangles = triangulate(caps)
        caps = Faces(points, triangles.ravel(), np.full(len(triangles), 3))
    body = quad_faces(points, sides.reshape(-1, 4))
    closed = Faces(points, np.concatenate([body.corners, caps.corners]), np.concatenate([body.sizes, caps.sizes]))
    return closed if enclosed_volume(closed) >= 0.0 else flip_faces(closed)


def _off_plane(polygon: Float) -> float:
    """Return the largest distance of a polygon's corners (K, 3) from its mean plane, m."""
    arms = polygon - polygon.mean(axis=0)
    normal = np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)
    return float(np.abs(arms @ normal).max() / max(float(np.linalg.norm(normal)), 1e-12))


def flip_faces(faces: Faces) -> Faces:
    """Return polygons with their orientation reversed, so that their normals point the other way."""
    return Faces(faces.points, faces.corners[::-1], faces.sizes[::-1])


def triangulate(faces: Faces) -> Int:
    """Triangulate polygons by zigzag strips between their first and last corners; return corner indices (T, 3).

    The strip's rungs join corner i with the i-th corner from the end. So an outline that isn't convex is filled rightly
    too, if each of its rungs lies within it: such are the thin profiles of posts, rails and barriers.
    """
    triangles = []
    starts = np.cumsum(faces.sizes) - faces.sizes
    for size in np.unique(faces.sizes).tolist():
        rings = faces.corners[starts[faces.sizes == size][:, None] + np.arange(size)]
        pattern, low_corner, high_corner = [], 0, size - 1
        while high_corner - low_corner > 1:
            pattern.append((low_corner, low_corner + 1, high_corner))
            if high_corner - low_corner > 2:
                pattern.append((low_corner + 1, high_corner - 1, high_corner))
            low_corner, high_corner = low_corner + 1, high_corner - 1
        triangles.append(rings[:, pattern].reshape(-1, 3))
    return np.concatenate(triangles) if triangles else np.empty((0, 3), np.int64)


def enclosed_volume(faces: Faces) -> float:
    """Return the signed volume that closed polygons enclose, m3; negative where they look inwards.

    By the divergence theorem: the sum of the signed tetrahedra from one point to the triangles of each polygon's fan.
    """
    if not len(faces):
        return 0.0
    points = faces.points - faces.points[faces.corners[0]]
    starts = np.cumsum(faces.sizes) - faces.sizes
    fan_centre = np.repeat(faces.corners[starts], faces.sizes)
    a, b, c = points[fan_centre], points[faces.corners], points[faces.corners[next_corner(faces.sizes)]]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def next_corner(sizes: Int) -> Int:
    """Return for each corner the index (C,) of the corner that follows it round its polygon."""
    next_index = np.arange(1, int(sizes.sum()) + 1)
    starts = np.cumsum(sizes) - sizes
    next_index[starts + sizes - 1] = starts
    return next_index


def polygon_areas(points: Float, corners: Int, sizes: Int) -> Float:
    """Return the areas (F,) of polygons, in the square of the unit of their points (N, 3)."""
    if not len(sizes):
        return np.empty(0)
    starts = np.cumsum(sizes) - sizes
    fan_centre = points[np.repeat(corners[starts], sizes)]
    arms = points[corners] - fan_centre, points[corners[next_corner(sizes)]] - fan_centre
    return np.asarray(np.linalg.norm(np.add.reduceat(np.cross(*arms), starts), axis=1) / 2.0)


def drop_polygons(corners: Int, sizes: Int, keep_mask: NDArray[np.bool_]) -> tuple[Int, Int]:
    """Return corners and sizes of only those polygons that a mask (F,) keeps."""
    return corners[np.repeat(keep_mask, sizes)], sizes[keep_mask]


def drop_collapsed(corners: Int, sizes: Int) -> tuple[Int, Int, NDArray[np.bool_]]:
    """Merge equal neighbouring corners and drop polygons left with fewer than 3; return corners, sizes, kept (F,)."""
    differs = corners != corners[next_corner(sizes)]
    polygon_of_corner = np.repeat(np.arange(len(sizes)), sizes)
    corner_counts = np.bincount(polygon_of_corner[differs], minlength=len(sizes))
    keep_mask = corner_counts >= 3
    return corners[differs & keep_mask[polygon_of_corner]], corner_counts[keep_mask], keep_mask
