"""The main job: scenario -> parameters -> model -> scan -> cloud -> files. What no output needs is not made."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.files import output_folder
from ..base.maps.crs import MapSystem, metric_system
from ..base.progress import Progress, StageTimer, silent
from ..base.remarks import collected_remarks, warn
from ..fitting.plot import draw_refused_fit
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters, read_parameters
from ..sampling.road import sample_road
from ..scanning.scene.classify import check_asset_classes
from ..scenario.inputs import ScenarioInputs
from ..scenario.road import RoadScenario
from ..scenario.scenario import OF_POINTS, Scenario
from ..twin.formats import check_formats
from .axis_points import NOWHERE_ELSE, PathPlace, RoadBeside
from .axis_source import axis_from_file
from .job_files import FILES, JobFiles, empty_scan_warnings
from .scan.plan import check_scan
from .whole_road import road_from_file

if TYPE_CHECKING:
    from .open_scene import RoadScene

FROM_ROAD = frozenset(
    {"length", "radius", "grade_percent", "map_origin", "cross_section", "lanes", "lane_width", "median_width"}
    | {"turnouts", "lane_changes"}
)
"""Fields of a road's limits that have no effect where a whole road is given."""
FROM_AXIS = frozenset({"length", "radius", "grade_percent", "map_origin"})
"""Fields of a road's limits that have no effect where an axis is given, which says all of that itself."""


@dataclass
class Job:
    """Request to `generate`: scenario, output folder, and optionally a given road or axis.

    Attributes:
        scenario: limits, scan, fidelity and outputs.
        output: folder for the files; `scan_to_arrays` needs none.
        parameters: take this road instead of sampling one.
        axis: sample a road along this centreline: any file that `synthroads road` reads.
        axis_name: of the road or alignment in that file; None takes the longest.
        axis_place: where the axis lies beside that file's points.
        overwrite: replace files that are already there.
        road: take the whole road of this OpenDRIVE, LandXML or IFC file, as far as it is read.
        new_file: build in a new, empty Blender file instead of the open one, which is lost. In the open one, all
            visible objects are scanned too, except the cube of a bpy that has just been imported.
        begun: when the job began, by `time.perf_counter`, for a time budget; when `generate` is called if None.
    """

    scenario: Scenario
    output: Path | None = None
    parameters: Path | None = None
    axis: Path | None = None
    axis_name: str | None = None
    axis_place: PathPlace = NOWHERE_ELSE
    overwrite: bool = False
    road: Path | None = None
    new_file: bool = False
    begun: float | None = None


@dataclass(frozen=True)
class RoadSource:
    """Source of a job's road: random sampling within limits, a parameter set, or a measured axis; see `Job`.

    Attributes:
        pictures: folder for the picture of an axis that no road follows; none is drawn if None.
        road: OpenDRIVE, LandXML or IFC file whose whole road is taken.
        round_kinks: distance (m) from an axis' kinks that roundings may keep; None refuses kinks.
        deviations: file for the picture of how far an axis' file is from it; none is drawn if None.
    """

    scenario: Scenario
    parameters: Path | None = None
    axis: Path | None = None
    axis_name: str | None = None
    axis_place: PathPlace = NOWHERE_ELSE
    pictures: Path | None = None
    road: Path | None = None
    round_kinks: float | None = None
    deviations: Path | None = None

    def read(self) -> tuple[RoadParameters, dict[str, Any]]:
        """Return the road's parameters, and a report of the fit to a measured axis (empty without an axis)."""
        scenario = self.scenario
        if self.parameters:
            return read_parameters(self.parameters), {}
        options = (self.axis_name, self.axis_place, self.round_kinks, self.deviations)
        if self.road:
            parameters, report = road_from_file(self.road, scenario, *options)
            return parameters, {"axis": report}
        if self.axis:
            with draw_refused_fit(self.pictures):
                road_beside = RoadBeside()
                axis, limits, report = axis_from_file(self.axis, scenario.road, scenario.seed, *options, road_beside)
            return sample_road(limits, scenario.seed, scenario.title, axis, road_beside.given), {"axis": report}
        return sample_road(scenario.road, scenario.seed, scenario.title), {}


@collected_remarks()
def generate(job: Job, progress: Progress = silent) -> dict[str, Any]:
    """Run the main job, from scenario to files; return the report, which is also written to ``report.json``.

    Raises:
        AxisRefusedError: no road follows the axis; a picture of the fit is in the output folder.
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    start, timer = job.begun or time.perf_counter(), StageTimer(progress)
    inputs = check(job)
    if job.output is None:
        raise InputError("output", None, "must be a folder for the files; scan_to_arrays needs none")
    files, scene = JobFiles(job.scenario), None
    with output_folder(job.output, files.names, job.overwrite) as folder:
        road, report = make_job_road(job, inputs, timer)
        if set(job.scenario.outputs) & {"scene", *OF_POINTS}:
            scene = open_job_scene(job, road, inputs, start, timer, report)
            files = JobFiles(scene.scenario)
        files.write_road(folder, road, timer)
        report["instances"] = road.numbers.to_dict()
        if scene:
            report["counts"] = scene.write_files(folder, timer)
            add_warnings(report, scene)
        return files.write_report(folder, report, timer)


def make_job_road(job: Job, inputs: ScenarioInputs, timer: StageTimer) -> tuple[RoadGeometry, dict[str, Any]]:
    """Return the road of a checked job and the beginning of its report: the fit to a measured axis, if it has one.

    Raises:
        InputError: there is no such road, or it can't be scanned as the scenario says.
    """
    source = RoadSource(job.scenario, job.parameters, job.axis, job.axis_name, job.axis_place, job.output, job.road)
    road, report = make_road(source, timer)
    job.scenario.check_sections(road.length)
    check_asset_classes(inputs.scheme, road.parameters)
    return road, report


def open_job_scene(
    job: Job, road: RoadGeometry, inputs: ScenarioInputs, begun: float, timer: StageTimer, report: dict[str, Any]
) -> RoadScene:
    """Return the scene of a job's road, with the settings that its scenario leaves open chosen; adds to `report`.

    Args:
        job: the job.
        road: its road.
        inputs: what the files that its scenario names hold.
        begun: when the job began, by `time.perf_counter`.
        timer: of its stages.
        report: gets the choice.
    """
    # Blender takes a second to start: other outputs need none
    from ..blender.files import empty_file, remove_startup_objects
    from .open_scene import RoadScene

    if job.new_file:
        empty_file()
    else:
        remove_startup_objects()
    scene = RoadScene(job.scenario, road, inputs)
    if job.scenario.chooses:
        from .choose.search import choose_settings  # loads Blender as well

        scene, report["choice"] = choose_settings(scene, begun, timer)
    return scene


def add_warnings(report: dict[str, Any], scene: RoadScene) -> None:
    """Add the warnings about a scene's scan, of which `report` has the counts, to it; none where there are none."""
    if warnings := [*scene.warnings, *empty_scan_warnings(report["counts"])]:
        report["warnings"] = warnings


def check(job: Job) -> ScenarioInputs:
    """Raise an InputError for a job that can't be done, before any work starts; return what its files hold."""
    scenario = job.scenario
    inputs = check_scan(scenario)
    system = metric_system(scenario.road.epsg, scenario.road.height_epsg, "road.epsg")
    if not (job.axis or job.parameters or job.road):
        _tell_odd_place(scenario.road, system)
    check_formats(scenario.twin)
    sources = {"--parameters": job.parameters, "--axis": job.axis, "--road": job.road}
    names = [name for name, path in sources.items() if path]
    if len(names) > 1:
        raise InputError(names[1], str(sources[names[1]]), f"can't be given together with {names[0]}")
    if not scenario.outputs and not scenario.twin:
        raise InputError("outputs", [], f"must name at least one of {', '.join(FILES)}")
    return inputs


def _tell_odd_place(road: RoadScenario, system: MapSystem) -> None:
    """Warn where a road's map origin lies outside of the area that its coordinate system is meant for."""
    if system.outside(np.array([road.map_origin[:2]])).max() > 0.0:
        place, name = list(road.map_origin[:2]), system.label
        warn("road.map_origin %s lies outside of the area that %s is meant for (%s)", place, name, system.area)


def make_road(source: RoadSource, timer: StageTimer) -> tuple[RoadGeometry, dict[str, Any]]:
    """Return the road's geometry, and a report of the fit to a measured axis (empty without an axis)."""
    with timer.stage("parameters"):
        parameters, axis_report = source.read()
        return RoadGeometry(parameters), axis_report
