"""Where a scene is: what a scan of a scene that nobody prepared goes by."""

import numpy as np

from ...base.arrays import Float
from ...cloud.strays import Strays
from .mesh import SceneMesh

_BLOCK = 1 << 17
_SHORTEST = 1.0  # m
WIDE = 20_000.0
"""Extent, m, beyond which a scene may be one of usual size with a vertex astray."""


def bounds(mesh: SceneMesh) -> Float:
    """Return the smallest and the largest local coordinates (2, 3) of the triangles, m; there must be one."""
    is_used = np.zeros(len(mesh.vertices), dtype=bool)
    is_used[mesh.triangles.ravel()] = True
    vertices = mesh.vertices[is_used]
    return np.array([vertices.min(axis=0), vertices.max(axis=0)], dtype=np.float64)


def body_bounds(mesh: SceneMesh) -> Float:
    """Return the bounds (2, 3), m, of the triangles, without stray vertices if the scene is wider than `WIDE`."""
    strays = strays_of(mesh)
    if strays is None:
        return bounds(mesh)
    vertices = mesh.vertices[np.unique(mesh.triangles)]
    body_mask = strays.belongs(vertices)
    return np.array([vertices[body_mask].min(axis=0), vertices[body_mask].max(axis=0)], dtype=np.float64)


def strays_of(mesh: SceneMesh) -> Strays | None:
    """Return the stray vertices of a scene wider than `WIDE`, far from all others; None if there are none.

    In a smaller scene the far corners of a large face are as good as any others.
    """
    if float(np.ptp(bounds(mesh), axis=0).max()) <= WIDE:
        return None
    vertices, strays = mesh.vertices[np.unique(mesh.triangles)], Strays()
    for start in range(0, len(vertices), _BLOCK):
        strays.add(vertices[start : start + _BLOCK])
    return strays if strays.count() else None


def middle_line(mesh: SceneMesh) -> Float:
    """Return both ends (2, 3) of the line over the middle of the scene along the longer of x and y, local, m.

    It spans the scene's extent without stray vertices, `_SHORTEST` at least, at the scene's `median_elevation`.
    """
    lowest_corner, highest_corner = body_bounds(mesh)
    ends = np.repeat(((lowest_corner + highest_corner) / 2.0)[None], 2, axis=0)
    axis = int(np.argmax((highest_corner - lowest_corner)[:2]))
    half_length = max(highest_corner[axis] - lowest_corner[axis], _SHORTEST) / 2.0
    ends[:, axis] += [-half_length, half_length]
    ends[:, 2] = median_elevation(mesh)
    return ends


def median_elevation(mesh: SceneMesh) -> float:
    """Return the elevation (local, m) below which half of the scene's area in plan lies.

    Where the scene has no area in plan, as one of walls alone, it is the lowest elevation.
    """
    area, height = np.empty(len(mesh)), np.empty(len(mesh))
    for start in range(0, len(mesh), _BLOCK):
        block = slice(start, start + _BLOCK)
        corners = mesh.vertices[mesh.triangles[block]].astype(np.float64)
        area[block] = np.abs(_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        height[block] = corners[:, :, 2].mean(axis=1)
    if not area.any():
        return float(bounds(mesh)[0, 2])
    order = np.argsort(height, kind="stable")
    area_below = np.cumsum(area[order])
    return float(height[order][np.searchsorted(area_below, area_below[-1] / 2.0)])


def elevation_at(mesh: SceneMesh, x: float, y: float) -> float | None:
    """Return the local elevation, m, of the highest surface at a plan position (local, m); None if there is none."""
    highest = -np.inf
    for start in range(0, len(mesh), _BLOCK):
        corners = mesh.vertices[mesh.triangles[start : start + _BLOCK]].astype(np.float64)
        a, b, c = (corners[:, i, :2] - [x, y] for i in range(3))
        # Barycentric coordinates: twice the areas that the place makes with the sides, by twice the triangle's area.
        # They are all of one sign where the place lies inside.
        side_areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])
        area = side_areas.sum(axis=0)
        is_inside = ((side_areas >= 0.0).all(axis=0) | (side_areas <= 0.0).all(axis=0)) & (area != 0.0)
        if is_inside.any():
            shares = side_areas[:, is_inside] / area[is_inside]
            elevations = (shares * corners[is_inside, :, 2].T).sum(axis=0)
            highest = max(highest, float(elevations.max()))
    return highest if np.isfinite(highest) else None


def _cross(a: Float, b: Float) -> Float:
    """Return the third component (N,) of the cross products of plane vectors (N, 2 or more)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
