"""One block of pulses, from the path to the points. Pure arrays: the casters are all that knows the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..cloud.points import PointBlock, concatenate, make_block
from ..materials.surfaces import Surfaces, brightness_of
from ..materials.texture_spread import spread_factors
from .apply_effects import BothMarks, EffectChain
from .beam import BeamPattern, conical_directions, cylindrical_offsets
from .colour.colour import SeenPoints
from .devices.device import ScannerSetting
from .knots import Track
from .plan import ScanPlan
from .platforms.path import Strip
from .point_layers import MeasuredPoints, fill_layers, place_points
from .pulses import Emitter, Errors, Pulses, reaching_scene
from .radiometry import received_intensity, saturate
from .returns import UNCOUNTED, Echoes, Marks, group_returns, number_returns
from .scene.target import Target
from .trace import Hits, Rays, Traced, trace

Float = NDArray[np.float64]
Index = NDArray[np.intp]

LENIENT = 0.25
"""Share of the threshold that is enough for an echo whose intensity is yet to change: none is expected to become four
times as bright as its material's mean makes it."""


@dataclass(frozen=True)
class BlockResult:
    """The points of one block and what was counted on the way.

    Attributes:
        points: as measured.
        seen: where, if the scan was to say so.
        pulses, rays: emitted, and cast at what is first in their way.
        below_threshold, saturated: returns that the detector lost or clipped.
        sources: (256,) points by the source of their colour, once they are finished.
        blocks: how many blocks these are.
    """

    points: PointBlock
    seen: SeenPoints | None
    pulses: int
    rays: int
    below_threshold: int
    saturated: int
    sources: NDArray[np.int64] | None = None
    blocks: int = 1


def joined_results(results: list[BlockResult]) -> BlockResult:
    """Return several blocks that aren't finished yet as one, in their order."""
    seen = [result.seen for result in results if result.seen is not None]

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
    )


@dataclass(frozen=True)
class Beam:
    """The laser's beam, as the rays that sample a pulse's footprint.

    Attributes:
        pattern, setting: see `scanning.plan.ScanPlan`.
        shape: whether the rays diverge from the aperture or run parallel.
    """

    pattern: BeamPattern
    setting: ScannerSetting
    shape: Literal["conical", "cylindrical"]

    def rays(self, target: Target, pulses: Pulses, motions: list[Track]) -> Rays:
        """Return the rays that sample the pulses' footprints."""
        origin, share = pulses.origin[:, None, :], self.pattern.weights[:, None]
        if len(self.pattern) == 1:
            return Rays(origin, pulses.direction[:, None, :], share, pulses.time)
        assert pulses.in_plane is not None
        assert pulses.across is not None
        divergence = self.setting.divergence
        if self.shape == "conical":
            direction = conical_directions(pulses.direction, pulses.in_plane, pulses.across, self.pattern, divergence)
            return Rays(origin, direction, share, pulses.time)
        reach = self.setting.maximum_range
        distance = target.cast(pulses.origin, pulses.direction, reach, pulses.time, motions).distance
        offsets = cylindrical_offsets(pulses.in_plane, pulses.across, self.pattern, divergence, distance)
        direction = np.repeat(pulses.direction[:, None, :], len(self.pattern), axis=1)
        return Rays(origin + offsets, direction, share, pulses.time)


@dataclass(frozen=True)
class LitSurfaces:
    """Light that surfaces send back to the scanner.

    Attributes:
        target, surfaces, attenuation, frame, seed: see `scanning.plan.ScanPlan`.
        in_air: whether some echoes come from no surface.
    """

    target: Target
    surfaces: Surfaces
    attenuation: float
    frame: Float
    seed: int
    in_air: bool

    def marks(self, traced: Traced) -> BothMarks:
        """Return what the hits of traced rays add to returns: what each ray meets first, and what lies behind."""
        return self._marks(traced.first), self._marks(traced.behind)

    def _marks(self, hits: Hits) -> Marks:
        """Return what hits add to returns."""
        surfaces, material = self.surfaces, hits.material.ravel()
        brightness = brightness_of(surfaces, material, np.abs(hits.along.ravel())).reshape(hits.face.shape)
        brightness *= hits.share
        weight = np.maximum(np.take(surfaces.reflectivity, material), UNCOUNTED).reshape(hits.face.shape)
        weight *= hits.share
        return Marks(hits.distance, weight, received_intensity(brightness, hits.distance, self.attenuation))

    def vary_brightness(self, traced: Traced, echoes: Echoes, motions: list[Track]) -> Echoes:
        """Return the echoes as bright as the places are that gave most of them, see `materials.texture_spread`."""
        material = traced.pick("material", echoes.hit)
        own = np.flatnonzero(np.take(self.surfaces.uneven, material, mode="clip"))
        if self.in_air:
            own = own[traced.pick("face", echoes.hit[own]) >= 0]
        if not len(own):
            return echoes
        hit = echoes.hit[own]
        ray, reach, face = traced.ray_of(hit), traced.pick("distance", hit), traced.pick("face", hit)
        position, _ = _ray_ends(traced.rays, ray, reach)
        if self.target.moving:
            (position,) = self.target.at_start(face, position, traced.rays.time[ray % len(traced.rays.time)], motions)
        intensity = echoes.intensity.copy()
        intensity[own] *= spread_factors(self.surfaces, material[own], position.T + self.frame, self.seed)
        return replace(echoes, intensity=intensity)


class BlockScan:
    """The stages that blocks of pulses go through, in any order and by any worker.

    Args:
        plan: the scan, of which each stage takes what it needs.

    Attributes:
        emitter, beam, surfaces: the first stages.
    """

    def __init__(self, plan: ScanPlan) -> None:
        setting, effects, later = plan.setting, plan.effects, plan.detects_later
        several, self._most = plan.rays_per_pulse > 1, plan.most_returns
        self._cut, self._setting, self._target = plan.cut, setting, plan.target
        self.emitter = Emitter(setting, plan.path, plan.noise, plan.seed, plan.driven, several, self._most)
        self.beam = Beam(plan.pattern, setting, plan.beam)
        # In the air, echoes come from pulses into the sky as well.
        in_air = bool(effects and plan.target.triangles)
        self.surfaces = LitSurfaces(plan.target, plan.surfaces, plan.attenuation, plan.frame, plan.seed, in_air)
        self._effects = EffectChain(effects, plan.seed, plan.attenuation, setting) if in_air else None
        self._threshold = setting.threshold * (LENIENT if later else 1.0)
        self._saturation = np.inf if later else setting.saturation
        self._range_bias, self._wanted, self._targets = plan.noise.range_bias, plan.wanted, plan.targets

    def block(self, strip: Strip, block: int) -> BlockResult:
        """Scan one block."""
        return self.pulses(strip, *self._cut.pulses_of(strip, block), block)

    def pulses(self, strip: Strip, first: int, count: int, key: int = 0) -> BlockResult:
        """Scan pulses ``first`` to ``first + count`` of a strip at once; ``key`` is that of their random numbers.

        A block isn't cut any smaller, though its arrays leave the processor's cache: blocks are scanned side by side in
        threads that take turns in Python, so that few long calls beat many short ones.
        """
        setting, target = self._setting, self._target
        errors = self.emitter.draw_errors(strip, count, key)
        ends = (self._cut.time(strip, number) for number in (first, first + count - 1))
        poses = self.emitter.poses_between(target, strip, *ends)
        pulses = self.emitter.emit(strip, poses, errors.angle, first, count)
        number = np.arange(count)  # of each pulse within the block
        towards = None if self._effects else reaching_scene(setting, target, pulses, poses.motions)
        if towards is not None:
            number = np.flatnonzero(towards)
            pulses = pulses.select(number)
        rays = self.beam.rays(target, pulses, poses.motions)
        surfaces, limits = self.surfaces, (setting.minimum_range, setting.maximum_range)
        traced = trace(target, surfaces.surfaces, rays, poses.motions, *limits)
        marks = surfaces.marks(traced)
        if self._effects:
            traced, marks = self._effects.apply(strip, key, pulses, traced, marks)
        echoes = group_returns(*marks, traced.pulse, setting.range_resolution)
        if surfaces.surfaces.varying:
            echoes = surfaces.vary_brightness(traced, echoes, poses.motions)
        strong = np.flatnonzero(echoes.intensity >= self._threshold)
        weak = len(echoes.pulse) - len(strong)
        if weak:
            echoes = echoes.select(strong)
        if errors.lost is not None:
            echoes = _drop_lost_echoes(echoes, errors.lost[number])
        points, seen, clipped = self._points(strip, pulses, traced, echoes, errors, number, poses.motions)
        return BlockResult(points, seen, count, traced.first.face.size, weak, clipped)

    def _points(
        self,
        strip: Strip,
        pulses: Pulses,
        traced: Traced,
        echoes: Echoes,
        errors: Errors,
        number_in_block: Index,
        motions: list[Track],
    ) -> tuple[PointBlock, SeenPoints | None, int]:
        """Return the points of the echoes, where they were seen, and how many of them saturated the detector."""
        keep, number, returns = number_returns(echoes.pulse, self._most)
        if not keep.all():
            echoes = echoes.select(keep)
        pulse, hit, target = echoes.pulse, echoes.hit, self._target
        face, along = traced.pick("face", hit), traced.pick("along", hit)
        distance = echoes.range + self._range_bias
        if errors.range is not None:
            own = errors.range_errors(number_in_block[pulse], number, self._most)
            distance = distance + self._setting.range_sigma * own
        intensity, clipped = saturate(echoes.intensity, self._saturation)
        normal = None
        if self._targets or "normal" in self._wanted:
            normal = target.normals(face, along, pulses.time[pulse], motions)
            if self._effects:
                air = np.flatnonzero(face < 0)
                normal[:, air] = -np.take(traced.rays.direction.reshape(3, -1), traced.ray_of(hit[air]), axis=1)
        measured = MeasuredPoints(self._setting, target, pulses, pulse, echoes.range, echoes.intensity, face, normal)
        points = make_block(
            xyz=place_points(pulses.measured_origin, pulses.measured_direction, pulse, distance, target.origin),
            intensity=intensity,
            rgb=np.zeros((len(pulse), 3), dtype=np.uint16),
            class_id=target.face_values("class_id", face),
            instance_id=target.face_values("instance_id", face),
            return_number=number,
            number_of_returns=returns,
            gps_time=pulses.time[pulse],
            scan_angle_deg=np.rad2deg(pulses.scan_angle[pulse]).astype(np.float32),
            strip=np.full(len(pulse), strip.index, dtype=np.uint16),
            range=distance,
            incidence_deg=np.rad2deg(np.arccos(np.minimum(np.abs(along), 1.0))).astype(np.float32),
            **fill_layers(measured, self._wanted),
        )
        seen = None
        if self._targets and normal is not None:
            ray, reach = traced.ray_of(hit), traced.pick("distance", hit)
            seen = self._seen_targets(traced.rays, ray, reach, face, normal, motions)
        return points, seen, clipped

    def _seen_targets(
        self, rays: Rays, ray: Index, reach: Float, face: Index, normal: Float, motions: list[Track]
    ) -> SeenPoints:
        """Return where the points were seen, in the scene as it stands at the time 0: as it is rendered.

        That is on the surface that gave most of the return: the mean of all its hits may lie in the air between them.
        """
        target, time = self._target, rays.time[ray % len(rays.time)]
        position, scanner = _ray_ends(rays, ray, reach)
        if target.moving:
            begin, offset, normal = target.at_start(face, position, time, motions, (scanner - position, normal))
            position, scanner = begin, begin + offset
        return SeenPoints(
            position=np.ascontiguousarray(position.T),
            scanner=np.ascontiguousarray(scanner.T),
            normal=np.ascontiguousarray(normal.T),
            material=target.face_values("material", face),
            time=time,
        )


def _ray_ends(rays: Rays, ray: Index, reach: Float) -> tuple[Float, Float]:
    """Return where rays end after ``reach``, and where they began, (3, N) local, m."""
    scanner = np.take(rays.origin.reshape(3, -1), ray if rays.origin.shape[1] > 1 else ray % len(rays.time), axis=1)
    return scanner + reach * np.take(rays.direction.reshape(3, -1), ray, axis=1), scanner


def _drop_lost_echoes(echoes: Echoes, lost: NDArray[np.bool_]) -> Echoes:
    """Return the echoes that are not lost at random, by their number within the pulse."""
    keep, number, _ = number_returns(echoes.pulse, lost.shape[1])
    chosen = np.flatnonzero(keep)
    chosen = chosen[~lost[echoes.pulse[chosen], number - 1]]
    return echoes.select(chosen)
