"""Levels of the ground in strips along the road: medians of brightness, height or roughness in each stretch."""

import numpy as np

from ...base.arrays import Bool, Float
from ..profiles import ACROSS, STRETCH, Grid, Profiles

_FEWEST = 4
"""Bins of a stretch that its ground's level is told from. Chosen: less than a tenth of a strip's."""


def median_level(profiles: Profiles, values: Grid | Float, low: Float, high: Float) -> Float:
    """Return the median (K,) of values (S, U) between offsets (K,), m, in each stretch; NaN where hardly seen."""
    result = np.full(profiles.stretches, np.nan)
    for number in np.flatnonzero(np.isfinite(low) & np.isfinite(high)):
        first, last = profiles.column(float(low[number])), profiles.column(float(high[number]))
        if last - first + 1 < 2 or abs(profiles.offsets[last] - high[number]) > 2.0 * ACROSS:
            continue
        bins = values[number * STRETCH : (number + 1) * STRETCH, first : last + 1]
        known: Bool = np.isfinite(bins)
        if known.sum() >= _FEWEST:
            result[number] = float(np.median(bins[known]))
    return result
