"""The line markings that frame the axis, or the pavement's edges where no line does."""

import numpy as np
from scipy import ndimage

from ..layout import FoundAxis, RoadLayout, axis_guides
from ..path import SPACING
from ..profiles import STRETCH
from .view import View

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
        layout: that profiles along a path parallel to the road show.
        axis: that its lines agree on.
    """
    painted = all(guide.width > 0.0 for guide in axis_guides(layout))
    exact = layout.profiles.points is not None
    floor = (_CLASSED if exact else _PAINTED) if painted else (_CLASSED if exact else _EDGES)
    known = np.isfinite(axis.raw)
    framed = np.all([np.isfinite(guide.measured) for guide in axis_guides(layout)], axis=0)
    away = STRETCH * SPACING * ndimage.distance_transform_edt(~framed) if framed.any() else np.full(len(known), np.inf)
    carried = _CARRIED * np.clip(away / _FAR, 0.0, 1.0)
    std = np.where(known & np.isfinite(axis.std), np.hypot(axis.std, axis.raw - axis.offsets), 0.0)
    deviation = np.where(known, np.sqrt(floor**2 + std**2 + carried**2), np.inf)
    return View("lines" if painted else "edges", axis.raw, deviation)
