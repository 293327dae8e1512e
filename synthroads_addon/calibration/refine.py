"""Settings of a moving scanner, refined until a simulated scan has the statistics of the real one.

Estimates by formula take the points' noise apart one cause after the other: what two causes have in common, or what a
parabola follows of a strip's step, is counted twice or not at all. So the settings that they give are only where the
search begins. The real cloud's own pavement is scanned anew with them (`simulation`), window by window; the
medians of its patches' statistics (`cloud.selection.patches`) are compared with the real ones, and the settings moved
until both agree: the method of simulated moments (McFadden 1989, Econometrica 57). The random numbers stay the same
from step to step, so that what a change does isn't hidden by them. The search is Gauss and Newton's with Broyden's
updates of the derivatives, and each setting is held by a weak prior about its beginning.

Scatter of the statistics over the windows says how much each of them counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..base.arrays import Bool, Float
from ..base.errors import InputError
from ..base.random_streams import stream
from ..cloud.selection.classes import RealClass
from ..cloud.selection.patches import FEATURES, make_patches

_WINDOWS = 8
"""Windows of the real pavement that are scanned anew. Chosen: their scatter is the statistics' own."""
_NARROWEST, _WIDEST, _POINTS = 8.0, 30.0, 15_000.0
"""Edge of such a window, m, and points of one that is pavement all over. Chosen: several patches in each."""
_REACH, _SHARE = 1.5, 0.5
"""A place is pavement where so large a share of the usual points lies within so many usual distances of it. Chosen: at
the pavement's edge half of them are missing."""
_USED = tuple(name for name in FEATURES if name not in ("curvature", "level_db"))
"""Statistics that are compared: a patch's curvature is its road's, and its level says how the whole road varies."""
_LOGARITHMIC = ("residual_mm", "intensity_iqr_db", "neighbour_noise_db", "spacing_variation", "eighth_neighbour")
"""Statistics that are compared by their logarithms. Chosen: they are scales, and vary by factors."""
_BRIGHTNESS_GROUPS = 8
"""Groups of brightness between which a patch's range noise is compared. Chosen: a slope and its noise."""
_PRIOR = 1.5
"""Standard deviation of a setting about where the search begins, in the search's own units. Chosen: a factor of 4.5
where the search goes by logarithms."""
_STEP, _LARGEST_MOVE = 0.25, 0.6
"""Step of the derivatives, and largest move, in the search's own units. Chosen: above the simulation's noise; within
what is nearly linear."""
_ROUNDS, _MOVES = 3, 3
"""How often the derivatives are measured, and moves with their updates. Chosen: bounds the scans that are simulated."""
_LEAST_SCATTER = 0.01
"""Least deviation of a statistic's mean over the windows. Chosen: no statistic is fitted more exactly."""
_LEAST_LOGARITHM = 1e-6
"""Coarse numbers and lattices have statistics of 0."""

Simulate = Callable[[Mapping[str, float], int], RealClass]
"""Gives the points of a level pavement about the origin, scanned with settings and a seed."""


@dataclass(frozen=True)
class Setting:
    """A setting that is fitted.

    Attributes:
        path: in the scenario, or a name of the caller's.
        begin: value at which the search begins.
        low, high: limits.
        logarithmic: whether the search goes by the logarithm; else by the value over ``unit``.
        unit: one step's size where it isn't.
    """

    path: str
    begin: float
    low: float
    high: float
    logarithmic: bool = True
    unit: float = 1.0

    def value(self, x: float) -> float:
        """Return the setting's value at a place of the search, 0 where it begins."""
        value = self.begin * float(np.exp(x)) if self.logarithmic else self.begin + x * self.unit
        return min(max(value, self.low), self.high)

    def reach(self) -> tuple[float, float]:
        """Return the places of the search at which the setting comes to its limits."""
        if not self.logarithmic:
            return (self.low - self.begin) / self.unit, (self.high - self.begin) / self.unit
        return float(np.log(self.low / self.begin)), float(np.log(self.high / self.begin))


@dataclass(frozen=True)
class Refined:
    """Settings that were refined.

    Attributes:
        values: of each setting, by its path.
        real, before, after: the statistics of the real cloud, and of the simulated ones at the beginning and the end.
    """

    values: dict[str, float]
    real: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return settings and statistics as JSON data, numbers to four digits."""
        return {
            name: {key: float(f"{value:.4g}") for key, value in part.items()} for name, part in asdict(self).items()
        }


def refine_settings(road: RealClass, settings: Sequence[Setting], simulate: Simulate) -> Refined:
    """Return the settings with which simulated scans of a real pavement have its statistics.

    Args:
        road: points of the real pavement, with intensities in proportion to the light.
        settings: to be fitted.
        simulate: scans a square of `window_edge` about the origin, or more of it.

    Raises:
        InputError: the real pavement, or a simulated one, has too few points in patches.
    """
    windows = _windows(road)
    names, real_moments = _moments(road)

    def moments(x: Float) -> Float:
        """Return the statistics (W, M) of scans simulated in W windows, with settings at a place of the search."""
        values = {setting.path: setting.value(place) for setting, place in zip(settings, x, strict=True)}
        return np.array([_moments(window.cut(simulate(values, number)))[1] for number, window in enumerate(windows)])

    first_moments = moments(np.zeros(len(settings)))
    if not np.isfinite(first_moments).all(axis=1).any():
        raise InputError(
            "--real", None, "has no window of pavement in which a simulated scan fills patches; see --formulas"
        )
    # Standard error of each statistic's mean over the windows.
    scatter = np.maximum(np.nanstd(first_moments, axis=0) / np.sqrt(len(windows)), _LEAST_SCATTER)

    def residual(x: Float) -> Float:
        """Return the deviations (M,) of the mean statistics from the real ones, over their scatter."""
        return np.asarray((np.nanmean(moments(x), axis=0) - real_moments) / scatter)

    start_residual = np.asarray((np.nanmean(first_moments, axis=0) - real_moments) / scatter)
    limits = np.array([setting.reach() for setting in settings]).T
    x, end_residual = _search(residual, start_residual, limits)
    values = {setting.path: setting.value(place) for setting, place in zip(settings, x, strict=True)}
    # A residual back to a statistic: that of the real cloud has none.
    residuals = (0.0 * start_residual, start_residual, end_residual)
    statistics = [dict(zip(names, map(float, real_moments + scatter * r), strict=True)) for r in residuals]
    return Refined(values, *statistics)


def _search(residual: Callable[[Float], Float], start: Float, limits: Float) -> tuple[Float, Float]:
    """Return the place (N,) at which residuals are least, by Gauss and Newton with Broyden's updates, and these (M,).

    Args:
        residual: over the statistics' scatter, at a place (N,) of the search.
        start: (M,) the residuals at 0.
        limits: (2, N) least and largest places.
    """
    least_x, largest_x = limits
    x, r = np.zeros(len(least_x)), start
    for _ in range(_ROUNDS):
        # One-sided differences, to the side with more room: beyond its limits a setting stays what it is.
        up, down = largest_x - x, x - least_x
        steps = np.where(up >= down, np.minimum(_STEP, up), -np.minimum(_STEP, down))
        jacobian = np.column_stack([(residual(x + step) - r) / step.sum() for step in np.diag(steps)])
        damping = 1.0
        for _ in range(_MOVES):
            # A normal prior about 0 keeps settings that the statistics don't tell where they begin (ridge regression):
            # (J'J + I / s^2) delta = -(J'r + x / s^2), the diagonal damped as by Marquardt.
            normal = jacobian.T @ jacobian + np.eye(len(x)) / _PRIOR**2
            gradient = jacobian.T @ r + x / _PRIOR**2
            delta = np.linalg.solve(normal + (damping - 1.0) * np.diag(np.diag(normal)), -gradient)
            delta *= min(1.0, _LARGEST_MOVE / float(np.abs(delta).max()))
            delta = np.clip(x + delta, least_x, largest_x) - x
            new_r = residual(x + delta)
            # Broyden 1965: J += (change of r - J delta) delta' / |delta|^2; also where the step is refused, as a scan
            # is costly, and tells the slope all the same.
            jacobian += np.outer(new_r - r - jacobian @ delta, delta) / max(float(delta @ delta), 1e-12)
            if _cost(new_r, x + delta) < _cost(r, x):
                x, r, damping = x + delta, new_r, max(damping / 2.0, 1.0)
            else:
                damping *= 3.0
    return x, r


def _cost(residual: Float, x: Float) -> float:
    """Return the sum of squared residuals (M,), and of the places x (N,) over the prior's standard deviation."""
    return float(residual @ residual + x @ x / _PRIOR**2)


@dataclass(frozen=True)
class _Window:
    """A window of the real pavement: simulated points are cut to where its points are.

    Attributes:
        edge: of the window, m.
        tree: of its points in plan, from its middle, m.
        reach: within which points are counted, m.
        fewest: points within that reach where there is pavement.
    """

    edge: float
    tree: cKDTree
    reach: float
    fewest: float

    def cut(self, scan: RealClass) -> RealClass:
        """Return the simulated points that lie on the window's pavement, with the others as points beside it."""
        is_pavement = self.holds(scan.place[:, :2])
        return replace(select_points(scan, is_pavement), beside=scan.place[~is_pavement, :2])

    def holds(self, place: Float) -> Bool:
        """Return a mask (N,) of the places (N, 2), m from the window's middle, that are pavement."""
        is_inside = (np.abs(place) < self.edge / 2.0).all(axis=1)
        count = np.zeros(len(place))
        count[is_inside] = self.tree.query_ball_point(place[is_inside], self.reach, return_length=True)
        return np.asarray(count >= self.fewest)


def window_edge(density: float) -> float:
    """Return the edge of the square about the origin that a simulated scan of a density (1/m2) must cover, m."""
    return float(np.clip(np.sqrt(_POINTS / density), _NARROWEST, _WIDEST))


def select_points(road: RealClass, keep: Bool) -> RealClass:
    """Return the points of a class that a mask (N,) keeps; its number of zeros stays."""
    per_point = ("place", "intensity", "distance", "incidence", "returns")
    parts = {name: getattr(road, name)[keep] for name in per_point}
    return replace(road, **parts, time=None if road.time is None else road.time[keep])


def _windows(road: RealClass) -> list[_Window]:
    """Return `_WINDOWS` windows of a real pavement about points that are drawn at random."""
    place = road.place[:, :2]
    tree = cKDTree(place)
    random = stream(0, "calibration windows")
    centres = place[random.choice(len(place), _WINDOWS, replace=len(place) < _WINDOWS)]
    density = float(np.median(make_patches(road, "--real").density))
    edge, reach = window_edge(density), _REACH / np.sqrt(density)
    # A circle of that radius about a place of even pavement holds pi _REACH^2 points.
    fewest = _SHARE * np.pi * _REACH**2
    window_rows = (tree.query_ball_point(centre, edge) for centre in centres)
    return [
        _Window(edge, cKDTree(place[rows] - centre), reach, fewest)
        for centre, rows in zip(centres, window_rows, strict=True)
    ]


def _moments(road: RealClass) -> tuple[list[str], Float]:
    """Return the names and values (M,) of the statistics that are compared: medians over patches, NaN without any."""
    names = [*_USED, "density", "faint_share"]
    try:
        patches = make_patches(road, "--real")
    except InputError:
        return names, np.full(len(names), np.nan)
    medians = dict(zip(FEATURES, np.median(patches.values, axis=0), strict=True))
    medians |= {name: float(np.log(max(medians[name], _LEAST_LOGARITHM))) for name in _LOGARITHMIC}
    values = [float(medians[name]) for name in _USED]
    return names, np.array([*values, float(np.log(np.median(patches.density))), _faint_share(road)])


def _faint_share(road: RealClass) -> float:
    """Return the change of the heights' deviation from the faintest to the brightest points, over its mean.

    Heights and brightness are those about the mean of the square metre that a point lies in.
    """
    level = np.log(road.intensity)
    cell = np.unique(np.floor(road.place[:, :2]).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(cell)
    height, brightness = (values - (np.bincount(cell, values) / count)[cell] for values in (road.place[:, 2], level))
    in_full_cell = count[cell] >= _BRIGHTNESS_GROUPS
    order = np.argsort(brightness[in_full_cell])
    groups = np.array_split(height[in_full_cell][order], _BRIGHTNESS_GROUPS)
    sigma = [float(group.std()) for group in groups]
    # Slope of a straight line from the faintest group, at -1/2, to the brightest, at 1/2.
    places = np.linspace(-0.5, 0.5, _BRIGHTNESS_GROUPS)
    return float(np.polyfit(places, sigma, 1)[0] / max(np.mean(sigma), 1e-9))
