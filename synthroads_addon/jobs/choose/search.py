"""The settings of a job, chosen by a tolerance or a time.

A tolerance takes the cheapest settings whose errors, measured on short stretches of the user's own scene with a margin
for what other stretches may show, are within it. That depends on nothing but the scene, so that the same job gives the
same bytes. A time is held against the shipped table's times, scaled by short runs on the scene; errors are the
table's then, unless a tolerance is to be kept as well.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from ...base.progress import Progress, StageTimer
from ...blender.cameras import HAS_RETURN_CAMERA
from ...cloud.points import PointBlock
from ...scanning.beam import RINGS
from ...scenario.choice import has_kind
from ...scenario.scenario import FIDELITIES, Scenario
from ..measure.errors import CONVERGED, Errors, beam_errors
from ..open_scene import ForeignScene, RoadScene
from . import knobs as choices
from .knobs import ModelKnobs
from .options import Knobs, Option, best_in_time, cheapest, too_short_error
from .table import JobTimes, nearest_row, shipped_table
from .trial import LINES, TIMED_SHARE, Trial

_BEAM = frozenset({"position", "intensity", "labels", "density"})
_COLOURS = frozenset({"colour", "layers"})
_SURE = 0.8
"""Share of the time left that settings may be expected to take: the table's ratios differ from scene to scene."""
_TIMING = 0.1
"""Share of the time left that timing many rays per pulse, beside few, may be expected to take."""
_HOPELESS = 4.0
"""A time that the shipped table says is exceeded so many times isn't tried out."""


S = TypeVar("S", ForeignScene, RoadScene)


@dataclass(frozen=True)
class _Findings:
    """Expected errors of all options (beam by model and rays, relief by octaves, colour by name) and their source."""

    beam: Mapping[tuple[ModelKnobs | None, int], Errors]
    relief: Mapping[int, Errors]
    colour: Mapping[str, Errors]
    source: str = f"pilot measurements on {LINES} scan lines"


def choose_settings(scene: S, begun: float, timer: StageTimer) -> tuple[S, dict[str, Any]]:
    """Choose the settings that a scenario leaves open, to keep its error tolerance or time budget.

    Args:
        scene: its scenario has a tolerance or a time budget, or both.
        begun: when the job began, by `time.perf_counter`.
        timer: of the job's stages.

    Returns:
        the scene under the job with the chosen settings, as it can be repeated; and what was asked for, chosen and
        expected, as JSON data.

    Raises:
        InputError: the tolerance can't be kept, which says what is the best to be had; or the time is too short.
    """
    with timer.stage("choice"):
        search = _Search(scene, begun, timer.progress)
        scenario, report = search.decide()
    settings = scenario.settings()
    chosen_model = ModelKnobs(settings.tolerance, settings.vegetation_detail)
    return scene.with_settings(scenario, search.trial is None or search.trial[0] in (None, chosen_model)), report


class _Search:
    """Search for a job's settings: the options, and the errors and times measured for them so far.

    Attributes:
        limits: the tolerance; empty without.
        models: to choose from; None for a scene that is there.
        build_seconds: by model, of those that were built.
        trial: the model that was built last, and the trial of it.
    """

    def __init__(self, scene: ForeignScene | RoadScene, begun: float, progress: Progress) -> None:
        self.progress = progress
        self.scene, self.site, self.scenario, self.begun = scene, scene.site, scene.site.scenario, begun
        self.began_here = time.perf_counter()
        self.limits = self.scenario.tolerance.limits() if self.scenario.tolerance else {}
        self.rays, self.octaves = choices.rays_choices(self.scenario), choices.octave_choices(self.scenario)
        colours = choices.colour_choices(self.scenario, self.site.path.typical_range, HAS_RETURN_CAMERA)
        self.colours = colours if _COLOURS & set(self.limits) or self.scenario.may_render else {}
        pulses = sum(map(self.site.cut.pulse_count, self.site.path.strips))
        self.times = JobTimes(shipped_table(self.scenario.scan.platform.kind), scene.area, pulses)
        models = choices.model_knobs(self.scenario, self.limits) if scene.area else (None,)
        self.models: list[ModelKnobs | None] = [*models]
        self.build_seconds: dict[ModelKnobs | None, float] = {}
        self.trial: tuple[ModelKnobs | None, Trial] | None = None

    def decide(self) -> tuple[Scenario, dict[str, Any]]:
        """Return the scenario with the chosen settings, and a report of the choice as JSON data."""
        budget = self.scenario.time_budget
        findings, choice = self._choose_by_tolerance() if budget is None else self._choose_by_time(budget)
        now, given_knobs = time.perf_counter(), choices.given_knobs(self.scenario)
        goals = {"tolerance": self.limits or None, "time_budget": budget}
        return choices.with_changes(self.scenario, choice.changes), {
            "asked": {name: value for name, value in goals.items() if value is not None},
            "kept": given_knobs,
            "chosen": {path: value for path, value in choice.changes.items() if path not in given_knobs},
            "expected": {
                "errors": {kind: float(f"{pair[0]:.6g}") for kind, pair in choice.errors.items()},
                "at_most": {kind: float(f"{choice.errors[kind][1]:.6g}") for kind in self.limits},
                "seconds": round(now - self.begun + choice.seconds, 1),
            },
            "by": findings.source,
            "pilot_seconds": round(now - self.began_here, 3),
        }

    def _choose_by_tolerance(self) -> tuple[_Findings, Option]:
        """Return the measured errors, and the cheapest option within the tolerance with the seconds it will take."""
        findings = self._measure()
        rays = int(cheapest(self._options(findings), self.limits).changes.get("scan.rays_per_pulse", max(self.rays)))
        self.times.calibrate(rays, *self._trial.time_scan(self.rays[rays]))
        self._time_relief()
        return findings, cheapest(self._options(findings), self.limits)

    def _choose_by_time(self, budget: float) -> tuple[_Findings, Option]:
        """Return the errors, and the option with the smallest error that fits a budget (s from the job's begin).

        From cheap to dear: the shipped table alone, then a timed scan with the fewest rays, then the relief and as many
        rays as a tenth of the time left allows.
        """

        def left() -> float:
            """Return the seconds of the budget that are left now."""
            return budget - (time.perf_counter() - self.begun)

        fewest_rays, times = min(self.rays), self.times
        seconds = times.model_seconds(0) + times.scan_seconds(fewest_rays) + times.other_seconds(self.scenario)
        if seconds > _HOPELESS * left():  # by the shipped table, before anything is built
            raise too_short_error(left(), seconds)
        times.calibrate(fewest_rays, *self._try_model(self.models[0]).time_scan(self.rays[fewest_rays]))
        if (fastest_seconds := times.scan_seconds(fewest_rays) + times.other_seconds(self.scenario)) > left():
            raise too_short_error(left(), fastest_seconds)
        self._time_relief()
        self._time_many_rays(_TIMING * left())
        # The error of the height follows from the model, without a measurement.
        findings = self._measure() if set(self.limits) - {"height"} else self._table_errors()
        return findings, best_in_time(self._options(findings), _SURE * left(), self._reference_errors(), self.limits)

    def _time_relief(self) -> None:
        """Time the finest micro-relief there is to choose, with the fewest rays per pulse, as it costs by the point."""
        if (octaves := max(self.octaves, default=2)) > 2:
            self.times.relief = octaves, self._trial.time_relief(self.rays[min(self.rays)], octaves)

    def _time_many_rays(self, most_seconds: float) -> None:
        """Time the largest number of rays per pulse whose timing is expected to take at most so many seconds."""
        while True:
            affordable_rays = [
                rays for rays in self.rays if TIMED_SHARE * self.times.scan_seconds(rays) <= most_seconds
            ]
            if (rays := max(affordable_rays, default=0)) <= max(self.times.timed):
                return
            self.times.calibrate(rays, *self._trial.time_scan(self.rays[rays]))

    def _measure(self) -> _Findings:
        """Return errors measured in trials; those of beam and colours only if the tolerance limits them."""
        limited_kinds = set(self.limits)
        beam = self._measure_beam() if _BEAM & limited_kinds else {(self.models[0], min(self.rays)): {}}
        if self.trial is None:
            self._try_model(self.models[0])
        colour: Mapping[str, Errors] = {name: {} for name in self.colours}
        if self.colours and _COLOURS & limited_kinds:
            colour = self._trial.colour_errors(self.colours, self.scenario.coloured_layers)
        return _Findings(beam, self._trial.relief_errors(self.octaves) if self.octaves else {}, colour)

    def _measure_beam(self) -> dict[tuple[ModelKnobs | None, int], Errors]:
        """Return the beam's errors by model and rays per pulse, measured against 61 rays on the last model."""
        points: dict[tuple[ModelKnobs | None, int], list[PointBlock]] = {}
        for number, model in enumerate(self.models):
            trial = self._try_model(model)
            for step, (rays, rings) in enumerate(self.rays.items(), 1):
                points[model, rays] = trial.points(rings)
                # The truth, colours and relief are measured afterwards: a fifth of it, by and large.
                self.progress("choice", 0.8 * (number + step / len(self.rays)) / len(self.models))
        has_converged_rays = self.rays.get(CONVERGED) == RINGS[CONVERGED]
        truth = points[self.models[-1], CONVERGED] if has_converged_rays else self._trial.points()
        return {knobs: beam_errors(point_blocks, truth) for knobs, point_blocks in points.items()}

    def _table_errors(self) -> _Findings:
        """Return the errors of all options from the shipped table instead of from measurements."""
        table, beam = self.times.table, {}
        for model in self.models:
            has_few_plants = model is not None and model.detail < FIDELITIES["standard"].vegetation_detail
            has_few_plants = (
                has_few_plants and self.scenario.vegetation_detail is None
            )  # as many plants as are wanted otherwise
            for rays in self.rays if model == self.models[-1] else (min(self.rays),):
                beam[model, rays] = _exact(
                    {**nearest_row(table.beam, rays), **(table.few_plants if has_few_plants else {})}
                )
        relief = {octaves: _exact({"relief": nearest_row(table.relief, octaves)}) for octaves in self.octaves}
        kinds = [kind for kind in sorted(_COLOURS) if has_kind(self.scenario, kind)]
        colour = {name: _exact({kind: table.colour[name][kind] for kind in kinds}) for name in self.colours}
        return _Findings(beam, relief, colour, "shipped table, scaled by a short run")

    def _reference_errors(self) -> dict[str, float]:
        """Return the standard fidelity's error of each kind, by which errors are weighed against each other."""
        table, standard_fidelity = self.times.table, FIDELITIES["standard"]
        errors = {
            "height": standard_fidelity.tolerance,
            "relief": nearest_row(table.relief, standard_fidelity.relief_octaves),
        }
        errors |= {**nearest_row(table.beam, standard_fidelity.rays_per_pulse), **table.colour["standard"]}
        return {kind: error for kind, error in errors.items() if error > 0.0}

    def _options(self, findings: _Findings) -> Knobs:
        """Return the options of every knob with their errors, costs and seconds expected on this machine."""
        beam = [self._beam_option(*knobs, errors) for knobs, errors in findings.beam.items()]
        relief = [
            Option({"scan.relief_octaves": octaves}, errors, octaves, self.times.relief_seconds(octaves))
            for octaves, errors in findings.relief.items()
        ]
        colour = [self._colour_option(name, errors) for name, errors in findings.colour.items()]
        other_work = [Option({}, {}, 0.0, self.times.other_seconds(self.scenario))]
        return [options for options in (beam, relief, colour, other_work) if options]

    def _beam_option(self, model: ModelKnobs | None, rays: int, errors: Errors) -> Option:
        """Return the option of a model and rays per pulse; its seconds include building a model that isn't open."""
        cost, seconds = 4.0 + rays, self.times.scan_seconds(rays)
        changes: dict[str, Any] = {"scan.rays_per_pulse": rays} if self.scenario.scan.beam_rings is None else {}
        if model is None:
            return Option(changes, errors, cost, seconds)
        estimate, upper_bound = errors.get("position", (0.0, 0.0))
        # The model's vertices lie on the surface: heights are off by its tolerance at most, positions by half of it.
        errors = {
            **errors,
            "height": (model.tolerance,) * 2,
            "position": (estimate, upper_bound + model.tolerance / 2.0),
        }
        if self.trial is None or model != self.trial[0]:
            seconds += self.build_seconds.get(model, self.times.model_seconds(self.models.index(model)))
        return Option({**model.changes, **changes}, errors, cost + 0.5 * model.detail, seconds)

    def _colour_option(self, name: str, errors: Errors) -> Option:
        """Return the option of a colour source with its errors, cost and seconds."""
        changes = self.colours[name]
        work = changes["colour.source"], *self._trial.count_images(changes)
        return Option(changes, errors, self.times.colour_cost(*work), self.times.colour_seconds(*work))

    @property
    def _trial(self) -> Trial:
        """Return the trial of the model that was built last."""
        assert self.trial is not None
        return self.trial[1]

    def _try_model(self, model: ModelKnobs | None) -> Trial:
        """Return a trial of a model, which is built in the open file unless it is there already."""
        if self.trial is None or self.trial[0] != model:
            begin = time.perf_counter()
            self.trial = model, Trial.of(self.site, self.scene.rebuild(model.changes if model else {}))
            self.build_seconds[model] = time.perf_counter() - begin
        return self.trial[1]


def _exact(errors: Mapping[str, float]) -> Errors:
    """Return errors whose upper bounds are their estimates: a table's are taken as they are."""
    return {kind: (error, error) for kind, error in errors.items()}
