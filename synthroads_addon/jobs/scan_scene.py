"""The job "scan a scene": what others made -> triangles with classes -> scan -> cloud and previews.

The scene is only read: nothing is added to it, and its file isn't written.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.class_mapping import ClassMapping
from ..base.crs import wkt
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.progress import Progress, StageTimer, silent
from ..base.schema import read_json
from ..cloud.tools.previews import TopView
from ..road.centerline import read_axis
from ..road.geometry import RoadGeometry
from ..scanning.plan import ScanConditions
from ..scanning.platforms.over_scene import SceneRoute, as_tripod, path_over
from ..scanning.platforms.trajectory import RecordedTrajectory, read_trajectory
from ..scanning.scene.extent import body_bounds, strays_of
from ..scanning.scene.mesh import SceneMesh
from ..scanning.scene.motion import ScannedScene
from ..scenario.scenario import OF_POINTS, Scenario
from .job_files import JobFiles, empty_scan_warnings
from .scan.plan import Site, check_scan

if TYPE_CHECKING:
    from ..blender.scene.foreign import UpAxis


@dataclass(frozen=True)
class SceneScan:
    """Request to `scan_scene`: scenario, output folder, scene, and the scanner's path.

    Attributes:
        scenario: scan, fidelity and seed; its road is not looked at.
        output: folder for the files.
        scene: file to open, or the scene that is open if None.
        path: CSV or GeoJSON of a line that the platform follows, in map coordinates.
        tripods: positions (x, y) or (x, y, z) of a tripod in map coordinates; z is that of the scanner itself.
        classes: JSON file with classes by name, see `ClassMapping`.
        road: name of the scene's road, where it has several; the one that is active or was chosen in it if None.
        epsg: of the map; that of the scene's road, or unknown, if None.
        origin: map coordinates of the scene's own origin, m; those of the scene's road, or 0, if None.
        up: see `blender.scene.foreign.open_scene`.
        overwrite: replace files that are already there.
        begun: when the job began, by `time.perf_counter`, for a time budget; when `scan_scene` is called if None.
    """

    scenario: Scenario
    output: Path
    scene: Path | None = None
    path: Path | None = None
    tripods: tuple[tuple[float, ...], ...] = ()
    classes: Path | None = None
    road: str | None = None
    epsg: int | None = None
    origin: tuple[float, float, float] | None = None
    up: UpAxis | None = None
    overwrite: bool = False
    begun: float | None = None


def scan_scene(job: SceneScan, progress: Progress = silent) -> dict[str, Any]:
    """Scan a scene made elsewhere into files; return the report, which is also written to ``report.json``.

    Raises:
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    # Blender takes a second to start: whoever imports the names of this module needs none.
    from .choose.search import choose_settings
    from .open_scene import ForeignScene

    begun, timer = job.begun or time.perf_counter(), StageTimer(progress)
    mapping, report = check_scene_scan(job), dict[str, Any](scene=job.scene.name if job.scene else None)
    with output_folder(job.output, JobFiles(job.scenario, road=False).names, job.overwrite) as folder:
        read, road, warnings = open_and_read(job, mapping, timer, report)
        scene = ForeignScene(scene_site(job, read.static, road), read)
        if job.scenario.chooses:
            scene, report["choice"] = choose_settings(scene, begun, timer)
        counts = scene.scan(folder, timer)
        report |= {"counts": counts, "warnings": warnings + warnings_of_counts(counts)}
        return JobFiles(scene.site.scenario, road=False).write_report(folder, report, timer)


def check_scene_scan(job: SceneScan) -> ClassMapping | None:
    """Raise an InputError for a job that can't be done; return its mapping of names to classes, or None."""
    from ..blender.scene.foreign import check_scene_file  # see `scan_scene`

    platform = job.scenario.scan.platform
    if not set(job.scenario.outputs) & set(OF_POINTS):
        raise InputError("outputs", list(job.scenario.outputs), f"must name at least one of {', '.join(OF_POINTS)}")
    check_scan(job.scenario, foreign=True)
    if job.scene is not None:
        check_scene_file(job.scene, job.up)
    if job.tripods:
        tripod = as_tripod(platform)
        if tripod.height is not None and any(len(place) == 3 for place in job.tripods):
            raise InputError("--height", tripod.height, "can't be given with a tripod whose z is the scanner's own")
    if job.path and (job.tripods or isinstance(platform, RecordedTrajectory)):
        raise InputError("--path", str(job.path), "can't be given together with a trajectory or a tripod's positions")
    if isinstance(platform, RecordedTrajectory) and platform.file:
        read_trajectory(platform.file)
    if job.path:
        read_axis(job.path)
    if job.epsg is not None:
        wkt(job.epsg)
    if job.classes is None:
        return None
    mapping = ClassMapping.from_dict(read_json(job.classes), source=str(job.classes))
    mapping.check(job.scenario.cloud.scheme().source_ids(), str(job.classes))
    return mapping


def open_and_read(
    job: SceneScan, mapping: ClassMapping | None, timer: StageTimer, report: dict[str, Any]
) -> tuple[ScannedScene, RoadGeometry | None, list[str]]:
    """Open a job's scene; return its scanned form, its road (or None) and warnings; adds the road to `report`.

    Raises:
        InputError: the file can't be read, there is nothing to scan in it, or it has a road and an origin is given.
    """
    from ..blender.model.settle import settle  # see `scan_scene`
    from ..blender.model.truth import open_road
    from ..blender.scene.evaluated import scanned_scene
    from ..blender.scene.foreign import open_scene, open_scene_warnings

    with timer.stage("scene"):
        if job.scene is not None:
            open_scene(job.scene, job.up)
    with timer.stage("scene mesh"):
        opened = open_road(job.road)
        edited = opened.edited if opened else None
        parameters = edited.parameters if edited and not edited.lost else None
        if opened and edited:
            report |= {"road": opened.name} | edited.to_dict()
            if edited.stale and not edited.lost:
                settle(opened.road_id, edited)
        if opened and job.origin is not None:
            raise InputError("--origin", list(job.origin), "can't be given: the road in the scene has one of its own")
        factor, class_ids = job.scenario.scan.traffic_speed_factor, job.scenario.cloud.scheme().source_ids()
        further: dict[str, Any] = {"class_ids": class_ids, "road": opened.road_id if opened else ""}
        road = RoadGeometry(parameters) if parameters else None
        scene = scanned_scene(None, None, mapping, road, factor, number_objects=True, **further)
        if not len(scene.static) and not scene.moving:
            what = "holds nothing visible with faces that could be scanned"
            raise InputError(str(job.scene or "open scene"), None, what)
        if job.origin is not None:
            scene = replace(scene, static=replace(scene.static, origin=np.array(job.origin, dtype=np.float64)))
        warnings = open_scene_warnings()
        warnings += [f"{edit.name} was edited by hand: {edit.reason}" for edit in edited.by_hand] if edited else []
        warnings += [f"{job.classes}: nothing in the scene is named as in {entry}" for entry in scene.unmatched]
        if strays := strays_of(scene.static) if len(scene.static) else None:
            warnings += [f"{strays.count():,} vertices lie far from all others: path and previews leave them out"]
    return scene, road, warnings


def scene_site(job: SceneScan, mesh: SceneMesh, road: RoadGeometry | None) -> Site:
    """Return the site of a scene's scan: path, conditions, preview raster if wanted."""
    conditions = ScanConditions.of(road.parameters if road else None)
    if job.epsg is not None:
        conditions = replace(conditions, epsg=job.epsg)
    path = path_over(job.scenario.scan.platform, mesh, road, job.path, job.tripods)
    return Site(job.scenario, path, conditions, _view_over(job.scenario, mesh, road))


def route_site(scenario: Scenario, route: SceneRoute, mesh: SceneMesh) -> Site:
    """Return the site of a scan along a route through a scene without a road."""
    path = route.path(scenario.scan.platform, mesh)
    return Site(scenario, path, ScanConditions.of(None), _view_over(scenario, mesh, None))


def _view_over(scenario: Scenario, mesh: SceneMesh, road: RoadGeometry | None) -> TopView | None:
    """Return the raster of the previews, over the road or else the mesh's box; None if no previews are wanted."""
    if "previews" not in scenario.outputs:
        return None
    scheme, (low, high) = scenario.cloud.scheme().sources(), body_bounds(mesh) + mesh.origin
    return TopView.over_road(road, scheme) if road else TopView.over_box(low, high, scheme)


def warnings_of_counts(counts: dict[str, Any]) -> list[str]:
    """Return warnings about a scene's scan, as sentences: no points, points without class."""
    unlabelled = int(counts["points_by_class"].get("unlabelled", 0))
    return [*empty_scan_warnings(counts), *([f"{unlabelled:,} points have no class"] if unlabelled else [])]
