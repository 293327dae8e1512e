"""The operator that scans, and the work of scanning the open scene's road into a folder.

The scene is read in the window's thread, and scanned in another, which has the window's work out materials' nodes.
Where the scene itself must be rendered, that takes the main thread of a Blender for long: that of another one, which
works on a copy of the file.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bpy

from ...blender.model.build import RoadModel
from ...blender.model.roads import ROAD
from ...blender.model.settle import settle_steps
from ...blender.model.store import find_road, recall
from ...blender.model.truth import EditedRoad, read_road
from ...blender.scene.evaluated import scanned_scene_steps
from ...jobs.generate import Job as PipelineJob
from ...jobs.generate import check
from ...jobs.job_files import JobFiles, empty_scan_warnings
from ...jobs.open_scene import write_scene_files
from ...jobs.scan.plan import Site, check_scan
from ...jobs.scan.sink import record_cloud
from ...road.geometry import RoadGeometry
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from ..fields.preferences import with_preferences
from .common import is_free
from .job import Aside, PanelJob, Report, Step, Work
from .long_operator import LongOperator
from .rendered_scan import save_open_scene
from .scan_steps import (
    READ,
    Measure,
    Workplace,
    Written,
    follow_scan,
    followed_models,
    pass_on_reading,
    renders_scene,
    snapshot_services,
)
from .scene_scan import VisibleScan, class_mapping, route_of, visible_scan_work


@dataclass(frozen=True)
class RoadScan:
    """Request to scan a road, with the target folder.

    Attributes:
        scenario: the road's and the scan's settings.
        edited: the road that the scene shows.
        road_id: of that road.
        target: folder for the files.
        overwrite: replace files that are already there.
    """

    scenario: Scenario
    edited: EditedRoad
    road_id: str
    target: Path
    overwrite: bool

    @cached_property
    def road(self) -> RoadGeometry:
        """Return the analytic geometry of the road as edited."""
        return RoadGeometry(self.edited.parameters)


def scan_work(scan: RoadScan) -> Work[Written]:
    """Generator that scans the open scene's road into files, as a job's work; leaves nothing half-written.

    Raises:
        InputError: a setting is wrong or the folder can't be written; in its first step.
    """
    scenario = scan.scenario
    inputs = check(PipelineJob(scenario, scan.target, overwrite=scan.overwrite))
    with Workplace.opened(scan.target, JobFiles(scenario).names, scan.overwrite) as work:
        if scan.edited.stale and not scan.edited.lost:
            yield Step(0.0, "Building")
            yield from _no_share(settle_steps(scan.road_id, scan.edited))
        yield Step(0.0, "Reading")
        measure = None if renders_scene(scenario) else (yield from _read_open_scene(scan, inputs, work))
        state = "Scanning" if measure else "Rendering"
        if measure is None:
            measure = yield from _save_copy(scan, work)
        if "scene" in scenario.outputs:
            write_scene_files(scenario, scan.road, inputs, work.folder, work.timer, scan.road_id)

        def write(report: Report) -> int:
            return _write_files(scan, work, measure, report)

        points = yield Aside(write, state, READ, 1.0, work.calls, work.notes)
    return Written(points, scan.target)


def _save_copy(scan: RoadScan, work: Workplace) -> Generator[Step, None, Measure]:
    """Save a copy of the open file; return the function that has a second Blender scan it."""
    scanned = {"parameters": json.loads(scan.edited.parameters.to_json()), "road": scan.road_id}
    with work.timer.stage("scene copy"):
        saved = save_open_scene(scan.scenario, work.folder, scanned)
    yield Step(READ)

    def measure(report: Report) -> tuple[dict[str, Any], Sequence[str]]:
        result = saved.scan(report)
        work.timer.stages.update(result.stages)
        return result.counts, result.warnings

    return measure


def _read_open_scene(scan: RoadScan, inputs: ScenarioInputs, work: Workplace) -> Generator[Step, None, Measure | None]:
    """Copy the open scene; return the function that scans it, or None if some materials must be rendered."""
    timer = work.timer
    speed_factor, class_ids = scan.scenario.scan.traffic_speed_factor, inputs.scheme.source_ids()
    with timer.stage("scene mesh"):
        geometry, road = scan.road, scan.road_id
        steps = scanned_scene_steps(geometry=geometry, speed_factor=speed_factor, class_ids=class_ids, road=road)
        copied = yield from pass_on_reading(steps)
    services = snapshot_services(scan.scenario, copied.materials, work)
    if services is None:
        return None

    def measure(report: Report) -> tuple[dict[str, Any], Sequence[str]]:
        site = Site.of_road(scan.scenario, scan.road, inputs)
        with timer.stage("scene mesh"):
            scene = copied.put_together()
        report(0.02)
        with timer.stage("caster"):
            plan = site.plan(scene, services)
        warnings = scene.warnings
        del scene
        follow_scan(timer, report)
        files = site.files(work.folder, plan.target.origin)
        return record_cloud([plan], files, timer, work.note_forecast), warnings

    return measure


def _no_share(steps: Generator[float | None, None, RoadModel]) -> Generator[Step | None, None, None]:
    """Generator that runs the steps of a build without counting them as progress of the scan."""
    with closing(steps):
        for share in steps:
            yield None if share is None else Step(0.0)
    if not bpy.app.background:
        bpy.ops.ed.undo_push(message="Build as Edited")


def _write_files(scan: RoadScan, work: Workplace, measure: Measure, report: Report) -> int:
    """Write all files of the scan and return the number of points; for a thread, as it touches no data-blocks."""
    folder, timer = work.folder, work.timer
    files = JobFiles(scan.scenario)
    with followed_models(timer, report):
        files.write_road(folder, scan.road, timer)
    contents: dict[str, Any] = {}
    of_scene: Sequence[str] = ()
    if scan.scenario.scans:
        contents["counts"], of_scene = measure(report)
    contents |= {"instances": scan.road.numbers.to_dict()} | scan.edited.to_dict()
    if warnings := [*of_scene, *empty_scan_warnings(contents.get("counts", {}))]:
        contents["warnings"] = warnings
    files.write_report(folder, contents, timer)
    return int(contents["counts"]["points"]) if "counts" in contents else 0


class SYNTHROADS_OT_scan(LongOperator, bpy.types.Operator):
    """Scan everything that is visible; write the labelled points, pictures and, for a road, its parameters"""

    bl_idname = "synthroads.scan"
    bl_label = "Scan"

    nothing_done = "nothing was written"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether no job is running and Blender is in object mode."""
        return is_free(cls, context)

    def job(self, context: bpy.types.Context) -> PanelJob[Written]:
        """Return the job that scans the current road as edited, or all that is visible, with the panel's settings."""
        if find_road(context.scene) is None:
            return PanelJob("Scan", visible_scan_work(requested_visible_scan(context)))
        return PanelJob("Scan", scan_work(requested_scan(context)))

    def succeed(self, context: bpy.types.Context, job: PanelJob[Written]) -> str:
        """Remember the result as the last scan's and return the message."""
        global _last
        assert job.result
        _last = job.result
        return f"{_last.points:,} points written to {_last.target}"


def requested_scan(context: bpy.types.Context) -> RoadScan:
    """Return the request to scan the current road with the panel's settings; `InputError` if one is wrong."""
    settings, road = context.scene.synthroads, find_road(context.scene)
    assert road  # the operator has seen it
    _, built = recall(road)
    edited = read_road(road, context.scene)
    shown = settings.scenario()
    # The road and its fidelity are those that it was built with.
    chosen = {name: getattr(shown, name) for name in ("scan", "colour", "cloud", "outputs", "twin", "materials_table")}
    scenario = with_preferences(built.model_copy(update=chosen))
    return RoadScan(_of_known(scenario, edited), edited, str(road[ROAD]), settings.folder(), settings.overwrite)


def _of_known(scenario: Scenario, edited: EditedRoad) -> Scenario:
    """Return the scenario without files of the road's parameters if its surface was edited by hand."""
    if not edited.lost:
        return scenario
    outputs = tuple(name for name in scenario.outputs if name not in ("parameters", "centerline"))
    return scenario.model_copy(update={"outputs": outputs, "twin": ()})


def requested_visible_scan(context: bpy.types.Context) -> VisibleScan:
    """Return the request to scan a scene without a road; `InputError` if a setting is wrong."""
    settings, choices = context.scene.synthroads, context.scene.synthroads_scene_scan
    scenario = with_preferences(settings.scenario())
    inputs = check_scan(scenario, is_foreign=True)
    platform = scenario.scan.platform
    follows_file = platform.kind == "trajectory"
    guide = None if follows_file else choices.guide
    route = route_of(guide, context.scene, platform.kind == "tripod")
    classes = class_mapping(choices.classes, inputs.scheme)
    return VisibleScan(scenario, inputs, route, classes, settings.folder(), settings.overwrite, choices.visible)


_last: Written | None = None


def last_written() -> Written | None:
    """Return the result of this session's last scan; None before the first."""
    return _last
