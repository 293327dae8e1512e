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

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import ndtri

from synthroads_addon.base.arrays import Bool, Float, Index
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from .calibration import LEVELS
from .metrics import Metric

WINDOW = 60.0
GAP = 5.0
SHORTEST = 20.0
"""m."""
DEGREE = 3
_FEWEST = 2 * (DEGREE + 1)
"""Predicted centres that a window's polynomial needs."""
_PAST_END = 1.0
"""Distance past a line's end, m, from which on points have no offset from the line."""


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


@dataclass(frozen=True)
class Comparison:
    """Predicted and true centres of one road's M slices.

    Attributes:
        predicted: (M, 2) predicted centres, NaN where there is none.
        true: (M, 2) true centres, one on each slice's orthogonal, NaN in the truth's gaps.
        station: (M,) of the slices along their path, m, growing.
        std: (M,) predicted standard deviation, m; None if there is none.
        intervals: (M, 2) half-widths of the intervals of `LEVELS`, m; None: a Gaussian's of the standard deviation.
    """

    predicted: Float
    true: Float
    station: Float
    std: Float | None = None
    intervals: Float | None = None

    @cached_property
    def known(self) -> Bool:
        """Mask (M,) of the slices with a known true centre; cached."""
        return np.isfinite(self.true).all(axis=1)

    @cached_property
    def both(self) -> Bool:
        """Mask (M,) of the slices with both a true and a predicted centre; cached."""
        return self.known & np.isfinite(self.predicted).all(axis=1)

    @cached_property
    def distance(self) -> Float:
        """Plane distances (N,), m, between predicted and true centres of the slices that have both; cached."""
        return np.hypot(*(self.predicted - self.true)[self.both].T)

    @cached_property
    def offset(self) -> Float:
        """Signed offsets (N,) of predicted centres from the true line, m, left positive; gaps left out; cached."""
        offset = lateral_errors(self.predicted[self.both], self.true, self.station)
        return offset[np.isfinite(offset)]

    @cached_property
    def chamfer(self) -> Chamfer:
        """Chamfer distances between polynomials of the predicted and the true line, m; cached."""
        return chamfer(self.predicted, self.true, self.station)

    def coverage(self, level_index: int) -> float | None:
        """Return the share of distances within the predicted interval of `LEVELS[place]`; None without deviations."""
        if self.std is None:
            return None
        if self.intervals is None:
            return coverage(self.distance, self.std[self.both], LEVELS[level_index])
        return _mean((self.distance <= self.intervals[self.both, level_index]).astype(np.float64))


def _mean(values: Float) -> float:
    """Return the mean of values; NaN without any."""
    return float(values.mean()) if len(values) else np.nan


def _deviation(road: Comparison) -> float | None:
    """Return a road's mean predicted standard deviation, m; None if none was predicted."""
    return None if road.std is None else _mean(road.std[road.both][np.isfinite(road.std[road.both])])


METRICS = {
    # Slices with a known truth, and the share of them with a prediction.
    "slices": Metric(lambda road: road.known.sum(), summed=True),
    "found": Metric(
        lambda road: road.both.sum() / road.known.sum() if road.known.any() else np.nan, "found (%)", 100.0, 1, place=1
    ),
    "mae": Metric(lambda road: _mean(road.distance), "MAE (m)"),
    "distance_95": Metric(
        lambda road: np.quantile(road.distance, 0.95) if len(road.distance) else np.nan, "95 % (m)", decimals=2
    ),
    # Mean distance from the true line, and mean offset from it, positive to the left.
    "lateral": Metric(lambda road: _mean(np.abs(road.offset)), "lateral (m)"),
    "bias": Metric(lambda road: _mean(road.offset), "bias (m)"),
    "chamfer_full": Metric(lambda road: road.chamfer.full, "Chamfer, full (m)"),
    "chamfer_common": Metric(lambda road: road.chamfer.common, "Chamfer, common (m)"),
    "chamfer_compared": Metric(lambda road: road.chamfer.compared),
    "chamfer_windows": Metric(lambda road: road.chamfer.windows, summed=True),
    "coverage_68": Metric(lambda road: road.coverage(0), "in 68 % (%)", 100.0, 1),
    "coverage_95": Metric(lambda road: road.coverage(1), "in 95 % (%)", 100.0, 1),
    "std": Metric(_deviation),
}
"""Metrics of a `Comparison`, m unless said; what is here is in a measurement's data and, with a title, in tables."""


@dataclass(frozen=True)
class TargetErrors:
    """Errors of one corridor target in the N slices in which it is known, with predicted deviations.

    Attributes:
        size: (N,) absolute errors, in the target's unit.
        std: (N,) predicted standard deviations.
        widths: (N, 2) half-widths of the intervals of `LEVELS`.
        whole: whether the target is a whole number.
    """

    size: Float
    std: Float
    widths: Float
    whole: bool

    def inside(self, level_index: int) -> float:
        """Return the share of errors within the predicted interval of `LEVELS[place]`; NaN without slices."""
        return _mean((self.size <= self.widths[:, level_index]).astype(np.float64))


TARGET_METRICS = {
    "slices": Metric(lambda target: len(target.size)),
    "mae": Metric(lambda target: _mean(target.size), "mean error"),
    "right": Metric(
        lambda target: _mean((np.rint(target.size) == 0).astype(np.float64)) if target.whole else None,
        "right when rounded (%)",
        100.0,
        1,
    ),
    "coverage_68": Metric(lambda target: coverage(target.size, target.std, LEVELS[0])),
    "interval_68": Metric(lambda target: target.inside(0), "in 68 % (%)", 100.0, 1),
    "coverage_95": Metric(lambda target: coverage(target.size, target.std, LEVELS[1])),
    "interval_95": Metric(lambda target: target.inside(1), "in 95 % (%)", 100.0, 1),
}
"""Metrics of `TargetErrors`."""


def lateral_errors(points: Float, true_points: Float, station: Float) -> Float:
    """Return the signed offsets (N,) of points (N, 2) from the true line, m, left positive; NaN beside its gaps.

    The line runs through the true centres (M, 2) in the order of their stations (M,) and is broken at gaps.
    """
    known_rows = np.flatnonzero(np.isfinite(true_points).all(axis=1))
    no_offsets = np.full(len(points), np.nan)
    if len(known_rows) < 2 or not len(points) or not np.ptp(true_points[known_rows], axis=0).any():
        return no_offsets
    line = MeasuredAxis(true_points[known_rows], np.diff(station[known_rows]) <= GAP)
    return line.beside(points, np.inf, _PAST_END)[1] if len(line.parts) else no_offsets


def coverage(error: Float, std: Float, level: float) -> float:
    """Return the share (0 to 1) of errors (N,) within the Gaussian interval of a level; NaN without finite ones.

    Errors and standard deviations (N,) are in m; those that aren't finite are left out.
    """
    is_finite = np.isfinite(error) & np.isfinite(std)
    return _mean((np.abs(error[is_finite]) <= ndtri(0.5 + level / 2.0) * std[is_finite]).astype(np.float64))


def chamfer(predicted_points: Float, true_points: Float, station: Float, window: float = WINDOW) -> Chamfer:
    """Return Chamfer distances (m) between cubics fitted to predicted and true centres, averaged over windows.

    Args:
        predicted_points: (M, 2) m, NaN where there is none.
        true_points: (M, 2) m, NaN in the truth's gaps.
        station: (M,) of the slices along their path, m, growing.
        window: length of a window, m.
    """
    is_known = np.isfinite(true_points).all(axis=1)
    parts = windows(station, is_known, window)
    rows, weights, total_length = [], [], 0.0
    for part in parts:
        length = float(station[part[-1]] - station[part[0]])
        total_length += length
        found_points = predicted_points[part][np.isfinite(predicted_points[part]).all(axis=1)]
        distances = _window_chamfer(found_points, true_points[part])
        if distances is not None:
            rows.append(distances)
            weights.append(length)
    if not rows:
        return Chamfer(np.nan, np.nan, 0.0, len(parts))
    mean_full, mean_common = np.average(np.array(rows), axis=0, weights=weights)
    return Chamfer(float(mean_full), float(mean_common), sum(weights) / total_length, len(parts))


def windows(station: Float, truth_mask: Bool, window: float = WINDOW) -> list[Index]:
    """Return an index array of slices for each window of about `window` (m) of gapless truth, short pieces left out.

    Args:
        station: (M,) m, growing.
        truth_mask: (M,) mask of the slices with a known truth.
        window: length, m.
    """
    known_rows = np.flatnonzero(truth_mask)
    pieces = np.split(known_rows, np.flatnonzero(np.diff(station[known_rows]) > GAP) + 1) if len(known_rows) else []
    result: list[Index] = []
    for piece in pieces:
        distance = station[piece] - station[piece[0]]
        if distance[-1] < SHORTEST:
            continue
        count = max(1, round(distance[-1] / window))
        number = np.minimum((distance * (count / distance[-1])).astype(np.intp), count - 1)
        result.extend(piece[number == index] for index in range(count))
    return result


def _window_chamfer(predicted_points: Float, true_points: Float) -> tuple[float, float] | None:
    """Return one window's Chamfer distances over full and common extent, m; None if too little was predicted."""
    if len(predicted_points) < _FEWEST or len(true_points) < _FEWEST:
        return None
    origin = true_points.mean(axis=0)
    axes = np.linalg.svd(true_points - origin, full_matrices=False)[2]
    local = [(points - origin) @ axes.T for points in (predicted_points, true_points)]
    scale = float(np.abs(local[1][:, 0]).max())
    extents = [(points[:, 0].min(), points[:, 0].max()) for points in local]
    common_extent = (max(start for start, _ in extents), min(end for _, end in extents))
    fits = [np.polynomial.Polynomial.fit(p[:, 0] / scale, p[:, 1] / scale, DEGREE) for p in local]
    full_samples = [_sample_polynomial(fit, scale, extent) for fit, extent in zip(fits, extents, strict=True)]
    common_samples = [_sample_polynomial(fit, scale, common_extent) for fit in fits]
    if not all(len(points) for points in (*full_samples, *common_samples)):
        return None
    return _mutual_distance(*full_samples), _mutual_distance(*common_samples)


def _sample_polynomial(fit: np.polynomial.Polynomial, scale: float, extent: tuple[float, float]) -> Float:
    """Return a scaled polynomial's points (N, 2), m, at the whole metres within an extent (m)."""
    metres = np.arange(np.ceil(extent[0] - 1e-9), np.floor(extent[1] + 1e-9) + 1.0)
    return np.column_stack([metres, scale * fit(metres / scale)])


def _mutual_distance(points: Float, other_points: Float) -> float:
    """Return the Chamfer distance of two point sets: both directed mean nearest distances added, m."""
    return float(cKDTree(other_points).query(points)[0].mean() + cKDTree(points).query(other_points)[0].mean())


def over_roads(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Return the figures of several roads combined: means weighted by slices, and sums of counts.

    Roads too short for a window say nothing of Chamfer distances.
    """
    rows = list(rows)
    slices = np.array([row["slices"] for row in rows])
    windows = np.array([row.get("chamfer_windows", np.nan) for row in rows])
    result = {}
    for name in ("slices", *dict.fromkeys(name for row in rows for name in row if name != "slices")):
        values = np.array([row.get(name, np.nan) for row in rows])
        counts = windows > 0 if name.startswith("chamfer_") else np.ones(len(rows), dtype=bool)
        weight = slices[counts]
        mean = float((values[counts] * weight).sum() / weight.sum()) if weight.sum() else np.nan
        result[name] = float(values.sum()) if METRICS[name].summed else mean
    return result
