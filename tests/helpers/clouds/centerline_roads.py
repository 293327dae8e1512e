"""Straight and curved roads of random points, whose centreline is known, for tests of centreline regression."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ml.data.corridor import Truth
from ml.data.points import Points
from ml.data.roads import LearningRoad
from synthroads_addon.base.random_streams import stream
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

Float = NDArray[np.float64]
REAL = Path(__file__).resolve().parents[3].parent / "shared" / "real"
NAMES = {0: "ground", 1: "road", 2: "road_marking"}


def arc_points(station: Float, offset: Float, radius: float) -> Float:
    """Return points (N, 2) beside an arc to the left that begins at 0, 0 eastward."""
    turn = station / radius
    return np.column_stack([(radius - offset) * np.sin(turn), radius - (radius - offset) * np.cos(turn)])


def strip_road(
    name: str = "strip", left: float = 7.0, right: float = -7.0, length: float = 200.0, radius: float = 1500.0
) -> LearningRoad:
    """Return a two-lane road: asphalt up to 3.5 m, edge lines at 3.2 m, a line in the middle, bright grass beyond."""
    random = stream(11, name)
    count = int(length * (left - right) * 15)
    station, offset = random.uniform(0.0, length, count), random.uniform(right, left, count)
    paved = np.abs(offset) < 3.5
    line = (np.abs(np.abs(offset) - 3.2) < 0.1) | (np.abs(offset) < 0.1)
    intensity = np.where(line, 0.6, np.where(paved, 0.25, 0.55)) + random.normal(0.0, 0.02, count)
    xyz = np.column_stack([arc_points(station, offset, radius), 0.01 * random.normal(size=count)])
    axis = MeasuredAxis(arc_points(np.arange(0.0, length + 0.5), np.zeros(int(length) + 1), radius))
    points = Points(
        origin=np.zeros(3),
        xyz=xyz,
        intensity=intensity.astype(np.float32),
        rgb=np.zeros((count, 3), dtype=np.float32),
        class_id=np.where(line, 2, np.where(paved, 1, 0)).astype(np.uint8),
        class_names=NAMES,
    )
    return LearningRoad.of_points(name, points, axis, Truth.of_axis(axis, "road"))
