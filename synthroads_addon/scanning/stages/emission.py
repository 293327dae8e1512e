"""`PulseEmitter`: the pulses of a block, with their random errors, and which of them may meet anything."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...base.arrays import Bool, Float, Float32, Index
from ...base.random_streams import stream
from ..beam import outer_radii
from ..devices.shots import Columns, ShotRun, shot_run
from ..knots import Track
from ..noise import measured_pose, shares, speckle_factors, standard_exponential, standard_normal, trajectory_errors
from ..plan import ScanPlan
from ..platforms.path import Strip
from ..pulses import Errors, Poses, Pulses, may_hit_scene, tilt_vectors, turned_vectors
from ..receiver import draw_values
from ..receiving.range_noise import tail_factors
from ..scene.outline import Outline
from ..strip_errors import with_strip_errors
from ..sway import SwayingPath

_MOTION_KNOTS = 0.01
"""Seconds between two poses of a moving vehicle: it turns by less than a milliradian meanwhile."""
_KNOTS_PER_CORRELATION = 50.0
"""Knots of the measured poses within a correlation time of their errors at least. Chosen: between knots errors would
lose some of their spread if they changed much meanwhile."""


@dataclass(frozen=True)
class Beams:
    """Beams of a block's P pulses, before it is known which of them may meet anything.

    Attributes:
        shot: of the device, of all pulses of the block.
        time: (P,) s since the first strip's start.
        origin: (3, P) where each leaves the scanner, local, m.
        direction: (3, P) unit vectors of their axes.
    """

    shot: ShotRun
    time: Float
    origin: Float
    direction: Float

    def select(self, rows: Index) -> Beams:
        """Return the beams of these indices."""
        origin, direction = (np.take(vectors, rows, axis=1) for vectors in (self.origin, self.direction))
        return Beams(self.shot, np.take(self.time, rows), origin, direction)


@dataclass(frozen=True)
class PulseEmitter:
    """Emission of the pulses of a plan's blocks.

    Attributes:
        plan: the scan.
    """

    plan: ScanPlan

    def draw_errors(self, strip: Strip, count: int, key: int) -> Errors:
        """Draw the random errors of a block of ``count`` pulses; ``key`` keys their random streams."""
        plan = self.plan
        receiver, noise, range_sigma = plan.setting.receiver, plan.reception.noise, plan.setting.range_sigma

        def source(purpose: str) -> np.random.Generator:
            """Return the block's stream of random numbers for a purpose."""
            return stream(plan.run.seed, purpose, strip.index, key)

        def values(purpose: str, size: object, draw: Callable[[np.random.Generator, int], Float32]) -> Any:
            """Return random numbers of the block's echoes; None where the size of the error is 0 or None."""
            return draw_values(partial(draw, source(purpose)), count) if size else None

        def angles() -> Float32:
            """Return pointing errors (2, P), rad."""
            sigma = np.float32(noise.angle_sigma_mrad * 1e-3)
            return np.asarray(sigma * source("angle noise").standard_normal((2, count), dtype=np.float32))

        speckle = partial(speckle_factors, sigma=noise.speckle, normal=noise.speckle_normal)
        tails = partial(tail_factors, freedom=receiver.range_tails or 0.0)
        return Errors(
            range=values("range noise", range_sigma, standard_normal),
            angle=angles() if noise.angle_sigma_mrad else None,
            lost=values("dropouts", noise.dropout, shares),
            speckle=values("speckle", noise.speckle, speckle),
            receiver=values("receiver noise", receiver.noise_sigma(plan.setting.threshold), standard_normal),
            tails=values("range tails", range_sigma and receiver.range_tails, tails),
            number=values("lost numbers", receiver.lost_numbers, shares),
            delay=values("range delays", range_sigma and receiver.range_delay, standard_exponential),
        )

    def poses_between(self, strip: Strip, begin: float, end: float) -> Poses:
        """Return the tracks of the scanner and of the target's moving parts between two times, s."""
        path, noise, spacing = self.plan.path, self.plan.reception.noise, self.plan.path.knot_spacing
        strip_errors, seed = self.plan.reception.strip_errors, self.plan.run.seed
        knots_per_node = path.knots_per_node if isinstance(path, SwayingPath) else 1
        is_noisy = bool(noise.position_sigma or noise.attitude_sigma_deg or noise.heading_sigma_deg)
        path_poses: dict[tuple[float, float], tuple[Float, Float]] = {}

        def path_pose(time: Float) -> tuple[Float, Float]:
            """Return the path's poses at evenly spaced times, which are worked out once for both tracks."""
            key = (float(time[0]), float(time[-1]))
            if key not in path_poses:
                path_poses[key] = path.pose(strip, time)
            return path_poses[key]

        def true_pose(time: Float) -> tuple[Float, Float, Float]:
            """Return rotations, positions and presence of the scanner, see `Track.between`."""
            position, rotation = path_pose(time)
            return rotation, position, np.ones(len(time))

        def navigation_pose(time: Float) -> tuple[Float, Float, Float]:
            """Return rotations, positions and presence of the scanner with the errors of its navigation."""
            pose = path_pose(time)
            if is_noisy:
                pose = measured_pose(*pose, trajectory_errors(noise, seed, strip, time))
            outages = self.plan.reception.outages
            position, rotation = with_strip_errors(strip_errors, seed, strip, time, pose, outages)
            return rotation, position, np.ones(len(time))

        true_track = measured_track = Track.between(true_pose, begin, end, spacing, knots_per_node)
        if is_noisy or strip_errors.moves_points:
            error_spacing = noise.correlation_time / _KNOTS_PER_CORRELATION
            measured_spacing = min(spacing, error_spacing)
            measured_per_node = max(1, min(knots_per_node, int(error_spacing / measured_spacing)))
            measured_track = Track.between(navigation_pose, begin, end, measured_spacing, measured_per_node)
        carrier = true_track if self.plan.emission.on_vehicle else None
        motions = self.plan.target.motions(begin, end, min(spacing, _MOTION_KNOTS), carrier)
        return Poses(true_track, measured_track, motions)

    def emit(self, strip: Strip, poses: Poses, angle: Float32 | None, first_pulse: int, count: int) -> Pulses:
        """Return pulses of a strip as they leave the scanner, in local coordinates.

        Args:
            strip: of the pulses.
            poses: that span their times.
            angle: (2, P) pointing errors in the scan plane and across it, rad; None without.
            first_pulse: number of the first one within the strip.
            count: of pulses.
        """
        return self.fire(self.aim(strip, poses, angle, first_pulse, count), poses, angle, None)

    def aim(self, strip: Strip, poses: Poses, angle: Float32 | None, first_pulse: int, count: int) -> Beams:
        """Return the beams of pulses, whose axes are known and nothing else yet; see `emit`."""
        with_frame = self.plan.rays_per_pulse > 1 or angle is not None
        shot = shot_run(self.plan.setting, first_pulse, count, with_frame)
        time = shot.time + strip.start_time
        origin, (direction,) = self._turn(poses.true, time, [shot.table.direction], Columns(shot.first))
        return Beams(shot, time, origin, direction)

    def fire(self, beams: Beams, poses: Poses, angle: Float32 | None, rows: Index | None) -> Pulses:
        """Return the pulses of beams.

        Args:
            beams: of a block.
            poses: that span its times.
            angle: (2, P) see `emit`.
            rows: (K,) of the beams that are fired, ascending; None for all.
        """
        shot = beams.shot
        if rows is not None:
            beams = beams.select(rows)
            angle = None if angle is None else np.take(angle, rows, axis=1)
        time, origin, direction = beams.time, beams.origin, beams.direction
        in_plane: Float | None = None
        across: Float | None = None
        if self.plan.rays_per_pulse > 1:
            frame = [axis for axis in (shot.table.in_plane, shot.table.across) if axis is not None]
            in_plane, across = self._turn(poses.true, time, frame, Columns(shot.first, rows))[1]
        measured_origin, measured_direction = origin, direction
        if poses.measured is not poses.true or angle is not None:
            # The scanner believes that the beam went as its mirror says, with an error, from where navigation says.
            believed = shot.column("direction", rows)
            if angle is not None:
                believed = tilt_vectors(believed, shot.column("in_plane", rows), shot.column("across", rows), angle)
            measured_origin, (measured_direction,) = self._turn(poses.measured, time, [believed])
        return Pulses(
            time=time,
            scan_angle=shot.column("scan_angle", rows),
            channel=np.asarray(shot.column("beam", rows), np.uint8),
            origin=origin,
            direction=direction,
            in_plane=in_plane,
            across=across,
            measured_origin=measured_origin,
            measured_direction=measured_direction,
        )

    def beams_towards_scene(self, beams: Beams, motions: list[Track]) -> Index | None:
        """Return the rows (K,) of the beams that may meet anything; None if all may.

        They are told by boxes around the scene, then by its outline.

        Args:
            beams: P of them.
            motions: tracks of the target's moving parts.
        """
        plan = self.plan
        mask = may_hit_scene(plan.setting, plan.target, beams.origin, beams.direction, motions)
        rows = None if mask is None else np.flatnonzero(mask)
        if plan.emission.outline is None or plan.rays_per_pulse == 1:
            return rows
        candidates = beams if rows is None else beams.select(rows)
        hits = np.flatnonzero(~self._passes_by(plan.emission.outline, candidates, motions))
        if len(hits) == len(candidates.time):
            return rows
        return hits if rows is None else rows[hits]

    def _passes_by(self, outline: Outline, beams: Beams, motions: list[Track]) -> Bool:
        """Return a mask (P,) of the beams that surely meet nothing, neither of the static scene nor of what moves."""
        setting, target = self.plan.setting, self.plan.target
        passes_by = outline.passed_by(beams.origin, beams.direction, setting.maximum_range)
        if target.moving and len(rows := np.flatnonzero(passes_by)):
            radius = max(outer_radii(self.plan.emission.rings, setting.divergence)) * setting.maximum_range
            passing, reach = beams.select(rows), np.full(len(rows), setting.maximum_range)
            is_near = target.near_moving(passing.origin, passing.direction, reach, passing.time, motions, radius)
            passes_by[rows] = ~is_near
        return passes_by

    def _turn(
        self, track: Track, times: Float, vectors: Sequence[Float], columns: Columns | None = None
    ) -> tuple[Float, list[Float]]:
        """Return positions and vectors turned by a track, by compiled loops if there are any: see `turned_vectors`."""
        kernel = self.plan.pose_kernel
        turn = turned_vectors if kernel is None else kernel.turned_vectors
        return turn(track, times, vectors, columns)
