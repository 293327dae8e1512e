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


def calm_swings(model: Model, station: Float, heights: Float, largest_swing: float) -> Model:
    """Return a model of grades in which parabolas from point to point replace elements that swing between points.

    Args:
        model: model of grades (order 1), near the heights.
        station, heights: (N,) of the points, m.
        largest_swing: swing that stays, m (`excess_swings`).
    """
    is_swing = excess_swings(model, station, heights) > largest_swing
    if not is_swing.any():
        return model
    padded_flags = np.pad(is_swing, 1)
    # Beside a swing the elements are askew as well.
    widened_flags = padded_flags[:-2] | padded_flags[1:-1] | padded_flags[2:]
    grade = np.gradient(heights, station)
    for first_chord, last_chord in reversed(_runs(widened_flags)):
        points = slice(first_chord, last_chord + 2)
        model = _insert_parabolas(model, station[points], heights[points], grade[points])
    return model


def excess_swings(model: Model, station: Float, heights: Float) -> Float:
    """Return a model's swing (N - 1,), m, between points: its distance off a chord's middle beyond the bends around.

    A bend of curvature k has the sagitta k h^2 / 8 over a chord of length h; the bends are those at the points around.
    """
    chord = np.diff(station)
    bend = np.diff(np.diff(heights) / chord) / (0.5 * (chord[1:] + chord[:-1]))
    padded_bend = np.pad(bend, 2, mode="edge") if len(bend) else np.zeros(len(chord) + 3)
    around = np.lib.stride_tricks.sliding_window_view(padded_bend, 4)[: len(chord)]
    distance = model.evaluate(0.5 * (station[1:] + station[:-1])) - 0.5 * (heights[1:] + heights[:-1])
    lower_limit, upper_limit = (-0.125 * chord**2 * limit for limit in (around.max(axis=1), around.min(axis=1)))
    return np.asarray(np.maximum(np.maximum(lower_limit - distance, distance - upper_limit), 0.0))


def _runs(flags: Bool) -> list[tuple[int, int]]:
    """Return the first and the last index, included, of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.pad(flags, 1).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _insert_parabolas(model: Model, station: Float, heights: Float, grade: Float) -> Model:
    """Return a model in which two parabolas from point to point replace the elements along a stretch of points.

    Args:
        model: model of grades; its elevations at the stretch's ends stay.
        station, heights: (N,) of the stretch's points, m.
        grade: (N,) grade at each point, m/m.
    """
    heights = heights.copy()
    heights[[0, -1]] = model.evaluate(station[[0, -1]])
    chord = np.diff(station)
    middle = 2.0 * np.diff(heights) / chord - 0.5 * (grade[1:] + grade[:-1])
    knots = np.empty(2 * len(chord) + 1)
    knots[::2], knots[1::2] = station, 0.5 * (station[1:] + station[:-1])
    values = np.empty((2 * len(chord), 2))
    values[::2] = np.column_stack([grade[:-1], middle])
    values[1::2] = np.column_stack([middle, grade[1:]])
    model_before = _cut_elements(model, -np.inf, float(station[0]))
    model_after = _cut_elements(model, float(station[-1]), np.inf)
    sections = [row for row in (model_before, (knots, values), model_after) if len(row[1])]
    all_knots = np.concatenate([sections[0][0][:1], *(row[0][1:] for row in sections)])
    count = sum(len(row[1]) for row in sections)
    start = model.evaluate(all_knots[:1]) if len(model_before[1]) else heights[:1]
    return replace(
        model,
        start=start,
        knots=all_knots,
        values=np.concatenate([row[1] for row in sections]),
        kinds=np.full(count, FREE),
        smooth=np.zeros(count - 1, dtype=bool),
    )


def _cut_elements(model: Model, lower_station: float, upper_station: float) -> tuple[Float, Float]:
    """Return knots (K + 1,) and values (K, 2) of a model's elements between two stations, m, the outermost ones cut."""
    knots, values = list[float](), list[list[float]]()
    for e, (start_value, end_value) in enumerate(model.values.tolist()):
        a, b = float(model.knots[e]), float(model.knots[e + 1])
        begin, end = max(a, lower_station), min(b, upper_station)
        if end - begin <= 1e-6:
            continue
        slope = (end_value - start_value) / (b - a)
        knots += [begin] if not knots else []
        knots.append(end)
        values.append([start_value + slope * (begin - a), start_value + slope * (end - a)])
    return np.array(knots), np.array(values).reshape(-1, 2)
