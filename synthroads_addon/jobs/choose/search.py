"""The settings of a job, chosen by a tolerance or a time: on the user's own scene, by pilot measurements.

A tolerance takes the cheapest settings whose errors on short stretches, with a margin for what other stretches may
show, are within it. That depends on nothing but the scene, so that the same job gives the same bytes. A time is
measured as it is on this machine.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from ...base.errors import InputError
from ...blender.cameras import HAS_RETURN_CAMERA
from ...scanning.beam import RINGS
from ...scanning.colour.colour import MATERIAL_LAYERS
from ...scanning.plan import ScanConditions
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import FIDELITIES, Scenario
from ..measure.errors import CONVERGED
from ..scan.plan import coloured_layers, may_render
from .choice import Chosen, Ladder, Rung, best_in_time, cheapest, too_short
from .costs import Costs, nearest, pulses_of
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
from .pilot import LINES, PULSES, Errors, Pilot, beam_errors
from .pilot_colour import colour_errors, image_seconds
from .prior import Prior, prior_of

_BEAM = ("position", "intensity", "labels", "density")
_COLOURS = frozenset({"colour", "layers"})
_TIMED_RAYS = (1, 7, 19)
"""Rays per pulse whose time is measured; that of others lies between or beyond."""
_PILOT_SHARE = 0.25
"""Largest share of the time left that pilot measurements may take."""
_SURE, _UNSURE = 0.95, 0.8
"""Share of the time that settings may be expected to take, by measured costs and by the shipped table's."""
_HOPELESS = 4.0
"""A time that the shipped table says is exceeded so many times isn't tried out."""


class Site(Protocol):
    """What is scanned, and may be built in several ways.

    Attributes:
        path: the scanner's.
        conditions: of the scene's road.
        area: of the model, m2; 0 if nothing is built.
    """

    path: ScanPath
    conditions: ScanConditions
    area: float

    def models(self, limits: Mapping[str, float]) -> Sequence[ModelKnobs | None]:
        """Return the models to choose from, the cheapest first; None for a scene that is there."""
        ...

    def scene(self, model: ModelKnobs | None) -> ScannedScene:
        """Return the scene of a model, built in place of that before."""
        ...


@dataclass(frozen=True)
class Decision:
    """What was chosen.

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
    return _Choice(scenario, site, begun).made()


@dataclass
class _Tried:
    """A model that was built and tried out."""

    model: ModelKnobs | None
    pilot: Pilot
    build_seconds: float
    errors: dict[int, Errors] = field(default_factory=dict)
    seconds: dict[int, float] = field(default_factory=dict)


class _Choice:
    """The work of `decide`."""

    def __init__(self, scenario: Scenario, site: Site, begun: float) -> None:
        self.scenario, self.site, self.begun = scenario, site, begun
        self.began_here = time.perf_counter()
        self.limits = scenario.tolerance.limits() if scenario.tolerance else {}
        self.budget = scenario.time_budget
        self.prior: Prior = prior_of(scenario.scan.platform.kind)
        self.rays, self.octaves = rays_choices(scenario), octave_choices(scenario)
        colours = colour_choices(scenario, site.path.typical_range, HAS_RETURN_CAMERA)
        limited = bool(_COLOURS & set(self.limits))
        self.colours = colours if limited or may_render(scenario) else {}
        self.costs = Costs(scenario, site.path, site.area, self.prior)
        self.tried: list[_Tried] = []
        self.source = f"pilot measurements on {LINES} scan lines"

    def left(self) -> float:
        """Return the seconds that are left of the budget."""
        return (self.budget or 0.0) - (time.perf_counter() - self.begun)

    def made(self) -> Decision:
        chosen = self._by_time() if self.budget is not None else self._by_tolerance()
        scenario = with_changes(self.scenario, chosen.changes)
        last = self.tried[-1] if self.tried else None
        settings = scenario.settings()
        wanted = ModelKnobs(settings.tolerance, settings.vegetation_detail)
        stands = last is not None and (last.model is None or last.model == wanted)
        here, kept = time.perf_counter(), given_knobs(self.scenario)
        expected = None if chosen.seconds is None else round(here - self.begun + chosen.seconds, 1)
        report = {
            "asked": {
                name: value
                for name, value in (("tolerance", self.limits or None), ("time_budget", self.budget))
                if value is not None
            },
            "kept": kept,
            "chosen": {path: value for path, value in chosen.changes.items() if path not in kept},
            "expected": {
                "errors": {name: float(f"{value:.6g}") for name, value in chosen.errors.items()},
                "at_most": {name: float(f"{chosen.bounds[name]:.6g}") for name in self.limits},
                "seconds": expected,
            },
            "by": self.source,
            "pilot_seconds": round(here - self.began_here, 3),
        }
        if last is None or not stands:
            return Decision(scenario, report, None, None)
        return Decision(scenario, report, last.model, last.pilot.scene)

    # By a tolerance

    def _by_tolerance(self) -> Chosen:
        beam = {name: limit for name, limit in self.limits.items() if name in _BEAM}
        models = list(self.site.models(self.limits))
        if not beam:
            models = models[:1]
        ladders = [self._beam_ladder_within(models, beam)]
        relief = self._relief_ladder(self.tried[-1].pilot)
        ladders += [relief] if relief else []
        if self.colours:
            pilot = self.tried[-1].pilot
            ladders.append(self._colour_ladder(pilot, self._pilot_colours(pilot) if self._limits_colours else {}))
        chosen = cheapest(ladders, self.limits)
        return self._timed(chosen)

    def _beam_ladder_within(self, models: Sequence[ModelKnobs | None], beam: Mapping[str, float]) -> Ladder:
        """Try the models out and return their rungs; without limits on the beam, the cheapest one's alone."""
        if not beam:
            self._try(models[0])
            fewest = min(self.rays)
            return Ladder("beam", (self._rung(models[0], fewest, {}),))
        points = {}
        for model in models[:-1]:
            tried = self._try(model)
            points[model] = {rays: self._points(tried.pilot, rings) for rays, rings in self.rays.items()}
        full = self._try(models[-1])
        truth = full.pilot.truth()
        rungs = []
        for rays, rings in self.rays.items():
            exact = rays == CONVERGED and rings == RINGS[CONVERGED]
            mine = truth if exact else self._points(full.pilot, rings)
            rungs.append(self._rung(full.model, rays, beam_errors(mine, truth)))
            rungs += [self._rung(model, rays, beam_errors(own[rays], truth)) for model, own in points.items()]
        return Ladder("beam", tuple(rungs))

    @staticmethod
    def _points(pilot: Pilot, rings: tuple[int, ...]) -> list[Any]:
        return [result.points for result in pilot.results(rings, pilot.stretches())]

    def _timed(self, chosen: Chosen) -> Chosen:
        """Return what was chosen with the time that it is expected to take, measured on the model that stands."""
        tried = self.tried[-1]
        rays = int(chosen.changes.get("scan.rays_per_pulse", max(self.rays)))
        seconds, self.costs.points = tried.pilot.scan_seconds({rays: self.rays[rays]})
        pulses = pulses_of(tried.pilot)
        self.costs.speed = seconds[rays] / max(pulses * self.prior.pulse_seconds(rays), 1e-9)
        stands = tried.model is None or tried.model.changes.items() <= chosen.changes.items()
        build = 0.0 if stands else self.tried[0].build_seconds
        beam = replace(chosen.rungs["beam"], seconds=seconds[rays] + build)
        rungs: dict[str, Rung] = {"beam": beam}
        if "relief" in chosen.rungs:
            rungs["relief"] = replace(chosen.rungs["relief"], seconds=self._octave_seconds(chosen))
        if "colour" in chosen.rungs:
            own = chosen.rungs["colour"].changes
            rungs["colour"] = replace(
                chosen.rungs["colour"], seconds=self.costs.colour_seconds(tried.pilot, own, self.prior.image)
            )
        return Chosen(rungs, self.costs.apart())

    def _octave_seconds(self, chosen: Chosen) -> float:
        octaves = int(chosen.rungs["relief"].changes["scan.relief_octaves"])
        return self.costs.relief_seconds(octaves)

    # By a time

    def _by_time(self) -> Chosen:
        models = list(self.site.models(self.limits))
        self._refuse_hopeless(models[0])
        fewest = min(self.rays)
        first = self._try(models[0])
        first.seconds, self.costs.points = first.pilot.scan_seconds({fewest: self.rays[fewest]})
        pulses = pulses_of(first.pilot)
        self.costs.speed = first.seconds[fewest] / max(pulses * self.prior.pulse_seconds(fewest), 1e-9)
        fastest, pilots = first.seconds[fewest] + self.costs.apart(), self._pilot_cost(first, pulses)
        if fastest > self.left():
            raise too_short(self.left(), fastest)
        # What is to keep a tolerance must have been measured; but for the height, which follows from the model.
        must = bool(set(self.limits) - {"height"})
        if must and pilots + fastest > self.left():
            raise too_short(self.left(), pilots + fastest, tolerance=True)
        if must or pilots <= _PILOT_SHARE * (self.left() - fastest):
            return self._measured_choice(models, first)
        self.source = "shipped table: the time is too short for pilot measurements"
        return self._unmeasured_choice(models, first)

    def _measured_choice(self, models: Sequence[ModelKnobs | None], first: _Tried) -> Chosen:
        # Few plants are tried with the fewest rays alone: whoever has time for more rays takes the plants first.
        fewest = min(self.rays)
        few = self._points(first.pilot, self.rays[fewest]) if len(models) > 1 else None
        tried = self._try(models[-1]) if len(models) > 1 else first
        timed = {rays: rings for rays, rings in self.rays.items() if rays in _TIMED_RAYS or len(self.rays) == 1}
        tried.seconds, self.costs.points = tried.pilot.scan_seconds(timed)
        truth = tried.pilot.truth()
        rungs = []
        for rays, rings in self.rays.items():
            exact = rays == CONVERGED and rings == RINGS[CONVERGED]
            mine = truth if exact else self._points(tried.pilot, rings)
            seconds = _between(tried.seconds, rays)
            rungs.append(self._rung(tried.model, rays, beam_errors(mine, truth), seconds))
        if few is not None:
            seconds = first.seconds[fewest] + first.build_seconds
            rungs.append(self._rung(first.model, fewest, beam_errors(few, truth), seconds))
        ladders = [Ladder("beam", tuple(rungs))]
        relief = self._relief_ladder(tried.pilot, timed=True)
        ladders += [relief] if relief else []
        if self.colours:
            ladders.append(self._timed_colours(tried.pilot))
        return best_in_time(ladders, _SURE * self.left(), self._reference(ladders), self.limits, self.costs.apart())

    def _unmeasured_choice(self, models: Sequence[ModelKnobs | None], first: _Tried) -> Chosen:
        fewest = min(self.rays)
        base = self.prior.pulse_seconds(fewest)
        rungs = []
        for number, model in enumerate(models):
            more = 0.0 if number == 0 else self.costs.build_seconds(-1)
            for rays in self.rays if number == len(models) - 1 else (fewest,):
                seconds = first.seconds[fewest] * self.prior.pulse_seconds(rays) / base + more
                rungs.append(self._rung(model, rays, self._prior_errors(rays, model), seconds))
        ladders = [Ladder("beam", tuple(rungs))]
        if self.octaves:
            ladders.append(
                Ladder(
                    "relief",
                    tuple(
                        self._octave_rung(number, {"relief": _exact(nearest(self.prior.relief, number))}, True)
                        for number in self.octaves
                    ),
                )
            )
        if self.colours:
            ladders.append(self._colour_ladder(first.pilot, self._table_colours(), self.prior.image))
        return best_in_time(ladders, _UNSURE * self.left(), self._reference(ladders), self.limits, self.costs.apart())

    def _refuse_hopeless(self, model: ModelKnobs | None) -> None:
        """Refuse a time that is far too short before anything is built, by the shipped table."""
        scan = self.costs.path_pulses() * self.prior.pulse_seconds(min(self.rays))
        seconds = self.costs.build_seconds(0) + scan + self.costs.apart()
        if seconds > _HOPELESS * self.left():
            raise too_short(self.left(), seconds)

    def _pilot_cost(self, first: _Tried, pulses: int) -> float:
        """Return about how long the pilot measurements would take, s."""
        per_pulse = first.seconds[min(self.rays)] / max(pulses, 1)
        ratio = self.prior.pulse_seconds(CONVERGED) / self.prior.pulse_seconds(min(self.rays))
        build = first.build_seconds * self.prior.model[1] / max(self.prior.model[0], 1e-9)
        lines = LINES * PULSES * per_pulse * 2.0 * ratio
        timed = min(0.1 * pulses, 3e5) * per_pulse * 8.0
        return (build if self.site.area else 0.0) + lines + timed

    def _reference(self, ladders: Sequence[Ladder]) -> dict[str, float]:
        """Return the errors of the standard fidelity, by which kinds of errors are weighed against each other."""
        standard = FIDELITIES["standard"]
        found = {"height": standard.tolerance}
        for ladder in ladders:
            usual = {"beam": {"scan.rays_per_pulse": standard.rays_per_pulse}}
            usual |= {"relief": {"scan.relief_octaves": standard.relief_octaves}}
            rungs = [rung for rung in ladder.rungs if usual.get(ladder.name, {}).items() <= rung.changes.items()]
            if ladder.name == "colour":
                found |= self.prior.colour["standard"]
            elif rungs:
                found |= {name: error for name, error in rungs[0].errors.items() if name != "height"}
        return {name: error for name, error in found.items() if error > 0.0}

    # Rungs

    def _try(self, model: ModelKnobs | None) -> _Tried:
        begin = time.perf_counter()
        scene = self.site.scene(model)
        pilot = Pilot.on(self.scenario, scene, self.site.path, self.site.conditions)
        self.tried.append(_Tried(model, pilot, time.perf_counter() - begin))
        return self.tried[-1]

    def _rung(self, model: ModelKnobs | None, rays: int, errors: Errors, seconds: float | None = None) -> Rung:
        changes = rays_changes(self.scenario, rays)
        cost = 4.0 + rays
        errors = dict(errors)
        if model is not None:
            changes = {**model.changes, **changes}
            cost += 0.5 * model.detail
            errors["height"] = _exact(model.height_error)
            estimate, bound = errors.get("position", (0.0, 0.0))
            errors["position"] = estimate, bound + model.position_error
        expected = {name: pair[0] for name, pair in errors.items()}
        return Rung(changes, expected, {name: pair[1] for name, pair in errors.items()}, cost, seconds)

    def _prior_errors(self, rays: int, model: ModelKnobs | None) -> Errors:
        errors = dict(nearest(self.prior.beam, rays))
        if model is not None and model.detail < FIDELITIES["standard"].vegetation_detail:
            errors |= self.prior.few_plants
        if self.scenario.vegetation_detail is not None:  # as many plants as are wanted
            errors = dict(nearest(self.prior.beam, rays))
        return {name: _exact(error) for name, error in errors.items()}

    def _relief_ladder(self, pilot: Pilot, timed: bool = False) -> Ladder | None:
        if not self.octaves:
            return None
        found = pilot.relief_errors(self.octaves)
        return Ladder(
            "relief", tuple(self._octave_rung(number, errors, timed) for number, (errors, _seconds) in found.items())
        )

    def _octave_rung(self, number: int, errors: Errors, timed: bool) -> Rung:
        expected, bounds = ({name: pair[side] for name, pair in errors.items()} for side in (0, 1))
        seconds = self.costs.relief_seconds(number) if timed else None
        return Rung({"scan.relief_octaves": number}, expected, bounds, number, seconds)

    @property
    def _limits_colours(self) -> bool:
        return bool(_COLOURS & set(self.limits))

    def _pilot_colours(self, pilot: Pilot) -> dict[str, Errors]:
        return colour_errors(pilot, self.colours, self.costs.wanted)

    def _table_colours(self) -> dict[str, Errors]:
        kinds = [kind for kind in sorted(_COLOURS) if has_kind(self.scenario, kind)]
        return {name: {kind: _exact(self.prior.colour[name][kind]) for kind in kinds} for name in self.colours}

    def _colour_ladder(
        self,
        pilot: Pilot,
        errors: Mapping[str, Errors],
        timing: tuple[float, float, float] | None = None,
    ) -> Ladder:
        """Return the sources of colours with their errors by name, as far as these are known."""
        rungs = []
        for name, changes in self.colours.items():
            seconds = None if timing is None else self.costs.colour_seconds(pilot, changes, timing)
            expected, bounds = ({kind: pair[side] for kind, pair in errors.get(name, {}).items()} for side in (0, 1))
            rungs.append(Rung(changes, expected, bounds, self.costs.colour_cost(pilot, changes), seconds))
        return Ladder("colour", tuple(rungs))

    def _timed_colours(self, pilot: Pilot) -> Ladder:
        """Return the sources of colours with the time that images take here, as far as there is time to find out."""
        timing = tuple(self.costs.speed * value for value in self.prior.image)
        images = [name for name, changes in self.colours.items() if changes["colour.source"] == "images"]
        if images and timing[0] + 4.0 * timing[1] < 0.5 * _PILOT_SHARE * self.left():
            measured = self.colours["standard" if "standard" in images else images[0]]
            timing = image_seconds(pilot, measured, self.costs.wanted)
        if self._limits_colours:
            errors = self._pilot_colours(pilot)
        else:
            errors, self.source = self._table_colours(), f"{self.source}; colours by the shipped table"
        return self._colour_ladder(pilot, errors, (timing[0], timing[1], timing[2]))


def has_kind(scenario: Scenario, kind: str) -> bool:
    """Return whether points of a job have what a kind of error of colours is of: ``colour`` or ``layers``."""
    wanted = coloured_layers(scenario)
    return "rgb" in wanted if kind == "colour" else bool(set(MATERIAL_LAYERS) & wanted)


def _exact(value: float) -> tuple[float, float]:
    return value, value


def _between(seconds: Mapping[int, float], rays: int) -> float:
    """Return the seconds of so many rays per pulse, linear between and beyond those that were measured."""
    known = sorted(seconds)
    if rays in seconds or len(known) == 1:
        return seconds[rays if rays in seconds else known[0]]
    low, high = (known[-2], known[-1]) if rays > known[-1] else (known[0], known[1])
    return seconds[low] + (seconds[high] - seconds[low]) * (rays - low) / (high - low)


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


