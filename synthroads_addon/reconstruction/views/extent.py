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
    padded = np.zeros((stretches * STRETCH, len(profiles.offsets)))
    padded[: len(profiles.stations)] = profiles.count
    filled = padded.reshape(stretches, STRETCH, -1).sum(axis=1) > 0
    there = filled.any(axis=1)
    if not there.any():
        return View("extent", np.full(stretches, np.nan), np.full(stretches, np.inf))
    # The first filled bin from either side.
    ends = [profiles.offsets[filled.argmax(axis=1)], profiles.offsets[::-1][filled[:, ::-1].argmax(axis=1)]]
    low, high = (ndimage.median_filter(fill_gaps(np.where(there, end, np.nan)), 2 * _ALONG + 1) for end in ends)
    std = np.maximum(_LEAST, _SHARE * (high - low))
    return View("extent", np.where(there, 0.5 * (low + high), np.nan), np.where(there, std, np.inf))
