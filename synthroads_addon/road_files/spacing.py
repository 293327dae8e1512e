"""Points of a line cleaned before a road is fitted to them, and what is told of how far apart they are.

Each remark names a place: the number of a point as the file counts it, from 1, and its coordinates on the map.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Bool, Float, Int
from ..base.errors import InputError
from ..base.remarks import assume, warn
from ..road.other_roads.axis import LONGEST_ROAD

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


def cleaned(name: str, points: Float, spacing: float = 0.0) -> Float:
    """Return the points (M, 3) of a line that moves on, without those of stops, doubled ones and those that go back.

    Args:
        name: of the file, for remarks.
        points: (N, 3), m, in order.
        spacing: least distance of the points that are kept, m; 0 keeps all.

    Raises:
        InputError: points are kilometres apart, the line is longer than any road, or fewer than two points are left.
    """
    number = np.arange(1, len(points) + 1)  # as the file counts them
    # The order matters: a stop's points lie closer than the step by which the others are judged.
    points, number = _without_doubled(name, points, number)
    points, number = _without_stops(name, points, number)
    _refuse_far(name, points, number, _LONGEST_DRIVEN if spacing > 0.0 else _LONGEST_STEP)
    if spacing > 0.0 and len(points) > 1:
        kept_rows = thinned(points, spacing)
        points, number = points[kept_rows], number[kept_rows]
    points, number = _without_backward(name, points, number)
    if len(points) < 2:
        raise InputError(name, None, f"must have at least two distinct points; the file has {len(points)}")
    return points


def _refuse_far(name: str, points: Float, number: Int, farthest: float) -> None:
    """Raise `InputError` where neighbours lie farther from each other than `farthest` (m), or the line is too long."""
    distances = _steps(points)
    if len(distances) and distances.max() > farthest:
        row = int(distances.argmax())
        gap, limit = distances[row] / 1000.0, farthest / 1000.0
        allowed = f"the next one is {gap:,.1f} km away, but must lie within {limit:g} km: is a part missing?"
        raise InputError(f"{name}: {_place(points, number, row)}", None, allowed)
    if distances.sum() > LONGEST_ROAD:
        raise InputError(f"{name}: length, m", round(float(distances.sum())), f"must be at most {LONGEST_ROAD:g} m")


def _place(points: Float, number: Int, row: int) -> str:
    """Return the number and the coordinates of a point as text."""
    east, north = points[row, :2].tolist()
    return f"point {number[row]} ({east:.2f}, {north:.2f})"


def _steps(points: Float) -> Float:
    """Return the horizontal distances (N - 1,), m, between neighbours of points (N, 2 or 3)."""
    return np.hypot(*np.diff(points[:, :2], axis=0).T)


def _without_doubled(name: str, points: Float, number: Int) -> tuple[Float, Int]:
    """Return the points (M, 3) and their numbers without those that lie where the point before them does."""
    is_repeated = np.concatenate([[False], _steps(points) <= _SAME])
    if is_repeated.any():
        place = _place(points, number, int(is_repeated.argmax()))
        assume(
            "%s: %d points that are where the one before is are left out, the first is %s",
            name,
            is_repeated.sum(),
            place,
        )
    return points[~is_repeated], number[~is_repeated]


def _without_stops(name: str, points: Float, number: Int) -> tuple[Float, Int]:
    """Return the points and their numbers, with the mean of its points in place of each stop of the vehicle."""
    distances = _steps(points)
    if len(distances) < 2 * _FEWEST_STILL:
        return points, number
    is_short = distances < _STILL * _usual(distances)
    keep_mask, averaged, places = np.ones(len(points), dtype=bool), points.copy(), list[str]()
    for start, end in _runs(is_short):
        rows = slice(start, end + 1)
        extent = float(np.hypot(*np.ptp(points[rows, :2], axis=0)))
        if end - start < _FEWEST_STILL or extent > _WANDERING * float(distances[start:end].sum()):
            continue
        averaged[start] = points[rows].mean(axis=0)
        keep_mask[start + 1 : end + 1] = False
        places.append(f"{end - start + 1} at {_place(points, number, start)}")
    if places:
        more = f" and at {len(places) - _SHOWN} more places" if len(places) > _SHOWN else ""
        assume("%s stands still: of points that hardly move one is kept: %s%s", name, ", ".join(places[:_SHOWN]), more)
    return averaged[keep_mask], number[keep_mask]


def _usual(distances: Float) -> float:
    """Return the median of the distances (m) weighted by themselves: thousands of points of a stop don't change it."""
    sorted_distances = np.sort(distances)
    cumulated = np.cumsum(sorted_distances)
    return float(sorted_distances[np.searchsorted(cumulated, 0.5 * cumulated[-1])])


def _runs(flags: Bool) -> list[tuple[int, int]]:
    """Return the first and the last point of each run of steps that are flagged; step n leads from point n to n + 1."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _without_backward(name: str, points: Float, number: Int) -> tuple[Float, Int]:
    """Return the points and their numbers without those that lie behind an earlier one, if the line soon goes on."""
    step = np.diff(points[:, :2], axis=0)
    length = np.hypot(*step.T)
    # Cosine of the angle between neighbouring steps, times both lengths.
    turns = (step[:-1] * step[1:]).sum(axis=1) <= _BACK * length[:-1] * length[1:]
    if not turns.any():
        return points, number
    plan, kept_rows, dropped_count, places = points[:, :2], [0, 1], 0, list[str]()
    row = 2
    while row < len(points):
        position, previous_step = plan[kept_rows[-1]], plan[kept_rows[-1]] - plan[kept_rows[-2]]
        step = plan[row] - position
        if float(step @ previous_step) <= _BACK * float(np.hypot(*step) * np.hypot(*previous_step)):
            next_row = _row_ahead(plan, row, position, previous_step)
            if next_row is not None:
                dropped_count += next_row - row
                places.append(_place(points, number, row))
                row = next_row
                continue
            text = "%s turns back at %s, for more than %g m: no road does, and what is fitted there may be none"
            warn(text, name, _place(points, number, kept_rows[-1]), _FARTHEST_BACK)
        kept_rows.append(row)
        row += 1
    if dropped_count:
        more = f" and at {len(places) - _SHOWN} more places" if len(places) > _SHOWN else ""
        warn("%s goes back: %d points are left out, from %s%s", name, dropped_count, ", ".join(places[:_SHOWN]), more)
    return points[kept_rows], number[kept_rows]


def _row_ahead(plan: Float, first_row: int, position: Float, previous_step: Float) -> int | None:
    """Return the first row of a plan (N, 2), from `first_row` on, that lies ahead of a position (2,).

    Ahead is the direction of the step (2,) that led to the position. The result is None where the line goes farther
    back than `_FARTHEST_BACK` first, and N where the line ends before it lies ahead again.
    """
    for row in range(first_row, len(plan)):
        step = plan[row] - position
        if float(step @ previous_step) > 0.0:
            return row
        if float(np.hypot(*step)) > _FARTHEST_BACK:
            return None
    return len(plan)


def widest_sagitta(points: Float) -> tuple[float, float, float, int]:
    """Return the largest distance (m) that a bend through points (N, 3) may have from the chord between two points.

    Between two points a bend of the curvature that the line has at one of them, by the circle through the point and its
    neighbours, is curvature * length^2 / 8 off the chord (the arc's sagitta).

    Returns:
        the distance (m), the chord's length (m), the radius (m; infinite without a bend) and the chord's first point.
    """
    chord = np.diff(points[:, :2], axis=0)
    length = np.hypot(*chord.T)
    if len(length) < 2:
        return 0.0, float(length.max(initial=0.0)), np.inf, 0
    chord_before, chord_behind = chord[:-1], chord[1:]
    cross = chord_before[:, 0] * chord_behind[:, 1] - chord_before[:, 1] * chord_behind[:, 0]
    span = np.hypot(*(chord_before + chord_behind).T)
    # Curvature of the circle through three points: 2 |a x b| / (|a| |b| |a + b|) (Menger).
    curvature = 2.0 * np.abs(cross) / np.maximum(length[:-1] * length[1:] * span, 1e-12)
    at_ends = np.maximum(np.concatenate([[0.0], curvature]), np.concatenate([curvature, [0.0]]))
    sagitta = at_ends * length**2 / 8.0
    widest = int(sagitta.argmax())
    return float(sagitta[widest]), float(length[widest]), float(1.0 / max(at_ends[widest], 1e-12)), widest


def tell_spacing(name: str, lines: Sequence[Float]) -> float:
    """Warn where points (N, 3), m, of lines are too far apart for the bends between them; return the sagitta, m."""
    worst_line = max(range(len(lines)), key=lambda n: widest_sagitta(lines[n])[0])
    points, (sagitta, length, radius, row) = lines[worst_line], widest_sagitta(lines[worst_line])
    if sagitta > _TOLD_SAGITTA:
        distance = float(_steps(points)[:row].sum())
        east, north = points[row, :2].tolist()
        warn(
            "%s: points are %.0f m apart at %.0f m (%.2f, %.2f) in a bend of %.0f m radius: between them the road may "
            "lie up to %.2f m beside the chord: what is fitted there is a guess",
            name, length, distance, east, north, radius, sagitta,
        )  # fmt: skip
    return sagitta


def thinned(points: Float, spacing: float) -> Int:
    """Return rows (M,) of a line (N, 3), each at least `spacing` (m) from the row before it, and the last row."""
    kept_rows, plan = [0], points[:, :2].tolist()
    east, north = plan[0]
    for row in range(1, len(plan)):
        if (plan[row][0] - east) ** 2 + (plan[row][1] - north) ** 2 >= spacing * spacing:
            kept_rows.append(row)
            east, north = plan[row]
    # The line's last point stays; it takes the place of the one kept before it, unless that is the first.
    if kept_rows[-1] != len(plan) - 1:
        kept_rows = [*(kept_rows if len(kept_rows) == 1 else kept_rows[:-1]), len(plan) - 1]
    return np.array(kept_rows)


def moved_aside(name: str, points: Float, offset: float, height: float) -> Float:
    """Return the points (N, 3) of a line that runs beside another one, at the same places along it.

    The direction at a point is that of the line's chord over 5 m to either side.

    Args:
        name: of the file, for messages.
        points: (N, 3) of the other line, m.
        offset: of the line, m; positive to the left in the direction of the points.
        height: that the line lies lower, m.

    Raises:
        InputError: a bend is so sharp that no line runs so far on its inner side.
    """
    station = np.concatenate([[0.0], np.cumsum(_steps(points))])
    ahead_station, behind_station = (np.clip(station + reach, 0.0, station[-1]) for reach in (_REACH, -_REACH))
    places = [
        [np.interp(station_at, station, points[:, axis]) for axis in (0, 1)]
        for station_at in (ahead_station, behind_station)
    ]
    chord = np.array(places[0]).T - np.array(places[1]).T
    directions = chord / np.maximum(np.hypot(*chord.T), 1e-9)[:, None]
    moved_points = points + np.column_stack(
        [-offset * directions[:, 1], offset * directions[:, 0], np.full(len(points), -height)]
    )
    runs_back = (np.diff(moved_points[:, :2], axis=0) * np.diff(points[:, :2], axis=0)).sum(axis=1) <= 0.0
    if runs_back.any():
        station_at = int(runs_back.argmax())
        place = _place(points, np.arange(1, len(points) + 1), station_at)
        allowed = f"must be smaller: the path bends too sharply at {place}"
        raise InputError(f"{name}: --offset-from-path", offset, allowed)
    return moved_points
