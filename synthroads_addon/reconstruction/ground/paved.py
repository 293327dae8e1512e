"""Pavement told from other ground by brightness, and the strips that are paved along the road."""

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float, otsu_threshold
from ..edges import Pavement
from ..lines import Line, is_dashed
from ..profiles import ACROSS, Grid, Profiles
from ..smoothing import robust_scale
from .levels import median_level

_NARROWEST_BAND = 3.0
"""Width of a strip of pavement, m. Chosen: a lane."""
_AROUND_DASHES = (0.4, 1.4)
"""Distances beside a lane line that are pavement for sure, m. Chosen: off the paint, within a lane's half."""
_BESIDE_LINE = ((-1.4, -0.4), (0.4, 1.4))
"""Distances from a line's middle, m, of the ground on its right and its left. Chosen: off the paint, within half of a
lane."""
_LIKE = 4.0
"""Times the pavement's own spread of brightness that other ground is off at least. Chosen: Otsu's method parts any
histogram, a pavement's as well."""
_BLUR = (6.0, 1.0)
"""Standard deviations of the brightness' blur, bins along and across. Chosen: some metres along the road, where
pavement changes little, and less than a line across it."""
_PAINT = 9
"""Widest strip of paint, bins. Chosen: double lines fit in 0.9 m."""
_COVERED = 0.3
"""Share of the road on which a bin must have points to belong to a strip. Chosen: bins between rows of points are often
empty."""
_CRACK = 0.3
"""Gaps in the pavement that are closed to either side, m. Chosen: seams and bins between rows of points; a median is
wider."""
_LEVEL_BLUR = 10.0
"""Standard deviation of the blur of the pavement's brightness along the road, m. Chosen: single cars and stains vanish
in it."""
_ROUGHER = 2.0
"""Times as rough as the smoothest ground beside lines that no pavement is. Chosen: grass and soil are twice to five
times as rough, patches and ruts less."""
_SMOOTH = 0.004
"""Step from bin to bin, m, that counts as smooth at least. Chosen: the best scanners' noise."""


def lines_on_pavement(profiles: Profiles, lines: list[Line]) -> list[Line]:
    """Return the lines that have smooth ground on one side at least: bright strips in grass and soil are no paint."""
    if not lines:
        return []
    step = np.abs(np.diff(profiles.height, axis=1, append=np.nan))
    places = [[(line.offsets + start, line.offsets + end) for start, end in _BESIDE_LINE] for line in lines]
    roughness = np.full((len(lines), 2), np.inf)
    for row, sides in enumerate(places):
        for side, (low, high) in enumerate(sides):
            levels = median_level(profiles, step, low, high)
            if np.isfinite(levels).any():
                roughness[row, side] = float(np.nanmedian(levels))
    smoother = roughness.min(axis=1)
    # Where no height is known around a line nothing speaks against it.
    known = np.isfinite(smoother)
    if not known.any():
        return lines
    largest = _ROUGHER * max(float(smoother[known].min()), _SMOOTH)
    return [line for line, value in zip(lines, smoother, strict=True) if not np.isfinite(value) or value <= largest]


def paved_spans(pavement: Pavement) -> list[tuple[float, float]]:
    """Return the right and left edge, m, of each strip that is paved along most of the road and as wide as a lane."""
    profiles, has_points = pavement.profiles, np.isfinite(pavement.share)
    rows = has_points.sum(axis=0)
    share = np.where(has_points, pavement.share, 0.0).sum(axis=0) / np.maximum(rows, 1)
    strip = (share > 0.5) & (rows > _COVERED * profiles.covered_length)
    strip = ndimage.binary_closing(strip, iterations=round(_CRACK / ACROSS))
    columns = [part[0] for part in ndimage.find_objects(ndimage.label(strip)[0])]
    spans = [(profiles.offsets[c.start] - ACROSS / 2, profiles.offsets[c.stop - 1] + ACROSS / 2) for c in columns]
    return [
        (float(right_edge), float(left_edge))
        for right_edge, left_edge in spans
        if left_edge - right_edge >= _NARROWEST_BAND
    ]


def paved_by_brightness(profiles: Profiles, lines: list[Line]) -> Grid:
    """Return a mask of pavement (S, U), 1 or 0, by brightness alike that near the lane lines; NaN without points.

    Pavement is what is about as bright as the strips on both sides of the lane lines, after a blur of some metres:
    grass, soil and gravel are mostly brighter. Without a dashed line it is as bright as the smoother of two kinds of
    ground. Otsu's threshold parts the differences from that brightness, if there are two kinds of them; if not, all is
    pavement.
    """
    brightness = _blur(profiles.brightness)
    has_points = np.isfinite(brightness)
    everywhere = np.where(has_points, 1.0, np.nan).astype(np.float32)
    if any(is_dashed(line) for line in lines):
        reference = _bins_beside(profiles, _lane_lines(lines)) & has_points
    else:
        reference = _smoother_ground(profiles, brightness.astype(np.float64))
    if not reference.any():
        return everywhere
    difference = np.abs(brightness - _level_along(brightness, reference)[:, None])
    threshold = otsu_threshold(np.asarray(difference[has_points], dtype=np.float64))
    pavement = float(np.median(difference[has_points & (difference <= threshold)]))
    other_ground = float(np.median(difference[has_points & (difference > threshold)]))
    # Otsu's method splits any histogram: the parts are two kinds of ground only if they lie clearly apart.
    if other_ground - pavement < _LIKE * robust_scale(difference[reference]):
        return everywhere
    # Paint is brighter than the threshold, but lies on pavement: narrow gaps across are closed.
    mask = ndimage.grey_closing(np.where(has_points, difference <= threshold, 0.0), size=(1, _PAINT))
    return np.where(has_points, mask, np.nan).astype(np.float32)


def _bins_beside(profiles: Profiles, lines: list[Line]) -> Bool:
    """Return a mask (S, U) of the bins to both sides of lines, within the distances of `_AROUND_DASHES`."""
    mask = np.zeros(profiles.brightness.shape, dtype=bool)
    rows = np.arange(len(profiles.stations))
    for line in lines:
        offset = np.interp(profiles.stations, line.stations, line.offsets, left=np.nan, right=np.nan)
        for start, end in ((-_AROUND_DASHES[1], -_AROUND_DASHES[0]), _AROUND_DASHES):
            for shift in np.arange(start, end + 1e-9, ACROSS):
                column = np.rint((offset + shift - profiles.offsets[0]) / ACROSS)
                in_grid = np.isfinite(column) & (column >= 0) & (column < len(profiles.offsets))
                mask[rows[in_grid], column[in_grid].astype(np.int64)] = True
    return mask


def _level_along(brightness: Grid, reference: Bool) -> Float:
    """Return the mean brightness (S,) of a row's reference bins (mask (S, U)), smoothed and bridged along the road."""
    count = np.maximum(reference.sum(axis=1), 1)
    mean_brightness = np.where(reference, brightness, 0.0).sum(axis=1) / count
    has_reference = reference.any(axis=1)
    rows = np.arange(len(mean_brightness))
    mean_brightness = np.interp(rows, rows[has_reference], mean_brightness[has_reference])
    return np.asarray(ndimage.gaussian_filter1d(mean_brightness, _LEVEL_BLUR, mode="nearest"))


def _smoother_ground(profiles: Profiles, brightness: Float) -> Bool:
    """Return a mask (S, U) of the smoother one of dark and bright ground; of all bins with points if these are few."""
    has_points = np.isfinite(brightness)
    if has_points.sum() < 2:
        return has_points
    dark_ground = has_points & (brightness <= otsu_threshold(np.asarray(brightness[has_points], dtype=np.float64)))
    bright_ground = has_points & ~dark_ground
    step = np.abs(np.diff(profiles.height, axis=1, append=np.nan))
    roughness = [
        float(np.median(of_kind)) if len(of_kind := step[kind & np.isfinite(step)]) else np.inf
        for kind in (dark_ground, bright_ground)
    ]
    return dark_ground if roughness[0] <= roughness[1] else bright_ground


def _lane_lines(lines: list[Line]) -> list[Line]:
    """Return the long dashed lines, or just the longest line if none is dashed."""
    dashed = [line for line in lines if is_dashed(line)]
    longest = max((line.length for line in dashed), default=0.0)
    return [line for line in dashed if line.length > 0.5 * longest] or sorted(lines, key=lambda item: -item.length)[:1]


def _blur(values: Grid) -> Grid:
    """Return values (S, U) blurred by a Gaussian over bins with points; NaN where there are hardly any around."""
    has_points = np.isfinite(values)
    weight = ndimage.gaussian_filter(has_points.astype(np.float32), _BLUR)
    mean = ndimage.gaussian_filter(np.where(has_points, values, 0.0).astype(np.float32), _BLUR)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Chosen: points in 5 % of the blur's reach tell its value.
        return np.where(weight > 0.05, mean / weight, np.nan)
