"""True kinks of a file's plan, rounded on request by two clothoids that keep near the corner."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import Float
from ..road.alignment import Alignment, Element

if TYPE_CHECKING:
    from .line import PlanPiece, RoadLine

FARTHEST_ROUNDING = 5.0
"""Largest distance (m) from a kink that may be asked for. Chosen: beyond it the road would be another one."""
_SHARE = 0.45
"""Share of an element that the rounding at one of its ends may take."""
_STEPS, _TRIALS = 20, 5
_NEAR = 1e-9
"""Distance (m) and angle (rad) at which a rounding meets the element behind it."""
_SHORTEST = 1e-3
_SHARPEST = 0.9
"""Curvature (1/m) beyond which no rounding is looked for."""


@dataclass(frozen=True)
class Rounding:
    """A kink that two clothoids stand for.

    Attributes:
        station: of the kink in the file, m.
        angle: change of direction, rad, positive to the left.
        length: of both clothoids, m.
        curvature: where they meet, 1/m.
        deviation: distance from the kink, m.
    """

    station: float
    angle: float
    length: float
    curvature: float
    deviation: float


def rounded(
    line: RoadLine, joints: Sequence[float], least: float, tolerance: float, sharpest: float
) -> tuple[RoadLine, list[Rounding]]:
    """Return a line whose kinks are rounded, as far as the tolerance and its elements' lengths allow, and which were.

    Args:
        line: of a file.
        joints: change of direction (rad) before each piece.
        least: those up to it are none, rad.
        tolerance: largest distance from a kink, m.
        sharpest: largest curvature of a road, 1/m.
    """
    pieces: list[PlanPiece] = [line.pieces[0]]
    roundings: list[Rounding] = []
    for piece, turn in zip(line.pieces[1:], joints[1:], strict=True):
        made, aim = None, tolerance
        for _ in range(_TRIALS if abs(turn) > least else 0):
            made = _round(pieces[-1], piece, aim)
            if made is None or made[1].deviation <= tolerance:
                break
            aim *= 0.98 * tolerance / made[1].deviation  # beside curves the rounding lies otherwise
        if made is None or abs(made[1].curvature) > sharpest or made[1].deviation > tolerance:
            pieces.append(piece)
            continue
        pieces[-1:] = made[0]
        roundings.append(made[1])
    return replace(line, pieces=tuple(pieces)), roundings


def _round(before: PlanPiece, after: PlanPiece, tolerance: float) -> tuple[list[PlanPiece], Rounding] | None:
    """Return what two pieces become, and the rounding; None where it can't be: other curves, or no solution."""
    if not (isinstance(before.shape, tuple) and isinstance(after.shape, tuple)):
        return None
    first = Alignment([Element(before.length, *before.shape)], before.x, before.y, before.heading)
    second = Alignment([Element(after.length, *after.shape)], after.x, after.y, after.heading)
    angle = math.remainder(after.heading - float(first.heading(before.length)), 2.0 * math.pi)
    # Between straights both clothoids are 6 e / angle long, e the distance from the corner.
    reach = min(0.99 * 6.0 * tolerance / abs(angle), _SHARE * before.length, _SHARE * after.length)
    if reach < _SHORTEST:
        return None
    start, heading, k1 = first.frame(before.length - reach)
    goal, ahead, k2 = second.frame(reach)
    turn = math.remainder(float(ahead) - float(heading), 2.0 * math.pi)
    solution = _clothoids(np.array([*start, float(heading)]), np.array([*goal, turn]), float(k1), float(k2), reach)
    if solution is None:
        return None
    one, two, middle = solution
    elements = [Element(one, float(k1), middle), Element(two, middle, float(k2))]
    pair = Alignment(elements, float(start[0]), float(start[1]), float(heading))
    corner = np.array([[after.x, after.y]])
    deviation = float(abs(pair.project(corner)[1][0]))
    inner, towards, _ = pair.frame(one)
    station = after.station
    here = (
        replace(before, length=before.length - reach, shape=(before.shape[0], float(k1))),
        replace(
            before, kind="rounding", station=station - reach, length=one, x=float(start[0]), y=float(start[1]),
            heading=float(heading), shape=(float(k1), middle),
        ),
        replace(
            before, kind="rounding", station=station, length=two, x=float(inner[0]), y=float(inner[1]),
            heading=float(towards), shape=(middle, float(k2)),
        ),
        replace(
            after, station=station + reach, length=after.length - reach, x=float(goal[0]), y=float(goal[1]),
            heading=float(ahead), shape=(float(k2), after.shape[1]),
        ),
    )  # fmt: skip
    return list(here), Rounding(station, angle, one + two, middle, deviation)


def _clothoids(start: Float, goal: Float, k1: float, k2: float, reach: float) -> tuple[float, float, float] | None:
    """Return both lengths (m) and the curvature between (1/m) of two clothoids from a pose to a place and a turn.

    Args:
        start: (3,) x, y, m, and heading, rad.
        goal: (3,) x, y, m, and the turn up to there, rad.
        k1, k2: curvatures at their outer ends, 1/m.
        reach: length of either to begin with, m.
    """

    def missed(unknown: Float) -> Float:
        one, two, middle = (float(v) for v in unknown)
        pair = Alignment([Element(one, k1, middle), Element(two, middle, k2)], *(float(v) for v in start))
        end = pair.position(pair.length) - goal[:2]
        return np.array([*end, 0.5 * (k1 + middle) * one + 0.5 * (middle + k2) * two - goal[2]])

    unknown = np.array([reach, reach, (goal[2] - 0.5 * (k1 + k2) * reach) / reach])
    steps = np.array([1e-6 * reach, 1e-6 * reach, 1e-8])
    if abs(unknown[2]) >= _SHARPEST:
        return None
    for _ in range(_STEPS):
        rest = missed(unknown)
        if np.abs(rest).max() < _NEAR:
            return float(unknown[0]), float(unknown[1]), float(unknown[2])
        slope = np.column_stack([(missed(unknown + step) - rest) / step.sum() for step in np.diag(steps)])
        try:
            unknown = unknown - np.linalg.solve(slope, rest)
        except np.linalg.LinAlgError:
            return None
        if not (np.isfinite(unknown).all() and unknown[:2].min() > _SHORTEST and abs(unknown[2]) < _SHARPEST):
            return None
    return None
