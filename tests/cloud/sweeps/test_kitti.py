"""KITTI's labels, read as KITTI's readers read them: boxes in the camera's frame, and their rectangles in the image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from synthroads_addon.base.classes import class_id, class_scheme
from synthroads_addon.cloud.sweeps.kitti import KittiWriter
from synthroads_addon.cloud.sweeps.pinhole import image_box
from synthroads_addon.cloud.sweeps.sweep import Box, Sweep, SweepPlace, quaternion, upright
from tests.helpers.clouds.random_points import make_points

SIZE = np.array([4.3, 1.8, 1.5])


def sweep(boxes: tuple[Box, ...], yaw: float = 0.7) -> Sweep:
    """Return a sweep with some points, seen from (10, 20, 2) towards a yaw."""
    points = make_points(50)
    rotation = Rotation.from_euler("z", yaw).as_matrix()
    xyz = ((points.xyz - 200.0) @ rotation).astype(np.float32)
    remission = np.linspace(0.0, 1.0, 50, dtype=np.float32)
    position = np.array([10.0, 20.0, 2.0])
    return Sweep(0, 0, 0, 0.0, 0.1, position, rotation, points, xyz, remission, points.class_id, boxes)


def box(place, yaw: float, frame: Sweep, pitch: float = 0.0, **more) -> Box:
    """Return a car at a place in the frame of a sweep, turned by a yaw in it."""
    rotation = frame.rotation @ Rotation.from_euler("zy", [yaw, pitch]).as_matrix()
    values = {"seen": 0.9, "kind": "car", "points": 3} | more
    centre = frame.position + frame.rotation @ np.array(place)
    return Box(
        5, class_id("vehicle"), "car-1", centre=centre, size=SIZE, rotation=rotation, velocity=np.zeros(3), **values
    )


def written(folder: Path, boxes) -> list[list[str]]:
    """Return the words of the labels' lines."""
    writer = KittiWriter(folder / "kitti", SweepPlace(class_scheme("17"), np.zeros(3)))
    frame = sweep(())
    writer.write(sweep(tuple(boxes(frame))))
    writer.close()
    text = (folder / "kitti" / "training" / "label_2" / "000000.txt").read_text()
    return [line.split() for line in text.splitlines()]


def calibration(folder: Path) -> dict[str, np.ndarray]:
    text = (folder / "kitti" / "training" / "calib" / "000000.txt").read_text()
    return {key: np.array(values.split(), float) for key, values in (line.split(":") for line in text.splitlines())}


@pytest.mark.parametrize(
    ("place", "yaw"), [((20.0, 3.0, -1.0), 0.4), ((12.0, -2.0, -1.2), 2.9), ((40.0, 9.0, 0.0), -1.6)]
)
def test_a_label_is_the_box(tmp_path: Path, place, yaw) -> None:
    (line,) = written(tmp_path, lambda frame: [box(place, yaw, frame)])
    kind, numbers = line[0], list(map(float, line[1:]))
    truncated, occluded, alpha, left, top, right, bottom, height, width, length, x, y, z, turn = numbers
    assert (kind, truncated, occluded) == ("Car", 0.0, 0.0)
    assert np.allclose([length, width, height], SIZE, atol=1e-4)
    # As OpenPCDet takes a label to the scanner's frame: by R0_rect and Tr_velo_to_cam; heading = -(ry + pi / 2).
    entries = calibration(tmp_path)
    matrix = np.vstack([entries["Tr_velo_to_cam"].reshape(3, 4), [0, 0, 0, 1]])
    matrix = np.vstack([np.column_stack([entries["R0_rect"].reshape(3, 3), np.zeros(3)]), [0, 0, 0, 1]]) @ matrix
    bottom_centre = np.linalg.inv(matrix) @ [x, y, z, 1.0]
    assert np.allclose(bottom_centre[:3] + [0, 0, height / 2.0], place, atol=1e-3)
    assert np.mod(-(turn + np.pi / 2.0) - yaw + 1e-4, 2 * np.pi) < 2e-4
    assert np.mod(alpha - (turn - np.arctan2(x, z)) + 1e-3, 2 * np.pi) < 2e-3
    # The rectangle: corners of the box through P2.
    cos, sin = np.cos(turn), np.sin(turn)
    signs = np.array([(sx, sy, sz) for sx in (-0.5, 0.5) for sy in (-1.0, 0.0) for sz in (-0.5, 0.5)])
    corners = signs * [length, height, width] @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).T + [x, y, z]
    pixels = corners @ entries["P2"].reshape(3, 4)[:, :3].T
    pixels = pixels[:, :2] / pixels[:, 2:]
    assert np.allclose([left, top, right, bottom], [*pixels.min(axis=0), *pixels.max(axis=0)], atol=0.1)


def test_points_are_as_they_are_seen_from_the_scanner(tmp_path: Path) -> None:
    written(tmp_path, lambda frame: [])
    data = np.fromfile(tmp_path / "kitti" / "training" / "velodyne" / "000000.bin", "<f4").reshape(-1, 4)
    assert np.array_equal(data[:, :3], sweep(()).xyz)
    assert np.array_equal(data[:, 3], sweep(()).remission)
    assert (tmp_path / "kitti" / "ImageSets" / "train.txt").read_text() == "000000\n"


def test_what_is_behind_or_aside_has_no_label_and_what_is_cut_off_says_so(tmp_path: Path) -> None:
    lines = written(tmp_path, lambda frame: [
        box((-20.0, 0.0, -1.0), 0.0, frame),
        box((5.0, 40.0, -1.0), 0.0, frame),
        box((10.0, 8.5, -1.0), 0.0, frame, seen=0.3),
        box((10.0, 0.0, -1.0), 0.0, frame, seen=0.6, kind="", points=0),
        box((30.0, 0.0, -1.0), 0.0, frame, seen=None, kind="motorcycle"),
    ])  # fmt: skip
    assert [line[0] for line in lines] == ["Car", "vehicle", "vehicle"]
    assert 0.05 < float(lines[0][1]) < 0.95
    assert float(lines[0][4]) == 0.0
    assert [line[2] for line in lines] == ["2", "1", "3"]


def test_a_tilted_thing_has_an_upright_box_around_it() -> None:
    rotation = Rotation.from_euler("ZYX", [0.8, 0.1, -0.05]).as_matrix()
    centre, size, yaw = upright(np.array([1.0, 2.0, 3.0]), rotation, SIZE)
    signs = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    corners = (signs * SIZE) @ rotation.T @ Rotation.from_euler("z", yaw).as_matrix()
    assert np.allclose(np.abs(corners).max(axis=0), size / 2.0)
    assert yaw == pytest.approx(0.8)
    assert np.array_equal(centre, [1.0, 2.0, 3.0])


def test_the_image_of_a_box_around_the_camera_is_the_whole_image() -> None:
    corners = np.array([(x, y, z) for x in (-5, 5) for y in (-5, 5) for z in (-5, 5)], float)
    shown = image_box(corners)
    assert shown is not None
    assert tuple(shown[:4]) == (0.0, 0.0, 1241.0, 374.0)
    assert shown.truncated > 0.9


@pytest.mark.parametrize("seed", range(20))
def test_quaternions(seed: int) -> None:
    rotation = Rotation.random(rng=seed) if seed else Rotation.from_euler("x", np.pi)
    w, x, y, z = quaternion(rotation.as_matrix())
    assert w >= 0.0
    assert np.allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), rotation.as_matrix(), atol=1e-12)
