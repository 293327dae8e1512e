"""Images of a job in their order: what each is called, when it was taken, and from where."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...base.arrays import Float
from ...base.rotations import quaternions
from ...scanning.cameras.rig import MountedCamera

GRAPHICS_AXES = np.diag([1.0, -1.0, -1.0])
"""Rotation between a camera's axes (x right, y down, z forward) and those of computer graphics (y up, z back)."""


@dataclass(frozen=True)
class Shot:
    """One image of the album.

    Attributes:
        camera: that took it.
        number: of the exposure, the same for all cameras of the rig.
        strip: index of the path's strip.
        time: of the middle of the exposure, as points have it, s.
        position: (3,) measured place of the optical centre, map, m.
        rotation: (3, 3) measured, from the camera's frame to the map's axes.
        true_position: (3,) the same without errors.
        true_rotation: (3, 3) the same without errors.
        stops: by how many it is exposed brighter than the scene's usual light asks for.
    """

    camera: MountedCamera
    number: int
    strip: int
    time: float
    position: Float
    rotation: Float
    true_position: Float
    true_rotation: Float
    stops: float = 0.0

    @property
    def stem(self) -> str:
        """Return the image's name without an ending: the camera's folder and the number of the exposure."""
        return f"{self.camera.camera.name}/{self.number:06d}"

    @property
    def quaternion(self) -> Float:
        """Return the measured rotation (4,), scalar first, from the camera's frame to the map's axes."""
        return np.asarray(quaternions(self.rotation[None])[0])


@dataclass
class Album:
    """All images of a job.

    Attributes:
        cameras: of the rig.
        origin: (3,) map coordinates of the local origin that files of poses count from, m.
        picture: ending of the pictures' files.
        mounts: place (3,) and rotation (3, 3) of each camera in the scanner's frame, as they are believed to be.
        shots: the images, in the order in which they were taken.
    """

    cameras: list[MountedCamera]
    origin: Float
    picture: str
    mounts: list[tuple[Float, Float]] = field(default_factory=list)
    shots: list[Shot] = field(default_factory=list)

    def of_model(self, model: str) -> list[Shot]:
        """Return the images of cameras with lenses of a model."""
        return [shot for shot in self.shots if shot.camera.lens.model == model]

    @property
    def models(self) -> list[str]:
        """Return the models of the rig's lenses, each once."""
        return list(dict.fromkeys(camera.lens.model for camera in self.cameras))
