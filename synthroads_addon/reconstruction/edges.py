"""The pavement's edges and its surface: where it ends on either side, how high it lies, and how it falls."""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks

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

_COMMON = 0.35
"""Share of the most common place's count from which on another place may be the usual one. Chosen: turnouts on a short
road may be longer than what lies between them."""


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
    """Cross profiles and the share of pavement in each of their bins.

    Attributes:
        profiles: cross profiles with S rows along a path and U bins across.
        share: (S, U) share of pavement by bin, from classes or from brightness; NaN without points.
    """

    profiles: Profiles
    share: Grid

    def edge(self, begin: Float, sign: int, farthest: float | Float = FARTHEST, slope: float | Float = 0.0) -> Edge:
        """Return the pavement's edge in each of K stretches, beyond an offset that is surely paved; NaN where unseen.

        Args:
            begin: (K,) offsets that are surely paved, one per stretch, m.
            sign: +1 for the edge to the left, -1 for the one to the right.
            farthest: distance beyond ``begin`` in which the edge is looked for, m; a number, or (K,).
            slope: of the edge against the path, m/m; a number, or (K,).

        The edge lies where the fewest bins are on the wrong side, paved outside or unpaved inside; around it the shares
        of both are weighed, so that the edge is found more exactly than to a bin.
        """
        profiles = self.profiles
        edges, gaps = np.full(len(begin), np.nan), np.zeros(len(begin))
        reach, slopes = (
            np.broadcast_to(np.asarray(values, dtype=np.float64), begin.shape) for values in (farthest, slope)
        )
        for number, offset in enumerate(begin):
            if not np.isfinite(offset) or reach[number] < 2.0 * ACROSS:
                continue
            rows = slice(number * STRETCH, (number + 1) * STRETCH)
            column = profiles.column(offset)
            end = profiles.column(offset + sign * reach[number])
            share = _sheared(self.share[rows], slopes[number])[
                :, column : end + sign if end + sign >= 0 else None : sign
            ]
            edges[number] = _find_edge(_mean(share), float(profiles.offsets[column]), sign)
            if profiles.points is not None and np.isfinite(edges[number]):
                edges[number], gaps[number] = _between_points(
                    profiles.points, number, edges[number], sign, slopes[number], float(profiles.middles[number])
                )
        return Edge(edges, gaps if profiles.points is not None else profiles.row_gaps(edges))


def usual_place(distance: Float) -> float | None:
    """Return the usual distance, m, of an edge by its distances (K,) along the road: the innermost common one.

    Turnouts and lanes that begin make the pavement wider, and on a short road may be longer than what lies between
    them. None if the edge is seen nowhere.
    """
    distances = distance[np.isfinite(distance)]
    if not len(distances):
        return None
    # Bins of 0.1 m that reach beyond both ends; the chosen 0.4 m to both sides of a peak hold an edge's own spread.
    edges = np.arange(distances.min() - 0.25, distances.max() + 0.36, 0.1)
    count = ndimage.uniform_filter1d(np.histogram(distances, edges)[0].astype(np.float64), 3)
    peak = int(find_peaks(np.pad(count, 1), height=_COMMON * count.max())[0][0]) - 1
    peak_distances = distances[np.abs(distances - edges[peak] - 0.05) < 0.4]
    return float(np.median(peak_distances))


def _sheared(rows: Grid, slope: float) -> Grid:
    """Return the rows (R, U) of a stretch, each shifted so that an edge with a slope, m/m, runs straight along them."""
    if slope == 0.0:
        return rows
    along = SPACING * (np.arange(len(rows)) - 0.5 * (len(rows) - 1))
    return np.array(
        [np.roll(row, -round(slope * distance / ACROSS)) for row, distance in zip(rows, along, strict=True)]
    )


def _between_points(
    points: SurfacePoints, stretch: int, edge: float, sign: int, slope: float, middle: float
) -> tuple[float, float]:
    """Return an edge's offset refined to midway between the points beside it, and the distance of these points, m.

    Args:
        points: surface points with their classes.
        stretch: index of the stretch.
        edge: offset of the edge by bins, m.
        sign: +1 if the pavement lies to the right of the edge, -1 if to the left.
        slope: of the edge against the path, m/m.
        middle: station of the stretch's middle, m.
    """
    point_slice = points.near(stretch, edge - _MIXED, edge + _MIXED)
    offset, paved = points.offset[point_slice], points.paved[point_slice]
    if slope != 0.0:
        offset = offset - slope * (points.station[point_slice] - middle)
        order = np.argsort(offset, kind="stable")
        offset, paved = offset[order], paved[order]
    offset, paved = offset[::sign], paved[::sign]
    if len(offset) < _FEWEST_POINTS:
        return edge, 0.0
    # The split after n points, outwards, leaves the fewest on the wrong side where paved less unpaved ones are most.
    gain = np.append(0, np.cumsum(np.where(paved, 1, -1)))
    # Where points of both lie mingled there are several: the first is no edge.
    best_splits = np.flatnonzero(gain == gain.max())
    first_split, last_split = int(best_splits[0]), int(best_splits[-1])
    if first_split == 0 or last_split == len(offset):
        return edge, 0.0
    gaps = [abs(float(offset[split] - offset[split - 1])) for split in (first_split, last_split)]
    border_offsets = [0.5 * float(offset[split - 1] + offset[split]) for split in (first_split, last_split)]
    return 0.5 * (border_offsets[0] + border_offsets[1]), max(*gaps, abs(border_offsets[1] - border_offsets[0]))


def _find_edge(share: Float, begin: float, sign: int) -> float:
    """Return the offset, m, of the edge in a profile (C,) of paved shares that starts at ``begin``; NaN if unseen."""
    has_points = np.isfinite(share)
    if has_points.sum() < 4:
        return float("nan")
    # The sum of (share - 1/2) up to an edge is largest where the fewest bins are on its wrong side.
    gain = np.append(0.0, np.cumsum(np.where(has_points, share - 0.5, 0.0)))
    edge_bin = int(gain.argmax())  # bins before it are paved
    reach = round(_MIXED / ACROSS)
    first_bin, end_bin = max(0, edge_bin - reach), min(len(share), edge_bin + reach)
    share_around = share[first_bin:end_bin]
    has_share = np.isfinite(share_around)
    # An edge that the cloud or the search ends at is no edge.
    if (
        edge_bin >= len(share) - 1
        or edge_bin == 0
        or has_share.mean() < _FEWEST
        or not np.isfinite(share[edge_bin : edge_bin + reach]).any()
    ):
        return float("nan")
    # Around it the paved shares add up to the width that is paved: the edge is found to a part of a bin. Unknown bins
    # count as what their side of the edge is.
    filled_share = np.where(has_share, share_around, (np.arange(first_bin, end_bin) < edge_bin).astype(np.float64))
    return begin + sign * ACROSS * (first_bin - 0.5 + float(filled_share.sum()))


def _mean(values: Grid) -> Float:
    """Return the mean over the rows of values (S, C) that are known, (C,); NaN in columns without any."""
    has_points = np.isfinite(values)
    count = has_points.sum(axis=0)
    total = np.where(has_points, values, 0.0).sum(axis=0)
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


def fit_surface(profiles: Profiles, right_edge: Float, left_edge: Float, pivot: Float) -> Surface:
    """Return the surface between two edges in K stretches, by a robust line (bisquare) through each stretch's bins.

    Args:
        profiles: cross profiles along the road.
        low, high: (K,) offsets of the pavement's right and left edge, m.
        pivot: (K,) offsets at which the height is taken, m.
    """
    result = np.full((2, len(pivot)), np.nan)
    # Along the road heights differ by the grade more than across it by the crossfall: it is taken off first.
    slope = _grade(profiles)
    for number in range(len(pivot)):
        if not (
            np.isfinite(right_edge[number])
            and np.isfinite(left_edge[number])
            and left_edge[number] - right_edge[number] > 1.0
        ):
            continue
        rows = slice(number * STRETCH, (number + 1) * STRETCH)
        columns = slice(profiles.column(right_edge[number] + _CLEAR), profiles.column(left_edge[number] - _CLEAR) + 1)
        height = profiles.height[rows, columns].astype(np.float64)
        station_shift = profiles.stations[rows] - profiles.stations[rows].mean()
        height = height - slope[number] * station_shift[:, None]
        pivot_distance = np.broadcast_to(profiles.offsets[columns] - pivot[number], height.shape)
        has_points = np.isfinite(height)
        if has_points.sum() >= _FEWEST_BINS:
            result[:, number] = _fit_line(pivot_distance[has_points], height[has_points])
    return Surface(*result)


def _grade(profiles: Profiles) -> Float:
    """Return the grade (K,), m/m, of the surface along the path in each stretch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without points
        row_heights = np.nanmedian(profiles.height, axis=1)
    # 31 m: short enough for vertical curves, long enough for the noise of a median over some rows.
    smooth_heights = np.convolve(np.pad(fill_gaps(row_heights), 15, mode="edge"), np.ones(31) / 31, mode="valid")
    grade = np.gradient(smooth_heights, SPACING)
    return grade[np.minimum(np.arange(profiles.stretches) * STRETCH + STRETCH // 2, len(grade) - 1)]


def _fit_line(offsets: Float, height: Float) -> Float:
    """Return height at 0, m, and slope, m/m, (2,), of a robust line (bisquare) through bins (N,)."""
    matrix = np.column_stack([np.ones(len(offsets)), offsets])
    weight, solution = np.ones(len(offsets)), np.zeros(2)
    for _ in range(_ROUNDS):
        inverse = np.linalg.pinv(matrix.T @ (weight[:, None] * matrix))
        solution = inverse @ (matrix.T @ (weight * height))
        residual = height - matrix @ solution
        weight = bisquare(residual, max(robust_scale(residual), 1e-6))
    return solution
