"""The job "scan into arrays": a generated road or a scene that is there -> scan -> NumPy arrays, without files."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TypeVar

from ..base.progress import Progress, StageTimer, silent
from ..base.remarks import collected_remarks
from ..road.instances import InstanceNumbers
from ..scenario.scenario import Scenario
from .generate import Job, add_warnings, check, make_job_road, open_job_scene
from .job_files import JobFiles
from .scan.arrays import ScanArrays
from .scan.plan import Site
from .scan_scene import SceneScan, add_counts, check_scene_scan, open_foreign_scene

J = TypeVar("J", Job, SceneScan)


@collected_remarks()
def scan_to_arrays(job: Scenario | Job | SceneScan, progress: Progress = silent) -> ScanArrays:
    """Scan a generated road, or a scene that is there, and return the points as NumPy arrays.

    The arrays are those of the cloud that `generate` or `scan_scene` writes for the same job: names, order and values,
    before a file's format rounds them. No file is written: the job's output folder and the scenario's outputs have no
    effect. A road stands in the open Blender file afterwards, unless it is scanned section by section.

    Args:
        job: a scenario, of which a road is sampled; a `Job`, which may name a given road or axis; or a `SceneScan`.
        progress: told how far it is; may raise `Cancelled`.

    Raises:
        InputError: an input is wrong.
    """
    if isinstance(job, SceneScan):
        return _scan_scene(_without_files(job), progress)
    return _scan_road(_without_files(Job(job) if isinstance(job, Scenario) else job), progress)


def _without_files(job: J) -> J:
    """Return a copy of a job that asks for points and for no files; its time is counted from now if not given."""
    scenario = job.scenario.model_copy(update={"outputs": ("cloud",), "twin": ()})
    return replace(job, scenario=scenario, output=None, begun=job.begun or time.perf_counter())


def _scan_road(job: Job, progress: Progress) -> ScanArrays:
    """Make a job's road, scan it, and return the points' arrays."""
    timer = StageTimer(progress)
    inputs = check(job)
    road, report = make_job_road(job, inputs, timer)
    scene = open_job_scene(job, road, inputs, job.begun or time.perf_counter(), timer, report)
    report["instances"] = road.numbers.to_dict()
    sink = scene.site.arrays()
    report["counts"] = scene.build_and_scan(sink, timer)
    add_warnings(report, scene)
    full_report = JobFiles(scene.scenario).report(report, timer)
    return sink.result(full_report, *_system(scene.site), road.numbers.name_of)


def _scan_scene(job: SceneScan, progress: Progress) -> ScanArrays:
    """Scan a scene that is there, and return the points' arrays."""
    timer = StageTimer(progress)
    scene, report = open_foreign_scene(job, check_scene_scan(job), timer)
    sink, road = scene.site.arrays(), scene.site.conditions.road
    add_counts(report, scene.scan(sink, timer))
    full_report = JobFiles(scene.site.scenario, road=False).report(report, timer)
    name_of = InstanceNumbers(road).name_of if road else _no_name
    return sink.result(full_report, *_system(scene.site), name_of)


def _no_name(number: int) -> None:
    """Return None: what stands in a scene of others has no instance number that a parameter set would name."""


def _system(site: Site) -> tuple[int | None, str | None]:
    """Return a site's map coordinate system, and it with heights as WKT; None if unknown."""
    system = site.conditions.system
    return site.conditions.epsg, system.to_wkt() if system else None
