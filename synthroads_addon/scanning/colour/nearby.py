"""Points that no image shows take a place of the same material close by that one shows: leaves behind leaves."""

from __future__ import annotations

import numpy as np

from ...base.arrays import Bool, Float, Float32, UInt16
from .colour import MaterialLayers, SeenPoints
from .views import RenderedImage

REACH = 0.3
"""How far away a place may lie that stands for a point, m."""
_STEPS = 2
"""Pixels are looked at on a square of twice as many steps and one, which is within `REACH` if they are fine enough."""
_ROWS, _COLUMNS = (steps.ravel() for steps in np.mgrid[-_STEPS : _STEPS + 1, -_STEPS : _STEPS + 1])
_LIT = 0.05
"""Share of the sun's full light from which on a place counts as lit."""


def sample_nearby(image: RenderedImage, position: Float, material: UInt16, limit: Float) -> tuple[Float32, Bool, Float]:
    """Return what an image shows close to points: its layers (n, C), of which points (N,), and how far away (n,), m.

    Of the pixels around a point's projection those count that show its material, and of these the one that shows the
    nearest place in space. What hides the point is thus never taken, unless it is of the same material and as close.

    Args:
        image: with depths and materials.
        position: (N, 3) points in front of the camera.
        material: (N,) theirs.
        limit: (N,) how far away a place may lie, m; `REACH` at most.
    """
    view = image.view
    x, y, depth = view.project(position)
    step = np.maximum(np.floor(REACH / _STEPS * view.focal / depth), 1.0)
    i = (np.floor(x)[:, None] + step[:, None] * _COLUMNS).astype(np.intp)
    j = (np.floor(y)[:, None] + step[:, None] * _ROWS).astype(np.intp)
    width, height = view.size
    good = (i >= 0) & (i < width) & (j >= 0) & (j < height)
    i, j = np.where(good, i, 0), np.where(good, j, 0)
    good &= image.material[j, i] == material[:, None] + 1
    away = np.linalg.norm(view.place(i, j, image.depth[j, i]) - position[:, None, :], axis=2)
    away[~good] = np.inf
    best = np.arange(len(position)), away.argmin(axis=1)
    near = away[best] < limit
    return image.layers[j[best], i[best]][near].astype(np.float32), near, away[best][near]


def light_nearby(fallback: MaterialLayers, points: SeenPoints, taken: Float32, channels: dict[str, slice]) -> Float32:
    """Return channels (N, C) taken at places close by, with the sun's light as the points' own slope has it.

    Leaves, blades and sheets that touch lean every way. Whether the sun reaches a place is therefore all that is kept
    of its light; without a base colour there is nothing to shine on, and the light stays as it is.
    """
    if "sun" not in channels or "base_color" not in channels:
        return taken
    result = taken.copy()
    varies = fallback.constants.varies["base_color"][points.material][:, None]
    mean = fallback.constants.values["base_color"][points.material]
    color = np.where(varies, taken[:, channels["base_color"]], mean)
    sun = fallback.shading.light.sun.astype(np.float32)
    lit = taken[:, channels["sun"]].sum(axis=1) > _LIT * (color * sun).sum(axis=1)
    result[:, channels["sun"]] = color * fallback.shading.light.sunlight(points.normal) * lit[:, None]
    return result
