"""COLMAP's text model: cameras, images with their poses, rigs and frames; https://colmap.github.io/format.html."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Float
from ...base.rotations import quaternions
from ...scanning.cameras.lens import Lens
from .album import Album

_HEADER = "# {title}, written by SynthRoads. Local metres: map coordinates less {origin}.\n# {columns}\n"
_MODELS = {
    "cameras.txt": "CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
    "images.txt": "IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then a line of POINTS2D[], empty here",
    "points3D.txt": "POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]",
    "rigs.txt": "RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[]",
    "frames.txt": "FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, DATA_IDS[]",
}


def write_colmap(folder: Path, album: Album) -> None:
    """Write the text model of an album into a folder: COLMAP's images are those in the folder ``rgb``.

    The poses are those that the cameras measured, in local metres. An exposure of all cameras is a frame of a rig.
    """
    folder.mkdir(parents=True, exist_ok=True)
    columns = [_camera_line(number, camera.lens) for number, camera in enumerate(album.cameras, 1)]
    lines: dict[str, list[str]] = {"cameras.txt": columns, "points3D.txt": [], "images.txt": []}
    frames: dict[int, list[tuple[int, int]]] = {}
    poses: dict[int, str] = {}
    for number, shot in enumerate(album.shots, 1):
        camera = shot.camera.index + 1
        pose = _world_to_camera(shot.rotation, shot.position - album.origin)
        lines["images.txt"] += [f"{number} {pose} {camera} {shot.stem}.{album.picture}", ""]
        frames.setdefault(shot.number, []).append((camera, number))
        if shot.camera.index == 0:
            poses[shot.number] = pose
    lines["rigs.txt"] = [_rig_line(album)]
    lines["frames.txt"] = [
        f"{frame + 1} 1 {poses[frame]} {len(data)} " + " ".join(f"CAMERA {camera} {number}" for camera, number in data)
        for frame, data in sorted(frames.items())
    ]
    origin = " ".join(f"{value:.3f}" for value in album.origin)
    for name, rows in lines.items():
        header = _HEADER.format(title=name, origin=origin, columns=_MODELS[name])
        (folder / name).write_text(header + "".join(f"{row}\n" for row in rows), encoding="utf-8")


def _numbers(values: ArrayLike) -> str:
    """Return numbers as text, without loss, between spaces."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _world_to_camera(rotation: Float, position: Float) -> str:
    """Return the quaternion and translation, as text, from the world to a camera at a position with a rotation."""
    inverse = rotation.T
    return f"{_numbers(quaternions(inverse[None])[0])} {_numbers(-inverse @ position)}"


def _camera_line(number: int, lens: Lens) -> str:
    """Return the line of a camera: COLMAP's model of the lens with all of its parameters."""
    intrinsics, values = (*lens.focal, *lens.centre), tuple[float, ...]()
    if lens.model == "equirectangular":
        model, values = "EQUIRECTANGULAR", (float(lens.width), float(lens.height))
    elif lens.model == "fisheye":
        model, values = "OPENCV_FISHEYE", (*intrinsics, *(*lens.radial, 0.0, 0.0, 0.0, 0.0)[:4])
    else:
        k1, k2, k3 = (*lens.radial, 0.0, 0.0, 0.0)[:3]
        model, values = "FULL_OPENCV", (*intrinsics, k1, k2, *lens.tangential, k3, 0.0, 0.0, 0.0)
    return f"{number} {model} {lens.width} {lens.height} {_numbers(values)}"


def _rig_line(album: Album) -> str:
    """Return the line of the rig: the first camera is its reference, the others have their poses from it."""
    sensors = [f"1 {len(album.cameras)} CAMERA 1"]
    first = next((shot for shot in album.shots if shot.camera.index == 0), None)
    for camera in album.cameras[1:]:
        shot = next(
            (s for s in album.shots if s.camera.index == camera.index and first and s.number == first.number), None
        )
        if shot is None or first is None:
            continue
        # From the reference camera to this one: x = R_this^T (R_first y + C_first - C_this).
        rotation = first.rotation.T @ shot.rotation
        position = first.rotation.T @ (shot.position - first.position)
        sensors.append(f"CAMERA {camera.index + 1} 1 {_world_to_camera(rotation, position)}")
    return " ".join(sensors)
