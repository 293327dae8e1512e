"""When cameras are triggered along a path, and where they are then, in truth and by their navigation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.random_streams import stream
from ...base.rotations import rotation_matrix
from ..blocks import Blocks
from ..noise import Noise, measured_pose, trajectory_errors
from ..platforms.path import Path, Strip
from ..strip_errors import StripErrors, drift
from .choice import CameraChoice
from .rig import MountedCamera

_STEP = 0.05
"""Time between two places of a path by which its length is measured, s. Chosen: chords of a metre in curves."""
_LAST = 1e-6
"""Share of a spacing by which the last exposure may lie beyond a strip's end."""


@dataclass(frozen=True)
class Exposure:
    """One moment at which all cameras of a rig are triggered.

    Attributes:
        number: of the exposure among all of the scan, from 0.
        strip: in which it lies.
        time: middle of the exposure (of the middle row of a rolling shutter), s since the first strip's start.
    """

    number: int
    strip: Strip
    time: float


def exposures_along(path: Path, choice: CameraChoice) -> list[Exposure]:
    """Return the exposures along all strips of a path, the first at each strip's start, in the order of time.

    Where the path stands still, as on a tripod, a trigger by distance gives one exposure for each strip.
    """
    result: list[Exposure] = []
    for strip in path.strips:
        if choice.trigger == "time":
            times = strip.start_time + np.arange(int(strip.duration / choice.interval + _LAST) + 1) * choice.interval
        else:
            times = _times_by_distance(path, strip, choice.spacing)
        result += [Exposure(len(result) + number, strip, float(time)) for number, time in enumerate(times)]
    return result


def _times_by_distance(path: Path, strip: Strip, spacing: float) -> Float:
    """Return the times (K,), s, at which a strip's path has run whole multiples of a spacing, m."""
    time = strip.start_time + np.linspace(0.0, strip.duration, max(2, int(strip.duration / _STEP) + 2))
    place = path.pose(strip, time)[0]
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))))
    ways = np.arange(int(way[-1] / spacing + _LAST) + 1) * spacing
    # The path's length must grow for it to be inverted: where it stands still, the first time counts.
    grows = np.concatenate(([True], np.diff(way) > 0.0))
    return np.interp(ways, way[grows], time[grows])


def exposures_in_blocks(
    exposures: list[Exposure], cut: Blocks, chosen: tuple[tuple[Strip, int], ...]
) -> list[Exposure]:
    """Return those exposures that lie within some blocks of pulses: each lies in one block of its strip.

    Args:
        exposures: of the whole path.
        cut: the scan's blocks.
        chosen: some of these blocks.
    """
    numbers: dict[int, set[int]] = {}
    for strip, number in chosen:
        numbers.setdefault(strip.index, set()).add(number)
    starts: dict[int, Float] = {}
    result = []
    for exposure in exposures:
        index = exposure.strip.index
        if index not in numbers:
            continue
        if index not in starts:
            first_pulses = [cut.pulse_span(exposure.strip, block)[0] for block in cut.block_numbers(exposure.strip)]
            starts[index] = np.array([cut.time(exposure.strip, pulse) for pulse in first_pulses])
        block = max(0, int(np.searchsorted(starts[index], exposure.time, side="right")) - 1)
        if block in numbers[index]:
            result.append(exposure)
    return result


@dataclass(frozen=True)
class CameraPose:
    """Where a camera is and how it is turned.

    Attributes:
        position: (3,) of its optical centre, local, m.
        rotation: (3, 3) from its frame (x right, y down, z along the axis) to the local one.
    """

    position: Float
    rotation: Float


@dataclass(frozen=True)
class RigPoses:
    """Poses of a rig's cameras along a path.

    Attributes:
        path: the scanner's.
        mounting: (3, 3) rotation from the scanner's frame to the platform's, on which the cameras are.
        noise: errors of the navigation, which are the scanner's as well.
        strip_errors: of the scanner; of these the drift of the strips is the cameras' too.
        choice: errors of the cameras' own mounting.
        seed: of the scan.
    """

    path: Path
    mounting: Float
    noise: Noise
    strip_errors: StripErrors
    choice: CameraChoice
    seed: int

    def camera_from_scanner(self, camera: MountedCamera) -> tuple[Float, Float]:
        """Return a camera's place (3,), m, and rotation (3, 3) from its frame, both in the scanner's frame."""
        return self.mounting.T @ np.array(camera.camera.position), self.mounting.T @ camera.camera.mounting()

    def true_pose(self, camera: MountedCamera, exposure: Exposure) -> CameraPose:
        """Return where a camera is in the middle of an exposure."""
        return self._on(camera, *self.path.pose(exposure.strip, np.array([exposure.time])))

    def measured_pose(self, camera: MountedCamera, exposure: Exposure) -> CameraPose:
        """Return where a camera believes to be in the middle of an exposure: with errors of navigation and mounting."""
        strip, time = exposure.strip, np.array([exposure.time])
        position, rotation = self.path.pose(strip, time)
        if self.noise.position_sigma or self.noise.attitude_sigma_deg or self.noise.heading_sigma_deg:
            position, rotation = measured_pose(
                position, rotation, trajectory_errors(self.noise, self.seed, strip, time)
            )
        if self.strip_errors.drift_sigma:
            begin, end = drift(self.strip_errors, self.seed, strip.index)
            share = float(np.clip((exposure.time - strip.start_time) / max(strip.duration, 1e-9), 0.0, 1.0))
            position = position + begin + share * (end - begin)
        pose = self._on(camera, position, rotation)
        shift, (x, y, z) = self.mounting_error(camera)
        return CameraPose(pose.position + pose.rotation @ shift, pose.rotation @ rotation_matrix(z, -y, x))

    def mounting_error(self, camera: MountedCamera) -> tuple[Float, Float]:
        """Return the errors of a camera's place (3,), m, and direction (3,), rad, in its own frame.

        The three angles are about its x, y and z axes: right, down, and along its axis.
        """
        normal = stream(self.seed, "camera mounting", camera.index).standard_normal(6)
        return self.choice.lever_arm_sigma * normal[:3], np.deg2rad(self.choice.boresight_sigma_deg) * normal[3:]

    def error_report(self, cameras: list[MountedCamera]) -> list[dict[str, Any]]:
        """Return the errors of the cameras' mounting as JSON data: the truth that a calibration has to find."""
        rows = []
        for camera in cameras:
            shift, angles = self.mounting_error(camera)
            rows.append(
                {
                    "camera": camera.camera.name,
                    "lever_arm": [round(float(value), 7) for value in shift],
                    "boresight_deg": [round(float(value), 7) for value in np.rad2deg(angles)],
                }
            )
        return rows

    def _on(self, camera: MountedCamera, position: Float, rotation: Float) -> CameraPose:
        """Return the pose of a camera beside a scanner at a position (1, 3), m, with a rotation (1, 3, 3)."""
        place, turn = self.camera_from_scanner(camera)
        return CameraPose(position[0] + rotation[0] @ place, rotation[0] @ turn)
