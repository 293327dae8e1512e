"""The lines' vote for the axis: a line whose distance changes, where a lane begins or ends, moves it nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.layout import Band, RoadLayout, axis_from_lines
from synthroads_addon.reconstruction.lines import Line

STATIONS: Float = 5.0 * np.arange(60) + 2.5


def line(offset: float | Float, width: float = 0.15) -> Line:
    """Return a line at an offset or offsets (60,), m, with a centimetre of noise."""
    noise = np.random.default_rng(7).normal(0.0, 0.01, len(STATIONS))
    measured = np.asarray(np.broadcast_to(np.asarray(offset, dtype=float), STATIONS.shape) + noise)
    zeros = np.zeros(len(STATIONS))
    return Line(STATIONS, measured, measured, zeros + 0.01, zeros, zeros, 0.0, 300.0, width)


@pytest.mark.parametrize("begin", [60.0, 200.0])
def test_a_lane_that_ends_moves_the_axis_nowhere(begin: float) -> None:
    outwards = 3.5 * np.clip((STATIONS - begin) / 60.0, 0.0, 1.0)
    guides = line(-2.0), line(2.0)
    right = Band(
        -9.0, -1.5, [line(-9.0 - outwards), line(-5.5 - outwards), guides[0]], (line(-9.5, 0.0), line(-1.5, 0.0))
    )
    left = Band(1.5, 9.0, [guides[1], line(5.5), line(9.0)], (line(1.5, 0.0), line(9.5, 0.0)))
    gap = np.where((STATIONS > 100.0) & (STATIONS < 140.0), np.nan, 0.0)
    for guide in guides:  # where its own lines are hidden the others carry the axis on
        guide.measured[:] += gap
    axis = axis_from_lines(RoadLayout("dual", (right, left), np.zeros((300, 200)), ()))
    assert np.abs(axis.offsets).max() < 0.05
    assert np.isfinite(axis.raw).all()
