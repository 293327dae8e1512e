"""The main job: scenario -> parameters -> model -> scan -> cloud -> files. What no output needs is not made."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.crs import wkt
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.progress import Progress, StageTimer, silent
from ..fitting.axis_object import fitted_axis
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters, read_parameters
from ..sampling.road import sample_road
from ..scenario.scan import scanner_setting
from ..scenario.scenario import Scenario
from ..twin.formats import check_formats, twin_file_names
from .report import FILES, empty_scan_warnings, file_names, report_footer, report_header, write_report
from .road_files import write_road_files

if TYPE_CHECKING:
    from .road_scene import RoadScene


@dataclass
class Job:
    """Request to `generate`.

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


def generate(job: Job, progress: Progress = silent) -> dict[str, Any]:
    """Run the main job; return the report that is also written to ``report.json``.

    Raises:
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    job = replace(job, begun=job.begun or time.perf_counter())
    check(job)
    timer, report = StageTimer(progress), report_header()
    with output_folder(job.output, _names(job.scenario), job.overwrite) as folder:
        road = make_road(job, timer, report)
        job, built = choose_settings(job, road, timer, report)
        write_road_files(folder, job.scenario, road, timer)
        scan_and_save(job, road, folder, timer, report, built)
        if warnings := empty_scan_warnings(report.get("counts", {})):
            report["warnings"] = warnings
        return write_report(folder, report | report_footer(job.scenario, timer))


def _names(scenario: Scenario) -> list[str]:
    return [*file_names(scenario, scenario.outputs), *twin_file_names(scenario.twin)]


def check(job: Job) -> None:
    """Refuse a job that can't be done before any work starts."""
    scenario = job.scenario
    if scenario.chooses:
        from .choose import search  # loads Blender

        search.check(scenario)
    scanner_setting(scenario.scan)
    scenario.cloud.scheme()
    scenario.own_materials()
    if set(scenario.outputs) & {"cloud", "previews"}:
        from ..blender.cameras import check_colour  # Blender takes a second to start: other outputs need none

        check_colour(scenario.colour.settings(scenario.fidelity))
    wkt(scenario.road.epsg)
    check_formats(scenario.twin)
    if job.parameters and job.axis:
        raise InputError("--axis", str(job.axis), "can't be given together with --parameters")
    if not scenario.outputs and not scenario.twin:
        raise InputError("outputs", [], f"must name at least one of {', '.join(FILES)}")


def make_road(job: Job, timer: StageTimer, report: dict[str, Any]) -> RoadGeometry:
    """Return the road that a job is about; the report gets what is to be said of the axis that it was fitted to."""
    with timer.stage("parameters"):
        parameters, axis_report = road_parameters(job)
        report |= axis_report
        road = RoadGeometry(parameters)
    section = job.scenario.section_length(road.length)
    if section is not None:
        refuse_sections(job.scenario, road.length, section)
    return road


def road_parameters(job: Job) -> tuple[RoadParameters, dict[str, Any]]:
    """Return the road that a job is about, and what to report of the axis that it was fitted to."""
    scenario = job.scenario
    if job.parameters:
        return read_parameters(job.parameters), {}
    if job.axis:
        axis, limits, fit = fitted_axis(job.axis, scenario.road)
        return sample_road(limits, scenario.seed, scenario.title, axis), {"axis": fit}
    return sample_road(scenario.road, scenario.seed, scenario.title), {}


def refuse_sections(scenario: Scenario, length: float, section: float) -> None:
    """Refuse what needs the whole model of a road of a length (m) that is built by sections of a length (m)."""
    if scenario.chooses:
        name = "time_budget" if scenario.tolerance is None else "tolerance"
        raise InputError(
            name,
            getattr(scenario, name),
            f"can't be kept on a road of {length:g} m, which is built by sections of {section:g} m: choose on a "
            "shorter road, and set what was chosen",
        )
    if "scene" in scenario.outputs:
        raise InputError(
            "outputs",
            list(scenario.outputs),
            f"can't have scene: a road of {length:g} m is built by sections of {section:g} m; leave "
            f"scene out, or set scan.section_length to {length / 2.0:g} or more",
        )


def choose_settings(
    job: Job, road: RoadGeometry, timer: StageTimer, report: dict[str, Any]
) -> tuple[Job, RoadScene | None]:
    """Return the job with the settings chosen that its scenario leaves open, and the model if that stands already."""
    if not job.scenario.chooses:
        return job, None
    from ..blender.files import empty_file  # Blender takes a second to start: most jobs choose nothing
    from .choose.search import decide
    from .choose.sites import RoadSite
    from .road_scene import RoadScene

    with timer.stage("choice"):
        if job.new_file:
            empty_file()
        site = RoadSite(job.scenario, road)
        decision = decide(job.scenario, site, job.begun or time.perf_counter())
        report["choice"] = decision.report
    job = replace(job, scenario=decision.scenario, new_file=False)
    if decision.scene is None or site.model is None:
        return job, None
    return job, RoadScene(site.model, decision.scene)


def scan_and_save(
    job: Job, road: RoadGeometry, folder: Path, timer: StageTimer, report: dict[str, Any], built: RoadScene | None
) -> None:
    """Write the files that need a scene, if there are any; the report gets the counts."""
    if set(job.scenario.outputs) & {"scene", "cloud", "previews"}:
        from .road_scene import make_scene_files  # Blender takes a second to start: other outputs need none

        report["counts"] = make_scene_files(job.scenario, road, folder, timer, built, job.new_file)
