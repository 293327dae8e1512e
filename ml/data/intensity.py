"""Intensities as a model sees them: alike from scanners of any gain, range and compression.

Raw intensities fall with the square of the range, so that a vehicle's scanner sees the lane below it a hundred times as
bright as the next carriageway; others are delivered corrected, or squeezed by a power. What all have in common is that
a line is brighter than what lies beside it. So there are two features, both of logarithms, in which a gain is a shift
and a power a factor: the `level` on the whole, and the `contrast` to what is around.
"""

import numpy as np

from synthroads_addon.base.arrays import Float

DARKEST = 0.01
"""Share of the median intensity to which smaller intensities are raised."""
_BIN = 0.5
"""Width across the road over which a median is taken, m."""
_AROUND = 3
"""Bins to either side over whose medians the local level is a median: wider than any line, narrower than a lane."""
QUIETEST = 0.15
"""Least noise, as a share of the distance of the logarithms' 10th and 90th percentiles."""
_SPREAD_20_80 = 1.683
"""Distance of a Gaussian's 20th and 80th percentiles, in deviations."""
_SMALLEST = 1e-3
"""Least spread of logarithms by which they are divided."""


def logarithms(intensity: Float) -> Float:
    """Return natural logarithms (K,) of intensities (K,) >= 0, floored at `DARKEST` times their positive median."""
    positive = intensity[intensity > 0.0]
    floor = DARKEST * float(np.median(positive)) if len(positive) else 1.0
    result: Float = np.log(np.maximum(intensity, floor))
    return result


def level(logs: Float) -> Float:
    """Return logarithms (K,) minus their median, divided by their spread from the 10th to the 90th percentile."""
    return (logs - float(np.median(logs))) / max(_decile_spread(logs), _SMALLEST)


def _decile_spread(logs: Float) -> float:
    """Return the distance of the 10th and the 90th percentile of logarithms."""
    lower_decile, upper_decile = np.percentile(logs, (10.0, 90.0))
    return float(upper_decile - lower_decile)


def contrast(logs: Float, y: Float) -> Float:
    """Return logarithms (K,) minus the local median across the road, divided by a robust estimate of their noise.

    The noise is that of a Gaussian with the same 20th and 80th percentiles: lines are too few to matter. It counts as
    `QUIETEST` where there is less.

    Args:
        logs: (K,) logarithms of the intensities of a sequence's points.
        y: (K,) their places across the road, m.
    """
    cell = np.floor(y / _BIN).astype(np.intp)
    first_bin = int(cell.min())
    cell -= first_bin
    order = np.lexsort((logs, cell))
    counts = np.bincount(cell)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    # The lower median, of the bins that have points.
    has_points = counts > 0
    medians = np.full(len(counts) + 2 * _AROUND, np.nan)
    medians[_AROUND:-_AROUND][has_points] = logs[order[starts[has_points] + (counts[has_points] - 1) // 2]]
    windows = np.lib.stride_tricks.sliding_window_view(medians, 2 * _AROUND + 1)[has_points]
    smooth_medians = np.nanmedian(windows, axis=1)
    local_level = np.interp(y, _BIN * (first_bin + np.flatnonzero(has_points) + 0.5), smooth_medians)
    excess = logs - local_level
    lower_quintile, upper_quintile = np.percentile(excess, (20.0, 80.0))
    return excess / max(
        float(upper_quintile - lower_quintile) / _SPREAD_20_80, QUIETEST * max(_decile_spread(logs), _SMALLEST)
    )
