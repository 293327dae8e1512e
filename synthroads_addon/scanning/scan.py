"""One block of pulses, from the path to the points. Pure arrays: the casters are all that knows the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cloud.points import PointBlock, concatenate, make_block
from ..materials.surfaces import brightness_of
from ..materials.texture_spread import spread_factors
from .apply_effects import BothMarks, apply_effects
from .beam import conical_directions, cylindrical_offsets
from .colour.colour import SeenPoints
from .knots import Track
from .plan import ScanPlan
from .platforms.path import Strip
from .point_layers import MeasuredPoints, fill_layers, place_points
from .pulses import Errors, Poses, Pulses, make_pulses, reaching_scene
from .radiometry import received_intensity, saturate
from .returns import UNCOUNTED, Echoes, Marks, group_returns, number_returns
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


def scan_block(plan: ScanPlan, strip: Strip, block: int) -> BlockResult:
    """ScanPlan one block; blocks can be computed in any order and by any worker."""
    return scan_pulses(plan, strip, *plan.cut.pulses_of(strip, block), block)


def scan_pulses(plan: ScanPlan, strip: Strip, first: int, count: int, key: int = 0) -> BlockResult:
    """ScanPlan pulses ``first`` to ``first + count`` of a strip at once; ``key`` is that of their random numbers.

    A block isn't cut any smaller, though its arrays leave the processor's cache: blocks are scanned side by side in
    threads that take turns in Python, so that few long calls beat many short ones.
    """
    errors = Errors.draw(plan, strip, count, key)
    poses = Poses.between(plan, strip, *(plan.cut.time(strip, i) for i in (first, first + count - 1)))
    pulses = make_pulses(plan, strip, poses, errors.angle, first, count)
    number = np.arange(count)  # of each pulse within the block
    # In the air, echoes come from pulses into the sky as well.
    in_air = bool(plan.effects and plan.target.triangles)
    towards = None if in_air else reaching_scene(plan, pulses, poses.motions)
    if towards is not None:
        number = np.flatnonzero(towards)
        pulses = pulses.select(number)
    rays = beam_rays(plan, pulses, poses.motions)
    traced = trace(
        plan.target, plan.surfaces, rays, poses.motions, plan.setting.minimum_range, plan.setting.maximum_range
    )
    marks = hit_marks(plan, traced)
    if in_air:
        traced, marks = apply_effects(plan, strip, key, pulses, traced, marks)
    echoes = group_returns(*marks, traced.pulse, plan.setting.range_resolution)
    if plan.surfaces.varying:
        echoes = _vary_brightness(plan, traced, echoes, poses.motions)
    threshold = plan.setting.threshold * (LENIENT if plan.detects_later else 1.0)
    strong = np.flatnonzero(echoes.intensity >= threshold)
    weak = len(echoes.pulse) - len(strong)
    if weak:
        echoes = echoes.select(strong)
    if errors.lost is not None:
        echoes = _drop_lost_echoes(echoes, errors.lost[number])
    points, seen, clipped = _points(plan, strip, pulses, traced, echoes, errors, number, poses.motions)
    return BlockResult(points, seen, count, traced.first.face.size, weak, clipped)


def beam_rays(plan: ScanPlan, pulses: Pulses, motions: list[Track]) -> Rays:
    """Return the rays that sample the pulses' footprints."""
    origin, share = pulses.origin[:, None, :], plan.pattern.weights[:, None]
    if plan.rays_per_pulse == 1:
        return Rays(origin, pulses.direction[:, None, :], share, pulses.time)
    assert pulses.in_plane is not None
    assert pulses.across is not None
    divergence = plan.setting.divergence
    if plan.beam == "conical":
        direction = conical_directions(pulses.direction, pulses.in_plane, pulses.across, plan.pattern, divergence)
        return Rays(origin, direction, share, pulses.time)
    reach = plan.setting.maximum_range
    distance = plan.target.cast(pulses.origin, pulses.direction, reach, pulses.time, motions).distance
    offsets = cylindrical_offsets(pulses.in_plane, pulses.across, plan.pattern, divergence, distance)
    direction = np.repeat(pulses.direction[:, None, :], plan.rays_per_pulse, axis=1)
    return Rays(origin + offsets, direction, share, pulses.time)


def hit_marks(plan: ScanPlan, traced: Traced) -> BothMarks:
    """Return what the hits of traced rays add to returns: what each ray meets first, and what lies behind."""
    return _marks(plan, traced.first), _marks(plan, traced.behind)


def _marks(plan: ScanPlan, hits: Hits) -> Marks:
    """Return what hits add to returns."""
    surfaces, material = plan.surfaces, hits.material.ravel()
    brightness = brightness_of(surfaces, material, np.abs(hits.along.ravel())).reshape(hits.face.shape)
    brightness *= hits.share
    weight = np.maximum(np.take(surfaces.reflectivity, material), UNCOUNTED).reshape(hits.face.shape)
    weight *= hits.share
    return Marks(hits.distance, weight, received_intensity(brightness, hits.distance, plan.attenuation))


def _vary_brightness(plan: ScanPlan, traced: Traced, echoes: Echoes, motions: list[Track]) -> Echoes:
    """Return the echoes as bright as the places are that gave most of them, see `materials.texture_spread`."""
    material = traced.pick("material", echoes.hit)
    own = np.flatnonzero(np.take(plan.surfaces.uneven, material, mode="clip"))
    if plan.effects:
        own = own[traced.pick("face", echoes.hit[own]) >= 0]
    if not len(own):
        return echoes
    hit = echoes.hit[own]
    ray, reach, face = traced.ray_of(hit), traced.pick("distance", hit), traced.pick("face", hit)
    position, _ = _ray_ends(traced.rays, ray, reach)
    if plan.target.moving:
        (position,) = plan.target.at_start(face, position, traced.rays.time[ray % len(traced.rays.time)], motions)
    intensity = echoes.intensity.copy()
    intensity[own] *= spread_factors(plan.surfaces, material[own], position.T + plan.frame, plan.seed)
    return replace(echoes, intensity=intensity)


def _ray_ends(rays: Rays, ray: Index, reach: Float) -> tuple[Float, Float]:
    """Return where rays end after ``reach``, and where they began, (3, N) local, m."""
    scanner = np.take(
        rays.origin.reshape(3, -1), ray if rays.origin.shape[1] > 1 else ray % len(rays.time), axis=1
    )
    return scanner + reach * np.take(rays.direction.reshape(3, -1), ray, axis=1), scanner


def _drop_lost_echoes(echoes: Echoes, lost: NDArray[np.bool_]) -> Echoes:
    """Return the echoes that are not lost at random, by their number within the pulse."""
    keep, number, _ = number_returns(echoes.pulse, lost.shape[1])
    chosen = np.flatnonzero(keep)
    chosen = chosen[~lost[echoes.pulse[chosen], number - 1]]
    return echoes.select(chosen)


def _points(
    plan: ScanPlan,
    strip: Strip,
    pulses: Pulses,
    traced: Traced,
    echoes: Echoes,
    errors: Errors,
    number_in_block: Index,
    motions: list[Track],
) -> tuple[PointBlock, SeenPoints | None, int]:
    """Return the points of the echoes, where they were seen, and how many of them saturated the detector."""
    keep, number, returns = number_returns(echoes.pulse, plan.most_returns)
    if not keep.all():
        echoes = echoes.select(keep)
    pulse, hit, target = echoes.pulse, echoes.hit, plan.target
    face, along = traced.pick("face", hit), traced.pick("along", hit)
    distance = echoes.range + plan.noise.range_bias
    if errors.range is not None:
        own = errors.range_errors(number_in_block[pulse], number, plan.most_returns)
        distance = distance + plan.setting.range_sigma * own
    intensity, clipped = saturate(echoes.intensity, np.inf if plan.detects_later else plan.setting.saturation)
    normal = None
    if plan.targets or "normal" in plan.wanted:
        normal = target.normals(face, along, pulses.time[pulse], motions)
        if plan.effects:
            air = np.flatnonzero(face < 0)
            normal[:, air] = -np.take(traced.rays.direction.reshape(3, -1), traced.ray_of(hit[air]), axis=1)
    measured = MeasuredPoints(plan, pulses, pulse, echoes.range, echoes.intensity, face, normal)
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
        **fill_layers(measured),
    )
    seen = None
    if plan.targets and normal is not None:
        ray, reach = traced.ray_of(hit), traced.pick("distance", hit)
        seen = _seen_targets(plan, traced.rays, ray, reach, face, normal, motions)
    return points, seen, clipped


def _seen_targets(
    plan: ScanPlan, rays: Rays, ray: Index, reach: Float, face: Index, normal: Float, motions: list[Track]
) -> SeenPoints:
    """Return where the points were seen, in the scene as it stands at the time 0: as it is rendered.

    That is on the surface that gave most of the return: the mean of all its hits may lie in the air between them.
    """
    target, time = plan.target, rays.time[ray % len(rays.time)]
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
