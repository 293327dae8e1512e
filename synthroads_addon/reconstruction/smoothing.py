"""Smooth values along the road with their standard deviations, unmoved by single outliers."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.special import ndtr

from ..base.arrays import Float

ORDER = 3
"""Order of the differences that are held small: a curvature that changes linearly costs nothing. Chosen: clothoids have
such a curvature."""
_ROUNDS = 6
"""Rounds of iteratively reweighted least squares. Chosen: weights change little after them."""
_MAD = 1.4826
"""A normal distribution's standard deviation over its median absolute deviation: 1 / 0.6745."""
_BISQUARE = 4.685
"""Scales of the residuals from which on a value counts nothing: Tukey's bisquare, 95 % efficient for normal errors."""
_LEAST_SCATTER = 0.01
"""Least scatter of single offsets beside the rows that they lie between, m. Chosen: rows wobble by about as much."""
_MOST_INDEPENDENT = 5.0
"""Independent values that all intervals together count as, at most. Chosen: soft ends would shrink with each more."""
_GRID = 0.002
"""Step of the places at which the intervals' likelihood is worked out, m. Chosen: small beside `_LEAST_SCATTER`."""
_OUTLIER = 0.02
"""Likelihood of a value whose interval misses the mean, over that of one whose interval holds it. Chosen: a single
fault moves the logarithm by 4 at most."""
_FLOOR = 1e-9
"""Weight, over the mean one, where nothing was measured. Chosen: holds the solution there and moves no other."""
_LARGEST_LAG = 0.95
"""Largest lag-1 correlation that is believed. Chosen: a value still counts as a fortieth of an independent one."""
_FEWEST_LAGS = 8
"""Fewest residuals whose correlation is worked out. Chosen: of fewer it is mostly chance."""


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
    values: Float, weights: Float, spacing: float, wavelength: float, order: int = ORDER, usual_std: float = 0.0
) -> SmoothedValues:
    """Smooth values (N,) at equal spacing by Whittaker's method with bisquare weights; return standard deviations too.

    Args:
        values: (N,); NaN where nothing was measured.
        weights: (N,) >= 0, weight of each value, e.g. by its number of points.
        spacing: distance of neighbours, m.
        wavelength: a wave of this length (m) keeps half of its amplitude; shorter ones vanish.
        order: of the differences that are held small.
        usual_std: standard deviation of single values up to which none counts as an outlier.

    The residuals of neighbours may go together (markings are painted with a slow sway): the standard deviations are
    widened by the factor that their lag-1 correlation asks for.
    """
    is_measured = np.isfinite(values) & (weights > 0.0)
    count = len(values)
    if is_measured.sum() <= order:
        median = float(np.median(values[is_measured])) if is_measured.any() else 0.0
        return SmoothedValues(np.full(count, median), np.full(count, np.inf), np.inf)
    observations = np.where(is_measured, values, 0.0)
    weight = np.where(is_measured, weights, 0.0)
    weight = weight / weight[is_measured].mean()
    order = min(order, count - 1)
    # Whittaker 1923, Eilers 2003: (W + lambda D'D) z = W y. Of a wave of the angular frequency omega per step the share
    # 1 / (1 + lambda omega^(2 order)) stays, half of it for lambda = (wavelength / (2 pi spacing))^(2 order).
    penalty = (wavelength / (2.0 * np.pi * spacing)) ** (2 * order) * _difference_bands(count, order)
    robustness = is_measured.astype(np.float64)
    smooth_values, scatter = observations, 0.0
    for _ in range(_ROUNDS):
        cholesky, smooth_values = _solve(penalty, weight * robustness, observations)
        residual = observations - smooth_values
        scatter = robust_scale(residual[is_measured] * np.sqrt(weight[is_measured]))
        robustness = np.where(is_measured, bisquare(residual * np.sqrt(weight), max(scatter, usual_std, 1e-9)), 0.0)
    cholesky, smooth_values = _solve(penalty, weight * robustness, observations)
    inliers = is_measured & (robustness > 0.0)
    residual = (observations - smooth_values)[inliers] * np.sqrt(weight[inliers])
    scatter = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
    # Var(z_i) = scatter^2 [(W + lambda D'D)^-1]_ii, times what correlated residuals are worth less.
    widening = np.sqrt(correlation_factor(residual))
    std = scatter * widening * np.sqrt(np.maximum(_inverse_diagonal(cholesky), 0.0))
    return SmoothedValues(smooth_values, std, scatter)


def penalised_curve(values: Float, weights: Float, penalty: float) -> Float:
    """Return the curve (N,) that lies near values (N,) at equal spacing, and whose third differences are small.

    It is the least of sum(weights (values - curve)^2) + penalty sum(third differences^2) (Whittaker 1923).

    Args:
        values: (N,); those without weight don't count.
        weights: (N,) >= 0.
        penalty: of the squared differences.
    """
    return _solve(penalty * _difference_bands(len(values), ORDER), weights, values)[1]


def correlation_factor(residual: Float) -> float:
    """Return how many values with the lag-1 correlation of residuals (N,) are worth one independent value."""
    if len(residual) < _FEWEST_LAGS:
        return 1.0
    centred = residual - residual.mean()
    variance = float(centred @ centred)
    rho = float(centred[1:] @ centred[:-1]) / variance if variance > 0.0 else 0.0
    rho = min(max(rho, 0.0), _LARGEST_LAG)
    # Effective sample size of a first-order autoregression: n (1 - rho) / (1 + rho).
    return (1.0 + rho) / (1.0 - rho)


def mean_with_std(values: Float) -> tuple[float, float]:
    """Return the robust mean (bisquare) of values (N,) along the road, and its standard deviation.

    Bisquare about the median; the deviation counts as many values as are independent of their neighbours. NaN and
    infinity for no values.
    """
    values = values[np.isfinite(values)]
    if not len(values):
        return float("nan"), float("inf")
    mean = float(np.median(values))
    for _ in range(_ROUNDS):
        robustness = bisquare(values - mean, max(robust_scale(values - mean), 1e-9))
        total = float(robustness.sum())
        if total <= 0.0:
            break
        mean = float((robustness * values).sum() / total)
    inliers = bisquare(values - mean, max(robust_scale(values - mean), 1e-9)) > 0.0
    scatter = float(np.sqrt(np.mean((values[inliers] - mean) ** 2))) if inliers.any() else 0.0
    sample_size = max(1.0, inliers.sum() / correlation_factor(values[inliers] - mean))
    return mean, scatter / float(np.sqrt(sample_size))


def interval_mean(values: Float, spacing: Float, axis_std: float = 0.0) -> tuple[float, float]:
    """Return the mean, and its standard deviation, of values (K,) that each lie midway between two rows of points.

    A value is evenly likely everywhere between its rows, ``spacing`` (K,) from each other, m, and so are all of them at
    once where the rows run beside the road: however many there are, they say no more than one. Where the rows wander
    only the places count that all intervals have in common. Intervals end softly, by how much values scatter beyond
    them, and weigh as `correlation_factor` says. Values that are means of many points have no interval. Where the axis
    that all is measured from wanders by its deviation ``axis_std``, m, the rows only seem to.
    """
    is_measured = np.isfinite(values) & np.isfinite(spacing)
    middles, half_length = values[is_measured], 0.5 * spacing[is_measured]
    if not len(middles):
        return float("nan"), float("inf")
    centre = mean_with_std(middles)[0]
    sigma = _end_scatter(middles, half_length, centre, axis_std)
    lower_ends = middles - np.maximum(half_length, 0.5 * _LEAST_SCATTER)
    upper_ends = middles + np.maximum(half_length, 0.5 * _LEAST_SCATTER)
    mu = np.arange(np.percentile(lower_ends, 1) - sigma, np.percentile(upper_ends, 99) + sigma + _GRID, _GRID)
    # A uniform distribution from low to high, convolved with a normal one of sigma:
    # L_i(mu) = Phi((mu - low_i) / sigma) - Phi((mu - high_i) / sigma), over its largest, but no less than an outlier's.
    likelihood = ndtr((mu - lower_ends[:, None]) / sigma) - ndtr((mu - upper_ends[:, None]) / sigma)
    likelihood = np.maximum(likelihood / np.maximum(likelihood.max(axis=1, keepdims=True), 1e-12), _OUTLIER)
    # The sum of logarithms counts K values; it is tempered (a power of the likelihood) to those that are independent.
    log_likelihood = np.log(likelihood).sum(axis=0)
    log_likelihood *= min(1.0 / correlation_factor(middles - centre), _MOST_INDEPENDENT / len(middles))
    # Posterior over the grid under a flat prior: its mean, and its deviation with the grid's own.
    posterior = np.exp(log_likelihood - log_likelihood.max())
    posterior /= posterior.sum()
    mean = float(posterior @ mu)
    return mean, float(np.hypot(np.sqrt(posterior @ (mu - mean) ** 2), _GRID))


def _end_scatter(middles: Float, half_lengths: Float, centre: float, axis_std: float) -> float:
    """Return the standard deviation, m, of the ends of intervals (K,) about their true places.

    Args:
        middles: (K,) middles of the intervals, m.
        half_lengths: (K,) halves of their lengths, m.
        centre: robust mean of the middles, m.
        axis_std: deviation of the axis that all is measured from, m.
    """
    excess = np.maximum(np.abs(middles - centre) - half_lengths, 0.0)  # by how much an interval misses the mean
    # Differences of neighbours have sqrt(2) of the scatter; what the intervals explain of it isn't the ends'.
    step = robust_scale(np.diff(middles)) / np.sqrt(2.0) if len(middles) > 1 else 0.0
    return max(
        _LEAST_SCATTER, axis_std, robust_scale(excess), min(step, float(np.median(half_lengths)) + _LEAST_SCATTER)
    )


def hidden_std(spacing: Float, scatter: float) -> float:
    """Return the standard deviation, m, of an offset's error that scatter hides, as points lie in rows along the road.

    What lies midway between two rows is off by up to half of their distance: evenly distributed, so by
    distance / sqrt(12). Where the rows wander beside the road, the offsets scatter by as much and their mean is better;
    where they don't, what is missing in the scatter is an error that all of them share.

    Args:
        spacing: (K,) distances of the rows, m; 0 where the offset is a mean of many points.
        scatter: standard deviation of single offsets about the mean, m.
    """
    gaps = spacing[np.isfinite(spacing) & (spacing > 0.0)]
    if not len(gaps):
        return 0.0
    # Variance of a uniform distribution of width d: d^2 / 12, less what scatters.
    return float(np.sqrt(max(0.0, float(np.median(gaps)) ** 2 / 12.0 - scatter**2)))


def robust_scale(residual: Float) -> float:
    """Return a standard deviation estimated by the median absolute residual (N,) times 1.4826; 0 for none."""
    return float(_MAD * np.median(np.abs(residual))) if len(residual) else 0.0


def bisquare(residual: Float, scale: float) -> Float:
    """Return Tukey's bisquare weights (N,) of residuals: 1 at 0, falling to 0 at 4.685 times the scale."""
    # Beaton and Tukey 1974: w(r) = (1 - (r / (c s))^2)^2 for |r| < c s, else 0.
    return np.asarray(np.maximum(1.0 - (residual / (_BISQUARE * scale)) ** 2, 0.0) ** 2)


def fill_gaps(values: Float) -> Float:
    """Return values (N,) with NaN interpolated linearly, held at the ends; at least one must not be NaN."""
    rows, is_known = np.arange(len(values)), np.isfinite(values)
    return np.interp(rows, rows[is_known], values[is_known])


def _difference_bands(count: int, order: int) -> Float:
    """Return D'D of the difference operator D of an order, in lower banded form (order + 1, N)."""
    stencil = np.array([1.0])
    for _ in range(order):
        stencil = np.convolve(stencil, [-1.0, 1.0])  # (-1)^(d - k) binomial(d, k) in the end
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


def _inverse_diagonal(cholesky: Float) -> Float:
    """Return the diagonal (N,) of a banded matrix's inverse from its lower Cholesky factor (Takahashi's recursion)."""
    bandwidth, count = cholesky.shape[0] - 1, cholesky.shape[1]
    inverse_bands = np.zeros((bandwidth + 1, count + bandwidth))  # bands of the inverse, from the diagonal downwards
    # Takahashi et al. 1973, of A = L D L' with a unit lower L: Z = D^-1 L^-1 + (I - L') Z. Column i needs the columns
    # behind it only, so that they are worked out from the last to the first.
    unit_lower = cholesky / cholesky[0]
    inverse_d = 1.0 / cholesky[0] ** 2
    for i in range(count - 1, -1, -1):
        column = unit_lower[1:, i]
        inverse_column = -_block(inverse_bands, i + 1, bandwidth) @ column
        inverse_bands[1:, i] = inverse_column
        inverse_bands[0, i] = inverse_d[i] - column @ inverse_column
    return inverse_bands[0, :count]


def _block(bands: Float, start: int, width: int) -> Float:
    """Return the symmetric (width, width) block on a banded matrix's diagonal that begins at a row."""
    block = np.empty((width, width))
    for a in range(width):
        for b in range(a + 1):
            block[a, b] = block[b, a] = bands[a - b, start + b]
    return block


def difference_figures(difference: Float, *names: str) -> dict[str, float]:
    """Return the named figures (mean, mae, rms, p95, largest) of differences (N,), m; NaN are left out.

    Without any number there are no figures.
    """
    finite_values = difference[np.isfinite(difference)]
    if not len(finite_values):
        return {}
    size = np.abs(finite_values)
    figures = {"mean": finite_values.mean(), "mae": size.mean(), "rms": np.sqrt((size**2).mean())}
    figures |= {"p95": np.percentile(size, 95), "largest": size.max()}
    return {name: round(float(figures[name]), 4) for name in names}
