"""The line markings that frame the axis, or the pavement's edges where no line does."""

import numpy as np
from scipy import ndimage

from ..layout import RoadLayout
from ..path import SPACING
from ..profiles import STRETCH
from .view import View
from .vote import FoundAxis, axis_guides

_PAINTED = 0.10
"""Deviation of lines found by brightness where nothing scatters, m. Chosen: as measured bins are off."""
_CLASSED = 0.01
"""The same by class, m. Chosen: the points' own noise."""
_EDGES = 0.20
"""The same of edges in place of lines, m. Chosen: grass that grows over them."""
_CARRIED, _FAR = 0.5, 30.0
"""Deviation where other lines carry the axis on, m, reached so far (m) from where its own were seen. Chosen: lanes may
begin to widen on the way."""


def view_lines(layout: RoadLayout, axis: FoundAxis) -> View:
    """Return the view of the axis by lines (`axis_from_lines`), or by the pavement's edges in their place.

    Args:
        layout: carriageways and lines in profiles along a path parallel to the road.
        axis: the axis that the layout's lines agree on.
    """
    by_paint = all(guide.width > 0.0 for guide in axis_guides(layout))
    by_class = layout.profiles.points is not None
    floor = (_CLASSED if by_class else _PAINTED) if by_paint else (_CLASSED if by_class else _EDGES)
    seen_mask = np.isfinite(axis.raw)
    guides_seen = np.all([np.isfinite(guide.measured) for guide in axis_guides(layout)], axis=0)
    guide_distance = (
        STRETCH * SPACING * ndimage.distance_transform_edt(~guides_seen)
        if guides_seen.any()
        else np.full(len(seen_mask), np.inf)
    )
    carried_std = _CARRIED * np.clip(guide_distance / _FAR, 0.0, 1.0)
    std = np.where(seen_mask & np.isfinite(axis.std), np.hypot(axis.std, axis.raw - axis.offsets), 0.0)
    deviation = np.where(seen_mask, np.sqrt(floor**2 + std**2 + carried_std**2), np.inf)
    return View("lines" if by_paint else "edges", axis.raw, deviation)
