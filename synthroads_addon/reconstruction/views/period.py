"""The markings' period: dashed lines found by the beat of their dashes, however faint their paint.

Along each offset the paint's wave at the usual periods is compared with its scatter, over a window long enough for some
dashes. Of a single carriageway the dashed line between its lanes is the axis; of two carriageways with as many dashed
lines each, the axis lies midway between the innermost two.
"""

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks

from ...base.arrays import Float
from ..path import SPACING
from ..profiles import ACROSS, STRETCH, Grid, Profiles
from .view import View

PERIODS = (18.0, 12.0, 9.0, 6.0)
"""Dash and gap together, m: 6 + 12, 4 + 8 and 6 + 6, 3 + 6, 3 + 3 (RMS)."""
_WINDOW = 90
"""Length of paint whose period is looked for, m. Chosen: five of the longest period."""
_FEWEST_ROWS = 45
"""Rows with points in it. Chosen: half of them."""
_CLEAR = 12.0
"""Power from which on a wave is no noise, whose mean is 1. Chosen: noise exceeds it with a probability of exp(-12) at
each period."""
_WIDTH = 3
"""Bins across that count as one. Chosen: a line and the points beside it."""
_LANE = 2.3
"""Least distance of dashed lines, m. Chosen: a lane, as in `layout`."""
_RIVAL = 0.5
"""Share of the best's power from which on another dashed line leaves a single carriageway's axis open. Chosen: as of
fused views."""
_FLOOR = 0.12
"""Deviation of a dashed line from the axis where nothing scatters, m. Chosen: a line's width."""
_TURN = 0.01
"""Way that a path may leave the line by beside a window's middle, at the ends, m per m. Chosen: half of what a gap may
hide."""


def view_period(profiles: Profiles, dual: bool, middle: float) -> View:
    """Return the view of the axis by the dashed lines' period in windows of `_WINDOW` rows.

    Near the road's ends a window isn't centred on its stretch: its line is that of a place farther on, and says
    little of where a path turns off.

    Args:
        profiles: along a path parallel to the road.
        dual: whether the road has two carriageways.
        middle: rough offset of the median, or of a single carriageway's middle, m.
    """
    rows, paint = len(profiles.stations), _widened(profiles.paint)
    offsets, window_distance = np.full(profiles.stretches, np.nan), np.zeros(profiles.stretches)
    for number in range(profiles.stretches):
        centre = number * STRETCH + STRETCH // 2
        first_row = int(np.clip(centre - _WINDOW // 2, 0, max(0, rows - _WINDOW)))
        window = slice(first_row, min(rows, first_row + _WINDOW))
        power = dash_power(paint[window], profiles.stations[window])
        offsets[number] = _axis_of(power, profiles.offsets, dual, middle)
        window_distance[number] = SPACING * abs(centre - 0.5 * (window.start + window.stop - 1))
    return View.of("marking period", offsets, _FLOOR, _TURN * window_distance)


def _widened(paint: Grid) -> Float:
    """Return the paint (S, U) clipped to 0 to 1 and averaged over the known of `_WIDTH` bins across; NaN if none."""
    has_points = np.isfinite(paint)
    size = (1, _WIDTH)
    total = ndimage.uniform_filter(np.where(has_points, np.clip(paint, 0.0, 1.0), 0.0).astype(np.float64), size)
    share = ndimage.uniform_filter(has_points.astype(np.float64), size)
    return np.where(share > 0.5 / _WIDTH, total / np.maximum(share, 1e-9), np.nan)


def dash_power(paint: Float, stations: Float) -> Float:
    """Return the power (U,) of the paint's wave at the best of the usual periods, by offset; of noise its mean is 1.

    Args:
        paint: (R, U) share of paint; NaN where unknown.
        stations: (R,) m.
    """
    has_points = np.isfinite(paint)
    count = has_points.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(has_points, paint, 0.0).sum(axis=0) / count
        centred_paint = np.where(has_points, paint - mean, 0.0)
        variance = np.maximum((centred_paint**2).sum(axis=0) / count, 1e-4)
        # Schuster 1898: the periodogram |sum of (x - mean) exp(-2 pi i s / T)|^2 over n times the variance, which of
        # noise is exponentially distributed with the mean 1.
        waves = np.exp(-2j * np.pi * stations[None, :] / np.array(PERIODS)[:, None])
        power = np.abs(waves @ centred_paint) ** 2 / (count * variance)
    return np.where(count >= _FEWEST_ROWS, power.max(axis=0), 0.0)


def _axis_of(power: Float, offsets: Float, dual: bool, middle: float) -> float:
    """Return the axis' offset, m, by the dashed lines at the peaks of a power (U,); NaN where they show none.

    Args:
        power: (U,) by offset, see `dash_power`.
        offsets: (U,) m.
        dual: whether the road has two carriageways.
        middle: rough offset of the axis, m.
    """
    blurred = ndimage.gaussian_filter1d(power, 1.0)
    peaks = find_peaks(blurred, height=_CLEAR, distance=round(_LANE / ACROSS))[0]
    line_offsets = [_centre_of_peak(blurred, line_offset, offsets) for line_offset in peaks]
    if not dual:
        if not len(peaks):
            return np.nan
        # Dashes on both sides of a lane beat alike: which of two is the axis the beat doesn't tell.
        order = np.argsort(-blurred[peaks])
        if len(order) > 1 and blurred[peaks[order[1]]] > _RIVAL * blurred[peaks[order[0]]]:
            return np.nan
        return line_offsets[int(order[0])]
    right_lines = [line_offset for line_offset in line_offsets if line_offset < middle]
    left_lines = [line_offset for line_offset in line_offsets if line_offset > middle]
    if not right_lines or len(right_lines) != len(left_lines):
        return np.nan
    return 0.5 * (max(right_lines) + min(left_lines))


def _centre_of_peak(values: Float, peak_bin: int, offsets: Float) -> float:
    """Return the centre of gravity, m, of a peak's bins."""
    bins = slice(max(0, peak_bin - 3), peak_bin + 4)
    return float(np.average(offsets[bins], weights=np.maximum(values[bins], 1e-9)))
