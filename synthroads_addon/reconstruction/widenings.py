"""Where the pavement is wider or narrower than the cross-section says: emergency bays, and what isn't reconstructed.

An emergency bay opens over a taper, keeps its width and closes again, beside an edge line that goes on. Whatever else
changes the pavement's width (exits, entries, lanes that begin or end) is found as well, but left to the reader.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.optimize import least_squares

from ..base.arrays import Bool, Float
from ..road.guidelines import EMERGENCY_BAY_LENGTH, EMERGENCY_BAY_TAPER, EMERGENCY_BAY_WIDTH
from .path import SPACING
from .profiles import STRETCH
from .section import MeasuredSection, Side, SideSection
from .smoothing import correlation_factor, robust_scale

APART = 0.75
"""An edge of the pavement so far, m, from the usual one is another cross-section's. Chosen: less than any bay or lane,
more than an edge wanders."""
SHORTEST = 25.0
"""A shorter stretch, m, is a fault in the picture. Chosen: five stretches; an emergency bay is longer."""
_BACK = 0.1
"""Distance of an edge from the usual one at which it is back, m. Chosen: a bin."""
_CLOSING = 3
"""Stretches that an edge may not be seen within a run. Chosen: 15 m, a lorry's length."""
_AROUND = 40.0
"""Length before and behind a run that its shape is fitted to, m. Chosen: more than a taper."""
_NEAREST = 10.0
"""Distance from a bay to where the road's edge is first or last seen, m. Chosen: else the bay may go on beyond the
cloud."""
_MISFIT = 0.25
"""Root mean square that a bay's shape may keep from its edge, m. Chosen: exits and lanes that begin keep more."""
_NARROWEST, _WIDEST = 0.6 * EMERGENCY_BAY_WIDTH, 5.0
"""Widths of a bay, m. Chosen: about those of the guidelines' bays, and a lane with its strip."""
_SHORTEST_BAY, _LONGEST_BAY = 0.4 * EMERGENCY_BAY_LENGTH, 3.0 * EMERGENCY_BAY_LENGTH
"""Lengths of a bay at full width, m. Chosen: about those of the guidelines' bays."""
_PAINTED = 0.6
"""Share of a bay's length that must be beside the edge line's paint, where that is seen. Chosen: of a dashed line it is
half."""
_LEAST_TAPER = 5.0
"""Length of a taper at least, m. Chosen: a stretch."""
_LEAST_SCATTER = 0.02
"""Scatter of an edge's offset in one stretch at least, m. Chosen: no pavement's edge is as straight as a line."""


@dataclass(frozen=True)
class Bay:
    """A measured emergency bay.

    Attributes:
        side: side of the road that the bay lies on.
        start, end: stations between which the pavement is wider, m.
        low_taper, high_taper: lengths of the tapers at the lower and the higher station, m.
        width, width_std: width and its standard deviation, m.
        covariance: (5, 5) of start, low taper, length at full width, high taper and width, m2.
    """

    side: Side
    start: float
    end: float
    low_taper: float
    high_taper: float
    width: float
    width_std: float
    covariance: Float

    def std_at(self, stations: Float) -> Float:
        """Return the standard deviation (K,), m, of the bay's width at stations (K,), m."""
        shape = np.array(
            [self.start, self.low_taper, self.end - self.start - self.low_taper - self.high_taper, self.high_taper]
        )
        shape = np.append(shape, self.width)
        jacobian = _trapezoid_jacobian(stations, shape)
        near_tapers = np.abs(jacobian[:, :4]).max(axis=1) > 0.0  # near its tapers: no bay is quite a trapezoid
        # Propagation of errors: the variance of f(shape) is J C J'.
        shape_variance = np.maximum(np.einsum("ki,ij,kj->k", jacobian, self.covariance, jacobian), 0.0)
        return np.sqrt(shape_variance + np.where(near_tapers, _LEAST_SCATTER, 0.0) ** 2)


@dataclass(frozen=True)
class Unlike:
    """A stretch whose pavement is wider or narrower than the cross-section: stations, and excess of width, m."""

    side: Side
    start: float
    end: float
    wider_by: float


def find_widenings(section: MeasuredSection, stations: Float) -> tuple[list[Bay], list[Unlike]]:
    """Return the emergency bays beside a road, and the stretches whose width remains unlike the cross-section.

    Args:
        section: the measured cross-section.
        stations: (K,) of its stretches, m.
    """
    bays: list[Bay] = []
    unlike_stretches: list[Unlike] = []
    for side in section.sides.values():
        runs = []
        for run in _runs(side, stations):
            bay = _bay(side, stations, run) if section.kind == "dual" else None
            if bay is not None:
                bays.append(bay)
            else:
                runs.append(run)
        unlike_stretches += _unlike_stretches(side, stations, runs)
    return bays, unlike_stretches


def excess(side: SideSection) -> Float:
    """Return the distance (K,), m, of the pavement's outer edge outwards from its usual place; NaN if unseen."""
    edge = side.outer_edge.offsets
    usual_offsets = edge[side.usual]
    return (
        edge - float(np.nanmedian(usual_offsets))
        if len(usual_offsets) and np.isfinite(usual_offsets).any()
        else np.full(len(edge), np.nan)
    )


def _runs(side: SideSection, stations: Float) -> Iterator[slice]:
    """Yield the runs of stretches in which the outer edge lies more than `APART` from its usual place."""
    excess_width = excess(side)
    unusual = np.isfinite(excess_width) & (np.abs(excess_width) > APART)
    unusual = ndimage.binary_closing(np.pad(unusual, _CLOSING), np.ones(_CLOSING))[_CLOSING:-_CLOSING]
    label, _ = ndimage.label(unusual)
    for (run,) in ndimage.find_objects(label):
        if stations[run.stop - 1] - stations[run.start] + STRETCH * SPACING >= SHORTEST:
            yield run


def _whole(run: slice, excess_width: Float, scatter: float) -> slice:
    """Return a run extended by the stretches before and behind it in which the edge comes back to its usual place.

    One more stretch is added to either side, as the edge comes back within a stretch.
    """
    is_unusual = np.isfinite(excess_width) & (np.abs(excess_width) > max(_BACK, 3.0 * scatter))
    is_unusual = ndimage.binary_closing(np.pad(is_unusual, _CLOSING), np.ones(_CLOSING))[_CLOSING:-_CLOSING]
    is_unusual[run] = True
    label, _ = ndimage.label(is_unusual)
    ((extent,),) = ndimage.find_objects((label == label[run.start]).astype(np.int8))
    return slice(max(0, extent.start - 1), min(len(excess_width), extent.stop + 1))


def _bay(side: SideSection, stations: Float, run: slice) -> Bay | None:
    """Return the emergency bay that a run of wider pavement shows; None if its shape is no bay's."""
    excess_width = excess(side)
    seen_stretches = np.flatnonzero(np.isfinite(excess_width))
    run_start, run_end = stations[run.start], stations[run.stop - 1]
    within_road = (
        run_start - stations[seen_stretches[0]] >= _NEAREST and stations[seen_stretches[-1]] - run_end >= _NEAREST
    )
    if not within_road or np.nanmedian(excess_width[run]) < _NARROWEST or not _beside_line(side, run):
        return None
    fit_mask = np.isfinite(excess_width) & (stations > run_start - _AROUND) & (stations < run_end + _AROUND)
    shape, residual, unit_covariance = _fit_trapezoid(stations[fit_mask], excess_width[fit_mask], run_start, run_end)
    start, low_taper, length, high_taper, width = shape.tolist()
    fits = robust_scale(residual) < _MISFIT and float(np.sqrt(np.mean(residual**2))) < 2.0 * _MISFIT
    if not fits or not _NARROWEST <= width <= _WIDEST or not _SHORTEST_BAY <= length <= _LONGEST_BAY:
        return None
    scatter = max(robust_scale(residual), _LEAST_SCATTER)
    covariance = scatter**2 * correlation_factor(residual) * unit_covariance
    std = float(np.sqrt(covariance[-1, -1]))
    return Bay(side.side, start, start + low_taper + length + high_taper, low_taper, high_taper, width, std, covariance)


def _beside_line(side: SideSection, run: slice) -> bool:
    """Return whether the outermost line goes on as a solid line beside a run of stretches, as far as it is seen."""
    line = side.lines[-1]
    if line is None:
        return False
    cover = line.cover[run]
    painted_shares = cover[np.isfinite(cover)]
    return line.solid and len(painted_shares) > 0 and float(painted_shares.mean()) > _PAINTED


def _trapezoid(stations: Float, shape: Float) -> Float:
    """Return the width (K,), m, of a trapezoidal bay at stations (K,), m, by its shape.

    Args:
        stations: (K,) m.
        shape: (5,) start, low taper, length at full width, high taper and width, m.
    """
    start, low_taper, length, high_taper, width = shape
    # width x min(rise, 1, fall), each linear along its taper.
    rise = (stations - start) / low_taper
    fall = (start + low_taper + length + high_taper - stations) / high_taper
    return np.asarray(width * np.clip(np.minimum(rise, fall), 0.0, 1.0))


def _trapezoid_jacobian(stations: Float, shape: Float) -> Float:
    """Return the derivatives (K, 5) of `_trapezoid` by its shape, as central differences.

    Stations and lengths are varied by half a stretch, tapers by 1 m, the width by 1 cm.
    """
    steps = np.diag([0.5 * STRETCH * SPACING] * 4 + [0.01])
    steps[[1, 3], [1, 3]] = 1.0
    return np.column_stack(
        [
            (_trapezoid(stations, shape + step) - _trapezoid(stations, shape - step)) / (2.0 * step.sum())
            for step in steps
        ]
    )


def _fit_trapezoid(
    stations: Float, excess_width: Float, run_start: float, run_end: float
) -> tuple[Float, Float, Float]:
    """Return the best-fitting trapezoid's shape (5,), m, its residuals (N,), and its covariance (5, 5) for unit noise.

    Args:
        stations: (N,) m.
        excess_width: (N,) distance by which the edge lies outside of its usual place, m.
        run_start, run_end: stations between which the pavement is wider, m.
    """

    def residual(shape: Float) -> Float:
        """Return the trapezoid's width less the measured excess (N,), m."""
        return _trapezoid(stations, shape) - excess_width

    # Above the median: the tapers are part of the run.
    width = float(np.percentile(excess_width[(stations >= run_start) & (stations <= run_end)], 70))
    # Start with a bay's usual tapers, or with 30 % of a short run, half of each within the run (chosen).
    taper = min(EMERGENCY_BAY_TAPER, 0.3 * (run_end - run_start) + _LEAST_TAPER)
    initial_shape = np.array(
        [run_start - 0.3 * taper, taper, max(run_end - run_start - 1.4 * taper, 5.0), taper, width]
    )
    # Chosen: bays are 0.1 to 10 m wide with tapers of 80 m at most; residuals beyond 0.2 m count less.
    lower_bounds = np.array([run_start - _AROUND, _LEAST_TAPER, 1.0, _LEAST_TAPER, 0.1])
    upper_bounds = np.array([run_end, 80.0, run_end - run_start + _AROUND, 80.0, 10.0])
    solution = least_squares(
        residual,
        np.clip(initial_shape, lower_bounds + 1e-6, upper_bounds - 1e-6),
        bounds=(lower_bounds, upper_bounds),
        loss="soft_l1",
        f_scale=0.2,
    )
    # Covariance of least squares for unit noise: (J'J)^-1; the pseudo-inverse, as a taper may be seen by no stretch.
    normal = solution.jac.T @ solution.jac
    return np.asarray(solution.x), residual(solution.x), np.linalg.pinv(normal, hermitian=True)


def _unlike_stretches(side: SideSection, stations: Float, runs: list[slice]) -> list[Unlike]:
    """Return the stretches of wider or narrower pavement; runs between which the edge never comes back are one."""
    half_stretch, excess_width = 0.5 * STRETCH * SPACING, excess(side)
    scatter = robust_scale(excess_width[side.usual & np.isfinite(excess_width)])
    groups: dict[tuple[int, int], list[slice]] = {}
    for run in runs:
        extent = _whole(run, excess_width, scatter)
        groups.setdefault((extent.start, extent.stop), []).append(run)
    return [
        Unlike(
            side=side.side,
            start=round(stations[first_stretch] - half_stretch, 1),
            end=round(stations[end_stretch - 1] + half_stretch, 1),
            wider_by=round(float(np.nanmedian(np.concatenate([excess_width[run] for run in parts]))), 2),
        )
        for (first_stretch, end_stretch), parts in groups.items()
    ]


def unlike_mask(unlike_stretches: list[Unlike], stations: Float) -> Bool:
    """Return a mask (K,) of the stretches that lie in any of the stretches that are unlike the cross-section."""
    masks = [(stations >= stretch.start) & (stations <= stretch.end) for stretch in unlike_stretches]
    return np.any(masks, axis=0) if masks else np.zeros(len(stations), dtype=bool)
