"""The camera of KITTI's files: where it stands beside the scanner, and what of a box it shows.

KITTI's labels are by an image. Where a scan has no camera, the files state one with the numbers of KITTI's own left
colour camera at the scanner's place, so that readers of these files have what they need.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.arrays import Float

IMAGE_SIZE = (1242, 375)
"""Width and height of the image, pixels. Source: Geiger et al., "Vision meets Robotics: The KITTI Dataset" (2013)."""
PROJECTION = np.array([[721.5377, 0.0, 609.5593, 0.0], [0.0, 721.5377, 172.854, 0.0], [0.0, 0.0, 1.0, 0.0]])
"""Projection of the left colour camera, rectified; its 4th column is 0, as it is the only one. Source: file
``calib/000000.txt`` of KITTI's object detection benchmark, P2."""
TO_CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation from the frame of a sweep (x forward, y left, z up) to the camera's (x right, y down, z forward)."""
_NEAR = 0.1
"""Least depth of what an image shows, m. Chosen."""
_EDGES = tuple((i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit)
"""Pairs of a box's corners that its edges join, as `Box.corners` orders them."""


class ImageBox(NamedTuple):
    """Box of a thing in the image.

    Attributes:
        left, top, right, bottom: pixels, within the image.
        truncated: share of its area that lies outside of the image, 0 to 1.
    """

    left: float
    top: float
    right: float
    bottom: float
    truncated: float


def image_box(corners: Float) -> ImageBox | None:
    """Return the box in the image around a box of corners (8, 3) in the frame of a sweep; None if it isn't in sight."""
    camera = corners @ TO_CAMERA.T
    visible = [point for point in camera if point[2] > _NEAR]
    for i, j in _EDGES:  # what lies behind the camera is cut off
        near, far = camera[i], camera[j]
        if (near[2] - _NEAR) * (far[2] - _NEAR) < 0.0:
            visible.append(near + (far - near) * (_NEAR - near[2]) / (far[2] - near[2]))
    if not visible:
        return None
    projected = np.array(visible) @ PROJECTION[:, :3].T
    pixels = projected[:, :2] / projected[:, 2:]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    size = np.array(IMAGE_SIZE, dtype=np.float64) - 1.0
    inside_low, inside_high = np.clip(low, 0.0, size), np.clip(high, 0.0, size)
    area, inside = float(np.prod(high - low)), float(np.prod(np.maximum(inside_high - inside_low, 0.0)))
    if area <= 0.0 or inside <= 0.0:
        return None
    (left, top), (right, bottom) = ((float(x), float(y)) for x, y in (inside_low, inside_high))
    return ImageBox(left, top, right, bottom, 1.0 - inside / area)
