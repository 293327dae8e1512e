"""The pavement's edges and its surface: where it ends on either side, how high it lies, and how it falls."""

import warnings
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Float
from .path import SPACING
from .profiles import ACROSS, STRETCH, Grid, Profiles, SurfacePoints
from .smoothing import bisquare, fill_gaps, robust_scale

FARTHEST = 8.0
"""How far beyond a carriageway's lines its edge is looked for, m. Chosen: a hard shoulder and an emergency bay."""
_MIXED = 0.8
"""Distance to either side of an edge in which pavement and verge are weighed, m. Chosen: grass that grows over it."""
_FEWEST = 0.15
"""Share of the bins around an edge that must have points. Chosen: rows of points leave most bins empty."""
_CLEAR = 0.2
"""Distance inside of the edges from which on the surface is measured, m. Chosen: gutters and grass lie on the rest."""
_ROUNDS = 5
"""Rounds of iteratively reweighted least squares. Chosen: a line across moves no more after them."""
_FEWEST_BINS = 20
"""Bins that height and crossfall of a stretch are told from. Chosen: a tenth of a lane's."""
_FEWEST_POINTS = 6
"""Points around an edge that tell where it is. Chosen: fewer may be stray ones."""


@dataclass(frozen=True)
class Edge:
    """Offsets of an edge of the pavement in each of K stretches, and how exactly points show it.

    Attributes:
        offsets: (K,) m; NaN where it isn't seen.
        spacing: (K,) distance of the points that it lies midway between, m; 0 where it is found by shares.
    """

    offsets: Float
    spacing: Float


@dataclass(frozen=True)
class Pavement:
    """Cross profiles and the pavement in them.

    Attributes:
        profiles: S rows along a path.
        share: (S, U) of pavement, from classes or from brightness; NaN without points.
    """

    profiles: Profiles
    share: Grid

    def edge(self, begin: Float, sign: int, farthest: float | Float = FARTHEST) -> Edge:
        """Return in each of K stretches the offset, m, at which the pavement ends beyond a given one; NaN if unseen.

        Args:
            begin: (K,) offsets that are paved for sure, one per stretch, m.
            sign: +1 looks to the left, -1 to the right.
            farthest: how far beyond ``begin`` it is looked for, m; a number, or (K,).

        The edge parts pavement from what isn't so that the fewest bins are on the wrong side; around it the shares of
        both are weighed, so that it is found more exactly than the bins.
        """
        profiles = self.profiles
        edges, gaps = np.full(len(begin), np.nan), np.zeros(len(begin))
        reach = np.broadcast_to(np.asarray(farthest, dtype=np.float64), begin.shape)
        for number, offset in enumerate(begin):
            if not np.isfinite(offset) or reach[number] < 2.0 * ACROSS:
                continue
            rows = slice(number * STRETCH, (number + 1) * STRETCH)
            column = profiles.column(offset)
            end = profiles.column(offset + sign * reach[number])
            share = _mean(self.share[rows, column : end + sign if end + sign >= 0 else None : sign])
            edges[number] = _find_edge(share, float(profiles.offsets[column]), sign)
            if profiles.points is not None and np.isfinite(edges[number]):
                edges[number], gaps[number] = _between_points(profiles.points, number, edges[number], sign)
        return Edge(edges, gaps if profiles.points is not None else profiles.row_gaps(edges))


def _between_points(points: SurfacePoints, stretch: int, edge: float, sign: int) -> tuple[float, float]:
    """Return an edge's offset, m, refined to midway between the points beside it, and the distance of these, m."""
    near = points.near(stretch, edge - _MIXED, edge + _MIXED)
    offset, paved = points.offset[near][::sign], points.paved[near][::sign]
    if len(offset) < _FEWEST_POINTS:
        return edge, 0.0
    gain = np.append(0, np.cumsum(np.where(paved, 1, -1)))
    best = np.flatnonzero(
        gain == gain.max()
    )  # where points of both lie mingled there are several: the first is no edge
    first, last = int(best[0]), int(best[-1])
    if first == 0 or last == len(offset):
        return edge, 0.0
    gaps = [abs(float(offset[at] - offset[at - 1])) for at in (first, last)]
    places = [0.5 * float(offset[at - 1] + offset[at]) for at in (first, last)]
    return 0.5 * (places[0] + places[1]), max(*gaps, abs(places[1] - places[0]))


def _find_edge(share: Float, begin: float, sign: int) -> float:
    """Return the offset, m, of the edge in a profile (C,) of paved shares that starts at ``begin``; NaN if unseen."""
    known = np.isfinite(share)
    if known.sum() < 4:
        return float("nan")
    # The sum of (share - 1/2) up to an edge is largest where the fewest bins are on its wrong side.
    gain = np.append(0.0, np.cumsum(np.where(known, share - 0.5, 0.0)))
    at = int(gain.argmax())  # bins before it are paved
    reach = round(_MIXED / ACROSS)
    low, high = max(0, at - reach), min(len(share), at + reach)
    near = share[low:high]
    seen = np.isfinite(near)
    # An edge that the cloud or the search ends at is no edge.
    if at >= len(share) - 1 or at == 0 or seen.mean() < _FEWEST or not np.isfinite(share[at : at + reach]).any():
        return float("nan")
    # Around it the paved shares add up to the width that is paved: the edge is found to a part of a bin. Unknown bins
    # count as what their side of the edge is.
    filled = np.where(seen, near, (np.arange(low, high) < at).astype(np.float64))
    return begin + sign * ACROSS * (low - 0.5 + float(filled.sum()))


def _mean(values: Grid) -> Float:
    known = np.isfinite(values)
    count = known.sum(axis=0)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@dataclass(frozen=True)
class Surface:
    """Height and crossfall of a carriageway's surface in each of K stretches.

    Attributes:
        height: (K,) at the pivot line, m; NaN where too little was seen.
        fall: (K,) crossfall, m/m, positive where it falls to the right.
    """

    height: Float
    fall: Float


def fit_surface(profiles: Profiles, low: Float, high: Float, pivot: Float) -> Surface:
    """Return height and crossfall between two edges (K,), by a robust line (bisquare) across each stretch.

    Args:
        profiles: of the road.
        low, high: (K,) offsets of the pavement's right and left edge, m.
        pivot: (K,) offsets at which the height is wanted, m.
    """
    result = np.full((2, len(pivot)), np.nan)
    # Along the road heights differ by the grade more than across it by the crossfall: it is taken off first.
    slope = _grade(profiles)
    for number in range(len(pivot)):
        if not (np.isfinite(low[number]) and np.isfinite(high[number]) and high[number] - low[number] > 1.0):
            continue
        rows = slice(number * STRETCH, (number + 1) * STRETCH)
        columns = slice(profiles.column(low[number] + _CLEAR), profiles.column(high[number] - _CLEAR) + 1)
        height = profiles.height[rows, columns].astype(np.float64)
        along = profiles.stations[rows] - profiles.stations[rows].mean()
        height = height - slope[number] * along[:, None]
        across = np.broadcast_to(profiles.offsets[columns] - pivot[number], height.shape)
        known = np.isfinite(height)
        if known.sum() >= _FEWEST_BINS:
            result[:, number] = _fit_line(across[known], height[known])
    return Surface(*result)


def _grade(profiles: Profiles) -> Float:
    """Return the grade (K,), m/m, of the surface along the path in each stretch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without points
        middle = np.nanmedian(profiles.height, axis=1)
    # 31 m: short enough for vertical curves, long enough for the noise of a median over some rows.
    smoothed = np.convolve(np.pad(fill_gaps(middle), 15, mode="edge"), np.ones(31) / 31, mode="valid")
    grade = np.gradient(smoothed, SPACING)
    return grade[np.minimum(np.arange(profiles.stretches) * STRETCH + STRETCH // 2, len(grade) - 1)]


def _fit_line(across: Float, height: Float) -> Float:
    """Return height at 0, m, and slope, m/m, (2,), of a robust line (bisquare) through bins (N,)."""
    matrix = np.column_stack([np.ones(len(across)), across])
    weight, solution = np.ones(len(across)), np.zeros(2)
    for _ in range(_ROUNDS):
        inverse = np.linalg.pinv(matrix.T @ (weight[:, None] * matrix))
        solution = inverse @ (matrix.T @ (weight * height))
        residual = height - matrix @ solution
        weight = bisquare(residual, max(robust_scale(residual), 1e-6))
    return solution
