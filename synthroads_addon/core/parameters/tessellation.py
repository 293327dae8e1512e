"""Where the analytic road is sampled: as few stations as keep the mesh within the geometric tolerance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import RoadGeometry
from .model import LineMarking

MAXIMUM_SPACING = 8.0
"""No two stations lie farther apart than this (m), so that the terrain's undulation is followed on straights."""

_SHARE = 0.57
"""Share of the tolerance given to each of the horizontal chord, the vertical chord and the twist of a strip, whose
root sum of squares stays below the whole."""


def sample_stations(geometry: RoadGeometry, tolerance: float) -> NDArray[np.float64]:
    """Return the (N,) increasing stations at which the road is sampled, from 0 to its length.

    Every kink (element, rounding, crossfall point, end of a dash) is a station of its own. Between two kinks the
    spacing is even and keeps the chord's sagitta ds^2 k / 8 and the twist of the widest strip within the tolerance.

    Args:
        geometry: the analytic road.
        tolerance: largest distance (m) between the mesh and the analytic surface, > 0.
    """
    kinks = _kinks(geometry)
    spacing = np.minimum(_chord_spacing(geometry, kinks, tolerance), _twist_spacing(geometry, kinks, tolerance))
    spacing = np.minimum(spacing, MAXIMUM_SPACING)
    counts = np.maximum(1, np.ceil(np.diff(kinks) / spacing - 1e-9)).astype(int)
    first = np.repeat(kinks[:-1], counts)
    step = np.repeat(np.diff(kinks) / counts, counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(first + within * step, kinks[-1])


def _kinks(geometry: RoadGeometry) -> NDArray[np.float64]:
    parameters, length = geometry.parameters, geometry.length
    stations = [geometry.alignment.element_starts, np.asarray(geometry.profile.breakpoints), [0.0, length]]
    for side in ("left", "right"):
        if carriageway := parameters.carriageway(side):
            stations.append([point.station for point in carriageway.crossfall])
    stations += [geometry.dashes(line).ravel() for line in parameters.of_type(LineMarking).values()]
    inside = np.clip(np.concatenate([np.asarray(s, dtype=np.float64) for s in stations]), 0.0, length)
    kinks = np.unique(inside)
    # Kinks closer than a tenth of a millimetre are one: they would only make faces without area.
    keep = np.append(np.diff(kinks) > 1e-4, True)
    keep[0] = True
    return kinks[keep] if len(kinks) > 2 else kinks


def _chord_spacing(geometry: RoadGeometry, kinks: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the largest spacing (K,) whose horizontal and vertical sagitta keep their share of the tolerance."""
    samples = np.linspace(kinks[:-1] + 1e-6, kinks[1:] - 1e-6, 5)
    reach = np.abs(geometry.offsets).max()
    bend = np.abs(geometry.alignment.curvature(samples)).max(axis=0)
    horizontal = bend * (1.0 + bend * reach)
    vertical = np.abs(geometry.profile.curvature(samples)).max(axis=0)
    return np.sqrt(8.0 * _SHARE * tolerance / np.maximum(np.maximum(horizontal, vertical), 1e-12))


def _twist_spacing(geometry: RoadGeometry, kinks: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the largest spacing (K,) at which two triangles stay close to a strip whose crossfall changes.

    The middle of a twisted quad of width w and length ds lies w ds (dq/ds) / 4 off its diagonal.
    """
    widest = np.abs(np.diff(geometry.offsets)).max()
    heights = geometry.boundary_elevations(kinks)
    slopes = np.diff(heights, axis=1) / -np.diff(geometry.offsets)
    twist = np.abs(np.diff(slopes, axis=0)).max(axis=1) / np.diff(kinks)
    return 4.0 * _SHARE * tolerance / np.maximum(twist * widest, 1e-12)
