"""How far apart the points of patches lie: the density-aware Chamfer distance.

Of two sets of points S and T it is the mean, over x in S, of

    1 - exp(-a d(x, y)) / n(y),   y being the nearest of T, d(x, y) its distance, n(y) how many have y as theirs,

and the same the other way round (Wu et al. 2021, Density-aware Chamfer distance as a comprehensive metric for point
cloud completion, NeurIPS). It is 0 for equal sets and at most 1, whatever single points do, and unlike the Chamfer
distance it sees where one point of the other set has to stand for many. 1 / a is the inverse root of the density.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..base.arrays import Float
from ..cloud.selection.patches import Patches

MOST_PAIRS = 400
"""Pairs of patches between which a chamfer distance is worked out at most. Chosen: its mean is then known to a
twentieth of one's deviation."""


def density_aware_chamfer(points: Float, other_points: Float, scale: float) -> float:
    """Return the density-aware Chamfer distance of two sets of points (N, 3), (M, 3), 0 to 1.

    Args:
        one, other: the points, m.
        scale: 1 / a, m.

    Example:
        >>> import numpy as np
        >>> plane = np.random.default_rng(1).uniform(0.0, 1.0, (200, 3)) * [1.0, 1.0, 0.0]
        >>> raised = plane + [0.0, 0.0, 0.05]
        >>> [round(float(density_aware_chamfer(plane, other, scale=0.05)), 2) for other in (plane, raised)]
        [0.0, 0.63]
    """
    return 0.5 * (_one_way(points, other_points, scale) + _one_way(other_points, points, scale))


def _one_way(points: Float, other_points: Float, scale: float) -> float:
    """Return the mean term of one set's points against their nearest ones of the other set, 0 to 1."""
    distance, nearest_index = cKDTree(other_points).query(points)
    # Wu et al. 2021: mean of 1 - exp(-a d) / n over the points, n of which share their nearest one.
    count = np.bincount(nearest_index, minlength=len(other_points))[nearest_index]
    return float(np.mean(1.0 - np.exp(-distance / scale) / count))


def mean_chamfer(patches: Patches, other_patches: Patches) -> float:
    """Return the mean density-aware Chamfer distance of pairs of patches of equal density (`patches.match_density`)."""
    pairs = list(zip(patches.points, other_patches.points, patches.density, strict=True))[:MOST_PAIRS]
    return float(np.mean([density_aware_chamfer(a, b, density**-0.5) for a, b, density in pairs]))
