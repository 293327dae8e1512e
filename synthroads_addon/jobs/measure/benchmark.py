"""The demo job, each stage beside its floor: bare Embree, lazrs and Cycles on the same rays, points and images.

A process measures one number of cores: those that it may use.
"""

import tempfile
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import laspy

from ...base.machine import available_cores
from ...base.progress import StageTimer, peak_memory_mb
from ...blender.cameras.benchmark import measure_rendering
from ...blender.casters.measure import bare_rate
from ...blender.files import empty_file
from ...blender.model.measure import bare_mesh_seconds, panel_edit, seconds_of
from ...cloud.formats.registry import open_cloud
from ...road.geometry import RoadGeometry
from ...sampling.road import sample_road
from ...scanning.beam import RINGS
from ...scanning.plan import ScanPlan
from ...scanning.record import scan_blocks
from ...scenario.scenario import Scenario
from ..job_files import JobFiles
from ..open_scene import RoadScene
from ..scan.files import CloudFiles
from ..scan.sink import record_cloud
from .scenes import rays_of_blocks, spread_blocks, with_rings

_CAST_BLOCKS, _WRITTEN_BLOCKS = 48, 96
"""Blocks on which casting (spread over the scan) and writing are measured beside their floors: so many that what is
left over for one core at the end doesn't count."""
_BLOCK = 1 << 15
"""Points of a block that is written: about as many as a block of the scan has."""
_RAYS = (1, 7, 19, 61)
_TURNS = 4
"""Measurements of each rate, of which the best counts, as other work on the machine only slows."""
_VIEWS = 4
"""Images that are rendered bare."""

Rate = dict[str, Any]


def measure_demo(scenario: Scenario) -> dict[str, Any]:
    """Run the demo job and measure its stages, memory and rates beside bare libraries; the open file is lost.

    Returns:
        ``stages`` with seconds and peak memory; ``lines`` by the names of `headless.benchmark_table.LIMITS`;
        ``floors``: name, unit, ours and floor.
    """
    timer = StageTimer()
    empty_file()
    with tempfile.TemporaryDirectory(prefix="synthroads-") as text:
        folder = Path(text)
        with timer.stage("parameters"):
            road = RoadGeometry(sample_road(scenario.road, scenario.seed, scenario.title))
            JobFiles(scenario).write_road(folder, road, timer)
        scene = RoadScene.of(scenario, road)
        with timer.stage("model"):
            model = scene.build()
        with timer.stage("scene mesh"):
            scene.read()
        with timer.stage("caster"):
            plan = scene.plan()
        files = scene.site.files(folder, plan.target.origin)
        record_cloud([plan], files, timer)
        seconds, memory = timer.seconds, peak_memory_mb()
        # The scene, its caster and the materials are the same for every number of rays.
        bare_plan = replace(plan, layers=replace(plan.layers, seen_points=False, measured=frozenset()))
        casting = {rays: _measure_casting(with_rings(bare_plan, RINGS[rays])) for rays in _RAYS}
        writing = _measure_writing(files)
        rates = casting[plan.rays_per_pulse]
        scanning = timer.stages["scan"]["seconds"]
        assert scanning is not None
        scan_rate = _scan_rate(files, scanning, rates, writing)
        floors = [*casting.values(), writing, scan_rate]
        assert plan.layers.request is not None
        if scenario.colour.source != "material":
            floors.append(measure_rendering(plan.layers.request, _VIEWS))
    edit_seconds, edited_triangles = panel_edit(model, road.parameters)
    building_seconds = sum(timer.stages[name]["seconds"] or 0.0 for name in ("parameters", "model", "scene mesh"))
    least_seconds = files.counts.points / scan_rate["floor"] / 1e6
    lines = {
        "points": files.counts.points / 1e6,
        "memory_mb": memory,
        "job": seconds / least_seconds,
        "model": building_seconds / bare_mesh_seconds(plan.target.triangles),
        "panel_edit": edit_seconds / bare_mesh_seconds(edited_triangles),
        "casting": 100.0 * rates["ours"] / rates["floor"],
        "writing": 100.0 * writing["ours"] / writing["floor"],
    }
    if scenario.colour.source != "material":
        lines["rendering"] = 100.0 * floors[-1]["ours"] / floors[-1]["floor"]
    stages = timer.stages | {"panel edit": {"seconds": edit_seconds, "peak_memory_mb": None}}
    return {"stages": stages, "lines": lines, "floors": floors}


def _scan_rate(files: CloudFiles, seconds: float, casting: Rate, writing: Rate) -> Rate:
    """Return the points of the whole scan per second, beside bare casting of its rays and compression of its points.

    Args:
        files: that the scan was written to.
        seconds: of the scan.
        casting, writing: rates of these, with as many rays per pulse as the scan's.
    """
    counts = files.counts
    least_seconds = counts.rays / casting["floor"] + counts.points / writing["floor"]
    name = "scan; Embree and lazrs alone, one after the other"
    rates = {"ours": counts.points / seconds / 1e6, "floor": counts.points / least_seconds}
    return {"name": name, "unit": "million points/s", **rates}


def _measure_casting(plan: ScanPlan) -> Rate:
    """Measure casting with radiometry beside the bare caster on the same rays, in million rays per second.

    Of spared footprints all rays count: the bare caster has to cast them.
    """
    threads, caster = available_cores(), plan.target._parts[0].caster
    blocks = spread_blocks(plan, _CAST_BLOCKS)
    origins, directions = rays_of_blocks(plan, blocks)
    sampled_plan = replace(plan, run=replace(plan.run, chosen_blocks=blocks, threads=threads))

    def ours() -> float:
        """Return the rays per second of casting with radiometry."""
        return len(origins) / seconds_of(lambda: deque(scan_blocks(sampled_plan), maxlen=0))

    def floor() -> float:
        """Return the rays per second of the bare caster."""
        limit = plan.setting.maximum_range
        return bare_rate(caster, origins, directions, limit, threads, repeats=1).rays_per_second

    name = f"casting and radiometry, {plan.rays_per_pulse} rays per pulse; Embree"
    return {"name": name, "unit": "million rays/s", **_best_rates(ours, floor)}


def _best_rates(ours: Callable[[], float], floor: Callable[[], float]) -> dict[str, float]:
    """Return the best rates, in millions per second, of two functions called in turn; disturbances hit both."""
    rates = [(ours(), floor()) for _ in range(_TURNS)]
    return {"ours": max(rate for rate, _ in rates) / 1e6, "floor": max(floor_rate for _, floor_rate in rates) / 1e6}


def _measure_writing(files: CloudFiles) -> Rate:
    """Measure writing LAZ beside bare lazrs compression of the same points, in million points per second.

    The points are the first of the cloud that the job has written.
    """
    folder = files.folder
    with open_cloud(folder / files.scenario.cloud.file_names()[0]) as cloud:
        blocks = list(islice(cloud.blocks(_BLOCK), _WRITTEN_BLOCKS))
    count = sum(map(len, blocks))

    def ours() -> None:
        """Write the blocks by the job's own writer."""
        with files.open_writer("ours.laz") as writer:
            for block in blocks:
                writer.write(block)

    ours()
    written_cloud = laspy.read(folder / "ours.laz")

    def floor() -> None:
        """Write the same points by lazrs alone."""
        backend = laspy.LazBackend.LazrsParallel
        with laspy.open(folder / "bare.laz", "w", header=written_cloud.header, laz_backend=backend) as writer:
            writer.point_writer.write_points(written_cloud.points)  # without laspy's bookkeeping

    rates = _best_rates(lambda: count / seconds_of(ours), lambda: count / seconds_of(floor))
    return {"name": "writing LAZ; lazrs alone", "unit": "million points/s", **rates}
