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
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.triangles.ravel()] = True
    vertices = mesh.vertices[used]
    return np.array([vertices.min(axis=0), vertices.max(axis=0)], dtype=np.float64)


def body_bounds(mesh: SceneMesh) -> Float:
    """Return the bounds (2, 3), m, of the triangles, without stray vertices if the scene is wider than `WIDE`."""
    strays = strays_of(mesh)
    if strays is None:
        return bounds(mesh)
    vertices = mesh.vertices[np.unique(mesh.triangles)]
    stay = strays.stay(vertices)
    return np.array([vertices[stay].min(axis=0), vertices[stay].max(axis=0)], dtype=np.float64)


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

    It spans the scene's extent, without what strays from it, but a metre at least, at the scene's `median_elevation`.
    """
    low, high = body_bounds(mesh)
    ends = np.repeat(((low + high) / 2.0)[None], 2, axis=0)
    axis = int(np.argmax((high - low)[:2]))
    reach = max(high[axis] - low[axis], _SHORTEST) / 2.0
    ends[:, axis] += [-reach, reach]
    ends[:, 2] = median_elevation(mesh)
    return ends


def median_elevation(mesh: SceneMesh) -> float:
    """Return the elevation (local, m) below which half of the scene's area lies, as it shows in plan.

    A scene without any area in plan, one of walls alone, has its lowest elevation here.
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
    below = np.cumsum(area[order])
    return float(height[order][np.searchsorted(below, below[-1] / 2.0)])


def elevation_at(mesh: SceneMesh, x: float, y: float) -> float | None:
    """Return the local elevation, m, of the highest surface at a plan position (local, m); None if there is none."""
    highest = -np.inf
    for start in range(0, len(mesh), _BLOCK):
        corners = mesh.vertices[mesh.triangles[start : start + _BLOCK]].astype(np.float64)
        a, b, c = (corners[:, i, :2] - [x, y] for i in range(3))
        # Twice the areas that the place makes with the sides: all of one sign where it lies inside.
        areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])
        whole = areas.sum(axis=0)
        inside = ((areas >= 0.0).all(axis=0) | (areas <= 0.0).all(axis=0)) & (whole != 0.0)
        if inside.any():
            shares = areas[:, inside] / whole[inside]
            highest = max(highest, float((shares * corners[inside, :, 2].T).sum(axis=0).max()))
    return highest if np.isfinite(highest) else None


def _cross(a: Float, b: Float) -> Float:
    """Return the cross products (N,) of plane vectors (N, 2 or more)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
