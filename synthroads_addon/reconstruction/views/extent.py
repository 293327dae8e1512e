"""The extent of the points across the road: what is left where nothing else is seen.

Clouds are cut out along roads, so their middle says something of the axis; the wider they are, the less.
"""

import numpy as np
from scipy import ndimage

from ..profiles import STRETCH, Profiles
from ..smoothing import fill_gaps
from .view import View

_ALONG = 2
"""Stretches to either side whose points count. Chosen: a gap in the cloud is shorter."""
_LEAST, _SHARE = 0.5, 0.12
"""Deviation of the middle: m at least, and share of the width. Chosen: clouds cut out along a road lie about it by no
more."""


def view_extent(profiles: Profiles) -> View:
    """Return the view of the middle between the outermost points on either side."""
    stretches = profiles.stretches
    full_rows = np.zeros((stretches * STRETCH, len(profiles.offsets)))
    full_rows[: len(profiles.stations)] = profiles.count
    occupied = full_rows.reshape(stretches, STRETCH, -1).sum(axis=1) > 0
    has_points = occupied.any(axis=1)
    if not has_points.any():
        return View("extent", np.full(stretches, np.nan), np.full(stretches, np.inf))
    # The first filled bin from either side.
    ends = [profiles.offsets[occupied.argmax(axis=1)], profiles.offsets[::-1][occupied[:, ::-1].argmax(axis=1)]]
    right_end, left_end = (
        ndimage.median_filter(fill_gaps(np.where(has_points, end, np.nan)), 2 * _ALONG + 1) for end in ends
    )
    std = np.maximum(_LEAST, _SHARE * (left_end - right_end))
    return View("extent", np.where(has_points, 0.5 * (right_end + left_end), np.nan), np.where(has_points, std, np.inf))
