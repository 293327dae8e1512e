"""The painted line beside a measured axis: how far the axis itself lies from what can be seen.

An axis out of a road register is a smooth line that somebody drew; where a lane line is painted, a model that follows
the paint differs from the axis by what the axis differs from the paint. This line knows the axis, so it isn't a
predictor; it is a second truth, independent of how the first was drawn.
"""

from dataclasses import replace

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from ..data.corridor import Truth
from ..data.intensity import logarithms
from ..data.roads import LearningRoad

REACH = 1.2
"""A line is looked for up to so far from the axis, m."""
LENGTH = 10.0
"""Length of road from which one place of the line is taken, m."""
STEP = 2.0
"""Distance from one place to the next, m."""
CELL = 0.05
"""Width of a cell across the road, m."""
LINE = 0.3
"""Width over which cells are averaged: a line's, seen by an airborne scanner, m."""
BRIGHTER = 0.7
"""A line is brighter than the median beside the axis by at least so much of the logarithms' 20th to 80th percentile."""
FEWEST = 100
"""Points that a place needs at least."""


def with_painted_line(road: LearningRoad) -> LearningRoad:
    """Return a copy of the road whose true axis is the painted line found beside the measured one, with gaps.

    Raises:
        InputError: the road has no truth, or no two neighbouring places with a line.
    """
    truth = road.known_truth
    axis = truth.axis
    station, offset = axis.project(road.xyz)
    is_near = np.abs(offset) <= REACH + LINE
    station, offset = station[is_near], offset[is_near]
    logs = logarithms(road.intensity[is_near].astype(np.float64))
    order = np.argsort(station, kind="stable")
    station, offset, logs = station[order], offset[order], logs[order]
    place_stations = axis.stations(STEP)
    begins, ends = (np.searchsorted(station, place_stations + side * 0.5 * LENGTH) for side in (-1.0, 1.0))
    line_offsets = np.array([_ridge(offset[a:b], logs[a:b]) for a, b in zip(begins, ends, strict=True)])
    has_line = np.isfinite(line_offsets)
    if has_line.sum() < 2:
        raise InputError("road", road.name, "must have a painted line beside its axis")
    direction = axis.direction(place_stations[has_line])
    left_normals = np.column_stack([-np.sin(direction), np.cos(direction)])
    points = axis.position(place_stations[has_line]) + line_offsets[has_line, None] * left_normals
    line = MeasuredAxis(
        np.column_stack([points, axis.elevation(place_stations[has_line])]),
        np.diff(place_stations[has_line]) < 1.5 * STEP,
    )
    return replace(road, truth=Truth.of_axis(line, truth.kind))


def _ridge(offset: Float, logs: Float) -> float:
    """Return the offset of the brightest line across a road, m; NaN where none stands out of the median."""
    if len(offset) < FEWEST:
        return float("nan")
    middles = np.arange(-REACH, REACH + 0.5 * CELL, CELL)
    order = np.argsort(offset)
    total = np.concatenate([[0.0], np.cumsum(logs[order])])
    begin, end = (np.searchsorted(offset[order], middles + side * 0.5 * LINE) for side in (-1.0, 1.0))
    count = end - begin
    mean = np.where(count > 0, (total[end] - total[begin]) / np.maximum(count, 1), -np.inf)
    spread = float(np.subtract(*np.percentile(logs, (80.0, 20.0))))
    excess = mean - float(np.median(logs)) - BRIGHTER * spread
    best_cell = int(np.argmax(excess))
    # At the end of the reach the brightest may be the flank of something else.
    is_inner = 0 < best_cell < len(middles) - 1
    return float(middles[best_cell]) if is_inner and excess[best_cell] > 0.0 else float("nan")
