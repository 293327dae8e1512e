"""The axis: one line that all lines of the road agree on, and the alignment of lines, arcs and clothoids through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from .layout import RoadLayout
from .lines import USUAL, Line
from .path import SPACING
from .profiles import STRETCH
from .smoothing import mean_with_std, smooth, unseen

WAVELENGTH = 60.0
"""Shorter swings of the axis, m, are noise."""
_ROUNDS = 4


@dataclass(frozen=True)
class Centre:
    """The axis beside the path, stretch by stretch.

    Attributes:
        stations: (K,) m along the path.
        offsets: (K,) of the axis, m; smoothed.
        std: (K,) standard deviation, m.
        raw: (K,) before smoothing; NaN where no line was seen.
    """

    stations: Float
    offsets: Float
    std: Float
    raw: Float


def centre_of(layout: RoadLayout) -> Centre:
    """Return the axis of a layout.

    Of a dual carriageway it is the middle between its two innermost lines, of a single one the line in its middle; for
    want of lines the pavement's edges take their place. All lines vote for how it moves along the road: each tells the
    axis from its own mean distance to it, and counts by how steady that is. Where the lines in the middle are missing
    the others carry on.

    Raises:
        InputError: no line and no edge was seen anywhere.
    """
    guides = axis_guides(layout)
    lines = list(guides) + [line for band in layout.bands for line in band.lines if line not in guides]
    stations = lines[0].stations
    given = np.mean([line.measured for line in guides], axis=0)
    raw, start = given, given
    if not any(np.isfinite(line.measured).any() for line in lines):
        raise InputError("road", None, "neither lines nor edges of a carriageway can be made out in the cloud")
    if not np.isfinite(given).any():
        start = np.nanmean(np.array([line.measured for line in lines]), axis=0)
    axis = _fill_gaps(start)
    for _ in range(_ROUNDS):
        raw = _vote_axis(lines, axis)
        # The votes fix the movement; where the axis lies, its own lines say.
        raw = raw + _level(given - raw)
        axis = _fill_gaps(raw)
    smoothed = smooth(raw, np.where(np.isfinite(raw), 1.0, 0.0), STRETCH * SPACING, WAVELENGTH, usual=USUAL)
    level_std = mean_with_std(given - raw)[1]
    level_std = float(np.hypot(level_std if np.isfinite(level_std) else 0.0, _shared_error(guides, smoothed.scatter)))
    known = np.isfinite(raw)
    held = np.interp(stations, stations[known], smoothed.values[known])  # no curve is guessed where nothing was seen
    return Centre(stations, held, np.hypot(smoothed.std, level_std), raw)


def axis_guides(layout: RoadLayout) -> tuple[Line, ...]:
    """Return the lines, or edges, whose mean is the axis."""
    if layout.kind == "dual":
        right, left = layout.bands
        return right.guide(1), left.guide(-1)
    (band,) = layout.bands
    return (band.middle,) if band.middle is not None else (band.guide(-1), band.guide(1))


def _vote_axis(lines: list[Line], axis: Float) -> Float:
    """Return the axis (K,) by the votes of all lines, each relative to its mean distance from a first axis."""
    offsets = np.array([line.measured for line in lines])
    std = np.array([line.std for line in lines])
    apart = offsets - axis
    middle = np.array([mean_with_std(row)[0] for row in apart])
    spread = np.array([_robust_spread(row - value) for row, value in zip(apart, middle, strict=True)])
    seen = np.isfinite(offsets) & np.isfinite(std)
    weight = np.where(seen, 1.0 / (spread[:, None] ** 2 + np.where(seen, std, 1.0) ** 2 + 1e-6), 0.0)
    votes = np.where(seen, offsets - middle[:, None], 0.0)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0.0, (weight * votes).sum(axis=0) / total, np.nan)


def _shared_error(guides: tuple[Line, ...], scatter: float) -> float:
    """Return the standard deviation of what all offsets of the axis share, see `unseen`, m."""
    return float(np.sqrt(sum(unseen(line.apart, scatter) ** 2 for line in guides))) / len(guides)


def _robust_spread(values: Float) -> float:
    known = values[np.isfinite(values)]
    return max(1.4826 * float(np.median(np.abs(known))), 0.003) if len(known) else np.inf


def _level(difference: Float) -> float:
    value = mean_with_std(difference)[0]
    return value if np.isfinite(value) else 0.0


def _fill_gaps(values: Float) -> Float:
    rows = np.arange(len(values))
    known = np.isfinite(values)
    return np.interp(rows, rows[known], values[known])
