"""Rays followed through permeable surfaces: all that each of them meets, and the share of light that arrives there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ..base.arrays import AnyArray, ArrayRows, Float, Index
from ..materials.surfaces import Surfaces
from .colour.transparency import SeeThrough
from .knots import Track
from .scene.gaps import LeafGaps
from .scene.target import FirstHits, Target

LAYERS = 32
"""Surfaces that a ray passes at most: a canopy's leaves are many, one behind the other."""
FAINTEST = 1e-2
"""A ray ends where less than this of its own light is left."""
CLEAR_LAYERS = 256
"""Surfaces that a ray passes at most where some are clear in places: those take nothing of it."""
BEYOND = 1e-3
"""A ray goes on this far, m, behind the surface that it has passed: farther than float32 rounds."""
BEYOND_CLEAR = 1e-4
"""Likewise behind one that is clear in places: a sign's or a marking's picture often lies a millimetre above a wall."""


class PulseRays(Protocol):
    """Interface of K rays of each of P pulses, as `Rays`, which may be worked out where they are asked for."""

    @property
    def share(self) -> Float:
        """Return the shares (K, 1) of the pulse's energy."""

    @property
    def time(self) -> Float:
        """Return when the pulses are emitted, (P,), s."""

    def pick(self, ray: Index) -> tuple[Float, Float]:
        """Return origins and directions (3, N) of chosen rays, as k * P + p for ray k of pulse p."""


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

    rays: PulseRays
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
        return self.rays.pick(self.ray_of(hits))[1]

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
    openings: Openings | None = None,
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
        openings: where materials are open; None: all of a material weakens rays alike.
    """
    met = _first_hits(target, rays, motions, farthest, axis)
    material = np.take(target.material, met.face, mode="clip").astype(np.intp)
    if not surfaces.permeable:
        first = Hits(met.face, material, _within(met.distance, nearest, np.inf), met.along, rays.share)
        return _gather_hits(rays, first, [], [])
    on = np.flatnonzero(np.take(surfaces.pervious, material, mode="clip"))
    on = on[np.take(met.distance, on) < farthest]
    share = np.broadcast_to(rays.share, material.shape).copy()
    left = np.take(share, on)
    onward = _Onward(target, surfaces, openings or Openings(), rays, motions)
    kind, start = np.take(material, on), np.take(met.distance, on)
    face, along = (np.take(met.face, on), np.take(met.along, on)) if onward.clear else (None, None)
    through = onward.transmitted(on, face, kind, along, start)
    share.ravel()[on] = left * (1.0 - through)
    distance = _within(met.distance, nearest, np.inf)
    if openings is not None and (through == 1.0).any():
        distance = distance.copy()
        distance.ravel()[on[through == 1.0]] = np.inf
    first = Hits(met.face, material, distance, met.along, share)
    passed = _Passed(on, left * through, start, face, onward.steps(kind))
    layers = list(onward.follow(passed, nearest, farthest))
    return _gather_hits(rays, first, [hits for hits, _ in layers], [on for _, on in layers])


class Openings(NamedTuple):
    """Where the permeable materials of a scene are open.

    Attributes:
        gaps: leaves and gaps of materials that have a ``gap_size``; None: they weaken rays as others do, evenly.
        clear: materials whose transparency differs from place to place; None where the scene has none.
    """

    gaps: LeafGaps | None = None
    clear: SeeThrough | None = None


@dataclass(frozen=True)
class _Passed(ArrayRows):
    """Rays (N,) that have passed a surface.

    Attributes:
        on: the rays, as k * P + p for ray k of pulse p.
        left: light that they keep.
        start: range of the surface, m.
        face: that was passed; None where no material is clear in places.
        step: how far behind it they go on, m; None likewise, for the usual distance.
    """

    on: Index
    left: Float
    start: Float
    face: Index | None
    step: Float | None


@dataclass(frozen=True)
class _Onward:
    """A block's rays behind permeable surfaces.

    Attributes:
        target: what is scanned.
        surfaces: the materials.
        openings: of them.
        rays: of pulses.
        motions: tracks of the target's moving parts.
    """

    target: Target
    surfaces: Surfaces
    openings: Openings
    rays: Rays
    motions: list[Track]

    @property
    def clear(self) -> bool:
        """Return whether some materials are clear in places."""
        return self.openings.clear is not None

    def follow(self, passed: _Passed, nearest: float, farthest: float) -> Iterator[tuple[Hits, Index]]:
        """Yield what rays meet next, and which rays; again and again, until they are too faint or meet nothing.

        Args:
            passed: rays behind what they have met first.
            nearest, farthest: ranges, m.
        """
        pulses = len(self.rays.time)
        for _ in range((CLEAR_LAYERS if self.clear else LAYERS) - 1):
            bright = np.flatnonzero(passed.left > FAINTEST * np.take(self.rays.share, passed.on // pulses))
            if not len(bright):
                break
            before = passed.select(bright)
            step: Float | float = BEYOND if before.step is None else before.step
            start, (origin, direction) = before.start + step, self.rays.pick(before.on)
            times = self.rays.time[before.on % pulses]
            met = self.target.cast(origin + start * direction, direction, farthest, times, self.motions)
            hit = np.flatnonzero(met.face >= 0)
            before, start, face, along = (
                before.select(hit),
                start[hit] + met.distance[hit],
                met.face[hit],
                met.along[hit],
            )
            surface = np.take(self.target.material, face).astype(np.intp)
            through, steps = self.transmitted(before.on, face, surface, along, start), self.steps(surface)
            if before.face is not None and steps is not None and (again := face == before.face).any():
                # No ray meets a flat face twice: rounding has put it before the face that it has passed.
                through[again], steps[again] = 1.0, 4.0 * np.asarray(before.step)[again]
            taken = before.left * (1.0 - through)
            reached = np.where(taken > 0.0, _within(start, nearest, farthest), np.inf)
            yield Hits(face, surface, reached, along, taken), before.on
            passed = _Passed(before.on, before.left * through, start, None if steps is None else face, steps)

    def steps(self, material: Index) -> Float | None:
        """Return how far (N,), m, rays go on behind surfaces that they have passed, by material; None: all alike."""
        if not self.clear:
            return None
        return np.where(np.take(self.surfaces.clear, material), BEYOND_CLEAR, BEYOND)

    def transmitted(
        self, on: Index, face: Index | None, material: Index, along: Float | None, distance: Float
    ) -> Float:
        """Return the share (N,) of their light that rays keep behind what they meet.

        Args:
            on: (N,) rays as k * P + p for ray k of pulse p.
            face: (N,) that they meet; None where no material is clear in places.
            material: (N,) of the faces.
            along: (N,) n . d of their normals and the rays; None likewise.
            distance: (N,) where they meet them, m.
        """
        result = np.take(self.surfaces.transmission, material)
        gaps, clear = self.openings
        if gaps is not None and len(leafy := np.flatnonzero(np.take(self.surfaces.gappy, material))):
            ray, here = on[leafy], distance[leafy]
            share = np.take(self.rays.share, ray // self.rays.direction.shape[2])
            place = self._places(ray, here)
            result[leafy] = gaps.transmitted(self.surfaces, material[leafy], place, here, share)
        if (
            clear is not None
            and face is not None
            and along is not None
            and len(some := np.flatnonzero(np.take(self.surfaces.clear, material)))
        ):
            ray, times = on[some], np.take(self.rays.time, on[some] % len(self.rays.time))
            place = self._places(ray, distance[some])
            result[some] = clear.transmitted(
                self.target, material[some], face[some], along[some], place, times, self.motions
            )
        return result

    def _places(self, ray: Index, distance: Float) -> Float:
        """Return the places (3, N) on rays at distances (N,), local, m."""
        origin, direction = self.rays.pick(ray)
        return np.asarray(origin + distance * direction)


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
