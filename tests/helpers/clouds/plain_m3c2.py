"""M3C2 at single places by its definition, without a library (Lague et al. 2013, ISPRS Journal 82)."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

Float = Any
NORMAL_RADIUS, RADIUS, DEPTH, FEWEST = 0.5, 0.25, 0.5, 5
"""Radius in which normals are fitted, radius and half length of the cylinder, m; points that it has at least."""


def m3c2_at(core: Float, first: Float, second: Float) -> tuple[Float, Float]:
    """Return the distances (K,) of two clouds (N, 3) and their levels of detection at 95 %, m, at places (K, 3).

    NaN where either cloud has too few points. The levels are those of noise alone, without a registration error.
    """
    trees = [cKDTree(cloud) for cloud in (first, second)]
    around = trees[1].query_ball_point(core, NORMAL_RADIUS)
    reach = float(np.hypot(RADIUS, DEPTH))
    near = [tree.query_ball_point(core, reach) for tree in trees]
    distance, level = np.full(len(core), np.nan), np.full(len(core), np.nan)
    for row, place in enumerate(core):
        if len(around[row]) < FEWEST:
            continue
        arm = second[around[row]] - second[around[row]].mean(axis=0)
        normal = np.linalg.eigh(arm.T @ arm)[1][:, 0]
        normal = normal if normal[2] >= 0.0 else -normal
        heights = [
            _in_cylinder(cloud[rows[row]] - place, normal) for cloud, rows in zip((first, second), near, strict=True)
        ]
        if min(map(len, heights)) < FEWEST:
            continue
        distance[row] = heights[1].mean() - heights[0].mean()
        level[row] = 1.96 * np.sqrt(sum(values.var(ddof=1) / len(values) for values in heights))
    return distance, level


def _in_cylinder(arm: Float, normal: Float) -> Float:
    """Return the heights (K,), m, along the axis of those points, by their arms (N, 3), that lie in the cylinder."""
    height = arm @ normal
    inside = ((arm**2).sum(axis=1) - height**2 <= RADIUS**2) & (np.abs(height) <= DEPTH)
    return height[inside]
