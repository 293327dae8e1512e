"""The study of roads whose lines are painted out: what is painted, and what its figures count."""

from __future__ import annotations

import numpy as np
import pytest

from studies.reconstruction.unpainted import bright_points, figures_of, painted_out
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.reconstruction.cloud import PointKind, RoadCloud
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

LENGTH, HALF = 100.0, 5.0
GRASS, ASPHALT, LINE = 400.0, 200.0, 320.0


def road() -> tuple[RoadCloud, np.ndarray, np.ndarray]:
    """Return a road along x, 6 m wide, with a dashed line in its middle; and the points' stations and offsets."""
    random = np.random.default_rng(3)
    station, offset = random.uniform(0.0, LENGTH, 20_000), random.uniform(-HALF, HALF, 20_000)
    intensity = np.where(np.abs(offset) < 3.0, ASPHALT, GRASS) + random.normal(0.0, 8.0, 20_000)
    intensity[line_of(station, offset)] = LINE
    xyz = np.column_stack([station, offset, np.zeros(20_000)])
    kind = np.full(20_000, PointKind.GROUND, dtype=np.uint8)
    cloud = RoadCloud(xyz, intensity.astype(np.float32), kind, np.zeros(3), Placement(), False, False, 20_000, {})
    return cloud, station, offset


def line_of(station: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return which points are on the line."""
    on_line: np.ndarray = (np.abs(offset) < 0.08) & (station % 12.0 < 4.0)
    return on_line


def test_lines_are_painted_out_and_nothing_else() -> None:
    cloud, station, offset = road()
    painted = painted_out(cloud, station, offset, (-3.0, 3.0), 1)
    line, beside = line_of(station, offset), np.abs(offset) > 3.0
    assert painted.intensity[line].max() < ASPHALT + 50.0
    assert painted.intensity[line].std() == pytest.approx(8.0, rel=0.3), "as uneven as the asphalt"
    assert (painted.intensity[beside] == cloud.intensity[beside]).all()
    assert (painted.intensity[~line] == cloud.intensity[~line]).mean() > 0.9
    assert (painted.xyz == cloud.xyz).all()
    assert (cloud.intensity[line] == LINE).all(), "the cloud itself stays"
    other = painted_out(cloud, station, offset, (-3.0, 3.0), 2)
    assert (other.intensity[line] != painted.intensity[line]).any()


def test_points_beside_bright_ones_count_as_a_lines() -> None:
    station, offset = np.linspace(0.0, 9.0, 100), np.zeros(100)
    intensity = np.concatenate([np.full(99, 1.0), [9.0]]) + np.linspace(0.0, 0.01, 100)
    assert np.flatnonzero(bright_points(intensity, station, offset)).tolist() == [97, 98, 99]
    assert not bright_points(intensity[:50], station[:50], offset[:50]).any()


def test_figures_count_lengths_within_limits_and_doubts() -> None:
    """A line of 210 m is right for half of its length, then 2 m off; of that, half is doubted."""
    axis = MeasuredAxis([[0.0, 0.0, 0.0], [210.0, 0.0, 0.0]])
    stations = np.arange(0.0, 210.5, 0.5)
    points = np.column_stack([stations, np.where(stations < 105.0, 0.1, 2.0)])
    figures = figures_of(points, stations, [(155.0, 300.0)], axis)
    assert figures.near == pytest.approx(50.0, abs=1.0)
    assert figures.near_or_doubted == pytest.approx(75.0, abs=1.0)
    assert figures.silent == pytest.approx(25.0, abs=1.0)
    assert figures.error == pytest.approx(1.05, abs=0.05)
    half = figures_of(points[:210], stations[:210], [], axis)
    assert half.near_or_doubted == pytest.approx(100.0, abs=1.0), "where there is no line, none is trusted"
