"""Epochs of a road: parameters, changes, twins and clouds of each, one after the other."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...base.errors import InputError
from ...base.files import output_folder
from ...base.machine import release_memory
from ...base.progress import Progress, StageTimer, silent
from ...base.random_streams import stream
from ...base.remarks import collected_remarks
from ...base.schema import canonical_json, round_value
from ...base.version import generator
from ...road.changes.change import ChangeList, Edit
from ...road.changes.diff import diff_roads
from ...road.changes.edits import apply_changes
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.surroundings import RampVehicle, Vehicle
from ...sampling.changes import sample_changes
from ...sampling.surroundings import sample_environment
from ...scanning.epochs.registration import CELL, Displacement
from ...scanning.epochs.seen import SeenPlaces
from ...scanning.epochs.truth import ChangedMesh, EpochTruth
from ...scenario.scenario import OF_POINTS, Scenario, data_as_given, scenario_changes, with_changes
from ..generate import Job, add_warnings, check, make_job_road
from ..job_files import JobFiles

SUMMARY, CHANGES, REGISTRATION = "epochs.json", "changes.json", "registration.json"
"""Files of the job: what there is, in its folder; the changes since the epoch before, in each later epoch's; and how
far a cloud is displaced, in that of each epoch with one."""
_MOST_EPOCHS = 100
LAYER = "change"


@dataclass
class EpochsJob:
    """Request for several epochs of a road.

    Attributes:
        job: the first epoch: scenario, output folder and the road, as `generate` takes them.
        count: number of epochs, at least 2.
        same_survey: whether all are scanned from the same path with the same random numbers, light and traffic.
        settings: fields of the scenario by the number of an epoch, from 1, as ``path=value``.
        changes: lists to make instead of drawing them, one for each epoch from the second on.
    """

    job: Job
    count: int = 2
    same_survey: bool = False
    settings: Mapping[int, list[str]] = field(default_factory=dict)
    changes: tuple[ChangeList, ...] = ()


@dataclass
class _Epoch:
    """One epoch: number from 1, parameter set, scenario of its survey, and the changes since the one before."""

    number: int
    road: RoadGeometry
    scenario: Scenario
    changes: ChangeList | None

    @property
    def name(self) -> str:
        """Return the name of its folder."""
        return epoch_name(self.number)


def epoch_name(number: int) -> str:
    """Return the name of an epoch's folder."""
    return f"epoch-{number}"


@collected_remarks()
def generate_epochs(request: EpochsJob, progress: Progress = silent) -> dict[str, Any]:
    """Make all epochs of a road and return the report, which is also written to ``epochs.json``.

    Each is built, scanned and dropped before the next one: memory is that of one epoch, with what of the one before
    changed ones are compared with.

    Raises:
        InputError: an input is wrong; nothing is left half-written.
    """
    if not 2 <= request.count <= _MOST_EPOCHS:
        raise InputError("epochs", request.count, f"must be a whole number from 2 to {_MOST_EPOCHS}")
    job = request.job
    if job.output is None:
        raise InputError("output", None, "must be a folder for the files")
    timer = StageTimer(progress)
    inputs = check(job)
    road, _ = make_job_road(job, inputs, timer)
    epochs = plan_epochs(request, road)
    for epoch in epochs:
        if epoch.scenario.section_length(road.length) is not None:
            text = f"must be at least {road.length:g}: epochs are scanned whole, as their changes are compared"
            raise InputError("scan.section_length", epoch.scenario.scan.section_length, text)
    names = [SUMMARY, *(f"{epoch.name}/{name}" for epoch in epochs for name in _file_names(epoch))]
    folders = [SUMMARY, *(epoch.name for epoch in epochs)]
    with output_folder(job.output, folders, job.overwrite) as folder:
        report = _EpochsRun(request, epochs, folder, progress).run()
        report["files"] = names
        (folder / SUMMARY).write_text(canonical_json(report), encoding="utf-8")
    return report


def _file_names(epoch: _Epoch) -> list[str]:
    """Return the names of an epoch's files in its folder."""
    names = JobFiles(epoch.scenario).names
    registered = [REGISTRATION] if "cloud" in epoch.scenario.outputs else []
    return [*names, *registered, *([CHANGES] if epoch.changes else [])]


def plan_epochs(request: EpochsJob, road: RoadGeometry) -> list[_Epoch]:
    """Return all epochs, with the changes drawn, or made as lists say, and what else differs between surveys."""
    job = request.job
    limits = job.scenario.road.changes
    epochs = [_Epoch(1, road, epoch_scenario(request, 1), None)]
    for number in range(2, request.count + 1):
        before, scenario = epochs[-1].road.parameters, epoch_scenario(request, number)
        if len(request.changes) >= number - 1:
            changes = request.changes[number - 2]
        else:
            changes = sample_changes(before, limits, job.scenario.seed, number - 1)
        if not request.same_survey:
            changes = _with_survey(before, changes, scenario)
        after = apply_changes(before, changes)
        epochs.append(_Epoch(number, RoadGeometry(after), scenario, changes))
    roads = [epoch.road for epoch in epochs]
    for item in roads:
        item.epochs = tuple(other for other in roads if other is not item)
    return epochs


def epoch_scenario(request: EpochsJob, number: int) -> Scenario:
    """Return the scenario of an epoch's survey: its own seed and settings, and the layer of changes in its cloud."""
    scenario = request.job.scenario
    if number > 1 and not request.same_survey:
        seed = int(stream(scenario.seed, "survey", number).integers(2**62))
        scenario = scenario.model_copy(update={"seed": seed})
    if settings := request.settings.get(number):
        scenario = Scenario.from_dict(with_changes(data_as_given(scenario), scenario_changes(settings)))
    if "cloud" in scenario.outputs and LAYER not in scenario.cloud.attributes:
        attributes = (*scenario.cloud.attributes, LAYER)
        scenario = scenario.model_copy(update={"cloud": scenario.cloud.model_copy(update={"attributes": attributes})})
    return scenario


def _with_survey(before: RoadParameters, changes: ChangeList, scenario: Scenario) -> ChangeList:
    """Return a list with the light, weather and traffic of another day among its circumstances."""
    update: dict[str, Any] = {"environment": sample_environment(scenario.road, scenario.seed)}
    rng = stream(scenario.seed, "traffic of an epoch")
    objects = dict(before.objects)
    for name, vehicle in before.of_type(Vehicle).items():
        if isinstance(vehicle, RampVehicle):
            continue
        station = round_value(before.alignment.length * rng.random(), 3)
        objects[name] = vehicle.model_copy(update={"station": station})
    other_day = before.model_copy(update={**update, "objects": objects})
    edits = diff_roads(before, other_day).circumstances
    taken = {(edit.thing, edit.path) for edit in changes.edits}
    gone = {edit.thing for edit in changes.edits if edit.path == ""}
    further: list[Edit] = [edit for edit in edits if (edit.thing, edit.path) not in taken and edit.thing not in gone]
    return changes.model_copy(update={"circumstances": (*changes.circumstances, *further)})


class _EpochsRun:
    """The epochs of a job as they are made one after the other."""

    def __init__(self, request: EpochsJob, epochs: list[_Epoch], folder: Path, progress: Progress) -> None:
        self._request, self._epochs, self._folder, self._progress = request, epochs, folder, progress
        self._mesh: ChangedMesh | None = None
        self._seen: SeenPlaces | None = None
        self._errors: Displacement | None = None

    def run(self) -> dict[str, Any]:
        """Make all epochs; return the report."""
        reports = []
        ahead = 0.0
        if any(set(epoch.scenario.outputs) & {"cloud"} for epoch in self._epochs):
            begun = time.perf_counter()
            self._mesh = self._next_mesh()
            ahead = time.perf_counter() - begun
        for epoch in self._epochs:
            reports.append(self._make(epoch))
        return {
            "type": "Epochs",
            "generator": generator(),
            "seed": self._request.job.scenario.seed,
            "same_survey": self._request.same_survey,
            "seconds_ahead": round(ahead, 3),
            "epochs": reports,
        }

    def _next_mesh(self) -> ChangedMesh:
        """Return the second epoch's triangles at what changes, for which its scene is built ahead if there are any."""
        first, second = self._epochs[:2]
        assert second.changes is not None
        if not ChangedMesh.is_needed(second.road, first.road, second.changes):
            return ChangedMesh({})
        scene = self._scene(second, StageTimer(self._progress))
        mesh = scene.read().static
        result = ChangedMesh.of(mesh, second.road, first.road, second.changes)
        self._drop()
        return result

    def _scene(self, epoch: _Epoch, timer: StageTimer) -> Any:
        """Return the scene of an epoch, built in an empty file."""
        from ...blender.files import empty_file  # needs Blender, which is loaded late
        from ..open_scene import RoadScene

        empty_file()
        scene = RoadScene.of(epoch.scenario, epoch.road)
        with timer.stage("model"):
            scene.build()
        return scene

    def _drop(self) -> None:
        """Free what the scene of an epoch took."""
        from ...blender.files import empty_file  # needs Blender, which is loaded late

        empty_file()
        gc.collect()
        release_memory()

    def _make(self, epoch: _Epoch) -> dict[str, Any]:
        """Make the files of an epoch; return its line in the report."""
        folder = self._folder / epoch.name
        folder.mkdir()
        timer, begun = StageTimer(self._progress), time.perf_counter()
        files, report = JobFiles(epoch.scenario), {}  # type: JobFiles, dict[str, Any]
        files.write_road(folder, epoch.road, timer)
        if epoch.changes is not None:
            (folder / CHANGES).write_text(epoch.changes.to_json(), encoding="utf-8")
        report["instances"] = epoch.road.numbers.to_dict()
        if set(epoch.scenario.outputs) & {"scene", *OF_POINTS}:
            scene = self._scene(epoch, timer)
            scene.truth = self._truth(epoch)
            report["counts"] = scene.write_files(folder, timer)
            self._register(epoch, folder, scene.truth)
            self._keep(epoch, scene)
            add_warnings(report, scene)
            del scene
            self._drop()
        files.write_report(folder, report, timer)
        counts = report.get("counts", {})
        return {
            "folder": epoch.name,
            "years": epoch.changes.years if epoch.changes else None,
            "changes": len(epoch.changes.changes) if epoch.changes else 0,
            "points": counts.get("points"),
            "seconds": round(time.perf_counter() - begun, 3),
        }

    def _truth(self, epoch: _Epoch) -> EpochTruth | None:
        """Return what an epoch's scan knows of the one before; of the first, of the one after."""
        if self._mesh is None:
            return None
        number = epoch.number
        other = self._epochs[1] if number == 1 else self._epochs[number - 2]
        before, after = (epoch, other) if number == 1 else (other, epoch)
        assert after.changes is not None
        limits = self._request.job.scenario.road.changes
        truth = EpochTruth(
            before.road,
            after.road,
            after.changes,
            is_second=number > 1,
            other=self._mesh,
            strength=epoch.scenario.scan.relief,
            least=limits.unchanged_below,
            earlier=self._seen,
        )
        if number == 1:
            truth.later = self._mesh.cells
        return truth

    def _register(self, epoch: _Epoch, folder: Path, truth: EpochTruth | None) -> None:
        """Write how far the cloud of an epoch is displaced, in itself and against that of the epoch before."""
        before, self._errors = self._errors, None
        if truth is None or "cloud" not in epoch.scenario.outputs:
            return
        self._errors = truth.errors.displacement()
        content: dict[str, Any] = {"type": "Registration", "cell": CELL, "displacement": self._errors.report()}
        if before is not None:
            since = self._errors.since(before)
            error = since.registration_error
            content["since_epoch_before"] = since.report()
            content["registration_error"] = None if math.isnan(error) else round(error, 7)
        (folder / REGISTRATION).write_text(canonical_json(content), encoding="utf-8")

    def _keep(self, epoch: _Epoch, scene: Any) -> None:
        """Keep of an epoch that was scanned what the next one is compared with."""
        if scene.truth is not None:
            self._seen = scene.truth.seen
        following = self._epochs[epoch.number] if epoch.number < len(self._epochs) else None
        if following is not None and following.changes is not None and self._mesh is not None:
            self._mesh = ChangedMesh.of(scene.read().static, epoch.road, following.road, following.changes)
