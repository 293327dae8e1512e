"""Pilot measurements: what settings would cost on a scene, and how large their errors would be, from short stretches.

Errors are taken of single scan lines scattered over the path, against the same pulses with the converged footprint;
times of longer stretches that go through the whole job to a file. Noise of the scanner is left out of the errors.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.machine import available_cores
from ...base.progress import StageTimer
from ...blender.services import BlenderServices
from ...cloud.points import PointBlock
from ...scanning.beam import RINGS, beam_pattern
from ...scanning.blocks import Blocks
from ...scanning.noise import Noise
from ...scanning.plan import ScanConditions, ScanPlan
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.record import record_as_measured
from ...scanning.relief import adjusted
from ...scanning.samples import Stretches, scattered
from ...scanning.scan import BlockResult, joined_results
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario
from ..measure.errors import CONVERGED, paired
from ..scan.files import CloudFiles, record_to_files
from ..scan.plan import plan_scan
from .choice import quantile_bound, ratio_bound

Float = NDArray[np.float64]
Errors = dict[str, tuple[float, float]]
"""Kind -> expected error and its upper bound."""

LINES, PULSES = 64, 1024
"""Stretches that errors are taken of, and the pulses of each."""
_TIMED_PULSES = 1 << 15
"""Pulses of each stretch that is timed: as many as blocks are worth."""
_TIMED = 8
_TIMED_SHARE = 0.1
"""Stretches that are timed, and the largest share of the path that they may be."""
_QUANTILE = 0.95
_FINEST = 8
"""Octaves of the micro-relief that counts as truth."""


@dataclass
class Pilot:
    """A scene that is tried out.

    Attributes:
        scenario: the job.
        scene: what is scanned.
        scan: of the whole path, without noise.
        conditions: of the scene's road.
        phase: see `scanning.samples.scattered`: other phases are other stretches.
        lines: of these is the error taken.
        clock: measures seconds.
    """

    scenario: Scenario
    scene: ScannedScene
    scan: ScanPlan
    conditions: ScanConditions
    phase: float = 0.5
    lines: int = LINES
    clock: Callable[[], float] = time.perf_counter

    @classmethod
    def on(
        cls,
        scenario: Scenario,
        scene: ScannedScene,
        path: ScanPath,
        conditions: ScanConditions,
        phase: float = 0.5,
        lines: int = LINES,
    ) -> Pilot:
        """Prepare to scan a scene; builds the casters."""
        quiet = scenario.scan.model_copy(update={"noise": Noise(range_sigma=0.0)})
        colour = scenario.colour.model_copy(update={"intensity_from_layers": False})
        scenario = scenario.model_copy(update={"scan": quiet, "colour": colour})
        plan = plan_scan(scenario, scene, path, BlenderServices(), conditions)
        return cls(scenario, scene, plan, conditions, phase, lines)

    def stretches(self) -> Stretches:
        """Return the stretches that errors are taken of."""
        return scattered(self.scan.path, self.lines, PULSES / self.scan.setting.shot_rate, self.phase)

    def results(self, rings: tuple[int, ...], path: Stretches) -> list[BlockResult]:
        """Scan stretches with a beam; return the points of each, with the places that were seen, in their order."""
        results = iter(record_as_measured(replace(self.scan, path=path, rings=rings)))
        blocks = Blocks(self.scan.setting, path, len(beam_pattern(rings).weights))
        return [joined_results([next(results) for _ in blocks.of(strip)]) for strip in path.strips]

    def truth(self) -> list[PointBlock]:
        """Return the points of the stretches with the converged footprint."""
        return [result.points for result in self.results(RINGS[CONVERGED], self.stretches())]

    def beam_errors(self, rings: tuple[int, ...], truth: Sequence[PointBlock]) -> Errors:
        """Return the errors of a beam against the truth, by kind."""
        mine = [result.points for result in self.results(rings, self.stretches())]
        return beam_errors(mine, truth)

    def relief_errors(self, octaves: Iterable[int]) -> dict[int, tuple[Errors, float]]:
        """Return the error of the micro-relief by octaves, and seconds per million points of one core."""
        results = [one for one in self.results(RINGS[1], self.stretches()) if len(one.points)]
        relief, strength, seed = self.scan.relief, self.scan.relief_strength, self.scan.seed
        assert relief is not None

        def shifted(number: int) -> tuple[list[Float], float]:
            begin = self.clock()
            places = [
                adjusted(one.points, one.seen.position, relief, strength, seed, number).xyz
                for one in results
                if one.seen is not None
            ]
            return places, self.clock() - begin

        finest, _ = shifted(_FINEST)
        points = max(1, sum(map(len, finest)))
        found = {}
        for number in octaves:
            mine, seconds = shifted(number)
            parts = [np.linalg.norm(a - b, axis=1) for a, b in zip(mine, finest, strict=True)]
            found[number] = {"relief": quantile_bound(parts, _QUANTILE, "relief")}, 1e6 * seconds / points
        return found

    def scan_seconds(self, rays: Mapping[int, tuple[int, ...]]) -> tuple[dict[int, float], int]:
        """Return the seconds of the whole scan into files by rays per pulse, and its points.

        Colours are the materials' means and the relief is the coarsest: what more than that costs is known apart.
        """
        count = max(_TIMED, 2 * available_cores())
        path = scattered(self.scan.path, count, _TIMED_PULSES / self.scan.setting.shot_rate, 0.5, _TIMED_SHARE)
        assert self.scan.request is not None
        means = replace(self.scan.request.settings, source="material")
        plain = replace(self.scan, relief_octaves=2, request=replace(self.scan.request, settings=means))
        # Pulses come in whole lines, so that stretches hold fewer of them than their duration says.
        share = sum(map(self.scan.pulses, path.strips)) / sum(map(self.scan.pulses, path.whole.strips))
        times, points = {}, 0
        for number, rings in rays.items():
            plan = replace(plain, path=path, rings=rings)
            with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
                files = CloudFiles(self.scenario, Path(folder), plan.target.origin, path.typical_range)
                begin = self.clock()
                record_to_files([plan], files, StageTimer())
                times[number] = (self.clock() - begin) / share
            points = round(files.counts.points / share)
        return times, points


def beam_errors(mine: Sequence[PointBlock], truth: Sequence[PointBlock]) -> Errors:
    """Return position, intensity, labels and density of stretches against the truth, with their upper bounds."""
    pairs = [paired(a, b) for a, b in zip(mine, truth, strict=True)]
    position = [np.linalg.norm(a.xyz - b.xyz, axis=1) for a, b in pairs]
    intensity = [np.abs(a.intensity / b.intensity - 1.0) for a, b in pairs]
    wrong = np.array([float((a.class_id != b.class_id).sum()) for a, b in pairs])
    number = np.array([float(len(a)) for a, _ in pairs])
    points, true = (np.array([float(len(one)) for one in several]) for several in (mine, truth))
    fewer, most_fewer = ratio_bound(true - points, true, "density")
    more, most_more = ratio_bound(points - true, true, "density")
    return {
        "position": quantile_bound(position, _QUANTILE, "position"),
        "intensity": quantile_bound(intensity, _QUANTILE, "intensity"),
        "labels": ratio_bound(wrong, number, "labels"),
        "density": (max(fewer, more), max(most_fewer, most_more)),
    }
