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
        """Return a view of offsets as they are, their deviation made of scatter, a floor and each stretch's own.

        An offset beside the others of its neighbourhood has what it is beside them as its deviation.

        Args:
            name: of the evidence.
            offsets: (K,) m; NaN where nothing is seen.
            floor: what the evidence is off by even where it doesn't scatter, standard deviation, m.
            std: of single stretches, m.
        """
        known = np.isfinite(offsets)
        if known.sum() < 3:
            return cls(name, np.full(len(offsets), np.nan), np.full(len(offsets), np.inf))
        smoothed = smooth(offsets, known.astype(np.float64), STRETCH * SPACING, _WAVELENGTH, usual=_RELIABLE)
        residual = np.where(known, np.abs(offsets - smoothed.values), 0.0)
        sized = np.sqrt(floor**2 + smoothed.std**2 + np.square(residual) + np.square(std))
        return cls(name, np.where(known, offsets, np.nan), np.where(known, sized, np.inf))

    def less_sure(self, std: Float) -> Self:
        """Return the view with one more independent error (K,), m, in each stretch."""
        return replace(self, std=np.hypot(self.std, std))

    @property
    def seen(self) -> float:
        """Return the share of the stretches in which the evidence is seen."""
        return float(np.isfinite(self.offsets).mean())
