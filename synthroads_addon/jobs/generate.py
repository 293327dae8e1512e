"""The main job: scenario -> parameters -> model -> scan -> cloud -> files. What no output needs is not made."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.crs import wkt
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.progress import Progress, StageTimer, silent
from ..fitting.fit import fitted_axis
from ..fitting.plot import draw_refused_fit
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters, read_parameters
from ..sampling.road import sample_road
from ..scanning.scene.classify import check_asset_classes
from ..scenario.scenario import OF_POINTS, Scenario
from ..twin.formats import check_formats
from .job_files import FILES, JobFiles, empty_scan_warnings
from .scan.plan import check_scan


@dataclass
class Job:
    """Request to `generate`: scenario, output folder, and optionally a given road or axis.

    Attributes:
        scenario: limits, scan, fidelity and outputs.
        output: folder for the files.
        parameters: take this road instead of sampling one.
        axis: sample a road along this centreline (CSV or GeoJSON).
        overwrite: replace files that are already there.
        new_file: build in a new, empty Blender file instead of the open one, which is lost.
        begun: when the job began, by `time.perf_counter`, for a time budget; when `generate` is called if None.
    """

    scenario: Scenario
    output: Path
    parameters: Path | None = None
    axis: Path | None = None
    overwrite: bool = False
    new_file: bool = False
    begun: float | None = None


@dataclass(frozen=True)
class RoadSource:
    """Source of a job's road: random sampling within limits, a parameter set, or a measured axis; see `Job`.

    Attributes:
        pictures: folder for the picture of an axis that no road follows; none is drawn if None.
    """

    scenario: Scenario
    parameters: Path | None = None
    axis: Path | None = None
    pictures: Path | None = None

    def read(self) -> tuple[RoadParameters, dict[str, Any]]:
        """Return the road's parameters, and a report of the fit to a measured axis (empty without an axis)."""
        scenario = self.scenario
        if self.parameters:
            return read_parameters(self.parameters), {}
        if self.axis:
            with draw_refused_fit(self.pictures):
                axis, limits, fit = fitted_axis(self.axis, scenario.road)
            return sample_road(limits, scenario.seed, scenario.title, axis), {"axis": fit}
        return sample_road(scenario.road, scenario.seed, scenario.title), {}


def generate(job: Job, progress: Progress = silent) -> dict[str, Any]:
    """Run the main job, from scenario to files; return the report, which is also written to ``report.json``.

    Raises:
        AxisRefusedError: no road follows the axis; a picture of the fit is in the output folder.
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    begun, timer = job.begun or time.perf_counter(), StageTimer(progress)
    check(job)
    source = RoadSource(job.scenario, job.parameters, job.axis, pictures=job.output)
    files, scene = JobFiles(job.scenario), None
    with output_folder(job.output, files.names, job.overwrite) as folder:
        road, report = make_road(source, timer)
        job.scenario.check_sections(road.length)
        check_asset_classes(job.scenario.cloud.scheme(), road.parameters)
        if set(job.scenario.outputs) & {"scene", *OF_POINTS}:
            from ..blender.files import empty_file  # Blender takes a second to start: other outputs need none
            from .open_scene import RoadScene

            if job.new_file:
                empty_file()
            scene = RoadScene(job.scenario, road)
        if scene and job.scenario.chooses:
            from .choose.search import choose_settings  # loads Blender as well

            scene, report["choice"] = choose_settings(scene, begun, timer)
            files = JobFiles(scene.scenario)
        files.write_road(folder, road, timer)
        report["instances"] = road.numbers.to_dict()
        if scene:
            report["counts"] = scene.write_files(folder, timer)
            if warnings := empty_scan_warnings(report["counts"]):
                report["warnings"] = warnings
        return files.write_report(folder, report, timer)


def check(job: Job) -> None:
    """Raise an InputError for a job that can't be done, before any work starts."""
    scenario = job.scenario
    check_scan(scenario)
    wkt(scenario.road.epsg)
    check_formats(scenario.twin)
    if job.parameters and job.axis:
        raise InputError("--axis", str(job.axis), "can't be given together with --parameters")
    if not scenario.outputs and not scenario.twin:
        raise InputError("outputs", [], f"must name at least one of {', '.join(FILES)}")


def make_road(source: RoadSource, timer: StageTimer) -> tuple[RoadGeometry, dict[str, Any]]:
    """Return the road's geometry, and a report of the fit to a measured axis (empty without an axis)."""
    with timer.stage("parameters"):
        parameters, axis_report = source.read()
        return RoadGeometry(parameters), axis_report
