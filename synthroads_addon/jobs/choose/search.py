"""The settings of a job, chosen by a tolerance or a time.

A tolerance takes the cheapest settings whose errors, measured on short stretches of the user's own scene with a margin
for what other stretches may show, are within it. That depends on nothing but the scene, so that the same job gives the
same bytes. A time is held against the shipped table's times, scaled by one short run on the scene; errors are the
table's then, unless a tolerance is to be kept as well.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...base.errors import InputError
from ...blender.cameras import HAS_RETURN_CAMERA
from ...scanning.beam import RINGS
from ...scanning.colour.colour import MATERIAL_LAYERS
from ...scanning.devices.device import ScannerSetting
from ...scanning.devices.shots import shot_count
from ...scanning.scene.motion import ScannedScene
from ...scenario.scan import scanner_setting
from ...scenario.scenario import FIDELITIES, Scenario
from ..measure.errors import CONVERGED, Errors, beam_errors
from ..scan.plan import coloured_layers, may_render
from .knobs import (
    ModelKnobs,
    check_choice,
    colour_choices,
    given_knobs,
    octave_choices,
    rays_changes,
    rays_choices,
    with_changes,
)
from .options import Choice, Option, best_in_time, cheapest, too_short
from .sites import Site
from .table import JobTimes, nearest_row, table_of
from .trial import LINES, Trial

_BEAM = ("position", "intensity", "labels", "density")
_COLOURS = frozenset({"colour", "layers"})
_SURE = 0.8
"""Share of the time left that settings may be expected to take: the table's ratios differ from scene to scene."""
_HOPELESS = 4.0
"""A time that the shipped table says is exceeded so many times isn't tried out."""


@dataclass(frozen=True)
class Decision:
    """The settings that were chosen.

    Attributes:
        scenario: the job with the chosen settings, as it can be repeated.
        report: what was asked for, chosen and expected, as JSON data.
        model: the model that stands in the open file, if that is the chosen one.
        scene: of that.
    """

    scenario: Scenario
    report: dict[str, Any]
    model: ModelKnobs | None
    scene: ScannedScene | None


def decide(scenario: Scenario, site: Site, begun: float) -> Decision:
    """Choose the settings that a scenario leaves open.

    Args:
        scenario: has a tolerance or a time budget, or both.
        site: what is scanned.
        begun: when the job began, by `time.perf_counter`.

    Raises:
        InputError: the tolerance can't be kept, which says what is the best to be had; or the time is too short.
    """
    check_choice(scenario)
    return _Search(scenario, site, begun).decide()


class _Search:
    """One choice: what there is to choose from, and what was measured of it.

    Attributes:
        limits: the tolerance; empty without.
        trial: of the model that was built last.
        model: that model; None for a scene that is there.
        build_seconds: by model, of those that were built.
    """

    def __init__(self, scenario: Scenario, site: Site, begun: float) -> None:
        self.scenario, self.site, self.begun = scenario, site, begun
        self.began_here = time.perf_counter()
        self.limits = scenario.tolerance.limits() if scenario.tolerance else {}
        self.rays, self.octaves = rays_choices(scenario), octave_choices(scenario)
        colours = colour_choices(scenario, site.path.typical_range, HAS_RETURN_CAMERA)
        self.colours = colours if _COLOURS & set(self.limits) or may_render(scenario) else {}
        setting: ScannerSetting = scanner_setting(scenario.scan)
        pulses = sum(shot_count(setting, strip.duration) for strip in site.path.strips)
        self.times = JobTimes(table_of(scenario.scan.platform.kind), site.area, pulses)
        self.models = list(site.models(self.limits))
        self.build_seconds: dict[ModelKnobs | None, float] = {}
        self.trial: Trial | None = None
        self.model: ModelKnobs | None = None
        self.source = f"pilot measurements on {LINES} scan lines"

    def decide(self) -> Decision:
        budget = self.scenario.time_budget
        choice = self._choose_by_tolerance() if budget is None else self._choose_by_time(budget)
        scenario = with_changes(self.scenario, choice.changes)
        settings = scenario.settings()
        stands = self.model in (None, ModelKnobs(settings.tolerance, settings.vegetation_detail))
        report, scene = self._report(choice, budget), self._trial.scene
        return Decision(scenario, report, self.model, scene) if stands else Decision(scenario, report, None, None)

    def _report(self, choice: Choice, budget: float | None) -> dict[str, Any]:
        here, kept = time.perf_counter(), given_knobs(self.scenario)
        asked = {"tolerance": self.limits or None, "time_budget": budget}
        found = choice.found
        return {
            "asked": {name: value for name, value in asked.items() if value is not None},
            "kept": kept,
            "chosen": {path: value for path, value in choice.changes.items() if path not in kept},
            "expected": {
                "errors": {kind: float(f"{pair[0]:.6g}") for kind, pair in found.items()},
                "at_most": {kind: float(f"{found[kind][1]:.6g}") for kind in self.limits},
                "seconds": None if choice.seconds is None else round(here - self.begun + choice.seconds, 1),
            },
            "by": self.source,
            "pilot_seconds": round(here - self.began_here, 3),
        }

    # By a tolerance

    def _choose_by_tolerance(self) -> Choice:
        choice = cheapest(self._measured_options(), self.limits)
        rays = int(choice.changes.get("scan.rays_per_pulse", max(self.rays)))
        self.times.calibrate(rays, *self._trial.time_scan(self.rays[rays]))
        timed = {name: self._with_time(name, option) for name, option in choice.options.items()}
        return Choice(timed, self.times.fixed(self.scenario))

    def _measured_options(self) -> dict[str, list[Option]]:
        """Return the options of every knob with errors as trials show them: of the beam, only if it is limited."""
        limited = bool(set(_BEAM) & set(self.limits))
        if limited:
            beam = self._measured_beam()
        else:
            self._try(self.models[0])
            beam = [self._beam_option(self.models[0], min(self.rays), {})]
        knobs = {"beam": beam}
        if self.octaves:
            found = self._trial.relief_errors(self.octaves)
            knobs["relief"] = [self._relief_option(octaves, errors) for octaves, errors in found.items()]
        if self.colours:
            measured = bool(_COLOURS & set(self.limits))
            errors = self._trial.colour_errors(self.colours, coloured_layers(self.scenario)) if measured else {}
            knobs["colour"] = [self._colour_option(name, errors.get(name, {})) for name in self.colours]
        return knobs

    def _measured_beam(self) -> list[Option]:
        """Try all models out, the one with all plants last; the truth is seen among these."""
        points = {}
        for model in self.models:
            trial = self._try(model)
            points[model] = {rays: trial.points(rings) for rays, rings in self.rays.items()}
        exact = self.rays.get(CONVERGED) == RINGS[CONVERGED]
        truth = points[self.models[-1]][CONVERGED] if exact else self._trial.points()
        return [
            self._beam_option(model, rays, beam_errors(mine, truth))
            for model in self.models
            for rays, mine in points[model].items()
        ]

    # By a time

    def _choose_by_time(self, budget: float) -> Choice:
        self._refuse_hopeless(budget)
        fewest = min(self.rays)
        trial = self._try(self.models[0])
        self.times.calibrate(fewest, *trial.time_scan(self.rays[fewest]))
        fastest = self.times.scan(fewest) + self.times.fixed(self.scenario)
        if fastest > self._left(budget):
            raise too_short(self._left(budget), fastest)
        # The error of the height follows from the model, without a measurement.
        if set(self.limits) - {"height"}:
            knobs = self._measured_options()
        else:
            self.source, knobs = "shipped table, scaled by a short run", self._table_options()
        timed = {name: [self._with_time(name, option) for option in options] for name, options in knobs.items()}
        left, fixed = _SURE * self._left(budget), self.times.fixed(self.scenario)
        return best_in_time(timed, left, self._reference(timed), self.limits, fixed)

    def _refuse_hopeless(self, budget: float) -> None:
        """Refuse a time that is far too short before anything is built, by the shipped table."""
        seconds = self.times.model(0) + self.times.scan(min(self.rays)) + self.times.fixed(self.scenario)
        if seconds > _HOPELESS * self._left(budget):
            raise too_short(self._left(budget), seconds)

    def _left(self, budget: float) -> float:
        """Return the seconds that are left of the budget."""
        return budget - (time.perf_counter() - self.begun)

    def _table_options(self) -> dict[str, list[Option]]:
        """Return the options of every knob with the shipped table's errors."""
        table = self.times.table
        beam = []
        for model in self.models:
            few = model is not None and model.detail < FIDELITIES["standard"].vegetation_detail
            few = few and self.scenario.vegetation_detail is None  # as many plants as are wanted otherwise
            for rays in self.rays if model == self.models[-1] else (min(self.rays),):
                errors = dict(nearest_row(table.beam, rays)) | (dict(table.few_plants) if few else {})
                beam.append(self._beam_option(model, rays, _exact(errors)))
        knobs = {"beam": beam}
        if self.octaves:
            rows = {octaves: {"relief": nearest_row(table.relief, octaves)} for octaves in self.octaves}
            knobs["relief"] = [self._relief_option(octaves, _exact(errors)) for octaves, errors in rows.items()]
        if self.colours:
            kinds = [kind for kind in sorted(_COLOURS) if has_kind(self.scenario, kind)]
            errors_of = {name: {kind: table.colour[name][kind] for kind in kinds} for name in self.colours}
            knobs["colour"] = [self._colour_option(name, _exact(errors)) for name, errors in errors_of.items()]
        return knobs

    def _reference(self, knobs: Mapping[str, Sequence[Option]]) -> dict[str, float]:
        """Return the errors of the standard fidelity, by which kinds of errors are weighed against each other."""
        standard = FIDELITIES["standard"]
        usual = {"beam": {"scan.rays_per_pulse": standard.rays_per_pulse}}
        usual |= {"relief": {"scan.relief_octaves": standard.relief_octaves}}
        found = {"height": standard.tolerance}
        for name, options in knobs.items():
            fitting = [option for option in options if usual.get(name, {}).items() <= option.changes.items()]
            if name == "colour":
                found |= self.times.table.colour["standard"]
            elif fitting:
                errors = fitting[-1].found
                found |= {kind: pair[0] for kind, pair in errors.items() if kind != "height"}
        return {kind: error for kind, error in found.items() if error > 0.0}

    # Options

    @property
    def _trial(self) -> Trial:
        assert self.trial is not None
        return self.trial

    def _try(self, model: ModelKnobs | None) -> Trial:
        """Return the trial of a model, which is built unless it stands."""
        if self.trial is None or self.model != model:
            begin = time.perf_counter()
            scene = self.site.scene(model)
            self.trial, self.model = Trial.of(self.scenario, scene, self.site.path, self.site.conditions), model
            self.build_seconds[model] = time.perf_counter() - begin
        return self.trial

    def _beam_option(self, model: ModelKnobs | None, rays: int, errors: Errors) -> Option:
        changes, cost = rays_changes(self.scenario, rays), 4.0 + rays
        if model is not None:
            changes, cost = {**model.changes, **changes}, cost + 0.5 * model.detail
            estimate, bound = errors.get("position", (0.0, 0.0))
            moved = {"position": (estimate, bound + model.position_error)}
            errors = {**errors, "height": (model.height_error, model.height_error), **moved}
        return Option(changes, errors, cost)

    def _relief_option(self, octaves: int, errors: Errors) -> Option:
        return Option({"scan.relief_octaves": octaves}, errors, octaves)

    def _colour_option(self, name: str, errors: Errors) -> Option:
        changes = self.colours[name]
        images = self._trial.count_images(changes)
        return Option(changes, errors, self.times.colour_cost(changes["colour.source"], *images))

    def _with_time(self, name: str, option: Option) -> Option:
        """Return a knob's option with its expected time; that of the beam with that of a model that isn't built yet."""
        changes = option.changes
        if name == "relief":
            return replace(option, seconds=self.times.relief(int(changes["scan.relief_octaves"])))
        if name == "colour":
            images = self._trial.count_images(changes)
            return replace(option, seconds=self.times.colour(changes["colour.source"], *images))
        model = next((one for one in self.models if one and one.changes.items() <= changes.items()), None)
        build = self.build_seconds.get(model, self.times.model(self.models.index(model)))
        rays = int(changes.get("scan.rays_per_pulse", max(self.rays)))
        return replace(option, seconds=self.times.scan(rays) + (0.0 if model == self.model else build))


def has_kind(scenario: Scenario, kind: str) -> bool:
    """Return whether points of a job have what a kind of error of colours is of: ``colour`` or ``layers``."""
    wanted = coloured_layers(scenario)
    return "rgb" in wanted if kind == "colour" else bool(set(MATERIAL_LAYERS) & wanted)


def _exact(errors: Mapping[str, float]) -> Errors:
    return {kind: (error, error) for kind, error in errors.items()}


def check(scenario: Scenario, foreign: bool = False) -> None:
    """Refuse a choice that can't be made before any work starts.

    Args:
        scenario: the job.
        foreign: the scene isn't built, so that nothing is known of its height's errors.
    """
    if not scenario.chooses:
        return
    check_choice(scenario)
    limits = scenario.tolerance.limits() if scenario.tolerance else {}
    if foreign and "height" in limits:
        raise InputError("tolerance.height", limits["height"], "can't be promised of a scene that was built elsewhere")
    for kind in sorted(_COLOURS & set(limits)):
        if not has_kind(scenario, kind):
            has = "colours: colour.rgb is false" if kind == "colour" else "layers: cloud.attributes names none of them"
            raise InputError(f"tolerance.{kind}", limits[kind], f"nothing has such an error, as points get no {has}")
    if not set(scenario.outputs) & {"cloud", "previews"}:
        raise InputError("outputs", list(scenario.outputs), "must have the cloud or previews for settings to be chosen")
