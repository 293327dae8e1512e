"""Where the analytic road is sampled: as few stations as keep the mesh within the geometric tolerance."""

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Float
from .damage import damage_rows
from .geometry import RoadGeometry
from .section import LineMarking
from .structures.relief import relief_stations
from .turnout_geometry import STEP

MAXIMUM_SPACING = 8.0
"""No two stations lie farther apart than this (m), so that the terrain's undulation is followed on straights."""

_SHARE = 0.57
"""Share of the tolerance given to each of the horizontal chord, the vertical chord and the twist of a strip, whose
root sum of squares stays below the whole."""


def sample_stations(geometry: RoadGeometry, tolerance: float, start: float = 0.0, end: float = np.inf) -> Float:
    """Return the increasing stations (N,), m, of a mesh's rows: as few as keep it within the tolerance (m).

    Every kink (element, rounding, crossfall point, end of a dash) is a station of its own. Between two kinks the
    spacing is even and keeps the chord's sagitta ds^2 k / 8 and the twist of the widest strip within the tolerance.
    A stretch has the whole road's stations, from the last one that is not after its start to the last one that is not
    after its end: stretches that follow one another join, and a road doesn't depend on how it is cut.

    Args:
        geometry: the analytic road.
        tolerance: largest distance (m) between the mesh and the analytic surface, > 0.
        start, end: stations (m) of the stretch that is wanted.

    Example:
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> from synthroads_addon.road.geometry import RoadGeometry
        >>> geometry = RoadGeometry(sample_road(RoadScenario(length=200.0), seed=1))
        >>> coarse, fine = (sample_stations(geometry, tolerance) for tolerance in (0.05, 0.005))
        >>> len(coarse) < len(fine)
        True
    """
    end = min(end, geometry.length)
    all_kinks = _joined([_kinks(epoch, tolerance) for epoch in (geometry, *geometry.epochs)])
    kinks = _enclosing_kinks(all_kinks, start, end)
    spacing = np.minimum(_chord_spacing(geometry, kinks, tolerance), _twist_spacing(geometry, kinks, tolerance))
    # Between the two ends of a step there is nothing to follow.
    spacing = np.where(np.diff(kinks) <= 2.0 * STEP, np.inf, np.minimum(spacing, MAXIMUM_SPACING))
    counts = np.maximum(1, np.ceil(np.diff(kinks) / spacing - 1e-9)).astype(int)
    interval_starts = np.repeat(kinks[:-1], counts)
    steps = np.repeat(np.diff(kinks) / counts, counts)
    number_in_interval = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    stations = np.append(interval_starts + number_in_interval * steps, kinks[-1])
    first_row, last_row = (int(np.searchsorted(stations, place, side="right")) - 1 for place in (start, end))
    first_row = max(first_row, 0)
    return stations[first_row : max(last_row, first_row + 1) + 1]


def _kinks(geometry: RoadGeometry, tolerance: float) -> Float:
    """Return the stations (K,), m, at which any of the road's functions bends or jumps, and both ends; unsorted."""
    parameters, end = geometry.parameters, geometry.length
    stations = [geometry.alignment.element_starts, np.asarray(geometry.profile.breakpoints), [0.0, end]]
    for section in geometry.sections.values():
        stations.append([point.station for point in section.carriageway.crossfall])
        stations += [section.kinks(), damage_rows(section, tolerance)]
    stations += [mouth.stations for mouth in geometry.mouths.values()]
    stations += [structure.stations for structure in geometry.structures.values()]
    stations += [relief_stations(structure) for structure in geometry.reliefs.values()]
    stations += [geometry.dashes(line).ravel() for line in parameters.of_type(LineMarking).values()]
    return np.clip(np.concatenate([np.asarray(s, dtype=np.float64) for s in stations]), 0.0, end)


def _joined(stations: Sequence[Float]) -> Float:
    """Return the sorted stations (K,), m, of several lists of kinks."""
    kinks = np.unique(np.concatenate(stations))
    # Kinks closer than a tenth of a millimetre are one: they would only make faces without area.
    keep_mask = np.append(np.diff(kinks) > 1e-4, True)
    keep_mask[0] = True
    return kinks[keep_mask] if len(kinks) > 2 else kinks


def _enclosing_kinks(kinks: Float, start: float, end: float) -> Float:
    """Return those of the sorted kinks that enclose the stations from start to end, at least two."""
    first_kink = int(np.clip(np.searchsorted(kinks, start, side="right") - 1, 0, len(kinks) - 2))
    last_kink = int(np.searchsorted(kinks, end, side="left"))
    return kinks[first_kink : max(last_kink, first_kink + 1) + 1]


def _chord_spacing(geometry: RoadGeometry, kinks: Float, tolerance: float) -> Float:
    """Return the largest spacings (K,), m, whose horizontal and vertical sagitta keep their share of the tolerance."""
    samples = np.linspace(kinks[:-1] + 1e-6, kinks[1:] - 1e-6, 5)
    largest_offsets = np.abs(geometry.offsets(kinks)).max(axis=1)
    reach = np.maximum(largest_offsets[:-1], largest_offsets[1:])
    curvature = np.abs(geometry.alignment.curvature(samples)).max(axis=0)
    for section in geometry.sections.values():
        curvature = curvature + section.bend(samples.ravel()).reshape(samples.shape).max(axis=0)
    horizontal_curvature = curvature * (1.0 + curvature * reach)
    vertical_curvature = np.abs(geometry.profile.curvature(samples)).max(axis=0)
    for section in geometry.sections.values():
        vertical_curvature = vertical_curvature + section.ramp_bend(samples.ravel()).reshape(samples.shape).max(axis=0)
    return np.sqrt(8.0 * _SHARE * tolerance / np.maximum(np.maximum(horizontal_curvature, vertical_curvature), 1e-12))


def _twist_spacing(geometry: RoadGeometry, kinks: Float, tolerance: float) -> Float:
    """Return the largest spacings (K,), m, at which two triangles stay close to a strip whose crossfall changes.

    The middle of a twisted quad of width w and length ds lies w ds (dq/ds) / 4 off its diagonal.
    """
    widths = -np.diff(geometry.offsets(kinks), axis=1)
    heights = np.diff(geometry.boundary_elevations(kinks), axis=1)
    # A strip without width lies in no plane; one that opens from 0 has the slope that it opens to.
    slopes = np.where(widths > 1e-6, heights / np.maximum(widths, 1e-6), np.nan)
    slope_changes = np.nan_to_num(np.abs(np.diff(slopes, axis=0)))
    largest_widths = np.maximum(widths[:-1], widths[1:])
    twist = (slope_changes * largest_widths).max(axis=1) / np.diff(kinks)
    return 4.0 * _SHARE * tolerance / np.maximum(twist, 1e-12)
