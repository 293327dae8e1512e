"""Images, pixel by pixel: rays of the lens, cast at the scene at each row's own time.

Truth (depth, normal, class, instance) is what the ray through a pixel's middle meets, in the middle of its row's
exposure; behind leaves and panes it is the first surface by which half of the light is taken. The colour is the mean
of several rays, spread over the pixel and, with motion blur, over the exposure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arithmetic.loops import loops_by
from ...base.arithmetic.noise import noise_by
from ...base.arrays import Bool, Float, Float32, Index, UInt8
from ...base.classes import UNLABELLED
from ...base.machine import available_cores, linear_algebra_on_one_thread
from ...base.random_streams import stream
from ..colour.colour import LayerSource, SeenPoints, sample_points
from ..colour.light import sun_direction
from ..plan import ScanPlan
from ..platforms.path import Strip
from ..pulses import Poses, turn_vectors
from ..scene.gaps import LeafGaps
from ..stages.emission import PulseEmitter
from ..trace import Openings, Rays, TracedRays, trace
from .choice import CameraChoice
from .exposures import Exposure, RigPoses
from .lens import pixel_centres
from .rig import MountedCamera
from .sensor import encode_8_bit, linear_colours, sensed
from .sky import Surroundings

RAYS_AT_ONCE = 1 << 18
"""Rays that are followed together; what keeps memory bounded."""
_HALF = 0.5
"""Share of the light that has to be taken for a surface to be what a pixel shows."""
_FAINT = 0.01
"""Share of a ray's light below which the colour of a surface isn't worked out: less than 8 bits show."""
_METERED = 24
"""Places of each row and column at which an image's brightness is metered."""
_MIDDLE_GREY = 0.22
"""Mean linear light of a picture that meters aim at. Chosen: about the 18 % of grey cards, with some sky."""
_MOST_STOPS = 2.0
"""Stops by which metering changes the exposure at most. Chosen: night stays darker than day."""
_OFF_SURFACE = 1e-3
"""How far from its surface a ray towards the sun begins, m."""


class Image(NamedTuple):
    """One image: what its pixels show.

    Attributes:
        rgb: (H, W, 3) uint8 sRGB; None if it wasn't asked for.
        depth: (H, W) float32 distance from the optical centre along the ray, m; 0 where no surface is met.
        normal: (H, W, 3) float32 unit normals towards the camera, local axes; 0 where no surface is met.
        class_id: (H, W) uint8 as the points of a scan have it; unlabelled where no surface is met.
        instance_id: (H, W) uint32; 0 where no surface is met.
        stops: by how many the picture is exposed brighter than the scene's usual light asks for.
    """

    rgb: UInt8 | None
    depth: Float32
    normal: Float32
    class_id: UInt8
    instance_id: NDArray[np.uint32]
    stops: float = 0.0


class _Aimed(NamedTuple):
    """Rays (N,) of places in an image; those that see nothing are left out.

    Attributes:
        rows: (N,) which of the places they are of.
        rays: origins, directions and times.
    """

    rows: Index
    rays: Rays


@dataclass(frozen=True)
class Shooter:
    """Cameras in the scene of a scan's plan.

    Attributes:
        plan: the scan: its scene, path and materials.
        choice: what is wanted of the images.
        poses: of the cameras.
        source: of colours; None without pictures.
        surroundings: what is seen beyond the scene; None without light.
    """

    plan: ScanPlan
    choice: CameraChoice
    poses: RigPoses
    source: LayerSource | None = None
    surroundings: Surroundings | None = None

    def shoot(self, camera: MountedCamera, exposure: Exposure) -> Image:
        """Return the image that a camera takes at an exposure.

        Where colours are rendered or the caster needs it, it must run in Blender's main thread.
        """
        lens, height = camera.lens, camera.lens.height
        samples = self.choice.samples if self.source is not None else 1
        rows = max(1, RAYS_AT_ONCE // (lens.width * samples))
        starts = range(0, height, rows)
        moments = self._moments(camera, exposure)
        with self._kernels():
            stops = self._stops(camera, exposure, moments)
            tasks = [(camera, exposure, moments, stops, first, min(first + rows, height)) for first in starts]
            if self._single:
                parts = [self._part(*task) for task in tasks]
            else:
                with ThreadPoolExecutor(self.plan.run.threads or available_cores()) as pool:
                    parts = list(pool.map(lambda task: self._part(*task), tasks))
        arrays = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("rgb", "depth", "normal", "class_id", "instance_id")
            if getattr(parts[0], name) is not None
        }
        return Image(**{"rgb": None} | arrays, stops=stops)

    def _stops(self, camera: MountedCamera, exposure: Exposure, moments: Poses) -> float:
        """Return by how many stops an image is brighter than the scene's light asks for: as wanted, and by metering.

        The meter takes the mean light of the whole image, at places of a coarse grid, for middle grey.
        """
        compensation = self.choice.exposure_compensation
        if self.source is None or not self.choice.auto_exposure or self.surroundings is None:
            return compensation
        lens = camera.lens
        share = (np.arange(_METERED) + 0.5) / _METERED
        column, row = (grid.ravel() for grid in np.meshgrid(share * lens.width, share * lens.height))
        place = np.stack([column, row])
        seen = np.flatnonzero(~np.isnan(lens.rays(place)[0]))
        time = np.full(len(seen), exposure.time)
        light = float(self._colours(camera, moments, place[:, seen], time).mean()) if len(seen) else 0.0
        metered = math.log2(_MIDDLE_GREY / light) if light > 0.0 else 0.0
        return compensation + min(max(metered, -_MOST_STOPS), _MOST_STOPS)

    @property
    def _single(self) -> bool:
        """Return whether the calling thread alone may work: the caster or the colours need the main thread."""
        return self.plan.target.caster.main_thread_only or (self.source is not None and self.source.calls is not None)

    @contextmanager
    def _kernels(self) -> Iterator[None]:
        """Context in which compiled loops are used as in the scan."""
        with ExitStack() as stack:
            for context in (linear_algebra_on_one_thread(), noise_by(self.plan.noise_kernel)):
                stack.enter_context(context)
            stack.enter_context(loops_by(self.plan.point_loops))
            yield

    @cached_property
    def _lowest(self) -> float:
        """Return the height of the scene's lowest place, m, at which the plain ground beyond it lies."""
        vertices = self.plan.target.static.vertices
        return float(vertices[:, 2].min()) if len(vertices) else 0.0

    @cached_property
    def _emitter(self) -> PulseEmitter:
        """Return what knows the poses of scanner and moving parts."""
        return PulseEmitter(self.plan)

    def _moments(self, camera: MountedCamera, exposure: Exposure) -> Poses:
        """Return the tracks of the scanner and of what moves, during an exposure."""
        half = (camera.readout + (camera.exposure if camera.blur else 0.0)) / 2.0
        # In another strip object of the same index where a section's path is a stretch.
        return self._emitter.poses_between(self._strip(exposure), exposure.time - half, exposure.time + half)

    def _strip(self, exposure: Exposure) -> Strip:
        """Return the strip of the plan's path in which an exposure lies."""
        return next(strip for strip in self.plan.path.strips if strip.index == exposure.strip.index)

    def _part(
        self, camera: MountedCamera, exposure: Exposure, moments: Poses, stops: float, first: int, last: int
    ) -> Image:
        """Return the rows `first` to `last` (exclusive) of an image, exposed by so many stops more than usual."""
        lens = camera.lens
        shape = (last - first, lens.width)
        middle = pixel_centres(lens, first, last)
        row_time = exposure.time + camera.readout * ((np.floor(middle[1]) + 0.5) / lens.height - 0.5)
        truth = self._truth(camera, moments, middle, row_time, shape)
        if self.source is None:
            return truth
        linear = np.zeros((middle.shape[1], 3), np.float32)
        random = stream(self.plan.run.seed, "image", camera.index, exposure.number, first)
        count = self.choice.samples
        across = max(1, int(math.sqrt(count)))
        place = np.repeat(middle, count, axis=1)
        time = np.repeat(row_time, count)
        number = np.tile(np.arange(count), middle.shape[1])
        jitter = random.random((3, place.shape[1]))
        # Cells of the pixel in turn, a random place in each: as many cells as fill whole rows, the rest anywhere.
        cells = across * (count // across)
        column, line = number % across, number // across
        in_cell = number < cells
        down = count // across
        place[0] += np.where(in_cell, (column + jitter[0]) / across, jitter[0]) - 0.5
        place[1] += np.where(in_cell, (line + jitter[1]) / down, jitter[1]) - 0.5
        if camera.blur:
            # Each ray of a pixel has a part of the exposure of its own; which one differs from pixel to pixel.
            turn = np.repeat(random.integers(0, count, middle.shape[1]), count)
            time = time + camera.exposure * (((number + turn) % count + jitter[2]) / count - 0.5)
        for start in range(0, place.shape[1], RAYS_AT_ONCE):
            chunk = slice(start, start + RAYS_AT_ONCE)
            colours = self._colours(camera, moments, place[:, chunk], time[chunk])
            pixel = np.arange(start, start + len(colours)) // count
            for channel in range(3):
                linear[:, channel] += np.bincount(pixel, colours[:, channel], minlength=len(linear)).astype(np.float32)
        linear /= np.float32(count)
        noisy = sensed(linear, camera.camera, self.choice.noise, stops, random)
        noisy[np.isnan(lens.rays(middle)[0])] = 0.0
        return truth._replace(rgb=encode_8_bit(noisy).reshape(*shape, 3))

    def _aim(self, camera: MountedCamera, moments: Poses, place: Float, time: Float) -> _Aimed:
        """Return the rays of places (2, N), px, in an image at times (N,), s."""
        direction = camera.lens.rays(place)
        rows = np.flatnonzero(~np.isnan(direction[0]))
        direction, time = np.take(direction, rows, axis=1), np.take(time, rows)
        offset, turn = self.poses.camera_from_scanner(camera)
        rotation, position, _ = moments.true.at(time) if len(time) else (np.zeros((9, 0)), np.zeros((3, 0)), None)
        in_scanner = turn @ direction
        origin = position + turn_vectors(rotation, np.repeat(offset[:, None], len(time), axis=1))
        local = turn_vectors(rotation, in_scanner)
        local /= np.sqrt(local[0] ** 2 + local[1] ** 2 + local[2] ** 2)
        return _Aimed(rows, Rays(origin[:, None], local[:, None], np.ones((1, 1)), time))

    def _traced(self, rays: Rays, moments: Poses, angle: float) -> TracedRays:
        """Return what rays meet, of pixels of an angle, rad."""
        plan = self.plan
        return trace(
            plan.target,
            plan.reflection.surfaces,
            rays,
            moments.motions,
            0.0,
            self.choice.farthest,
            openings=self._openings(angle),
        )

    def _openings(self, angle: float) -> Openings | None:
        """Return where the scene's materials are open for rays of pixels of an angle, rad."""
        openings, gaps = self.plan.openings, self.plan.gaps
        if openings is None or gaps is None:
            return openings
        return openings._replace(gaps=LeafGaps(angle * angle, gaps.key, gaps.frame_origin))

    def _truth(self, camera: MountedCamera, moments: Poses, place: Float, time: Float, shape: tuple[int, int]) -> Image:
        """Return the truth of places (2, N), px, at times (N,), s, as an image of this shape, without colours."""
        count = place.shape[1]
        depth, normal = np.zeros(count, np.float32), np.zeros((count, 3), np.float32)
        class_id, instance_id = np.full(count, UNLABELLED, np.uint8), np.zeros(count, np.uint32)
        aimed = self._aim(camera, moments, place, time)
        if len(aimed.rows):
            traced = self._traced(aimed.rays, moments, camera.lens.pixel_angle)
            ray, hit = _shown(traced)
            rows, target = aimed.rows[ray], self.plan.target
            face, cosine, times = traced.pick("face", hit), traced.pick("cosine", hit), traced.times(hit)
            depth[rows] = traced.pick("distance", hit)
            normal[rows] = target.normals(face, cosine, times, moments.motions).T
            class_id[rows] = target.face_values("class_id", face)
            instance_id[rows] = target.instances(face, times)
        return Image(
            None,
            depth.reshape(shape),
            normal.reshape(*shape, 3),
            class_id.reshape(shape),
            instance_id.reshape(shape),
        )

    def _colours(self, camera: MountedCamera, moments: Poses, place: Float, time: Float) -> Float32:
        """Return the linear colours (N, 3) of places (2, N), px, at times (N,), s; 0 where they see nothing."""
        result = np.zeros((place.shape[1], 3), np.float32)
        aimed = self._aim(camera, moments, place, time)
        if not len(aimed.rows):
            return result
        angle = camera.lens.pixel_angle / math.sqrt(self.choice.samples)
        traced = self._traced(aimed.rays, moments, angle)
        share = np.concatenate(
            [np.broadcast_to(traced.first.share, traced.first.face.shape).ravel(), np.ravel(traced.behind.share)]
        )
        distance = np.concatenate([traced.first.distance.ravel(), traced.behind.distance])
        hits = np.flatnonzero((distance < np.inf) & (share > _FAINT))
        colours = np.zeros((len(aimed.rows), 3), np.float32)
        met: Float = np.zeros(len(aimed.rows))
        if len(hits):
            ray, light = traced.ray_of(hits), share[hits]
            seen = self._seen(traced, hits, moments)
            assert self.source is not None
            values = linear_colours(sample_points(self.source, seen, frozenset({"rgb"})).arrays["rgb"])  # type: ignore[arg-type]
            if self.surroundings is not None:
                values = self.surroundings.through_air(values, distance[hits])
            met = np.asarray(np.bincount(ray, light, minlength=len(met)), np.float64)
            for channel in range(3):
                colours[:, channel] = np.bincount(ray, light * values[:, channel], minlength=len(met))
        if self.surroundings is not None:
            open_rays = np.flatnonzero(met < 1.0 - _FAINT)
            directions = np.take(aimed.rays.direction[:, 0], open_rays, axis=1)
            left = (1.0 - met[open_rays]).astype(np.float32)[:, None]
            height = aimed.rays.origin[2, 0, open_rays] - self._lowest
            colours[open_rays] += left * self.surroundings.colours(directions, height)
        result[aimed.rows] = colours
        return result

    def _seen(self, traced: TracedRays, hits: Index, moments: Poses) -> SeenPoints:
        """Return the surface points of chosen hits, in the scene at time 0, as materials are evaluated."""
        target, time = self.plan.target, traced.times(hits)
        face, cosine = traced.pick("face", hits), traced.pick("cosine", hits)
        normal = target.normals(face, cosine, time, moments.motions)
        position, camera = traced.ends(hits)
        sunlit = self._sunlit(position, normal, time, moments)
        if target.moving:
            vectors = (camera - position, normal)
            position, offset, normal = target.at_time_zero(face, position, time, moments.motions, vectors)
            camera = position + offset
        return SeenPoints(
            position=np.ascontiguousarray(position.T),
            scanner=np.ascontiguousarray(camera.T),
            normal=np.ascontiguousarray(normal.T),
            material=target.face_values("material", face),
            time=time,
            face=face,
            sunlit=sunlit,
        )

    def _sunlit(self, position: Float, normal: Float, time: Float, moments: Poses) -> Bool | None:
        """Return a mask (N,) of the places (3, N) that the sun reaches; None without light."""
        request = self.plan.layers.request
        if self.surroundings is None or request is None:
            return None
        sun = sun_direction(request.environment)
        facing = np.flatnonzero(sun[0] * normal[0] + sun[1] * normal[1] + sun[2] * normal[2] > 0.0)
        result = np.zeros(position.shape[1], bool)
        begin = np.take(position, facing, axis=1) + _OFF_SURFACE * np.take(normal, facing, axis=1)
        result[facing] = self.plan.target.unobstructed(begin, sun, time[facing], moments.motions)
        return result


def _shown(traced: TracedRays) -> tuple[Index, Index]:
    """Return the rays (M,) that show a surface, and the number (M,) of the hit that each shows.

    It is the first hit along the ray with which half of the light is taken.
    """
    first_distance, first_share = (
        traced.first.distance.ravel(),
        np.broadcast_to(traced.first.share, traced.first.face.shape).ravel(),
    )
    is_first = (first_distance < np.inf) & (first_share >= _HALF)
    ray, hit = np.flatnonzero(is_first), np.flatnonzero(is_first)
    if not len(traced.ray):
        return ray, hit
    # Hits behind stand in the order of the layers: for each ray in the order in which it meets them.
    order = np.argsort(traced.ray, kind="stable")
    behind_ray, share = traced.ray[order], traced.behind.share[order]
    taken = np.where(first_distance < np.inf, first_share, 0.0)
    starts = np.concatenate(([True], behind_ray[1:] != behind_ray[:-1]))
    total = np.cumsum(share)
    group = np.cumsum(starts) - 1
    before = (total - share)[starts]
    along = total - before[group] + taken[behind_ray]
    fits = (along >= _HALF) & ~is_first[behind_ray]
    candidates = np.flatnonzero(fits)
    chosen_ray, index = np.unique(behind_ray[candidates], return_index=True)
    chosen = order[candidates[index]] + traced.first.face.size
    return np.concatenate([ray, chosen_ray]), np.concatenate([hit, chosen])
