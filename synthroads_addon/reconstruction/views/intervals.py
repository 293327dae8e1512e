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
_EVIDENCE |= {"cross-profile": "ground", "edges": "ground"}
_REACH, _STEP = 8.0, 0.05
"""Distance to either side in which the axis may lie, and from one place to the next, m. Chosen: two lanes; a third of
`fusion.DEFINITION`."""


def half_width(axis: FusedAxis, share: float, factor: float, more: float = 0.0) -> Float:
    """Return half-widths (K,), m, about the fused axis of the intervals that hold the true one with a probability.

    They are never narrower than the axis' own deviation says, and only that where nothing is seen.

    Args:
        axis: with its views.
        share: the probability.
        factor: standard deviations that hold it of a normal distribution.
        more: standard deviation, m, of one more error that all of the axis has.
    """
    minimum = factor * np.hypot(axis.std, more)
    seen = np.any([np.isfinite(view.offsets) for view in axis.views], axis=0)
    if not seen.any():
        return minimum
    # One more independent error: densities convolve.
    density = ndimage.gaussian_filter1d(_density(axis), max(more, 1e-3) / _STEP, axis=1, mode="constant")
    density /= density.sum(axis=1, keepdims=True)
    return np.where(seen, np.maximum(minimum, _quantile(density, share)), minimum)


def _quantile(density: Float, share: float) -> Float:
    """Return how far (K,), m, to both sides of the middle a share of densities (K, P) lies."""
    middle = density.shape[1] // 2
    # The interval is the same to both sides: shares are added up from the middle outwards.
    pairs = density[:, middle + 1 :] + density[:, middle - 1 :: -1]
    within = np.cumsum(np.column_stack([np.zeros(len(density)), density[:, middle], pairs]), axis=1)
    behind = np.maximum((within < share).argmin(axis=1), 1)[:, None]  # the first place by which it is reached
    low, high = (np.take_along_axis(within, behind - step, axis=1)[:, 0] for step in (1, 0))
    return np.maximum(_STEP * (behind[:, 0] - 1.5 + (share - low) / (high - low)), 0.0)


def _density(axis: FusedAxis) -> Float:
    """Return how likely (K, P) the axis lies at places beside the fused one, up to a factor by stretch."""
    place = np.arange(-round(_REACH / _STEP), round(_REACH / _STEP) + 1) * _STEP
    result = np.zeros((len(axis.offsets), len(place)))
    kinds = [_EVIDENCE.get(view.name, view.name) for view in axis.views]
    for kind in dict.fromkeys(kinds):
        same = [view for view, other in zip(axis.views, kinds, strict=True) if other == kind]
        # Views of one kind of evidence slip together: the mean of their logarithms counts as one view.
        known = np.sum([np.isfinite(view.offsets) for view in same], axis=0)
        result += (
            np.sum([_likelihood(view, axis.offsets, place) for view in same], axis=0) / np.maximum(known, 1)[:, None]
        )
    return np.exp(result - result.max(axis=1, keepdims=True))


def _likelihood(view: View, at: Float, place: Float) -> Float:
    """Return the logarithm of a view's likelihood (K, P) of places, m, about an axis (K,); 0 where it sees nothing."""
    seen = np.isfinite(view.offsets)
    std = np.where(seen, view.std, 1.0)[:, None]
    z = (place - np.where(seen, view.offsets - at, 0.0)[:, None]) / std
    # p = (1 - slips) N(place; offset, std) + slips / (2 reach): the tail keeps a single view from ruling a place out.
    right = np.exp(-0.5 * z**2) / (np.sqrt(2.0 * np.pi) * std)
    return np.where(seen[:, None], np.log((1.0 - SLIPS) * right + SLIPS / (2.0 * _REACH)), 0.0)
