"""The painted line beside a measured axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ml.data.corridor import Truth
from ml.data.points import Points
from ml.data.roads import LearningRoad
from ml.scores.paint import REACH, with_painted_line
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis


def swaying_road(paint: float = 1.5, sway: float = 0.4, bare: tuple[float, float] = (0.0, 0.0)) -> LearningRoad:
    """Return a straight road with a painted line at y = 0 and an axis that sways about it, m."""
    rng = np.random.default_rng(1)
    xyz = np.column_stack([rng.uniform(0.0, 200.0, 40_000), rng.uniform(-4.0, 4.0, 40_000), np.zeros(40_000)])
    line = (np.abs(xyz[:, 1]) < 0.12) & ~((xyz[:, 0] >= bare[0]) & (xyz[:, 0] < bare[1]))
    intensity = np.exp(0.2 * rng.standard_normal(len(xyz)) + paint * line).astype(np.float32)
    zeros = np.zeros(len(xyz))
    points = Points(
        origin=np.zeros(3),
        xyz=xyz,
        intensity=intensity,
        rgb=np.zeros((len(xyz), 3), dtype=np.float32),
        class_id=zeros.astype(np.uint8),
        class_names={0: "ground"},
        has_color=False,
    )
    x = np.arange(0.0, 200.5, 1.0)
    axis = MeasuredAxis(np.column_stack([x, sway * np.sin(x / 15.0)]))
    return LearningRoad.of_points("swaying", points, axis, Truth.of_axis(axis, "carriageway"))


def test_the_line_is_found_where_the_axis_is_not() -> None:
    found = with_painted_line(swaying_road()).known_truth.axis
    assert found.length > 190.0
    assert len(found.parts) == 1
    # Over 10 m the axis turns by a quarter of its sway; the line is straight.
    assert np.abs(found.points[:, 1]).mean() < 0.04
    assert np.abs(found.points[:, 1]).max() < 0.15


def test_no_line_is_found_where_none_is_painted() -> None:
    with pytest.raises(InputError, match="painted line"):
        with_painted_line(swaying_road(paint=0.0))
    found = with_painted_line(swaying_road(bare=(80.0, 120.0))).known_truth.axis
    assert not found.inside([100.0])[0]
    assert found.inside(np.array([40.0, 160.0])).all()


def test_what_is_bright_farther_away_is_no_line_of_the_axis() -> None:
    far = swaying_road(sway=0.0)
    axis = MeasuredAxis(far.reference.points + np.array([0.0, REACH + 0.1, 0.0]))
    with pytest.raises(InputError, match="painted line"):
        with_painted_line(replace(far, truth=Truth.of_axis(axis, "carriageway")))


def test_the_points_stay() -> None:
    road = swaying_road()
    assert with_painted_line(road).xyz is road.xyz
