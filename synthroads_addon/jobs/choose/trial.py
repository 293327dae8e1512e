"""Trials: short stretches of a scan, by which errors on the user's own scene and the machine's speed are measured.

Errors are taken of single scan lines scattered over the path, against the same pulses with the converged footprint;
the time of longer stretches that go through the whole job to a file. Noise of the scanner is left out of the errors.
"""

import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from ...base.machine import available_cores
from ...base.progress import StageTimer
from ...blender.cameras import image_views
from ...blender.services import BlenderServices
from ...cloud.points import PointBlock
from ...scanning.beam import RINGS
from ...scanning.colour.images import views_near
from ...scanning.colour.request import LayerRequest
from ...scanning.noise import Noise
from ...scanning.plan import ScanPlan
from ...scanning.platforms.stretches import scatter_stretches
from ...scanning.record import record_as_measured
from ...scanning.scan import BlockResult, join_results
from ...scanning.scene.motion import ScannedScene
from ...scanning.strip_errors import StripErrors
from ..measure.errors import (
    CONVERGED,
    FINEST,
    Errors,
    colour_errors,
    relief_errors,
    render_layers,
    shift_points,
    truest_settings,
)
from ..scan.plan import Site
from ..scan.sink import record_cloud

LINES, PULSES = 64, 1024
"""Stretches that errors are taken of, and the pulses of each."""
_TIMED_PULSES = 1 << 15
"""Least pulses of each stretch that is timed; a whole block if that is more, as every block costs time by itself."""
_FEW, _FEW_SHARE = 4, 0.05
"""Stretches that are timed at least, and the largest share of the path that they may be."""
TIMED_SHARE = 5.0 * _FEW_SHARE
"""Largest share of the path that is scanned when it is timed: three times the few stretches, and twice as many."""
_COLOURED = 8
"""Scan lines that errors of colours are taken of."""


@dataclass
class Trial:
    """Scans of short stretches of a path, by which errors and the machine's speed are measured on a scene.

    Attributes:
        site: of the scan; its scenario is without noise.
        plan: of the whole path.
        phase: see `scanning.platforms.stretches.scatter_stretches`: other phases are other stretches.
        lines: of these is the error taken.
        clock: measures seconds.
    """

    site: Site
    plan: ScanPlan
    phase: float = 0.5
    lines: int = field(default_factory=lambda: LINES)
    clock: Callable[[], float] = time.perf_counter

    @classmethod
    def of(cls, site: Site, scene: ScannedScene) -> Self:
        """Return a trial of a scene, without range noise; plans the scan and builds its ray casters."""
        receiver = site.scenario.scan.receiver.model_copy(update={"threshold_to_noise": 0.0})
        noiseless_scan = site.scenario.scan.model_copy(
            update={"noise": Noise(range_sigma=0.0), "receiver": receiver, "strip_errors": StripErrors()}
        )
        colour = site.scenario.colour.model_copy(update={"intensity_from_layers": "never"})
        scenario = site.scenario.model_copy(update={"scan": noiseless_scan, "colour": colour})
        site = replace(site, scenario=scenario, view=None)
        return cls(site, site.plan(scene, BlenderServices()))

    @property
    def pulses(self) -> int:
        """Return the number of pulses of the whole path."""
        return sum(map(self.plan.pulse_count, self.plan.path.strips))

    def scan_lines(self, rings: tuple[int, ...], lines: int = 0) -> list[BlockResult]:
        """Scan short stretches with a beam of so many rays per ring; return the result of each stretch."""
        path = scatter_stretches(self.plan.path, lines or self.lines, PULSES / self.plan.setting.shot_rate, self.phase)
        ground = None if rings == RINGS[CONVERGED] else self.plan.emission.ground
        plan = replace(self.plan, emission=replace(self.plan.emission, path=path, rings=rings, ground=ground))
        results = iter(record_as_measured(plan))
        return [join_results([next(results) for _ in plan.cut.block_numbers(strip)]) for strip in path.strips]

    def points(self, rings: tuple[int, ...] = RINGS[CONVERGED]) -> list[PointBlock]:
        """Scan the stretches and return the points of each, by default with the 61 rays per pulse of the truth."""
        return [result.points for result in self.scan_lines(rings)]

    def relief_errors(self, octaves: Iterable[int]) -> dict[int, Errors]:
        """Return the micro-relief's position error (m, 95th percentile, with bound) by number of octaves."""
        results = [result for result in self.scan_lines(RINGS[1]) if len(result.points)]
        truth = shift_points(results, self.plan, FINEST)
        return {number: relief_errors(shift_points(results, self.plan, number), truth) for number in octaves}

    def colour_errors(self, choices: Mapping[str, Mapping[str, Any]], layers: frozenset[str]) -> dict[str, Errors]:
        """Return the errors of colours and material layers against the truest rendering, by colour source name.

        Of each image only what shows a scan line is rendered.

        Args:
            choices: name -> changes of the scenario.
            layers: ``rgb`` and names of layers.
        """
        seen_points = [
            result.seen
            for result in self.scan_lines(RINGS[1], _COLOURED)
            if result.seen is not None and len(result.seen)
        ]
        request = replace(self.layer_request({}), names=layers, pick=lambda views: views_near(views, seen_points))
        true_settings = truest_settings(request)
        truth = render_layers(replace(request, settings=true_settings), seen_points)
        errors = {}
        for name, changes in choices.items():
            settings = self.layer_request(changes).settings
            values = (
                truth if settings == true_settings else render_layers(replace(request, settings=settings), seen_points)
            )
            errors[name] = colour_errors(values, truth, layers)
        return errors

    def layer_request(self, changes: Mapping[str, Any]) -> LayerRequest:
        """Return the plan's request for colours and layers with the scenario's `colour` fields changed."""
        colour_fields = {path.removeprefix("colour."): value for path, value in changes.items()}
        scenario = self.site.scenario
        colour = type(scenario.colour).from_dict(scenario.colour.to_dict() | colour_fields)
        assert self.plan.layers.request is not None
        settings = colour.settings(scenario.fidelity, self.plan.path.typical_range)
        return replace(self.plan.layers.request, settings=settings)

    def count_images(self, changes: Mapping[str, Any]) -> tuple[int, float]:
        """Return the number of images that the whole path needs and their total megapixels; 0 without images."""
        if changes["colour.source"] != "images":
            return 0, 0.0
        views = image_views(self.layer_request(changes))
        return len(views), sum(view.pixels for view in views) / 1e6

    def time_scan(self, rings: tuple[int, ...]) -> tuple[float, int]:
        """Measure stretches and return the projected seconds and number of points of the whole scan into files.

        Few stretches and twice as many tell what every scan takes from what each pulse takes; before these, the few
        are scanned once, as the first scan waits for much that later ones find done. After these they are scanned once
        more, and the shorter time counts, as other work on the machine may have disturbed one. Colours are the
        materials' means and the relief is the coarsest: what more than that costs is known apart.
        """
        few_stretches, many_stretches = (self._few, _FEW_SHARE), (2 * self._few, 2.0 * _FEW_SHARE)
        _, (few_pulses, seconds_before, _), (many_pulses, many_seconds, points), (_, seconds_after, _) = [
            self._time_stretches(rings, *stretches)
            for stretches in (few_stretches, few_stretches, many_stretches, few_stretches)
        ]
        return _project(
            (few_pulses, min(seconds_before, seconds_after)), (many_pulses, many_seconds), self.pulses
        ), round(points * self.pulses / many_pulses)

    def time_relief(self, rings: tuple[int, ...], octaves: int) -> float:
        """Measure stretches and return the projected seconds that so many octaves take beyond two in the whole scan.

        Stretches with and without them take turns, and the shorter of two times counts, as in `time_scan`.
        """
        octaves_in_turn = (2, octaves, 2, octaves)
        measurements = [self._time_stretches(rings, self._few, _FEW_SHARE, number) for number in octaves_in_turn]
        pulses, seconds = measurements[0][0], [duration for _, duration, _ in measurements]
        return max(0.0, min(seconds[1::2]) - min(seconds[::2])) * self.pulses / pulses

    @property
    def _few(self) -> int:
        """Return the number of the few stretches: no worker waits for another at the end."""
        workers = self.plan.run.threads or available_cores()
        return workers * -(-_FEW // workers)

    def _time_stretches(
        self, rings: tuple[int, ...], count: int, share: float, octaves: int = 2
    ) -> tuple[int, float, int]:
        """Scan so many stretches, at most a share of the path, into files; return pulses, seconds, points."""
        request = self.layer_request({"colour.source": "material"})
        emission = replace(self.plan.emission, rings=rings)
        relief, layers = replace(self.plan.relief, octaves=octaves), replace(self.plan.layers, request=request)
        plan = replace(self.plan, emission=emission, relief=relief, layers=layers)
        pulses = max(plan.cut.size, _TIMED_PULSES)
        path = scatter_stretches(plan.path, count, pulses / plan.setting.shot_rate, 0.5, share)
        plan = replace(plan, emission=replace(emission, path=path))
        with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
            files = self.site.files(Path(folder), plan.target.origin)
            begin = self.clock()
            record_cloud([plan], files, StageTimer(), announce=None)
            seconds = self.clock() - begin
        # Pulses come in whole lines, so that stretches hold fewer of them than their duration says.
        return sum(map(plan.pulse_count, plan.path.strips)), seconds, files.counts.points


def _project(few_run: tuple[int, float], many_run: tuple[int, float], pulses: int) -> float:
    """Return the seconds that so many pulses take, by the numbers and seconds of few pulses and of many.

    No scan takes longer per pulse than a shorter one, nor less time in all: where the clock says so other work on the
    machine disturbed it, and the shorter time per pulse counts.
    """
    (few_pulses, few_seconds), (many_pulses, many_seconds) = few_run, many_run
    # Seconds per pulse; where both runs show a fixed part as well, the slope between them.
    rate = min(few_seconds / few_pulses, many_seconds / many_pulses)
    many_seconds = rate * many_pulses
    if many_pulses > few_pulses and many_seconds > few_seconds:
        rate = min(rate, (many_seconds - few_seconds) / (many_pulses - few_pulses))
    return many_seconds + rate * (pulses - many_pulses)
