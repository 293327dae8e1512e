"""First guesses for fitting an axis: a smoothing spline through the points, and a chain of many elements along it."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Float, Int
from .chain import FREE, Chain

_STIFFNESS = 0.05  # of the spline, relative to the density of the data; it spans gaps and leaves the rest alone

Start = tuple[Float, float]  # pose and value where the part before was left


def start_plan(points: Float, spacing: float, start: Start | None) -> tuple[Chain, Float]:
    """Return a chain of curvatures along the points (N, 2) and their stations (N,), m.

    The curvatures are fitted to the spline's heading, not taken from it, so that the chain doesn't drift away.
    """
    through = points if start is None else np.vstack((start[0][:2], points))
    run = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(through, axis=0).T))))
    at = np.linspace(0.0, run[-1], int(run[-1] / min(1.0, 0.1 * spacing)) + 20)
    curve = smooth_values(run, through, 0.5 * spacing, at)
    move = np.diff(curve, axis=0)
    station = np.concatenate(([0.0], np.cumsum(np.hypot(*move.T))))
    heading = np.unwrap(np.arctan2(move[:, 1], move[:, 0]))
    knots = even_knots(station[-1], spacing)
    turn = np.column_stack((np.ones(len(heading)), _hat_integrals(0.5 * (station[1:] + station[:-1]), knots)))
    if start is None:
        solution = np.linalg.lstsq(turn, heading, rcond=1e-10)[0]
        pose = np.append(curve[0], solution[0])
    else:
        pose, value = start
        heading += 2.0 * np.pi * np.round((pose[2] - heading[0]) / (2.0 * np.pi))
        rest = np.linalg.lstsq(turn[:, 2:], heading - pose[2] - value * turn[:, 1], rcond=1e-10)[0]
        solution = np.concatenate(([pose[2], value], rest))
    chain = Chain(pose, knots, np.clip(solution[1:], -0.2, 0.2), _free(knots), start is not None)
    return chain, np.interp(run, at, station)[len(through) - len(points) :]


def start_heights(station: Float, heights: Float, spacing: float, start: Start | None) -> Chain:
    """Return a chain of grades along heights (N,) at stations (N,) counted from the part's begin, m."""
    if start is not None:
        station, heights = np.append(0.0, station), np.append(start[0][0], heights)
    knots = even_knots(station[-1], spacing)
    curve = smooth_values(station, heights[:, None], 0.5 * spacing, knots)[:, 0]
    grade = np.diff(curve) / np.diff(knots)
    values = np.concatenate((grade[:1], 0.5 * (grade[1:] + grade[:-1]), grade[-1:]))
    if start is None:
        return Chain(curve[:1], knots, values, _free(knots))
    values[0] = start[1]
    return Chain(start[0], knots, values, _free(knots), True)


def even_knots(length: float, spacing: float) -> Float:
    """Return knots from 0 to the length, about `spacing` apart, at least two."""
    return np.linspace(0.0, length, max(1, round(length / spacing)) + 1)


def _free(knots: Float) -> Int:
    return np.full(len(knots) - 1, FREE)


def smooth_values(run: Float, values: Float, spacing: float, at: Float) -> Float:
    """Return (M, D): at `at` (M), a cubic spline of even knots through values (N, D) at `run` (N).

    Its third differences are penalised, so that it goes on smoothly through gaps in the data.
    """
    count = max(1, int(np.ceil(run[-1] / spacing)))
    width = run[-1] / count
    matrix = _cubic(run / width, count)
    bend = np.diff(np.eye(count + 3), 3, axis=0)
    normal = matrix.T @ matrix + _STIFFNESS * max(len(run) / count, 1e-3) * bend.T @ bend
    normal[np.diag_indices(len(normal))] += 1e-10 * len(run) / count  # two points alone determine no spline
    centre = values.mean(axis=0)
    return _cubic(at / width, count) @ np.linalg.solve(normal, matrix.T @ (values - centre)) + centre


def _cubic(place: Float, count: int) -> Float:
    """Return (N, count + 3) values of the cubic B-splines over `count` unit intervals."""
    interval = np.clip(place.astype(np.int64), 0, count - 1)
    f = place - interval
    weights = np.stack(((1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3), axis=1) / 6
    matrix = np.zeros((len(place), count + 3))
    matrix[np.arange(len(place))[:, None], interval[:, None] + np.arange(4)] = weights
    return matrix


def _hat_integrals(station: Float, knots: Float) -> Float:
    """Return (N, K): the integral from the first knot to each station of each knot's hat, for even knots."""
    width = knots[1] - knots[0]
    v = np.clip((station[:, None] - knots) / width, -1.0, 1.0)
    whole = np.where(v < 0.0, 0.5 * (v + 1.0) ** 2, 0.5 + v - 0.5 * v**2)
    whole[:, 0] -= 0.5
    return width * whole
