"""Pulses as they leave the scanner, and the errors that its navigation and its mirror make."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.random_streams import stream
from .devices.device import ScannerSetting
from .devices.shots import shots
from .knots import Track
from .noise import Noise, TrajectoryNoise, measured_pose
from .platforms.path import Path, Strip
from .scene.target import Target

Float = NDArray[np.float64]
Index = NDArray[np.intp]

_MOTION_KNOTS = 0.01
"""Seconds between two poses of a moving vehicle: it turns by less than a milliradian meanwhile."""


@dataclass(frozen=True)
class Errors:
    """Random errors of a block's pulses; they don't depend on what else is met, so that one more return leaves the
    others' errors alone.

    Attributes:
        range: (2, P) float32 of the block, or as many as a pulse can have returns if these are more, in units of one
            sigma; None without. See `range_errors`.
        angle: (2, P) rad; None without.
        lost: (P, returns) bool; None without.
    """

    range: NDArray[np.float32] | None
    angle: Float | None
    lost: NDArray[np.bool_] | None

    def range_errors(self, pulse: Index, number: NDArray[np.uint8], most: int) -> NDArray[np.float32]:
        """Return (N,) range errors of returns, in units of one sigma.

        First returns have a number each. Later ones, which are few, take theirs from a second row, the third and
        fourth of a pulse a good part of the block away from the second: no two returns of one pulse share one.

        Args:
            pulse: (N,) within the block.
            number: (N,) from 1.
            most: largest number that there can be.
        """
        assert self.range is not None
        count = self.range.shape[1]
        result = np.take(self.range[0], pulse)
        later = np.flatnonzero(number > 1)
        place = pulse[later] + (number[later].astype(np.intp) - 2) * max(1, count // most)
        result[later] = self.range[1][place % count]
        return result


@dataclass(frozen=True)
class Poses:
    """Where everything is during a block.

    Attributes:
        true: of the scanner.
        measured: what its navigation says; the same where it makes no errors.
        motions: of the target's moving parts.
    """

    true: Track
    measured: Track
    motions: list[Track]


@dataclass(frozen=True)
class Pulses:
    """A block of pulses as they really leave the scanner, in local coordinates.

    Attributes:
        time: (P,) s since the first strip's start.
        scan_angle: (P,) rad, see `patterns.base.PulseRays`.
        origin: (3, P) where each leaves the scanner, m.
        direction: (3, P) unit vectors of the beam's axis.
        in_plane: (3, P) unit vectors across the beam, in the scan plane; None for a single ray.
        across: (3, P) unit vectors across the beam and the scan plane; None for a single ray.
        measured_origin, measured_direction: (3, P) what the scanner believes; the same arrays where it doesn't err.
    """

    time: Float
    scan_angle: Float
    origin: Float
    direction: Float
    in_plane: Float | None
    across: Float | None
    measured_origin: Float
    measured_direction: Float

    def select(self, pulses: Index) -> Pulses:
        """Return chosen pulses."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        chosen: dict[str, Any] = {
            name: None if array is None else np.take(array, pulses, axis=-1) for name, array in values.items()
        }
        # What the scanner believes may be the very array of what is true: it stays so.
        if self.measured_origin is self.origin:
            chosen["measured_origin"] = chosen["origin"]
        return Pulses(**chosen)


@dataclass(frozen=True)
class Emitter:
    """The scanner on its way, which errs as it emits pulses.

    Attributes:
        setting, path, noise, seed, driven: see `scanning.plan.ScanPlan`.
        several: whether several rays sample a pulse.
        most_returns: of a pulse that are kept at most.
    """

    setting: ScannerSetting
    path: Path
    noise: Noise
    seed: int
    driven: bool
    several: bool
    most_returns: int

    def draw_errors(self, strip: Strip, count: int, key: int) -> Errors:
        """Draw the errors of a block."""

        def source(purpose: str) -> np.random.Generator:
            return stream(self.seed, purpose, strip.index, key)

        shape = (count, self.most_returns)
        angle, dropout = self.noise.angle_sigma_mrad * 1e-3, self.noise.dropout
        return Errors(
            source("range noise").standard_normal((2, max(shape)), dtype=np.float32)
            if self.setting.range_sigma
            else None,
            source("angle noise").normal(scale=angle, size=(2, count)) if angle else None,
            source("dropouts").random(shape, dtype=np.float32) < dropout if dropout else None,
        )

    def poses_between(self, target: Target, strip: Strip, begin: float, end: float) -> Poses:
        """Return the scanner's poses, and those of what moves in the target, between two times."""
        spacing = self.path.knot_spacing

        def true(time: Float) -> tuple[Float, Float, Float]:
            position, rotation = self.path.pose(strip, time)
            return rotation, position, np.ones(len(time))

        def measured(time: Float) -> tuple[Float, Float, Float]:
            errors = TrajectoryNoise(self.noise, self.seed, strip).errors(time)
            position, rotation = measured_pose(*self.path.pose(strip, time), errors)
            return rotation, position, np.ones(len(time))

        track = Track.between(true, begin, end, spacing)
        noisy = self.noise.position_sigma or self.noise.attitude_sigma_deg or self.noise.heading_sigma_deg
        return Poses(
            track,
            # Linear between knots, errors would lose some of their spread if they changed much meanwhile.
            Track.between(measured, begin, end, min(spacing, self.noise.correlation_time / 50.0)) if noisy else track,
            target.motions(begin, end, min(spacing, _MOTION_KNOTS), track if self.driven else None),
        )

    def emit(self, strip: Strip, poses: Poses, angle: Float | None, first: int, count: int) -> Pulses:
        """Return pulses ``first`` to ``first + count`` of a strip.

        Args:
            angle: (2, P) pointing errors in the scan plane and across it, rad; None without.
        """
        shot = shots(self.setting, first, count, self.several or angle is not None)
        time = shot.time + strip.start_time
        rotation, origin, _ = poses.true.at(time)
        direction = _turn_vectors(rotation, shot.direction)
        frame = (shot.in_plane, shot.across)
        in_plane, across = (
            None if not self.several or axis is None else _turn_vectors(rotation, axis) for axis in frame
        )
        measured_origin, measured_direction = origin, direction
        if poses.measured is not poses.true or angle is not None:
            believed = shot.direction
            if angle is not None:
                assert frame[0] is not None
                assert frame[1] is not None
                believed = believed + angle[0] * frame[0] + angle[1] * frame[1]
                believed /= np.sqrt(np.einsum("ij,ij->j", believed, believed))
            rotation, measured_origin, _ = poses.measured.at(time)
            measured_direction = _turn_vectors(rotation, believed)
        return Pulses(time, shot.scan_angle, origin, direction, in_plane, across, measured_origin, measured_direction)


def _turn_vectors(rotation: Float, vectors: Float) -> Float:
    """Return vectors (3, N) turned by rotations (9, N)."""
    result = np.empty_like(vectors)
    product = np.empty(vectors.shape[1])
    for i in range(3):
        np.multiply(rotation[3 * i], vectors[0], out=result[i])
        for j in (1, 2):
            result[i] += np.multiply(rotation[3 * i + j], vectors[j], out=product)
    return result


def reaching_scene(
    setting: ScannerSetting, target: Target, pulses: Pulses, motions: list[Track]
) -> NDArray[np.bool_] | None:
    """Return which pulses (P,) may hit anything at all, as those into the sky don't; None if all may."""
    boxes = [] if target.bounds is None else [target.bounds]
    boxes += target.moving_bounds(motions)
    if not boxes:
        return np.zeros(len(pulses.time), dtype=bool)
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    cone = max(setting.divergence) * 2.0
    width = cone * setting.maximum_range
    towards: NDArray[np.bool_] | None = None
    for axis in range(3):
        place, direction = pulses.origin[axis], pulses.direction[axis]
        if place.min() > high[axis] + width:
            turned = direction < cone
        elif place.max() < low[axis] - width:
            turned = direction > -cone
        else:
            continue
        towards = turned if towards is None else towards & turned
    return None if towards is None or towards.all() else towards
