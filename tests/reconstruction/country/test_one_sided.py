"""Bays and lay-bys beside a road without a middle line: which of the pavement's edges keeps the road's course."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.reconstruction.country.one_sided import one_sided
from synthroads_addon.reconstruction.edges import Pavement
from synthroads_addon.reconstruction.path import SPACING, CloudPath, path_through
from synthroads_addon.reconstruction.profiles import ACROSS, STRETCH, Profiles

HALF = 2.75
"""Half of the road's usual width, m."""
MIDDLES: Float = np.arange(2.5, 250.0, STRETCH)
"""Middles of the stretches along the road, m."""


def bay(stations: Float, start: float, length: float, width: float = 3.3, taper: float = 20.0) -> Float:
    """Return the width (N,), m, of a bay at stations (N,), m."""
    return width * np.clip(np.minimum((stations - start) / taper, (start + length - stations) / taper), 0.0, 1.0)


def axis(radius: float) -> CloudPath:
    """Return an axis of 250 m: straight, then over a clothoid of 40 m into a curve."""
    station = np.arange(0.0, 250.5, 0.5)
    heading = np.cumsum(np.clip((station - 60.0) / 40.0, 0.0, 1.0) / radius) * 0.5
    return path_through(0.5 * np.column_stack([np.cumsum(np.cos(heading)), np.cumsum(np.sin(heading))]))


def seen_along_middle(
    true: CloudPath, right_bay: Float, left_bay: Float, noise: float
) -> tuple[CloudPath, Float, Float, Float]:
    """Return a path in the middle of the pavement, its stretches, and both edges as seen from it; bays by stretch."""
    rng = np.random.default_rng(5)
    dense = true.stations
    right_dense, left_dense = (np.interp(dense, MIDDLES, values) for values in (right_bay, left_bay))
    path = path_through(true.place(dense, 0.5 * (left_dense - right_dense)))
    stations = np.arange(2.5, path.length, STRETCH)
    edges = []
    for sign, wider in ((-1.0, right_dense), (1.0, left_dense)):
        station, offset = path.project(true.place(dense, sign * (HALF + wider)))
        edges.append(np.interp(stations, station, offset) + rng.normal(0.0, noise, len(stations)))
    return path, stations, edges[0], edges[1]


def error(true: CloudPath, path: CloudPath, stations: Float, offsets: Float) -> Float:
    """Return how far (K,), m, offsets from a path lie beside the true axis."""
    return np.abs(true.project(path.place(stations, offsets))[1])


@pytest.mark.parametrize("noise", [0.01, 0.06])
@pytest.mark.parametrize("radius", [1e6, 120.0, -200.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_the_edge_without_a_bay_keeps_the_course(side: int, radius: float, noise: float) -> None:
    """The pavement's middle, along which the path runs, lies 1.65 m beside the axis there."""
    true, wider, none = axis(radius), bay(MIDDLES, 90.0, 90.0), np.zeros(len(MIDDLES))
    path, stations, right, left = seen_along_middle(true, *((wider, none) if side < 0 else (none, wider)), noise)
    assert error(true, path, stations, 0.5 * (right + left)).max() > 1.5
    found = one_sided(path, stations, right, left)
    assert found is not None
    assert error(true, path, stations, found.axis).max() < 0.15 + 2.0 * noise
    assert found.shift[np.argmin(np.abs(stations - 135.0))] == pytest.approx(side * 1.65, abs=0.15)
    assert not found.is_open.any()
    moved = found.course(path, stations)
    assert np.abs(true.project(moved.points[10:-10])[1]).max() < 0.2


def test_bays_on_both_sides_that_overlap_are_told_apart() -> None:
    true = axis(-300.0)
    path, stations, right, left = seen_along_middle(true, bay(MIDDLES, 60.0, 65.0), bay(MIDDLES, 105.0, 80.0), 0.02)
    found = one_sided(path, stations, right, left)
    assert found is not None
    assert error(true, path, stations, found.axis).max() < 0.4
    assert found.share[np.argmin(np.abs(stations - 85.0))] == 1.0
    assert found.share[np.argmin(np.abs(stations - 160.0))] == 0.0


def test_pavement_that_widens_on_both_sides_alike_has_its_axis_in_the_middle() -> None:
    true, wider = axis(1e6), bay(MIDDLES, 90.0, 90.0, 1.6)
    path, stations, right, left = seen_along_middle(true, wider, wider, 0.02)
    found = one_sided(path, stations, right, left)
    assert found is not None
    assert np.abs(found.shift).max() < 0.05
    assert not found.is_open.any()


def test_edges_too_rough_to_tell_are_said_to_be_open() -> None:
    """Over long tapers on edges that wander by half a metre either of them may be the one that keeps its course."""
    wider, none = bay(MIDDLES, 60.0, 150.0, 2.0, 70.0), np.zeros(len(MIDDLES))
    path, stations, right, left = seen_along_middle(axis(1e6), wider, none, 0.4)
    found = one_sided(path, stations, right, left)
    assert found is not None
    assert found.is_open.sum() > 8


def test_pavement_as_wide_as_usual_has_its_axis_in_the_middle() -> None:
    none = np.zeros(len(MIDDLES))
    path, stations, right, left = seen_along_middle(axis(150.0), none, none, 0.03)
    found = one_sided(path, stations, right, left)
    assert found is not None
    assert not found.excess.any()
    assert one_sided(path, stations, np.full(len(right), np.nan), left) is None


@pytest.fixture
def askew() -> tuple[Pavement, Float]:
    """Return pavement whose left edge leaves the path by 0.15 m per m, and its offset in the middles of stretches."""
    path = path_through(np.array([[0.0, 0.0], [60.0, 0.0]]))
    rows, columns = len(path.points) - 1, 240
    stations = SPACING * (np.arange(rows) + 0.5)
    offsets = ACROSS * (np.arange(columns) - columns // 2 + 0.5)
    edge = 0.5 + 0.15 * stations
    # Few bins of a row have points, as in a scan from the air.
    is_seen = np.random.default_rng(1).random((rows, columns)) < 0.3
    share = np.where(is_seen, (offsets < edge[:, None]) & (offsets > -5.0), np.nan).astype(np.float32)
    grid = np.zeros((rows, columns), dtype=np.float32)
    profiles = Profiles(path, stations, offsets, grid + 1.0, grid, share, grid, grid, None)
    is_in_reach = (profiles.middles > 3.0) & (profiles.middles < 35.0)
    return Pavement(profiles, share), np.where(is_in_reach, 0.5 + 0.15 * profiles.middles, np.nan)


def test_an_edge_askew_to_the_path_is_measured_along_its_course(askew: tuple[Pavement, Float]) -> None:
    pavement, true = askew
    begin = np.zeros(len(true))
    plain, along = (np.nanmax(np.abs(pavement.edge(begin, 1, 6.0, slope).offsets - true)) for slope in (0.0, 0.15))
    assert along < 0.6 * plain
    assert along < 0.05
