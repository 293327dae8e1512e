"""One block of pulses, from the path to the points. Pure arrays: the casters are all that knows the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.arrays import Int
from ..cloud.points import PointBlock, concatenate
from .colour.colour import SeenPoints
from .plan import ScanPlan
from .platforms.path import Strip
from .receiving.detector import Readout, detect_echoes
from .receiving.waveform import merge_peaks
from .returns import number_returns
from .stages.echoes import EchoTracer
from .stages.emission import PulseEmitter
from .stages.placing import PointPlacer, RecordedEchoes
from .strip_errors import strip_gain


@dataclass(frozen=True)
class BlockResult:
    """Points of one block, or of several joined, and counts of pulses, rays and lost returns.

    Attributes:
        points: as measured.
        seen: where, if the scan was to say so.
        pulses, rays: emitted, and cast at what is first in their way.
        below_threshold, saturated: returns that the detector lost or clipped.
        sources: (256,) points by the source of their colour, once they are finished.
        blocks: how many blocks these are.
        readout: what the receiver is still to make of the points; None once it is done.
        footprints: (3, 256) pulses by class, see `sparing.count_footprints`; None where none could be spared.
    """

    points: PointBlock
    seen: SeenPoints | None
    pulses: int
    rays: int
    below_threshold: int
    saturated: int
    sources: Int | None = None
    blocks: int = 1
    readout: Readout | None = None
    footprints: Int | None = None


def join_results(results: list[BlockResult]) -> BlockResult:
    """Return the results of several blocks, none of them finished yet, joined into one in their order."""
    seen_points = [result.seen for result in results if result.seen is not None]
    footprints = [result.footprints for result in results if result.footprints is not None]
    readouts = [result.readout for result in results if result.readout is not None]

    def total(name: str) -> int:
        """Return the sum of a count over the results."""
        return sum(getattr(result, name) for result in results)

    return BlockResult(
        points=concatenate([result.points for result in results]),
        seen=SeenPoints.join(seen_points) if seen_points else None,
        pulses=total("pulses"),
        rays=total("rays"),
        below_threshold=total("below_threshold"),
        saturated=total("saturated"),
        blocks=total("blocks"),
        readout=Readout.join(readouts) if readouts else None,
        footprints=np.sum(footprints, axis=0) if footprints else None,
    )


@dataclass(frozen=True)
class BlockScan:
    """Simulation of the blocks of a plan, from pulses to points, in any order and by any thread.

    Attributes:
        plan: the scan.
    """

    plan: ScanPlan

    @cached_property
    def emitter(self) -> PulseEmitter:
        """Return the stage that makes pulses."""
        return PulseEmitter(self.plan)

    @cached_property
    def tracer(self) -> EchoTracer:
        """Return the stage that traces pulses to their echoes."""
        return EchoTracer(self.plan)

    @cached_property
    def placer(self) -> PointPlacer:
        """Return the stage that makes points of echoes."""
        return PointPlacer(self.plan, self.tracer.off_surfaces)

    def scan_block(self, strip: Strip, block: int) -> BlockResult:
        """Scan the block of a strip with this number; return its points and counts."""
        return self.scan_pulses(strip, *self.plan.cut.pulse_span(strip, block), block)

    def scan_pulses(self, strip: Strip, first_pulse: int, count: int, key: int = 0) -> BlockResult:
        """Scan pulses of a strip; return their points and counts.

        A block isn't cut any smaller, though its arrays leave the processor's cache: blocks are scanned side by side in
        threads that take turns in Python, so that few long calls beat many short ones.

        Args:
            strip: of the pulses.
            first_pulse: number of the first one within the strip.
            count: of pulses.
            key: seeds random streams, with the strip.
        """
        plan, setting = self.plan, self.plan.setting
        errors = self.emitter.draw_errors(strip, count, key)
        begin, end = (plan.cut.time(strip, pulse) for pulse in (first_pulse, first_pulse + count - 1))
        poses = self.emitter.poses_between(strip, begin, end)
        beams = self.emitter.aim(strip, poses, errors.angle, first_pulse, count)
        # In the air, echoes come from pulses into the sky as well.
        rows = None if self.tracer.in_air else self.emitter.beams_towards_scene(beams, poses.motions)
        pulse_number = np.arange(count) if rows is None else rows  # of each pulse within the block
        pulses = self.emitter.fire(beams, poses, errors.angle, rows)
        traced, echoes, tally = self.tracer.traced_echoes(strip, pulses, poses.motions, key)
        if setting.receiver.echo_separation == "waveform":
            echoes = merge_peaks(echoes, setting.range_resolution)
        if plan.reflection.surfaces.varying:
            echoes = self.tracer.vary_brightness(traced, echoes, poses.motions)
        if (gain := strip_gain(plan.reception.strip_errors, plan.run.seed, strip.index)) != 1.0:
            echoes = replace(echoes, intensity=echoes.intensity * gain)
        is_provisional = plan.reception.after_layers
        echoes, readout, weak_count = detect_echoes(
            echoes,
            errors,
            pulse_number,
            pulses.channel,
            setting,
            dropout=plan.reception.noise.dropout,
            provisional=is_provisional,
        )
        recorded_mask, number, returns = number_returns(echoes.pulse, plan.most_returns)
        if not recorded_mask.all():
            echoes, readout = echoes.select(recorded_mask), readout.select(recorded_mask)
        recorded = RecordedEchoes(echoes, number, returns, readout.speckle, pulse_number)
        points, seen_points = self.placer.points(strip, pulses, traced, recorded, errors, poses.motions)
        result = BlockResult(points, seen_points, count, tally.rays, weak_count, 0, footprints=tally.footprints)
        if is_provisional:  # the layers still change intensities: `finish.read_echoes` reads them out
            return replace(result, readout=readout)
        intensity, clipped_count = readout.read(points.intensity, points.range, setting, plan.gains)
        return replace(result, points=replace(points, intensity=intensity), saturated=clipped_count)
