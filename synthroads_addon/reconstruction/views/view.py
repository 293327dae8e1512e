"""One view of the axis: offsets along the road from one kind of evidence alone, with standard deviations."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...base.arrays import Float
from ..path import SPACING
from ..profiles import STRETCH
from ..smoothing import smooth

_WAVELENGTH = 60.0
"""Wavelength of which half of an axis' swings is kept, m. Chosen: shorter ones are noise."""
_RELIABLE = 0.02
"""Deviation of one stretch below which no view is, m. Chosen: paint itself sways by as much."""


@dataclass(frozen=True)
class View:
    """Offsets of a road's axis in each of K stretches as one kind of evidence shows it.

    Attributes:
        name: of the evidence.
        offsets: (K,) m, positive to the left of the path; NaN where nothing is seen.
        std: (K,) standard deviation, m; infinite where nothing is seen.
    """

    name: str
    offsets: Float
    std: Float

    @classmethod
    def of(cls, name: str, offsets: Float, floor: float, std: Float | float = 0.0) -> Self:
        """Return a view of offsets whose variance is the sum of their scatter's, a floor's and each stretch's own.

        An offset that lies off the smoothed course has that distance added to its deviation.

        Args:
            name: of the evidence.
            offsets: (K,) m; NaN where nothing is seen.
            floor: standard deviation of the evidence's error even where it doesn't scatter, m.
            std: (K,) standard deviation of each stretch's own error, m; or a number.
        """
        seen_mask = np.isfinite(offsets)
        if seen_mask.sum() < 3:
            return cls(name, np.full(len(offsets), np.nan), np.full(len(offsets), np.inf))
        smooth_offsets = smooth(
            offsets, seen_mask.astype(np.float64), STRETCH * SPACING, _WAVELENGTH, usual_std=_RELIABLE
        )
        residual = np.where(seen_mask, np.abs(offsets - smooth_offsets.values), 0.0)
        total_std = np.sqrt(floor**2 + smooth_offsets.std**2 + np.square(residual) + np.square(std))
        return cls(name, np.where(seen_mask, offsets, np.nan), np.where(seen_mask, total_std, np.inf))

    def less_sure(self, std: Float) -> Self:
        """Return the view with one more independent error (K,), m, in each stretch."""
        return replace(self, std=np.hypot(self.std, std))

    @property
    def seen(self) -> float:
        """Return the share of the stretches in which the evidence is seen."""
        return float(np.isfinite(self.offsets).mean())
