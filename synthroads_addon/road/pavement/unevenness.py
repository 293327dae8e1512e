"""Unevenness of a pavement: waves of a spectrum by ISO 8608, alike along and across, as a field in plan."""

import math

import numpy as np

from ...base.arithmetic.noise import DECAY, noise_field
from ...base.arrays import Float

LONGEST, OCTAVES = 16.0, 6
"""Longest wavelength of the field (m) and its octaves, down to half a metre: longer waves are the profile's, shorter
ones the texture's."""
_REFERENCE = 0.1
"""Spatial frequency that the density holds at (ISO 8608), cycles/m."""
CLASSES = {"A": 32.0, "B": 128.0, "C": 512.0}
"""Upper limits of the classes' densities at that frequency (ISO 8608, table C.2), cm3."""


def unevenness_spread(density: float) -> float:
    """Return the standard deviation (m) of the heights.

    A band of an octave below the wavelength L has the variance G n0^2 L / 2 on a line. Noise of an octave is wider than
    its band and lies in space, so that only a share 1 / pi of its variance is on the line's spectrum.

    Args:
        density: spectral density G at 0.1 cycles/m, cm3; it falls with the square of the frequency.
    """
    bands = LONGEST / 2.0 * sum(DECAY**octave for octave in range(OCTAVES))
    return math.sqrt(math.pi * density * 1e-6 * _REFERENCE**2 * bands)


def unevenness(place: Float, density: float | Float, seed: int) -> Float:
    """Return the heights (N,) of places (N, 2) in the road's local frame, m.

    Args:
        place: m.
        density: one, or (N,), at 0.1 cycles/m, cm3.
        seed: of the field.
    """
    points_3d = np.column_stack([place[:, :2], np.zeros(len(place))])
    return noise_field(points_3d, LONGEST, seed, OCTAVES) * unevenness_spread(1.0) * np.sqrt(density)
