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
    line: RoadLine, angles: Sequence[float], smallest: float, tolerance: float, largest_curvature: float
) -> tuple[RoadLine, list[Rounding]]:
    """Return a line with its kinks rounded where tolerance and lengths of its elements allow it, and the roundings.

    Args:
        line: of a file.
        angles: change of direction (rad) before each piece.
        smallest: angle (rad) up to which a change of direction counts as none.
        tolerance: largest distance from a kink, m.
        largest_curvature: of a road, 1/m.
    """
    pieces: list[PlanPiece] = [line.pieces[0]]
    roundings: list[Rounding] = []
    for piece, angle in zip(line.pieces[1:], angles[1:], strict=True):
        solution, aimed_distance = None, tolerance
        for _ in range(_TRIALS if abs(angle) > smallest else 0):
            solution = _round(pieces[-1], piece, aimed_distance)
            if solution is None or solution[1].deviation <= tolerance:
                break
            # Beside curves the rounding lies farther off than between straights: aim for less.
            aimed_distance *= 0.98 * tolerance / solution[1].deviation
        if solution is None or abs(solution[1].curvature) > largest_curvature or solution[1].deviation > tolerance:
            pieces.append(piece)
            continue
        pieces[-1:] = solution[0]
        roundings.append(solution[1])
    return replace(line, pieces=tuple(pieces)), roundings


def _round(
    piece_before: PlanPiece, piece_behind: PlanPiece, tolerance: float
) -> tuple[list[PlanPiece], Rounding] | None:
    """Return the four pieces that take the place of two pieces with a kink, and the rounding; None without a solution.

    There is none where a piece is no line, arc or clothoid, or where Newton's method finds no pair of clothoids.
    """
    if not (isinstance(piece_before.shape, tuple) and isinstance(piece_behind.shape, tuple)):
        return None
    line_before = Alignment(
        [Element(piece_before.length, *piece_before.shape)], piece_before.x, piece_before.y, piece_before.heading
    )
    line_behind = Alignment(
        [Element(piece_behind.length, *piece_behind.shape)], piece_behind.x, piece_behind.y, piece_behind.heading
    )
    angle = math.remainder(piece_behind.heading - float(line_before.heading(piece_before.length)), 2.0 * math.pi)
    # Length cut off both pieces: between straights the clothoids are 6 e / angle long, e the distance from the corner.
    cut = min(0.99 * 6.0 * tolerance / abs(angle), _SHARE * piece_before.length, _SHARE * piece_behind.length)
    if cut < _SHORTEST:
        return None
    start, heading, k1 = line_before.frame(piece_before.length - cut)
    end, end_heading, k2 = line_behind.frame(cut)
    turn = math.remainder(float(end_heading) - float(heading), 2.0 * math.pi)
    solution = _clothoids(np.array([*start, float(heading)]), np.array([*end, turn]), float(k1), float(k2), cut)
    if solution is None:
        return None
    length_1, length_2, joint_curvature = solution
    elements = [Element(length_1, float(k1), joint_curvature), Element(length_2, joint_curvature, float(k2))]
    pair = Alignment(elements, float(start[0]), float(start[1]), float(heading))
    corner = np.array([[piece_behind.x, piece_behind.y]])
    deviation = float(abs(pair.project(corner)[1][0]))
    joint, joint_heading, _ = pair.frame(length_1)
    station = piece_behind.station
    parts = (
        replace(piece_before, length=piece_before.length - cut, shape=(piece_before.shape[0], float(k1))),
        replace(
            piece_before, kind="rounding", station=station - cut, length=length_1, x=float(start[0]), y=float(start[1]),
            heading=float(heading), shape=(float(k1), joint_curvature),
        ),
        replace(
            piece_before, kind="rounding", station=station, length=length_2, x=float(joint[0]), y=float(joint[1]),
            heading=float(joint_heading), shape=(joint_curvature, float(k2)),
        ),
        replace(
            piece_behind, station=station + cut, length=piece_behind.length - cut, x=float(end[0]), y=float(end[1]),
            heading=float(end_heading), shape=(float(k2), piece_behind.shape[1]),
        ),
    )  # fmt: skip
    return list(parts), Rounding(station, angle, length_1 + length_2, joint_curvature, deviation)


def _clothoids(start: Float, target: Float, k1: float, k2: float, reach: float) -> tuple[float, float, float] | None:
    """Return both lengths (m) and the curvature between (1/m) of two clothoids from a pose to a place and turn.

    The three unknowns are solved by Newton's method; None where it doesn't converge.

    Args:
        start: (3,) x, y, m, and heading, rad.
        target: (3,) x, y, m, and the turn up to there, rad.
        k1, k2: curvatures at their outer ends, 1/m.
        reach: length of either to begin with, m.
    """

    def miss(unknown: Float) -> Float:
        """Return how far (m, m, rad) the clothoids with both lengths and the middle curvature are from the target."""
        length_1, length_2, joint_curvature = (float(v) for v in unknown)
        pair = Alignment(
            [Element(length_1, k1, joint_curvature), Element(length_2, joint_curvature, k2)], *(float(v) for v in start)
        )
        gap = pair.position(pair.length) - target[:2]
        # A clothoid turns by its mean curvature times its length.
        turn = 0.5 * (k1 + joint_curvature) * length_1 + 0.5 * (joint_curvature + k2) * length_2
        return np.array([*gap, turn - target[2]])

    unknown = np.array([reach, reach, (target[2] - 0.5 * (k1 + k2) * reach) / reach])
    increments = np.array([1e-6 * reach, 1e-6 * reach, 1e-8])
    if abs(unknown[2]) >= _SHARPEST:
        return None
    for _ in range(_STEPS):
        residual = miss(unknown)
        if np.abs(residual).max() < _NEAR:
            return float(unknown[0]), float(unknown[1]), float(unknown[2])
        jacobian = np.column_stack([(miss(unknown + step) - residual) / step.sum() for step in np.diag(increments)])
        try:
            unknown = unknown - np.linalg.solve(jacobian, residual)
        except np.linalg.LinAlgError:
            return None
        if not (np.isfinite(unknown).all() and unknown[:2].min() > _SHORTEST and abs(unknown[2]) < _SHARPEST):
            return None
    return None
