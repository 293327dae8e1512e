"""Smooth values along the road with their standard deviations, unmoved by single outliers."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.special import ndtr

from ..base.arrays import Float

ORDER = 3
"""Order of the differences that are held small: a curvature that changes linearly costs nothing."""
_ROUNDS = 6
_BISQUARE = 4.685  # times the residuals' scale: from here on a value counts nothing
_LEAST_SCATTER = 0.01  # m: of single offsets, beside the rows that they lie between
_MOST_SAY = 5.0  # independent values that all together count as: soft ends would shrink with each more
_GRID = 0.002  # m
_FAULTY = 0.02  # likelihood of a value whose interval misses the mean, relative to one whose interval holds it
_FLOOR = 1e-9  # of the mean weight: what holds the solution where nothing was measured


@dataclass(frozen=True)
class SmoothedValues:
    """A smoothed sequence of N values with their standard deviations.

    Attributes:
        values: (N,).
        std: (N,) standard deviation of each smoothed value, from the scatter of what was measured about it.
        scatter: standard deviation of one measured value about the smoothed ones.
    """

    values: Float
    std: Float
    scatter: float


def smooth(
    values: Float, weights: Float, spacing: float, wavelength: float, order: int = ORDER, usual: float = 0.0
) -> SmoothedValues:
    """Smooth values (N,) at equal spacing by Whittaker's method with bisquare weights; return standard deviations too.

    Args:
        values: (N,); NaN where nothing was measured.
        weights: (N,) >= 0, how much each counts, e.g. by its number of points.
        spacing: distance of neighbours, m.
        wavelength: a wave of this length (m) keeps half of its amplitude; shorter ones vanish.
        order: of the differences that are held small.
        usual: standard deviation of single values that is nothing unusual: no fault is seen in it.

    The residuals of neighbours may go together (markings are painted with a slow sway): the standard deviations are
    widened by the factor that their lag-1 correlation asks for.
    """
    known = np.isfinite(values) & (weights > 0.0)
    count = len(values)
    if known.sum() <= order:
        level = float(np.median(values[known])) if known.any() else 0.0
        return SmoothedValues(np.full(count, level), np.full(count, np.inf), np.inf)
    given = np.where(known, values, 0.0)
    base = np.where(known, weights, 0.0)
    base = base / base[known].mean()
    order = min(order, count - 1)
    stiffness = (wavelength / (2.0 * np.pi * spacing)) ** (2 * order)
    penalty = stiffness * _difference_bands(count, order)
    robust = known.astype(np.float64)
    fitted, scatter = given, 0.0
    for _ in range(_ROUNDS):
        factor, fitted = _solve(penalty, base * robust, given)
        residual = given - fitted
        scatter = robust_scale(residual[known] * np.sqrt(base[known]))
        robust = np.where(known, bisquare(residual * np.sqrt(base), max(scatter, usual, 1e-9)), 0.0)
    factor, fitted = _solve(penalty, base * robust, given)
    kept = known & (robust > 0.0)
    residual = (given - fitted)[kept] * np.sqrt(base[kept])
    scatter = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
    widening = np.sqrt(correlation_factor(residual))
    std = scatter * widening * np.sqrt(np.maximum(_inverse_diagonal(factor), 0.0))
    return SmoothedValues(fitted, std, scatter)


def correlation_factor(residual: Float) -> float:
    """Return how many values, correlated (lag 1) as residuals (N,) are, tell as much as one independent value."""
    if len(residual) < 8:
        return 1.0
    centred = residual - residual.mean()
    square = float(centred @ centred)
    lag = float(centred[1:] @ centred[:-1]) / square if square > 0.0 else 0.0
    lag = min(max(lag, 0.0), 0.95)
    return (1.0 + lag) / (1.0 - lag)


def mean_with_std(values: Float) -> tuple[float, float]:
    """Return the robust mean (bisquare) of values (N,) along the road, and its standard deviation.

    Bisquare about the median; the deviation counts as many values as are independent of their neighbours. NaN and
    infinity for no values.
    """
    values = values[np.isfinite(values)]
    if not len(values):
        return float("nan"), float("inf")
    middle = float(np.median(values))
    for _ in range(_ROUNDS):
        robust = bisquare(values - middle, max(robust_scale(values - middle), 1e-9))
        total = float(robust.sum())
        if total <= 0.0:
            break
        middle = float((robust * values).sum() / total)
    kept = bisquare(values - middle, max(robust_scale(values - middle), 1e-9)) > 0.0
    spread = float(np.sqrt(np.mean((values[kept] - middle) ** 2))) if kept.any() else 0.0
    independent = max(1.0, kept.sum() / correlation_factor(values[kept] - middle))
    return middle, spread / float(np.sqrt(independent))


def interval_mean(values: Float, apart: Float, axis_std: float = 0.0) -> tuple[float, float]:
    """Return the mean of values (K,) along the road that each lie midway between two rows of points, and its deviation.

    A value is evenly likely everywhere between its rows, ``apart`` (K,) from each other, m, and so are all of them at
    once where the rows run beside the road: however many there are, they say no more than one. Where the rows wander
    only the places count that all intervals have in common. Intervals end softly, by how much values scatter beyond
    them, and weigh as `correlation_factor` says. Values that are means of many points have no interval. Where the axis
    that all is measured from wanders by its deviation ``axis_std``, m, the rows only seem to.
    """
    known = np.isfinite(values) & np.isfinite(apart)
    values, half = values[known], 0.5 * apart[known]
    if not len(values):
        return float("nan"), float("inf")
    middle = mean_with_std(values)[0]
    beyond = np.maximum(np.abs(values - middle) - half, 0.0)
    jump = robust_scale(np.diff(values)) / np.sqrt(2.0) if len(values) > 1 else 0.0
    scatter = max(_LEAST_SCATTER, axis_std, robust_scale(beyond), min(jump, float(np.median(half)) + _LEAST_SCATTER))
    low, high = values - np.maximum(half, 0.5 * _LEAST_SCATTER), values + np.maximum(half, 0.5 * _LEAST_SCATTER)
    place = np.arange(np.percentile(low, 1) - scatter, np.percentile(high, 99) + scatter + _GRID, _GRID)
    shares = ndtr((place - low[:, None]) / scatter) - ndtr((place - high[:, None]) / scatter)
    likely = np.log(np.maximum(shares / np.maximum(shares.max(axis=1, keepdims=True), 1e-12), _FAULTY)).sum(axis=0)
    likely *= min(1.0 / correlation_factor(values - middle), _MOST_SAY / len(values))
    weight = np.exp(likely - likely.max())
    weight /= weight.sum()
    mean = float(weight @ place)
    return mean, float(np.hypot(np.sqrt(weight @ (place - mean) ** 2), _GRID))


def hidden_std(apart: Float, scatter: float) -> float:
    """Return the standard deviation, m, of an offset's error that scatter hides, as points lie in rows along the road.

    What lies midway between two rows is off by up to half of their distance: evenly distributed, so by
    distance / sqrt(12). Where the rows wander beside the road, the offsets scatter by as much and their mean is better;
    where they don't, what is missing in the scatter is an error that all of them share.

    Args:
        apart: (K,) distances of the rows, m; 0 where the offset is a mean of many points.
        scatter: standard deviation of single offsets about the mean, m.
    """
    rows = apart[np.isfinite(apart) & (apart > 0.0)]
    if not len(rows):
        return 0.0
    return float(np.sqrt(max(0.0, float(np.median(rows)) ** 2 / 12.0 - scatter**2)))


def robust_scale(residual: Float) -> float:
    """Return a standard deviation estimated by the median absolute residual (N,) times 1.4826; 0 for none."""
    return float(1.4826 * np.median(np.abs(residual))) if len(residual) else 0.0


def bisquare(residual: Float, scale: float) -> Float:
    """Return Tukey's bisquare weights (N,) of residuals: 1 at 0, falling to 0 at 4.685 times the scale."""
    return np.asarray(np.maximum(1.0 - (residual / (_BISQUARE * scale)) ** 2, 0.0) ** 2)


def fill_gaps(values: Float) -> Float:
    """Return values (N,) with NaN interpolated linearly, held at the ends; at least one must not be NaN."""
    rows, known = np.arange(len(values)), np.isfinite(values)
    return np.interp(rows, rows[known], values[known])


def _difference_bands(count: int, order: int) -> Float:
    """Return D'D of the difference operator D of an order, in lower banded form (order + 1, N)."""
    stencil = np.array([1.0])
    for _ in range(order):
        stencil = np.convolve(stencil, [-1.0, 1.0])
    bands = np.zeros((order + 1, count))
    rows = count - order
    for i in range(order + 1):
        for j in range(i, order + 1):
            bands[j - i, i : i + rows] += stencil[i] * stencil[j]
    return bands


def _solve(penalty: Float, weights: Float, values: Float) -> tuple[Float, Float]:
    """Return the banded Cholesky factor of the smoothing equations, and the smoothed values (N,)."""
    bands = penalty.copy()
    bands[0] += weights + _FLOOR * max(float(weights.mean()), _FLOOR)
    factor = np.asarray(cholesky_banded(bands, lower=True))
    return factor, np.asarray(cho_solve_banded((factor, True), weights * values))


def _inverse_diagonal(factor: Float) -> Float:
    """Return the diagonal (N,) of a banded matrix's inverse from its lower Cholesky factor (Takahashi's recursion)."""
    width, count = factor.shape[0] - 1, factor.shape[1]
    inverse = np.zeros((width + 1, count + width))  # bands below the diagonal
    lower = factor / factor[0]
    pivot = 1.0 / factor[0] ** 2
    for i in range(count - 1, -1, -1):
        below = lower[1:, i]
        block = _block(inverse, i + 1, width)
        row = -block @ below
        inverse[1:, i] = row
        inverse[0, i] = pivot[i] - below @ row
    return inverse[0, :count]


def _block(inverse: Float, start: int, width: int) -> Float:
    """Return the symmetric (width, width) block on the inverse's diagonal that begins at a row."""
    block = np.empty((width, width))
    for a in range(width):
        for b in range(a + 1):
            block[a, b] = block[b, a] = inverse[a - b, start + b]
    return block


def difference_figures(difference: Float, *names: str) -> dict[str, float]:
    """Return the named figures (mean, mae, rms, p95, largest) of differences (N,), m; NaN are left out.

    Without any number there are no figures.
    """
    known = difference[np.isfinite(difference)]
    if not len(known):
        return {}
    size = np.abs(known)
    figures = {"mean": known.mean(), "mae": size.mean(), "rms": np.sqrt((size**2).mean())}
    figures |= {"p95": np.percentile(size, 95), "largest": size.max()}
    return {name: round(float(figures[name]), 4) for name in names}
