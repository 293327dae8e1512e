"""Recognition of single sweeps: clouds whose points lie in rings about the turning head that measured them.

A head of L lasers measures L elevations, so that the elevations of a sweep's points, seen from the head, lie in L
narrow clusters with gaps between. Those of points from a moving scanner, or from anywhere else, don't.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from synthroads_addon.base.arrays import Float

MOST_POINTS = 1_000_000
"""Points above which a cloud isn't one sweep. Chosen: the largest heads measure 128 lasers x 2,048 directions x 2
returns, which is half of that."""
MOST_RINGS = 256
"""Rings above which a cloud is a tripod scanner's raster instead of a head's sweep. Chosen: twice the largest number of
lasers in a head for cars."""
RINGED = 0.55
"""Share of the elevations' range in the widest tenth of the gaps, from which the elevations are rings. Chosen between
that of sweeps, 0.9 seen from the head and 0.6 from 3 m beside it, and that of elevations at random, 0.33: the widest
tenth of exponentially distributed gaps holds int_{ln 10}^{inf} t exp(-t) dt = 0.1 (1 + ln 10) of their sum."""

_SECTORS = 24
"""Directions in which the elevations are compared. Chosen: every 15 degrees."""
_SECTOR_WIDTH = np.radians(4.0)
"""Width of such a direction, rad. Chosen: over this width a ring on a slope, or seen from beside, stays narrow."""
_FEWEST_POINTS = 200
"""Points in a sector from which it is judged. Chosen: two windows."""
_FEWEST_SECTORS = _SECTORS // 2
"""Sectors that must be judged. Chosen: half a turn, as roads' strips fill only the two along the road."""
_WINDOW = 100
"""Elevations in order in which the gaps are compared. Chosen: over so few, the density of elevations changes little."""
_NEAREST = 1.5
"""Horizontal distance to the origin below which elevations aren't compared, m. Chosen: the vehicle's own roof."""
_HEAD_HEIGHT = 1.8
"""Height of a head above the ground at which the search for the origin begins, m. Chosen: on a car's roof."""
_BANDWIDTHS = (30.0, 20.0, 10.0, 5.0, 5.0, 5.0, 5.0)
"""Standard deviations of the kernel of the mean shift towards the densest place, m, from coarse to fine. Chosen."""
_GROUND_RADIUS, _GROUND_PERCENT = 15.0, 10.0
"""Radius about the densest place, m, and percentile of the heights in it, which is the ground's. Chosen: within it most
points lie on the road, and a few below it are errors."""
_STEPS = (2.0, 1.0, 0.5, 0.25)
"""Steps of the search for the origin, m. Chosen: from the error of the densest place to a tenth of a ring's spacing."""


@dataclass(frozen=True)
class Sweep:
    """The rings of a sweep.

    Attributes:
        origin: (3,) place of the head, in the points' coordinates, m.
        rings: number of elevations that were measured, about.
        ringed: share of the range of elevations in the widest tenth of the gaps, see `RINGED`.
    """

    origin: Float
    rings: int
    ringed: float


def find_sweep(points: Float) -> Sweep | None:
    """Return the rings of a cloud's points (N, 3) in m if it is a single sweep of a turning head; else None.

    The head is looked for at the coordinates' origin, where data sets of sweeps have it, then near the densest place.
    """
    if not _FEWEST_SECTORS * _FEWEST_POINTS <= len(points) <= MOST_POINTS:
        return None
    at_zero = ringed_share(points, np.zeros(3))
    origin, ringed = (np.zeros(3), at_zero) if at_zero >= RINGED else _search_origin(points)
    if ringed < RINGED:
        return None
    rings = _count_rings(points, origin)
    return Sweep(origin, rings, ringed) if rings <= MOST_RINGS else None


def _search_origin(points: Float) -> tuple[Float, float]:
    """Return the place (3,) from which the points look most like rings, and `ringed_share` there."""
    origin = _densest_place(points)
    best = ringed_share(points, origin)
    for step in _STEPS:
        improved = True
        while improved:
            improved = False
            for axis in range(3):
                for sign in (-1.0, 1.0):
                    shifted = origin.copy()
                    shifted[axis] += sign * step
                    share = ringed_share(points, shifted)
                    if share > best:
                        origin, best, improved = shifted, share, True
    return origin, best


def _densest_place(points: Float) -> Float:
    """Return the place (3,), m, that a head would have above the densest part of points (N, 3) in plan.

    The ground's points are densest about a head, as their density falls with the square of the distance from it.
    """
    # Points are counted in cells of 1 m in plan, so that the mean shift's cost is that of the cells.
    cells, counts = np.unique(np.floor(points[:, :2]).astype(np.int64), axis=0, return_counts=True)
    centres = cells + 0.5
    place = centres[np.argmax(counts)]
    for bandwidth in _BANDWIDTHS:
        # Mean shift with a Gaussian kernel (Comaniciu and Meer 2002, eq. 17).
        weights = counts * np.exp(-0.5 * np.sum((centres - place) ** 2, axis=1) / bandwidth**2)
        place = weights @ centres / weights.sum()
    is_near = np.hypot(*(points[:, :2] - place).T) < _GROUND_RADIUS
    ground = np.percentile(points[is_near, 2], _GROUND_PERCENT) if is_near.any() else points[:, 2].min()
    return np.array([*place, ground + _HEAD_HEIGHT])


def ringed_share(points: Float, origin: Float) -> float:
    """Return the median over the sectors of the mean share of the widest tenth of the gaps; 0 if too few are judged."""
    shares = []
    for elevations in _sectors(points, origin):
        gaps = np.diff(elevations)
        gaps = np.sort(gaps[: len(gaps) // _WINDOW * _WINDOW].reshape(-1, _WINDOW), axis=1)
        ranges = gaps.sum(axis=1)
        widest = gaps[:, -_WINDOW // 10 :].sum(axis=1)
        shares.append(float(np.mean(widest[ranges > 0.0] / ranges[ranges > 0.0])) if ranges.any() else 0.0)
    return float(np.median(shares)) if len(shares) >= _FEWEST_SECTORS else 0.0


def _count_rings(points: Float, origin: Float) -> int:
    """Return the median over the sectors of the number of clusters of elevations.

    A gap between rings is over ten times the median gap, which is one within a ring.
    """
    counts = []
    for elevations in _sectors(points, origin):
        gaps = np.diff(elevations)
        counts.append(1 + int(np.count_nonzero(gaps > 10.0 * np.median(gaps))))
    return int(np.median(counts))


def _sectors(points: Float, origin: Float) -> list[Float]:
    """Return the sorted elevations (rad) of the points in each full enough sector, without the outer fiftieths."""
    offsets = points - origin
    distance = np.hypot(offsets[:, 0], offsets[:, 1])
    position = np.arctan2(offsets[:, 1], offsets[:, 0]) / (2.0 * np.pi) * _SECTORS
    sector = np.rint(position).astype(np.int64)
    half_width = 0.5 * _SECTOR_WIDTH / (2.0 * np.pi) * _SECTORS
    inside = (np.abs(position - sector) < half_width) & (distance > _NEAREST)
    elevation = np.arctan2(offsets[inside, 2], distance[inside])
    sector = sector[inside] % _SECTORS
    order = np.lexsort((elevation, sector))
    elevation, bounds = elevation[order], np.searchsorted(sector[order], np.arange(_SECTORS + 1))
    parts = [elevation[begin:end] for begin, end in pairwise(bounds)]
    return [part[len(part) // 50 : len(part) - len(part) // 50] for part in parts if len(part) >= _FEWEST_POINTS]
