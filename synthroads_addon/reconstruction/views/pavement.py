"""The pavement looked for without lines and without classes: by brightness, and by steps of the ground.

It is what is about as bright as the ground on the supposed lanes, and ends where the brightness changes for more than a
crack or the ground steps up or down.
"""

import warnings
from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float, otsu_threshold
from ..profiles import ACROSS, STRETCH, Grid, Profiles
from ..smoothing import fill_gaps, robust_scale
from .view import View

_ROWS = 10
"""Distance along the road to either side of a stretch's middle that its median profile is taken from, m. Chosen: cars
and stains are shorter."""
_CORE = 1.5
"""Distance to either side of a carriageway's middle that is pavement if anything is, m. Chosen: a lane."""
_PAINT = 11
"""Widest bright strip that is paint, bins. Chosen: double lines."""
_KERB, _KERB_REACH = 0.05, 3
"""Height that a kerb rises by, m, and bins to either side of it. Chosen: the lowest kerbs; over 0.6 m a crossfall of 8
% rises by less."""
_CRACK = 9
"""Widest gap in the pavement, or in the median, that is a crack or a seam, bins. Chosen: a median is wider."""
_PATCH = 5
"""Stretches in which what differs from the ground before and behind it is a patch, a stain, an entrance. Chosen: 25
m."""
_FEWEST_ROWS = 3
"""Rows with points of a median. Chosen: of fewer it is a single car's or stain's."""
_BEYOND = 6
"""Bins beyond an edge, half of which must be known. Chosen: else the cloud ends there, not the pavement."""
_LIKE = 4.0
"""Times the pavement's own spread of brightness that other ground is off at least. Chosen: as in `layout`."""
_FLOOR = 0.25
"""Deviation of the pavement's middle from the axis where nothing scatters, m. Chosen: shoulders of two sides differ by
as much."""


def view_brightness(profiles: Profiles, cores: Sequence[float], dual: bool) -> View:
    """Return the view of the pavement's middle, or of the middle between two carriageways, by brightness and height."""
    right, left = pavement_edges(profiles, cores, dual, float(np.mean(cores)))
    return View.of("brightness", 0.5 * (right + left), _FLOOR)


def pavement_edges(profiles: Profiles, cores: Sequence[float], dual: bool, at: float = 0.0) -> Float:
    """Return the right and left edge (2, K), m, of the pavement or median at a place, found without lines or classes.

    They are found by brightness and height alone; NaN where an edge isn't seen.

    Args:
        profiles: along a path parallel to the road.
        cores: offsets of the carriageways' middles, m, about which is pavement if anywhere.
        dual: whether what lies between two carriageways is wanted, in place of the pavement itself.
        at: offset that the pavement or median lies about, m.
    """
    stretches, height = range(profiles.stretches), remove_grade(profiles.height)
    brightness = np.array([median_profile(profiles.brightness, number) for number in stretches])
    steps = np.array([_is_kerb(median_profile(height, number)) for number in stretches])
    known = np.isfinite(brightness)
    core = np.any([np.abs(profiles.offsets - middle) < _CORE for middle in cores], axis=0)
    filled = np.array([fill_gaps(row) if np.isfinite(row).any() else row for row in brightness])
    smooth = ndimage.median_filter(filled, (1, _PAINT))
    # Paint and wear are brighter than the pavement: a low percentile of the core is its own brightness.
    levels = np.array([np.percentile(row[core], 30) if np.isfinite(row).all() else np.nan for row in smooth])
    difference = np.abs(smooth - levels[:, None])
    alike = known & ~(difference > _brightness_threshold(difference[known], difference[:, core]))
    inside = _without_patches(_close_cracks(alike) & ~steps)
    if dual:
        inside = _close_cracks(known & ~inside)
    return np.array([_run_at(profiles, row, seen, at) for row, seen in zip(inside, known, strict=True)]).T


def median_profile(values: Grid | Float, stretch: int) -> Float:
    """Return the median profile (U,) of the rows about a stretch's middle; NaN where too few have points."""
    middle = stretch * STRETCH + STRETCH // 2
    rows = values[max(0, middle - _ROWS) : middle + _ROWS + 1].astype(np.float64)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # bins without points
        median = np.nanmedian(rows, axis=0)
    return np.where(np.isfinite(rows).sum(axis=0) >= _FEWEST_ROWS, median, np.nan)


def remove_grade(height: Grid) -> Float:
    """Return heights (S, U) less their row's median, which removes the road's grade."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without points
        return np.asarray(height - np.nanmedian(height, axis=1)[:, None], dtype=np.float64)


def _is_kerb(height: Float) -> Bool:
    """Return a mask (U,) of a profile's bins at which the ground steps up or down by more than a crossfall would."""
    if not np.isfinite(height).any():
        return np.zeros(len(height), dtype=bool)
    filled = ndimage.median_filter(fill_gaps(height), 3)
    # The rise over several bins: a kerb's face may be hidden, and its two levels lie some bins apart.
    rise = np.roll(filled, -_KERB_REACH) - np.roll(filled, _KERB_REACH)
    rise[:_KERB_REACH], rise[-_KERB_REACH:] = 0.0, 0.0
    return np.asarray(np.abs(rise) > _KERB)


def _brightness_threshold(difference: Float, core: Float) -> float:
    """Return the threshold of brightness differences beyond which ground is unpaved; inf if brightness can't tell."""
    difference, core = difference[np.isfinite(difference)], core[np.isfinite(core)]
    if not len(difference) or not len(core):
        return np.inf
    reach = otsu_threshold(difference)
    other = difference[difference > reach]
    clear = len(other) > 0 and float(np.median(other)) > _LIKE * robust_scale(core)
    return reach if clear else np.inf


def _close_cracks(inside: Bool) -> Bool:
    """Return a mask (K, U) with gaps that are narrow across the road closed."""
    across = np.ones((1, _CRACK))
    return ndimage.binary_erosion(ndimage.binary_dilation(inside, across), across, border_value=1)


def _without_patches(inside: Bool) -> Bool:
    """Return a mask (K, U) without gaps and spots that are shorter along the road than any change of its width.

    Repairs and oil make pavement look like a verge, and entrances a verge like pavement, but for a few metres.
    """
    along, ends = np.ones((_PATCH, 1)), ((_PATCH, _PATCH), (0, 0))
    closed = ndimage.binary_closing(np.pad(inside, ends, mode="edge"), along)
    return np.asarray(ndimage.binary_opening(closed, along)[_PATCH:-_PATCH])


def _run_at(profiles: Profiles, inside: Bool, known: Bool, at: float) -> tuple[float, float]:
    """Return right and left end, m, of the run of bins (U,) nearest to an offset (m); NaN where the cloud ends it."""
    label, _ = ndimage.label(inside)
    near = label[(np.abs(profiles.offsets - at) < _CORE) & inside]
    if not len(near):
        return np.nan, np.nan
    run = np.flatnonzero(label == np.bincount(near).argmax())
    first, last = int(run[0]), int(run[-1])
    right, left = profiles.offsets[first] - 0.5 * ACROSS, profiles.offsets[last] + 0.5 * ACROSS
    right_seen = 2 * known[max(0, first - _BEYOND) : first].sum() >= _BEYOND
    left_seen = 2 * known[last + 1 : last + 1 + _BEYOND].sum() >= _BEYOND
    return float(right) if right_seen else np.nan, float(left) if left_seen else np.nan
