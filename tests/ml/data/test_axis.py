"""`MeasuredAxis`: stations, gaps, projection and crossing against circles and straight lines; the frames along it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ml.data.frames import Frames, displace_frames, estimated_path, frames_along, random_deviation, read_path, sequences
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

RADIUS = 300.0
REAL = Path(__file__).resolve().parents[3].parent / "shared" / "real"


def arc(length: float = 200.0, step: float = 0.5, radius: float = RADIUS) -> MeasuredAxis:
    """Return an arc to the left that begins at the origin towards x, its centre at (0, radius)."""
    angle = np.arange(0.0, length / radius + 1e-9, step / radius)
    return MeasuredAxis(
        np.column_stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), 5.0 + 0.02 * radius * angle])
    )


def with_gap() -> MeasuredAxis:
    x = np.concatenate([np.arange(0.0, 21.0), np.arange(50.0, 81.0)])
    return MeasuredAxis(np.column_stack([x, 0.0 * x]), np.diff(x) < 2.0)


def test_station_position_and_direction_of_an_arc() -> None:
    axis = arc()
    station = np.array([0.0, 0.3, 50.0, 123.4, axis.length])
    angle = station / RADIUS
    exact = np.column_stack([RADIUS * np.sin(angle), RADIUS * (1.0 - np.cos(angle))])
    np.testing.assert_allclose(axis.position(station), exact, atol=2e-4)
    np.testing.assert_allclose(axis.elevation(station), 5.0 + 0.02 * station, atol=1e-4)
    # At the ends the chord has one side only.
    np.testing.assert_allclose(axis.direction(station), angle, atol=0.006)
    np.testing.assert_allclose(axis.direction(station[2:4]), angle[2:4], atol=1e-4)


def test_projection_onto_an_arc() -> None:
    rng = np.random.default_rng(0)
    along_arc, offset = rng.uniform(1.0, 199.0, 500), rng.uniform(-30.0, 30.0, 500)
    angle, r = along_arc / RADIUS, RADIUS - offset
    xy = np.column_stack([r * np.sin(angle), RADIUS - r * np.cos(angle)])
    station, found = arc().project(xy)
    np.testing.assert_allclose(found, offset, atol=1e-3)
    np.testing.assert_allclose(station, along_arc, atol=0.03)


def test_projection_finds_the_nearest_place_of_a_rough_line() -> None:
    rng = np.random.default_rng(2)
    x = np.cumsum(rng.uniform(0.4, 1.7, 80))
    axis = MeasuredAxis(np.column_stack([x, np.cumsum(rng.uniform(-0.6, 0.6, 80))]))
    points = np.column_stack([rng.uniform(3.0, x[-1] - 3.0, 400), rng.uniform(-6.0, 6.0, 400)])
    station, offset = axis.project(points)
    dense = np.linspace(0.0, axis.length, 60_000)
    distance = np.linalg.norm(points[:, None, :] - axis.position(dense)[None, ::30], axis=2)
    assert (np.abs(offset) <= distance.min(axis=1) + 1e-6).all()
    np.testing.assert_allclose(np.linalg.norm(axis.position(station) - points, axis=1), np.abs(offset), atol=1e-6)


def test_projection_goes_on_beyond_the_ends() -> None:
    station, offset = with_gap().project([[-7.0, 3.0], [35.0, -2.0], [90.0, 1.0]])
    np.testing.assert_allclose(station, [-7.0, 35.0, 90.0])
    np.testing.assert_allclose(offset, [3.0, -2.0, 1.0])


def test_crossing_of_an_arc() -> None:
    rng = np.random.default_rng(1)
    station, y, turn = rng.uniform(20.0, 180.0, 200), rng.uniform(-6.0, 6.0, 200), rng.uniform(-0.1, 0.1, 200)
    axis = arc()
    direction = station / RADIUS + turn
    left = np.column_stack([-np.sin(direction), np.cos(direction)])
    found, at = axis.crossing(axis.position(station) - y[:, None] * left, direction)
    np.testing.assert_allclose(found, y, atol=1e-4)
    np.testing.assert_allclose(at, station, atol=1e-3)


def test_crossing_takes_the_nearest_branch_and_leaves_far_ones() -> None:
    # A hairpin: out along y = 0 and back along y = 40.
    axis = MeasuredAxis([[0.0, 0.0], [100.0, 0.0], [100.0, 40.0], [0.0, 40.0]])
    y, station = axis.crossing([[50.0, 15.0], [50.0, 30.0], [50.0, -70.0]], [0.0, 0.0, 0.0])
    np.testing.assert_allclose(y[:2], [-15.0, 10.0])
    np.testing.assert_allclose(station[:2], [50.0, 190.0])
    assert np.isnan(y[2])


def test_gaps() -> None:
    axis = with_gap()
    assert axis.length == 80.0
    np.testing.assert_allclose(axis.parts, [[0.0, 20.0], [50.0, 80.0]])
    assert axis.inside([0.0, 20.0, 20.5, 49.9, 50.0, 80.0, 80.1, -0.1]).tolist() == [1, 1, 0, 0, 1, 1, 0, 0]
    assert np.isnan(axis.position([35.0])).all()
    assert np.isnan(axis.direction([35.0])).all()
    y, _ = axis.crossing([[10.0, 1.0], [35.0, 1.0], [60.0, 1.0]], np.zeros(3))
    np.testing.assert_allclose(y, [-1.0, np.nan, -1.0])
    frames = frames_along(axis)
    assert len(frames) == 21 + 31
    assert not np.isnan(frames.position).any()
    assert not np.isnan(frames.direction).any()


def test_direction_does_not_follow_jumps_of_single_points() -> None:
    x = np.arange(0.0, 100.0)
    y = np.where(x > 50.0, 0.05, 0.0)
    assert np.abs(MeasuredAxis(np.column_stack([x, y])).direction(x, reach=5.0)).max() < 0.0051


def test_bad_axes_are_refused() -> None:
    for wrong in ([[0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [[0.0, np.nan], [1.0, 1.0]], [1.0, 2.0]):
        with pytest.raises(InputError, match="axis"):
            MeasuredAxis(wrong)


def test_reading_csv_with_gaps_and_geojson(tmp_path: Path) -> None:
    rows = "".join(f"{s},{x},{2.0 * s},5,0\n" for s, x in ((0, 10), (1, 11), (2, 12), (30, 40), (31, 41)))
    (tmp_path / "axis.csv").write_text("s,x,y,z,tile\n" + rows)
    axis = MeasuredAxis.read(tmp_path / "axis.csv")
    assert axis.joined.tolist() == [True, True, False, True]
    line = {"type": "LineString", "coordinates": [[10.0, 0.0, 1.0], [60.0, 0.0, 1.0], [900.0, 0.0, 1.0]]}
    (tmp_path / "axis.geojson").write_text(json.dumps(line))
    assert MeasuredAxis.read(tmp_path / "axis.geojson").joined.all()


def test_wander_is_smooth_and_uniform() -> None:
    station = np.arange(0.0, 50.0, 0.01)
    ends = []
    for seed in range(400):
        value, slope = random_deviation(station[:2], np.random.default_rng(seed), 80.0)
        ends.append(value[0])
        assert abs(slope[0]) < 0.05
    assert np.histogram(ends, bins=4, range=(-0.5, 0.5))[0].min() > 70
    value, slope = random_deviation(station, np.random.default_rng(0), 80.0)
    np.testing.assert_allclose(np.gradient(value, station)[1:-1], slope[1:-1], atol=1e-6)


def test_displaced_frames_stay_in_their_window_and_turn_with_their_path() -> None:
    axis = arc(400.0)
    exact = frames_along(axis)
    moved = [displace_frames(exact, np.random.default_rng(seed), 12.0, 0.0, 100.0) for seed in range(20)]
    offsets = np.array([axis.project(frames.position)[1] for frames in moved])
    assert np.abs(offsets).max() <= 6.0 + 1e-3
    assert np.abs(offsets).max() > 5.0
    assert offsets.std() > 2.0
    # Without an error of its own a frame looks along the displaced path.
    path = np.diff(moved[0].position, axis=0)
    heading = np.arctan2(path[:, 1], path[:, 0])
    between = 0.5 * (moved[0].direction[1:] + moved[0].direction[:-1])
    np.testing.assert_allclose(heading[5:-5], between[5:-5], atol=0.001)
    turned = displace_frames(exact, np.random.default_rng(0), 0.0, 2.0, 100.0)
    assert 0.1 < np.rad2deg(np.abs(turned.direction - exact.direction)).max() <= 4.0
    again = displace_frames(exact, np.random.default_rng(0), 0.0, 2.0, 100.0)
    assert (again.direction == turned.direction).all()


def test_points_of_frames_and_turning_round() -> None:
    frames = Frames(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0.0, np.pi / 2]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(frames.at([5.0, 1.0]), [[1.0, 7.0], [2.0, 4.0]], atol=1e-12)
    back = frames.reverse()
    np.testing.assert_allclose(back.at([-1.0, -5.0]), [[2.0, 4.0], [1.0, 7.0]], atol=1e-12)
    assert len(frames.select(slice(1))) == 1


def test_sequences_cover_all_frames_and_cross_no_gap() -> None:
    station = np.concatenate([np.arange(23.0), 40.0 + np.arange(4.0), 60.0 + np.arange(10.0)])
    frames = Frames(np.zeros((len(station), 2)), np.zeros(len(station)), station)
    runs = sequences(frames, 10)
    assert set(runs.ravel()) == set(range(len(station)))
    assert np.abs(np.diff(station[runs], axis=1)).max() <= 1.0
    assert runs.shape == (5, 10)
    assert runs[3].tolist() == [23, 24, 25, 26, 26, 26, 26, 26, 26, 26]
    assert sequences(frames.select(slice(0, 0)), 10).shape == (0, 10)
    assert len(sequences(frames, 10, step=5)) == 3 + 1 + 1 + 1


@pytest.mark.parametrize("count", [3, 40, 100])
def test_sequences_of_slices_farther_apart_than_the_frames_are_interleaved(count: int) -> None:
    station = np.concatenate([np.arange(count), 200.0 + np.arange(count)]).astype(float)
    runs = sequences(Frames(np.zeros((len(station), 2)), np.zeros(len(station)), station), 10, step=5, spacing=4.0)
    assert set(runs.ravel()) == set(range(len(station)))
    steps = np.diff(station[runs], axis=1)
    # Steps of 0 repeat a stretch's last frame.
    assert set(steps.ravel()) <= {0.0, 4.0}
    assert count < 40 or (steps == 4.0).all()


@pytest.mark.parametrize(("radius", "length"), [(300.0, 700.0), (60.0, 150.0), (5000.0, 300.0)])
def test_a_path_is_found_in_a_strip_of_points(radius: float, length: float) -> None:
    rng = np.random.default_rng(0)
    angle, offset = rng.uniform(0.0, length / radius, 40_000), rng.uniform(-9.0, 9.0, 40_000)
    # A strip with a hole of 40 m, as where a bridge was cut out.
    there = np.abs(angle * radius - 0.4 * length) > 20.0
    r = radius - offset[there]
    xy = np.column_stack([r * np.sin(angle[there]), -r * np.cos(angle[there])])
    found = estimated_path(xy)
    assert abs(found.length - length) < 4.0
    error = np.hypot(*found.position(found.stations()).T) - radius
    assert np.abs(error).max() < 0.8
    turned = estimated_path(xy[::-1])
    np.testing.assert_allclose(turned.points, found.points, atol=1e-6)


def test_no_path_in_a_point() -> None:
    with pytest.raises(InputError, match="its road can be found"):
        estimated_path(np.zeros((10, 3)))


def test_reading_a_trajectory(tmp_path: Path) -> None:
    x = np.concatenate([np.zeros(50), np.arange(0.0, 100.0, 0.05), np.full(50, 99.95)]) + 294000.0
    lines = [f"{0.1 * n:.1f},{value:.3f},5628000.0,200.0,0,0,90" for n, value in enumerate(x)]
    (tmp_path / "flight.csv").write_text("time,x,y,z,roll,pitch,heading\n" + "\n".join(lines))
    path = read_path(tmp_path / "flight.csv", (294000.0, 5628000.0, 0.0))
    assert 99.0 < path.length < 100.0
    assert np.diff(path.station).min() >= 0.3 - 1e-9
    (tmp_path / "still.csv").write_text("x,y\n294000,5628000\n294000.1,5628000\n")
    with pytest.raises(InputError, match=r"at least 0\.3 m"):
        read_path(tmp_path / "still.csv")


@pytest.mark.skipif(not REAL.is_dir(), reason="no real scans here")
@pytest.mark.parametrize("file", sorted(REAL.glob("als_*_axis.csv")), ids=lambda file: file.stem)
def test_real_axes(file: Path) -> None:
    axis = MeasuredAxis.read(file)
    given = np.genfromtxt(file, delimiter=",", names=True)["s"]
    np.testing.assert_allclose(axis.station, given - given[0], atol=0.1)
    lengths = np.diff(axis.station)
    assert (lengths[~axis.joined] > 10.0).all()
    assert (lengths[axis.joined] < 3.5).all()
    frames = frames_along(axis)
    y, station = axis.crossing(frames.position, frames.direction)
    assert np.nanmax(np.abs(y)) < 1e-6
    # Where the axis jumps by centimetres between two blocks, the direction is steady all the same.
    turns = np.abs(np.diff(frames.direction))[np.diff(frames.station) < 1.5]
    assert np.rad2deg(np.quantile(turns, 0.99)) < 2.0
    assert np.nanmax(np.abs(station - frames.station)) < 1e-6
