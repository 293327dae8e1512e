"""One block of pulses, from the path to the points. Pure arrays: the casters are all that knows the scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..base.arithmetic.loops import EchoPlaces, PointLoops
from ..base.arrays import AnyArray, Bool, Float, Float32, Index, Int, UInt8
from ..base.random_streams import stream
from ..cloud.points import PointBlock, concatenate, make_block
from ..materials.surfaces import brightness_of, spread_factors
from .beam import conical_directions, cylindrical_offsets, outer_radii
from .colour.colour import SeenPoints
from .devices.shots import Columns, ShotRun, shot_run
from .effects import apply_effect
from .kernels.hits import TracedPulses
from .kernels.pulses import PulseKernel
from .knots import Track
from .multipath import Multipath
from .noise import measured_pose, shares, speckle_factors, standard_exponential, standard_normal, trajectory_errors
from .plan import ScanPlan
from .platforms.path import Strip
from .point_layers import MeasuredPoints, fill_layers, place_points
from .pulses import Errors, Poses, Pulses, may_hit_scene, tilt_vectors, turned_vectors
from .receiver import draw_values
from .receiving.detector import Readout, detect_echoes
from .receiving.radiometry import received_intensity
from .receiving.range_noise import range_sigma, range_walk, tail_factors
from .receiving.waveform import merge_peaks
from .returns import (
    LEAST_REFLECTANCE,
    BothSignals,
    Echoes,
    HitSignals,
    group_returns,
    merge_echoes,
    number_returns,
)
from .scene.outline import Outline
from .scene.target import FirstHits
from .sparing import PartlyTraced, Sparing, Traced, count_footprints
from .strip_errors import strip_gain, with_strip_errors
from .sway import SwayingPath
from .trace import Hits, Rays, TracedRays, trace

_MOTION_KNOTS = 0.01
"""Seconds between two poses of a moving vehicle: it turns by less than a milliradian meanwhile."""
_OFF_SURFACE = 1e-3
"""How far from its surface a ray towards the sun begins, m."""


@dataclass(frozen=True)
class BlockResult:
    """Points of one block, or of several joined, and counts of pulses, rays and lost returns.

    Attributes:
        points: as measured.
        seen: where, if the scan was to say so.
        pulses, rays: emitted, and cast at what is first in their way.
        below_threshold, saturated: returns that the detector lost or clipped.
        sources: (256,) points by the source of their colour, once they are finished.
        blocks: how many blocks these are.
        readout: what the receiver is still to make of the points; None once it is done.
        footprints: (3, 256) pulses by class, see `sparing.count_footprints`; None where none could be spared.
    """

    points: PointBlock
    seen: SeenPoints | None
    pulses: int
    rays: int
    below_threshold: int
    saturated: int
    sources: Int | None = None
    blocks: int = 1
    readout: Readout | None = None
    footprints: Int | None = None


@dataclass(frozen=True)
class _Tally:
    """Rays of a block that were cast at what is first in their way, and its footprints, see `BlockResult`."""

    rays: int
    footprints: Int | None = None


@dataclass(frozen=True)
class _Beams:
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

    def select(self, rows: Index) -> _Beams:
        """Return the beams of these indices."""
        origin, direction = (np.take(vectors, rows, axis=1) for vectors in (self.origin, self.direction))
        return _Beams(self.shot, np.take(self.time, rows), origin, direction)


def join_results(results: list[BlockResult]) -> BlockResult:
    """Return the results of several blocks, none of them finished yet, joined into one in their order."""
    seen = [result.seen for result in results if result.seen is not None]
    footprints = [result.footprints for result in results if result.footprints is not None]
    readouts = [result.readout for result in results if result.readout is not None]

    def total(name: str) -> int:
        return sum(getattr(result, name) for result in results)

    return BlockResult(
        points=concatenate([result.points for result in results]),
        seen=SeenPoints.join(seen) if seen else None,
        pulses=total("pulses"),
        rays=total("rays"),
        below_threshold=total("below_threshold"),
        saturated=total("saturated"),
        blocks=total("blocks"),
        readout=Readout.join(readouts) if readouts else None,
        footprints=np.sum(footprints, axis=0) if footprints else None,
    )


@dataclass(frozen=True)
class BlockScan:
    """Simulation of the blocks of a plan, from pulses to points, in any order and by any thread.

    Attributes:
        plan: the scan.
    """

    plan: ScanPlan

    def scan_block(self, strip: Strip, block: int) -> BlockResult:
        """Scan the block of a strip with this number; return its points and counts."""
        return self.scan_pulses(strip, *self.plan.cut.pulse_span(strip, block), block)

    def scan_pulses(self, strip: Strip, first: int, count: int, key: int = 0) -> BlockResult:
        """Scan ``count`` pulses of a strip from ``first`` on; return points and counts; ``key`` seeds random streams.

        A block isn't cut any smaller, though its arrays leave the processor's cache: blocks are scanned side by side in
        threads that take turns in Python, so that few long calls beat many short ones.
        """
        plan, setting = self.plan, self.plan.setting
        errors = self.draw_errors(strip, count, key)
        begin, end = (plan.cut.time(strip, number) for number in (first, first + count - 1))
        poses = self.poses_between(strip, begin, end)
        beams = self._aim(strip, poses, errors.angle, first, count)
        # In the air, echoes come from pulses into the sky as well.
        towards = None if self._in_air else self._towards_scene(beams, poses.motions)
        number = np.arange(count) if towards is None else towards  # of each pulse within the block
        pulses = self._fire(beams, poses, errors.angle, towards)
        traced, echoes, tally = self.traced_echoes(strip, pulses, poses.motions, key)
        if setting.receiver.echo_separation == "waveform":
            echoes = merge_peaks(echoes, setting.range_resolution)
        if plan.reflection.surfaces.varying:
            echoes = self.vary_brightness(traced, echoes, poses.motions)
        if (gain := strip_gain(plan.reception.strip_errors, plan.run.seed, strip.index)) != 1.0:
            echoes = replace(echoes, intensity=echoes.intensity * gain)
        provisional = plan.reception.after_layers
        echoes, readout, weak = detect_echoes(
            echoes,
            errors,
            number,
            pulses.channel,
            setting,
            dropout=plan.reception.noise.dropout,
            provisional=provisional,
        )
        keep, return_number, returns = number_returns(echoes.pulse, plan.most_returns)
        if not keep.all():
            echoes, readout = echoes.select(keep), readout.select(keep)
        recorded = (return_number, returns, readout.speckle)
        points, seen = self._points(strip, pulses, traced, echoes, recorded, errors, number, poses.motions)
        if provisional:
            return BlockResult(points, seen, count, tally.rays, weak, 0, readout=readout, footprints=tally.footprints)
        intensity, clipped = readout.read(points.intensity, points.range, setting, plan.gains)
        points = replace(points, intensity=intensity)
        return BlockResult(points, seen, count, tally.rays, weak, clipped, footprints=tally.footprints)

    def _towards_scene(self, beams: _Beams, motions: list[Track]) -> Index | None:
        """Return the pulses (K,) that may meet anything, by boxes around the scene and its outline; None if all may."""
        plan = self.plan
        towards = may_hit_scene(plan.setting, plan.target, beams.origin, beams.direction, motions)
        rows = None if towards is None else np.flatnonzero(towards)
        if plan.emission.outline is None or plan.rays_per_pulse == 1:
            return rows
        left = beams if rows is None else beams.select(rows)
        near = np.flatnonzero(~self._missing(plan.emission.outline, left, motions))
        if len(near) == (len(beams.time) if rows is None else len(rows)):
            return rows
        return near if rows is None else rows[near]

    def _missing(self, outline: Outline, beams: _Beams, motions: list[Track]) -> Bool:
        """Return a mask (P,) of pulses that surely meet nothing, by the outline of the static scene and what moves."""
        setting, target = self.plan.setting, self.plan.target
        missing = outline.passed_by(beams.origin, beams.direction, setting.maximum_range)
        if target.moving and len(rows := np.flatnonzero(missing)):
            radius = max(outer_radii(self.plan.emission.rings, setting.divergence)) * setting.maximum_range
            few, reach = beams.select(rows), np.full(len(rows), setting.maximum_range)
            missing[rows] = ~target.near_moving(few.origin, few.direction, reach, few.time, motions, radius)
        return missing

    def traced_echoes(
        self, strip: Strip, pulses: Pulses, motions: list[Track], key: int
    ) -> tuple[Traced, Echoes, _Tally]:
        """Return what the rays of pulses meet, the echoes that they give before any is lost, and the number of rays.

        Args:
            strip: of the pulses.
            pulses: of a block.
            motions: tracks of the target's moving parts.
            key: of random streams.
        """
        plan, setting = self.plan, self.plan.setting
        if plan.spares:
            return self._spared_echoes(pulses, motions)
        compiled, tally = self._kernel_of(len(pulses.time)), _Tally(len(pulses.time) * plan.rays_per_pulse)
        if compiled is not None and not self._off_surfaces:
            return *compiled.trace(pulses, motions), tally
        if compiled is None:
            traced = self._trace(pulses, motions)
            signals = self.signals(traced)
        else:
            traced, signals = compiled.follow(pulses, motions)
        if plan.reflection.multipath is not None:
            traced, signals = self.add_ghosts(plan.reflection.multipath, traced, signals, motions)
        for effect in plan.atmosphere.effects if self._in_air else ():
            random = stream(plan.run.seed, f"effect {effect.name}", strip.index, key)
            traced, signals = apply_effect(
                effect, random, setting, plan.atmosphere.attenuation, pulses, traced, signals
            )
        if compiled is None:
            return traced, group_returns(*signals, traced.pulse, setting.range_resolution), tally
        return traced, compiled.group(signals, traced.ray), tally

    def _kernel_of(self, pulses: int) -> PulseKernel | None:
        """Return the compiled loops for so many pulses; None for NumPy, as for a single one: see `PulseKernel`."""
        kernel = self.plan.pulse_kernel
        return kernel if isinstance(kernel, PulseKernel) and pulses > 1 else None

    def _spared_echoes(self, pulses: Pulses, motions: list[Track]) -> tuple[Traced, Echoes, _Tally]:
        """Return what `traced_echoes` does where footprints that meet one plane alone aren't cast in full."""
        plan, setting = self.plan, self.plan.setting
        met = plan.target.cast(pulses.origin, pulses.direction, setting.maximum_range, pulses.time, motions)
        sparing = Sparing(plan)
        spared = sparing.find(pulses, met, motions)
        others = np.ones(len(pulses.time), bool)
        others[spared.pulse] = others[sparing.find_missing(pulses, met, motions)] = False
        full = np.flatnonzero(others)
        traced: TracedRays | TracedPulses
        if (compiled := self._kernel_of(len(full))) is not None:
            traced, echoes = compiled.trace(pulses.select(full), motions, met.take(full))
        else:
            traced = self._trace(pulses.select(full), motions, met.take(full))
            echoes = group_returns(*self.signals(traced), traced.pulse, setting.range_resolution)
        echoes = replace(echoes, pulse=full[echoes.pulse])
        echoes = merge_echoes(echoes, sparing.echoes(spared, traced.count))
        rays = len(met.face) + (plan.rays_per_pulse - 1) * len(full)
        tally = _Tally(rays, count_footprints(plan.target, met, spared))
        return PartlyTraced(traced, spared, pulses), echoes, tally

    def _trace(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None = None) -> TracedRays:
        """Return what all rays of pulses meet, without casting their axes again where ``axis`` says what these meet."""
        plan, setting = self.plan, self.plan.setting
        limits = (setting.minimum_range, setting.maximum_range)
        rays = self.rays(pulses, motions, axis)
        return trace(plan.target, plan.reflection.surfaces, rays, motions, *limits, axis, plan.openings)

    @property
    def _in_air(self) -> bool:
        """Return whether effects may add echoes to pulses that meet no surface."""
        return bool(self.plan.atmosphere.effects and self.plan.target.triangles)

    @property
    def _off_surfaces(self) -> bool:
        """Return whether there may be echoes that come from no surface: of the air, or ghosts."""
        return self._in_air or self.plan.reflection.multipath is not None

    def draw_errors(self, strip: Strip, count: int, key: int) -> Errors:
        """Draw the random errors of a block of ``count`` pulses; ``key`` keys their random streams."""
        plan = self.plan

        def source(purpose: str) -> np.random.Generator:
            return stream(plan.run.seed, purpose, strip.index, key)

        receiver, noise, ranges = plan.setting.receiver, plan.reception.noise, plan.setting.range_sigma

        def values(purpose: str, wanted: object, draw: Callable[[np.random.Generator, int], Float32]) -> Any:
            return draw_values(partial(draw, source(purpose)), count) if wanted else None

        def angles() -> Float32:
            sigma = np.float32(noise.angle_sigma_mrad * 1e-3)
            return np.asarray(sigma * source("angle noise").standard_normal((2, count), dtype=np.float32))

        return Errors(
            values("range noise", ranges, standard_normal),
            angles() if noise.angle_sigma_mrad else None,
            values("dropouts", noise.dropout, shares),
            values(
                "speckle", noise.speckle, partial(speckle_factors, sigma=noise.speckle, normal=noise.speckle_normal)
            ),
            values("receiver noise", receiver.noise_sigma(plan.setting.threshold), standard_normal),
            values(
                "range tails",
                ranges and receiver.range_tails,
                partial(tail_factors, freedom=receiver.range_tails or 0.0),
            ),
            values("lost numbers", receiver.lost_numbers, shares),
            values("range delays", ranges and receiver.range_delay, standard_exponential),
        )

    def poses_between(self, strip: Strip, begin: float, end: float) -> Poses:
        """Return the tracks of the scanner and of the target's moving parts between two times, s."""
        path, noise, spacing = self.plan.path, self.plan.reception.noise, self.plan.path.knot_spacing
        strip_errors, seed = self.plan.reception.strip_errors, self.plan.run.seed
        every = path.knots_per_node if isinstance(path, SwayingPath) else 1
        noisy = bool(noise.position_sigma or noise.attitude_sigma_deg or noise.heading_sigma_deg)
        known: dict[tuple[float, float], tuple[Float, Float]] = {}

        def planned(time: Float) -> tuple[Float, Float]:
            """Return the poses at evenly spaced times, which are worked out once for both tracks."""
            key = (float(time[0]), float(time[-1]))
            if key not in known:
                known[key] = path.pose(strip, time)
            return known[key]

        def true(time: Float) -> tuple[Float, Float, Float]:
            position, rotation = planned(time)
            return rotation, position, np.ones(len(time))

        def measured(time: Float) -> tuple[Float, Float, Float]:
            pose = planned(time)
            if noisy:
                pose = measured_pose(*pose, trajectory_errors(noise, seed, strip, time))
            position, rotation = with_strip_errors(strip_errors, seed, strip, time, pose)
            return rotation, position, np.ones(len(time))

        track = Track.between(true, begin, end, spacing, every)
        # Between knots errors would lose some of their spread if they changed much meanwhile.
        closest = min(spacing, noise.correlation_time / 50.0)
        every = max(1, min(every, int(noise.correlation_time / 50.0 / closest)))
        return Poses(
            track,
            Track.between(measured, begin, end, closest, every) if noisy or strip_errors.moves_points else track,
            self.plan.target.motions(
                begin, end, min(spacing, _MOTION_KNOTS), track if self.plan.emission.on_vehicle else None
            ),
        )

    def emit(self, strip: Strip, poses: Poses, angle: Float32 | None, first: int, count: int) -> Pulses:
        """Return ``count`` pulses of a strip from ``first`` on, as they leave the scanner, in local coordinates.

        Args:
            angle: (2, P) pointing errors in the scan plane and across it, rad; None without.
        """
        return self._fire(self._aim(strip, poses, angle, first, count), poses, angle, None)

    def _turned(
        self, track: Track, times: Float, vectors: Sequence[Float], columns: Columns | None = None
    ) -> tuple[Float, list[Float]]:
        """Return positions and turned vectors by a track, see `turned_vectors`."""
        kernel = self.plan.pose_kernel
        turned = turned_vectors if kernel is None else kernel.turned_vectors
        return turned(track, times, vectors, columns)

    def _aim(self, strip: Strip, poses: Poses, angle: Float32 | None, first: int, count: int) -> _Beams:
        """Return where ``count`` pulses of a strip from ``first`` on are fired from and to, see `emit`."""
        shot = shot_run(self.plan.setting, first, count, self.plan.rays_per_pulse > 1 or angle is not None)
        time = shot.time + strip.start_time
        origin, (direction,) = self._turned(poses.true, time, [shot.table.direction], Columns(shot.first))
        return _Beams(shot, time, origin, direction)

    def _fire(self, beams: _Beams, poses: Poses, angle: Float32 | None, rows: Index | None) -> Pulses:
        """Return the pulses of beams, or the rows (K,) of them, ascending, see `emit`."""
        shot, several = beams.shot, self.plan.rays_per_pulse > 1
        if rows is not None:
            beams = beams.select(rows)
            angle = None if angle is None else np.take(angle, rows, axis=1)
        time, origin, direction = beams.time, beams.origin, beams.direction
        axes: list[Float | None] = [None, None]
        if several:
            frame = [axis for axis in (shot.table.in_plane, shot.table.across) if axis is not None]
            axes[:] = self._turned(poses.true, time, frame, Columns(shot.first, rows))[1]
        measured_origin, measured_direction = origin, direction
        if poses.measured is not poses.true or angle is not None:
            believed = shot.column("direction", rows)
            if angle is not None:
                believed = tilt_vectors(believed, shot.column("in_plane", rows), shot.column("across", rows), angle)
            measured_origin, (measured_direction,) = self._turned(poses.measured, time, [believed])
        scan_angle, channel = shot.column("scan_angle", rows), np.asarray(shot.column("beam", rows), np.uint8)
        in_plane, across = axes
        return Pulses(
            time, scan_angle, channel, origin, direction, in_plane, across, measured_origin, measured_direction
        )

    def rays(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None = None) -> Rays:
        """Return the K rays that sample each pulse's footprint; a cylindrical beam is cast once to find its range.

        Args:
            pulses: P pulses.
            motions: tracks of the target's moving parts.
            axis: (P,) what the pulses' axes meet, if these were cast already.
        """
        pattern, setting = self.plan.emission.pattern, self.plan.setting
        origin, share = pulses.origin[:, None, :], pattern.weights[:, None]
        if len(pattern) == 1:
            return Rays(origin, pulses.direction[:, None, :], share, pulses.time)
        assert pulses.in_plane is not None
        assert pulses.across is not None
        across = (pulses.in_plane, pulses.across, pattern, setting.divergence)
        if self.plan.emission.beam == "conical":
            return Rays(origin, conical_directions(pulses.direction, *across), share, pulses.time)
        met = axis or self.plan.target.cast(
            pulses.origin, pulses.direction, setting.maximum_range, pulses.time, motions
        )
        offsets = cylindrical_offsets(*across, met.distance)
        direction = np.repeat(pulses.direction[:, None, :], len(pattern), axis=1)
        return Rays(origin + offsets, direction, share, pulses.time)

    def signals(self, traced: TracedRays) -> BothSignals:
        """Return the signals of traced rays' hits: of what each ray meets first, and of what lies behind it."""
        return self._signals(traced.first), self._signals(traced.behind)

    def _signals(self, hits: Hits) -> HitSignals:
        """Return the signals that hits send back: ranges, their weights in mean ranges, and received intensities."""
        surfaces, material = self.plan.reflection.surfaces, hits.material.ravel()
        brightness = brightness_of(surfaces, material, np.abs(hits.cosine.ravel())).reshape(hits.face.shape)
        brightness *= hits.share
        weight = np.maximum(np.take(surfaces.reflectivity, material), LEAST_REFLECTANCE).reshape(hits.face.shape)
        weight *= hits.share
        return HitSignals(
            hits.distance, weight, received_intensity(brightness, hits.distance, self.plan.atmosphere.attenuation)
        )

    def add_ghosts(
        self, multipath: Multipath, traced: TracedRays, signals: BothSignals, motions: list[Track]
    ) -> tuple[TracedRays, BothSignals]:
        """Return traced rays and signals with the echoes of what surfaces mirror among those that lie behind."""
        plan, (first, behind) = self.plan, signals
        hits, ray, ghosts = multipath.ghosts(
            plan.target, plan.reflection.surfaces, plan.setting, plan.atmosphere.attenuation, traced, motions
        )
        traced = replace(traced, behind=Hits.join([traced.behind, hits]), ray=np.concatenate([traced.ray, ray]))
        return traced, (first, HitSignals.join([behind, ghosts]))

    def vary_brightness(self, traced: Traced, echoes: Echoes, motions: list[Track]) -> Echoes:
        """Return the echoes with intensities scaled by how their materials' reflectance varies in space."""
        surfaces, target = self.plan.reflection.surfaces, self.plan.target
        material = traced.pick("material", echoes.hit)
        uneven = np.flatnonzero(np.take(surfaces.uneven, material, mode="clip"))
        if self._off_surfaces:
            uneven = uneven[traced.pick("face", echoes.hit[uneven]) >= 0]
        if not len(uneven):
            return echoes
        hit = echoes.hit[uneven]
        position, _ = traced.ends(hit)
        if target.moving:
            (position,) = target.at_time_zero(traced.pick("face", hit), position, traced.times(hit), motions)
        intensity = echoes.intensity.copy()
        place = position.T + self.plan.reflection.frame_origin
        intensity[uneven] *= spread_factors(surfaces, material[uneven], place, self.plan.run.seed)
        return replace(echoes, intensity=intensity)

    def _points(
        self,
        strip: Strip,
        pulses: Pulses,
        traced: Traced,
        echoes: Echoes,
        recorded: tuple[UInt8, UInt8, Float | None],
        errors: Errors,
        number_in_block: Index,
        motions: list[Track],
    ) -> tuple[PointBlock, SeenPoints | None]:
        """Return the points of the echoes, with intensities as they arrive, and where they were seen.

        Args:
            recorded: number of each echo and of its pulse's returns, and the factor of its speckle (None without).
        """
        plan, setting, target = self.plan, self.plan.setting, self.plan.target
        number, returns, speckle = recorded
        pulse, hit = echoes.pulse, echoes.hit
        cosine = traced.pick("cosine", hit)
        distance = echoes.range + plan.reception.noise.range_bias
        if errors.range is not None:
            delayed = setting.receiver.range_delay or 0.0
            range_errors = errors.range_errors(np.take(number_in_block, pulse), number, delayed)
            distance = distance + range_sigma(setting, echoes.range, cosine, echoes.intensity) * range_errors
            if setting.receiver.range_walk:
                gain = strip_gain(plan.reception.strip_errors, plan.run.seed, strip.index)
                distance = distance + range_walk(setting, speckle, plan.reception.noise, gain)
        kernel = plan.point_loops
        if kernel is not None and isinstance(traced, TracedPulses) and not target.moving:
            arrays, seen = self._placed_by_loops(kernel, pulses, traced, echoes, distance)
        else:
            arrays, seen = self._placed(pulses, traced, echoes, distance, motions)
        points = make_block(
            intensity=echoes.intensity,
            rgb=np.zeros((len(pulse), 3), dtype=np.uint16),
            return_number=number,
            number_of_returns=returns,
            strip=np.full(len(pulse), strip.index, dtype=np.uint16),
            range=distance,
            incidence_deg=np.rad2deg(np.arccos(np.minimum(np.abs(cosine), 1.0))).astype(np.float32),
            **arrays,
        )
        return points, seen

    def _placed(
        self, pulses: Pulses, traced: Traced, echoes: Echoes, distance: Float, motions: list[Track]
    ) -> tuple[dict[str, AnyArray], SeenPoints | None]:
        """Return the arrays of echoes' points that follow from where these are, and where they were seen.

        Args:
            pulses: of the block.
            traced: hits.
            echoes: N of them.
            distance: (N,) measured ranges, m.
            motions: tracks of the target's moving parts.
        """
        plan, setting, target = self.plan, self.plan.setting, self.plan.target
        pulse, hit = echoes.pulse, echoes.hit
        face, cosine = traced.pick("face", hit), traced.pick("cosine", hit)
        normal, seen = None, None
        if plan.layers.seen_points or "normal" in plan.layers.measured:
            normal = target.normals(face, cosine, pulses.time[pulse], motions)
            if self._off_surfaces:
                air = np.flatnonzero(face < 0)
                normal[:, air] = -traced.directions(hit[air])
        class_id = target.face_values("class_id", face)
        if self._off_surfaces:
            class_id = np.where(face < 0, np.uint8(plan.atmosphere.air_class), class_id)
        measured = MeasuredPoints(setting, target, pulses, pulse, echoes.range, echoes.intensity, face, normal)
        arrays: dict[str, AnyArray] = {
            "xyz": place_points(pulses.measured_origin, pulses.measured_direction, pulse, distance, target.origin),
            "class_id": class_id,
            "instance_id": target.instances(face, pulses.time[pulse]),
            "gps_time": pulses.time[pulse] + plan.reception.epoch,
            "scan_angle_deg": np.rad2deg(pulses.scan_angle[pulse]).astype(np.float32),
        }
        if plan.layers.seen_points and normal is not None:
            seen = self._seen_targets(traced, hit, face, normal, motions)
        return arrays | fill_layers(measured, plan.layers.measured), seen

    def _placed_by_loops(
        self, loops: PointLoops, pulses: Pulses, traced: TracedPulses, echoes: Echoes, distance: Float
    ) -> tuple[dict[str, AnyArray], SeenPoints | None]:
        """Return what `_placed` does where nothing moves and all echoes are of surfaces, by compiled loops."""
        plan, target = self.plan, self.plan.target
        of_pulses = (pulses.time, pulses.scan_angle, pulses.origin, pulses.measured_origin, pulses.measured_direction)
        of_faces = (target.static_planes, target.class_id, target.instance_id, target.material)
        hits = (traced.face, traced.cosine, traced.distance, traced.direction, traced.begin)
        asked = plan.layers.seen_points or "normal" in plan.layers.measured
        placed = loops.placed(
            EchoPlaces(
                echoes.pulse, echoes.hit, distance, *hits, *of_pulses, *of_faces, target.origin, plan.reception.epoch
            ),
            asked,
        )
        face = traced.pick("face", echoes.hit)
        known: dict[str, AnyArray] = {"normal": placed.narrow_normal, "material": placed.material}
        measured = MeasuredPoints(
            plan.setting, target, pulses, echoes.pulse, echoes.range, echoes.intensity, face, None
        )
        arrays: dict[str, AnyArray] = {
            "xyz": placed.xyz,
            "class_id": placed.class_id,
            "instance_id": placed.instance_id,
            "gps_time": placed.gps_time,
            "scan_angle_deg": placed.scan_angle_deg,
            **{name: array for name, array in known.items() if name in plan.layers.measured},
            **fill_layers(measured, plan.layers.measured - known.keys()),
        }
        if not plan.layers.seen_points:
            return arrays, None
        sunlit = None
        if plan.sun is not None:
            facing, begin = loops.facing(placed.normal, placed.position, plan.sun, _OFF_SURFACE)
            sunlit = self._unshaded(facing, begin, placed.time, [])
        seen = SeenPoints(placed.position, placed.scanner, placed.normal, placed.material, placed.time, face, sunlit)
        return arrays, seen

    def _seen_targets(self, traced: Traced, hit: Index, face: Index, normal: Float, motions: list[Track]) -> SeenPoints:
        """Return the surface points that gave the returns, in the scene at time 0, as it is rendered.

        That is on the surface that gave most of the return: the mean of all its hits may lie in the air between them.
        """
        target, time = self.plan.target, traced.times(hit)
        position, scanner = traced.ends(hit)
        sunlit = None if self.plan.sun is None else self._sunlit(face, position, normal, time, motions)
        if target.moving:
            begin, offset, normal = target.at_time_zero(face, position, time, motions, (scanner - position, normal))
            position, scanner = begin, begin + offset
        return SeenPoints(
            position=np.ascontiguousarray(position.T),
            scanner=np.ascontiguousarray(scanner.T),
            normal=np.ascontiguousarray(normal.T),
            material=target.face_values("material", face),
            time=time,
            face=face,
            sunlit=sunlit,
        )

    def _sunlit(self, face: Index, position: Float, normal: Float, time: Float, motions: list[Track]) -> Bool:
        """Return a mask (N,) of the points that the sun reaches, on the side that their normals (3, N) point to."""
        sun = self.plan.sun
        assert sun is not None
        facing = (sun[0] * normal[0] + sun[1] * normal[1] + sun[2] * normal[2] > 0.0) & (face >= 0)
        return self._unshaded(facing, normal * _OFF_SURFACE + position, time, motions)

    def _unshaded(self, facing: Bool, begin: Float, time: Float, motions: list[Track]) -> Bool:
        """Return a mask (N,) of the places (3, N), m, that face the sun and that nothing shades at times (N,), s."""
        sun, towards = self.plan.sun, np.flatnonzero(facing)
        assert sun is not None
        if len(towards) < len(facing):
            # Columns are chosen several times as fast by `take` as by indexing.
            begin, time = np.take(begin, towards, axis=1), np.take(time, towards)
        result = np.zeros(len(facing), bool)
        result[towards] = self.plan.target.unobstructed(begin, sun, time, motions)
        return result
