"""Model fitted to a measured axis: a chain of linear functions of the station, its first guess and its refinement.

In plan the chain is the curvature (integrated twice it is the position), in height the grade (integrated once it is
the elevation). An element is FREE (a clothoid; a parabola), EQUAL (its value is constant: an arc; a constant grade) or
ZERO (a line). The chain is continuous. Its parameters are the start's pose, the values at the knots and the inner
knots' stations; the kinds of the elements tie values together (`Chain.groups`).

`Plan` and `Heights` are the two sets of data: they measure a chain's residuals and how these change. A first guess
follows a smoothing spline through the points; it has many elements, and is improved by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Float, Int
from ..road.alignment import Alignment, Element

FREE, EQUAL, ZERO = 0, 1, 2
"""Kinds of elements: clothoid or parabola, arc or constant grade, line. In this order each has one freedom less."""
NEAR = 40.0
"""Distance around where they should be that feet are looked for within, m. Chosen: more than the points of an axis lie
apart."""

_QUADRATURE = 2.0
"""Step of the integrals in the Jacobian, m. Chosen: the residuals themselves are exact, so that this slows the steps at
most."""
_SHARE = 0.45
"""Share of its room that a knot may use up in one step. Chosen: below a half, so that neighbours never meet."""
_STIFFNESS = 0.05
"""Stiffness of the first spline, relative to the density of the data. Chosen: it spans gaps and leaves the rest
alone."""


@dataclass(frozen=True)
class Chain:
    """A continuous, piecewise linear curvature or grade by station.

    Attributes:
        pose: pose of the start: x, y (m), heading (rad) in plan; elevation (m) in height.
        knots: (M + 1,) stations, increasing, the first one 0.
        values: (M + 1,) curvatures (1/m), or grades (m/m), at the knots.
        kinds: (M,) FREE, EQUAL or ZERO.
        pinned: whether the start's pose and value are fixed, by the chain of the window before.
    """

    pose: Float
    knots: Float
    values: Float
    kinds: Int
    pinned: bool = False

    @property
    def size(self) -> int:
        """Return the number M of elements."""
        return len(self.kinds)

    @property
    def pose_size(self) -> int:
        """Return the number of the pose's parameters: 2 (across and heading) in plan, 1 (elevation) in height."""
        return 2 if len(self.pose) == 3 else 1

    @property
    def value_columns(self) -> slice:
        """Return the slice of the values at the knots among all parameters (`basis`)."""
        return slice(self.pose_size, self.pose_size + self.size + 1)

    @property
    def slopes(self) -> Float:
        """Return the change of value per metre (M,) of each element."""
        return np.diff(self.values) / np.diff(self.knots)

    @cached_property
    def groups(self) -> tuple[Float, Float]:
        """Return a matrix (M + 1, G) and a vector (M + 1,) with: values at the knots = matrix @ free values + vector.

        Values that an element's kind ties together share a column; those fixed at zero or pinned have none.
        """
        label = np.arange(self.size + 1)
        is_zero = np.zeros(self.size + 1, bool)
        for e, kind in enumerate(self.kinds):
            if kind != FREE:
                label[e + 1] = label[e]
            if kind == ZERO:
                is_zero[label[e]] = True
        is_fixed = is_zero[label]
        if self.pinned:
            is_fixed |= label == 0
        fixed_values = np.where(self.pinned & (label == 0) & ~is_zero[label], self.values[0], 0.0)
        free_labels = np.unique(label[~is_fixed])
        return ((label[:, None] == free_labels) & ~is_fixed[:, None]).astype(np.float64), fixed_values

    def tie_values(self) -> Chain:
        """Return the chain with values that obey the elements' kinds: those tied together are set to their mean."""
        choice, fixed_values = self.groups
        mean = choice.T @ self.values / np.maximum(choice.sum(axis=0), 1.0)
        return replace(self, values=choice @ mean + fixed_values)

    def freedom(self) -> int:
        """Return the number of free parameters."""
        start = 0 if self.pinned else self.pose_size
        return start + self.groups[0].shape[1] + self.size - 1

    def basis(self, free_knots: bool) -> Float:
        """Return the derivatives (F, P) of all F parameters by the P free parameters.

        All parameters in order: pose (across, heading; or elevation), M + 1 values, M - 1 inner knots.
        """
        everything = np.eye(self.pose_size + 2 * self.size)
        values = np.zeros((len(everything), self.groups[0].shape[1]))
        values[self.value_columns] = self.groups[0]
        pose = everything[:, : 0 if self.pinned else self.pose_size]
        knots = everything[:, self.value_columns.stop :]
        return np.hstack((pose, values, knots if free_knots else knots[:, :0]))

    @cached_property
    def alignment(self) -> Alignment:
        """Return a chain of curvatures as an alignment."""
        rows = zip(np.diff(self.knots), self.values[:-1], self.values[1:], strict=True)
        x, y, heading = self.pose
        return Alignment([Element(float(n), float(a), float(b)) for n, a, b in rows], x, y, heading)


def ramp_integrals(
    chain: Chain, stations: Float, grid: Float, weight: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the integrals (N, M) from the start to each station of weight times each element's rising, falling ramp.

    A rising ramp goes from 0 to 1 over its element and is 0 elsewhere, a falling one from 1 to 0.

    Args:
        chain: M elements.
        stations: (N,) m.
        grid: (Q + 1,) stations of the quadrature, which hold all knots and stations, m.
        weight: (Q,) at the middles of the grid's steps (midpoint rule).
    """
    middle, step = 0.5 * (grid[1:] + grid[:-1]), np.diff(grid)
    element = np.clip(np.searchsorted(chain.knots, middle, side="right") - 1, 0, chain.size - 1)
    rise = (middle - chain.knots[element]) / np.diff(chain.knots)[element]
    knot_index = np.searchsorted(grid, chain.knots)
    station_index = np.searchsorted(grid, np.clip(stations, 0.0, chain.knots[-1]))
    owner = np.clip(np.searchsorted(chain.knots, stations, side="right") - 1, 0, chain.size - 1)
    is_passed = np.arange(chain.size) < owner[:, None]
    is_current = np.arange(chain.size) == owner[:, None]
    result = []
    for ramp in (rise, 1.0 - rise):
        total = np.concatenate(([0.0], np.cumsum(ramp * weight * step)))
        element_integrals = total[knot_index[1:]] - total[knot_index[:-1]]
        result.append(
            is_passed * element_integrals + is_current * (total[station_index] - total[knot_index[owner]])[:, None]
        )
    return result[0], result[1]


def quadrature_grid(chain: Chain, stations: Float) -> Float:
    """Return sorted stations, m, at most `_QUADRATURE` apart, that include all knots and given stations."""
    inner_stations = stations[(stations > 0.0) & (stations < chain.knots[-1])]
    even_stations = np.linspace(0.0, chain.knots[-1], int(chain.knots[-1] / _QUADRATURE) + 2)
    return np.unique(np.concatenate((inner_stations, chain.knots, even_stations[1:-1])))


def assemble_jacobian(pose: Float, rise: Float, fall: Float, slopes: Float) -> Float:
    """Return the Jacobian (N, F) by pose, values and inner knots.

    A knot's value raises the ramp before it and the one after it; a knot that moves at constant value changes its
    elements by their slopes times the same ramps.

    Args:
        pose: (N, 1 or 2) derivatives by the pose.
        rise, fall: (N, M) derivatives by the elements' rising and falling ramps.
        slopes: (M,) change of value per metre.
    """
    count, size = rise.shape
    values = np.zeros((count, size + 1))
    values[:, :-1] += fall
    values[:, 1:] += rise
    knots = -slopes[:-1] * rise[:, :-1] - slopes[1:] * fall[:, 1:]
    return np.hstack((pose, values, knots))


class Spacings(NamedTuple):
    """Distances between knots with which a search begins, m.

    Attributes:
        exact: distance for data without noise: small enough to tell short elements apart.
        first: distance for all other data.
        finest: smallest distance that is tried where the first one cannot keep the tolerance.
    """

    exact: float
    first: float
    finest: float


@dataclass(frozen=True)
class Plan:
    """Map points of an axis, in order; a residual is the weighted offset from a chain of curvatures.

    Attributes:
        points, weights: (N, 2) m, and (N,).
        min_length: length of the shortest element allowed, m.
        reach: distance that a foot may move between two steps of a fit, m.
        limit: largest absolute curvature, 1/m.
        snaps: kinds that an element may be snapped to.
        spacings: distances between knots with which a search begins.
    """

    points: Float
    weights: Float
    min_length: float = 0.0
    reach: float = 0.0
    limit: ClassVar[float] = 0.2
    snaps: ClassVar[tuple[int, ...]] = (EQUAL, ZERO)
    spacings: ClassVar[Spacings] = Spacings(7.0, 20.0, 5.0)

    def measure(self, chain: Chain, stations: Float) -> tuple[Float, Float]:
        """Return the points' stations (N,) on the chain, near the given ones, and weighted residuals (N,), m."""
        feet, offset = chain.alignment.project_near(self.points, stations, self.reach)
        return feet, self.weights * offset

    def jacobian(self, chain: Chain, stations: Float) -> Float:
        """Return the derivatives (N, F) of the weighted offsets by all F parameters (see `Chain.basis`).

        A change of curvature at s' turns the rest of the road about the point there. The offset at s thus falls by
        t(s) . (z(s) - z(s')) for each radian; the foot's own shift has no effect.
        """
        # As complex numbers z = x + i y, with t = exp(i heading): t . (z(s) - z(s')) is the real part of
        # conj(t) (z(s) - z(s')). Integrated over a ramp w(s') it is Re(conj(t) z) W0 - Re(conj(t) W1), with the
        # integrals W0 of w and W1 of w z; the offset falls by that.
        alignment = chain.alignment
        grid = quadrature_grid(chain, stations)
        origin = np.array([alignment.x, alignment.y])
        position, heading, _ = alignment.frame(stations)
        z = (position - origin) @ np.array([1.0, 1j])
        tangent = np.exp(-1j * heading)
        weight = (alignment.position(0.5 * (grid[1:] + grid[:-1])) - origin) @ np.array([1.0, 1j])
        ramp_sums = ramp_integrals(chain, stations, grid, np.ones(len(weight)))
        ramp_moments = ramp_integrals(chain, stations, grid, weight)
        lever = (tangent * z).real
        rise, fall = (
            (tangent[:, None] * b).real - lever[:, None] * a for a, b in zip(ramp_sums, ramp_moments, strict=True)
        )
        start_shift = -(tangent * np.exp(1j * alignment.start_heading)).real
        return self.weights[:, None] * assemble_jacobian(
            np.column_stack((start_shift, -lever)), rise, fall, chain.slopes
        )

    def move_pose(self, pose: Float, step: Float) -> Float:
        """Return the pose (x, y, heading) after a step (m to the left, rad)."""
        return pose + np.array([-np.sin(pose[2]) * step[0], np.cos(pose[2]) * step[0], step[1]])

    def fit_window(self, indices: Int, spacing: float, start: Start | None, origin: float) -> ChainFit:
        """Return the fit of a chain, its knots fixed ``spacing`` (m) apart, to the points of one window.

        Args:
            indices: indices of the points.
            spacing: distance between knots, m.
            start: pose and value at the end of the previous window; None for the first one.
            origin: station at which the window begins, m.
        """
        part = Plan(self.points[indices], self.weights[indices], 0.4 * spacing, max(NEAR, 2.0 * spacing))
        return refine(part, *_first_plan(part.points, spacing, start), False, 8)

    def state_at(self, chain: Chain, station: float) -> Start:
        """Return pose (x, y, heading) and curvature (1/m) of the chain at a station (m)."""
        position, heading, value = chain.alignment.frame(station)
        return np.append(position, heading), float(value)


@dataclass(frozen=True)
class Heights:
    """Elevations at stations; a residual is the weighted height above a chain of grades. Otherwise as `Plan`.

    Attributes:
        heights, weights, stations: (N,) m, 1, and m along the whole axis.
        min_length, limit, snaps, spacings: as in `Plan`.
    """

    heights: Float
    weights: Float
    stations: Float
    min_length: float = 0.0
    limit: ClassVar[float] = 10.0
    snaps: ClassVar[tuple[int, ...]] = (EQUAL,)
    spacings: ClassVar[Spacings] = Spacings(20.0, 40.0, 40.0)

    def measure(self, chain: Chain, stations: Float) -> tuple[Float, Float]:
        """Return the given stations (N,) and the weighted heights above a chain of grades (N,), m."""
        return stations, self.weights * (self.heights - elevations(chain, stations))

    def jacobian(self, chain: Chain, stations: Float) -> Float:
        """Return the derivatives (N, F) of the weighted residuals by all F parameters (see `Chain.basis`)."""
        grid = quadrature_grid(chain, stations)
        rise, fall = ramp_integrals(chain, stations, grid, np.ones(len(grid) - 1))
        return -self.weights[:, None] * assemble_jacobian(np.ones((len(stations), 1)), rise, fall, chain.slopes)

    def move_pose(self, pose: Float, step: Float) -> Float:
        """Return the elevation (1,) after a step (1,), m."""
        return pose + step

    def fit_window(self, indices: Int, spacing: float, start: Start | None, origin: float) -> ChainFit:
        """Return the fit of a chain of grades to the heights of one window; arguments as `Plan.fit_window`."""
        part = Heights(self.heights[indices], self.weights[indices], self.stations[indices] - origin, 0.8 * spacing)
        return refine(part, _first_heights(part.stations, part.heights, spacing, start), part.stations, False, 8)

    def state_at(self, chain: Chain, station: float) -> Start:
        """Return elevation (1,), m, and grade of the chain at a station (m)."""
        return elevations(chain, np.array([station])), float(np.interp(station, chain.knots, chain.values))


AxisData = Plan | Heights
Start = tuple[Float, float]
"""Pose and value (curvature or grade) at the end of the previous window, where the next one begins."""


def elevations(chain: Chain, stations: Float) -> Float:
    """Return the elevations (N,), m, at stations (N,): the integral of a chain of grades, straight beyond its ends."""
    gap = np.diff(chain.knots)
    base = chain.pose[0] + np.concatenate(([0.0], np.cumsum(0.5 * gap * (chain.values[:-1] + chain.values[1:]))))
    element = np.clip(np.searchsorted(chain.knots, stations, side="right") - 1, 0, chain.size - 1)
    # z(u) = z0 + u (g + g' u / 2) on an element whose grade begins with g and changes by g' per metre.
    distance = stations - chain.knots[element]
    clipped_distance = np.clip(distance, 0.0, gap[element])
    elevation = base[element] + clipped_distance * (
        chain.values[element] + 0.5 * chain.slopes[element] * clipped_distance
    )
    return elevation + (distance - clipped_distance) * np.where(distance < 0.0, chain.values[0], chain.values[-1])


@dataclass
class ChainFit:
    """A chain fitted to data, with the points' stations and weighted residuals on it."""

    data: AxisData
    chain: Chain
    stations: Float
    residuals: Float

    @property
    def sum_of_squares(self) -> float:
        """Return the weighted sum of squared residuals, m^2."""
        return float(self.residuals @ self.residuals)

    @property
    def rms(self) -> float:
        """Return the root mean square of the weighted residuals, m."""
        return float(np.sqrt(self.sum_of_squares / len(self.residuals)))

    @property
    def noise(self) -> float:
        """Return the data's standard deviation, m: the root of the sum of squares over the degrees of freedom."""
        spare = float(self.data.weights.sum()) - self.chain.freedom()
        return float(np.sqrt(self.sum_of_squares / max(spare, 1.0)))

    @property
    def p95(self) -> float:
        """Return the 95th percentile of the absolute weighted residuals, m."""
        return float(np.percentile(np.abs(self.residuals), 95))

    @cached_property
    def linear(self) -> tuple[Float, Float]:
        """Return R (F, F), b (F,): after a step d (F,) the sum of squares is |R d + b|^2 plus a constant."""
        return triangular(self.data.jacobian(self.chain, self.stations), self.residuals)


def knot_room(chain: Chain, shortest: float) -> Float:
    """Return the distance (M - 1,), m, that each inner knot may move while elements keep a shortest length."""
    lengths = np.diff(chain.knots)
    room = np.maximum(lengths - shortest, 0.02 * lengths)  # those that are already shorter may still move a little
    return 0.5 * np.minimum(room[:-1], room[1:])


def apply_step(data: AxisData, chain: Chain, step: Float) -> Chain:
    """Return the chain after a step (F,) of all its parameters, knots kept apart and values tied."""
    values = np.clip(chain.values + step[chain.value_columns], -data.limit, data.limit)
    spare = _SHARE * np.maximum(np.diff(chain.knots) - data.min_length, 0.0)
    knots = chain.knots.copy()
    knots[1:-1] += np.clip(step[chain.value_columns.stop :], -spare[:-1], spare[1:])
    pose = data.move_pose(chain.pose, step[: chain.pose_size])
    return replace(chain, pose=pose, values=values, knots=knots).tie_values()


def least_squares(matrix: Float, rhs: Float) -> Float:
    """Return the least-squares solution x of ``matrix x = rhs`` (full rank), by QR, as chains are ill-conditioned."""
    return np.linalg.solve(*triangular(matrix, rhs))


def triangular(matrix: Float, rhs: Float) -> tuple[Float, Float]:
    """Return R (P, P) and Q' b (P,) of a matrix Q R (N, P), N > P, and a right side b (N,).

    The right side is taken along as one more column, so that Q, the greater part of the work, is never put together.
    """
    factor = np.asarray(np.linalg.qr(np.column_stack((matrix, rhs)), mode="r"))
    return factor[: matrix.shape[1], :-1], factor[: matrix.shape[1], -1]


def knot_penalty(data: AxisData, chain: Chain, width: int) -> Float:
    """Return rows (M - 1, width) that penalise steps of the inner knots, the last parameters, relative to their room.

    Far from its place a knot's linear effect is worth nothing: without this, every knot would seem dispensable.
    """
    rows = np.zeros((chain.size - 1, width))
    if chain.size > 1:
        rows[:, -(chain.size - 1) :] = np.diag(1.0 / knot_room(chain, data.min_length))
    return rows


def refine(data: AxisData, chain: Chain, stations: Float, free_knots: bool, steps: int) -> ChainFit:
    """Return a chain's fit improved by Levenberg-Marquardt in all its free parameters, in at most ``steps`` steps.

    Knots are damped by their room, scaled by the current sum of squares, so that exact data converge quadratically.
    """
    fit = ChainFit(data, chain, *data.measure(chain, stations))
    basis = chain.basis(free_knots)
    # Less damping after a step that helps, more after one that doesn't; the factors are chosen.
    damping, system = 1.0, _system(fit, basis, free_knots)
    for _ in range(steps if basis.shape[1] else 0):
        upper_factor, target, knot_rows, scale = system
        weight = np.sqrt(damping * (fit.sum_of_squares + 1e-12 * len(fit.residuals)))
        rows = np.vstack((upper_factor, weight * knot_rows, np.sqrt(1e-7 * damping) * np.eye(upper_factor.shape[1])))
        step = least_squares(rows, np.concatenate((target, np.zeros(len(rows) - len(target))))) / scale
        trial_chain = apply_step(data, fit.chain, basis @ step)
        trial = ChainFit(data, trial_chain, *data.measure(trial_chain, fit.stations))
        if trial.sum_of_squares < fit.sum_of_squares:
            gain = 1.0 - trial.sum_of_squares / fit.sum_of_squares
            fit, damping = trial, max(0.2 * damping, 1e-6)
            if gain < 1e-4 or fit.sum_of_squares < 1e-16 * len(fit.residuals):
                break
            system = _system(fit, basis, free_knots)
        else:
            damping *= 6.0
            if damping > 1e5:
                break
    return fit


def _system(fit: ChainFit, basis: Float, free_knots: bool) -> tuple[Float, ...]:
    """Return the linear problem of one step: R (P, P), right side (P,), the knots' penalty (M - 1, P), scale (P,)."""
    matrix = fit.data.jacobian(fit.chain, fit.stations) @ basis
    scale = column_scale(matrix)
    upper_factor, projected_residuals = triangular(matrix / scale, fit.residuals)
    knot_rows = knot_penalty(fit.data, fit.chain, len(scale)) / scale if free_knots else np.zeros((0, len(scale)))
    return upper_factor, -projected_residuals, knot_rows, scale


def column_scale(matrix: Float) -> Float:
    """Return the columns' Euclidean norms (P,), with a floor so that dividing by them doesn't blow up noise."""
    scale = np.sqrt((matrix**2).sum(axis=0))
    return np.maximum(scale, max(1e-9 * scale.max(initial=0.0), 1e-300))


def _first_plan(points: Float, spacing: float, start: Start | None) -> tuple[Chain, Float]:
    """Return a first guess, a chain of curvatures along points (N, 2), m, and the points' stations (N,), m.

    The curvatures are fitted to the spline's heading, not taken from it, so that the chain doesn't drift away.
    """
    anchored_points = points if start is None else np.vstack((start[0][:2], points))
    run = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(anchored_points, axis=0).T))))
    sample_stations = np.linspace(0.0, run[-1], int(run[-1] / min(1.0, 0.1 * spacing)) + 20)
    curve = _smooth_values(run, anchored_points, 0.5 * spacing, sample_stations)
    chord_vectors = np.diff(curve, axis=0)
    station = np.concatenate(([0.0], np.cumsum(np.hypot(*chord_vectors.T))))
    heading = np.unwrap(np.arctan2(chord_vectors[:, 1], chord_vectors[:, 0]))
    knots = _even_knots(station[-1], spacing)
    heading_matrix = np.column_stack((np.ones(len(heading)), _hat_integrals(0.5 * (station[1:] + station[:-1]), knots)))
    if start is None:
        solution = np.linalg.lstsq(heading_matrix, heading, rcond=1e-10)[0]
        pose = np.append(curve[0], solution[0])
    else:
        pose, value = start
        heading += 2.0 * np.pi * np.round((pose[2] - heading[0]) / (2.0 * np.pi))
        free_values = np.linalg.lstsq(
            heading_matrix[:, 2:], heading - pose[2] - value * heading_matrix[:, 1], rcond=1e-10
        )[0]
        solution = np.concatenate(([pose[2], value], free_values))
    chain = Chain(pose, knots, np.clip(solution[1:], -0.2, 0.2), _free(knots), start is not None)
    return chain, np.interp(run, sample_stations, station)[len(anchored_points) - len(points) :]


def _first_heights(station: Float, heights: Float, spacing: float, start: Start | None) -> Chain:
    """Return a first guess: a chain of grades along heights (N,) at stations (N,) from the part's begin, m."""
    if start is not None:
        station, heights = np.append(0.0, station), np.append(start[0][0], heights)
    knots = _even_knots(station[-1], spacing)
    curve = _smooth_values(station, heights[:, None], 0.5 * spacing, knots)[:, 0]
    grade = np.diff(curve) / np.diff(knots)
    values = np.concatenate((grade[:1], 0.5 * (grade[1:] + grade[:-1]), grade[-1:]))
    if start is None:
        return Chain(curve[:1], knots, values, _free(knots))
    values[0] = start[1]
    return Chain(start[0], knots, values, _free(knots), True)


def _even_knots(length: float, spacing: float) -> Float:
    """Return evenly spaced knots (stations, m) from 0 to the length, about ``spacing`` apart, at least two."""
    return np.linspace(0.0, length, max(1, round(length / spacing)) + 1)


def _free(knots: Float) -> Int:
    """Return kinds (M,) that make all elements between knots (M + 1,) free."""
    return np.full(len(knots) - 1, FREE)


def _smooth_values(run: Float, values: Float, spacing: float, sample_places: Float) -> Float:
    """Return the values (M, D) at sample places (M,), m, of a cubic smoothing spline of values (N, D) at ``run`` (N,).

    Its third differences are penalised, so that it goes on smoothly through gaps in the data.
    """
    count = max(1, int(np.ceil(run[-1] / spacing)))
    width = run[-1] / count
    matrix = _cubic(run / width, count)
    # Eilers and Marx 1996 (P-splines): (B'B + lambda D'D) a = B'y, here with D of third differences.
    third_difference = np.diff(np.eye(count + 3), 3, axis=0)
    normal = matrix.T @ matrix + _STIFFNESS * max(len(run) / count, 1e-3) * third_difference.T @ third_difference
    normal[np.diag_indices(len(normal))] += 1e-10 * len(run) / count  # two points alone determine no spline
    centre = values.mean(axis=0)
    return _cubic(sample_places / width, count) @ np.linalg.solve(normal, matrix.T @ (values - centre)) + centre


def _cubic(knot_position: Float, count: int) -> Float:
    """Return the values (N, count + 3) of the cubic B-splines over ``count`` unit intervals at places (N,)."""
    interval = np.clip(knot_position.astype(np.int64), 0, count - 1)
    fraction = knot_position - interval
    # Uniform cubic B-splines: (1 - f)^3, 3 f^3 - 6 f^2 + 4, -3 f^3 + 3 f^2 + 3 f + 1 and f^3, each over 6.
    weights = (
        np.stack(
            (
                (1 - fraction) ** 3,
                3 * fraction**3 - 6 * fraction**2 + 4,
                -3 * fraction**3 + 3 * fraction**2 + 3 * fraction + 1,
                fraction**3,
            ),
            axis=1,
        )
        / 6
    )
    matrix = np.zeros((len(knot_position), count + 3))
    matrix[np.arange(len(knot_position))[:, None], interval[:, None] + np.arange(4)] = weights
    return matrix


def _hat_integrals(station: Float, knots: Float) -> Float:
    """Return the integrals (N, K) of each knot's hat function from the first of evenly spaced knots to each station."""
    width = knots[1] - knots[0]
    # The hat 1 - |v| integrated from -1: (v + 1)^2 / 2 up to its top, 1/2 + v - v^2 / 2 behind it; of the first knot's
    # the half before the knot isn't there.
    distance = np.clip((station[:, None] - knots) / width, -1.0, 1.0)
    integrals = np.where(distance < 0.0, 0.5 * (distance + 1.0) ** 2, 0.5 + distance - 0.5 * distance**2)
    integrals[:, 0] -= 0.5
    return width * integrals
