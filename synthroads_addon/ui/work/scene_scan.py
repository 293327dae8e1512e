"""Scan of all that is visible in a scene without a road: along a curve, from a camera, or over the scene's extent."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...base.class_mapping import ClassMapping
from ...base.classes import ClassScheme
from ...base.errors import InputError
from ...base.schema import read_json
from ...blender.scene.evaluated import scanned_scene_steps
from ...blender.scene.foreign import open_scene_warnings
from ...blender.scene.render_state import Visible
from ...blender.scene.units import scene_unit
from ...jobs.job_files import JobFiles
from ...jobs.scan.sink import record_cloud
from ...jobs.scan_scene import route_site, warnings_of_counts
from ...scanning.platforms.over_scene import SceneRoute
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import OF_POINTS, Scenario
from .job import Aside, Report, Step, Work
from .rendered_scan import save_open_scene
from .scan_steps import (
    READ,
    Measure,
    Workplace,
    Written,
    follow_scan,
    pass_on_reading,
    renders_scene,
    snapshot_services,
)

_MOST_POSES = 100
"""Places that are taken of a moving camera, however many frames it moves."""


@dataclass(frozen=True)
class VisibleScan:
    """Request to scan all that is visible, with the target folder.

    Attributes:
        scenario: scan, colours, files; its road isn't looked at.
        inputs: what the files that it names hold.
        route: the scanner's way.
        visible: whether a render's or the viewport's state of the scene is scanned.
        classes: classes by name; none if None.
        target: folder for the files.
        overwrite: replace files that are already there.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    route: SceneRoute
    classes: ClassMapping | None
    target: Path
    overwrite: bool
    visible: Visible = "render"


def visible_scan_work(scan: VisibleScan) -> Work[Written]:
    """Generator that scans all that is visible into files, as a job's work; leaves nothing half-written.

    Raises:
        InputError: a setting is wrong, the folder can't be written, the scene's unit isn't 1 m, or nothing that could
            be scanned is visible.
    """
    files = JobFiles(scan.scenario, road=False)
    if not scan.scenario.scans:
        raise InputError("Outputs", None, f"must name at least one of {', '.join(OF_POINTS)}: the scene has no road")
    _check_unit()
    with Workplace.opened(scan.target, files.names, scan.overwrite) as work:
        yield Step(0.0, "Reading")
        warnings = open_scene_warnings()
        measure = None if renders_scene(scan.scenario) else (yield from _read(scan, work))
        state = "Scanning" if measure else "Rendering"
        if measure is None:
            measure = yield from _save_copy(scan, work)

        def write(report: Report) -> int:
            counts, of_scene = measure(report)
            contents = {"scene": bpy.path.basename(bpy.data.filepath) or None, "counts": counts}
            contents["warnings"] = [*warnings, *of_scene, *warnings_of_counts(counts)]
            files.write_report(work.folder, contents, work.timer)
            return int(counts["points"])

        points = yield Aside(write, state, READ, 1.0, work.calls, work.notes)
    return Written(points, scan.target)


def _check_unit() -> None:
    """Raise an InputError where the open scene's lengths, and with them Blender's view of ours, aren't metres."""
    unit = scene_unit()
    if unit != 1.0:
        allowed = f"must be 1 (Scene properties, Units): to keep its size scale what is in the scene by {unit:g}"
        raise InputError("Unit Scale", round(unit, 6), allowed)


def _read(scan: VisibleScan, work: Workplace) -> Generator[Step, None, Measure | None]:
    """Copy the open scene; return the function that scans it, or None if some materials must be rendered."""
    settings, class_ids = scan.scenario.scan, scan.inputs.scheme.source_ids()
    timer = work.timer
    with timer.stage("scene mesh"):
        factor = settings.traffic_speed_factor
        further: dict[str, Any] = {"number_objects": True, "class_ids": class_ids, "visible": scan.visible}
        steps = scanned_scene_steps(classes=scan.classes, speed_factor=factor, **further)
        copied = yield from pass_on_reading(steps)
    services = snapshot_services(scan.scenario, copied.materials, work)
    if services is None:
        return None

    def measure(report: Report) -> tuple[dict[str, Any], Sequence[str]]:
        with timer.stage("scene mesh"):
            scene = copied.put_together()
        if not len(scene.static) and not scene.moving:
            raise InputError("Scene", None, "nothing visible has faces that can be scanned")
        site = route_site(scan.scenario, scan.inputs, scan.route, scene.static)
        with timer.stage("caster"):
            plan = site.plan(scene, services)
        follow_scan(timer, report)
        files = site.files(work.folder, plan.target.origin)
        return record_cloud([plan], files, timer, work.note_forecast), scene.warnings

    return measure


def _save_copy(scan: VisibleScan, work: Workplace) -> Generator[Step, None, Measure]:
    """Save a copy of the open file; return the function that has a second Blender scan it."""
    classes = scan.classes.to_dict() if scan.classes else None
    job = {"route": scan.route.to_dict(), "classes": classes, "visible": scan.visible}
    with work.timer.stage("scene copy"):
        saved = save_open_scene(scan.scenario, work.folder, job)
    yield Step(READ)

    def measure(report: Report) -> tuple[dict[str, Any], Sequence[str]]:
        result = saved.scan(report)
        work.timer.stages.update(result.stages)
        return result.counts, result.warnings

    return measure


def route_of(guide: bpy.types.Object | None, scene: bpy.types.Scene, tripod: bool) -> SceneRoute:
    """Return the scanner's route by an object: a curve's line, a camera's place or frames; the scene's extent if None.

    Args:
        guide: curve or camera of the scene.
        scene: the open one.
        tripod: whether the scanner stands still.

    Raises:
        InputError: the object is neither, its line is too short, or a scanner that moves is to follow a still camera.
    """
    if guide is None:
        return SceneRoute("extent")
    if guide.type == "CAMERA":
        return _route_of_camera(guide, scene, tripod)
    if guide.type != "CURVE":
        raise InputError("Along", guide.name, "must be a curve or a camera")
    evaluated = guide.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    try:
        flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", flat)
    finally:
        evaluated.to_mesh_clear()
    matrix = np.array(evaluated.matrix_world)
    points = flat.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    if len(points) < 2:
        raise InputError("Along", guide.name, "must have at least two points")
    return SceneRoute("line", points.tolist())


def _route_of_camera(camera: bpy.types.Object, scene: bpy.types.Scene, tripod: bool) -> SceneRoute:
    if tripod:
        return SceneRoute("places", [list(camera.matrix_world.translation)])
    poses = _camera_places(camera, scene)
    if float(np.linalg.norm(np.diff(poses, axis=0), axis=1).sum()) < 1.0:
        text = "moves by less than 1 m in the scene's frames: animate it, or choose a tripod as the platform"
        raise InputError("Along", camera.name, text)
    return SceneRoute("flight", poses.tolist())


def _camera_places(camera: bpy.types.Object, scene: bpy.types.Scene) -> Any:
    """Return a camera's places (N, 3) over the scene's frames; the current frame is restored."""
    frame = scene.frame_current, scene.frame_subframe
    count = min(scene.frame_end - scene.frame_start + 1, _MOST_POSES)
    poses = []
    try:
        for number in np.linspace(scene.frame_start, scene.frame_end, count).round().astype(int):
            scene.frame_set(int(number))
            poses.append(list(camera.matrix_world.translation))
    finally:
        scene.frame_set(frame[0], subframe=frame[1])
    return np.array(poses)


def class_mapping(path: str, scheme: ClassScheme) -> ClassMapping | None:
    """Return the mapping of names to classes read from a JSON file; None for an empty path.

    Raises:
        InputError: it can't be read, or names a class that the scheme doesn't have.
    """
    if not path.strip():
        return None
    place = str(Path(bpy.path.abspath(path)).expanduser())
    mapping = ClassMapping.from_dict(read_json(Path(place)), source=place)
    mapping.check(scheme.source_ids(), place)
    return mapping
