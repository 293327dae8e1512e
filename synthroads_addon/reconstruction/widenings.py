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
    """An emergency bay, measured.

    Attributes:
        side: that it lies on.
        start, end: stations between which the pavement is wider, m.
        low_taper, high_taper: lengths over which it opens and closes, at the lower and the higher station, m.
        width: m, and its standard deviation.
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
        """Return the standard deviation (K,), m, of how much wider the pavement is at stations (K,)."""
        shape = np.array(
            [self.start, self.low_taper, self.end - self.start - self.low_taper - self.high_taper, self.high_taper]
        )
        shape = np.append(shape, self.width)
        change = _trapezoid_jacobian(stations, shape)
        bent = np.abs(change[:, :4]).max(axis=1) > 0.0  # near its tapers: no bay is quite a trapezoid
        # Propagated: the variance of f(shape) is J C J'.
        known = np.maximum(np.einsum("ki,ij,kj->k", change, self.covariance, change), 0.0)
        return np.sqrt(known + np.where(bent, _LEAST_SCATTER, 0.0) ** 2)


@dataclass(frozen=True)
class Unlike:
    """A stretch whose pavement isn't as wide as the reconstructed cross-section: stations, and by how much, m."""

    side: Side
    start: float
    end: float
    wider_by: float


def find_widenings(section: MeasuredSection, stations: Float) -> tuple[list[Bay], list[Unlike]]:
    """Return the emergency bays beside a road, and the stretches whose width remains unlike the cross-section.

    Args:
        section: measured.
        stations: (K,) of its stretches, m.
    """
    bays: list[Bay] = []
    others: list[Unlike] = []
    for side in section.sides.values():
        runs = []
        for run in _runs(side, stations):
            bay = _bay(side, stations, run) if section.kind == "dual" else None
            if bay is not None:
                bays.append(bay)
            else:
                runs.append(run)
        others += _unlike_stretches(side, stations, runs)
    return bays, others


def excess(side: SideSection) -> Float:
    """Return how much farther outside than usual the pavement's outer edge lies in each of K stretches, m."""
    edge = side.outer_edge.offsets
    usual = edge[side.usual]
    return edge - float(np.nanmedian(usual)) if len(usual) and np.isfinite(usual).any() else np.full(len(edge), np.nan)


def _runs(side: SideSection, stations: Float) -> Iterator[slice]:
    """Yield the runs of stretches in which the edge isn't the usual one."""
    beside = excess(side)
    unusual = np.isfinite(beside) & (np.abs(beside) > APART)
    unusual = ndimage.binary_closing(np.pad(unusual, _CLOSING), np.ones(_CLOSING))[_CLOSING:-_CLOSING]
    label, _ = ndimage.label(unusual)
    for (run,) in ndimage.find_objects(label):
        if stations[run.stop - 1] - stations[run.start] + STRETCH * SPACING >= SHORTEST:
            yield run


def _whole(run: slice, beside: Float, scatter: float) -> slice:
    """Return a run with the stretches before and behind it over which the edge comes back to the usual one.

    And one more to either side, as it does so within a stretch.
    """
    away = np.isfinite(beside) & (np.abs(beside) > max(_BACK, 3.0 * scatter))
    away = ndimage.binary_closing(np.pad(away, _CLOSING), np.ones(_CLOSING))[_CLOSING:-_CLOSING]
    away[run] = True
    label, _ = ndimage.label(away)
    ((extent,),) = ndimage.find_objects((label == label[run.start]).astype(np.int8))
    return slice(max(0, extent.start - 1), min(len(beside), extent.stop + 1))


def _bay(side: SideSection, stations: Float, run: slice) -> Bay | None:
    """Return the emergency bay that a run of wider pavement is; None if it is none."""
    beside = excess(side)
    seen = np.flatnonzero(np.isfinite(beside))
    first, last = stations[run.start], stations[run.stop - 1]
    inside = first - stations[seen[0]] >= _NEAREST and stations[seen[-1]] - last >= _NEAREST
    if not inside or np.nanmedian(beside[run]) < _NARROWEST or not _beside_line(side, run):
        return None
    near = np.isfinite(beside) & (stations > first - _AROUND) & (stations < last + _AROUND)
    shape, residual, unit = _fit_trapezoid(stations[near], beside[near], first, last)
    start, low, length, high, width = shape.tolist()
    fits = robust_scale(residual) < _MISFIT and float(np.sqrt(np.mean(residual**2))) < 2.0 * _MISFIT
    if not fits or not _NARROWEST <= width <= _WIDEST or not _SHORTEST_BAY <= length <= _LONGEST_BAY:
        return None
    scatter = max(robust_scale(residual), _LEAST_SCATTER)
    covariance = scatter**2 * correlation_factor(residual) * unit
    std = float(np.sqrt(covariance[-1, -1]))
    return Bay(side.side, start, start + low + length + high, low, high, width, std, covariance)


def _beside_line(side: SideSection, run: slice) -> bool:
    """Return whether the outermost line goes on as a solid one beside a run, as far as it is seen."""
    line = side.lines[-1]
    if line is None:
        return False
    cover = line.cover[run]
    known = cover[np.isfinite(cover)]
    return line.solid and len(known) > 0 and float(known.mean()) > _PAINTED


def _trapezoid(stations: Float, shape: Float) -> Float:
    """Return how much wider (K,), m, the pavement is by start, low taper, length, high taper and width (5,), m."""
    start, low, length, high, width = shape
    # width x min(rise, 1, fall), each linear along its taper.
    rising = (stations - start) / low
    falling = (start + low + length + high - stations) / high
    return np.asarray(width * np.clip(np.minimum(rising, falling), 0.0, 1.0))


def _trapezoid_jacobian(stations: Float, shape: Float) -> Float:
    """Return the derivatives (K, 5) of `_trapezoid` by its shape, over half a stretch to either side of its corners."""
    steps = np.diag([0.5 * STRETCH * SPACING] * 4 + [0.01])
    steps[[1, 3], [1, 3]] = 1.0
    return np.column_stack(
        [
            (_trapezoid(stations, shape + step) - _trapezoid(stations, shape - step)) / (2.0 * step.sum())
            for step in steps
        ]
    )


def _fit_trapezoid(stations: Float, beside: Float, first: float, last: float) -> tuple[Float, Float, Float]:
    """Return the shape (5,), m, of the best trapezoid, the residuals (N,), and its covariance for unit noise (5, 5)."""

    def residual(shape: Float) -> Float:
        return _trapezoid(stations, shape) - beside

    # Above the median: the tapers are part of the run.
    width = float(np.percentile(beside[(stations >= first) & (stations <= last)], 70))
    taper = min(EMERGENCY_BAY_TAPER, 0.3 * (last - first) + _LEAST_TAPER)
    begin = np.array([first - 0.3 * taper, taper, max(last - first - 1.4 * taper, 5.0), taper, width])
    low = np.array([first - _AROUND, _LEAST_TAPER, 1.0, _LEAST_TAPER, 0.1])
    high = np.array([last, 80.0, last - first + _AROUND, 80.0, 10.0])
    solution = least_squares(
        residual, np.clip(begin, low + 1e-6, high - 1e-6), bounds=(low, high), loss="soft_l1", f_scale=0.2
    )
    # Covariance of least squares for unit noise: (J'J)^-1; the pseudo-inverse, as a taper may be seen by no stretch.
    normal = solution.jac.T @ solution.jac
    return np.asarray(solution.x), residual(solution.x), np.linalg.pinv(normal, hermitian=True)


def _unlike_stretches(side: SideSection, stations: Float, runs: list[slice]) -> list[Unlike]:
    """Return the stretches of runs of wider or narrower pavement; those between which it never closes are one."""
    half, beside = 0.5 * STRETCH * SPACING, excess(side)
    scatter = robust_scale(beside[side.usual & np.isfinite(beside)])
    groups: dict[tuple[int, int], list[slice]] = {}
    for run in runs:
        whole = _whole(run, beside, scatter)
        groups.setdefault((whole.start, whole.stop), []).append(run)
    return [
        Unlike(
            side=side.side,
            start=round(stations[first] - half, 1),
            end=round(stations[behind - 1] + half, 1),
            wider_by=round(float(np.nanmedian(np.concatenate([beside[run] for run in parts]))), 2),
        )
        for (first, behind), parts in groups.items()
    ]


def unlike_mask(others: list[Unlike], stations: Float) -> Bool:
    """Return a mask (K,) of the stretches that lie in any of the stretches that are unlike the cross-section."""
    inside = [(stations >= one.start) & (stations <= one.end) for one in others]
    return np.any(inside, axis=0) if inside else np.zeros(len(stations), dtype=bool)
