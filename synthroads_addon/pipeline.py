"""The main job: scenario -> parameters -> model -> scan -> cloud -> files. What no output needs is not made."""

from __future__ import annotations

import platform as machine
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from . import version
from .core.cloud.centerline import centerline_geojson
from .core.cloud.labels import classes
from .core.cloud.las import LasWriter
from .core.cloud.previews import TopView
from .core.crs import wkt
from .core.errors import InputError
from .core.files import output_folder
from .core.materials import surfaces
from .core.parameters.axis_object import fitted_axis
from .core.parameters.geometry import RoadGeometry
from .core.parameters.model import RoadParameters, read_parameters
from .core.parameters.sampler import sample_road
from .core.parameters.tessellation import sample_stations
from .core.progress import Progress, StageTimer, silent
from .core.scanning.caster import Caster
from .core.scanning.devices import scanner_setting
from .core.scanning.path import FlightPath
from .core.scanning.scan import BlockResult, Scan, scan_block
from .core.scenario import Scenario
from .core.scene_mesh import SceneMesh
from .core.schema import canonical_json

FILES = {
    "parameters": ("parameters.json",),
    "cloud": ("cloud.laz",),
    "centerline": ("centerline.geojson",),
    "scene": ("scene.blend",),
    "previews": ("preview_class.png", "preview_intensity.png", "preview_rgb.png"),
}
"""The files that each output of a scenario stands for; ``report.json`` is always written."""


@dataclass
class Job:
    """What `generate` is asked for.

    Attributes:
        scenario: limits, scan, fidelity and outputs.
        output: folder for the files.
        parameters: take this road instead of sampling one.
        axis: sample a road along this centreline (CSV or GeoJSON).
        overwrite: replace files that are already there.
    """

    scenario: Scenario
    output: Path
    parameters: Path | None = None
    axis: Path | None = None
    overwrite: bool = False


@dataclass
class ScanCounts:
    """What was counted while scanning."""

    pulses: int = 0
    rays: int = 0
    points: int = 0
    below_threshold: int = 0
    intensity_clipped: int = 0
    by_class: np.ndarray = field(default_factory=lambda: np.zeros(256, dtype=np.int64))

    def add(self, result: BlockResult) -> None:
        """Add one block."""
        self.pulses += result.pulses
        self.rays += result.rays
        self.below_threshold += result.below_threshold
        self.points += len(result.points)
        self.by_class += np.bincount(result.points.class_id, minlength=256)


def generate(job: Job, progress: Progress = silent) -> dict[str, Any]:
    """Run the main job; return the report that is also written to ``report.json``.

    Raises:
        InputError: an input is wrong or the output can't be written; nothing is left half-written.
    """
    check(job)
    wanted = job.scenario.outputs
    names = [name for output in wanted for name in FILES[output]] + ["report.json"]
    timer = StageTimer(progress)
    report: dict[str, Any] = {"type": "Report", "generator": f"SynthRoads {version()}"}
    with output_folder(job.output, names, job.overwrite) as folder:
        with timer.stage("parameters"):
            parameters, axis_report = road_parameters(job)
            geometry = RoadGeometry(parameters)
            report |= axis_report
            _write_texts(folder, wanted, parameters, geometry, job.scenario)
        if set(wanted) & {"scene", "cloud", "previews"}:
            report["counts"] = _scene_outputs(job, folder, parameters, geometry, timer)
        report |= _closing(job, timer)
        (folder / "report.json").write_text(canonical_json(report), encoding="utf-8")
    return report


def check(job: Job) -> None:
    """Refuse a job that can't be done before any work starts."""
    scanner_setting(job.scenario.scan)
    wkt(job.scenario.road.epsg)
    if job.parameters and job.axis:
        raise InputError("--axis", str(job.axis), "can't be given together with --parameters")
    if not job.scenario.outputs:
        raise InputError("outputs", [], f"must name at least one of {', '.join(FILES)}")


def road_parameters(job: Job) -> tuple[RoadParameters, dict[str, Any]]:
    """Return the road that a job is about, and what to report of the axis that it was fitted to."""
    scenario = job.scenario
    if job.parameters:
        return read_parameters(job.parameters), {}
    if job.axis:
        axis, road, fit = fitted_axis(job.axis, scenario.road)
        return sample_road(road, scenario.seed, scenario.title, axis), {"axis": fit}
    return sample_road(scenario.road, scenario.seed, scenario.title), {}


def make_scan(
    scenario: Scenario, geometry: RoadGeometry, mesh: SceneMesh, caster: Caster, rays_per_pulse: int | None = None
) -> Scan:
    """Return the scan that a scenario asks for, ready to be cut into blocks."""
    return Scan(
        mesh=mesh,
        surfaces=surfaces(mesh.materials),
        caster=caster,
        setting=scanner_setting(scenario.scan),
        path=FlightPath(geometry, scenario.scan.platform),
        rays_per_pulse=rays_per_pulse or scenario.settings().rays_per_pulse,
        seed=scenario.seed,
        attenuation=scenario.scan.attenuation,
    )


def scan_blocks(scan: Scan, threads: int = 0) -> Iterator[BlockResult]:
    """Yield the blocks of a scan in their order, computed side by side; only a few are held at a time."""
    workers = threads or available_cores()
    with _pool(workers) as pool:
        tasks = iter(scan.blocks())
        pending: list[Future[BlockResult]] = [
            pool.submit(scan_block, scan, *task) for task in islice(tasks, workers + 1)
        ]
        while pending:
            yield pending.pop(0).result()
            pending += [pool.submit(scan_block, scan, *task) for task in islice(tasks, 1)]


def available_cores() -> int:
    """Return how many cores this process may use."""
    import os

    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _pool(workers: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a thread pool that drops what it has not begun when the work is stopped."""
    pool = ThreadPoolExecutor(workers)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _write_texts(
    folder: Path, wanted: tuple[str, ...], parameters: RoadParameters, geometry: RoadGeometry, scenario: Scenario
) -> None:
    if "parameters" in wanted:
        (folder / "parameters.json").write_text(parameters.to_json(), encoding="utf-8")
    if "centerline" in wanted:
        stations = sample_stations(geometry, scenario.settings().tolerance)
        text = canonical_json(centerline_geojson(geometry, stations))
        (folder / "centerline.geojson").write_text(text, encoding="utf-8")


def _scene_outputs(
    job: Job, folder: Path, parameters: RoadParameters, geometry: RoadGeometry, timer: StageTimer
) -> dict[str, Any]:
    """Build the model and write what needs it."""
    from .blender.casters import make_caster
    from .blender.model import build_road
    from .blender.scene import save_scene, scene_mesh

    settings, wanted = job.scenario.settings(), job.scenario.outputs
    counts: dict[str, Any] = {}
    with timer.stage("model"):
        model = build_road(parameters, settings.tolerance, settings.vegetation_detail)
    if set(wanted) & {"cloud", "previews"}:
        with timer.stage("scene mesh"):
            mesh = scene_mesh(origin=model.origin)
        counts |= {"triangles": len(mesh.triangles), "vertices": len(mesh.vertices)}
        with timer.stage("caster"):
            caster = make_caster(job.scenario.scan.caster, mesh)
        with timer.stage("scan"):
            scan = make_scan(job.scenario, geometry, mesh, caster)
            counts |= _scan_to_files(job, folder, scan, geometry, timer)
        counts["caster"] = caster.name
    if "scene" in wanted:
        with timer.stage("scene file"):
            save_scene(folder / "scene.blend")
    return counts


def _scan_to_files(
    job: Job, folder: Path, scan: Scan, geometry: RoadGeometry, timer: StageTimer
) -> dict[str, Any]:
    """Scan block by block into the cloud and the previews."""
    wanted, epsg = job.scenario.outputs, geometry.parameters.metadata.epsg
    counts, view = ScanCounts(), _top_view(geometry) if "previews" in wanted else None
    total = len(scan.blocks())
    with _cloud_writer(folder, wanted, epsg, scan) as writer:
        for number, result in enumerate(scan_blocks(scan, job.scenario.scan.threads), start=1):
            counts.add(result)
            if writer:
                writer.write(result.points)
            if view:
                view.add(result.points)
            timer.progress("scan", number / total)
        counts.intensity_clipped = writer.clipped if writer else 0
    if view:
        view.save(folder, epsg)
    summary = {k: v for k, v in asdict(counts).items() if k != "by_class"}
    names = {row.id: row.name for row in classes()} | {255: "unlabelled"}
    by_class = {names.get(i, str(i)): int(n) for i, n in enumerate(counts.by_class) if n}
    summary |= {"intensity_scale": writer.intensity_scale if writer else None}
    return summary | {"points_by_class": by_class}


@contextmanager
def _cloud_writer(folder: Path, wanted: tuple[str, ...], epsg: int, scan: Scan) -> Iterator[LasWriter | None]:
    if "cloud" not in wanted:
        yield None
        return
    # 16 bits are full for a white target at a right angle at half the flight height: nothing but a retro-reflector is
    # brighter, and the weakest echoes still have hundreds of steps.
    full_scale_range = max(1.0, scan.path.platform.height / 2.0)
    with LasWriter(folder / "cloud.laz", epsg, scan.mesh.origin, 65535.0 * full_scale_range**2) as writer:
        yield writer


def _top_view(geometry: RoadGeometry) -> TopView:
    """Return a raster that holds the whole swath."""
    origin = np.array(geometry.parameters.transform.translate)[:2]
    stations = np.linspace(0.0, geometry.length, 50)
    terrain = geometry.parameters.terrain
    reach = terrain.half_width if terrain else float(np.abs(geometry.offsets).max())
    plan, heading, _ = geometry.alignment.frame(stations)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    chord = plan[-1] - plan[0]
    normal = np.array([-chord[1], chord[0]]) / max(np.hypot(*chord), 1e-9)
    edges = np.concatenate([plan + reach * left, plan - reach * left])
    across = (edges - plan[0]) @ normal
    return TopView(plan[0] + origin, plan[-1] + origin, float(across.min()) - 2, float(across.max()) + 2)


def _closing(job: Job, timer: StageTimer) -> dict[str, Any]:
    """Return the part of the report that is the same for every job."""
    import bpy
    import laspy

    return {
        "seed": job.scenario.seed,
        "settings": asdict(job.scenario.settings()),
        "scenario": job.scenario.to_dict(),
        "seconds": round(timer.seconds, 3),
        "stages": timer.stages,
        "versions": {
            "synthroads": version(),
            "blender": bpy.app.version_string,
            "python": machine.python_version(),
            "numpy": np.__version__,
            "laspy": laspy.__version__,
        },
        "cores": available_cores(),
    }
