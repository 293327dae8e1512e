"""Pilot measurements: what settings would cost on a scene, and how large their errors would be, from short stretches.

Errors are taken of single scan lines scattered over the path, against the same pulses with the converged footprint;
times of longer stretches that go through the whole job to a file. Noise of the scanner is left out of the errors.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.machine import available_cores
from ...blender.cameras import layer_source
from ...cloud.points import PointBlock
from ...road.surroundings import Environment, MaterialVariation
from ...scanning.beam import RINGS
from ...scanning.noise import Noise
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.relief import adjusted, micro_relief
from ...scanning.samples import Stretches, scattered
from ...scanning.scan import BlockResult, Scan, joined_results, scan_block
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario
from ..measure.errors import CONVERGED, paired
from ..scan.files import ScanToFiles, colour_job, make_scan, material_rows
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


@dataclass(frozen=True)
class Air:
    """What the road says of a scan beside its geometry."""

    environment: Environment | None = None
    variation: MaterialVariation | None = None


@dataclass
class Pilot:
    """A scene that is tried out.

    Attributes:
        scenario: the job.
        scene: what is scanned.
        scan: of the whole path, without noise.
        air: of the scene's road.
        phase: see `scanning.samples.scattered`: other phases are other stretches.
        lines: of these is the error taken.
        clock: measures seconds.
    """

    scenario: Scenario
    scene: ScannedScene
    scan: Scan
    air: Air
    phase: float = 0.5
    lines: int = LINES
    clock: Callable[[], float] = time.perf_counter

    @classmethod
    def on(
        cls, scenario: Scenario, scene: ScannedScene, path: ScanPath, air: Air, phase: float = 0.5, lines: int = LINES
    ) -> Pilot:
        """Prepare to scan a scene; builds the casters."""
        quiet = scenario.scan.model_copy(update={"noise": Noise(range_sigma=0.0)})
        colour = scenario.colour.model_copy(update={"intensity_from_layers": False})
        scenario = scenario.model_copy(update={"scan": quiet, "colour": colour})
        scan = make_scan(scenario, scene, path, air.environment, None, air.variation)
        return cls(scenario, scene, scan, air, phase, lines)

    def stretches(self) -> Stretches:
        """Return the stretches that errors are taken of."""
        return scattered(self.scan.path, self.lines, PULSES / self.scan.setting.shot_rate, self.phase)

    def results(self, rings: tuple[int, ...], path: Stretches, targets: bool = False) -> list[BlockResult]:
        """Scan stretches with a beam; return their points in their order."""
        wanted = frozenset({"normal", "material"}) if targets else frozenset[str]()
        scan = replace(self.scan, path=path, rings=rings, targets=targets, wanted=wanted)

        def one(number: int) -> BlockResult:
            # A path of its own: stretches of one strip can't be told from each other by its index.
            part = replace(scan, path=Stretches(path.whole, (path.strips[number],)))
            return joined_results([scan_block(part, *block) for block in part.blocks()])

        numbers = range(len(path.strips))
        if scan.target.caster.main_thread_only:
            return [one(number) for number in numbers]
        with ThreadPoolExecutor(available_cores()) as pool:
            return list(pool.map(one, numbers))

    def truth(self) -> list[PointBlock]:
        """Return the points of the stretches with the converged footprint."""
        return [result.points for result in self.results(RINGS[CONVERGED], self.stretches())]

    def beam_errors(self, rings: tuple[int, ...], truth: Sequence[PointBlock]) -> Errors:
        """Return the errors of a beam against the truth, by kind."""
        mine = [result.points for result in self.results(rings, self.stretches())]
        return beam_errors(mine, truth)

    def relief_errors(self, octaves: Iterable[int]) -> dict[int, tuple[Errors, float]]:
        """Return the error of the micro-relief by octaves, and seconds per million points of one core."""
        results = [one for one in self.results(RINGS[1], self.stretches(), targets=True) if len(one.points)]
        materials = self.scan.target.materials
        relief = micro_relief(materials, material_rows(materials))
        strength, seed = self.scenario.scan.relief, self.scenario.seed

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
        plain = self.scenario.colour.model_copy(update={"source": "material"})
        scenario = self.scenario.model_copy(update={"colour": plain})
        scenario = scenario.model_copy(update={"scan": scenario.scan.model_copy(update={"relief_octaves": 2})})
        # Pulses come in whole lines, so that stretches hold fewer of them than their duration says.
        share = sum(map(self.scan.pulses, path.strips)) / sum(map(self.scan.pulses, path.whole.strips))
        times, points = {}, 0
        with layer_source(colour_job(scenario, self.scan, self.scene)) as source:
            for number, rings in rays.items():
                part = replace(self.scan, path=path, rings=rings)
                with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
                    task = ScanToFiles(scenario, part, source, Path(folder))
                    begin = self.clock()
                    for _ in task.run():
                        pass
                    times[number] = (self.clock() - begin) / share
                points = round(task.counts.points / share)
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
