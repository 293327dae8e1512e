"""A path and the axis are found again and again until they lie still: what has slipped by a lane comes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from synthroads_addon.reconstruction.axis import Options, find_axis, straighten_path
from synthroads_addon.reconstruction.cloud import read_road_cloud
from synthroads_addon.reconstruction.path import path_through
from synthroads_addon.road.geometry import RoadGeometry
from tests.helpers.clouds.road_clouds import cloud_of, road, write


def test_a_path_that_slips_by_a_lane_comes_back_to_the_axis(tmp_path: Path) -> None:
    parameters = road("RQ36", "EKA1A", 400.0, 5)
    cloud = read_road_cloud(write(tmp_path / "cloud.laz", cloud_of(parameters, 10.0, 1)))
    alignment = RoadGeometry(parameters).alignment
    moved = np.array(parameters.transform.translate[:2]) - cloud.origin[:2]
    station = np.arange(0.0, alignment.length, 5.0)
    position, heading, _ = alignment.frame(station)
    beside = 3.0 * np.tanh((200.0 - station) / 25.0)
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    found = find_axis(cloud, path_through(position + moved + beside[:, None] * left), 25.0, Options())
    axis = found.path.place(found.axis.stations, found.axis.offsets)
    _, off = alignment.project(axis - moved)
    assert np.abs(off).max() < 0.12
    assert np.abs(found.axis.offsets).max() < 0.15


def test_a_path_with_a_kink_is_laid_beside_the_lines_until_it_lies_still(tmp_path: Path) -> None:
    parameters = road("RQ36", "EKA1A", 400.0, 5)
    cloud = read_road_cloud(write(tmp_path / "cloud.laz", cloud_of(parameters, 10.0, 1)))
    alignment = RoadGeometry(parameters).alignment
    moved = np.array(parameters.transform.translate[:2]) - cloud.origin[:2]
    station = np.arange(0.0, alignment.length, 5.0)
    position, heading, _ = alignment.frame(station)
    beside = 8.0 * np.tanh((200.0 - station) / 40.0)
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    path, _ = straighten_path(cloud, Options(path=position + moved + beside[:, None] * left))
    _, off = alignment.project(path.points - moved)
    assert np.ptp(off) < 0.3
