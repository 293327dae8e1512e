"""The cross-profile's symmetry: a road is the same to both sides of its axis, in brightness, paint and shape.

Whatever lies within reach counts, seen or not seen as a line: each place pairs with its mirror image, so that a cloud
that is cut off on one side loses the pairs there and is not pulled to the other.
"""

import numpy as np
from scipy import ndimage
from scipy.signal import fftconvolve

from ...base.arrays import Float
from ..profiles import ACROSS, Profiles, median_profile, remove_grade
from ..smoothing import fill_gaps, robust_scale
from .view import View

_REACH = 8.0
"""Distance to either side of the path that the axis is looked for in, m. Chosen: two lanes."""
_LIMIT = 2.5
"""Spreads from the middle beyond which a value counts as that far. Chosen: single bright signs have no say."""
_APART = 0.6
"""Half the distance of the nearest pairs, m. Chosen: nearer places are alike anyway."""
_INDEPENDENT = 0.4
"""Width that one independent value takes, m. Chosen: some bins, which a line and blur join."""
_FEWEST = 3.0
"""Width on either side that must have mirror images, m. Chosen: a lane."""
_CLEAR = 3.0
"""Standard deviations that the best axis lies above what chance gives. Chosen: one false in some 700."""
_RIVAL = 0.75
"""Share of the best from which on another place leaves the axis open, if it is farther than `_OTHER` away. Chosen: one
nearly as good can't be ruled out."""
_OTHER = 1.0
"""Distance of another place, m. Chosen: as of fused views."""
_NEAR_BEST = 0.92
"""Share of the best at which the width of the peak says how sure it is. Chosen: above the peak's flanks."""
_FLOOR = 0.25
"""Deviation of the axis of symmetry from the axis where nothing scatters, m. Chosen: shoulders of two sides differ by
as much."""


def view_symmetry(profiles: Profiles) -> View:
    """Return the view of the axis about which brightness, paint and shape of the cross profiles are symmetric."""
    height = remove_grade(profiles.height)
    offsets, width = np.full(profiles.stretches, np.nan), np.full(profiles.stretches, np.inf)
    for number in range(profiles.stretches):
        offsets[number], width[number] = _axis_of(_signals(profiles, height, number), profiles.offsets)
    seen_mask = np.isfinite(offsets)
    return View.of("cross-profile", offsets, _FLOOR, np.where(seen_mask, width, 0.0))


def _signals(profiles: Profiles, height: Float, stretch: int) -> Float:
    """Return brightness, paint and the ground's bend (3, U) around a stretch, each in spreads; NaN where unknown."""
    rows = [
        median_profile(profiles.brightness, stretch),
        median_profile(profiles.paint, stretch),
        _bend(median_profile(height, stretch)),
    ]
    return np.array([_in_spreads(row) for row in rows])


def _bend(height: Float) -> Float:
    """Return the second difference (U,) of a height profile over half a metre: kerbs and verges, not the crossfall."""
    # Chosen: of fewer than 20 bins (1 m) no shape is told.
    if np.isfinite(height).sum() < 20:
        return np.full(len(height), np.nan)
    # A second difference sees nothing of slopes, and the blur keeps range noise out of it.
    smooth_height = ndimage.gaussian_filter1d(fill_gaps(height), 2.5)
    bend = np.gradient(np.gradient(smooth_height))
    return np.where(np.isfinite(height), bend, np.nan)


def _in_spreads(values: Float) -> Float:
    """Return a profile (U,) less its median, over its robust spread, clipped to `_LIMIT`; NaN if hardly known."""
    finite_values = values[np.isfinite(values)]
    if len(finite_values) < 20:
        return np.full(len(values), np.nan)
    middle = float(np.median(finite_values))
    # Of a profile that is even but for a few bins the robust scale is nearly 0, and would blow up its noise.
    spread = max(robust_scale(finite_values - middle), 0.3 * float(finite_values.std()), 1e-9)
    return np.clip((values - middle) / spread, -_LIMIT, _LIMIT)


def _axis_of(signals: Float, offsets: Float) -> tuple[float, float]:
    """Return the best axis of symmetry's offset and half the width of its peak, m; NaN if there is none, or a rival.

    Args:
        signals: (3, U) see `_signals`.
        offsets: (U,) m.
    """
    score, pairs = _symmetry(signals)
    if not np.isfinite(score).any():
        return np.nan, np.inf
    axis_offsets = offsets[0] + 0.5 * ACROSS * np.arange(len(score))
    candidate_mask = (np.abs(axis_offsets) <= _REACH) & (pairs * ACROSS >= _FEWEST)
    candidate_score = np.where(candidate_mask, score, -np.inf)
    best_place = int(candidate_score.argmax())
    if not candidate_score[best_place] >= _CLEAR:
        return np.nan, np.inf
    around_best = np.abs(axis_offsets - axis_offsets[best_place]) < _OTHER
    if float(np.where(around_best, -np.inf, candidate_score).max()) > _RIVAL * candidate_score[best_place]:
        return np.nan, np.inf
    peak = around_best & (candidate_score >= _NEAR_BEST * candidate_score[best_place])
    return float(np.average(axis_offsets[peak], weights=candidate_score[peak])), 0.5 * float(np.ptp(axis_offsets[peak]))


def _symmetry(values: Float) -> tuple[Float, Float]:
    """Return the score of symmetry about each place, half a bin apart, and the number of pairs of mirror images.

    Args:
        values: (C, U) signals in spreads; NaN where unknown.

    Returns:
        (2 U - 1,) standard deviations above what unrelated values give, and number of pairs.
    """
    bins = values.shape[1]
    # The autoconvolution sum of v_i v_(k - i) pairs each bin with its mirror image about k / 2: over the number of
    # pairs and the variance it is their correlation, whose deviation for unrelated values is 1 / sqrt(pairs).
    total, pairs = np.zeros(2 * bins - 1), np.zeros(2 * bins - 1)
    for row in values:
        has_value = np.isfinite(row)
        variance = float(row[has_value].var()) if has_value.any() else 0.0
        if variance <= 0.0:
            continue
        # Unknown bins are 0 and counted nowhere: they pull the correlation to neither side.
        centred_values = np.where(has_value, row - row[has_value].mean(), 0.0)
        product = 0.5 * (fftconvolve(centred_values, centred_values) - _too_near(centred_values * has_value, bins))
        count = 0.5 * (
            fftconvolve(has_value.astype(float), has_value.astype(float)) - _too_near(has_value.astype(float), bins)
        )
        count = np.maximum(np.rint(count), 0.0)
        independent = np.maximum(count * ACROSS / _INDEPENDENT, 1.0)
        total += np.where(count > 0.0, product / np.maximum(count, 1.0) / variance * np.sqrt(independent), 0.0)
        pairs = np.maximum(pairs, count)
    # The sum of C independent scores has the deviation sqrt(C).
    return total / np.sqrt(len(values)), pairs


def _too_near(values: Float, bins: int) -> Float:
    """Return by place of the axis (2 U - 1,) the sum of products of pairs within `_APART` of it, counted both ways."""
    reach = round(_APART / ACROSS)
    result = np.zeros(2 * bins - 1)
    for step in range(reach + 1):  # pairs (i, i + step) have their axis at 2 i + step half bins
        products = values[: bins - step] * values[step:]
        result[step : 2 * bins - 1 - step : 2] += products * (1.0 if step == 0 else 2.0)
    return result
