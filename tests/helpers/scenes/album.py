"""Images of a rig with lenses of three models beside a scanner, as files of poses take them, made without a scene."""

from __future__ import annotations

import numpy as np

from synthroads_addon.base.rotations import rotation_matrix
from synthroads_addon.jobs.images.album import Album, Shot
from synthroads_addon.scanning.cameras.choice import CameraChoice
from synthroads_addon.scanning.cameras.rig import CameraRig

PINHOLE = {"name": "left", "width": 320, "height": 200, "pixel_size_um": 10.0, "focal_length_mm": 2.0}
PINHOLE |= {"radial": [-0.2, 0.05, -0.004], "tangential": [0.001, -0.002], "position": [0.3, 0.25, -0.1]}
RIG = {
    "title": "t",
    "source": "s",
    "cameras": [
        PINHOLE,
        PINHOLE | {"name": "right", "position": [0.3, -0.25, -0.1], "yaw_deg": -3.0},
        {"name": "fish", "model": "fisheye", "width": 300, "height": 300, "pixel_size_um": 10.0}
        | {"focal_length_mm": 1.1, "radial": [0.02, -0.003], "field_of_view_deg": 170.0},
        {"name": "sphere", "model": "equirectangular", "width": 400, "height": 200},
    ],
}
ORIGIN = np.array([500_000.0, 5_000_000.0, 100.0])
SCANNER = rotation_matrix(0.4, 0.05, -0.03)
PLACE = ORIGIN + [12.0, -3.0, 2.0]


def album() -> Album:
    """Return an album of one exposure of four cameras beside a scanner."""
    cameras = CameraChoice().mounted(CameraRig.from_dict(RIG))
    result = Album(cameras, ORIGIN, "png")
    result.mounts = [(np.array(one.camera.position), one.camera.mounting()) for one in cameras]
    for camera, (place, turn) in zip(cameras, result.mounts, strict=True):
        position, rotation = PLACE + SCANNER @ place, SCANNER @ turn
        result.shots.append(Shot(camera, 0, 0, 1.5, position, rotation, position, rotation))
    return result
