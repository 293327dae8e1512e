"""Heights between points that lie far apart: grades that swing there, though they pass through the points, are calmed.

Elements found at points alone may leave one of them steeply and come back to the next. Where they are farther from the
chord of two points than the bends of the line through the points around allow, two parabolas stand in from point to
point: with the grade of the parabola through each point and its neighbours, and one grade in the middle that leads from
one point to the next.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import Bool, Float
from .chain import FREE
from .design import Model


def without_swings(model: Model, station: Float, heights: Float, allowed: float) -> Model:
    """Return a model of grades without the swings between points.

    Args:
        model: of order 1, near the heights.
        station, heights: (N,) of the points, m.
        allowed: distance (m) from which a swing is one.
    """
    swinging = swings(model, station, heights) > allowed
    if not swinging.any():
        return model
    padded = np.pad(swinging, 1)
    wide = padded[:-2] | padded[1:-1] | padded[2:]  # beside a swing the elements are askew as well
    grade = np.gradient(heights, station)
    for first, last in reversed(_runs(wide)):
        part = slice(first, last + 2)
        model = _with_parabolas(model, station[part], heights[part], grade[part])
    return model


def swings(model: Model, station: Float, heights: Float) -> Float:
    """Return how much farther (N - 1,) a model is from the middles of chords than the bends around allow, m.

    Of a bend of the curvature k a chord of the length h has a sagitta of k h^2 / 8.
    """
    chord = np.diff(station)
    bend = np.diff(np.diff(heights) / chord) / (0.5 * (chord[1:] + chord[:-1]))
    padded = np.pad(bend, 2, mode="edge") if len(bend) else np.zeros(len(chord) + 3)
    around = np.lib.stride_tricks.sliding_window_view(padded, 4)[: len(chord)]
    off = model.evaluate(0.5 * (station[1:] + station[:-1])) - 0.5 * (heights[1:] + heights[:-1])
    low, high = (-0.125 * chord**2 * limit for limit in (around.max(axis=1), around.min(axis=1)))
    return np.asarray(np.maximum(np.maximum(low - off, off - high), 0.0))


def _runs(flags: Bool) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of flags."""
    edges = np.flatnonzero(np.diff(np.pad(flags, 1).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _with_parabolas(model: Model, station: Float, heights: Float, grade: Float) -> Model:
    """Return a model with two parabolas from point to point of a stretch (N,), which ends where it did."""
    heights = heights.copy()
    heights[[0, -1]] = model.evaluate(station[[0, -1]])
    chord = np.diff(station)
    middle = 2.0 * np.diff(heights) / chord - 0.5 * (grade[1:] + grade[:-1])
    knots = np.empty(2 * len(chord) + 1)
    knots[::2], knots[1::2] = station, 0.5 * (station[1:] + station[:-1])
    values = np.empty((2 * len(chord), 2))
    values[::2] = np.column_stack([grade[:-1], middle])
    values[1::2] = np.column_stack([middle, grade[1:]])
    before, after = _part(model, -np.inf, float(station[0])), _part(model, float(station[-1]), np.inf)
    rows = [row for row in (before, (knots, values), after) if len(row[1])]
    joined = np.concatenate([rows[0][0][:1], *(row[0][1:] for row in rows)])
    count = sum(len(row[1]) for row in rows)
    start = model.evaluate(joined[:1]) if len(before[1]) else heights[:1]
    return replace(
        model,
        start=start,
        knots=joined,
        values=np.concatenate([row[1] for row in rows]),
        kinds=np.full(count, FREE),
        smooth=np.zeros(count - 1, dtype=bool),
    )


def _part(model: Model, low: float, high: float) -> tuple[Float, Float]:
    """Return knots (K + 1,) and values (K, 2) of a model's elements within two stations, m, the outer ones cut."""
    knots, values = list[float](), list[list[float]]()
    for e, (first, last) in enumerate(model.values.tolist()):
        a, b = float(model.knots[e]), float(model.knots[e + 1])
        begin, end = max(a, low), min(b, high)
        if end - begin <= 1e-6:
            continue
        slope = (last - first) / (b - a)
        knots += [begin] if not knots else []
        knots.append(end)
        values.append([first + slope * (begin - a), first + slope * (end - a)])
    return np.array(knots), np.array(values).reshape(-1, 2)
