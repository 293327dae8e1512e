"""Pulses whose footprint is one plane of pavement or ground: their returns follow from the ray along their axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ..base.arrays import AnyArray, ArrayRows, Bool, Float, Index, Int
from ..materials.surfaces import brightness_of
from .beam import beam_radii, conical_directions, cylindrical_offsets, outer_radii
from .kernels.hits import TracedPulses
from .knots import Track
from .plan import ScanPlan
from .pulses import Pulses
from .receiving.radiometry import received_intensity
from .returns import LEAST_REFLECTANCE, Echoes
from .scene.bare_ground import CREASE
from .scene.bundles import dot
from .scene.target import FirstHits, Target
from .trace import TracedRays

_GRAZING = 0.06
"""Cosine of the incidence angle from which on footprints are spared: below, ground that is hardly curved stands in a
beam's way."""
_WIDEST = 0.1
"""Largest share of its range by which a footprint's outermost ray may be nearer or farther than its axis."""
_CLEARANCE = 1e-3
"""How far before the plane a ray that looks for things in the way ends, m; on creases farther."""


@dataclass(frozen=True)
class SparedPulses(ArrayRows):
    """Pulses of a block whose footprints lie on one plane alone, and what their axes meet; one row for each.

    Attributes:
        pulse: (S,) in the block.
        face, material: (S,) what the axis meets.
        distance: (S,) range of the axis, m.
        along: (S,) n . d of the face's normal and the axis.
        steepness: (S, 2) by how much of its range a ray is nearer for each radian that it is deflected in the scan
            plane, and across it.
        one_ray: (S,) whether the axis was all that had to be cast, and not whether the other rays are blocked.
    """

    pulse: Index
    face: Index
    material: Index
    distance: Float
    along: Float
    steepness: Float
    one_ray: Bool


@dataclass(frozen=True)
class Sparing:
    """Footprints of a plan's pulses that needn't be cast in full, as all of their rays meet one plane.

    Attributes:
        plan: the scan; its ``ground`` says where planes are.
    """

    plan: ScanPlan

    @cached_property
    def _rays(self) -> list[tuple[float, float, float, float]]:
        """Return share of energy, stretch of the unit vector and deflections (rad) of each ray of a pulse."""
        radii, result = beam_radii(self.plan.setting.divergence), []
        for (x, y), share in zip(
            self.plan.emission.pattern.across.tolist(), self.plan.emission.pattern.weights.tolist(), strict=True
        ):
            a, b = x * radii[0], y * radii[1]
            conical = self.plan.emission.beam == "conical"
            result.append((share, 1.0 / np.sqrt(1.0 + a * a + b * b) if conical else 1.0, a, b))
        return result

    @cached_property
    def _reach(self) -> Float:
        """Return the deflections (2,) that no ray of a pulse exceeds, rad, as half axes of an ellipse."""
        return np.array(outer_radii(self.plan.emission.rings, self.plan.setting.divergence))

    def find(self, pulses: Pulses, met: FirstHits, motions: list[Track]) -> SparedPulses:
        """Return the pulses whose whole footprint meets one plane, by what their axes meet.

        Args:
            pulses: P pulses of a block.
            met: (P,) what their axes meet.
            motions: tracks of the target's moving parts.
        """
        plan, ground = self.plan, self.plan.emission.ground
        assert ground is not None
        assert pulses.in_plane is not None
        assert pulses.across is not None
        on = np.take(ground.face, met.face, mode="clip") & (met.face >= 0) & (met.face < len(ground.face))
        on &= (met.along <= -_GRAZING) & (pulses.direction[2] <= -_GRAZING)
        rows = np.flatnonzero(on)
        face, distance, along = met.take(rows)
        direction, normal = np.take(pulses.direction, rows, axis=1), plan.target.static_normals(face)
        spans, steepness = [], np.empty((len(rows), 2))
        for i, axis in enumerate((pulses.in_plane, pulses.across)):
            across = np.take(axis, rows, axis=1)
            slope = dot(across, normal)
            slope /= along
            steepness[:, i] = slope
            across -= slope * direction
            across *= self._reach[i] * distance
            spans.append(across)
        inside = self._single_returns(distance, steepness)
        place = np.take(pulses.origin, rows, axis=1) + distance * direction
        whole, alone = ground.check_footprints(face, place, (spans[0], spans[1]), -direction)
        material = np.take(plan.target.material, face).astype(np.intp)
        candidates = SparedPulses(rows, face, material, distance, along, steepness, alone & whole)
        candidates = candidates.select(np.flatnonzero(whole & inside))
        if plan.target.moving:
            candidates = candidates.select(np.flatnonzero(~self._near_traffic(candidates, pulses, motions)))
        return self._unblocked(candidates, pulses)

    def find_missing(self, pulses: Pulses, met: FirstHits, motions: list[Track]) -> Index:
        """Return the pulses whose whole beam passes by everything, of those whose axis meets nothing."""
        plan, ground = self.plan, self.plan.emission.ground
        assert ground is not None
        rows = np.flatnonzero(met.face < 0)
        origin, direction = (np.take(vectors, rows, axis=1) for vectors in (pulses.origin, pulses.direction))
        missing = ground.passed_by(origin, direction, float(self._reach.max()))
        if plan.target.moving:
            rows, origin, direction = rows[missing], origin[:, missing], direction[:, missing]
            reach = np.full(len(rows), plan.setting.maximum_range)
            radius = float(self._reach.max()) * plan.setting.maximum_range
            near = plan.target.near_moving(origin, direction, reach, pulses.time[rows], motions, radius)
            return rows[~near]
        return rows[missing]

    def _single_returns(self, distance: Float, steepness: Float) -> Bool:
        """Return which footprints (N,) give one return within the scanner's reach, whatever the beam's ray."""
        setting = self.plan.setting
        depth = np.hypot(steepness[:, 0] * self._reach[0], steepness[:, 1] * self._reach[1])
        depth += 0.5 * float(self._reach.max()) ** 2
        near, far = distance * (1.0 - depth), distance * (1.0 + 1.2 * depth)
        inside = (near >= setting.minimum_range) & (far <= setting.maximum_range)
        return np.asarray((depth <= _WIDEST) & (far - near <= setting.range_resolution) & inside)

    def _near_traffic(self, found: SparedPulses, pulses: Pulses, motions: list[Track]) -> Bool:
        """Return which spared pulses (S,) pass a moving part by less than their beam's radius."""
        radius = float(self._reach.max() * found.distance.max(initial=0.0))
        origin, direction = (np.take(vectors, found.pulse, axis=1) for vectors in (pulses.origin, pulses.direction))
        times = pulses.time[found.pulse]
        return self.plan.target.near_moving(origin, direction, found.distance, times, motions, radius)

    def _unblocked(self, found: SparedPulses, pulses: Pulses) -> SparedPulses:
        """Return the spared pulses without those that aren't sure to be and of which something blocks a ray."""
        doubtful = np.flatnonzero(~found.one_ray)
        if not len(doubtful):
            return found
        some = found.select(doubtful)
        origin, direction = self._outer_rays(pulses, some)
        reach = np.stack([distance for _, distance, _ in self._ray_hits(some)][1:])
        deepest = np.abs(self._reach).max() * some.distance / np.abs(some.along)
        reach -= _CLEARANCE + 2.0 * CREASE * deepest / np.abs(some.along)
        free = self.plan.target.unblocked(origin, direction, reach).all(axis=0)
        kept = np.ones(len(found.pulse), bool)
        kept[doubtful[~free]] = False
        return found.select(np.flatnonzero(kept))

    def _outer_rays(self, pulses: Pulses, some: SparedPulses) -> tuple[Float, Float]:
        """Return origins (3, 1 or K - 1, S) and directions (3, K - 1, S) of the rays around the axes of pulses."""
        plan = self.plan
        pattern = plan.emission.pattern
        pattern = replace(pattern, across=pattern.across[1:], weights=pattern.weights[1:])
        assert pulses.in_plane is not None
        assert pulses.across is not None
        vectors = (pulses.origin, pulses.direction, pulses.in_plane, pulses.across)
        origin, direction, in_plane, across = (np.take(array, some.pulse, axis=1) for array in vectors)
        if plan.emission.beam == "conical":
            beam = conical_directions(direction, in_plane, across, pattern, plan.setting.divergence)
            return origin[:, None, :], beam
        offsets = cylindrical_offsets(in_plane, across, pattern, plan.setting.divergence, some.distance)
        return origin[:, None, :] + offsets, np.repeat(direction[:, None, :], len(pattern), axis=1)

    def _ray_hits(self, spared: SparedPulses) -> Iterator[tuple[float, Float, Float]]:
        """Yield share of energy, range (S,), m, and n . d (S,) of each ray of spared pulses, the axis first."""
        conical = self.plan.emission.beam == "conical"
        for share, length, x, y in self._rays:
            stretch = x * spared.steepness[:, 0]
            stretch += y * spared.steepness[:, 1]
            if conical:
                stretch += 1.0
                stretch *= length
                yield share, spared.distance / stretch, spared.along * stretch
            else:
                yield share, spared.distance * (1.0 - stretch), spared.along

    def echoes(self, spared: SparedPulses, first: int) -> Echoes:
        """Return the one echo of each spared pulse, as all rays of its footprint give it.

        Args:
            spared: S pulses.
            first: number that the first of their axes' hits has among all hits of the block.
        """
        surfaces, count = self.plan.reflection.surfaces, len(spared.pulse)
        offset, energy = np.zeros(count), np.zeros(count)
        for share, distance, along in self._ray_hits(spared):
            bright = brightness_of(surfaces, spared.material, np.abs(along))
            bright *= share
            energy += received_intensity(bright, distance, self.plan.atmosphere.attenuation)
            offset += share * (distance - spared.distance)
        weight = np.maximum(np.take(surfaces.reflectivity, spared.material), LEAST_REFLECTANCE)
        return Echoes(spared.pulse, first + np.arange(count), spared.distance + offset, energy, weight)


@dataclass(frozen=True)
class PartlyTraced:
    """Hits of a block's pulses of which some were spared: those of traced rays first, then the spared pulses' axes.

    Attributes:
        traced: rays of the pulses that were cast in full.
        spared: the other pulses.
        pulses: of the block.
    """

    traced: TracedRays | TracedPulses
    spared: SparedPulses
    pulses: Pulses

    def pick(self, name: str, hits: Index) -> AnyArray:
        """Return the named attribute of chosen hits, by hit numbers as in `returns.Echoes`."""
        return self._join(hits, getattr(self.spared, name), partial(self.traced.pick, name))

    def ends(self, hits: Index) -> tuple[Float, Float]:
        """Return where chosen hits are and where their rays begin, (3, N) each, local, m."""
        begin = self._join(hits, self._of_pulses("origin"), self.traced.begins)
        return begin + self.pick("distance", hits) * self.directions(hits), begin

    def directions(self, hits: Index) -> Float:
        """Return the directions (3, N) of chosen hits' rays."""
        return self._join(hits, self._of_pulses("direction"), self.traced.directions)

    def times(self, hits: Index) -> Float:
        """Return when the rays of chosen hits (N,) were emitted, s."""
        return self._join(hits, self._of_pulses("time"), self.traced.times)

    def _of_pulses(self, name: str) -> Float:
        """Return a quantity (..., S) of the spared pulses."""
        return np.take(getattr(self.pulses, name), self.spared.pulse, axis=-1)

    def _join(self, hits: Index, spared: AnyArray, of_traced: Callable[[Index], AnyArray]) -> AnyArray:
        """Return values (..., N) of hits, of the spared pulses' axes (..., S) or by what gives those of traced rays."""
        others = np.flatnonzero(hits < self.traced.count)
        if not spared.shape[-1]:
            return of_traced(hits)
        result = np.take(spared, hits - self.traced.count, axis=-1, mode="clip")
        if len(others):
            result[..., others] = of_traced(hits[others])
        return np.asarray(result)


Traced = TracedRays | PartlyTraced | TracedPulses


def count_footprints(target: Target, met: FirstHits, spared: SparedPulses) -> Int:
    """Return the numbers (3, 256) of pulses by the class that their axis meets.

    These are all pulses, the spared ones of which one ray was cast, and those whose other rays were looked along.
    """
    of_axes = target.face_values("class_id", met.face[met.face >= 0])
    one = spared.one_ray
    of_spared = [target.face_values("class_id", spared.face[rows]) for rows in (one, ~one)]
    return np.array([np.bincount(classes, minlength=256) for classes in (of_axes, *of_spared)], np.int64)
