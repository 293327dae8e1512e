"""`EchoTracer`: what the rays of a block's pulses meet, and the echoes that come back of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.arrays import Float, Int
from ...base.random_streams import stream
from ...materials.surfaces import brightness_of, spread_factors
from ..beam import conical_directions, cylindrical_offsets
from ..effects import apply_effect
from ..kernels.hits import TracedPulses
from ..kernels.pulses import PulseKernel
from ..knots import Track
from ..multipath import Multipath
from ..plan import ScanPlan
from ..platforms.path import Strip
from ..pulses import Pulses
from ..receiving.radiometry import received_intensity
from ..returns import LEAST_REFLECTANCE, BothSignals, Echoes, HitSignals, group_returns, merge_echoes
from ..scene.target import FirstHits
from ..sparing import PartlyTraced, Sparing, Traced, count_footprints
from ..trace import Hits, Rays, TracedRays, trace


class Tally(NamedTuple):
    """Counts of a block.

    Attributes:
        rays: that were cast at what is first in their way.
        footprints: (3, 256) pulses by class, see `sparing.count_footprints`; None where none could be spared.
    """

    rays: int
    footprints: Int | None = None


class TracedEchoes(NamedTuple):
    """Echoes of a block's pulses.

    Attributes:
        traced: hits of the pulses' rays, which the echoes name by number.
        echoes: of the pulses, before any is lost.
        tally: counts.
    """

    traced: Traced
    echoes: Echoes
    tally: Tally


@dataclass(frozen=True)
class EchoTracer:
    """Tracing of the pulses of a plan's blocks to their echoes.

    Attributes:
        plan: the scan.
    """

    plan: ScanPlan

    @property
    def in_air(self) -> bool:
        """Return whether effects may add echoes to pulses that meet no surface."""
        return bool(self.plan.atmosphere.effects and self.plan.target.triangles)

    @property
    def off_surfaces(self) -> bool:
        """Return whether there may be echoes that come from no surface: of the air, or ghosts."""
        return self.in_air or self.plan.reflection.multipath is not None

    def traced_echoes(self, strip: Strip, pulses: Pulses, motions: list[Track], key: int) -> TracedEchoes:
        """Return what the rays of pulses meet, the echoes that they give before any is lost, and counts.

        Args:
            strip: of the pulses.
            pulses: of a block.
            motions: tracks of the target's moving parts.
            key: of random streams.
        """
        plan, setting = self.plan, self.plan.setting
        if plan.spares:
            return self._spared_echoes(pulses, motions)
        kernel, tally = self._kernel_of(len(pulses.time)), Tally(len(pulses.time) * plan.rays_per_pulse)
        if kernel is not None and not self.off_surfaces:
            return TracedEchoes(*kernel.trace(pulses, motions), tally)
        if kernel is None:
            traced_rays = self.trace_rays(pulses, motions)
            signals = self.signals(traced_rays)
        else:
            traced_rays, signals = kernel.follow(pulses, motions)
        # Ghosts first: effects weaken what mirrors send back as well.
        if plan.reflection.multipath is not None:
            traced_rays, signals = self.add_ghosts(plan.reflection.multipath, traced_rays, signals, motions)
        for effect in plan.atmosphere.effects if self.in_air else ():
            random = stream(plan.run.seed, f"effect {effect.name}", strip.index, key)
            traced_rays, signals = apply_effect(
                effect, random, setting, plan.atmosphere.attenuation, pulses, traced_rays, signals
            )
        if kernel is None:
            echoes = group_returns(*signals, traced_rays.pulse, setting.range_resolution)
        else:
            echoes = kernel.group(signals, traced_rays.ray)
        return TracedEchoes(traced_rays, echoes, tally)

    def _kernel_of(self, pulses: int) -> PulseKernel | None:
        """Return the compiled loops for a number of pulses; None for NumPy, as for a single one: see `PulseKernel`."""
        kernel = self.plan.pulse_kernel
        return kernel if isinstance(kernel, PulseKernel) and pulses > 1 else None

    def _spared_echoes(self, pulses: Pulses, motions: list[Track]) -> TracedEchoes:
        """Return `traced_echoes` where footprints that meet one plane alone aren't cast in full."""
        plan, setting = self.plan, self.plan.setting
        axis_hits = plan.target.cast(pulses.origin, pulses.direction, setting.maximum_range, pulses.time, motions)
        sparing = Sparing(plan)
        spared = sparing.find(pulses, axis_hits, motions)
        cast_mask = np.ones(len(pulses.time), bool)
        cast_mask[spared.pulse] = False
        cast_mask[sparing.find_missing(pulses, axis_hits, motions)] = False
        cast_pulses = np.flatnonzero(cast_mask)
        # The other pulses are cast in full, but for their axes.
        traced: TracedRays | TracedPulses
        selected_pulses, selected_hits = pulses.select(cast_pulses), axis_hits.take(cast_pulses)
        if (kernel := self._kernel_of(len(cast_pulses))) is not None:
            traced, echoes = kernel.trace(selected_pulses, motions, selected_hits)
        else:
            traced = self.trace_rays(selected_pulses, motions, selected_hits)
            echoes = group_returns(*self.signals(traced), traced.pulse, setting.range_resolution)
        echoes = replace(echoes, pulse=cast_pulses[echoes.pulse])
        echoes = merge_echoes(echoes, sparing.echoes(spared, traced.count))
        rays = len(axis_hits.face) + (plan.rays_per_pulse - 1) * len(cast_pulses)
        tally = Tally(rays, count_footprints(plan.target, axis_hits, spared))
        return TracedEchoes(PartlyTraced(traced, spared, pulses), echoes, tally)

    def trace_rays(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None = None) -> TracedRays:
        """Return what all rays of pulses meet, by NumPy.

        Args:
            pulses: P pulses.
            motions: tracks of the target's moving parts.
            axis: (P,) what the pulses' axes meet, if these were cast already: they aren't cast again.
        """
        plan, setting = self.plan, self.plan.setting
        limits = (setting.minimum_range, setting.maximum_range)
        rays = self.rays(pulses, motions, axis)
        return trace(plan.target, plan.reflection.surfaces, rays, motions, *limits, axis, plan.openings)

    def rays(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None = None) -> Rays:
        """Return the K rays that sample each pulse's footprint; a cylindrical beam is cast once to find its range.

        Args:
            pulses: P pulses.
            motions: tracks of the target's moving parts.
            axis: (P,) what the pulses' axes meet, if these were cast already.
        """
        pattern, setting = self.plan.emission.pattern, self.plan.setting
        origin, share = pulses.origin[:, None, :], pattern.weights[:, None]
        if len(pattern) == 1:
            return Rays(origin, pulses.direction[:, None, :], share, pulses.time)
        assert pulses.in_plane is not None
        assert pulses.across is not None
        footprint = (pulses.in_plane, pulses.across, pattern, setting.divergence)
        if self.plan.emission.beam == "conical":
            return Rays(origin, conical_directions(pulses.direction, *footprint), share, pulses.time)
        axis_hits = axis or self.plan.target.cast(
            pulses.origin, pulses.direction, setting.maximum_range, pulses.time, motions
        )
        offsets = cylindrical_offsets(*footprint, axis_hits.distance)
        direction = np.repeat(pulses.direction[:, None, :], len(pattern), axis=1)
        return Rays(origin + offsets, direction, share, pulses.time)

    def signals(self, traced_rays: TracedRays) -> BothSignals:
        """Return the signals of traced rays' hits: of what each ray meets first, and of what lies behind it."""
        return self._signals(traced_rays.first), self._signals(traced_rays.behind)

    def _signals(self, hits: Hits) -> HitSignals:
        """Return the signals that hits send back: ranges, their weights in mean ranges, and received intensities."""
        surfaces, material = self.plan.reflection.surfaces, hits.material.ravel()
        brightness = brightness_of(surfaces, material, np.abs(hits.cosine.ravel())).reshape(hits.face.shape)
        brightness *= hits.share
        weight = np.maximum(np.take(surfaces.reflectivity, material), LEAST_REFLECTANCE).reshape(hits.face.shape)
        weight *= hits.share
        intensity: Float = received_intensity(brightness, hits.distance, self.plan.atmosphere.attenuation)
        return HitSignals(hits.distance, weight, intensity)

    def add_ghosts(
        self, multipath: Multipath, traced_rays: TracedRays, signals: BothSignals, motions: list[Track]
    ) -> tuple[TracedRays, BothSignals]:
        """Return traced rays and signals with the echoes of what surfaces mirror among those that lie behind.

        Args:
            multipath: how surfaces mirror.
            traced_rays: of a block.
            signals: of what they meet first, and of what lies behind.
            motions: tracks of the target's moving parts.
        """
        plan, (first_signals, late_signals) = self.plan, signals
        hits, ray, ghosts = multipath.ghosts(
            plan.target, plan.reflection.surfaces, plan.setting, plan.atmosphere.attenuation, traced_rays, motions
        )
        late_hits = Hits.join([traced_rays.behind, hits])
        traced_rays = replace(traced_rays, behind=late_hits, ray=np.concatenate([traced_rays.ray, ray]))
        return traced_rays, (first_signals, HitSignals.join([late_signals, ghosts]))

    def vary_brightness(self, traced: Traced, echoes: Echoes, motions: list[Track]) -> Echoes:
        """Return the echoes with intensities scaled by how their materials' reflectance varies in space."""
        surfaces, target = self.plan.reflection.surfaces, self.plan.target
        material = traced.pick("material", echoes.hit)
        rows = np.flatnonzero(np.take(surfaces.uneven, material, mode="clip"))
        if self.off_surfaces:  # echoes without a face have any material
            rows = rows[traced.pick("face", echoes.hit[rows]) >= 0]
        if not len(rows):
            return echoes
        hit_numbers = echoes.hit[rows]
        position, _ = traced.ends(hit_numbers)  # (3, N) local, m
        if target.moving:
            # The pattern sticks to bodies that move: it is read where they are at time 0.
            face, times = traced.pick("face", hit_numbers), traced.times(hit_numbers)
            (position,) = target.at_time_zero(face, position, times, motions)
        intensity = echoes.intensity.copy()
        place = position.T + self.plan.reflection.frame_origin
        intensity[rows] *= spread_factors(surfaces, material[rows], place, self.plan.reflection.surface_seed)
        return replace(echoes, intensity=intensity)
