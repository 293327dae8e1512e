"""Several views of the axis become one: those that agree are averaged by their stated deviations, rivals are named."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float
from ..path import SPACING
from ..profiles import STRETCH
from ..smoothing import smooth
from .view import View

AGREEING = 2.0
"""Views agree where they lie within so many standard deviations of their difference. Chosen: 95 % of views that see the
same place do."""
APART = 1.0
"""Views that lie farther apart, m, and weigh as much, leave the axis open. Chosen: less than half of a lane, more than
views of one axis scatter by."""
_RIVAL = 0.5
"""Share of the leading views' trust that others together need to be a rival. Chosen: half as trustworthy is still a
doubt."""
_STEADY = 9
"""Stretches over which the lead is judged. Chosen: 45 m, so that it doesn't change at each fault."""
_TRUST = 0.1
"""Distance beside a view's deviation, m. Chosen: the surest isn't trusted above all others together."""
_VAGUE = 0.5
"""Deviation from which on a view leads the less, m. Chosen: what agrees with everything leads nowhere."""
_WAVELENGTH = 60.0
"""Wavelength of which half of the axis' swings is kept, m. Chosen: shorter ones are noise."""
DEFINITION = 0.15
"""Standard deviation, m, of where a road's axis is said to lie about where its markings and edges put it. Chosen: a
line's width, by which markings are laid beside the middle."""
_SAME = 0.3
"""Distance of the axes of two grids that are one place, m. Chosen: three bins."""
_DRIFT = 0.02
"""Way that the axis may leave its course by in a gap, m per m. Chosen: a curve of 600 m does over 25 m."""


@dataclass(frozen=True)
class FusedAxis:
    """The axis that several views agree on, in K stretches along a path.

    Attributes:
        stations: (K,) m along the path.
        offsets: (K,) m; smoothed, bridged where no view sees anything.
        std: (K,) standard deviation, m.
        raw: (K,) m before smoothing; NaN where no view sees anything.
        open: (K,) whether rival views, about as trustworthy together, lie more than `APART` from the axis.
        members: by view's name a mask (K,) of the stretches in which it is averaged into the axis.
        views: the views that were fused.
    """

    stations: Float
    offsets: Float
    std: Float
    raw: Float
    open: Bool
    members: dict[str, Bool]
    views: tuple[View, ...]


def fuse(stations: Float, views: Sequence[View]) -> FusedAxis:
    """Return the axis that views (at least one) agree on at stations (K,), m.

    In each stretch the views that agree with each other and are trusted most, there and in its neighbourhood, lead;
    they are averaged by inverse variances, and the mean's deviation is widened by how much they scatter.
    """
    offsets = np.array([view.offsets for view in views])
    std = np.array([view.std for view in views])
    seen_mask = np.isfinite(offsets)
    # The view leads that those agreeing with it trust most in sum: one alone leads nowhere, however small its
    # deviation.
    agreement = _agreement(offsets, std, seen_mask)
    trust = np.where(seen_mask, 1.0 / (_TRUST + np.where(seen_mask, std, 1.0)), 0.0)
    mass = np.einsum("vwk,wk->vk", agreement.astype(np.float64), trust)
    mass *= np.minimum(1.0, _VAGUE / np.where(seen_mask, std, 1.0))  # what agrees with everything leads nowhere
    smooth_mass = np.where(seen_mask, ndimage.uniform_filter1d(mass, _STEADY, axis=1, mode="nearest"), -1.0)
    leader = smooth_mass.argmax(axis=0)
    columns = np.arange(len(stations))
    member = agreement[leader, :, columns].T & seen_mask
    mean_offsets, deviation = _weighted_mean(offsets, std, member)
    # Rivals weigh by their sum, not one by one: several views may slip to the same place.
    rival_mask = seen_mask & ~member & (np.abs(offsets - mean_offsets) > APART)
    lead, rival = (trust * member).sum(axis=0), (trust * rival_mask).sum(axis=0)
    open_mask = ndimage.binary_opening(rival > _RIVAL * lead, np.ones(3))
    smooth_offsets, smooth_std = _along(stations, mean_offsets, deviation)
    names = {view.name: member[number] for number, view in enumerate(views)}
    return FusedAxis(stations, smooth_offsets, smooth_std, mean_offsets, open_mask, names, tuple(views))


def mean_axis(main_axis: FusedAxis, other_axes: Sequence[FusedAxis]) -> FusedAxis:
    """Return the mean of axes at the same stations that several grids of bins over the same points show.

    Where a line moves by a fraction of a bin, or some points are missing, bins hold other points and the axis in one
    grid jumps. The others count where they lie near the first, whose views, rivals and members stay: where one of them
    slips it has no say. The grids share their points: the mean is as sure as they are on average.
    """
    axes = [main_axis, *other_axes]
    agrees = np.array([np.abs(axis.offsets - main_axis.offsets) <= _SAME for axis in axes])
    raw_offsets = np.array([axis.raw for axis in axes])
    return replace(
        main_axis,
        offsets=_mean_where(agrees, np.array([axis.offsets for axis in axes])),
        std=_mean_where(agrees, np.array([axis.std for axis in axes])),
        raw=np.where(np.isfinite(main_axis.raw), _mean_where(agrees & np.isfinite(raw_offsets), raw_offsets), np.nan),
    )


def _mean_where(mask: Bool, values: Float) -> Float:
    """Return the mean (K,) over the first axis of the values (A, K) in a mask; NaN where there are none."""
    count = mask.sum(axis=0)
    total = np.where(mask, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _agreement(offsets: Float, std: Float, seen_mask: Bool) -> Bool:
    """Return a mask (V, V, K) of the pairs of views that agree in each stretch; each seen one agrees with itself."""
    with np.errstate(invalid="ignore"):
        distance = np.abs(offsets[:, None] - offsets[None])
        largest_distance = AGREEING * np.hypot(std[:, None], std[None])
        return np.asarray(seen_mask[:, None] & seen_mask[None] & (distance <= largest_distance))


def _weighted_mean(offsets: Float, std: Float, member: Bool) -> tuple[Float, Float]:
    """Return the mean of member views (mask (V, K)) by inverse variances, and its standard deviation, (K,) each, m.

    NaN and infinity in stretches without members.
    """
    weight = np.where(member, 1.0 / np.square(np.where(member, std, 1.0)), 0.0)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(total > 0.0, (weight * np.where(member, offsets, 0.0)).sum(axis=0) / total, np.nan)
        square = (weight * np.square(np.where(member, offsets - mean, 0.0))).sum(axis=0)
        # Birge 1932: the mean's variance 1 / sum of w is widened by chi^2 / (n - 1) where that is above 1.
        scatter = square / np.maximum(member.sum(axis=0) - 1, 1)
        return mean, np.sqrt(np.maximum(1.0, scatter) / total)


def _along(stations: Float, offsets: Float, deviation: Float) -> tuple[Float, Float]:
    """Return the smoothed axis (K,), m, and its standard deviation (K,), m, which grows in gaps."""
    seen_mask = np.isfinite(offsets)
    if not seen_mask.any():
        return np.zeros(len(offsets)), np.full(len(offsets), np.inf)
    weights = np.where(seen_mask, 1.0 / np.square(np.where(seen_mask, deviation, 1.0)), 0.0)
    smooth_axis = smooth(offsets, weights, STRETCH * SPACING, _WAVELENGTH, usual_std=0.03)
    # No curve is guessed where nothing was seen.
    values = np.interp(stations, stations[seen_mask], smooth_axis.values[seen_mask])
    # Nothing is known of the course within a gap but its ends: the deviation grows with the distance from these.
    gap = STRETCH * SPACING * ndimage.distance_transform_edt(~seen_mask)
    std = np.interp(stations, stations[seen_mask], deviation[seen_mask])
    residual = np.where(seen_mask, np.abs(np.where(seen_mask, offsets, 0.0) - values), 0.0)
    return values, np.sqrt(std**2 + ndimage.uniform_filter1d(residual, 5) ** 2 + np.square(_DRIFT * gap))
