"""The middle of the dark band that a road without paint is."""

import numpy as np

from ..ground.band import FULL, DarkBand
from .view import View

_FLOOR = 0.12
"""Deviation of the band's middle from the axis where nothing scatters, m. Chosen: half of a gutter's width."""


def view_band(band: DarkBand) -> View:
    """Return the view of the band's middle."""
    # Where the band is fainter its edges are found the less exactly.
    std = np.where(band.score > 0.0, _FLOOR * (FULL / np.maximum(band.score, 0.02) - 1.0), 0.0)
    return View.of("dark band", 0.5 * (band.right + band.left), _FLOOR, std)
