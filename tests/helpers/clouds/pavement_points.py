"""Points of a made-up pavement, whose statistics are known."""

from __future__ import annotations

import numpy as np

from synthroads_addon.cloud.selection.classes import RealClass

SIZE = (120.0, 9.0)
"""Of the pavement, m."""


def pavement(
    *,
    pattern: str = "random",
    density: float = 30.0,
    height_noise: float = 0.005,
    curvature: float = 0.0,
    spread_db: float = 1.0,
    brighter_by_height: float = 0.0,
    gain: float = 1.0,
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    strip: float = 0.0,
    seed: int = 1,
) -> RealClass:
    """Return points (N, 3) of a pavement and their intensities.

    Args:
        pattern: ``random``, or ``lattice``: squares.
        density: points per m2.
        height_noise: standard deviation of the heights about the surface, m.
        curvature: of the surface, across, 1/m.
        spread_db: standard deviation of the intensities, dB.
        brighter_by_height: how much brighter a point is by its height above the surface, dB/m.
        gain: factor on the intensities.
        shift: of all points, m.
        strip: width of a strip along the edge that has no points, m.
        seed: of the random numbers.
    """
    random = np.random.default_rng(seed)
    step = density**-0.5
    if pattern == "lattice":
        x, y = (axis.ravel() for axis in np.meshgrid(*(np.arange(0.5 * step, size, step) for size in SIZE)))
    else:
        x, y = (random.uniform(0.0, size, int(density * SIZE[0] * SIZE[1])) for size in SIZE)
    noise = random.normal(0.0, height_noise, len(x))
    level = random.normal(0.0, spread_db, len(x)) + brighter_by_height * noise / 0.5
    kept = y > strip
    place = np.stack([x, y, 0.02 * y + 0.5 * curvature * (y - 4.5) ** 2 + noise], axis=1)[kept] + shift
    unknown = np.full(len(place), np.nan)
    intensity = gain * 10.0 ** (level[kept] / 10.0)
    return RealClass("made up", place, intensity, 0, unknown, unknown, np.ones(len(place), np.uint8))
