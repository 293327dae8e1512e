"""The dark skeleton: the ridge line of what is dark in the cloud seen from above, as far from light on either side.

Unlike the view of the brightness it knows nothing of the ground on the lanes: one threshold parts dark from light in
the whole cloud (Otsu 1979), and the ridge is that of the distance to the nearest light place in the plane.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ...base.arrays import Bool, Float, otsu_threshold
from ..profiles import ACROSS, STRETCH, Profiles
from .view import View

_CELL = 3
"""Bins across of one cell. Chosen: 0.3 m hold points of any scanner; square cells of a metre would be too coarse."""
_MEDIAN = (7, 5)
"""Cells along and across whose median is a cell's brightness. Chosen: 7 m by 1.5 m, in which paint and stains are the
lesser part."""
_PAINT = 5
"""Widest light strip that is paint, cells. Chosen: double lines, after the median."""
_NARROWEST, _WIDEST = 1.2, 12.0
"""Distance from the ridge to the dark's edge, m. Chosen: narrower dark is a gutter or a crack, wider no carriageway."""
_RIDGE = 0.9
"""Share of the largest distance in a row that is the ridge. Chosen: it is then some cells wide, whose mean scatters
less."""
_FEWEST = 0.5
"""Share of the cells about a ridge that must be known. Chosen: half of them."""
_FLOOR = 0.35
"""Deviation of the ridge from the axis where nothing scatters, m. Chosen: a cell's width."""


def view_skeleton(profiles: Profiles, cores: Sequence[float]) -> View:
    """Return the view of the ridge of the dark about a carriageway's middle, or of the middle between two ridges.

    Args:
        profiles: along a path parallel to the road.
        cores: offsets of the carriageways' middles, m: one or two.
    """
    dark_mask, known_mask, offsets = _dark_cells(profiles)
    if not dark_mask.any():
        return View.of("skeleton", np.full(profiles.stretches, np.nan), _FLOOR)
    # Where the cloud ends nothing is known of what lies beyond: distances across count in metres as those along do.
    distance = ndimage.distance_transform_edt(dark_mask, sampling=(1.0, _CELL * ACROSS))
    ridges = [_ridge(distance, dark_mask, known_mask, offsets, core) for core in cores]
    rows = np.mean(ridges, axis=0)
    return View.of("skeleton", _by_stretch(rows, profiles.stretches), _FLOOR)


def _dark_cells(profiles: Profiles) -> tuple[Bool, Bool, Float]:
    """Return masks (S, C) of the dark cells and of those with points, and the cells' middles across (C,), m."""
    count = len(profiles.offsets) // _CELL
    cells = profiles.brightness[:, : count * _CELL].reshape(len(profiles.stations), count, _CELL)
    has_points = np.isfinite(cells)
    total = np.where(has_points, cells, 0.0).sum(axis=2)
    number = has_points.sum(axis=2)
    known_mask = ndimage.binary_closing(number > 0, np.ones((5, 3)))
    if not (number > 0).any():
        return known_mask & False, known_mask, profiles.offsets[1::_CELL][:count]
    mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    # Empty cells take the median brightness: they pull the threshold to neither side.
    median_brightness = float(np.nanmedian(mean))
    median = ndimage.median_filter(np.where(np.isfinite(mean), mean, median_brightness), _MEDIAN)
    dark_mask = known_mask & (median <= otsu_threshold(np.asarray(median[known_mask], dtype=np.float64)))
    dark_mask = ndimage.binary_closing(dark_mask, np.ones((1, _PAINT))) & known_mask
    offsets = profiles.offsets[: count * _CELL].reshape(count, _CELL).mean(axis=1)
    return np.asarray(dark_mask), np.asarray(known_mask), offsets


def _ridge(distance: Float, dark_mask: Bool, known_mask: Bool, offsets: Float, core: float) -> Float:
    """Return the ridge's offset (S,), m, in the dark run nearest to a core; NaN without one, or at the cloud's border.

    Args:
        distance: (S, C) distance of each cell from the nearest light one, m.
        dark_mask, known_mask: (S, C) dark cells, and cells with points.
        offsets: (C,) of the cells' middles, m.
        core: offset of a carriageway's middle, m.
    """
    result = np.full(len(distance), np.nan)
    border = round(1.0 / (_CELL * ACROSS))
    for number, (row, row_dark, row_known) in enumerate(zip(distance, dark_mask, known_mask, strict=True)):
        label, count = ndimage.label(row_dark)
        if not count:
            continue
        middles = np.asarray(ndimage.mean(offsets, label, np.arange(1, count + 1)))
        run = np.flatnonzero(label == int(np.abs(middles - core).argmin()) + 1)
        widest = float(row[run].max())
        first_cell, last_cell = int(run[0]), int(run[-1])
        ends = row_known[max(0, first_cell - border) : first_cell], row_known[last_cell + 1 : last_cell + 1 + border]
        if not _NARROWEST <= widest <= _WIDEST or min(end.mean() if len(end) else 0.0 for end in ends) < _FEWEST:
            continue
        ridge = run[row[run] >= _RIDGE * widest]
        result[number] = float(offsets[ridge].mean())
    return result


def _by_stretch(rows: Float, stretches: int) -> Float:
    """Return the medians (K,) of the rows' values (S,) by stretch; NaN where most rows have none."""
    full_rows = np.full(stretches * STRETCH, np.nan)
    full_rows[: len(rows)] = rows
    blocks = full_rows.reshape(stretches, STRETCH)
    result = np.full(stretches, np.nan)
    mostly_known = 2 * np.isfinite(blocks).sum(axis=1) > STRETCH
    result[mostly_known] = np.nanmedian(blocks[mostly_known], axis=1)
    return result
