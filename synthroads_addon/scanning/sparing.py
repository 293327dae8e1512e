"""Pulses whose footprint is one plane of pavement or ground: their returns follow from the ray along their axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

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
        cosine: (S,) n . d of the face's normal and the axis.
        steepness: (S, 2) by how much of its range a ray is nearer for each radian that it is deflected in the scan
            plane, and across it.
        one_ray: (S,) whether the axis was all that had to be cast, and not whether the other rays are blocked.
    """

    pulse: Index
    face: Index
    material: Index
    distance: Float
    cosine: Float
    steepness: Float
    one_ray: Bool


class _RayShape(NamedTuple):
    """One of the rays that sample a pulse.

    Attributes:
        share: of the pulse's energy.
        length: component of the ray's unit vector along the beam's axis.
        in_plane, across: its deflections, rad, in the scan plane and across it.
    """

    share: float
    length: float
    in_plane: float
    across: float


@dataclass(frozen=True)
class Sparing:
    """Footprints of a plan's pulses that needn't be cast in full, as all of their rays meet one plane.

    Attributes:
        plan: the scan; its ``ground`` says where planes are.
    """

    plan: ScanPlan

    @cached_property
    def _rays(self) -> list[_RayShape]:
        """Return the shape of each ray of a pulse, the axis first."""
        emission, radii = self.plan.emission, beam_radii(self.plan.setting.divergence)
        shapes = []
        for (x, y), share in zip(emission.pattern.across.tolist(), emission.pattern.weights.tolist(), strict=True):
            in_plane, across = x * radii[0], y * radii[1]
            length = 1.0 / np.sqrt(1.0 + in_plane * in_plane + across * across) if emission.beam == "conical" else 1.0
            shapes.append(_RayShape(share, length, in_plane, across))
        return shapes

    @cached_property
    def _reach(self) -> Float:
        """Return the half axes (2,), rad, in the scan plane and across it, of the ellipse that holds a pulse's rays."""
        return np.array(outer_radii(self.plan.emission.rings, self.plan.setting.divergence))

    def find(self, pulses: Pulses, axis_hits: FirstHits, motions: list[Track]) -> SparedPulses:
        """Return the pulses whose whole footprint meets one plane, with what their axes meet.

        Args:
            pulses: P pulses of a block.
            axis_hits: (P,) what their axes meet.
            motions: tracks of the target's moving parts.
        """
        plan, ground = self.plan, self.plan.emission.ground
        assert ground is not None
        assert pulses.in_plane is not None
        assert pulses.across is not None
        # Candidates: axes that meet pavement or ground steeply enough.
        face = axis_hits.face
        on_ground = np.take(ground.face, face, mode="clip") & (face >= 0) & (face < len(ground.face))
        on_ground &= (axis_hits.cosine <= -_GRAZING) & (pulses.direction[2] <= -_GRAZING)
        rows = np.flatnonzero(on_ground)
        face, distance, cosine = axis_hits.take(rows)
        direction, normal = np.take(pulses.direction, rows, axis=1), plan.target.static_normals(face)
        # Half axes of the footprints on their planes: along the beam d, a vector v across it is projected onto the
        # plane as v - (v . n / d . n) d.
        half_axes, steepness = [], np.empty((len(rows), 2))
        for i, axis in enumerate((pulses.in_plane, pulses.across)):
            beam_axis = np.take(axis, rows, axis=1)
            slope = dot(beam_axis, normal)
            slope /= cosine
            steepness[:, i] = slope
            beam_axis -= slope * direction
            beam_axis *= self._reach[i] * distance
            half_axes.append(beam_axis)
        one_return = self._single_returns(distance, steepness)
        place = np.take(pulses.origin, rows, axis=1) + distance * direction
        one_plane, unblocked = ground.check_footprints(face, place, (half_axes[0], half_axes[1]), -direction)
        material = np.take(plan.target.material, face).astype(np.intp)
        candidates = SparedPulses(rows, face, material, distance, cosine, steepness, unblocked & one_plane)
        candidates = candidates.select(np.flatnonzero(one_plane & one_return))
        if plan.target.moving:
            candidates = candidates.select(np.flatnonzero(~self._near_traffic(candidates, pulses, motions)))
        return self._unblocked(candidates, pulses)

    def find_missing(self, pulses: Pulses, axis_hits: FirstHits, motions: list[Track]) -> Index:
        """Return the pulses whose whole beam passes by everything, of those whose axis meets nothing.

        Args:
            pulses: P pulses of a block.
            axis_hits: (P,) what their axes meet.
            motions: tracks of the target's moving parts.
        """
        plan, ground = self.plan, self.plan.emission.ground
        assert ground is not None
        spread = float(self._reach.max())
        rows = np.flatnonzero(axis_hits.face < 0)
        origin, direction = (np.take(vectors, rows, axis=1) for vectors in (pulses.origin, pulses.direction))
        passes_by = ground.passed_by(origin, direction, spread)
        rows = rows[passes_by]
        if not plan.target.moving:
            return rows
        origin, direction = origin[:, passes_by], direction[:, passes_by]
        reach = np.full(len(rows), plan.setting.maximum_range)
        radius = spread * plan.setting.maximum_range
        near_traffic = plan.target.near_moving(origin, direction, reach, pulses.time[rows], motions, radius)
        return rows[~near_traffic]

    def _single_returns(self, distance: Float, steepness: Float) -> Bool:
        """Return a mask (N,) of the footprints all of whose rays give one return, within the scanner's reach.

        Args:
            distance: (N,) range of the axis, m.
            steepness: (N, 2) see `SparedPulses`.
        """
        setting = self.plan.setting
        # Share of its range by which a footprint's outermost ray may be nearer or farther than the axis: by the plane's
        # slope, and as rays diverge.
        relative_depth = np.hypot(steepness[:, 0] * self._reach[0], steepness[:, 1] * self._reach[1])
        relative_depth += 0.5 * float(self._reach.max()) ** 2
        # 1 / (1 - d) is less than 1 + 1.2 d for depths d up to `_WIDEST`.
        nearest_range, farthest_range = distance * (1.0 - relative_depth), distance * (1.0 + 1.2 * relative_depth)
        in_reach = (nearest_range >= setting.minimum_range) & (farthest_range <= setting.maximum_range)
        one_return = farthest_range - nearest_range <= setting.range_resolution
        return np.asarray((relative_depth <= _WIDEST) & one_return & in_reach)

    def _near_traffic(self, spared: SparedPulses, pulses: Pulses, motions: list[Track]) -> Bool:
        """Return which spared pulses (S,) pass a moving part by less than their beam's radius."""
        radius = float(self._reach.max() * spared.distance.max(initial=0.0))
        origin, direction = (np.take(vectors, spared.pulse, axis=1) for vectors in (pulses.origin, pulses.direction))
        times = pulses.time[spared.pulse]
        return self.plan.target.near_moving(origin, direction, spared.distance, times, motions, radius)

    def _unblocked(self, spared: SparedPulses, pulses: Pulses) -> SparedPulses:
        """Return the spared pulses without those of which something stands in the way of an outer ray.

        Rays are cast only for pulses of which that isn't known yet, those without ``one_ray``.
        """
        doubtful = np.flatnonzero(~spared.one_ray)
        if not len(doubtful):
            return spared
        doubtful_pulses = spared.select(doubtful)
        origin, direction = self._outer_rays(pulses, doubtful_pulses)
        # Rays end a little before the plane, and before what may stand out of it where faces meet at a crease.
        reach = np.stack([distance for _, distance, _ in self._ray_hits(doubtful_pulses)][1:])
        incidence_cosine = np.abs(doubtful_pulses.cosine)
        half_axis = np.abs(self._reach).max() * doubtful_pulses.distance / incidence_cosine
        reach -= _CLEARANCE + 2.0 * CREASE * half_axis / incidence_cosine
        is_free = self.plan.target.unblocked(origin, direction, reach).all(axis=0)
        keep_mask = np.ones(len(spared.pulse), bool)
        keep_mask[doubtful[~is_free]] = False
        return spared.select(np.flatnonzero(keep_mask))

    def _outer_rays(self, pulses: Pulses, spared: SparedPulses) -> tuple[Float, Float]:
        """Return origins (3, 1 or K - 1, S) and directions (3, K - 1, S) of the rays around the axes of pulses."""
        plan = self.plan
        outer_pattern = plan.emission.pattern
        outer_pattern = replace(outer_pattern, across=outer_pattern.across[1:], weights=outer_pattern.weights[1:])
        assert pulses.in_plane is not None
        assert pulses.across is not None
        vectors = (pulses.origin, pulses.direction, pulses.in_plane, pulses.across)
        origin, direction, in_plane, across = (np.take(array, spared.pulse, axis=1) for array in vectors)
        if plan.emission.beam == "conical":
            beam = conical_directions(direction, in_plane, across, outer_pattern, plan.setting.divergence)
            return origin[:, None, :], beam
        offsets = cylindrical_offsets(in_plane, across, outer_pattern, plan.setting.divergence, spared.distance)
        return origin[:, None, :] + offsets, np.repeat(direction[:, None, :], len(outer_pattern), axis=1)

    def _ray_hits(self, spared: SparedPulses) -> Iterator[tuple[float, Float, Float]]:
        """Yield share of energy, range (S,), m, and n . d (S,) of each ray of spared pulses, the axis first."""
        conical = self.plan.emission.beam == "conical"
        for share, length, in_plane, across in self._rays:
            # By how much nearer than the axis the deflected ray meets the plane, as a share of the axis's range.
            depth = in_plane * spared.steepness[:, 0]
            depth += across * spared.steepness[:, 1]
            if conical:
                # d = length (axis + deflection), so that n . d = length (1 + depth) times n . axis.
                stretch = depth
                stretch += 1.0
                stretch *= length
                yield share, spared.distance / stretch, spared.cosine * stretch
            else:
                yield share, spared.distance * (1.0 - depth), spared.cosine

    def echoes(self, spared: SparedPulses, first_hit: int) -> Echoes:
        """Return the one echo of each spared pulse, as all rays of its footprint together give it.

        Args:
            spared: S pulses.
            first_hit: number, among all hits of the block, of the hit of the first spared pulse's axis.
        """
        surfaces, count = self.plan.reflection.surfaces, len(spared.pulse)
        range_offset, energy = np.zeros(count), np.zeros(count)
        for share, distance, cosine in self._ray_hits(spared):
            brightness = brightness_of(surfaces, spared.material, np.abs(cosine))
            brightness *= share
            energy += received_intensity(brightness, distance, self.plan.atmosphere.attenuation)
            range_offset += share * (distance - spared.distance)
        weight = np.maximum(np.take(surfaces.reflectivity, spared.material), LEAST_REFLECTANCE)
        return Echoes(spared.pulse, first_hit + np.arange(count), spared.distance + range_offset, energy, weight)


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

    def _join(self, hits: Index, spared: AnyArray, values_of_traced: Callable[[Index], AnyArray]) -> AnyArray:
        """Return values (..., N) of hits by their numbers: first those of traced rays, then those of spared pulses.

        Args:
            hits: (N,) numbers.
            spared: (..., S) values of the spared pulses' axes.
            values_of_traced: returns the values (..., M) of M hits of traced rays.
        """
        traced_rows = np.flatnonzero(hits < self.traced.count)
        if not spared.shape[-1]:
            return values_of_traced(hits)
        result = np.take(spared, hits - self.traced.count, axis=-1, mode="clip")
        if len(traced_rows):
            result[..., traced_rows] = values_of_traced(hits[traced_rows])
        return np.asarray(result)


Traced = TracedRays | PartlyTraced | TracedPulses


def count_footprints(target: Target, axis_hits: FirstHits, spared: SparedPulses) -> Int:
    """Return the numbers (3, 256) of pulses by the class that their axis meets.

    The rows are all pulses, the spared pulses of which one ray was cast, and the spared pulses whose other rays were
    cast as well to see whether anything blocks them.
    """
    of_axes = target.face_values("class_id", axis_hits.face[axis_hits.face >= 0])
    one_ray = spared.one_ray
    of_spared = [target.face_values("class_id", spared.face[rows]) for rows in (one_ray, ~one_ray)]
    return np.array([np.bincount(classes, minlength=256) for classes in (of_axes, *of_spared)], np.int64)
