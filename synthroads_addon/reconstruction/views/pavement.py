"""The pavement looked for without lines and without classes: by brightness, and by steps of the ground.

It is what is about as bright as the ground on the supposed lanes, and ends where the brightness changes for more than a
crack or the ground steps up or down.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float, otsu_threshold
from ..profiles import ACROSS, ROWS, STRETCH, Profiles, median_of_rows, median_profile, remove_grade
from ..smoothing import bisquare, fill_gaps, robust_scale
from .view import View

_CORE = 1.5
"""Distance to either side of a carriageway's middle that is pavement if anything is, m. Chosen: a lane."""
_PAINT = 11
"""Widest bright strip that is paint, bins. Chosen: double lines."""
_KERB, _KERB_REACH = 0.05, 3
"""Height that a kerb rises by, m, and bins to either side of it. Chosen: the lowest kerbs; over 0.6 m a crossfall of 8
% rises by less."""
_FEWEST_BINS, _ROUNDS, _LEAST_SCATTER = 40, 3, 1e-3
"""Bins that the pavement's plane is told from at least, rounds of iteratively reweighted least squares, and scatter, m,
that no pavement is below. Chosen: ten for each coefficient; a car on the lane has no weight after them; texture."""
_CRACK = 9
"""Widest gap in the pavement that is a crack or a seam, bins. Chosen: a median is wider."""
_RAIL = 20
"""Widest strip without points, bins, that is rails or a wall cut out of the median. Chosen: two guardrails and the
ground between."""
_NO_LANE = 23
"""Strip between two parts of a median that is no carriageway, bins. Chosen: no lane of RAA or RAL is as narrow."""
_NARROWEST = 0.8
"""Width of a median, m, at least. Chosen: a concrete barrier on its own, as in `layout`; a kerb's step is seen over 0.6
m, with the same ground on both sides it is none."""
_PATCH = 5
"""Stretches in which what differs from the ground before and behind it is a patch, a stain, an entrance. Chosen: 25
m."""
_BEYOND = 6
"""Bins beyond an edge, half of which must be known. Chosen: else the cloud ends there, not the pavement."""
_LIKE = 4.0
"""Times the pavement's own spread of brightness that other ground is off at least. Chosen: as in `ground.paved`."""
_FLOOR = 0.25
"""Deviation of the pavement's middle from the axis where nothing scatters, m. Chosen: shoulders of two sides differ by
as much."""


def view_brightness(profiles: Profiles, cores: Sequence[float], dual: bool) -> View:
    """Return the view of the pavement's middle, or of the middle between two carriageways, by brightness and height."""
    right_edge, left_edge = pavement_edges(profiles, cores, dual, float(np.mean(cores)))
    return View.of("brightness", 0.5 * (right_edge + left_edge), _FLOOR)


def pavement_edges(profiles: Profiles, cores: Sequence[float], dual: bool, offset: float = 0.0) -> Float:
    """Return the right and left edge (2, K), m, of the pavement or median at an offset, without lines or classes.

    Edges are found by brightness and height alone; NaN where an edge isn't seen.

    Args:
        profiles: along a path parallel to the road.
        cores: offsets of the carriageways' middles, m, around which is surely pavement.
        dual: whether the median's edges are returned, in place of the pavement's.
        offset: offset that the pavement or median lies around, m.
    """
    brightness = np.array([median_profile(profiles.brightness, number) for number in range(profiles.stretches)])
    steps = _steps(profiles, cores)
    has_points = np.isfinite(brightness)
    core = np.any([np.abs(profiles.offsets - middle) < _CORE for middle in cores], axis=0)
    filled_brightness = np.array([fill_gaps(row) if np.isfinite(row).any() else row for row in brightness])
    paintless_brightness = ndimage.median_filter(filled_brightness, (1, _PAINT))
    # Paint and wear are brighter than the pavement: a low percentile of the core is its own brightness.
    levels = np.array(
        [np.percentile(row[core], 30) if np.isfinite(row).all() else np.nan for row in paintless_brightness]
    )
    difference = np.abs(paintless_brightness - levels[:, None])
    is_pavement = has_points & ~(difference > _brightness_threshold(difference[has_points], difference[:, core]))
    band_mask = _without_patches(_close(is_pavement, _CRACK) & ~steps)
    if dual:
        in_cloud = _close(has_points, _RAIL)
        band_mask = _close(in_cloud & ~band_mask, _NO_LANE) & in_cloud
    edges = np.array(
        [
            _run_at(profiles, row, row_has_points, offset)
            for row, row_has_points in zip(band_mask, has_points, strict=True)
        ]
    ).T
    if dual:
        edges[:, edges[1] - edges[0] < _NARROWEST] = np.nan
    return edges


def _steps(profiles: Profiles, cores: Sequence[float]) -> Bool:
    """Return a mask (K, U) of the bins at which the ground steps up or down from the plane of the nearest carriageway.

    A crossfall of 5 % alone rises by 3 cm over the reach of a kerb, and a grade scatters the heights of a stretch.
    """
    nearest_core = np.abs(profiles.offsets - np.array(cores)[:, None]).argmin(axis=0)
    rough_height = remove_grade(profiles.height)
    steps = np.zeros((profiles.stretches, len(profiles.offsets)), dtype=bool)
    for number in range(profiles.stretches):
        middle_row = number * STRETCH + STRETCH // 2
        rows = slice(max(0, middle_row - ROWS), middle_row + ROWS + 1)
        for index, core in enumerate(cores):
            above_plane = _above_plane(profiles, rows, core)
            height = median_profile(rough_height, number) if above_plane is None else median_of_rows(above_plane)
            steps[number] |= _is_kerb(height) & (nearest_core == index)
    return steps


def _above_plane(profiles: Profiles, rows: slice, core: float) -> Float | None:
    """Return the heights (R, U), m, of some rows above the pavement about a core, m; None if too little of it is seen.

    The pavement is a robust surface h = a + b u + c s + d s^2: plane across the road, curved along it.
    """
    height = profiles.height[rows].astype(np.float64)
    station = (profiles.stations[rows] - profiles.stations[rows].mean()) / ROWS
    across = profiles.offsets - core
    terms = np.stack(
        [np.broadcast_to(term, height.shape) for term in (1.0, across, station[:, None], station[:, None] ** 2)],
        axis=-1,
    )
    on_core = np.isfinite(height) & (np.abs(across) < _CORE)
    if on_core.sum() < _FEWEST_BINS:
        return None
    matrix, value = terms[on_core], height[on_core]
    weight, solution = np.ones(len(value)), np.zeros(matrix.shape[1])
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)
        solution = np.linalg.lstsq(matrix * root[:, None], value * root, rcond=None)[0]
        residual = value - matrix @ solution
        weight = bisquare(residual, max(robust_scale(residual), _LEAST_SCATTER))
    return np.asarray(height - terms @ solution)


def _is_kerb(height: Float) -> Bool:
    """Return a mask (U,) of a profile's bins at which the ground steps up or down by more than a crossfall would."""
    if not np.isfinite(height).any():
        return np.zeros(len(height), dtype=bool)
    smooth_height = ndimage.median_filter(fill_gaps(height), 3)
    # The rise over several bins: a kerb's face may be hidden, and its two levels lie some bins apart.
    rise = np.roll(smooth_height, -_KERB_REACH) - np.roll(smooth_height, _KERB_REACH)
    rise[:_KERB_REACH], rise[-_KERB_REACH:] = 0.0, 0.0
    return np.asarray(np.abs(rise) > _KERB)


def _brightness_threshold(difference: Float, core: Float) -> float:
    """Return the threshold of brightness differences beyond which ground is unpaved; inf if brightness can't tell."""
    difference, core = difference[np.isfinite(difference)], core[np.isfinite(core)]
    if not len(difference) or not len(core):
        return np.inf
    threshold = otsu_threshold(difference)
    other_ground = difference[difference > threshold]
    is_distinct = len(other_ground) > 0 and float(np.median(other_ground)) > _LIKE * robust_scale(core)
    return threshold if is_distinct else np.inf


def _close(mask: Bool, width: int) -> Bool:
    """Return a mask (K, U) with gaps of at most a width, bins, across the road closed."""
    window = np.ones((1, width))
    return ndimage.binary_erosion(ndimage.binary_dilation(mask, window), window, border_value=1)


def _without_patches(mask: Bool) -> Bool:
    """Return a mask (K, U) without gaps and spots that are shorter along the road than any change of its width.

    Repairs and oil make pavement look like a verge, and entrances a verge like pavement, but for a few metres.
    """
    window, ends = np.ones((_PATCH, 1)), ((_PATCH, _PATCH), (0, 0))
    filled_mask = ndimage.binary_closing(np.pad(mask, ends, mode="edge"), window)
    return np.asarray(ndimage.binary_opening(filled_mask, window)[_PATCH:-_PATCH])


def _run_at(profiles: Profiles, mask: Bool, has_points: Bool, offset: float) -> tuple[float, float]:
    """Return right and left end, m, of the run of bins around an offset, m; NaN where the cloud ends, not the run.

    Args:
        profiles: U bins across.
        mask: (U,) bins of the pavement or median.
        has_points: (U,) bins with points.
        offset: m.
    """
    label, _ = ndimage.label(mask)
    central_labels = label[(np.abs(profiles.offsets - offset) < _CORE) & mask]
    if not len(central_labels):
        return np.nan, np.nan
    run = np.flatnonzero(label == np.bincount(central_labels).argmax())
    first_bin, last_bin = int(run[0]), int(run[-1])
    right_end, left_end = profiles.offsets[first_bin] - 0.5 * ACROSS, profiles.offsets[last_bin] + 0.5 * ACROSS
    right_seen = 2 * has_points[max(0, first_bin - _BEYOND) : first_bin].sum() >= _BEYOND
    left_seen = 2 * has_points[last_bin + 1 : last_bin + 1 + _BEYOND].sum() >= _BEYOND
    return float(right_end) if right_seen else np.nan, float(left_end) if left_seen else np.nan
