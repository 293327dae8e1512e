"""Points of a line cleaned before a road is fitted to them, and what is told of how far apart they are.

Each remark names a place: the number of a point as the file counts it, from 1, and its coordinates on the map.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Bool, Float, Int
from ..base.errors import InputError
from ..base.remarks import assume, warn
from ..road.parameters import LONGEST_ROAD

_SAME = 1e-6
"""Points no farther apart than this, m, are one."""
_LONGEST_STEP, _LONGEST_DRIVEN = 20_000.0, 1000.0
"""Farthest that the next point of a line, and of a path, may be, m: between farther ones is no road that is known."""
_STILL = 0.05
"""Steps shorter than this share of the usual one are those of a stop, if there are several."""
_FEWEST_STILL, _WANDERING = 3, 0.5
"""Steps of a stop at least; share of their length that its points may spread over: they wander, and lead nowhere."""
_BACK = np.cos(np.radians(150.0))
"""Cosine of the change of direction from which on a line goes back."""
_FARTHEST_BACK = 100.0
"""Metres that points may go back and be left out; a line that goes farther back is told of, and the fit judges it."""
_TOLD_SAGITTA = 0.1
"""Distance of a bend from the chord between two points, m, from which on it is told: twice the fit's tolerance."""
_REACH = 5.0
"""Distance, m, to either side over which the direction of a path is taken."""
_SHOWN = 3
"""Places that are named one by one."""


def cleaned(name: str, points: Float, apart: float = 0.0) -> Float:
    """Return the points (M, 3) of a line that moves on, without those of stops, doubled ones and those that go back.

    Args:
        name: of the file, for remarks.
        points: (N, 3), m, in order.
        apart: least distance of the points that are kept, m; 0 keeps all.

    Raises:
        InputError: points are kilometres apart, the line is longer than any road, or fewer than two points are left.
    """
    number = np.arange(1, len(points) + 1)
    points, number = _without_doubled(name, points, number)
    points, number = _without_stops(name, points, number)
    _refuse_far(name, points, number, _LONGEST_DRIVEN if apart > 0.0 else _LONGEST_STEP)
    if apart > 0.0 and len(points) > 1:
        kept = thinned(points, apart)
        points, number = points[kept], number[kept]
    points, number = _without_backward(name, points, number)
    if len(points) < 2:
        raise InputError(name, None, f"must have at least two distinct points; the file has {len(points)}")
    return points


def _refuse_far(name: str, points: Float, number: Int, most: float) -> None:
    """Raise `InputError` for points too far apart (m) to be of one road, or of a road too long for one."""
    step = _steps(points)
    if len(step) and step.max() > most:
        at = int(step.argmax())
        gap, limit = step[at] / 1000.0, most / 1000.0
        allowed = f"the next one is {gap:,.1f} km away, but must lie within {limit:g} km: is a part missing?"
        raise InputError(f"{name}: {_place(points, number, at)}", None, allowed)
    if step.sum() > LONGEST_ROAD:
        raise InputError(f"{name}: length, m", round(float(step.sum())), f"must be at most {LONGEST_ROAD:g} m")


def _place(points: Float, number: Int, at: int) -> str:
    east, north = points[at, :2].tolist()
    return f"point {number[at]} ({east:.2f}, {north:.2f})"


def _steps(points: Float) -> Float:
    return np.hypot(*np.diff(points[:, :2], axis=0).T)


def _without_doubled(name: str, points: Float, number: Int) -> tuple[Float, Int]:
    again = np.concatenate([[False], _steps(points) <= _SAME])
    if again.any():
        first = _place(points, number, int(again.argmax()))
        assume("%s: %d points that are where the one before is are left out, the first is %s", name, again.sum(), first)
    return points[~again], number[~again]


def _without_stops(name: str, points: Float, number: Int) -> tuple[Float, Int]:
    """Return the points with one in place of those of each stop: their mean."""
    step = _steps(points)
    if len(step) < 2 * _FEWEST_STILL:
        return points, number
    short = step < _STILL * _usual(step)
    kept, moved, told = np.ones(len(points), dtype=bool), points.copy(), list[str]()
    for first, last in _runs(short):
        rows = slice(first, last + 1)
        extent = float(np.hypot(*np.ptp(points[rows, :2], axis=0)))
        if last - first < _FEWEST_STILL or extent > _WANDERING * float(step[first:last].sum()):
            continue
        moved[first] = points[rows].mean(axis=0)
        kept[first + 1 : last + 1] = False
        told.append(f"{last - first + 1} at {_place(points, number, first)}")
    if told:
        more = f" and at {len(told) - _SHOWN} more places" if len(told) > _SHOWN else ""
        assume("%s stands still: of points that hardly move one is kept: %s%s", name, ", ".join(told[:_SHOWN]), more)
    return moved[kept], number[kept]


def _usual(step: Float) -> float:
    """Return the step (m) than which half of the way is made of longer ones: thousands of a stop don't change it."""
    ordered = np.sort(step)
    run = np.cumsum(ordered)
    return float(ordered[np.searchsorted(run, 0.5 * run[-1])])


def _runs(flags: Bool) -> list[tuple[int, int]]:
    """Return first and last point of each run of steps that are flagged."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _without_backward(name: str, points: Float, number: Int) -> tuple[Float, Int]:
    """Return the points without those that lie behind where the line has been, if it soon comes on again."""
    step = np.diff(points[:, :2], axis=0)
    length = np.hypot(*step.T)
    turns = (step[:-1] * step[1:]).sum(axis=1) <= _BACK * length[:-1] * length[1:]
    if not turns.any():
        return points, number
    plan, kept, dropped, told, at = points[:, :2], [0, 1], 0, list[str](), 2
    while at < len(points):
        here, before = plan[kept[-1]], plan[kept[-1]] - plan[kept[-2]]
        step = plan[at] - here
        first = at
        if float(step @ before) <= _BACK * float(np.hypot(*step) * np.hypot(*before)):
            ahead = _comes_on(plan, first, here, before)
            if ahead is not None:
                dropped += ahead - first
                told.append(_place(points, number, first))
                at = ahead
                continue
            text = "%s turns back at %s, for more than %g m: no road does, and what is fitted there may be none"
            warn(text, name, _place(points, number, kept[-1]), _FARTHEST_BACK)
        kept.append(at)
        at += 1
    if dropped:
        more = f" and at {len(told) - _SHOWN} more places" if len(told) > _SHOWN else ""
        warn("%s goes back: %d points are left out, from %s%s", name, dropped, ", ".join(told[:_SHOWN]), more)
    return points[kept], number[kept]


def _comes_on(plan: Float, first: int, here: Float, before: Float) -> int | None:
    """Return the first point (of N, 2) from one on that lies ahead of a place, seen along the step before it.

    None where the line goes farther back than `_FARTHEST_BACK` before; the number of points where it ends there.
    """
    for at in range(first, len(plan)):
        step = plan[at] - here
        if float(step @ before) > 0.0:
            return at
        if float(np.hypot(*step)) > _FARTHEST_BACK:
            return None
    return len(plan)


def widest_sagitta(points: Float) -> tuple[float, float, float, int]:
    """Return the largest distance (m) that a bend through points (N, 3) may have from the chord between two of them.

    Between two points a bend of the curvature that the line has at one of them, by the circle through the point and its
    neighbours, is curvature * length^2 / 8 off the chord (the arc's sagitta).

    Returns:
        the distance (m), the chord's length (m), the radius (m; infinite without a bend) and the chord's first point.
    """
    chord = np.diff(points[:, :2], axis=0)
    length = np.hypot(*chord.T)
    if len(length) < 2:
        return 0.0, float(length.max(initial=0.0)), np.inf, 0
    before, after = chord[:-1], chord[1:]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    across = np.hypot(*(before + after).T)
    bend = 2.0 * np.abs(cross) / np.maximum(length[:-1] * length[1:] * across, 1e-12)
    at_ends = np.maximum(np.concatenate([[0.0], bend]), np.concatenate([bend, [0.0]]))
    sagitta = at_ends * length**2 / 8.0
    at = int(sagitta.argmax())
    return float(sagitta[at]), float(length[at]), float(1.0 / max(at_ends[at], 1e-12)), at


def tell_spacing(name: str, lines: Sequence[Float]) -> float:
    """Warn where points (N, 3), m, of lines are too far apart for the bends between them; return the sagitta, m."""
    worst = max(range(len(lines)), key=lambda n: widest_sagitta(lines[n])[0])
    points, (sagitta, length, radius, at) = lines[worst], widest_sagitta(lines[worst])
    if sagitta > _TOLD_SAGITTA:
        along = float(_steps(points)[:at].sum())
        east, north = points[at, :2].tolist()
        warn(
            "%s: points are %.0f m apart at %.0f m (%.2f, %.2f) in a bend of %.0f m radius: between them the road may "
            "lie up to %.2f m beside the chord: what is fitted there is a guess",
            name, length, along, east, north, radius, sagitta,
        )  # fmt: skip
    return sagitta


def thinned(points: Float, apart: float) -> Int:
    """Return which points (M,) of a line (N, 3) are at least some metres from the one kept before, and its last one."""
    kept, plan = [0], points[:, :2].tolist()
    east, north = plan[0]
    for at in range(1, len(plan)):
        if (plan[at][0] - east) ** 2 + (plan[at][1] - north) ** 2 >= apart * apart:
            kept.append(at)
            east, north = plan[at]
    if kept[-1] != len(plan) - 1:
        kept = [*(kept if len(kept) == 1 else kept[:-1]), len(plan) - 1]
    return np.array(kept)


def moved_aside(name: str, points: Float, offset: float, height: float) -> Float:
    """Return the points (N, 3) of a line beside another one, at the same places along it.

    The direction at a point is that of the line's chord over 5 m to either side.

    Args:
        name: of the file, for messages.
        points: of the other one, m.
        offset: of the line, m; positive to the left in the direction of the points.
        height: that the line lies lower, m.

    Raises:
        InputError: a bend is so sharp that no line runs so far on its inner side.
    """
    station = np.concatenate([[0.0], np.cumsum(_steps(points))])
    ahead, behind = (np.clip(station + reach, 0.0, station[-1]) for reach in (_REACH, -_REACH))
    place = [[np.interp(at, station, points[:, axis]) for axis in (0, 1)] for at in (ahead, behind)]
    chord = np.array(place[0]).T - np.array(place[1]).T
    unit = chord / np.maximum(np.hypot(*chord.T), 1e-9)[:, None]
    beside = points + np.column_stack([-offset * unit[:, 1], offset * unit[:, 0], np.full(len(points), -height)])
    back = (np.diff(beside[:, :2], axis=0) * np.diff(points[:, :2], axis=0)).sum(axis=1) <= 0.0
    if back.any():
        at = int(back.argmax())
        allowed = f"must be smaller: the path bends too sharply at {_place(points, np.arange(1, len(points) + 1), at)}"
        raise InputError(f"{name}: --offset-from-path", offset, allowed)
    return beside
