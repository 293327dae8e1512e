"""nerfstudio's and KITTI's files, read by the conventions of those programs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.jobs.images.album import Album
from synthroads_addon.jobs.images.kitti import write_kitti
from synthroads_addon.jobs.images.nerfstudio import write_nerfstudio
from tests.helpers.scenes.album import ORIGIN, PLACE, SCANNER
from tests.helpers.scenes.album import album as four_images


@pytest.fixture
def album() -> Album:
    """Return an album of one exposure of four cameras beside a scanner."""
    return four_images()


def nerfstudio_place(model: str, frame: dict, point: np.ndarray) -> np.ndarray:
    """Return where nerfstudio's rays (1.1.5, ``cameras.py``) pass a point (3,) of the world: the inverse of its way."""
    matrix = np.array(frame["transform_matrix"])
    x, y, z = matrix[:3, :3].T @ (point - matrix[:3, 3])  # x right, y up, z back
    if model == "EQUIRECTANGULAR":
        length = np.sqrt(x * x + y * y + z * z)
        flat = np.array([np.arctan2(x, -z) / np.pi, -(0.5 - np.arccos(y / length) / np.pi)])
    else:
        flat = np.array([x / -z, -y / -z])
        if model == "OPENCV_FISHEYE":
            aside = np.hypot(x, y)
            flat = np.arctan2(aside, -z) * np.array([x, -y]) / aside
        k1, k2, k3, k4, p1, p2 = (frame.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "p1", "p2"))
        u, v = flat
        r = u * u + v * v
        d = 1.0 + r * (k1 + r * (k2 + r * (k3 + r * k4)))
        flat = np.array([d * u + 2 * p1 * u * v + p2 * (r + 2 * u * u), d * v + 2 * p2 * u * v + p1 * (r + 2 * v * v)])
    return flat * [frame["fl_x"], frame["fl_y"]] + [frame["cx"], frame["cy"]]


def test_nerfstudio_sees_points_where_the_images_show_them(album: Album, tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, album)
    names = {"OPENCV": "transforms.json", "OPENCV_FISHEYE": "transforms_fisheye.json"}
    names["EQUIRECTANGULAR"] = "transforms_equirectangular.json"
    assert {path.name for path in tmp_path.iterdir()} == set(names.values())
    random, compared = np.random.default_rng(1), 0
    frames = {}
    for model, name in names.items():
        content = json.loads((tmp_path / name).read_text())
        assert content["camera_model"] == model
        frames |= {frame["file_path"]: (model, frame) for frame in content["frames"]}
    for shot in album.shots:
        model, frame = frames[f"rgb/{shot.stem}.png"]
        for point in shot.position + (shot.rotation @ random.normal(0, 1, (3, 200))).T * 20.0:
            place = shot.camera.lens.project((shot.rotation.T @ (point - shot.position))[:, None])[:, 0]
            if np.isfinite(place).all():
                compared += 1
                assert nerfstudio_place(model, frame, point - ORIGIN) == pytest.approx(place, abs=1e-6)
    assert compared > 200


def test_kitti_projects_the_scanners_points_into_both_cameras(album: Album, tmp_path: Path) -> None:
    assert write_kitti(tmp_path, album)
    files = {path.name: path.read_text() for path in tmp_path.iterdir()}
    camera = {
        line.split(": ")[0]: np.array(line.split(": ")[1].split(), float)
        for line in files["calib_cam_to_cam.txt"].splitlines()
    }
    scanner = {line[0]: np.array(line[3:].split(), float) for line in files["calib_velo_to_cam.txt"].splitlines()}
    points = np.random.default_rng(2).uniform([6, -4, -3], [30, 4, 3], (300, 3))  # x forward, y left, z up
    compared = 0
    for number, shot in enumerate(album.shots[:2]):
        name = f"{number:02d}"
        first = points @ scanner["R"].reshape(3, 3).T + scanner["T"]
        mine = first @ camera[f"R_{name}"].reshape(3, 3).T + camera[f"T_{name}"]
        u, v = mine[:, 0] / mine[:, 2], mine[:, 1] / mine[:, 2]
        k1, k2, p1, p2, k3 = camera[f"D_{name}"]
        r = u * u + v * v
        radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
        bent = np.stack(
            [u * radial + 2 * p1 * u * v + p2 * (r + 2 * u * u), v * radial + p1 * (r + 2 * v * v) + 2 * p2 * u * v]
        )
        place = (camera[f"K_{name}"].reshape(3, 3) @ np.vstack([bent, np.ones(len(u))]))[:2]
        world = PLACE + points @ SCANNER.T
        wanted = shot.camera.lens.project(shot.rotation.T @ (world - shot.position).T)
        inside = np.isfinite(wanted[0])
        compared += int(inside.sum())
        assert np.abs(place[:, inside] + 0.5 - wanted[:, inside]).max() < 1e-6
    assert compared > 200
    pose = np.array(files["poses.txt"].split(), float).reshape(3, 4)
    assert np.abs(pose[:, 3] - (album.shots[0].position - ORIGIN)).max() < 1e-9
    assert files["times.txt"].split() == ["1.5"]
