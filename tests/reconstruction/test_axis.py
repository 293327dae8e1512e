"""A path and the axis are found again and again until they lie still: what has slipped by a lane comes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.axis import Options, find_axis, straighten_path
from synthroads_addon.reconstruction.cloud import RoadCloud, read_road_cloud
from synthroads_addon.reconstruction.path import path_through
from synthroads_addon.road.alignment import Alignment
from synthroads_addon.road.geometry import RoadGeometry
from tests.helpers.clouds.road_clouds import cloud_of, road, write


def crossing_path(folder: Path, beside: float, over: float) -> tuple[RoadCloud, Alignment, Float, Float]:
    """Return a road's cloud, its axis, how far the cloud lies from it, and a path that crosses it in the middle.

    The path changes from one side to the other, a distance beside the axis (m), about as fast as over a length (m).
    """
    parameters = road("RQ36", "EKA1A", 400.0, 5)
    cloud = read_road_cloud(write(folder / "cloud.laz", cloud_of(parameters, 10.0, 1)))
    alignment = RoadGeometry(parameters).alignment
    moved = np.array(parameters.transform.translate[:2]) - cloud.origin[:2]
    station = np.arange(0.0, alignment.length, 5.0)
    position, heading, _ = alignment.frame(station)
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    return cloud, alignment, moved, position + moved + beside * np.tanh((200.0 - station) / over)[:, None] * left


def test_a_path_that_slips_by_a_lane_comes_back_to_the_axis(tmp_path: Path) -> None:
    cloud, alignment, moved, path = crossing_path(tmp_path, 3.0, 25.0)
    found = find_axis(cloud, path_through(path), 25.0, Options())
    axis = found.path.place(found.axis.stations, found.axis.offsets)
    _, off = alignment.project(axis - moved)
    assert np.abs(off).max() < 0.12
    assert np.abs(found.axis.offsets).max() < 0.15


def test_a_path_with_a_kink_is_laid_beside_the_lines_until_it_lies_still(tmp_path: Path) -> None:
    cloud, alignment, moved, path = crossing_path(tmp_path, 8.0, 40.0)
    found, _ = straighten_path(cloud, Options(path=path))
    _, off = alignment.project(found.points - moved)
    assert np.ptp(off) < 0.3
