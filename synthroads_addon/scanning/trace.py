"""Rays followed through permeable surfaces: all that each of them meets, and the share of light that arrives there."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import AnyArray, ArrayRows, Float, Index
from ..materials.surfaces import Surfaces
from .knots import Track
from .scene.target import FirstHits, Target

LAYERS = 8
"""Surfaces that a ray passes at most."""
FAINTEST = 1e-2
"""A ray ends where less than this of its own light is left."""
_BEYOND = 1e-3
"""A ray goes on this far, m, behind the surface that it has passed: farther than float32 rounds."""


@dataclass(frozen=True)
class Rays:
    """K rays of each of P pulses: origins, directions, shares of energy, times.

    The pulses stand side by side, so that sums over a pulse's rays are sums of long rows.

    Attributes:
        origin: (3, 1 or K, P) float64, local.
        direction: (3, K, P) unit vectors.
        share: (K, 1) of the pulse's energy.
        time: (P,) s.
    """

    origin: Float
    direction: Float
    share: Float
    time: Float


@dataclass(frozen=True)
class Hits(ArrayRows):
    """Surfaces that rays meet; all arrays have one shape.

    Attributes:
        face: number among all faces of the target; -1 for none, as in the air where an effect has added an echo.
        material: of the face; any for none. As wide as indices are: looking tables up is several times faster then.
        distance: range from the ray's origin, m; inf for none, or where it is out of the device's reach.
        along: n . d of the face's normal and the ray.
        share: of the pulse's energy that the surface takes: what arrives less what goes through. It may spread to the
            shape of the others.
    """

    face: Index
    material: Index
    distance: Float
    along: Float
    share: Float


@dataclass(frozen=True)
class TracedRays:
    """Hits of a block's rays: the first of each ray, and those behind permeable surfaces.

    Attributes:
        rays: the rays.
        first: (K, P) what each ray meets first.
        behind: (B,) what rays meet behind permeable surfaces.
        ray: (B,) rays of these: k * P + p for ray k of pulse p.
    """

    rays: Rays
    first: Hits
    behind: Hits
    ray: Index

    @property
    def count(self) -> int:
        """Return the number of hits, as `returns.Echoes` numbers them."""
        return self.first.face.size + len(self.ray)

    @property
    def pulse(self) -> Index:
        """Return the pulse (B,) of each hit behind a permeable surface."""
        return np.asarray(self.ray % self.first.face.shape[1])

    def ends(self, hits: Index) -> tuple[Float, Float]:
        """Return where chosen hits are and where their rays begin, (3, N) each, local, m; see `returns.Echoes`."""
        begin = self.begins(hits)
        return begin + self.pick("distance", hits) * self.directions(hits), begin

    def begins(self, hits: Index) -> Float:
        """Return where the rays of chosen hits begin, (3, N) local, m."""
        ray, rays = self.ray_of(hits), self.rays
        first = ray if rays.origin.shape[1] > 1 else ray % len(rays.time)
        return np.take(rays.origin.reshape(3, -1), first, axis=1)

    def directions(self, hits: Index) -> Float:
        """Return the directions (3, N) of chosen hits' rays."""
        return np.take(self.rays.direction.reshape(3, -1), self.ray_of(hits), axis=1)

    def times(self, hits: Index) -> Float:
        """Return when the rays of chosen hits (N,) were emitted, s."""
        return np.take(self.rays.time, self.ray_of(hits) % len(self.rays.time))

    def ray_of(self, hits: Index) -> Index:
        """Return the ray k * P + p of each hit, by hit numbers as in `returns.Echoes`."""
        late = np.flatnonzero(hits >= self.first.face.size)
        result = hits.copy()
        result[late] = self.ray[hits[late] - self.first.face.size]
        return result

    def pick(self, name: str, hits: Index) -> AnyArray:
        """Return the named attribute of chosen hits, by hit numbers as in `returns.Echoes`."""
        first, behind = getattr(self.first, name).ravel(), getattr(self.behind, name)
        if not len(behind):
            return np.asarray(np.take(first, hits))
        late = np.flatnonzero(hits >= len(first))
        result = np.take(first, hits, mode="clip")
        result[late] = behind[hits[late] - len(first)]
        return np.asarray(result)


def trace(
    target: Target,
    surfaces: Surfaces,
    rays: Rays,
    motions: list[Track],
    nearest: float,
    farthest: float,
    axis: FirstHits | None = None,
) -> TracedRays:
    """Return what rays meet between two ranges (m), through permeable surfaces, and the light that each hit takes.

    The shares taken along one ray never add up to more than its own.

    Args:
        target: what is scanned.
        surfaces: means of its materials.
        rays: of pulses.
        motions: tracks of the target's moving parts.
        nearest, farthest: ranges, m.
        axis: (P,) what the first ray of each pulse meets, where it has been cast already.
    """
    met = _first_hits(target, rays, motions, farthest, axis)
    material = np.take(target.material, met.face, mode="clip").astype(np.intp)
    if not surfaces.permeable:
        first = Hits(met.face, material, _within(met.distance, nearest, np.inf), met.along, rays.share)
        return _gather_hits(rays, first, [], [])
    on = np.flatnonzero(np.take(surfaces.pervious, material, mode="clip"))
    on = on[np.take(met.distance, on) < farthest]
    through = surfaces.transmission[np.take(material, on)]
    share = np.broadcast_to(rays.share, material.shape).copy()
    left = np.take(share, on)
    share.ravel()[on] = left * (1.0 - through)
    start = np.take(met.distance, on)
    first = Hits(met.face, material, _within(met.distance, nearest, np.inf), met.along, share)
    layers, rays_on = [], []
    left *= through
    for _ in range(LAYERS - 1):
        bright = np.flatnonzero(left > FAINTEST * np.take(rays.share, on // material.shape[1]))
        if not len(bright):
            break
        on, left, start = on[bright], left[bright], start[bright] + _BEYOND
        pulse = on % material.shape[1]
        direction = np.take(rays.direction.reshape(3, -1), on, axis=1)
        origin = np.take(rays.origin.reshape(3, -1), on if rays.origin.shape[1] > 1 else pulse, axis=1)
        origin += start * direction
        met = target.cast(origin, direction, farthest, rays.time[pulse], motions)
        hit = np.flatnonzero(met.face >= 0)
        on, left, start = on[hit], left[hit], start[hit] + met.distance[hit]
        face = met.face[hit]
        surface = np.take(target.material, face).astype(np.intp)
        through = np.take(surfaces.transmission, surface)
        layers.append(Hits(face, surface, _within(start, nearest, farthest), met.along[hit], left * (1.0 - through)))
        rays_on.append(on)
        left = left * through
    return _gather_hits(rays, first, layers, rays_on)


def _first_hits(target: Target, rays: Rays, motions: list[Track], farthest: float, axis: FirstHits | None) -> FirstHits:
    """Return what rays (K, P) meet first, without casting those again whose hits are known, see `trace`."""
    if axis is None:
        return target.cast(rays.origin, rays.direction, farthest, rays.time, motions)
    origin = rays.origin[:, 1:] if rays.origin.shape[1] > 1 else rays.origin
    others = target.cast(origin, rays.direction[:, 1:], farthest, rays.time, motions)
    return FirstHits(*(np.concatenate([one[None], more]) for one, more in zip(axis, others, strict=True)))


def _gather_hits(rays: Rays, first: Hits, layers: list[Hits], on: list[Index]) -> TracedRays:
    """Return first hits and those of all layers behind as one; of those behind only what is within reach."""
    if not layers:
        none, nothing = np.empty(0, dtype=np.intp), np.empty(0)
        return TracedRays(rays, first, Hits(none, none, nothing, nothing, nothing), none)
    behind = Hits.join(layers)
    inside = np.flatnonzero(behind.distance < np.inf)
    return TracedRays(rays, first, behind.select(inside), np.concatenate(on)[inside])


def _within(distance: Float, nearest: float, farthest: float) -> Float:
    """Return ranges (m) with inf where they are out of the limits and so not recorded.

    What rays meet first is never farther than they were cast, so there ``farthest`` is inf.
    """
    if distance.size == 0 or (farthest == np.inf and distance.min() >= nearest):
        return distance
    outside = (distance < nearest) | (distance > farthest)
    return np.where(outside, np.inf, distance) if outside.any() else distance
