"""Target of rays: the static scene and what moves in it, their faces numbered one after the other."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import AnyArray, Bool, Float, Float32, Index, UInt8
from ...base.classes import UNLABELLED
from ...cloud.points import NO_MATERIAL
from ...road.network.places import RoadPlaces
from ..knots import PoseCache, Track, track_knots
from .bundles import Bundles
from .caster import Caster, FacePlanes, as_rows
from .mesh import SceneMesh
from .motion import MovingMesh, ScannedScene
from .sun_columns import SunColumns

SUN_REACH = 2000.0
"""How far away something may stand that throws a shadow, m."""
CLEARANCE = np.array([2.5, 1.0, 3.0])
"""Room that a vehicle which carries the scanner takes around it: half its length and width, and its height, m."""

_NO_FACE = {"class_id": UNLABELLED, "instance_id": 0, "material": NO_MATERIAL, "damage": 0}


@dataclass(frozen=True)
class TargetPart:
    """One mesh of the target, static or moving, with its caster, its face planes and its bounds.

    Attributes:
        first: number of its first face among all.
        half: (3,) half the size of the box around ``centre`` (body frame) that holds it, m.
        radius: of the sphere that holds it, m.
    """

    caster: Caster
    planes: FacePlanes
    first: int
    count: int
    centre: Float
    half: Float
    radius: float


class FirstHits(NamedTuple):
    """First hits of rays; one value per ray, in the shape of the rays.

    Attributes:
        face: number among all faces of the target, -1 for none.
        distance: m, inf for none.
        cosine: n . d of the face's normal and the ray.
    """

    face: Index
    distance: Float
    cosine: Float

    def take(self, rays: Index) -> "FirstHits":
        """Return the hits of chosen rays, by indices into the last axis."""
        take = partial(np.take, indices=rays, axis=-1)
        return FirstHits(take(self.face), take(self.distance), take(self.cosine))


class Target:
    """A scene to cast rays at: a static mesh and moving ones, their faces numbered one after the other.

    Args:
        scene: static mesh and moving ones.
        make_caster: gives a caster of a mesh.
        damages: what instance numbers are of, as `road.damage.DAMAGES` numbers it; of no other there is damage.
        truth: of the changes to another epoch; None where none is known.
        places: of points along the scene's roads; None where points needn't know them.

    Attributes:
        class_id: (F,) uint8 of all faces.
        instance_id: (F,) uint32.
        material: (F,) uint16 indices into ``materials``.
        damage: (F,) uint8.
        static: the mesh of what stands.
        origin: (3,) float64 map coordinates of the local origin, m.
        caster: the static mesh's.
        bounds: (2, 3) float64 smallest and largest corner of the static mesh, m; None without vertices.
    """

    def __init__(
        self,
        scene: ScannedScene,
        make_caster: Callable[[SceneMesh], Caster],
        damages: Mapping[int, int] | None = None,
        truth: Any = None,
        places: RoadPlaces | None = None,
    ) -> None:
        self.static = static = scene.static
        self.truth, self.places = truth, places
        self.materials = static.materials
        self.origin = static.origin
        self.moving: tuple[MovingMesh, ...] = scene.moving
        self._poses = [PoseCache(part.motion.pose) for part in scene.moving]
        meshes = [static, *(part.mesh for part in scene.moving)]
        self.class_id = _join_arrays([mesh.class_id for mesh in meshes])
        self.instance_id = _join_arrays([mesh.instance_id for mesh in meshes])
        self.material = _join_arrays([mesh.material for mesh in meshes])
        self.damage = _damage_of(self.instance_id, damages or {})
        self.triangles = len(self.class_id)
        self.vertices = sum(len(mesh.vertices) for mesh in meshes)
        firsts = np.cumsum([0, *(len(mesh.triangles) for mesh in meshes)])
        self._parts = [
            _part(mesh, make_caster(mesh), int(first)) for mesh, first in zip(meshes, firsts[:-1], strict=True)
        ]
        self.caster = self._parts[0].caster
        self.bounds = static.vertex_bounds()
        self._columns = SunColumns(static, self._parts[0].planes)

    def face_values(self, name: str, faces: Index) -> AnyArray:
        """Return ``class_id``, ``instance_id``, ``material`` or ``damage`` of faces (H,); that of no face for -1."""
        values = getattr(self, name)
        if not len(faces) or faces.min() >= 0:
            return np.asarray(values[faces])
        result = values[np.maximum(faces, 0)]
        result[faces < 0] = _NO_FACE[name]
        return np.asarray(result)

    def instances(self, faces: Index, times: Float) -> AnyArray:
        """Return the instance numbers (H,) of faces (H,) met at times (H,), s; a vehicle has one for each pass."""
        result = np.array(self.face_values("instance_id", faces), dtype=np.uint32)
        for number, rows in self._on_moving(faces):
            part = self.moving[number]
            if part.again is None:
                continue
            passes = part.motion.passes(times[rows])
            returned = passes > 0
            result[rows[returned]] = part.again.first + (passes[returned] - 1) * part.again.step
        return result

    def motions(self, begin: float, end: float, spacing: float, carrier: Track | None = None) -> list[Track]:
        """Return the tracks of the moving parts between two times, s, on knots ``spacing`` (s) apart.

        Args:
            begin, end: times, s.
            spacing: s.
            carrier: track of the scanner, if a vehicle carries it. Vehicles that would drive through this one are
                absent meanwhile, as their ways take no account of it.
        """
        tracks = [poses.track(begin, end, spacing) for poses in self._poses]
        if carrier is None or not tracks:
            return tracks
        _, scanner, _ = carrier.at(track_knots(begin, end, spacing))
        return [_clear_scanner(track, part, scanner) for track, part in zip(tracks, self._parts[1:], strict=True)]

    def moving_bounds(self, motions: list[Track]) -> list[Float]:
        """Return the box (2, 3), m, that each moving part sweeps through, less parts that are never there."""
        moving = zip(self._parts[1:], motions, strict=True)
        boxes = (track.swept_box(part.centre, part.radius) for part, track in moving)
        return [box for box in boxes if box is not None]

    def cast(
        self, origins: Float, directions: Float, maximum_range: float, times: Float, motions: list[Track]
    ) -> FirstHits:
        """Return the first hit of each ray (face, range, n . d), on the static mesh or a moving one.

        Args:
            origins: (3, ...) float64, local; of the directions' shape, or one that spreads to it.
            directions: (3, ...) unit vectors.
            maximum_range: m.
            times: (...) when each ray is cast, s; spreads likewise.
            motions: see `motions`; they must span ``times``.
        """
        static_hits = _cast(self._parts[0], origins, directions, maximum_range)
        if not self.moving:
            return static_hits
        shape = directions.shape
        flat_origins = np.broadcast_to(origins, shape).reshape(3, -1)
        flat_directions, flat_times = directions.reshape(3, -1), np.broadcast_to(times, shape[1:]).ravel()
        nearest_hits = FirstHits(static_hits.face.ravel(), static_hits.distance.ravel(), static_hits.cosine.ravel())
        rays = Bundles.gather(
            flat_origins, flat_directions, flat_times, np.minimum(nearest_hits.distance, maximum_range)
        )
        for part, track in zip(self._parts[1:], motions, strict=True):
            if track.present.any():
                _cast_moving(part, track, rays, maximum_range, nearest_hits)
        ray_shape = shape[1:]
        return FirstHits(
            nearest_hits.face.reshape(ray_shape),
            nearest_hits.distance.reshape(ray_shape),
            nearest_hits.cosine.reshape(ray_shape),
        )

    def unobstructed(
        self, origins: Float, direction: Float, times: Float, motions: list[Track], reach: float = SUN_REACH
    ) -> Bool:
        """Return a mask (N,) of the places from which nothing blocks the view in a direction within ``reach`` (m).

        Args:
            origins: (3, N) local, m, a little off the surfaces that they lie on.
            direction: (3,) unit vector.
            times: (N,) s.
            motions: see `motions`.
            reach: how far is looked, m.
        """
        towards = np.broadcast_to(direction[:, None], origins.shape)
        # Columns clear most places without a ray; rays are cast from the others.
        is_free = self._columns.clear(origins, direction)
        if is_free is None:
            is_free = ~self.caster.occluded(as_rows(origins), as_rows(towards), reach)
        elif len(rows := np.flatnonzero(~is_free)):
            begin = as_rows(np.take(origins, rows, axis=1))
            is_free[rows] = ~self.caster.occluded(begin, as_rows(towards[:, : len(rows)]), reach)
        if not self.moving or not len(times):
            return is_free
        rays = Bundles.gather(origins, towards, times, np.full(len(times), reach))
        for part, track in zip(self._parts[1:], motions, strict=True):
            if track.present.any():
                _clear_blocked(part, track, rays, reach, is_free)
        return is_free

    def unblocked(self, origins: Float, directions: Float, reach: Float) -> Bool:
        """Return a mask (K, N) of the rays that meet nothing of the static mesh within their reach.

        Args:
            origins: (3, 1 or K, N) local, m.
            directions: (3, K, N) unit vectors.
            reach: (K, N) m.
        """
        limit = np.array(reach.T, np.float32, order="C").ravel()
        blocked = self.caster.occluded(*_as_rays(origins, directions), limit)
        return ~blocked.reshape(reach.shape[::-1]).T

    def near_moving(
        self, origins: Float, directions: Float, reach: Float, times: Float, motions: list[Track], radius: float
    ) -> Bool:
        """Return a mask (N,) of the rays that pass a moving part's box by less than a radius (m), or through it.

        Args:
            origins: (3, N) local, m.
            directions: (3, N) unit vectors.
            reach: (N,) how far they go, m.
            times: (N,) s.
            motions: see `motions`.
            radius: m.
        """
        is_near = np.zeros(len(times), bool)
        if not self.moving or not len(times):
            return is_near
        rays = Bundles.gather(origins, directions, times, reach)
        for part, track in zip(self.moving_parts, motions, strict=True):
            if not track.present.any():
                continue
            # A sphere around the part's whole way first: few rays are left for the box.
            indices = rays.rays_near(track, part.centre, part.radius + radius)
            rotation, position, presence = track.at(times[indices])
            indices, rotation, position = indices[presence], rotation[:, presence], position[:, presence]
            # Rays in the part's frame at their times, p' = R^T (p - t), from the box's centre.
            start = _unrotate(rotation, origins[:, indices] - position) - part.centre[:, None]
            direction = _unrotate(rotation, directions[:, indices])
            is_near[indices[_crosses_box(start, direction, reach[indices], part.half + radius)]] = True
        return is_near

    def at_time_zero(
        self, faces: Index, places: Float, times: Float, motions: list[Track], vectors: tuple[Float, ...] = ()
    ) -> tuple[Float, ...]:
        """Return places on faces (3, H), m, and vectors there, moved to where the scene has them at time 0.

        Args:
            faces: (H,).
            places: (3, H) local, m, at ``times``.
            times: (H,) s.
            motions: see `motions`.
            vectors: (3, H) each; turned only.
        """
        results = (places.copy(), *(vector.copy() for vector in vectors))
        for number, rows in self._on_moving(faces):
            rotation, place, _ = motions[number].at(times[rows])
            begin_rotation, begin_place, _ = self.moving[number].motion.pose(np.zeros(1))
            local = _unrotate(rotation, places[:, rows] - place)
            results[0][:, rows] = begin_rotation[0] @ local + begin_place[0][:, None]
            for result, vector in zip(results[1:], vectors, strict=True):
                result[:, rows] = begin_rotation[0] @ _unrotate(rotation, vector[:, rows])
        return results

    @property
    def moving_parts(self) -> list[TargetPart]:
        """Return the moving parts, in the order of ``moving``."""
        return self._parts[1:]

    @property
    def static_planes(self) -> Float:
        """Return the planes (F, 4) of the static mesh's faces, see `FacePlanes`."""
        return self._parts[0].planes.planes

    def static_normals(self, faces: Index) -> Float:
        """Return the local unit normals (3, H) of faces of the static mesh, on the side that these are seen from."""
        return np.ascontiguousarray(np.take(self._parts[0].planes.planes, faces, axis=0)[:, :3].T)

    def normals(self, faces: Index, cosine: Float, times: Float, motions: list[Track]) -> Float:
        """Return the local unit normals (3, H) of faces on the side that rays came from; for the face -1 any normal.

        Args:
            faces: (H,).
            cosine: (H,) n . d of the faces' normals and the rays that met them.
            times: (H,) when they did, s.
            motions: see `motions`.
        """
        static = self._parts[0]
        # Of faces that move these mean nothing, and are replaced below.
        result = static.planes.normals(faces, cosine) if static.count else np.empty((3, len(faces)))
        for number, rows in self._on_moving(faces):
            part = self._parts[number + 1]
            normal = part.planes.normals(faces[rows] - part.first, cosine[rows])
            rotation, _, _ = motions[number].at(times[rows])
            result[:, rows] = np.einsum("ijn,jn->in", rotation.reshape(3, 3, -1), normal)
        return result

    def _on_moving(self, faces: Index) -> Iterator[tuple[int, Index]]:
        """Yield, for each moving part that is among faces (H,), its number and the rows (M,) of its faces."""
        if not self.moving:
            return
        rows = np.flatnonzero(faces >= self._parts[1].first)
        moving_faces = faces[rows]
        for number, part in enumerate(self._parts[1:]):
            part_rows = rows[(moving_faces >= part.first) & (moving_faces < part.first + part.count)]
            if len(part_rows):
                yield number, part_rows


def _join_arrays(arrays: list[AnyArray]) -> AnyArray:
    """Return arrays joined along the first axis; a single one as it is, not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _part(mesh: SceneMesh, caster: Caster, first_face: int) -> TargetPart:
    """Return a mesh as a part of the target.

    Args:
        mesh: static, or a moving one in its body frame.
        caster: of the mesh.
        first_face: number of its first face among all.
    """
    bounds = mesh.vertex_bounds()
    lowest_corner, highest_corner = np.zeros((2, 3)) if bounds is None else bounds
    centre = (lowest_corner + highest_corner) / 2.0
    half_size = (highest_corner - lowest_corner) / 2.0
    radius = float(np.linalg.norm(half_size)) + 1e-3
    return TargetPart(caster, FacePlanes(mesh), first_face, len(mesh.triangles), centre, half_size, radius)


def _clear_scanner(track: Track, part: TargetPart, scanner: Float) -> Track:
    """Return a moving part's track, absent at the knots at which it meets the vehicle that carries the scanner.

    Args:
        track: the part's.
        part: a moving one.
        scanner: (3, K) places of the scanner at the track's knots, m.
    """
    offset = _unrotate(track.rotation, scanner - track.position)
    is_apart = (np.abs(offset.T - part.centre) > part.half + CLEARANCE).any(axis=1)
    return replace(track, present=track.present & is_apart)


def _cast(part: TargetPart, origins: Float, directions: Float, maximum_range: float) -> FirstHits:
    """Return rays' first hits on one part, in its body frame; faces are numbered among those of all parts.

    Args:
        part: static or moving.
        origins: (3, ...) in the body frame, m; of the directions' shape, or one that spreads to it.
        directions: (3, ...) unit vectors.
        maximum_range: m.
    """
    shape = directions.shape[1:]
    hits = part.caster.cast(*_as_rays(origins, directions), maximum_range)
    face = np.array(hits.reshape(shape[::-1]).T, np.intp, order="C")
    if not part.count:
        return FirstHits(face, np.full(shape, np.inf), np.zeros(shape))
    # A miss is worked out with some face and then forgotten: that is less work than to sort them out before.
    distance, cosine = part.planes.intersect(face, origins, directions)
    is_miss = face < 0
    is_finite = np.isfinite(distance)
    edge_on = not is_finite.all()  # a ray in the plane of its face, or a face without area
    if edge_on:
        is_miss |= ~is_finite
    np.copyto(distance, np.inf, where=is_miss)
    face += part.first
    if part.first or edge_on:
        face[is_miss] = -1
    return FirstHits(face, distance, cosine)


def _as_rays(origins: Float, directions: Float) -> tuple[Float32, Float32]:
    """Return rays (3, ...) as float32 rows, the last axis first: a caster meets a pulse's rays one after the other.

    They are next to each other, so that what one has brought into the processor's cache serves the others.

    Args:
        origins: of the directions' shape, or one that spreads to it.
        directions: (3, ...).
    """
    return _as_rows(origins, directions.shape), _as_rows(directions, directions.shape)


def _as_rows(vectors: Float, shape: tuple[int, ...]) -> Float32:
    """Return vectors that spread to a shape, (3, N) or (3, K, P), as float32 rows, see `_as_rays`."""
    if len(shape) == 2:
        return as_rows(np.broadcast_to(vectors, shape))
    _, rays, pulses = shape
    if vectors.shape[1] == 1:
        return np.repeat(as_rows(vectors[:, 0]), rays, axis=0)
    result = np.empty((pulses, rays, 3), dtype=np.float32)
    for i, ray in np.ndindex(3, rays):  # long rows one by one, which is several times as fast as all at once
        result[:, ray, i] = vectors[i, ray]
    return result.reshape(-1, 3)


def _cast_moving(part: TargetPart, track: Track, rays: Bundles, maximum_range: float, nearest_hits: FirstHits) -> None:
    """Replace hits by nearer ones on a moving part, in place.

    Args:
        part: a moving one.
        track: its.
        rays: N of them.
        maximum_range: m.
        nearest_hits: (N,) hits so far.
    """
    ray_index = rays.rays_near(track, part.centre, part.radius)
    if not len(ray_index):
        return
    rotation, place, present = track.at(rays.times[ray_index])
    ray_index, rotation, place = ray_index[present], rotation[:, present], place[:, present]
    begin, towards = rays.origins[:, ray_index] - place, rays.directions[:, ray_index]
    part_hits = _cast(part, _unrotate(rotation, begin), _unrotate(rotation, towards), maximum_range)
    closer_rows = np.flatnonzero(part_hits.distance < nearest_hits.distance[ray_index])
    for values, closer_values in zip(nearest_hits, part_hits, strict=True):
        values[ray_index[closer_rows]] = closer_values[closer_rows]


def _clear_blocked(part: TargetPart, track: Track, rays: Bundles, reach: float, is_free: Bool) -> None:
    """Set ``is_free`` (N,) to False, in place, for the rays that a moving part blocks within their reach (m)."""
    ray_index = rays.rays_near(track, part.centre, part.radius)
    ray_index = ray_index[is_free[ray_index]]
    if not len(ray_index):
        return
    rotation, place, present = track.at(rays.times[ray_index])
    ray_index, rotation, place = ray_index[present], rotation[:, present], place[:, present]
    # In the part's own frame, p' = R^T (p - t).
    begin = _unrotate(rotation, rays.origins[:, ray_index] - place)
    direction = _unrotate(rotation, rays.directions[:, ray_index])
    is_blocked = part.caster.occluded(as_rows(begin), as_rows(direction), reach)
    is_free[ray_index[is_blocked]] = False


def _crosses_box(begin: Float, direction: Float, reach: Float, half_size: Float) -> Bool:
    """Return a mask (N,) of the rays that cross a box around the origin within their reach: the slab method.

    Args:
        begin, direction: (3, N) m, and unit vectors.
        reach: (N,) m.
        half_size: (3,) of the box, m.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        side_ranges = np.stack([(-side * half_size[:, None] - begin) / direction for side in (1.0, -1.0)])
    # A ray in the plane of a side, and no farther out than it, is between both: what isn't a number doesn't count.
    entry_range = np.fmax.reduce(np.fmin(*side_ranges), axis=0)
    exit_range = np.fmin.reduce(np.fmax(*side_ranges), axis=0)
    return np.asarray((entry_range <= exit_range) & (exit_range >= 0.0) & (entry_range <= reach))


def _unrotate(rotation: Float, vectors: Float) -> Float:
    """Return vectors (3, N), each rotated by the inverse, that is the transpose, of its matrix (9, N), row by row."""
    result = np.empty_like(vectors)
    product = np.empty(vectors.shape[1])
    for i in range(3):
        np.multiply(rotation[i], vectors[0], out=result[i])
        for j in (1, 2):
            result[i] += np.multiply(rotation[3 * j + i], vectors[j], out=product)
    return result


def _damage_of(instance: NDArray[np.uint32], damages: Mapping[int, int]) -> UInt8:
    """Return the code of damage (F,) of faces by their instance numbers (F,); 0 for those that ``damages`` lacks."""
    result = np.zeros(len(instance), np.uint8)
    if damages:
        numbers = np.array(sorted(damages), np.int64)
        kinds = np.array([damages[number] for number in numbers.tolist()], np.uint8)
        position = np.minimum(np.searchsorted(numbers, instance), len(numbers) - 1)
        result = np.where(numbers[position] == instance, kinds[position], result)
    return result
