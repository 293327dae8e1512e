"""Trajectory files: what is read, how it is joined, and every wrong input."""

from __future__ import annotations

import tracemalloc
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.rotations import quaternion_matrices, quaternions, rotation_matrix, slerp
from synthroads_addon.scanning.blocks import Blocks
from synthroads_addon.scanning.devices.shots import shots
from synthroads_addon.scanning.platforms.path import KNOT_ERROR
from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from synthroads_addon.scanning.platforms.registry import make_platform
from synthroads_addon.scanning.platforms.trajectory import COLUMNS, TrajectoryPath, read_trajectory
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import load_scenario
from tests.scanning.platforms.test_path import knot_error

ORIGIN = (500_000.0, 5_600_000.0, 100.0)
GUIDE = PolylineGuide([(0.0, 0.0, 5.0), (500.0, 0.0, 5.0)], ORIGIN)
HEADER = "time,x,y,z,roll,pitch,heading"


def write(folder: Path, text: str) -> str:
    file = folder / "trajectory.csv"
    file.write_text(text, encoding="utf-8")
    return str(file)


def rows_of(time: np.ndarray) -> np.ndarray:
    """Return a flight east with all attitudes moving, (R, 7) as in the file."""
    x = ORIGIN[0] + 8.0 * (time - time[0])
    y = ORIGIN[1] + 3.0 * np.sin(0.2 * time)
    z = ORIGIN[2] + 65.0 + np.cos(0.1 * time)
    roll, pitch, heading = 4.0 * np.sin(time), 2.0 * np.cos(0.7 * time), 90.0 + 300.0 * np.sin(0.03 * time)
    return np.column_stack([time, x, y, z, roll, pitch, heading])


def trajectory(folder: Path, rows: np.ndarray, **platform) -> TrajectoryPath:
    text = "\n".join([HEADER, *(",".join(f"{v:.9f}" for v in row) for row in rows)])
    path = make_platform(kind="trajectory", file=write(folder, text), **platform).make_path(GUIDE)
    assert isinstance(path, TrajectoryPath)
    return path


def attitudes(rows: np.ndarray) -> Rotation:
    """Return body (forward, left, up) to map rotations by the navigator's way: north-east-down, yaw-pitch-roll."""
    ned = Rotation.from_euler("ZYX", rows[:, [6, 5, 4]], degrees=True)  # forward-right-down to north-east-down
    enu = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    flu = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
    return enu * ned * flu


def test_no_pulse_leaves_after_the_trajectory_has_ended(tmp_path: Path) -> None:
    """Of a flight that is shorter than a line only the pulses within it; longer ones have whole lines as ever."""
    setting = scanner_setting(load_scenario("rq31-600m-even").scan)
    line = 1.0 / setting.lines_per_second
    for duration, count in ((1e-9, 1), (0.3 * line, None), (line, setting.pulses_per_line)):
        path = trajectory(tmp_path, rows_of(np.array([0.0, duration])))
        pulses = Blocks(setting, path, 1).pulse_count(path.strips[0])
        after = shots(setting, 0, pulses + 1).time
        assert after[-2] <= duration < after[-1] + 1e-12
        assert count in (None, pulses)
    path = trajectory(tmp_path, rows_of(np.array([0.0, 2.5 * line])))
    assert Blocks(setting, path, 1).pulse_count(path.strips[0]) == 2 * setting.pulses_per_line


def test_the_blocks_of_a_flight_of_thirty_years_are_counted_and_not_listed(tmp_path: Path) -> None:
    setting = scanner_setting(load_scenario("rq31-600m-even").scan)
    rows = rows_of(np.array([0.0, 1.0]))
    rows[1, 0] = 1e9
    path = trajectory(tmp_path, rows)
    tracemalloc.start()
    blocks = Blocks(setting, path, 1)
    assert blocks.count() > 3e8
    assert [number for _, number in islice(blocks.all(), 3)] == [0, 1, 2]
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()


def test_a_file_comes_back_at_its_rows_and_between_them(tmp_path) -> None:
    rows = rows_of(400_000.0 + np.arange(41) * 0.25)
    path = trajectory(tmp_path, rows)
    (strip,) = path.strips
    assert (strip.index, strip.start_time, strip.duration) == (0, 0.0, 10.0)
    since = rows[:, 0] - rows[0, 0]
    position, rotation = path.pose(strip, since)
    np.testing.assert_allclose(position, rows[:, 1:4] - ORIGIN, atol=1e-6)
    np.testing.assert_allclose(rotation, attitudes(rows).as_matrix(), atol=1e-9)
    between = np.linspace(0.0, 10.0, 777)
    position, rotation = path.pose(strip, between)
    for axis in range(3):
        np.testing.assert_allclose(
            position[:, axis], np.interp(between, since, rows[:, 1 + axis] - ORIGIN[axis]), atol=1e-6
        )
    np.testing.assert_allclose(rotation, Slerp(since, attitudes(rows))(between).as_matrix(), atol=1e-8)


def test_headings_count_clockwise_from_north_and_rolls_to_the_right(tmp_path) -> None:
    rows = rows_of(np.arange(2.0))
    rows[:, 4:] = [[0.0, 0.0, 0.0], [10.0, 5.0, 90.0]]
    _, rotation = trajectory(tmp_path, rows).pose(None, np.array([0.0, 1.0]))
    np.testing.assert_allclose(rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)  # nose north, left west
    np.testing.assert_allclose(rotation[1], rotation_matrix(0.0, np.deg2rad(5.0), np.deg2rad(10.0)), atol=1e-12)
    assert rotation[1, 2, 1] > 0.1  # its left side is up
    assert rotation[1, 2, 0] > 0.05  # its nose is up


def test_map_coordinates_keep_their_precision(tmp_path) -> None:
    rows = rows_of(np.arange(3.0))
    rows[:, 1:4] = np.array(ORIGIN) + [[0.0, 0.0, 0.0], [0.0001, 0.0002, 0.0003], [1.0, 1.0, 1.0]]
    position, _ = trajectory(tmp_path, rows).pose(None, np.array([1.0]))
    np.testing.assert_allclose(position[0], [0.0001, 0.0002, 0.0003], atol=2e-9)
    other = make_platform(kind="trajectory", file=str(tmp_path / "trajectory.csv")).make_path(
        GUIDE, (499_999.0, 0.0, 0.0)
    )
    np.testing.assert_allclose(other.pose(None, np.array([0.0]))[0][0], [1.0, 5_600_000.0, 100.0], atol=1e-6)


def test_the_mounting_and_the_typical_range(tmp_path) -> None:
    rows = rows_of(np.arange(20.0))
    path = trajectory(tmp_path, rows, yaw_deg=90.0)
    rotation = path.pose(path.strips[0], np.zeros(1))[1][0]
    np.testing.assert_allclose(rotation, attitudes(rows).as_matrix()[0] @ rotation_matrix(np.pi / 2), atol=1e-9)
    assert path.typical_range == pytest.approx(60.0, abs=1.0)
    rows[:, 3] = ORIGIN[2]
    assert trajectory(tmp_path, rows).typical_range == 8.0


@pytest.mark.parametrize("separator", [",", ";", "\t", "  "])
def test_columns_may_stand_in_any_order_and_case_beside_others(tmp_path, separator: str) -> None:
    head = separator.join(["Heading", "Z", "X", "quality", "Y", "TIME", "Pitch", "Roll"])
    body = [separator.join(map(str, row)) for row in ((90, 3, 1, "good", 2, 0.5, 5, 4), (91, 3, 1, "", 2, 1.5, 5, 4))]
    if separator == "  ":
        body[1] = body[1].replace("    ", "  none  ")
    text = "\n".join(["# a comment", "", head, body[0], "  # another", "", body[1], ""])
    rows = read_trajectory(write(tmp_path, "\ufeff" + text))
    np.testing.assert_array_equal(rows.time, [0.5, 1.5])
    np.testing.assert_array_equal(rows.position, [[1, 2, 3], [1, 2, 3]])
    np.testing.assert_array_equal([rows.roll[0], rows.pitch[0], rows.heading[1]], [4, 5, 91])
    np.testing.assert_array_equal(rows.lines, [4, 7])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"csv: the file is empty: a header with time, x, y, z, roll, pitch, heading is needed"),
        ("# only a comment\n\n", r"csv: the file is empty"),
        (f"{HEADER}\n", r"csv: at least two rows below the header are needed, the file has 0"),
        (f"{HEADER}\n0,1,2,3,0,0,0\n", r"csv: at least two rows .* has 1"),
        ("0,1,2,3,0,0,0\n1,1,2,3,0,0,0", r"csv:1 is '0, 1, 2.*a header with the columns .* time is missing"),
        ("# c\ntime,x,y,z,roll,pitch\n0,1,2,3,0,0", r"csv:2 is .*heading is missing"),
        (
            "time,x,y,z,roll,pitch,headin\n",
            r"csv:1 is .*heading is missing \(did you mean 'headin'\?\)",
        ),
        ("time,x,x,y,z,roll,pitch,heading\n", r"csv:1 is .*x is there 2 times"),
        (f"{HEADER}\n0,1,2,3,0,0,0\n1,1,2,high,0,0,0", r"csv:3 z is 'high': a finite number is needed"),
        (f"{HEADER}\n0,1,2,3,0,0,0\n\n1,1,nan,3,0,0,0", r"csv:4 y is 'nan': a finite number is needed"),
        (f"{HEADER}\n0,1,2,3,inf,0,0\n1,1,2,3,0,0,0", r"csv:2 roll is 'inf': a finite number"),
        (f"{HEADER}\n0,1,2,3,,0,0\n1,1,2,3,0,0,0", r"csv:2 roll is '': a finite number"),
        (f"{HEADER}\n0,1,2,3,0,0\n1,1,2,3,0,0,0", r"csv:2 is .*at least 7 columns are needed, this line has 6"),
        (f"{HEADER}\n0,1,2,3,0,90.5,0\n1,1,2,3,0,0,0", r"csv:2 pitch is 90\.5: from -90 to 90 deg"),
        (f"{HEADER}\n1,1,2,3,0,0,0\n1,1,2,3,0,0,0", r"csv:3 time is 1\.0: times must increase: more than 1\.0 s"),
        (f"{HEADER}\n0,1,2,3,0,0,0\n2,1,2,3,0,0,0\n1,1,2,3,0,0,0", r"csv:4 time is 1\.0: .* more than 2\.0 s"),
        (f"{HEADER}\n0,1,2,3,0,0,0\n1,1,2,3,0,0,160", r"csv:3 heading is 160\.0: the platform turns by 160 degrees"),
    ],
)
def test_what_is_wrong_is_named_by_file_line_column_and_value(tmp_path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as info:
        make_platform(kind="trajectory", file=write(tmp_path, text)).make_path(GUIDE)
    assert "\n" not in str(info.value)


def test_a_missing_file_and_no_file_and_no_text(tmp_path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.csv: a trajectory file is needed here"):
        make_platform(kind="trajectory", file=str(tmp_path / "none.csv")).make_path(GUIDE)
    with pytest.raises(MissingFileError):
        read_trajectory(tmp_path)
    with pytest.raises(InputError, match=r"scan\.platform\.file: a trajectory needs a CSV file"):
        make_platform(kind="trajectory").make_path(GUIDE)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x9f")
    with pytest.raises(InputError, match="this is no text"):
        read_trajectory(tmp_path / "binary.csv")


@pytest.mark.parametrize("kind", ["even", "gaps", "jitter", "two rows"])
def test_poses_may_be_interpolated_between_knots(tmp_path, kind: str) -> None:
    rng = np.random.default_rng(5)
    time = np.arange(400) * 0.01
    if kind == "gaps":
        time = np.delete(time, [5, 6, 7, 200])
    elif kind == "jitter":
        time = np.cumsum(rng.uniform(0.004, 0.016, 400))
    elif kind == "two rows":
        time = np.array([0.0, 7.3])
    rows = rows_of(time)
    rows[:, 1:4] += rng.normal(0.0, 0.002, (len(rows), 3)) if len(rows) > 2 else 0.0
    path = trajectory(tmp_path, rows)
    assert knot_error(path) < KNOT_ERROR
    if kind in ("even", "gaps"):
        steps = 0.01 / path.knot_spacing
        assert steps == pytest.approx(round(steps), abs=1e-6)
        assert path.knot_spacing > 1e-3
    assert path.pose(path.strips[0], np.array([path.strips[0].duration + 0.1]))[0].shape == (1, 3)


@given(st.lists(st.floats(-np.pi, np.pi), min_size=3, max_size=3), st.lists(st.floats(-7, 7), min_size=3, max_size=3))
@settings(max_examples=80, deadline=None)
def test_quaternions_are_the_rotations(first: list[float], second: list[float]) -> None:
    a, b = (rotation_matrix(*(np.array([angle]) for angle in angles)) for angles in (first, second))
    qa, qb = quaternions(a), quaternions(b)
    np.testing.assert_allclose(quaternion_matrices(qa), a, atol=1e-12)
    np.testing.assert_allclose(quaternion_matrices(qb), b, atol=1e-12)
    ends = Rotation.from_matrix(np.concatenate([a, b]))
    if (ends[0].inv() * ends[1]).magnitude() > 3.1:
        return  # either way round is as short
    for share in (0.0, 0.3, 1.0):
        found = quaternion_matrices(slerp(qa, qb, np.array([share])))[0]
        np.testing.assert_allclose(found, Slerp([0.0, 1.0], ends)(share).as_matrix(), atol=1e-7)


def test_the_columns_are_those_documented() -> None:
    text = (Path(__file__).parents[3] / "docs" / "platforms.md").read_text(encoding="utf-8")
    assert ", ".join(f"`{name}`" for name in COLUMNS) in text
