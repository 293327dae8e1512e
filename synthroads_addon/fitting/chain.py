"""Model fitted to a measured axis: a chain of linear functions of the station, and its least-squares refinement.

In plan the chain is the curvature (integrated twice it is the position), in height the grade (integrated once it is
the elevation). An element is FREE (a clothoid; a parabola), EQUAL (its value is constant: an arc; a constant grade) or
ZERO (a line). The chain is continuous. Its parameters are the start's pose, the values at the knots and the inner
knots' stations; the kinds of the elements tie values together (`Chain.groups`).

`Plan` and `Heights` are the two sets of data: they measure a chain's residuals and how these change.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Float, Int
from ..road.alignment import Alignment, Element

FREE, EQUAL, ZERO = 0, 1, 2

_QUADRATURE = 2.0  # m, step of the integrals in the Jacobian; the residuals themselves are exact
_SHARE = 0.45  # of its room that a knot may use up in one step, so that neighbours never meet


@dataclass(frozen=True)
class Chain:
    """A continuous, piecewise linear function of the station.

    Attributes:
        pose: of the start: x, y, heading in plan; the elevation in height.
        knots: (M + 1,) stations, increasing, the first one 0.
        values: (M + 1,) curvatures 1/m, or grades.
        kinds: (M,) FREE, EQUAL or ZERO.
        pinned: the start's pose and value are given by what comes before.
    """

    pose: Float
    knots: Float
    values: Float
    kinds: Int
    pinned: bool = False

    @property
    def size(self) -> int:
        """Number M of elements."""
        return len(self.kinds)

    @property
    def turns(self) -> int:
        """Number of the pose's parameters: across and heading, or elevation."""
        return 2 if len(self.pose) == 3 else 1

    @property
    def value_columns(self) -> slice:
        """Where the values stand among all parameters (`basis`)."""
        return slice(self.turns, self.turns + self.size + 1)

    @property
    def slopes(self) -> Float:
        """(M,) change of value per metre."""
        return np.diff(self.values) / np.diff(self.knots)

    @cached_property
    def groups(self) -> tuple[Float, Float]:
        """Return (M + 1, G) and (M + 1,): values = first @ free values + second."""
        label = np.arange(self.size + 1)
        zero = np.zeros(self.size + 1, bool)
        for e, kind in enumerate(self.kinds):
            if kind != FREE:
                label[e + 1] = label[e]
            if kind == ZERO:
                zero[label[e]] = True
        held = zero[label]
        if self.pinned:
            held |= label == 0
        given = np.where(self.pinned & (label == 0) & ~zero[label], self.values[0], 0.0)
        names = np.unique(label[~held])
        return ((label[:, None] == names) & ~held[:, None]).astype(np.float64), given

    def tie_values(self) -> Chain:
        """Return the chain with values that obey the kinds: the mean of each group."""
        choice, given = self.groups
        mean = choice.T @ self.values / np.maximum(choice.sum(axis=0), 1.0)
        return replace(self, values=choice @ mean + given)

    def freedom(self) -> int:
        """Number of free parameters."""
        start = 0 if self.pinned else self.turns
        return start + self.groups[0].shape[1] + self.size - 1

    def basis(self, free_knots: bool) -> Float:
        """Return (F, P): the change of all F parameters for each of the P free ones.

        All are: pose (across, heading; or elevation), M + 1 values, M - 1 inner knots.
        """
        everything = np.eye(self.turns + 2 * self.size)
        values = np.zeros((len(everything), self.groups[0].shape[1]))
        values[self.value_columns] = self.groups[0]
        pose = everything[:, : 0 if self.pinned else self.turns]
        knots = everything[:, self.value_columns.stop :]
        return np.hstack((pose, values, knots if free_knots else knots[:, :0]))

    @cached_property
    def alignment(self) -> Alignment:
        """Return the chain of curvatures as an alignment."""
        rows = zip(np.diff(self.knots), self.values[:-1], self.values[1:], strict=True)
        x, y, heading = self.pose
        return Alignment([Element(float(n), float(a), float(b)) for n, a, b in rows], x, y, heading)


class AxisData(Protocol):
    """Points to be fitted: what `refine` and the search need of them."""

    @property
    def least(self) -> float:
        """Length of the shortest element, m."""

    @property
    def limit(self) -> float:
        """Largest absolute value."""

    @property
    def snaps(self) -> tuple[int, ...]:
        """Kinds that an element may be snapped to."""

    def measure(self, chain: Chain, stations: Float) -> tuple[Float, Float]:
        """Return stations (N,) of the points on the chain, from the former ones, and residuals (N,), m."""

    def jacobian(self, chain: Chain, stations: Float) -> Float:
        """Return (N, F) derivatives of the residuals by all parameters (see `Chain.basis`)."""

    def move_pose(self, pose: Float, step: Float) -> Float:
        """Return the pose after a step of its parameters."""


def ramp_integrals(
    chain: Chain, stations: Float, grid: Float, weight: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return two (N, M): from the start to each station, weight times each element's rising and falling ramp.

    `grid` (Q + 1) holds all knots and stations; `weight` (Q) is given at the middles of its steps.
    """
    middle, step = 0.5 * (grid[1:] + grid[:-1]), np.diff(grid)
    element = np.clip(np.searchsorted(chain.knots, middle, side="right") - 1, 0, chain.size - 1)
    rise = (middle - chain.knots[element]) / np.diff(chain.knots)[element]
    knot = np.searchsorted(grid, chain.knots)
    place = np.searchsorted(grid, np.clip(stations, 0.0, chain.knots[-1]))
    owner = np.clip(np.searchsorted(chain.knots, stations, side="right") - 1, 0, chain.size - 1)
    past = np.arange(chain.size) < owner[:, None]
    within = np.arange(chain.size) == owner[:, None]
    result = []
    for ramp in (rise, 1.0 - rise):
        total = np.concatenate(([0.0], np.cumsum(ramp * weight * step)))
        whole = total[knot[1:]] - total[knot[:-1]]
        result.append(past * whole + within * (total[place] - total[knot[owner]])[:, None])
    return result[0], result[1]


def quadrature_grid(chain: Chain, stations: Float) -> Float:
    """Return sorted stations that hold all knots and points and lie at most `_QUADRATURE` apart."""
    inside = stations[(stations > 0.0) & (stations < chain.knots[-1])]
    even = np.linspace(0.0, chain.knots[-1], int(chain.knots[-1] / _QUADRATURE) + 2)
    return np.unique(np.concatenate((inside, chain.knots, even[1:-1])))


def assemble(pose: Float, rise: Float, fall: Float, slopes: Float) -> Float:
    """Return (N, F) derivatives from those by the pose and by every element's ramps.

    A knot's value raises the ramp before it and the one after it; a knot that moves with its value held changes its
    elements by their slopes times the same ramps.
    """
    count, size = rise.shape
    values = np.zeros((count, size + 1))
    values[:, :-1] += fall
    values[:, 1:] += rise
    knots = -slopes[:-1] * rise[:, :-1] - slopes[1:] * fall[:, 1:]
    return np.hstack((pose, values, knots))


@dataclass(frozen=True)
class Plan:
    """Map points (N, 2) of an axis, in order, with weights (N,); the residual is the weighted offset."""

    points: Float
    weights: Float
    least: float
    reach: float  # m that a foot may move between two steps
    limit: float = 0.2
    snaps: tuple[int, ...] = (EQUAL, ZERO)

    def measure(self, chain: Chain, stations: Float) -> tuple[Float, Float]:
        feet, offset = chain.alignment.project_near(self.points, stations, self.reach)
        return feet, self.weights * offset

    def jacobian(self, chain: Chain, stations: Float) -> Float:
        """A change of curvature at s' turns the rest of the road about the point there.

        The offset at s thus falls by t(s) . (z(s) - z(s')) for each radian; the foot's own shift has no effect.
        """
        alignment = chain.alignment
        grid = quadrature_grid(chain, stations)
        origin = np.array([alignment.x, alignment.y])
        position, heading, _ = alignment.frame(stations)
        z = (position - origin) @ np.array([1.0, 1j])
        tangent = np.exp(-1j * heading)
        weight = (alignment.position(0.5 * (grid[1:] + grid[:-1])) - origin) @ np.array([1.0, 1j])
        plain = ramp_integrals(chain, stations, grid, np.ones(len(weight)))
        turned = ramp_integrals(chain, stations, grid, weight)
        lever = (tangent * z).real
        rise, fall = ((tangent[:, None] * b).real - lever[:, None] * a for a, b in zip(plain, turned, strict=True))
        across = -(tangent * np.exp(1j * alignment.start_heading)).real
        return self.weights[:, None] * assemble(np.column_stack((across, -lever)), rise, fall, chain.slopes)

    def move_pose(self, pose: Float, step: Float) -> Float:
        return pose + np.array([-np.sin(pose[2]) * step[0], np.cos(pose[2]) * step[0], step[1]])


@dataclass(frozen=True)
class Heights:
    """Elevations (N,) at stations, with weights (N,); the residual is the weighted height above the chain."""

    heights: Float
    weights: Float
    least: float
    limit: float = 10.0
    snaps: tuple[int, ...] = (EQUAL,)

    def measure(self, chain: Chain, stations: Float) -> tuple[Float, Float]:
        return stations, self.weights * (self.heights - elevations(chain, stations))

    def jacobian(self, chain: Chain, stations: Float) -> Float:
        grid = quadrature_grid(chain, stations)
        rise, fall = ramp_integrals(chain, stations, grid, np.ones(len(grid) - 1))
        return -self.weights[:, None] * assemble(np.ones((len(stations), 1)), rise, fall, chain.slopes)

    def move_pose(self, pose: Float, step: Float) -> Float:
        return pose + step


def elevations(chain: Chain, stations: Float) -> Float:
    """Return the elevation (N,), the integral of a chain of grades; the end grades go on beyond the ends."""
    gap = np.diff(chain.knots)
    base = chain.pose[0] + np.concatenate(([0.0], np.cumsum(0.5 * gap * (chain.values[:-1] + chain.values[1:]))))
    element = np.clip(np.searchsorted(chain.knots, stations, side="right") - 1, 0, chain.size - 1)
    u = stations - chain.knots[element]
    inside = np.clip(u, 0.0, gap[element])
    level = base[element] + inside * (chain.values[element] + 0.5 * chain.slopes[element] * inside)
    return level + (u - inside) * np.where(u < 0.0, chain.values[0], chain.values[-1])


@dataclass
class ChainFit:
    """A chain with the points' stations and residuals on it."""

    chain: Chain
    stations: Float
    residuals: Float
    _linear: tuple[Float, Float] | None = field(default=None, repr=False)

    @property
    def square(self) -> float:
        """Sum of squared residuals, m^2."""
        return float(self.residuals @ self.residuals)

    @property
    def rms(self) -> float:
        return float(np.sqrt(self.square / len(self.residuals)))

    @property
    def p95(self) -> float:
        return float(np.percentile(np.abs(self.residuals), 95))

    def linear(self, data: AxisData) -> tuple[Float, Float]:
        """Return R (F, F) and (F,): the sum of squares is that of R d + the vector, but for a constant."""
        if self._linear is None:
            q, r = np.linalg.qr(data.jacobian(self.chain, self.stations))
            self._linear = r, q.T @ self.residuals
        return self._linear


def room(chain: Chain, least: float) -> Float:
    """Return (M - 1,) how far each inner knot may move, m: its elements don't get shorter than `least`."""
    gap = np.diff(chain.knots)
    spare = np.maximum(gap - least, 0.02 * gap)  # those that are already shorter may still move a little
    return 0.5 * np.minimum(spare[:-1], spare[1:])


def apply_step(data: AxisData, chain: Chain, step: Float) -> Chain:
    """Return the chain after a step (F,) of all parameters, its knots kept apart."""
    values = np.clip(chain.values + step[chain.value_columns], -data.limit, data.limit)
    spare = _SHARE * np.maximum(np.diff(chain.knots) - data.least, 0.0)
    knots = chain.knots.copy()
    knots[1:-1] += np.clip(step[chain.value_columns.stop :], -spare[:-1], spare[1:])
    return replace(chain, pose=data.move_pose(chain.pose, step[: chain.turns]), values=values, knots=knots).tie_values()


def least_squares(matrix: Float, wanted: Float) -> Float:
    """Return the x of full rank with the least ``|matrix x - wanted|``; by QR, since chains are ill-conditioned."""
    q, r = np.linalg.qr(matrix)
    return np.linalg.solve(r, q.T @ wanted)


def knot_penalty(data: AxisData, chain: Chain, width: int) -> Float:
    """Return (M - 1, width) rows that measure steps of the knots, the last of `width` parameters, by their room.

    Far from its place a knot's linear effect is worth nothing: without this, every knot would seem dispensable.
    """
    rows = np.zeros((chain.size - 1, width))
    if chain.size > 1:
        rows[:, -(chain.size - 1) :] = np.diag(1.0 / room(chain, data.least))
    return rows


def refine(data: AxisData, chain: Chain, stations: Float, free_knots: bool, steps: int) -> ChainFit:
    """Levenberg-Marquardt: improve all free parameters at once, at most `steps` times.

    The damping holds knots by their room, scaled by the present sum of squares: exact data end quadratically.
    """
    fit = ChainFit(chain, *data.measure(chain, stations))
    basis = chain.basis(free_knots)
    damping, system = 1.0, _system(data, fit, basis, free_knots)
    for _ in range(steps if basis.shape[1] else 0):
        r, target, held, scale = system
        weight = np.sqrt(damping * (fit.square + 1e-12 * len(fit.residuals)))
        rows = np.vstack((r, weight * held, np.sqrt(1e-7 * damping) * np.eye(r.shape[1])))
        step = least_squares(rows, np.concatenate((target, np.zeros(len(rows) - len(target))))) / scale
        trial_chain = apply_step(data, fit.chain, basis @ step)
        trial = ChainFit(trial_chain, *data.measure(trial_chain, fit.stations))
        if trial.square < fit.square:
            gain = 1.0 - trial.square / fit.square
            fit, damping = trial, max(0.2 * damping, 1e-6)
            if gain < 1e-4 or fit.square < 1e-16 * len(fit.residuals):
                break
            system = _system(data, fit, basis, free_knots)
        else:
            damping *= 6.0
            if damping > 1e5:
                break
    return fit


def _system(data: AxisData, fit: ChainFit, basis: Float, free_knots: bool) -> tuple[Float, ...]:
    """Return R (P, P), the right side (P,), the knots' penalty (M - 1, P) and the scale (P,) of the linear problem."""
    matrix = data.jacobian(fit.chain, fit.stations) @ basis
    scale = column_scale(matrix)
    q, r = np.linalg.qr(matrix / scale)
    held = knot_penalty(data, fit.chain, len(scale)) / scale if free_knots else np.zeros((0, len(scale)))
    return r, -(q.T @ fit.residuals), held, scale


def column_scale(matrix: Float) -> Float:
    """Return the columns' lengths, none so small that dividing by it would blow up noise."""
    scale = np.sqrt((matrix**2).sum(axis=0))
    return np.maximum(scale, max(1e-9 * scale.max(initial=0.0), 1e-300))
