"""Simple detectors of changes between two clouds: M3C2, nearest distances, differences of rasters.

M3C2 is py4dgeo's (package ``py4dgeo``); the others stand here.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...base.arrays import Float, Index
from ...base.errors import MissingPackageError

CORE_SPACING = 0.25
"""Distance of the core points, m, at which M3C2 is worked out: a point has the value of the nearest; chosen."""
RADIUS = 0.25
"""Radius of M3C2's cylinders, m; py4dgeo takes the radius, CloudCompare the diameter."""
NORMAL_RADII = (0.5, 1.0)
"""Radii in which normals are fitted, m."""
DEPTH = 0.5
"""Half the length of M3C2's cylinders, m."""
RASTER = 0.5
"""Edge of a raster's cells, m."""
_FEWEST = 5
"""Points that a cell or a cylinder must have in both epochs; chosen."""
NORMAL_QUANTILE = 1.96
"""Of the standard normal distribution, for a confidence of 95 %."""
_MEDIAN = 0.6745
"""Median of the absolute values of the standard normal distribution."""
_LARGEST_REGISTRATION, _HALVINGS = 10.0, 50
"""Largest registration error that is looked for, m, and steps of the search."""
_BLOCK = 500_000


@dataclass(frozen=True)
class DetectorSettings:
    """Settings of a detector.

    Attributes:
        radius: of cylinders and edge of cells, m.
        registration: standard deviation of the registration of the two clouds, m; None has it estimated from the
            distances (`estimated_registration`).
    """

    radius: float = RADIUS
    registration: float | None = 0.0


@dataclass(frozen=True)
class Distances:
    """Distances of the second epoch's points to the first, and from which on they are changes.

    Attributes:
        distance: (N,) m; NaN where there is none.
        detection_limit: (N,) m, at 95 %; NaN where there is none.
        registration: standard deviation of the clouds' registration that is in it, m; None where it has none.
    """

    distance: Float
    detection_limit: Float
    registration: float | None = None


def estimated_registration(distance: Float, level: Float) -> float:
    """Return the registration error, m, that the distances (N,) of two clouds show beyond their noise.

    Of distances that are normally distributed half are within 0.6745 standard deviations: the error is what the levels
    lack for that. Changes of less than half of all places alter it little. Where both clouds are displaced alike, so
    that most distances have one size, it is larger than that size needs, never smaller.

    Args:
        distance: (N,) m; NaN where there is none.
        level: (N,) of detection by the noise alone, at 95 %, m.
    """
    is_known = np.isfinite(distance) & np.isfinite(level)
    size, sigma = np.abs(distance[is_known]), level[is_known] / NORMAL_QUANTILE
    low, high = 0.0, _LARGEST_REGISTRATION
    if not len(size) or 2 * np.count_nonzero(size <= _MEDIAN * sigma) >= len(size):
        return 0.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        is_enough = 2 * np.count_nonzero(size <= _MEDIAN * (sigma + middle)) >= len(size)
        low, high = (low, middle) if is_enough else (middle, high)
    return high


def _with_registration(distance: Float, level: Float, rows: Index, settings: DetectorSettings) -> Distances:
    """Return the distances of points by the places (N,) that they have theirs of.

    Args:
        distance, level: (K,) of K places, m, the level by noise alone.
        rows: (N,) place of each point.
        settings: say the registration error.
    """
    registration = settings.registration
    if registration is None:
        registration = estimated_registration(distance, level)
    return Distances(distance[rows], (level + NORMAL_QUANTILE * registration)[rows], registration)


def m3c2(first: Float, second: Float, settings: DetectorSettings) -> Distances:
    """Return M3C2 distances of the second cloud's points (N, 3) from the first (M, 3), with its level of detection.

    Lague et al. 2013, ISPRS Journal 82; the level is 1.96 (sqrt(s1^2 / n1 + s2^2 / n2) + registration).
    """
    try:
        import py4dgeo
    except ImportError:
        raise MissingPackageError("--method", "m3c2", "py4dgeo", "changes") from None
    progress = logging.getLogger("py4dgeo")
    for handler in list(progress.handlers):  # it'd write py4dgeo.log into the user's folder, and among what we print
        if isinstance(handler, logging.FileHandler) or getattr(handler, "stream", None) is sys.stdout:
            progress.removeHandler(handler)
    origin = second.mean(axis=0)
    core = _thinned(second - origin, CORE_SPACING)
    epochs = [py4dgeo.Epoch(np.ascontiguousarray(cloud - origin)) for cloud in (first, second)]
    work = py4dgeo.M3C2(
        epochs=tuple(epochs),
        corepoints=core,
        normal_radii=NORMAL_RADII,
        cyl_radius=settings.radius,
        max_distance=DEPTH,
        orientation_vector=np.array([0.0, 0.0, 1.0]),
    )
    distances, uncertainties = work.run()
    limit = np.array(uncertainties["lodetection"], np.float64)
    samples = np.minimum(uncertainties["num_samples1"], uncertainties["num_samples2"])
    values, enough = np.array(distances, np.float64), samples >= _FEWEST
    values[~enough], limit[~enough] = np.nan, np.nan
    _, nearest = cKDTree(core).query(second - origin)
    return _with_registration(values, limit, nearest, settings)


def nearest_distance(first: Float, second: Float, settings: DetectorSettings) -> Distances:
    """Return the distances of the second cloud's points (N, 3) to the nearest of the first, unsigned.

    The limit is the 95 % quantile of the distances: what is farther than most points is called a change.
    """
    tree = cKDTree(first)
    parts = [tree.query(second[start : start + _BLOCK])[0] for start in range(0, len(second), _BLOCK)]
    distance = np.concatenate([*parts, np.empty(0)])
    limit = float(np.quantile(distance, 0.95)) if len(distance) else 0.0
    return Distances(distance, np.full(len(distance), max(limit, settings.registration or 0.0)))


def raster_difference(first: Float, second: Float, settings: DetectorSettings) -> Distances:
    """Return the differences of the mean heights of cells, second less first, for the second cloud's points (N, 3).

    The limit is that of the two means at 95 %, as M3C2 has it.
    """
    edge = RASTER if settings.radius == RADIUS else settings.radius
    low = np.minimum(first[:, :2].min(axis=0), second[:, :2].min(axis=0))
    keys = [np.floor((cloud[:, :2] - low) / edge).astype(np.int64) for cloud in (first, second)]
    width = int(max(key[:, 1].max(initial=0) for key in keys)) + 1
    numbers = [key[:, 0] * width + key[:, 1] for key in keys]
    cells, inverse = np.unique(np.concatenate(numbers), return_inverse=True)
    rows = np.split(inverse.ravel(), [len(first)])
    moments = [_moments(row, cloud[:, 2], len(cells)) for row, cloud in zip(rows, (first, second), strict=True)]
    (n1, mean1, variance1), (n2, mean2, variance2) = moments
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = NORMAL_QUANTILE * np.sqrt(variance1 / n1 + variance2 / n2)
    difference = np.where((n1 >= _FEWEST) & (n2 >= _FEWEST), mean2 - mean1, np.nan)
    level = np.where(np.isfinite(difference), limit, np.nan)
    return _with_registration(difference, level, rows[1], settings)


def _moments(rows: Float, height: Float, count: int) -> tuple[Float, Float, Float]:
    """Return number, mean (m) and variance (m2) of the heights of the points of each cell."""
    number = np.bincount(rows, minlength=count).astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.bincount(rows, height, count) / number
        variance = np.bincount(rows, (height - mean[rows]) ** 2, count) / np.maximum(number - 1.0, 1.0)
    return number, mean, variance


def _thinned(points: Float, spacing: float) -> Float:
    """Return one of the points of each cell of an edge (m), (K, 3)."""
    _, first = np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)
    return np.ascontiguousarray(points[np.sort(first)])


Detector = Callable[[Float, Float, DetectorSettings], Distances]
DETECTORS: dict[str, Detector] = {"m3c2": m3c2, "nearest": nearest_distance, "raster": raster_difference}
"""Detectors by name."""
