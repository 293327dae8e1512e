"""Normals of a rough surface: the smooth one's, turned by slopes of what is raised above it, or as images say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.arrays import AnyArray, Float, Index
from ...cloud.points import PointBlock

Heights = Callable[[Index, Float], Float]
"""Heights above the smooth surface, (K,) m, of some rows (K,) at places (K, 3) beside theirs, m."""

STEP = 0.0005
"""Half the distance of the places between which slopes are measured, m: a sixth of the finest relief's wavelength."""


def turn_normals(points: PointBlock, rows: Index, towards: AnyArray, heights: Heights) -> PointBlock:
    """Return the points with normals and incidence angles of the raised surface; all else is kept.

    A height h above the smooth surface, along its normal n, has the normal n - grad h. A normal that would look away
    from the scanner, which sees its point, is at right angles to the beam at most.

    Args:
        points: with `normal`.
        rows: (K,) those that may lie on something raised.
        towards: (N, 3) unit vectors to the scanner.
        heights: of the raised surface.
    """
    assert points.normal is not None
    normal = points.normal[rows].astype(np.float64)
    raised_normal = normal.copy()
    for tangent in _tangents(normal):
        # Central difference along the tangent.
        slope = (heights(rows, STEP * tangent) - heights(rows, -STEP * tangent)) / (2.0 * STEP)
        raised_normal -= slope[:, None] * tangent
    return _with_normals(points, rows, raised_normal, towards)


def tilt_normals(points: PointBlock, rows: Index, tilts: Float, towards: AnyArray) -> PointBlock:
    """Return the points with normals n + tilt, of length 1, in place of n, and their incidence angles; see above.

    Args:
        points: with `normal`.
        rows: (K,) those that tilt.
        tilts: (K, 3) along the surface.
        towards: (N, 3) unit vectors to the scanner.
    """
    assert points.normal is not None
    return _with_normals(points, rows, points.normal[rows].astype(np.float64) + tilts, towards)


def _with_normals(points: PointBlock, rows: Index, normal: Float, towards: AnyArray) -> PointBlock:
    """Return the points with other normals and incidence angles in some rows; all else is kept.

    Args:
        points: N points.
        rows: (K,).
        normal: (K, 3) of any length; where one looks away from the scanner it is turned until it is at a right angle.
        towards: (N, 3) unit vectors to the scanner.
    """
    assert points.normal is not None
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    cosine = np.einsum("ij,ij->i", normal, towards[rows])
    # What a normal has against the direction to the scanner is taken off.
    normal -= np.minimum(cosine, 0.0)[:, None] * towards[rows]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    normals, incidence = points.normal.copy(), points.incidence_deg.copy()
    normals[rows] = normal
    incidence[rows] = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
    return points.with_arrays({"normal": normals, "incidence_deg": incidence})


def _tangents(normal: Float) -> tuple[Float, Float]:
    """Return two unit vectors (N, 3) at right angles to unit normals (N, 3) and to each other."""
    axis = np.where(np.abs(normal[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = np.cross(axis, normal)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    return tangent, np.cross(normal, tangent)
