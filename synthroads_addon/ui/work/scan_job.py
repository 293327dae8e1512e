"""A scan of the open scene's road into a folder.

Where nothing is rendered the scene is read in the window's thread, and the rest needs a thread. Rendering needs the
main thread of a Blender: that is another one, which works on a copy of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from ...base.files import output_folder
from ...base.progress import StageTimer
from ...blender.files import save_scene
from ...blender.scene.evaluated import CopiedScene, scanned_scene_steps
from ...blender.services import SnapshotServices
from ...jobs.generate import Job as PipelineJob
from ...jobs.generate import check
from ...jobs.report import empty_scan_warnings, file_names, report_footer, report_header, write_report
from ...jobs.road_files import write_road_files
from ...jobs.road_scene import refuse_empty, road_cloud_files
from ...jobs.scan.files import record_to_files
from ...jobs.scan.plan import may_render, plan_scan, road_path
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.plan import ScanConditions
from ...scenario.scenario import Scenario
from ...twin.formats import twin_file_names
from .job import Aside, Report, Step, Work
from .rendered_scan import SavedScene, save_open_scene


@dataclass(frozen=True)
class RoadScan:
    """Request for a scan, and where the files go.

    Attributes:
        scenario: the road's and the scan's settings.
        parameters: the road that the scene shows.
        target: folder for the files.
        overwrite: replace files that are already there.
    """

    scenario: Scenario
    parameters: RoadParameters
    target: Path
    overwrite: bool

    @cached_property
    def road(self) -> RoadGeometry:
        """The road that the scene shows."""
        return RoadGeometry(self.parameters)


@dataclass(frozen=True)
class Written:
    """Result of a scan: so many points into a folder."""

    points: int
    target: Path


_READ = 0.1
"""Share of a scan's progress that the reading of the scene takes up."""


@dataclass(frozen=True)
class _Output:
    """Where the thread's files go, and what it tells."""

    folder: Path
    timer: StageTimer
    report: Report


_Measure: TypeAlias = Callable[[_Output], dict[str, Any]]
"""Scans, writes the cloud and the previews, and returns the counts. It touches no data of Blender."""


def scan_work(scan: RoadScan) -> Work[Written]:
    """Scan the open scene; nothing half-written is ever left, and the scene is only read.

    Raises:
        InputError: a setting is wrong or the folder can't be written; in its first step.
    """
    scenario = scan.scenario
    check(PipelineJob(scenario, scan.target, overwrite=scan.overwrite))
    names = [*file_names(scenario, scenario.outputs), *twin_file_names(scenario.twin)]
    timer, renders = StageTimer(), may_render(scenario)
    with output_folder(scan.target, names, scan.overwrite) as folder:
        yield Step(0.0, "Reading")
        measure = yield from (_save_copy(scan, folder, timer) if renders else _read_open_scene(scan, timer))
        if "scene" in scenario.outputs:
            with timer.stage("scene file"):
                save_scene(folder / "scene.blend")

        def write(report: Report) -> int:
            return _write_files(scan, measure, _Output(folder, timer, report))

        points = yield Aside(write, "Rendering" if renders else "Scanning", _READ, 1.0)
    return Written(points, scan.target)


def _save_copy(scan: RoadScan, folder: Path, timer: StageTimer) -> Generator[Step, None, _Measure]:
    """Save a copy of the open file; return what has another Blender scan it."""
    with timer.stage("scene copy"):
        saved = save_open_scene(scan.scenario, scan.parameters, folder)
    yield Step(_READ)
    return lambda output: _scan_saved(saved, output)


def _scan_saved(saved: SavedScene, output: _Output) -> dict[str, Any]:
    done = saved.scan(output.report)
    output.timer.stages.update(done.stages)
    return done.counts


def _read_open_scene(scan: RoadScan, timer: StageTimer) -> Generator[Step, None, _Measure]:
    """Read the open scene; return what scans it."""
    speed_factor = scan.scenario.scan.traffic_speed_factor
    with timer.stage("scene mesh"):
        steps = scanned_scene_steps(geometry=scan.road, speed_factor=speed_factor)
        copied = yield from _shares(steps)
    services = SnapshotServices(copied.materials)
    return lambda output: _scan_copied(scan, copied, services, output)


def _shares(steps: Generator[float, None, CopiedScene]) -> Generator[Step, None, CopiedScene]:
    """Pass on the steps of reading as shares of the whole."""
    while True:
        try:
            yield Step(_READ * next(steps))
        except StopIteration as end:
            return end.value
        except BaseException:
            steps.close()
            raise


def _scan_copied(
    scan: RoadScan, copied: CopiedScene, services: SnapshotServices, output: _Output
) -> dict[str, Any]:
    """Scan what was read."""
    scenario, road, timer = scan.scenario, scan.road, output.timer
    with timer.stage("scene mesh"):
        scene = copied.put_together()
    refuse_empty(scene)
    output.report(0.02)
    with timer.stage("caster"):
        path = road_path(scenario, road)
        plan = plan_scan(scenario, scene, path, services, ScanConditions.of(scan.parameters))
    del scene
    shares = {"images": (0.05, 0.05), "scan": (0.05, 1.0), "files": (1.0, 1.0)}
    timer.progress = lambda stage, share: output.report(shares[stage][0] * (1.0 - share) + shares[stage][1] * share)
    return record_to_files([plan], road_cloud_files(scenario, road, output.folder, plan), timer)


def _write_files(scan: RoadScan, measure: _Measure, output: _Output) -> int:
    """Write all files; return the number of points. Runs in a thread: it touches no data of Blender."""
    scenario = scan.scenario
    write_road_files(output.folder, scenario, scan.road, output.timer)
    report = report_header()
    if set(scenario.outputs) & {"cloud", "previews"}:
        report["counts"] = measure(output)
    points = report.get("counts", {}).get("points", 0)
    if warnings := empty_scan_warnings(report.get("counts", {})):
        report["warnings"] = warnings
    write_report(output.folder, report | report_footer(scenario, output.timer))
    return int(points)
