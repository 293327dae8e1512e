"""How far the axis may lie from the fused one: intervals from all views, of which any may have slipped.

A view is right within its deviation, or has slipped and says nothing (mixture of good and bad data). So a rival makes
intervals wide that reach to it, and views that agree make them narrow. Views that go by the same evidence slip
together: they count as one.
"""

import numpy as np
from scipy import ndimage

from ...base.arrays import Float
from .fusion import FusedAxis
from .view import View

SLIPS = 0.1
"""Probability that a view has slipped, as measured on generated roads whose sides were cut at random."""
_EVIDENCE = {"lines": "paint", "marking period": "paint", "brightness": "ground", "skeleton": "ground"}
"""Kind of evidence by view: views of one kind slip together."""
_EVIDENCE |= {"cross-profile": "ground", "edges": "ground", "dark band": "ground"}
_REACH, _STEP = 8.0, 0.05
"""Distance to either side in which the axis may lie, and from one place to the next, m. Chosen: two lanes; a third of
`fusion.DEFINITION`."""


def half_width(axis: FusedAxis, share: float, factor: float, extra_std: float = 0.0) -> Float:
    """Return half-widths (K,), m, about the fused axis of the intervals that hold the true one with a probability.

    They are never narrower than the axis' own deviation says, and only that where nothing is seen.

    Args:
        axis: the fused axis with its views.
        share: probability that the interval holds the true axis.
        factor: standard deviations to either side that hold this probability of a normal distribution.
        extra_std: standard deviation of one more error that the whole axis has, m.
    """
    minimum = factor * np.hypot(axis.std, extra_std)
    seen_mask = np.any([np.isfinite(view.offsets) for view in axis.views], axis=0)
    if not seen_mask.any():
        return minimum
    # One more independent error: densities convolve.
    density = ndimage.gaussian_filter1d(_density(axis), max(extra_std, 1e-3) / _STEP, axis=1, mode="constant")
    density /= density.sum(axis=1, keepdims=True)
    return np.where(seen_mask, np.maximum(minimum, _quantile(density, share)), minimum)


def _quantile(density: Float, share: float) -> Float:
    """Return the half-width (K,), m, of the central interval that holds a share of each density (K, P).

    P is odd: a density has cells of `_STEP` about 0, which lies in the middle of the middle one.
    """
    middle = density.shape[1] // 2
    # The interval is the same to both sides: shares are added up from the middle outwards.
    pairs = density[:, middle + 1 :] + density[:, middle - 1 :: -1]
    # Entry 1 is the share of the middle cell, half a step to either side; entry n that of n - 0.5 steps.
    cumulative_share = np.cumsum(np.column_stack([np.zeros(len(density)), density[:, middle], pairs]), axis=1)
    # Index of the first cumulative share that reaches the wanted one; 1 at least.
    end_index = np.maximum((cumulative_share < share).argmin(axis=1), 1)[:, None]
    share_before, share_after = (
        np.take_along_axis(cumulative_share, end_index - step, axis=1)[:, 0] for step in (1, 0)
    )
    # Linear within the cell: the middle one ends half a step from the middle, each further one a step farther out.
    share_of_step = (share - share_before) / (share_after - share_before)
    end = end_index[:, 0]
    return np.where(end == 1, 0.5 * share_of_step, end - 1.5 + share_of_step) * _STEP


def _density(axis: FusedAxis) -> Float:
    """Return the density (K, P) of the axis' place beside the fused axis, up to a factor by stretch."""
    distance = np.arange(-round(_REACH / _STEP), round(_REACH / _STEP) + 1) * _STEP
    result = np.zeros((len(axis.offsets), len(distance)))
    kinds = [_EVIDENCE.get(view.name, view.name) for view in axis.views]
    for kind in dict.fromkeys(kinds):
        kind_views = [view for view, view_kind in zip(axis.views, kinds, strict=True) if view_kind == kind]
        # Views of one kind of evidence slip together: the mean of their logarithms counts as one view.
        view_count = np.sum([np.isfinite(view.offsets) for view in kind_views], axis=0)
        result += (
            np.sum([_likelihood(view, axis.offsets, distance) for view in kind_views], axis=0)
            / np.maximum(view_count, 1)[:, None]
        )
    return np.exp(result - result.max(axis=1, keepdims=True))


def _likelihood(view: View, axis_offsets: Float, distance: Float) -> Float:
    """Return the logarithm of a view's likelihood (K, P) of the axis at each place; 0 where the view sees nothing.

    Args:
        view: offsets with standard deviations.
        axis_offsets: (K,) of the fused axis, m.
        distance: (P,) distances from the fused axis, m.
    """
    seen_mask = np.isfinite(view.offsets)
    std = np.where(seen_mask, view.std, 1.0)[:, None]
    z = (distance - np.where(seen_mask, view.offsets - axis_offsets, 0.0)[:, None]) / std
    # p = (1 - slips) N(place; offset, std) + slips / (2 reach): the tail keeps a single view from ruling a place out.
    normal_density = np.exp(-0.5 * z**2) / (np.sqrt(2.0 * np.pi) * std)
    return np.where(seen_mask[:, None], np.log((1.0 - SLIPS) * normal_density + SLIPS / (2.0 * _REACH)), 0.0)
