"""Outlines of patches and cracks in stations and offsets."""

from collections.abc import Iterator

import numpy as np

from ...base.arrays import Float
from ..section import Crack, Patch

_SHARPEST = 0.5
"""Cosine of half the turn beyond which a line's corner is not mitred any further."""


def patch_outline(patch: Patch) -> Float:
    """Return the convex outline (K, 2) of a patch, counter-clockwise from above."""
    corners = np.array(patch.outline)
    return corners if _area(corners) > 0.0 else corners[::-1]


def crack_outlines(crack: Crack) -> Iterator[Float]:
    """Yield the quadrilaterals (4, 2) along a crack's lines, counter-clockwise from above, one per leg.

    Neighbours of a line share an edge, which halves the corner; sharp corners are cut.
    """
    for line in crack.lines:
        corners = np.array(line)
        corners = corners[np.append(True, np.any(np.diff(corners, axis=0) != 0.0, axis=1))]
        if len(corners) < 2:
            continue
        legs = np.diff(corners, axis=0)
        legs /= np.linalg.norm(legs, axis=1)[:, None]
        left = np.column_stack([-legs[:, 1], legs[:, 0]])
        before, behind = np.vstack([left[:1], left]), np.vstack([left, left[-1:]])
        middle = before + behind
        middle /= np.maximum(np.linalg.norm(middle, axis=1), 1e-9)[:, None]
        reach = crack.width / 2.0 / np.maximum(np.einsum("ij,ij->i", middle, behind), _SHARPEST)
        one, other = corners + middle * reach[:, None], corners - middle * reach[:, None]
        for number in range(len(legs)):
            yield np.array([other[number], other[number + 1], one[number + 1], one[number]])


def _area(corners: Float) -> float:
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2.0
