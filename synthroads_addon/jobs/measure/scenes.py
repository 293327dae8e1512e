"""Scans of scenes as meshes - waves, a road - beside bare Embree on the same rays: rates in processor time."""

import tempfile
import time
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float32
from ...base.machine import available_cores
from ...base.progress import StageTimer, peak_memory_mb
from ...blender.casters.measure import bare_rate
from ...blender.casters.packets import PacketCaster
from ...blender.files import empty_file
from ...blender.model.measure import bare_import_seconds
from ...blender.services import BlenderServices
from ...road.geometry import RoadGeometry
from ...sampling.road import sample_road
from ...scanning.beam import RINGS
from ...scanning.blocks import Block
from ...scanning.kernels.packets import Packing
from ...scanning.plan import ScanPlan
from ...scanning.scan import BlockScan
from ...scanning.scene.caster import Caster
from ...scanning.scene.mesh import SceneMesh
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario
from ..open_scene import RoadScene
from ..scan.plan import Site
from ..scan.sink import record_cloud

_BLOCKS, _BARE_BLOCKS = 48, 12
"""Blocks that are scanned, spread over the path, and those of which the rays are cast by Embree alone."""
_TURNS = 3
"""Times that a scan and Embree alone are measured in turn; the best of each counts, as other work only slows."""
_SIZES = (2, 6)
"""Blocks of scans that are compared for what a scan takes besides its pulses."""
_NOT_PACKED = Packing(least_cosine=2.0)

Rays = tuple[Float32, Float32]


def road_mesh(scenario: Scenario) -> SceneMesh:
    """Build a scenario's road in a new Blender file, and return what stands still in it as triangles."""
    empty_file()
    scene = RoadScene.of(scenario, RoadGeometry(sample_road(scenario.road, scenario.seed)))
    scene.build()
    return scene.read().static


def spread_blocks(plan: ScanPlan, count: int) -> tuple[Block, ...]:
    """Return so many of a plan's blocks, spread evenly over the scan; all of them where it has fewer."""
    all_blocks = list(plan.blocks())
    return tuple(all_blocks[i] for i in np.unique(np.linspace(0, len(all_blocks) - 1, count + 2).astype(int)[1:-1]))


def with_rings(plan: ScanPlan, rings: tuple[int, ...]) -> ScanPlan:
    """Return a plan with another number of rays on each ring around the beam's axis."""
    return replace(plan, emission=replace(plan.emission, rings=rings))


def rays_of_blocks(plan: ScanPlan, blocks: Sequence[Block]) -> Rays:
    """Return the origins and directions (N, 3) of all rays that a scan of some blocks casts at what stands still."""
    part, target, recorded_rays = plan.target._parts[0], copy(plan.target), list[Rays]()
    caster = part.caster

    def cast_and_keep(origins: Float32, directions: Float32, maximum_range: float) -> NDArray[np.int32]:
        """Cast rays, of which a copy is recorded."""
        recorded_rays.append((origins.copy(), directions.copy()))
        return caster.cast(origins, directions, maximum_range)

    recording_caster: Any = SimpleNamespace(
        name=caster.name, main_thread_only=False, kernels=caster.kernels, cast=cast_and_keep
    )
    target._parts, target.caster = [replace(part, caster=recording_caster), *target._parts[1:]], recording_caster
    for block in blocks:
        BlockScan(replace(plan, target=target, emission=replace(plan.emission, ground=None))).scan_block(*block)
    origins, directions = map(np.concatenate, zip(*recorded_rays, strict=True))
    return origins, directions


def measure_scene(
    site: Site, scene: ScannedScene, file: Path, title: str, rays_per_pulse: Sequence[int], timer: StageTimer
) -> dict[str, Any]:
    """Scan an opened scene with each number of rays per pulse, in turn with Embree alone on the same rays.

    Rates of scans are those of a second of all threads' processor time, from the first pulse to the file's end.

    Args:
        site: of its scan; what is written is lost.
        scene: as it was read.
        file: that it was opened from, an .obj with z up; it is imported again, and the open file is lost.
        title: of the scene, for names of rates.
        rays_per_pulse: numbers of rays, of `RINGS`.
        timer: of the stages so far, in which it was opened and read.

    Returns:
        ``rates`` by rays per pulse: million rays per processor second of the scan (``ours``), of Embree in packets and
        of its single rays, million pulses per second by the clock (``pulses_per_second``), and the share of the cores'
        time that it used (``busy``); ``floors``: name, unit, ours and floor; ``memory_mb``: the process's peak once the
        caster is built; ``opening`` up to the first pulse, in times of what Blender's importer alone takes; ``fixed``
        seconds of processor time that a scan takes besides its pulses.
    """
    with timer.stage("caster"):
        plan = site.plan(scene, BlenderServices())
        plan = replace(plan, run=replace(plan.run, threads=available_cores()))
    memory = peak_memory_mb() or 0.0
    bare_casters = _bare_casters(plan, scene.static)
    rates = {rays: _rates_in_turn(site, with_rings(plan, RINGS[rays]), bare_casters) for rays in rays_per_pulse}
    fixed_seconds = _fixed_seconds(site, with_rings(plan, RINGS[1]))
    floors = [
        {
            "name": f"{title}, {rays} rays per pulse; Embree's {kind}",
            "unit": "million rays per processor second",
            "ours": rate["ours"],
            "floor": rate[kind],
        }
        for rays, rate in rates.items()
        for kind in bare_casters
    ]
    import_seconds = min(bare_import_seconds(file) for _ in range(2))
    return {
        "rates": rates,
        "floors": floors,
        "memory_mb": memory,
        "opening": timer.seconds / import_seconds,
        "fixed": fixed_seconds,
    }


def _bare_casters(plan: ScanPlan, mesh: SceneMesh) -> dict[str, Caster]:
    """Return Embree's casters over a plan's scene: packets, where they are used, and single rays."""
    caster = plan.target.caster
    if not isinstance(caster, PacketCaster):
        return {"single rays": caster}
    return {"packets": caster, "single rays": PacketCaster(caster._packets, mesh, packing=_NOT_PACKED)}


def _rates_in_turn(site: Site, plan: ScanPlan, bare_casters: dict[str, Caster]) -> dict[str, float]:
    """Return the best rates of a scan and of bare casters on the same rays, measured in turn."""
    sampled_plan = replace(plan, run=replace(plan.run, chosen_blocks=spread_blocks(plan, _BLOCKS)))
    origins, directions = rays_of_blocks(plan, spread_blocks(plan, _BARE_BLOCKS))
    limit, best_rates = plan.setting.maximum_range, dict[str, float]()

    def keep(name: str, rate: float) -> None:
        """Keep a rate if it is the best of its name so far."""
        best_rates[name] = max(best_rates.get(name, 0.0), rate)

    for _ in range(_TURNS):
        counts, processor, seconds = _scan(site, sampled_plan)
        keep("ours", counts["rays"] / processor / 1e6)
        keep("pulses_per_second", counts["pulses"] / seconds / 1e6)
        keep("busy", processor / seconds / available_cores())
        for name, caster in bare_casters.items():
            rate = bare_rate(caster, origins, directions, limit, available_cores(), repeats=1)
            keep(name, rate.rays_per_processor_second / 1e6)
    return best_rates


def _scan(site: Site, plan: ScanPlan) -> tuple[dict[str, Any], float, float]:
    """Scan a plan into a file that is lost; return the counts, and seconds of processor time and by the clock."""
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        files = site.files(Path(folder), plan.target.origin)
        clock, processor = time.perf_counter(), time.process_time()
        counts = record_cloud([plan], files, StageTimer(), announce=None)
        return counts, time.process_time() - processor, time.perf_counter() - clock


def _fixed_seconds(site: Site, plan: ScanPlan) -> float:
    """Return the processor time, s, that a scan takes besides its pulses: of two sizes, extrapolated to no pulse."""
    all_blocks, (few_count, many_count) = tuple(plan.blocks()), _SIZES

    def seconds(count: int) -> float:
        """Return the least processor time, s, of several scans of so many blocks, repeated where there are fewer."""
        blocks = tuple(all_blocks[number % len(all_blocks)] for number in range(count))
        sampled_plan = replace(plan, run=replace(plan.run, chosen_blocks=blocks))
        return min(_scan(site, sampled_plan)[1] for _ in range(2 * _TURNS))

    few_seconds = seconds(few_count)
    return few_seconds - few_count * (seconds(many_count) - few_seconds) / (many_count - few_count)
