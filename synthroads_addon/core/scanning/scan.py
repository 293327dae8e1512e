"""One block of pulses, from the path to the points. Pure arrays: the caster is the only thing that knows the scene."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..cloud.points import PointBlock
from ..materials import Material
from ..random_streams import stream
from ..scene_mesh import SceneMesh
from .beam import beam_pattern
from .caster import Caster, FacePlanes
from .devices import ScannerSetting
from .path import FlightPath, Strip
from .pattern import Pulses, pulse_count, rotating_mirror
from .radiometry import lambert_intensity, lit_color, reflectivity
from .returns import Echoes, group_returns, number_returns

Float = NDArray[np.float64]

RAYS_PER_BLOCK = 2**18
"""Rays of one block at most; what keeps memory bounded. Fixed, as blocks carry their own random streams."""


@dataclass(frozen=True)
class Surfaces:
    """Constant materials by their index in the scene mesh: (M, 3) base colour, (M,) metallic, (M,) specular."""

    base_color: Float
    metallic: Float
    specular: Float

    @cached_property
    def reflectivity(self) -> Float:
        """Return R of each material, (M,)."""
        return reflectivity(self.base_color, self.metallic, self.specular)


def surfaces_of(rows: Iterable[Material]) -> Surfaces:
    """Return the constants of materials in the order of the scene mesh's."""
    rows = list(rows)
    return Surfaces(
        np.array([row.base_color for row in rows], dtype=np.float64).reshape(-1, 3),
        np.array([row.metallic for row in rows], dtype=np.float64),
        np.array([row.specular for row in rows], dtype=np.float64),
    )


@dataclass(frozen=True)
class Scan:
    """All that the blocks of one scan share.

    Attributes:
        noise: whether the range noise is added.
        attenuation: 1/m of range.
    """

    mesh: SceneMesh
    surfaces: Surfaces
    caster: Caster
    setting: ScannerSetting
    path: FlightPath
    rays_per_pulse: int
    seed: int
    attenuation: float = 0.0
    planes: FacePlanes = field(init=False)
    bounds: Float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "planes", FacePlanes(self.mesh))
        vertices = self.mesh.vertices
        bounds = np.array([vertices.min(axis=0), vertices.max(axis=0)], dtype=np.float64) if len(vertices) else None
        object.__setattr__(self, "bounds", bounds)

    @property
    def pulses_per_block(self) -> int:
        """Return the fixed number of pulses of a block."""
        return max(1, RAYS_PER_BLOCK // self.rays_per_pulse)

    def blocks(self) -> list[tuple[Strip, int]]:
        """Return (strip, number) of every block, in the order of time."""
        size = self.pulses_per_block
        return [
            (strip, block)
            for strip in self.path.strips
            for block in range(-(-pulse_count(self.setting, strip) // size))
        ]


@dataclass(frozen=True)
class BlockResult:
    """The points of one block and what was counted on the way."""

    points: PointBlock
    pulses: int
    rays: int
    below_threshold: int


def scan_block(scan: Scan, strip: Strip, block: int) -> BlockResult:
    """Scan one block; blocks can be computed in any order and by any worker."""
    first = block * scan.pulses_per_block
    count = min(scan.pulses_per_block, pulse_count(scan.setting, strip) - first)
    return scan_pulses(scan, strip, first, count, stream(scan.seed, "range noise", strip.index, block))


def scan_pulses(scan: Scan, strip: Strip, first: int, count: int, noise: np.random.Generator) -> BlockResult:
    """Scan pulses ``first`` to ``first + count`` of a strip; memory grows with their number."""
    pulses = rotating_mirror(scan.setting, scan.path, strip, first, count)
    # Drawn for every pulse and return there could be, so that one more return leaves the others' noise alone.
    errors = noise.normal(size=(count, scan.setting.device.maximum_returns))
    facing = _reaching_scene(scan, pulses)
    pulses = Pulses(*(getattr(pulses, name)[facing] for name in Pulses.__dataclass_fields__))
    directions = beam_directions(scan, pulses)
    faces = _cast(scan, pulses, directions)
    echoes, rays = _echoes(scan, pulses, directions, faces)
    strong = echoes.intensity >= scan.setting.threshold
    points = _points(scan, strip, pulses, echoes, rays, np.flatnonzero(strong), errors[facing])
    return BlockResult(points, count, faces.size, int(np.count_nonzero(~strong)))


def beam_directions(scan: Scan, pulses: Pulses) -> Float:
    """Return unit directions (P, K, 3) of the rays that sample each pulse's footprint."""
    pattern = beam_pattern(scan.rays_per_pulse)
    if scan.rays_per_pulse == 1:
        return pulses.direction[:, None, :]
    # The full angle at 1/e^2 is twice the radius; tangent, since the footprint is measured across the axis.
    radius = np.tan(np.array(scan.setting.divergence) / 2.0)
    x, y = (pattern.across * radius).T
    rays = (
        pulses.direction[:, None, :]
        + x[None, :, None] * pulses.in_plane[:, None, :]
        + y[None, :, None] * pulses.across[:, None, :]
    )
    return np.asarray(rays / np.sqrt(1.0 + x * x + y * y)[None, :, None])


def _reaching_scene(scan: Scan, pulses: Pulses) -> NDArray[np.bool_]:
    """Return the mask (P,) of pulses whose cone meets the scene's bounding box at all: the rest need no rays."""
    if scan.bounds is None:
        return np.zeros(len(pulses.time), dtype=bool)
    reach = scan.setting.maximum_range
    margin = reach * max(scan.setting.divergence) * 2.0
    low, high = scan.bounds[0] - margin, scan.bounds[1] + margin
    # 0 * inf cannot occur: a direction component of 0 is moved off by less than a rounding error.
    direction = np.where(np.abs(pulses.direction) < 1e-300, 1e-300, pulses.direction)
    with np.errstate(over="ignore"):
        near, far = (low - pulses.origin) / direction, (high - pulses.origin) / direction
    enter = np.minimum(near, far).max(axis=1)
    leave = np.maximum(near, far).min(axis=1)
    return np.asarray((leave >= np.maximum(enter, 0.0)) & (enter <= reach))


def _cast(scan: Scan, pulses: Pulses, directions: Float) -> NDArray[np.int32]:
    """Return the faces (P, K) that the rays hit."""
    count, rays = directions.shape[:2]
    origins = np.repeat(pulses.origin.astype(np.float32), rays, axis=0)
    flat = np.ascontiguousarray(directions.reshape(-1, 3), dtype=np.float32)
    return scan.caster.cast(origins, flat, scan.setting.maximum_range).reshape(count, rays)


@dataclass(frozen=True)
class _Rays:
    """What is known of each ray that hit: face, cosine and normal; `slot` maps flat ray indices to rows."""

    face: NDArray[np.int32]
    cosine: Float
    normal: Float
    slot: NDArray[np.intp]


def _echoes(scan: Scan, pulses: Pulses, directions: Float, faces: NDArray[np.int32]) -> tuple[Echoes, _Rays]:
    """Return the returns of a block, before the threshold, and the rays that they stem from."""
    hit = np.flatnonzero(faces.ravel() >= 0)
    face = faces.ravel()[hit]
    owner = hit // faces.shape[1]
    distance, cosine, normal = scan.planes.ranges(face, pulses.origin[owner], directions.reshape(-1, 3)[hit])
    share = beam_pattern(scan.rays_per_pulse).weights[hit % faces.shape[1]]
    reflectance = scan.surfaces.reflectivity[scan.mesh.material[face]]
    within = np.isfinite(distance) & (distance >= scan.setting.minimum_range)
    within &= distance <= scan.setting.maximum_range
    ranges = np.full(faces.shape, np.inf)
    weights, energy = np.zeros(faces.shape), np.zeros(faces.shape)
    ranges.ravel()[hit] = np.where(within, distance, np.inf)
    weights.ravel()[hit] = share * np.maximum(reflectance, 1e-6)
    energy.ravel()[hit] = np.where(
        within, share * lambert_intensity(reflectance, cosine, distance, scan.attenuation), 0.0
    )
    slot = np.full(faces.size, -1, dtype=np.intp)
    slot[hit] = np.arange(len(hit))
    echoes = group_returns(ranges, weights, energy, scan.setting.range_resolution)
    return echoes, _Rays(face, cosine, normal, slot)


def _points(
    scan: Scan,
    strip: Strip,
    pulses: Pulses,
    echoes: Echoes,
    rays: _Rays,
    strong: NDArray[np.intp],
    errors: Float,
) -> PointBlock:
    """Return the points of the echoes above the threshold, with range noise."""
    keep, number, returns = number_returns(echoes.pulse[strong], scan.setting.device.maximum_returns)
    chosen = strong[keep]
    pulse, row = echoes.pulse[chosen], rays.slot[echoes.ray[chosen]]
    face = rays.face[row]
    distance = echoes.range[chosen] + scan.setting.range_sigma * errors[pulse, number - 1]
    local = pulses.origin[pulse] + distance[:, None] * pulses.direction[pulse]
    return PointBlock(
        xyz=local + scan.mesh.origin,
        intensity=echoes.intensity[chosen],
        rgb=lit_color(scan.surfaces.base_color[scan.mesh.material[face]], rays.normal[row]),
        class_id=scan.mesh.class_id[face],
        instance_id=scan.mesh.instance_id[face],
        return_number=number,
        number_of_returns=returns,
        gps_time=pulses.time[pulse],
        scan_angle_deg=np.rad2deg(pulses.scan_angle[pulse]).astype(np.float32),
        strip=np.full(len(chosen), strip.index, dtype=np.uint16),
        range=distance,
        incidence_deg=np.rad2deg(np.arccos(rays.cosine[row])).astype(np.float32),
    )
