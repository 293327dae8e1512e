"""The main job: scenario -> parameters -> model -> scan -> cloud -> files. What no output needs is not made."""

from __future__ import annotations

import platform as machine
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import laspy
import numpy as np

from ..base.crs import wkt
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.machine import available_cores
from ..base.progress import Progress, StageTimer, silent
from ..base.schema import canonical_json
from ..base.version import generator, version
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters, read_parameters
from ..sampling.road import sample_road
from ..scanning.scene.motion import ScannedScene
from ..scenario.scan import scanner_setting
from ..scenario.scenario import Scenario
from ..twin.formats import check_formats, twin_file_names, write_twin
from .road_files import write_road_files
from .scan.by_section import check_by_section, scan_by_section
from .scan.files import colour_job, make_scan, road_path, scan_to_files, top_view

if TYPE_CHECKING:
    from ..blender.model.build import RoadModel

FILES = {
    "parameters": ("parameters.json",),
    "cloud": ("cloud.laz",),
    "centerline": ("centerline.geojson",),
    "scene": ("scene.blend",),
    "previews": ("preview_class.png", "preview_intensity.png", "preview_rgb.png"),
}
"""The files that each output of a scenario stands for, with one format of the cloud; see `file_names`."""


def file_names(scenario: Scenario, outputs: Sequence[str]) -> list[str]:
    """Return the names of all files that outputs stand for, and of the report, which is always written."""
    files = FILES | {"cloud": scenario.cloud.file_names()}
    return [name for output in outputs for name in files[output]] + ["report.json"]


@dataclass(frozen=True)
class Built:
    """A model that stands in the open file already, and what is scanned of it."""

    model: RoadModel
    scene: ScannedScene


@dataclass
class Job:
    """What `generate` is asked for.

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
    begun = time.perf_counter() if job.begun is None else job.begun
    check(job)
    wanted = job.scenario.outputs
    names = [*file_names(job.scenario, wanted), *twin_file_names(job.scenario.twin)]
    timer = StageTimer(progress)
    report = opening()
    with output_folder(job.output, names, job.overwrite) as folder:
        with timer.stage("parameters"):
            parameters, axis_report = road_parameters(job)
            geometry = RoadGeometry(parameters)
            check_by_section(job.scenario, geometry.length)
            report |= axis_report
            if not job.scenario.chooses:
                write_road_files(folder, wanted, parameters, geometry, job.scenario)
        built = None
        if job.scenario.chooses:
            with timer.stage("choice"):
                job, built, report["choice"] = _chosen(job, parameters, begun)
                write_road_files(folder, wanted, parameters, geometry, job.scenario)
        if job.scenario.twin:
            with timer.stage("twin"):
                write_twin(parameters, folder, job.scenario.twin, job.scenario.settings().tolerance)
        if set(wanted) & {"scene", "cloud", "previews"}:
            report["counts"] = _scene_outputs(job, folder, parameters, timer, built)
        report |= closing(job.scenario, timer)
        (folder / "report.json").write_text(canonical_json(report), encoding="utf-8")
    return report


def _chosen(job: Job, parameters: RoadParameters, begun: float) -> tuple[Job, Built | None, dict[str, Any]]:
    """Return the job with the settings chosen that its scenario leaves open, what of it stands, and the report."""
    from ..blender.files import empty_file
    from .choose.search import decide
    from .choose.sites import RoadSite

    if job.new_file:
        empty_file()
    site = RoadSite(job.scenario, parameters)
    decision = decide(job.scenario, site, begun)
    job = replace(job, scenario=decision.scenario, new_file=False)
    if decision.scene is None or site.model is None:
        return job, None, decision.report
    return job, Built(site.model, decision.scene), decision.report


def check(job: Job) -> None:
    """Refuse a job that can't be done before any work starts."""
    if job.scenario.chooses:
        from .choose import search as choosing

        choosing.check(job.scenario)
    scanner_setting(job.scenario.scan)
    job.scenario.cloud.scheme()
    job.scenario.own_materials()
    if set(job.scenario.outputs) & {"cloud", "previews"}:
        from ..blender.cameras import check_colour

        check_colour(job.scenario.colour)
    wkt(job.scenario.road.epsg)
    check_formats(job.scenario.twin)
    if job.parameters and job.axis:
        raise InputError("--axis", str(job.axis), "can't be given together with --parameters")
    if not job.scenario.outputs and not job.scenario.twin:
        raise InputError("outputs", [], f"must name at least one of {', '.join(FILES)}")


def road_parameters(job: Job) -> tuple[RoadParameters, dict[str, Any]]:
    """Return the road that a job is about, and what to report of the axis that it was fitted to."""
    scenario = job.scenario
    if job.parameters:
        return read_parameters(job.parameters), {}
    if job.axis:
        from ..fitting.axis_object import fitted_axis

        axis, road, fit = fitted_axis(job.axis, scenario.road)
        return sample_road(road, scenario.seed, scenario.title, axis), {"axis": fit}
    return sample_road(scenario.road, scenario.seed, scenario.title), {}


def _scene_outputs(
    job: Job, folder: Path, parameters: RoadParameters, timer: StageTimer, built: Built | None
) -> dict[str, Any]:
    """Build the model, unless it stands already, and write what needs it."""
    from ..blender.files import empty_file, save_scene
    from ..blender.materials import vary
    from ..blender.model.build import build_road
    from ..blender.model.store import remember

    settings, wanted = job.scenario.settings(), job.scenario.outputs
    counts: dict[str, Any] = {}
    if job.new_file:
        empty_file()
    if job.scenario.section_length(parameters.alignment.length) is not None:
        return scan_by_section(job.scenario, parameters, folder, timer)
    with timer.stage("model"):
        model = built.model if built else build_road(parameters, settings.tolerance, settings.vegetation_detail)
        if job.scenario.materials_table:
            vary(parameters.materials, parameters.environment, job.scenario.own_materials())
        remember(model.collection, parameters, job.scenario, "")
    if set(wanted) & {"cloud", "previews"}:
        counts = scan_open_road(job.scenario, parameters, folder, timer, built.scene if built else None)
    if "scene" in wanted:
        with timer.stage("scene file"):
            save_scene(folder / "scene.blend")
    return counts


def scan_open_road(
    scenario: Scenario,
    parameters: RoadParameters,
    folder: Path,
    timer: StageTimer,
    scene: ScannedScene | None = None,
) -> dict[str, Any]:
    """Scan the open scene, which shows a road, and write the cloud and the previews; must run in the main thread.

    Args:
        scene: what is scanned, where that was read already.

    Returns:
        the counts, as JSON data.

    Raises:
        InputError: nothing visible could be scanned, or see `scanned_scene`, `make_scan` and `check_colour`.
    """
    from ..blender.scene.evaluated import scanned_scene

    geometry, environment = RoadGeometry(parameters), parameters.environment
    with timer.stage("scene mesh"):
        if scene is None:
            scene = scanned_scene(geometry=geometry, speed_factor=scenario.scan.traffic_speed_factor)
    check_not_empty(scene)
    with timer.stage("caster"):
        scan = make_scan(
            scenario, scene, road_path(scenario, geometry), environment, variation=parameters.materials
        )
    cameras = colour_job(scenario, scan, scene, environment)
    del scene
    view = top_view(geometry) if "previews" in scenario.outputs else None
    return scan_to_files(scenario, scan, cameras, folder, parameters.metadata.epsg, view, timer)


def check_not_empty(scene: ScannedScene) -> None:
    """Refuse a scene without anything to scan."""
    if not len(scene.static) and not scene.moving:
        raise InputError("Scene", None, "nothing that could be scanned is visible")


def opening() -> dict[str, Any]:
    """Return the head of every job's report."""
    return {"type": "Report", "generator": generator()}


def closing(scenario: Scenario, timer: StageTimer) -> dict[str, Any]:
    """Return the part of the report that is the same for every job."""
    bpy = sys.modules.get("bpy")  # not there if nothing needed Blender
    return {
        "seed": scenario.seed,
        "settings": asdict(scenario.settings()),
        "scenario": scenario.to_dict(),
        "seconds": round(timer.seconds, 3),
        "stages": timer.stages,
        "versions": {
            "synthroads": version(),
            "blender": bpy.app.version_string if bpy else None,
            "python": machine.python_version(),
            "numpy": np.__version__,
            "laspy": laspy.__version__,
        },
        "cores": available_cores(),
    }
