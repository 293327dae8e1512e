"""How far predicted centrelines are from true ones: distances, Chamfer distance of polynomials, coverage, spread.

Predicted and true centres are given per slice as points in the plane, NaN where there is none. A slice counts where
both are known; what share of the true ones was predicted stands beside every figure.

The Chamfer distance compares third-degree polynomials, which describe short sections. Long roads are therefore cut into
windows along the path: pieces end where more than `GAP` of the truth is missing; each piece is divided into equal
windows of about `WINDOW`; pieces shorter than `SHORTEST` are left out. In each window

1. both sets of centres are moved, rotated and scaled into one frame: the true centres' mean, principal axis and extent;
2. a polynomial of third degree, across as a function of along, is fitted to each set by least squares;
3. each is sampled at the whole metres of that axis, the same for both, within the extent of its own centres ("full") or
   of both ("common");
4. the distance is the mean from each sample of the one to the nearest sample of the other, plus the same the other way.

A road's figure is the mean over windows, weighted by their lengths. Windows of 60 m are as long as the tiles that
clouds are cut into, and a cubic meets a road's own axis in them: to 2 cm on a winding rural road, to 0.2 cm on a
motorway.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import ndtri

from .calibration import LEVELS
from .tables import Spread

Float = NDArray[np.float64]
Index = NDArray[np.intp]

WINDOW = 60.0
GAP = 5.0
SHORTEST = 20.0
"""m."""
DEGREE = 3
_FEWEST = 2 * (DEGREE + 1)
"""Predicted centres that a window's polynomial needs."""
_PAST_END = 1.0
"""Points farther than this, m, past a line's end are beside none of it."""


@dataclass(frozen=True)
class Chamfer:
    """Chamfer distances of one road, m; NaN where no window could be compared.

    Attributes:
        full: over the extent of each line's own centres.
        common: over the extent that both have.
        compared: share of the windows' length in which both lines could be fitted, 0 to 1.
        windows: number of windows, those not compared included.
    """

    full: float
    common: float
    compared: float
    windows: int


def figures(
    predicted: Float, true: Float, station: Float, std: Float | None = None, intervals: Float | None = None
) -> dict[str, float]:
    """Return all figures of one road by name, in metres unless said.

    Args:
        predicted: (M, 2) predicted centres, NaN where there is none.
        true: (M, 2) true centres, one on each slice's orthogonal, NaN in the truth's gaps.
        station: (M,) of the slices along their path, m, growing.
        std: (M,) predicted standard deviation, m; None if there is none.
        intervals: (M, 2) half-widths of the intervals of `LEVELS`, m; None: a Gaussian's of the standard deviation.

    Returns:
        ``slices`` with a known truth, ``found`` (share of them with a prediction), ``mae`` (mean distance in the
        plane), ``distance_95`` (its 95 % quantile), ``lateral`` (mean distance from the true line), ``bias`` (mean
        offset from it, positive to the left), ``chamfer_full``, ``chamfer_common``, ``chamfer_compared`` (share),
        ``chamfer_windows`` and, with ``std``, ``coverage_68``, ``coverage_95`` (shares) and ``std``, its mean.
    """
    known = np.isfinite(true).all(axis=1)
    both = known & np.isfinite(predicted).all(axis=1)
    distance = np.hypot(*(predicted - true)[both].T)
    offset = lateral_errors(predicted[both], true, station)
    offset = offset[np.isfinite(offset)]
    apart = chamfer(predicted, true, station)
    result = {
        "slices": float(known.sum()),
        "found": float(both.sum() / known.sum()) if known.any() else np.nan,
        "mae": _mean(distance),
        "distance_95": float(np.quantile(distance, 0.95)) if len(distance) else np.nan,
        "lateral": _mean(np.abs(offset)),
        "bias": _mean(offset),
        "chamfer_full": apart.full,
        "chamfer_common": apart.common,
        "chamfer_compared": apart.compared,
        "chamfer_windows": float(apart.windows),
    }
    if std is not None:
        for place, level in enumerate(LEVELS):
            inside = coverage(distance, std[both], level)
            if intervals is not None:
                inside = _mean((distance <= intervals[both, place]).astype(np.float64))
            result[f"coverage_{level:.0%}".rstrip("%")] = inside
        result["std"] = _mean(std[both][np.isfinite(std[both])])
    return result


def lateral_errors(points: Float, true: Float, station: Float) -> Float:
    """Return the offsets (N,) of points (N, 2) from the true line, m, positive to its left; NaN beside its gaps.

    The line runs through the true centres (M, 2) in the order of their stations (M,) and is broken at gaps.
    """
    known = np.flatnonzero(np.isfinite(true).all(axis=1))
    joined = np.diff(station[known]) <= GAP
    begin, end = true[known[:-1][joined]], true[known[1:][joined]]
    length = np.hypot(*(end - begin).T)
    begin, end, length = begin[length > 1e-9], end[length > 1e-9], length[length > 1e-9]
    result = np.full(len(points), np.nan)
    if not len(begin) or not len(points):
        return result
    # The nearest of the 16 segments with the nearest middles: exact where segments are of about equal length.
    _, near = cKDTree((begin + end) / 2.0).query(points, k=min(16, len(begin)))
    near = near.reshape(len(points), -1)
    direction = ((end - begin) / length[:, None])[near]
    apart = points[:, None, :] - begin[near]
    along = (apart * direction).sum(axis=2)
    beyond = along - np.clip(along, 0.0, length[near])
    across = direction[..., 0] * apart[..., 1] - direction[..., 1] * apart[..., 0]
    best = np.hypot(beyond, across).argmin(axis=1)
    row = np.arange(len(points))
    beyond, across = beyond[row, best], across[row, best]
    return np.where(np.abs(beyond) > _PAST_END, np.nan, across)


def coverage(error: Float, std: Float, level: float) -> float:
    """Return the share of errors (N,) within the Gaussian interval of a level (0 to 1) about the prediction.

    Errors and standard deviations (N,) are in m; those that aren't finite are left out.
    """
    known = np.isfinite(error) & np.isfinite(std)
    return _mean((np.abs(error[known]) <= ndtri(0.5 + level / 2.0) * std[known]).astype(np.float64))


def chamfer(predicted: Float, true: Float, station: Float, window: float = WINDOW) -> Chamfer:
    """Return the Chamfer distances between polynomials of predicted and true centres (M, 2), window by window.

    Args:
        predicted: (M, 2) m, NaN where there is none.
        true: (M, 2) m, NaN in the truth's gaps.
        station: (M,) of the slices along their path, m, growing.
        window: length of a window, m.
    """
    known = np.isfinite(true).all(axis=1)
    parts = windows(station, known, window)
    rows, weights, whole = [], [], 0.0
    for part in parts:
        length = float(station[part[-1]] - station[part[0]])
        whole += length
        kept = predicted[part][np.isfinite(predicted[part]).all(axis=1)]
        distances = _window_chamfer(kept, true[part])
        if distances is not None:
            rows.append(distances)
            weights.append(length)
    if not rows:
        return Chamfer(np.nan, np.nan, 0.0, len(parts))
    full, common = np.average(np.array(rows), axis=0, weights=weights)
    return Chamfer(float(full), float(common), sum(weights) / whole, len(parts))


def windows(station: Float, known: NDArray[np.bool_], window: float = WINDOW) -> list[Index]:
    """Return the indices of the slices of each window; see the module's text.

    Args:
        station: (M,) m, growing.
        known: (M,) whether the truth is.
        window: length, m.
    """
    inside = np.flatnonzero(known)
    pieces = np.split(inside, np.flatnonzero(np.diff(station[inside]) > GAP) + 1) if len(inside) else []
    result: list[Index] = []
    for piece in pieces:
        along = station[piece] - station[piece[0]]
        if along[-1] < SHORTEST:
            continue
        count = max(1, round(along[-1] / window))
        number = np.minimum((along * (count / along[-1])).astype(np.intp), count - 1)
        result.extend(piece[number == index] for index in range(count))
    return result


def _window_chamfer(predicted: Float, true: Float) -> tuple[float, float] | None:
    """Return the distances over full and common extent of one window; None if too little was predicted."""
    if len(predicted) < _FEWEST or len(true) < _FEWEST:
        return None
    origin = true.mean(axis=0)
    axes = np.linalg.svd(true - origin, full_matrices=False)[2]
    local = [(points - origin) @ axes.T for points in (predicted, true)]
    scale = float(np.abs(local[1][:, 0]).max())
    extents = [(points[:, 0].min(), points[:, 0].max()) for points in local]
    common = (max(low for low, _ in extents), min(high for _, high in extents))
    fits = [np.polynomial.Polynomial.fit(p[:, 0] / scale, p[:, 1] / scale, DEGREE) for p in local]
    full = [_sample_polynomial(fit, scale, extent) for fit, extent in zip(fits, extents, strict=True)]
    shared = [_sample_polynomial(fit, scale, common) for fit in fits]
    if not all(len(points) for points in (*full, *shared)):
        return None
    return _both_ways(*full), _both_ways(*shared)


def _sample_polynomial(fit: np.polynomial.Polynomial, scale: float, extent: tuple[float, float]) -> Float:
    """Return the polynomial's points (N, 2), m, at the whole metres within an extent."""
    along = np.arange(np.ceil(extent[0] - 1e-9), np.floor(extent[1] + 1e-9) + 1.0)
    return np.column_stack([along, scale * fit(along / scale)])


def _both_ways(one: Float, other: Float) -> float:
    """Return the sum of both directed means of the distances to the nearest point of the other set."""
    return float(cKDTree(other).query(one)[0].mean() + cKDTree(one).query(other)[0].mean())


def over_seeds(rows: Sequence[Mapping[str, float]]) -> dict[str, Spread]:
    """Return mean and standard deviation (ddof 1) of each figure over runs with several seeds.

    A figure that is NaN or missing in one of them has a NaN mean: nothing is left out silently.
    """
    names = list(dict.fromkeys(name for row in rows for name in row))
    return {name: Spread.over([row.get(name, np.nan) for row in rows]) for name in names}


def over_roads(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Return the figures of several roads as one: means weighted by the number of slices; ``slices`` are summed.

    Roads too short for a window say nothing of Chamfer distances.
    """
    rows = list(rows)
    slices = np.array([row["slices"] for row in rows])
    names = list(dict.fromkeys(name for row in rows for name in row if name != "slices"))
    table = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    windows = table.get("chamfer_windows", np.zeros(len(rows)))
    summed = {"slices": float(slices.sum())}
    for name, values in table.items():
        counted = windows > 0 if name.startswith("chamfer_") else np.ones(len(rows), dtype=bool)
        weight = slices[counted]
        summed[name] = float((values[counted] * weight).sum() / weight.sum()) if weight.sum() else np.nan
    if "chamfer_windows" in table:
        summed["chamfer_windows"] = float(windows.sum())
    return summed


def _mean(values: Float) -> float:
    return float(values.mean()) if len(values) else np.nan
