"""Strips of pavement beside a road's main carriageways: further carriageways, which run along with them, and ramps.

A strip counts where other ground parts it from the road, and only as far as the cloud holds it: an exit's lane is part
of its carriageway until its gore ends.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.special import expit

from ...base.arrays import Bool, Float
from ..edges import Pavement
from ..path import SPACING
from ..profiles import ACROSS, STRETCH, Profiles, median_profile

_NARROWEST = 3.0
"""Width of a strip, m. Chosen: a lane; footways and cycle paths are narrower."""
_GAP = 5
"""Bins of other ground that part a strip from the road. Chosen: half of a metre, more than a seam or a gutter."""
_SEAM = 6
"""Widest gap in a strip that is a seam, a line or a gap between rows of points, bins. Chosen: as `_GAP`, a bin more."""
_ROUGHER = 2.0
"""Times as rough as the road that no pavement is. Chosen: as in `paved`."""
_HELD = 5
"""Bins about a point that the cloud holds. Chosen: the distance of two rows of points."""
_SHORTEST = 3
"""Stretches of a strip. Chosen: 15 m; entrances and lay-bys' mouths are shorter."""
_BRIDGED = 5
"""Stretches over which a strip's gaps are closed. Chosen: 20 m; neither ramps nor carriageways end for less."""
_DIVERGING = (0.03, 0.006)
"""Slope of a strip against the road, m per m, that a ramp has as often as a carriageway, and its scatter. Chosen: a
carriageway sways by a metre in 50 m at most, a ramp leaves by 3 m."""


@dataclass(frozen=True)
class Strip:
    """A strip of pavement beside the road.

    Attributes:
        present: (K,) mask of the stretches in which it is seen.
        probability: (K,) that it is pavement parted from the road there; 0 where it isn't seen.
        ramp: probability that it is a ramp rather than a carriageway: by how it leaves the road.
    """

    present: Bool
    probability: Float
    ramp: float


def find_strips(pavement: Pavement, right: float, left: float) -> list[Strip]:
    """Return the strips of pavement beside a road between two offsets, m, its outer edges.

    Args:
        pavement: cross profiles with their share of pavement.
        right: offset of the road's right edge, m.
        left: offset of its left edge, m.
    """
    profiles = pavement.profiles
    share, known = _share_by_stretch(pavement)
    paved = known & (share > 0.5) | ~known & ndimage.binary_closing(known & (share > 0.5), np.ones((1, _SEAM)))
    mask = _beside(profiles, paved, known & (share < 0.5), right, left)
    mask = ndimage.binary_closing(np.pad(mask, ((_BRIDGED, _BRIDGED), (0, 0))), np.ones((_BRIDGED, 1)))
    label, count = ndimage.label(mask[_BRIDGED:-_BRIDGED], np.ones((3, 3)))
    strips = [_strip(profiles, share, label == number + 1, right, left) for number in range(count)]
    return [strip for strip in strips if strip.present.sum() >= _SHORTEST]


def _share_by_stretch(pavement: Pavement) -> tuple[Float, Bool]:
    """Return the mean share of pavement (K, U) in three stretches about each, and where it is known."""
    stretches = pavement.profiles.stretches
    rows = np.full((stretches * STRETCH, pavement.share.shape[1]), np.nan)
    # The share is blurred beyond where points are.
    is_held = ndimage.maximum_filter(pavement.profiles.count, (1, _HELD)) > 0
    rows[: len(pavement.share)] = np.where(is_held, pavement.share, np.nan)
    blocks = rows.reshape(stretches, STRETCH, -1)
    seen = np.isfinite(blocks).sum(axis=1).astype(np.float64)
    total = np.where(np.isfinite(blocks), blocks, 0.0).sum(axis=1)
    seen, total = (ndimage.uniform_filter1d(values, 3, axis=0, mode="nearest") for values in (seen, total))
    # Chosen: a fifth of the rows, as points may lie in rows along the road.
    known = seen >= 0.2 * STRETCH
    return np.where(known, total / np.maximum(seen, 1e-9), np.nan), known


def _beside(profiles: Profiles, paved: Bool, other: Bool, right: float, left: float) -> Bool:
    """Return a mask (K, U) of the runs of pavement beside the road: as wide as a lane, as smooth as it, parted from it.

    Args:
        profiles: K stretches and U bins across.
        paved, other: (K, U) bins of pavement, and of other ground.
        right, left: offsets of the road's outer edges, m.
    """
    offsets, result = profiles.offsets, np.zeros(paved.shape, dtype=bool)
    step = np.abs(np.diff(profiles.height, axis=1, append=np.nan))
    inside = (offsets > right) & (offsets < left)
    for number, row in enumerate(ndimage.binary_closing(paved, np.ones((1, _SEAM))) & ~_wide_gaps(other)):
        label, count = ndimage.label(row)
        rough = median_profile(step, number)
        limit = _ROUGHER * _median(rough[inside & row])
        for index in range(1, count + 1):
            run = np.flatnonzero(label == index)
            low, high = offsets[run[0]], offsets[run[-1]]
            if (high > right and low < left) or len(run) * ACROSS < _NARROWEST:
                continue
            between = (offsets > high) & (offsets < right) if high <= right else (offsets > left) & (offsets < low)
            if other[number, between].sum() >= _GAP and not _median(rough[run]) > limit:
                result[number, run] = True
    return result


def _wide_gaps(other: Bool) -> Bool:
    """Return a mask (K, U) of other ground that is too wide for a seam."""
    return np.asarray(ndimage.binary_opening(other, np.ones((1, _GAP))))


def _median(values: Float) -> float:
    """Return the median of the known values; NaN without any."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else np.nan


def _strip(profiles: Profiles, share: Float, mask: Bool, right: float, left: float) -> Strip:
    """Return the strip of a mask (K, U): how sure it is in each stretch, and whether it leaves the road."""
    offsets, present = profiles.offsets, mask.any(axis=1)
    stations = STRETCH * SPACING * np.flatnonzero(present)
    probability, distance = np.zeros(len(mask)), []
    for number in np.flatnonzero(present):
        run = offsets[mask[number]]
        is_right = float(np.median(run)) < right
        distance.append(right - run.max() if is_right else run.min() - left)
        gap = (offsets > run.max()) & (offsets < right) if is_right else (offsets > left) & (offsets < run.min())
        paved, unpaved = share[number, mask[number]], 1.0 - share[number, gap]
        means = [
            float(np.mean(values[np.isfinite(values)])) for values in (paved, unpaved) if np.isfinite(values).any()
        ]
        probability[number] = float(np.prod(means)) if len(means) == 2 else 0.5
    slope = float(np.polyfit(stations, distance, 1)[0]) if len(distance) > 1 else 0.0
    middle, scatter = _DIVERGING
    return Strip(present, probability, float(expit((abs(slope) - middle) / scatter)))
