"""The two lines between the directions of one carriageway, which keep a strip between them clear of traffic."""

from itertools import combinations

import numpy as np

from ...base.arrays import Float
from ..lines import STANDARD_DASHES, Line
from ..smoothing import robust_scale

_APART = 0.22, 1.7
"""Distances of the middles of two lines, m, that belong together. Chosen: a double line's, 0.12 m wide and apart; the
broadest strip of the RAL is 1 m wide."""
_PARALLEL = 0.12
"""Deviation, m, of that distance along the road at most. Chosen: a line's width."""
_TOGETHER = 0.5
"""Share of the longer one's length on which both run beside each other. Chosen: more than by chance."""
_ALIKE = 2.5
"""Ratio of the widths of both at most. Chosen: both are narrow lines; a seam or a wide stain is none."""
_LANE = 2.3
"""Least pavement on either side, m. Chosen: as in `layout`, below any lane."""


def join_pairs(lines: list[Line], low: float, high: float) -> list[Line]:
    """Return lines, two that run between the directions of a carriageway made one, which lies midway between them.

    The joined line's ``pair`` has both, from right to left. Two lines are such a pair if they run near each other and
    parallel, not both dashed by a usual pattern, and more than a lane within the pavement, as no line and seam at its
    edge do.

    Args:
        lines: of the carriageway.
        low, high: offsets of the pavement's right and left edge, m.
    """
    pairs = [
        (right, left)
        for right, left in combinations(sorted(lines, key=lambda line: line.offset), 2)
        if _is_pair(right, left) and low + _LANE < 0.5 * (right.offset + left.offset) < high - _LANE
    ]
    if not pairs:
        return lines
    best = max(pairs, key=lambda pair: sum(line.length * line.width for line in pair))
    return [*(line for line in lines if line is not best[0] and line is not best[1]), _joined(*best)]


def _is_pair(right: Line, left: Line) -> bool:
    """Return whether two lines, the one with the smaller offset first, may be a pair between the directions.

    Of worn lines seldom both are seen in one stretch: each is compared with the other one's course.
    """
    if right.width == 0.0 or left.width == 0.0 or all(_is_regular(line) for line in (right, left)):
        return False
    both_run = np.isfinite(left.offsets) & np.isfinite(right.offsets)
    longer = max(int(np.isfinite(line.offsets).sum()) for line in (right, left))
    if both_run.sum() < _TOGETHER * longer:
        return False
    distance = _distances(right, left)
    least, largest = _APART
    narrow, wide = sorted((right.width, left.width))
    return (
        least <= float(np.median(distance)) <= largest
        and robust_scale(distance - np.median(distance)) <= _PARALLEL
        and wide <= _ALIKE * narrow
    )


def _is_regular(line: Line) -> bool:
    """Return whether a line is dashed by a usual pattern; a solid one that is worn off in places isn't."""
    return (line.dash, line.gap) in STANDARD_DASHES


def _distances(right: Line, left: Line) -> Float:
    """Return the distances (N,), m, of what is measured of two lines from the other one's course; N is at least 1."""
    distance = np.concatenate([left.measured - right.offsets, left.offsets - right.measured])
    distance = distance[np.isfinite(distance)]
    return distance if len(distance) else np.array([left.offset - right.offset])


def _joined(right: Line, left: Line) -> Line:
    """Return the line midway between two; where one isn't seen, half of their distance beside the other one."""
    half = 0.5 * float(np.median(_distances(right, left)))
    start, end = min(right.start, left.start), max(right.end, left.end)
    return Line(
        stations=right.stations,
        measured=_between(right.measured, left.measured, half),
        offsets=_between(right.offsets, left.offsets, half),
        std=0.5 * np.hypot(*_each_known(right.std, left.std)),
        spacing=0.5 * np.hypot(right.spacing, left.spacing),
        cover=np.fmax(right.cover, left.cover),
        start=start,
        end=end,
        width=right.width + left.width,
        width_std=float(np.hypot(right.width_std, left.width_std)),
        painted=max(right.painted, left.painted),
        hidden=min(right.hidden, left.hidden, end - start),
        pair=(right, left),
    )


def _between(right: Float, left: Float, half: float) -> Float:
    """Return the offsets (K,), m, midway between those of two lines, of which one may be unknown."""
    middle = 0.5 * (right + left)
    middle = np.where(np.isfinite(middle), middle, right + half)
    return np.where(np.isfinite(middle), middle, left - half)


def _each_known(right: Float, left: Float) -> tuple[Float, Float]:
    """Return two arrays (K,) with what is unknown in one of them taken from the other."""
    return np.where(np.isfinite(right), right, left), np.where(np.isfinite(left), left, right)
