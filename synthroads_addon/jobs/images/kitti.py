"""KITTI's calibration and poses: Geiger et al. 2013, Vision meets Robotics, and the development kits of raw data and
odometry. Only pinhole cameras have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...base.arrays import Float
from .album import Album, Shot

_HALF_PIXEL = 0.5
"""In KITTI, as in OpenCV, the middle of the first pixel is 0."""


def write_kitti(folder: Path, album: Album) -> bool:
    """Write calibration, times and poses of an album's pinhole cameras into a folder; return whether it has any.

    ``calib_cam_to_cam.txt`` has of each camera S (size), K, D (k1, k2, p1, p2, k3), R and T from the first one;
    ``calib_velo_to_cam.txt`` R and T from the scanner to it; ``poses.txt`` one matrix (3, 4) for each exposure, row by
    row, from the first camera to local metres; ``times.txt`` its time, s.
    """
    cameras = [camera for camera in album.cameras if camera.lens.model == "pinhole"]
    if not cameras:
        return False
    folder.mkdir(parents=True, exist_ok=True)
    first = cameras[0].index
    lines = ["corner_dist: 0.0"]
    for number, camera in enumerate(cameras):
        lens, (rotation, translation) = camera.lens, _from_camera(album, first, camera.index)
        (fx, fy), (cx, cy) = lens.focal, lens.centre
        matrix = np.array([[fx, 0.0, cx - _HALF_PIXEL], [0.0, fy, cy - _HALF_PIXEL], [0.0, 0.0, 1.0]])
        k1, k2, k3 = (*lens.radial, 0.0, 0.0, 0.0)[:3]
        projection = matrix @ np.column_stack([rotation, translation])
        size = np.array([lens.width, lens.height], dtype=np.float64)
        rows = {"S": size, "K": matrix, "D": np.array([k1, k2, *lens.tangential, k3]), "R": rotation, "T": translation}
        rows |= {"S_rect": size, "R_rect": np.eye(3), "P_rect": projection}
        lines += [f"{name}_{number:02d}: {_numbers(values)}" for name, values in rows.items()]
    _write(folder / "calib_cam_to_cam.txt", lines)
    place, turn = album.mounts[first]
    _write(folder / "calib_velo_to_cam.txt", [f"R: {_numbers(turn.T)}", f"T: {_numbers(-turn.T @ place)}"])
    shots = [shot for shot in album.shots if shot.camera.index == first]
    _write(folder / "poses.txt", [_numbers(_matrix(shot, album.origin)) for shot in shots])
    _write(folder / "times.txt", [repr(shot.time) for shot in shots])
    return True


def _from_camera(album: Album, first: int, second: int) -> tuple[Float, Float]:
    """Return rotation (3, 3) and translation (3,), m, from the frame of one camera to that of another."""
    (first_place, first_turn), (place, turn) = album.mounts[first], album.mounts[second]
    return turn.T @ first_turn, turn.T @ (first_place - place)


def _matrix(shot: Shot, origin: Float) -> Float:
    """Return the matrix (3, 4) from an image's camera to local metres."""
    return np.column_stack([shot.rotation, shot.position - origin])


def _numbers(values: Float) -> str:
    """Return numbers, row by row, as KITTI writes them."""
    return " ".join(f"{value:.12e}" for value in np.ravel(values))


def _write(path: Path, lines: list[str]) -> None:
    """Write lines of text."""
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
