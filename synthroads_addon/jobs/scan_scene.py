"""The job "scan a scene": what others made -> triangles with classes -> scan -> cloud and previews.

The scene is only read: nothing is added to it, and its file isn't written.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..base.arrays import Float
from ..base.class_mapping import ClassMapping
from ..base.classes import UNLABELLED
from ..base.errors import InputError
from ..base.files import output_folder, write_file
from ..base.maps.crs import metric_system
from ..base.maps.places import Placement
from ..base.progress import Progress, StageTimer, silent
from ..base.remarks import assume, collected_remarks, warn
from ..base.schema import read_json
from ..cloud.tools.previews import TopView
from ..road.axes.centerline import AxisContent
from ..road.geometry import RoadGeometry
from ..scanning.parts.conditions import ScanConditions
from ..scanning.platforms.over_scene import SceneRoute, as_tripod, path_over
from ..scanning.platforms.trajectory import RecordedTrajectory
from ..scanning.scene.extent import body_bounds, strays_of
from ..scanning.scene.map_coordinates import rounding_warnings, shift_of, step_at
from ..scanning.scene.mesh import SceneMesh
from ..scanning.scene.motion import ScannedScene
from ..scenario.inputs import ScenarioInputs
from ..scenario.scenario import OF_POINTS, Scenario
from .job_files import JobFiles, empty_scan_warnings
from .scan.plan import Site, check_scan

if TYPE_CHECKING:
    from ..blender.scene.foreign import UpAxis
    from ..blender.scene.render_state import Visible
    from .open_scene import ForeignScene


CLASSES = "classes.json"
"""File of classes by name that is written to be filled in, where things of a scene have none."""
_logger = logging.getLogger("synthroads")


@dataclass(frozen=True)
class SceneInputs:
    """Content of the files that the scan of a scene is given, each read once; the scene itself isn't among them.

    Attributes:
        named: what the files hold that the scenario names.
        mapping: classes by name; None without a file of them.
        line: that the platform follows; None without a file of it.
    """

    named: ScenarioInputs
    mapping: ClassMapping | None = None
    line: AxisContent | None = None


@dataclass(frozen=True)
class SceneScan:
    """Request to `scan_scene`: scenario, output folder, scene, and the scanner's path.

    Attributes:
        scenario: scan, fidelity and seed; its road is not looked at.
        output: folder for the files; `scan_to_arrays` needs none.
        scene: file to open, or the scene that is open if None.
        path: CSV or GeoJSON of a line that the platform follows, in map coordinates.
        tripods: positions (x, y) or (x, y, z) of a tripod in map coordinates; z is that of the scanner itself.
        classes: JSON file with classes by name, see `ClassMapping`.
        road: name of the scene's road, where it has several; the one that is active or was chosen in it if None.
        epsg: of the map; that of the scene's road, or unknown, if None.
        origin: map coordinates of the scene's own origin, m; those of the scene's road, or 0, if None; ``auto`` where
            the scene's own coordinates are those of the map: it is moved near the origin before it is read.
        up: see `blender.scene.foreign.open_scene`.
        visible: whether a render's or the viewport's state of the scene is scanned.
        also_from: further folders in which files may lie that a scene of another format than .blend names.
        overwrite: replace files that are already there.
        begun: when the job began, by `time.perf_counter`, for a time budget; when `scan_scene` is called if None.
    """

    scenario: Scenario
    output: Path | None = None
    scene: Path | None = None
    path: Path | None = None
    tripods: tuple[tuple[float, ...], ...] = ()
    classes: Path | None = None
    road: str | None = None
    epsg: int | None = None
    origin: tuple[float, float, float] | Literal["auto"] | None = None
    up: UpAxis | None = None
    visible: Visible = "render"
    also_from: tuple[Path, ...] = ()
    overwrite: bool = False
    begun: float | None = None


@collected_remarks()
def scan_scene(job: SceneScan, progress: Progress = silent) -> dict[str, Any]:
    """Scan a scene made elsewhere into files; return the report, which is also written to ``report.json``.

    Raises:
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    timer, files = StageTimer(progress), JobFiles(job.scenario, road=False)
    job = replace(job, begun=job.begun or time.perf_counter())
    inputs = check_scene_scan(job)
    if job.output is None:
        raise InputError("output", None, "must be a folder for the files; scan_to_arrays needs none")
    with output_folder(job.output, files.names, job.overwrite) as folder:
        scene, report = open_foreign_scene(job, inputs, timer)
        counts = scene.scan(folder, timer)
        add_counts(report, counts)
        return JobFiles(scene.site.scenario, road=False).write_report(folder, report, timer)


def open_foreign_scene(job: SceneScan, inputs: SceneInputs, timer: StageTimer) -> tuple[ForeignScene, dict[str, Any]]:
    """Open and read a job's scene; return it with all its settings, and the beginning of the job's report.

    With an output folder a file of classes is written there to be filled in, where things have none.

    Raises:
        InputError: see `open_and_read` and `choose_settings`.
    """
    # Blender takes a second to start: whoever imports the names of this module needs none.
    from .choose.search import choose_settings
    from .open_scene import ForeignScene

    report: dict[str, Any] = {"scene": job.scene.name if job.scene else None}
    scene_read, road, report["warnings"] = open_and_read(job, inputs, timer, report)
    scene = ForeignScene(scene_site(job, inputs, scene_read.static, road), scene_read)
    if hint := _say_unlabelled(job, inputs, scene_read):
        report["classes_to_fill_in"] = hint
    if job.scenario.chooses:
        scene, report["choice"] = choose_settings(scene, job.begun or time.perf_counter(), timer)
    return scene, report


def add_counts(report: dict[str, Any], counts: dict[str, Any]) -> None:
    """Add the counts of a scene's scan, and warnings about them, to the job's report."""
    report["counts"] = counts
    report["warnings"] += warnings_of_counts(counts, report.get("classes_to_fill_in", ""))


def check_scene_scan(job: SceneScan) -> SceneInputs:
    """Raise an InputError for a job that can't be done; return what the files hold that it is given."""
    from ..blender.scene.foreign import check_scene_file  # see `scan_scene`

    platform = job.scenario.scan.platform
    if not job.scenario.scans:
        raise InputError("outputs", list(job.scenario.outputs), f"must name at least one of {', '.join(OF_POINTS)}")
    scenario_inputs = check_scan(job.scenario, is_foreign=True)
    if job.scene is not None:
        check_scene_file(job.scene, job.up)
    if job.tripods:
        tripod = as_tripod(platform)
        if tripod.height is not None and any(len(place) == 3 for place in job.tripods):
            raise InputError("--height", tripod.height, "can't be given with a tripod whose Z is the scanner's height")
    if job.path and (job.tripods or isinstance(platform, RecordedTrajectory)):
        raise InputError("--path", str(job.path), "can't be given together with a trajectory or a tripod's positions")
    if job.epsg is not None:
        metric_system(job.epsg, field="--epsg")
    line = AxisContent.read(job.path) if job.path else None
    if job.classes is None:
        return SceneInputs(scenario_inputs, line=line)
    mapping = ClassMapping.from_dict(read_json(job.classes), source=str(job.classes))
    mapping.check(scenario_inputs.scheme.source_ids(), str(job.classes))
    return SceneInputs(scenario_inputs, mapping, line)


def open_and_read(
    job: SceneScan, inputs: SceneInputs, timer: StageTimer, report: dict[str, Any]
) -> tuple[ScannedScene, RoadGeometry | None, list[str]]:
    """Open a job's scene; return its scanned form, its road (or None) and warnings; adds the road to `report`.

    Raises:
        InputError: the file can't be read, there is nothing to scan in it, or it has a road and an origin is given.
    """
    from ..blender.model.settle import settle  # see `scan_scene`
    from ..blender.model.truth import open_road
    from ..blender.scene.evaluated import scanned_scene
    from ..blender.scene.foreign import open_scene, open_scene_warnings
    from ..blender.scene.units import scene_unit

    shift = np.zeros(3)
    with timer.stage("scene"):
        if job.scene is not None:
            shift = open_scene(job.scene, job.up, to_origin=job.origin == "auto", also_from=job.also_from)
    with timer.stage("scene mesh"):
        road_in_file = open_road(job.road)
        road_edits = road_in_file.edited if road_in_file else None
        parameters = road_edits.parameters if road_edits and not road_edits.lost else None
        if road_in_file and road_edits:
            report |= {"road": road_in_file.name} | road_edits.to_dict()
            if road_edits.stale and not road_edits.lost:
                settle(road_in_file.road_id, road_edits)
        if road_in_file and job.origin is not None:
            raise InputError("--origin", job.origin, "can't be given: the road in the scene has one of its own")
        factor, class_ids = job.scenario.scan.traffic_speed_factor, inputs.named.scheme.source_ids()
        scene_options: dict[str, Any] = {"class_ids": class_ids, "road": road_in_file.road_id if road_in_file else ""}
        road = RoadGeometry(parameters) if parameters else None
        if road_in_file and (unit := scene_unit()) != 1.0:
            warn("the scene's unit scale is %g: roads are built in metres, so one unit is read as one metre", unit)

        def read() -> ScannedScene:
            """Return the open scene as it is now, evaluated for the scan."""
            return scanned_scene(
                None, inputs.mapping, road, factor, number_objects=True, visible=job.visible, **scene_options
            )

        scene = read()
        if not len(scene.static) and not scene.moving:
            fault = "holds nothing visible with faces that could be scanned"
            raise InputError(str(job.scene or "open scene"), None, fault)
        scene, warnings = _placed(job, scene, shift, read)
        warnings += [*open_scene_warnings(), *scene.warnings]
        warnings += (
            [f"{edit.name} was edited by hand: {edit.reason}" for edit in road_edits.by_hand] if road_edits else []
        )
        warnings += [f"{job.classes}: nothing in the scene is named as in {entry}" for entry in scene.unmatched]
        if strays := strays_of(scene.static) if len(scene.static) else None:
            warnings += [f"{strays.count():,} vertices are far from all others: the path and the previews ignore them"]
    return scene, road, warnings


def _placed(
    job: SceneScan, scene: ScannedScene, shift: Float, read: Callable[[], ScannedScene]
) -> tuple[ScannedScene, list[str]]:
    """Return a scene with its place on the map, and what is to be said about the rounding of its coordinates.

    Args:
        job: says where the scene's origin is.
        scene: as it was read.
        shift: (3,) what was subtracted before, m.
        read: reads the scene again, after it was moved.

    Raises:
        InputError: its coordinates are too large for single precision.
    """
    name, warnings = job.scene.name if job.scene else "open scene", list[str]()
    if job.origin != "auto":
        warnings += rounding_warnings(scene.static, name)
        origin = scene.static.origin if job.origin is None else np.array(job.origin, dtype=np.float64)
        return replace(scene, static=replace(scene.static, origin=origin)), warnings
    if len(scene.static) and (further_shift := shift_of(body_bounds(scene.static))).any():
        from ..blender.scene.foreign import move_scene  # needs Blender, which is loaded late

        unit = scene.static.unit
        step = unit * step_at(float(np.abs(body_bounds(scene.static)).max()) / unit)
        warnings.append(f"{name} was read in single precision: its coordinates are rounded to steps of {step:g} m")
        move_scene(-further_shift / unit)
        scene, shift = read(), shift + further_shift
    assume("%s is scanned about the map coordinates %s", name, ", ".join(f"{value:,.0f}" for value in shift.tolist()))
    return replace(scene, static=replace(scene.static, origin=shift)), warnings


def scene_site(job: SceneScan, inputs: SceneInputs, mesh: SceneMesh, road: RoadGeometry | None) -> Site:
    """Return the site of a scene's scan: path, conditions, preview raster if wanted."""
    conditions = ScanConditions.of(road.parameters if road else None)
    if job.epsg is not None:
        conditions = replace(conditions, epsg=job.epsg, height_epsg=None)
    place = Placement.of(conditions.system)
    path = path_over(inputs.named.platform, mesh, road, inputs.line, job.tripods, place)
    return Site(job.scenario, inputs.named, path, conditions, _view_over(job.scenario, inputs.named, mesh, road))


def route_site(scenario: Scenario, inputs: ScenarioInputs, route: SceneRoute, mesh: SceneMesh) -> Site:
    """Return the site of a scan along a route through a scene without a road."""
    for text in rounding_warnings(mesh, "the open scene", "move it near the scene's origin"):
        warn("%s", text)
    path = route.path(inputs.platform, mesh)
    return Site(scenario, inputs, path, ScanConditions.of(None), _view_over(scenario, inputs, mesh, None))


def _view_over(
    scenario: Scenario, inputs: ScenarioInputs, mesh: SceneMesh, road: RoadGeometry | None
) -> TopView | None:
    """Return the raster of the previews, over the road or else the mesh's box; None if no previews are wanted."""
    if "previews" not in scenario.outputs:
        return None
    scheme, (lower, upper) = inputs.scheme.sources(), body_bounds(mesh) + mesh.origin
    return TopView.over_road(road, scheme) if road else TopView.over_box(lower, upper, scheme)


def _say_unlabelled(job: SceneScan, inputs: SceneInputs, scene: ScannedScene) -> str:
    """Log, before a scan, what in its scene has no class, and write a file of classes to fill in unless it is there.

    Return the file's path; an empty string where everything has a class, or no folder for files is given.
    """
    from ..blender.scene.unlabelled import unlabelled_things  # see `scan_scene`

    meshes = [scene.static, *(body.mesh for body in scene.moving)]
    if not any(np.any(mesh.class_id == UNLABELLED) for mesh in meshes):
        return ""
    things = unlabelled_things(inputs.mapping, inputs.named.scheme.source_ids())
    if not things.count:
        return ""
    if job.output is None:
        _logger.warning("warning: %s. Name a file with their classes in the field classes", things.text())
        return ""
    file = job.output / CLASSES
    if not file.exists():
        write_file(file, things.mapping().to_json().encode())
    _logger.warning("warning: %s. Fill in %s and scan with --classes %s --overwrite", things.text(), file, file)
    return str(file)


def warnings_of_counts(counts: dict[str, Any], classes: str = "") -> list[str]:
    """Return warnings about a scene's scan, as sentences: no points, points without class.

    Args:
        counts: of the scan.
        classes: file of classes that can be filled in; empty if there is none.
    """
    unlabelled = int(counts["points_by_class"].get("unlabelled", 0))
    remedy = f": fill in {classes} and scan with --classes {classes} --overwrite" if classes else ""
    return [*empty_scan_warnings(counts), *([f"{unlabelled:,} points have no class{remedy}"] if unlabelled else [])]
