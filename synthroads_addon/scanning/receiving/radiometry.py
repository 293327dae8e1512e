"""How bright an echo is: the laser equation and the detector.

An echo's intensity is ``share / d^2 * exp(-a d)``; the share is what the surface does
(`materials.reflectance.returned_share`), `received_intensity` the rest. An ideal white target, struck at a right angle
at 1 m, gives 1.
"""

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Float, Float32

DARKEST_DB = -300.0
"""Received power in decibels of what sends nothing back."""
NEAREST = 1e-3
"""Nearer than this, m, 1/d^2 doesn't grow on: the law holds far from the aperture only, and stays finite."""


def received_intensity(share: ArrayLike, distance: ArrayLike, attenuation: float = 0.0) -> Float:
    """Return the intensity share / d^2 exp(-a d); 0 where the range isn't a finite number above 0.

    Args:
        share: brightness of the surface times the ray's share of the pulse's energy.
        distance: range d, m; below `NEAREST` it counts as this.
        attenuation: a, 1/m of range, not negative; the light goes there and back, so it is twice the extinction.

    Example:
        >>> received_intensity([0.2, 0.2], [10.0, 100.0]).tolist()
        [0.002, 2e-05]
    """
    distance = np.asarray(distance, dtype=np.float64)
    all_in_law = bool(np.all(distance >= NEAREST))
    law_range = distance if all_in_law else np.maximum(distance, NEAREST)
    # Underflow in dense fog is a true zero, and so is what comes back from infinitely far away.
    with np.errstate(under="ignore", over="ignore"):
        intensity = np.asarray(np.asarray(share, dtype=np.float64) / (law_range * law_range))
        if attenuation > 0.0:
            transmission = np.asarray(law_range * -attenuation)
            intensity *= np.exp(transmission, out=transmission)
    return intensity if all_in_law else np.where(distance > 0.0, intensity, 0.0)


def decibels(power: ArrayLike) -> Float32:
    """Return powers in decibels, at least `DARKEST_DB`.

    Example:
        >>> decibels([1.0, 0.01]).tolist()
        [0.0, -20.0]
    """
    return np.asarray(10.0 * np.log10(np.maximum(power, 10.0 ** (DARKEST_DB / 10.0))), dtype=np.float32)


def saturate(intensity: Float, limit: float) -> tuple[Float, int]:
    """Return intensities (N,) clipped at the detector's limit, and the number of those that were clipped.

    Args:
        intensity: (N,) that reach the detector.
        limit: largest that it tells apart; inf clips nothing.

    Example:
        >>> import numpy as np
        >>> intensity, clipped = saturate(np.array([0.2, 0.9, 1.4]), limit=1.0)
        >>> intensity.tolist(), clipped
        ([0.2, 0.9, 1.0], 1)
    """
    clipped = int(np.count_nonzero(intensity > limit))
    return (np.minimum(intensity, limit), clipped) if clipped else (intensity, 0)
