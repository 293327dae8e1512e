"""A path and the axis are found again and again until they lie still: what has slipped by a lane comes back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.reconstruction import axis as axis_module
from synthroads_addon.reconstruction.axis import Options, find_axis, straighten_path
from synthroads_addon.reconstruction.cloud import RoadCloud, read_road_cloud
from synthroads_addon.reconstruction.layout import RoadKind, RoadLayout
from synthroads_addon.reconstruction.lines import Line
from synthroads_addon.reconstruction.path import path_through
from synthroads_addon.reconstruction.profiles import Profiles
from synthroads_addon.road.alignment import Alignment
from synthroads_addon.road.geometry import RoadGeometry
from tests.helpers.clouds.foreign_clouds import EAST, LENGTH, NORTH, axis_north, rural, throw
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


def line_found(cloud: RoadCloud) -> Float:
    """Return how far north of the axis of a thrown cloud that slants by 3 m the found one lies, m, by metre."""
    path, half = straighten_path(cloud, Options())
    found = find_axis(cloud, path, half, Options())
    place = found.path.place(found.axis.stations, found.axis.offsets) + cloud.origin[:2]
    off = place[:, 1] - NORTH - axis_north(place[:, 0] - EAST, 3.0)
    return np.interp(np.arange(5.0, LENGTH - 5.0), place[:, 0] - EAST, off)


def test_the_axis_stays_where_it_is_when_some_points_are_missing(tmp_path: Path) -> None:
    cloud = read_road_cloud(throw(tmp_path / "rural.laz", rural, 1, 3.0))
    whole, apart = line_found(cloud), []
    for seed in (1, 2, 3):
        kept = np.random.default_rng(seed).random(len(cloud.xyz)) >= 0.05
        thinned = replace(cloud, xyz=cloud.xyz[kept], intensity=cloud.intensity[kept], kind=cloud.kind[kept])
        apart.append(line_found(thinned) - whole)
    assert np.sqrt(np.mean(np.square(apart))) < 0.006  # 0.008 in one grid of bins
    assert np.sqrt(np.mean(np.square(whole))) < 0.015


def test_a_grid_that_shows_no_road_has_no_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cloud = read_road_cloud(throw(tmp_path / "rural.laz", rural, 1, 3.0))
    whole, find_layout = line_found(cloud), axis_module.find_layout

    def find_no_other(
        profiles: Profiles,
        lines: list[Line],
        wanted: RoadKind | None = None,
        asked: bool = True,
        learned: Float | None = None,
    ) -> RoadLayout:
        if wanted is not None:  # the kind that the first grid showed
            raise InputError("road", None, "no carriageway can be made out in the cloud")
        return find_layout(profiles, lines, wanted, asked, learned)

    monkeypatch.setattr(axis_module, "find_layout", find_no_other)
    assert 0.0 < np.abs(line_found(cloud) - whole).max() < 0.03
