"""Rays followed through permeable surfaces: all that each of them meets, and the share of light that arrives there."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import AnyArray, ArrayRows, Float, Index
from ..materials.surfaces import Surfaces
from .knots import Track
from .scene.gaps import LeafGaps
from .scene.target import FirstHits, Target

LAYERS = 32
"""Surfaces that a ray passes at most: a canopy's leaves are many, one behind the other."""
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

    def pick(self, ray: Index) -> tuple[Float, Float]:
        """Return origins and directions (3, N) of chosen rays, as k * P + p for ray k of pulse p."""
        first = ray if self.origin.shape[1] > 1 else ray % len(self.time)
        origin = np.take(self.origin.reshape(3, -1), first, axis=1)
        return origin, np.take(self.direction.reshape(3, -1), ray, axis=1)


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
        begin, direction = self.rays.pick(self.ray_of(hits))
        return begin + self.pick("distance", hits) * direction, begin

    def begins(self, hits: Index) -> Float:
        """Return where the rays of chosen hits begin, (3, N) local, m."""
        return self.rays.pick(self.ray_of(hits))[0]

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
    gaps: LeafGaps | None = None,
) -> TracedRays:
    """Return what rays meet between two ranges (m), through permeable surfaces, and the light that each hit takes.

    The shares taken along one ray never add up to more than its own. What takes nothing isn't met: it is at inf.

    Args:
        target: what is scanned.
        surfaces: means of its materials.
        rays: of pulses.
        motions: tracks of the target's moving parts.
        nearest, farthest: ranges, m.
        axis: (P,) what the first ray of each pulse meets, where it has been cast already.
        gaps: leaves and gaps of materials that have a ``gap_size``; None: they weaken rays as others do, evenly.
    """
    met = _first_hits(target, rays, motions, farthest, axis)
    material = np.take(target.material, met.face, mode="clip").astype(np.intp)
    if not surfaces.permeable:
        first = Hits(met.face, material, _within(met.distance, nearest, np.inf), met.along, rays.share)
        return _gather_hits(rays, first, [], [])
    on = np.flatnonzero(np.take(surfaces.pervious, material, mode="clip"))
    on = on[np.take(met.distance, on) < farthest]
    share = np.broadcast_to(rays.share, material.shape).copy()
    left, start = np.take(share, on), np.take(met.distance, on)
    through = _transmitted(surfaces, gaps, rays, on, np.take(material, on), start)
    share.ravel()[on] = left * (1.0 - through)
    distance = _within(met.distance, nearest, np.inf)
    if gaps is not None and (through == 1.0).any():
        distance = distance.copy()
        distance.ravel()[on[through == 1.0]] = np.inf
    first = Hits(met.face, material, distance, met.along, share)
    layers, rays_on = [], []
    left *= through
    for _ in range(LAYERS - 1):
        bright = np.flatnonzero(left > FAINTEST * np.take(rays.share, on // material.shape[1]))
        if not len(bright):
            break
        on, left, start = on[bright], left[bright], start[bright] + _BEYOND
        origin, direction = rays.pick(on)
        met = target.cast(origin + start * direction, direction, farthest, rays.time[on % material.shape[1]], motions)
        hit = np.flatnonzero(met.face >= 0)
        on, left, start = on[hit], left[hit], start[hit] + met.distance[hit]
        face = met.face[hit]
        surface = np.take(target.material, face).astype(np.intp)
        through = _transmitted(surfaces, gaps, rays, on, surface, start)
        taken = left * (1.0 - through)
        reached = np.where(taken > 0.0, _within(start, nearest, farthest), np.inf)
        layers.append(Hits(face, surface, reached, met.along[hit], taken))
        rays_on.append(on)
        left = left * through
    return _gather_hits(rays, first, layers, rays_on)


def _transmitted(
    surfaces: Surfaces, gaps: LeafGaps | None, rays: Rays, on: Index, material: Index, distance: Float
) -> Float:
    """Return the share (N,) of their light that rays keep behind what they meet.

    Args:
        surfaces: the materials.
        gaps: leaves and gaps of some of them.
        rays: of pulses.
        on: (N,) rays as k * P + p for ray k of pulse p.
        material: (N,) of what they meet.
        distance: (N,) where they meet it, m.
    """
    result = np.take(surfaces.transmission, material)
    leafy = np.flatnonzero(np.take(surfaces.gappy, material)) if gaps is not None else ()
    if gaps is None or not len(leafy):
        return result
    ray, here = on[leafy], distance[leafy]
    origin, direction = rays.pick(ray)
    share = np.take(rays.share, ray // rays.direction.shape[2])
    place = origin + here * direction
    result[leafy] = gaps.transmitted(surfaces, material[leafy], place, here, share)
    return result


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
