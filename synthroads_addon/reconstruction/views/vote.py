"""The axis that all lines of a layout agree on: those in its middle say where it lies, all how it moves."""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ..layout import RoadLayout
from ..lines import USUAL, Line
from ..path import SPACING
from ..profiles import STRETCH
from ..smoothing import bisquare, fill_gaps, hidden_std, mean_with_std, robust_scale, smooth

_TOGETHER = 0.2
"""Share of the stretches with both edges in which two lines must be seen together. Chosen: lines that seldom are give
way to the edges."""
_AXIS_WAVELENGTH = 60.0
"""Wavelength of which half of the axis' swings is kept, m. Chosen: shorter ones are noise."""
_ROUNDS = 4
"""Votes, each about the axis of the one before. Chosen: it moves no more after them."""


@dataclass(frozen=True)
class FoundAxis:
    """Offsets of the road's axis from the path in each of K stretches, with standard deviations.

    Attributes:
        stations: (K,) m along the path.
        offsets: (K,) of the axis, m; smoothed.
        std: (K,) standard deviation, m.
        raw: (K,) offsets before smoothing, m; NaN where no line was seen.
    """

    stations: Float
    offsets: Float
    std: Float
    raw: Float


def axis_from_lines(layout: RoadLayout) -> FoundAxis:
    """Return the axis of a layout, from its middle or innermost lines, by a vote of all lines on its course.

    Of a dual carriageway it is the middle between its two innermost lines, of a single one the line in its middle, or
    what lies midway between both branches of that; for want of lines the pavement's edges take their place. All lines
    vote for how it moves along the road: each tells the axis from its own mean distance to it, and counts by how steady
    that is. Where the lines in the middle are missing the others carry on.

    Raises:
        InputError: no line and no edge was seen anywhere.
    """
    guides = axis_guides(layout)
    guide_lines = (
        [band.middle for band in layout.bands] if layout.kind == "single" and len(guides) == 1 else list(guides)
    )
    lines = list(guides) + [line for band in layout.bands for line in band.lines if line not in guide_lines]
    stations = lines[0].stations
    centre = np.mean([line.measured for line in guides], axis=0)  # the axis by its guides alone
    voted_offsets, start = centre, centre
    if not any(np.isfinite(line.measured).any() for line in lines):
        raise InputError("road", None, "neither lines nor edges of a carriageway can be made out in the cloud")
    if not np.isfinite(centre).any():
        # Without guides begin with the mean of all lines.
        line_offsets = np.array([line.measured for line in lines])
        has_votes = np.isfinite(line_offsets).sum(axis=0)
        start = np.where(has_votes > 0, np.nansum(line_offsets, axis=0) / np.maximum(has_votes, 1), np.nan)
    # Repeated, as a line's mean distance is from the axis of the round before.
    axis = fill_gaps(start)
    for _ in range(_ROUNDS):
        voted_offsets = _vote_axis(lines, axis)
        # The votes give the axis up to a constant, which its guides fix.
        voted_offsets = voted_offsets + _mean_difference(centre - voted_offsets)
        axis = fill_gaps(voted_offsets)
    smooth_axis = smooth(
        voted_offsets,
        np.where(np.isfinite(voted_offsets), 1.0, 0.0),
        STRETCH * SPACING,
        _AXIS_WAVELENGTH,
        usual_std=USUAL,
    )
    # The deviation of the constant, which smoothing along the road doesn't lessen.
    level_std = mean_with_std(centre - voted_offsets)[1]
    level_std = float(
        np.hypot(level_std if np.isfinite(level_std) else 0.0, _shared_error(guides, smooth_axis.scatter))
    )
    has_votes = np.isfinite(voted_offsets)
    # No curve is guessed where nothing was seen.
    axis_offsets = np.interp(stations, stations[has_votes], smooth_axis.values[has_votes])
    return FoundAxis(stations, axis_offsets, np.hypot(smooth_axis.std, level_std), voted_offsets)


def axis_guides(layout: RoadLayout) -> tuple[Line, ...]:
    """Return the lines, or edges in their place, whose mean offset is the axis: one or two."""
    if layout.kind == "dual":
        right_band, left_band = layout.bands
        return right_band.guide(1), left_band.guide(-1)
    (band,) = layout.bands
    if band.axis_line is not None:
        return (band.axis_line,)
    guides = band.guide(-1), band.guide(1)
    # A line on one side and the pavement's edge on the other have nothing between them that is the middle of both.
    same_kind = (guides[0].width > 0.0) == (guides[1].width > 0.0)
    return guides if same_kind and _seen_together(guides) >= _TOGETHER * _seen_together(layout.edges) else layout.edges


def _seen_together(pair: tuple[Line, Line]) -> int:
    """Return the number of stretches in which both of two lines are seen."""
    return int((np.isfinite(pair[0].measured) & np.isfinite(pair[1].measured)).sum())


def _vote_axis(lines: list[Line], axis: Float) -> Float:
    """Return the axis on which all lines agree best: its offset (K,), m, in each stretch; NaN where none has a vote.

    Each line votes for the place at its mean distance beside it; the result is the weighted mean of the votes.

    Args:
        lines: L lines.
        axis: (K,) offsets, m, of the axis from which the lines' mean distances are measured.
    """
    # All arrays below are (L, K) but `mean` and `scatter` (L,) and `total` (K,); NaN where a line isn't seen.
    offsets = np.array([line.measured for line in lines])
    std = np.array([line.std for line in lines])
    distance = offsets - axis
    mean = np.array([mean_with_std(row)[0] for row in distance])
    scatter = np.array([_robust_spread(row - value) for row, value in zip(distance, mean, strict=True)])
    is_measured = np.isfinite(offsets) & np.isfinite(std)
    # Inverse variances: the scatter of a line's distance and the error of each offset add up; 1 mm^2 keeps them finite.
    weight = np.where(is_measured, 1.0 / (scatter[:, None] ** 2 + np.where(is_measured, std, 1.0) ** 2 + 1e-6), 0.0)
    # A line whose distance changes, where a lane begins or ends, has no vote there: Tukey's bisquare is 0 far from the
    # mean, by the line's own scatter, or what is usual.
    residual = np.where(is_measured, distance - mean[:, None], 0.0)
    weight *= np.array([bisquare(row, max(sigma, USUAL)) for row, sigma in zip(residual, scatter, strict=True)])
    votes = np.where(is_measured, offsets - mean[:, None], 0.0)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0.0, (weight * votes).sum(axis=0) / total, np.nan)


def _shared_error(guides: tuple[Line, ...], scatter: float) -> float:
    """Return the standard deviation, m, of the error that all offsets of the axis share, see `hidden_std`."""
    return float(np.sqrt(sum(hidden_std(line.spacing, scatter) ** 2 for line in guides))) / len(guides)


def _robust_spread(values: Float) -> float:
    """Return the robust deviation of values, m, at least 3 mm (chosen: paint isn't laid better); inf without any."""
    finite_values = values[np.isfinite(values)]
    return max(robust_scale(finite_values), 0.003) if len(finite_values) else np.inf


def _mean_difference(difference: Float) -> float:
    """Return the robust mean of differences, m; 0 without any."""
    value = mean_with_std(difference)[0]
    return value if np.isfinite(value) else 0.0
