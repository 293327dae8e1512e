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
        origin_index = ray if self.origin.shape[1] > 1 else ray % len(self.time)
        origin = np.take(self.origin.reshape(3, -1), origin_index, axis=1)
        return origin, np.take(self.direction.reshape(3, -1), ray, axis=1)


@dataclass(frozen=True)
class Hits(ArrayRows):
    """Surfaces that rays meet; all arrays have one shape.

    Attributes:
        face: number among all faces of the target; -1 for none, as in the air where an effect has added an echo.
        material: of the face; any for none. As wide as indices are: looking tables up is several times faster then.
        distance: range from the ray's origin, m; inf for none, or where it is out of the device's reach.
        cosine: n . d of the face's normal and the ray.
        share: of the pulse's energy that the surface takes: what arrives less what goes through. It may spread to the
            shape of the others.
    """

    face: Index
    material: Index
    distance: Float
    cosine: Float
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
        rows_behind = np.flatnonzero(hits >= self.first.face.size)
        result = hits.copy()
        result[rows_behind] = self.ray[hits[rows_behind] - self.first.face.size]
        return result

    def pick(self, name: str, hits: Index) -> AnyArray:
        """Return the named attribute of chosen hits, by hit numbers as in `returns.Echoes`."""
        first_values, values_behind = getattr(self.first, name).ravel(), getattr(self.behind, name)
        if not len(values_behind):
            return np.asarray(np.take(first_values, hits))
        rows_behind = np.flatnonzero(hits >= len(first_values))
        result = np.take(first_values, hits, mode="clip")
        result[rows_behind] = values_behind[hits[rows_behind] - len(first_values)]
        return np.asarray(result)


def trace(
    target: Target,
    surfaces: Surfaces,
    rays: Rays,
    motions: list[Track],
    nearest_range: float,
    farthest_range: float,
    axis: FirstHits | None = None,
    openings: Openings | None = None,
) -> TracedRays:
    """Return what rays meet between two ranges, through permeable surfaces, and the light that each hit takes.

    The shares of energy that all hits of one ray take never add up to more than the ray's own share. A hit that takes
    nothing, or that lies out of the ranges, has the distance inf.

    Args:
        target: what is scanned.
        surfaces: means of its materials.
        rays: K rays of each of P pulses.
        motions: tracks of the target's moving parts.
        nearest_range, farthest_range: m.
        axis: (P,) what the first ray of each pulse meets, where it has been cast already.
        openings: where materials are open; None: all of a material weakens rays alike.
    """
    met = _first_hits(target, rays, motions, farthest_range, axis)
    material = np.take(target.material, met.face, mode="clip").astype(np.intp)
    distance = _within(met.distance, nearest_range, np.inf)
    if not surfaces.permeable:
        return _gather_hits(rays, Hits(met.face, material, distance, met.cosine, rays.share), [], [])
    # Rays, as k * P + p, that meet a permeable material first. A miss has any material, but the distance inf.
    ray = np.flatnonzero(np.take(surfaces.pervious, material, mode="clip"))
    ray = ray[np.take(met.distance, ray) < farthest_range]
    onward = _Onward(target, surfaces, openings or Openings(), rays, motions)
    ray_material, start = np.take(material, ray), np.take(met.distance, ray)
    face, cosine = (np.take(met.face, ray), np.take(met.cosine, ray)) if onward.clear else (None, None)
    transmission = onward.transmitted(ray, face, ray_material, cosine, start)
    # The first surface takes what it doesn't let through; where that is nothing, it isn't recorded.
    share = np.broadcast_to(rays.share, material.shape).copy()
    arriving_light = np.take(share, ray)
    share.ravel()[ray] = arriving_light * (1.0 - transmission)
    if openings is not None and (transmission == 1.0).any():
        distance = distance.copy()
        distance.ravel()[ray[transmission == 1.0]] = np.inf
    first_hits = Hits(met.face, material, distance, met.cosine, share)
    # The light that is left goes on to what lies behind, layer by layer.
    passed_rays = _Passed(ray, arriving_light * transmission, start, face, onward.steps(ray_material))
    layers = list(onward.follow(passed_rays, nearest_range, farthest_range))
    return _gather_hits(rays, first_hits, [hits for hits, _ in layers], [layer_ray for _, layer_ray in layers])


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
        ray: k * P + p for ray k of pulse p.
        light: that they keep, as a share of the pulse's energy.
        start: range of the surface, m.
        face: that was passed; None where no material is clear in places.
        step: how far behind it they go on, m; None likewise, for the usual distance.
    """

    ray: Index
    light: Float
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

    def follow(self, passed_rays: _Passed, nearest_range: float, farthest_range: float) -> Iterator[tuple[Hits, Index]]:
        """Yield, layer by layer, the next hits (N,) behind passed surfaces and the rays (N,) that they belong to.

        The first layer is what rays meet behind the surfaces that they have passed, the next layer what lies behind
        that, and so on. A ray ends where it meets nothing, or where less than `FAINTEST` of its own light is left.

        Args:
            passed_rays: rays behind what they have met first.
            nearest_range, farthest_range: m; hits out of these have the distance inf, but rays go on behind them.
        """
        pulses = len(self.rays.time)
        for _ in range((CLEAR_LAYERS if self.clear else LAYERS) - 1):
            ray_share = np.take(self.rays.share, passed_rays.ray // pulses)
            bright_rows = np.flatnonzero(passed_rays.light > FAINTEST * ray_share)
            if not len(bright_rows):
                break
            onward_rays = passed_rays.select(bright_rows)
            # Each ray is cast anew from a little behind the surface that it has passed last.
            step: Float | float = BEYOND if onward_rays.step is None else onward_rays.step
            start, (origin, direction) = onward_rays.start + step, self.rays.pick(onward_rays.ray)
            times = self.rays.time[onward_rays.ray % pulses]
            next_hits = self.target.cast(origin + start * direction, direction, farthest_range, times, self.motions)
            hit_rows = np.flatnonzero(next_hits.face >= 0)
            onward_rays, face, cosine = (
                onward_rays.select(hit_rows),
                next_hits.face[hit_rows],
                next_hits.cosine[hit_rows],
            )
            distance = start[hit_rows] + next_hits.distance[hit_rows]
            material = np.take(self.target.material, face).astype(np.intp)
            transmission = self.transmitted(onward_rays.ray, face, material, cosine, distance)
            steps = self.steps(material)
            if onward_rays.face is not None and steps is not None and (same_face := face == onward_rays.face).any():
                # No ray meets a flat face twice: rounding has put it before the face that it has passed.
                transmission[same_face], steps[same_face] = 1.0, 4.0 * np.asarray(onward_rays.step)[same_face]
            taken_light = onward_rays.light * (1.0 - transmission)
            recorded_distance = np.where(taken_light > 0.0, _within(distance, nearest_range, farthest_range), np.inf)
            yield Hits(face, material, recorded_distance, cosine, taken_light), onward_rays.ray
            passed_rays = _Passed(
                onward_rays.ray, onward_rays.light * transmission, distance, None if steps is None else face, steps
            )

    def steps(self, material: Index) -> Float | None:
        """Return how far (N,), m, rays go on behind surfaces that they have passed, by material; None: all alike."""
        if not self.clear:
            return None
        return np.where(np.take(self.surfaces.clear, material), BEYOND_CLEAR, BEYOND)

    def transmitted(
        self, ray: Index, face: Index | None, material: Index, cosine: Float | None, distance: Float
    ) -> Float:
        """Return the share (N,) of their light that rays keep behind the surfaces that they meet.

        Args:
            ray: (N,) as k * P + p for ray k of pulse p.
            face: (N,) that they meet; None where no material is clear in places.
            material: (N,) of the faces.
            cosine: (N,) n . d of the faces' normals and the rays; None likewise.
            distance: (N,) where they meet them, m.
        """
        result = np.take(self.surfaces.transmission, material)
        gaps, see_through = self.openings
        if gaps is not None and len(leafy := np.flatnonzero(np.take(self.surfaces.gappy, material))):
            leafy_ray, leafy_distance = ray[leafy], distance[leafy]
            share = np.take(self.rays.share, leafy_ray // self.rays.direction.shape[2])
            place = self._places(leafy_ray, leafy_distance)
            result[leafy] = gaps.transmitted(self.surfaces, material[leafy], place, leafy_distance, share)
        if see_through is None or face is None or cosine is None:
            return result
        rows = np.flatnonzero(np.take(self.surfaces.clear, material))  # materials that are clear in places
        if len(rows):
            clear_ray = ray[rows]
            times = np.take(self.rays.time, clear_ray % len(self.rays.time))
            place = self._places(clear_ray, distance[rows])
            result[rows] = see_through.transmitted(
                self.target, material[rows], face[rows], cosine[rows], place, times, self.motions
            )
        return result

    def _places(self, ray: Index, distance: Float) -> Float:
        """Return the places (3, N) on rays at distances (N,), local, m."""
        origin, direction = self.rays.pick(ray)
        return np.asarray(origin + distance * direction)


def _first_hits(
    target: Target, rays: Rays, motions: list[Track], farthest_range: float, axis: FirstHits | None
) -> FirstHits:
    """Return what rays (K, P) meet first.

    Args:
        target: what is scanned.
        rays: of pulses.
        motions: tracks of the target's moving parts.
        farthest_range: range up to which rays are cast, m.
        axis: (P,) known hits of the first ray of each pulse, which isn't cast again; None: all rays are cast.
    """
    if axis is None:
        return target.cast(rays.origin, rays.direction, farthest_range, rays.time, motions)
    origin = rays.origin[:, 1:] if rays.origin.shape[1] > 1 else rays.origin
    other_hits = target.cast(origin, rays.direction[:, 1:], farthest_range, rays.time, motions)
    return FirstHits(
        *(
            np.concatenate([axis_values[None], other_values])
            for axis_values, other_values in zip(axis, other_hits, strict=True)
        )
    )


def _gather_hits(rays: Rays, first_hits: Hits, layers: list[Hits], layer_rays: list[Index]) -> TracedRays:
    """Return the hits of rays: the first ones, and all layers of hits behind these, less hits at the distance inf.

    Args:
        rays: of pulses.
        first_hits: (K, P) of all rays.
        layers: hits (N,) of each layer.
        layer_rays: rays (N,) that each layer's hits belong to, as k * P + p.
    """
    if not layers:
        no_index, no_number = np.empty(0, dtype=np.intp), np.empty(0)
        return TracedRays(rays, first_hits, Hits(no_index, no_index, no_number, no_number, no_number), no_index)
    late_hits = Hits.join(layers)
    recorded = np.flatnonzero(late_hits.distance < np.inf)
    return TracedRays(rays, first_hits, late_hits.select(recorded), np.concatenate(layer_rays)[recorded])


def _within(distance: Float, nearest_range: float, farthest_range: float) -> Float:
    """Return ranges (N,), m, with inf in place of those out of two limits, m, which aren't recorded.

    What rays meet first is never farther than they were cast, so there ``farthest_range`` is inf.
    """
    if distance.size == 0 or (farthest_range == np.inf and distance.min() >= nearest_range):
        return distance
    is_outside = (distance < nearest_range) | (distance > farthest_range)
    return np.where(is_outside, np.inf, distance) if is_outside.any() else distance
