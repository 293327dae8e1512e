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
from ..base.classes import ClassScheme
from ..base.crs import wkt
from ..base.errors import InputError
from ..base.files import output_folder
from ..base.progress import Progress, StageTimer, silent
from ..base.schema import read_json
from ..cloud.tools.previews import TopView
from ..road.centerline import read_axis
from ..road.geometry import RoadGeometry
from ..scanning.plan import ScanConditions
from ..scanning.platforms.guides import RoadGuide
from ..scanning.platforms.path import Path as ScanPath
from ..scanning.platforms.polyline import PolylineGuide
from ..scanning.platforms.trajectory import RecordedTrajectory, read_trajectory
from ..scanning.platforms.tripod import Tripod, TripodPath
from ..scanning.scene.extent import body_bounds, elevation_at, middle_line, strays_of
from ..scanning.scene.mesh import SceneMesh
from ..scanning.scene.motion import ScannedScene
from ..scenario.scan import scanner_setting
from ..scenario.scenario import Scenario
from .choose.knobs import check_choice
from .job_files import OF_POINTS, JobFiles, empty_scan_warnings
from .scan.plan import Site, road_view

if TYPE_CHECKING:
    from ..blender.scene.foreign import UpAxis

_BORDER = 2.0  # m, of the previews


@dataclass(frozen=True)
class SceneScan:
    """Request to `scan_scene`.

    Attributes:
        scenario: scan, fidelity and seed; its road is not looked at.
        output: folder for the files.
        scene: file to open, or the scene that is open if None.
        path: CSV or GeoJSON of a line that the platform follows, in map coordinates.
        tripods: positions (x, y) or (x, y, z) of a tripod in map coordinates; z is that of the scanner itself.
        classes: JSON file with classes by name, see `ClassMapping`.
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
    epsg: int | None = None
    origin: tuple[float, float, float] | None = None
    up: UpAxis | None = None
    overwrite: bool = False
    begun: float | None = None


def scan_scene(job: SceneScan, progress: Progress = silent) -> dict[str, Any]:
    """Scan a scene; return the report that is also written to ``report.json``.

    Raises:
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    # Blender takes a second to start: whoever imports the names of this module needs none.
    from ..blender.scene.foreign import open_scene
    from ..blender.services import BlenderServices
    from .choose.search import decide

    begun, timer = job.begun or time.perf_counter(), StageTimer(progress)
    mapping, report = check_scene_scan(job), dict[str, Any](scene=job.scene.name if job.scene else None)
    files = JobFiles(job.scenario, road=False)
    with output_folder(job.output, files.names, job.overwrite) as folder:
        with timer.stage("scene"):
            if job.scene is not None:
                open_scene(job.scene, job.up)
        with timer.stage("scene mesh"):
            scene, road, warnings = _read_scene(job, mapping)
        site = scene_site(job, scene.static, road)
        if job.scenario.chooses:
            with timer.stage("choice"):
                decision = decide(site, begun, lambda _: scene)
                site, report["choice"] = replace(site, scenario=decision.scenario), decision.report
                files = JobFiles(decision.scenario, road=False)
        counts = site.scan(scene, BlenderServices(), folder, timer)
        report |= {"counts": counts, "warnings": warnings + _warnings_of_counts(counts)}
        return files.write_report(folder, report, timer)


def check_scene_scan(job: SceneScan) -> ClassMapping | None:
    """Refuse a job that can't be done before any work starts; return the classes by name."""
    from ..blender.scene.foreign import check_scene_file  # see `scan_scene`

    check_choice(job.scenario, foreign=True)
    platform = job.scenario.scan.platform
    if job.scene is not None:
        check_scene_file(job.scene, job.up)
    if not set(job.scenario.outputs) & set(OF_POINTS):
        raise InputError("outputs", list(job.scenario.outputs), f"must name at least one of {', '.join(OF_POINTS)}")
    if job.tripods:
        tripod = _tripod_of(job)
        if tripod.height is not None and any(len(place) == 3 for place in job.tripods):
            raise InputError("--height", tripod.height, "can't be given with a tripod whose z is the scanner's own")
    if job.path and (job.tripods or isinstance(platform, RecordedTrajectory)):
        raise InputError("--path", str(job.path), "can't be given together with a trajectory or a tripod's positions")
    if job.path:
        read_axis(job.path)
    if isinstance(platform, RecordedTrajectory) and platform.file:
        read_trajectory(platform.file)
    scanner_setting(job.scenario.scan)
    job.scenario.own_materials()
    if job.epsg is not None:
        wkt(job.epsg)
    known = job.scenario.cloud.scheme().source_ids()
    if job.classes is None:
        return None
    mapping = ClassMapping.from_dict(read_json(job.classes), source=str(job.classes))
    mapping.check(known, str(job.classes))
    return mapping


def _read_scene(job: SceneScan, mapping: ClassMapping | None) -> tuple[ScannedScene, RoadGeometry | None, list[str]]:
    """Return the open scene, its road, and warnings; refuse a scene in which there is nothing to scan."""
    from ..blender.model.store import open_road  # see `scan_scene`
    from ..blender.scene.evaluated import scanned_scene
    from ..blender.scene.foreign import open_scene_warnings

    parameters = open_road()
    if parameters and job.origin is not None:
        raise InputError("--origin", list(job.origin), "can't be given: the road in the scene has one of its own")
    factor = job.scenario.scan.traffic_speed_factor
    road = RoadGeometry(parameters) if parameters else None
    class_ids = job.scenario.cloud.scheme().source_ids()
    scene = scanned_scene(
        classes=mapping, geometry=road, speed_factor=factor, number_objects=True, class_ids=class_ids
    )
    if not len(scene.static) and not scene.moving:
        name = str(job.scene) if job.scene else "open scene"
        raise InputError(name, None, "holds nothing visible with faces that could be scanned")
    if job.origin is not None:
        scene = replace(scene, static=replace(scene.static, origin=np.array(job.origin, dtype=np.float64)))
    unused = [f"{job.classes}: nothing in the scene is named as in {entry}" for entry in scene.unmatched]
    return scene, road, open_scene_warnings() + unused + _stray_warnings(scene.static)


def scene_site(job: SceneScan, mesh: SceneMesh, road: RoadGeometry | None) -> Site:
    """Return the site of a scene's scan."""
    conditions = ScanConditions.of(road.parameters if road else None)
    if job.epsg is not None:
        conditions = replace(conditions, epsg=job.epsg)
    view = None
    if "previews" in job.scenario.outputs:
        scheme = job.scenario.cloud.scheme().sources()
        view = road_view(road, scheme) if road else scene_view(mesh, scheme)
    return Site(job.scenario, scene_path(job, mesh, road), conditions, view)


def _stray_warnings(mesh: SceneMesh) -> list[str]:
    strays = strays_of(mesh) if len(mesh) else None
    return [f"{strays.count():,} vertices lie far from all others: path and previews leave them out"] if strays else []


def scene_path(job: SceneScan, mesh: SceneMesh, geometry: RoadGeometry | None) -> ScanPath:
    """Return the scanner's path: given, along the scene's road, or straight over its middle.

    A path of one's own or over the middle has one strip unless the platform has lateral offsets.
    """
    platform, origin = job.scenario.scan.platform, mesh.origin.tolist()
    if job.tripods:
        return TripodPath(_tripod_of(job), [_scanner_place(job, place, mesh) for place in job.tripods])
    if geometry and not job.path:
        return platform.make_path(RoadGuide(geometry))
    guide = PolylineGuide.read(job.path, origin) if job.path else PolylineGuide(middle_line(mesh), origin)
    return platform.as_single_strip().make_path(guide, origin)


def _tripod_of(job: SceneScan) -> Tripod:
    platform = job.scenario.scan.platform
    if not isinstance(platform, Tripod):
        raise InputError("scan.platform.kind", platform.kind, "must be tripod where its positions are given")
    return platform


def _scanner_place(job: SceneScan, place: tuple[float, ...], mesh: SceneMesh) -> list[float]:
    """Return the local place (3,) of a tripod's scanner: above the highest surface unless it has a z."""
    local = [value - base for value, base in zip(place, mesh.origin, strict=False)]
    if len(local) == 3:
        return local
    ground = elevation_at(mesh, *local)
    if ground is None:
        shown = ",".join(f"{value:g}" for value in place)
        raise InputError("--tripod", shown, "there is no surface below: give the scanner's elevation, X,Y,Z")
    return [*local, ground + _tripod_of(job).value("height")]


def scene_view(mesh: SceneMesh, scheme: ClassScheme | None = None) -> TopView:
    """Return a raster that holds the scene, its longer side from left to right.

    Args:
        mesh: the scene.
        scheme: of the points' classes; the 17 if None.
    """
    low, high = body_bounds(mesh)
    start, end = (low + mesh.origin)[:2], (high + mesh.origin)[:2]
    axis = int(np.argmax(end - start))
    reach = float((end - start)[1 - axis]) / 2.0 + _BORDER
    middle = (start + end)[1 - axis] / 2.0
    start[1 - axis] = end[1 - axis] = middle
    return TopView(start, end, -reach, reach, scheme)


def _warnings_of_counts(counts: dict[str, Any]) -> list[str]:
    unlabelled = int(counts["points_by_class"].get("unlabelled", 0))
    return [*empty_scan_warnings(counts), *([f"{unlabelled:,} points have no class"] if unlabelled else [])]
