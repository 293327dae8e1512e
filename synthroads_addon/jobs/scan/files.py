"""A scan into files: what a scenario asks the scanner for, its blocks side by side, and the cloud that they become."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.machine import available_cores
from ...base.progress import StageTimer
from ...cloud.tools.previews import TopView
from ...materials.surfaces import surfaces_of
from ...materials.table import Material
from ...materials.variation import varied
from ...road.geometry import RoadGeometry
from ...road.surroundings import Environment, MaterialVariation
from ...scanning.beam import RINGS
from ...scanning.colour.colour import LayerSource
from ...scanning.finish import LAYERS, OPTIONAL, Finish
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.platforms.path import RoadGuide, Strip, make_path
from ...scanning.relief import micro_relief
from ...scanning.scan import BlockResult, Scan, joined_results, scan_block
from ...scanning.scene.motion import ScannedScene
from ...scanning.scene.target import Target
from ...scanning.weather.registry import weather_of
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario
from .cloud_files import CloudFiles, ScanCounts

if TYPE_CHECKING:
    from ...blender.cameras import ColourJob


def make_scan(
    scenario: Scenario,
    scene: ScannedScene,
    path: ScanPath,
    environment: Environment | None = None,
    rows: Sequence[Material] | None = None,
    variation: MaterialVariation | None = None,
) -> Scan:
    """Return the scan that a scenario asks for, ready to be cut into blocks; builds the casters.

    Args:
        scene: what is scanned.
        path: the scanner's.
        environment: the road's, for its weather and wetness; clear and dry if None.
        rows: the materials' means, see `material_rows`: without them the open file is asked, in the main thread.
        variation: of the road's materials, for those of the scenario's own table.
    """
    from ...blender.casters import make_caster

    settings, setting = scenario.settings(), scanner_setting(scenario.scan)
    rows = list(material_rows(scene.static.materials) if rows is None else rows)
    own = scenario.own_materials()
    for number, name in enumerate(scene.static.materials):
        if name in own:
            rows[number] = varied(name, variation or MaterialVariation(), environment or Environment(), own)
    rings, given = scenario.scan.beam_rings, scenario.scan.attenuation
    weather = scenario.scan.weather or weather_of(environment or Environment())
    return Scan(
        target=Target(scene, lambda mesh: make_caster(scenario.scan.caster, mesh)),
        # The layers of each point have the variation of their own already.
        surfaces=surfaces_of(rows, scenario.scan.reflection, spread=not scenario.colour.intensity_from_layers),
        setting=setting,
        path=path,
        rings=RINGS[settings.rays_per_pulse] if rings is None else rings,
        seed=scenario.seed,
        noise=scenario.scan.noise,
        attenuation=weather.attenuation(setting.device.wavelength_nm) if given is None else given,
        effects=weather.effects() if given is None else (),
        beam=scenario.scan.beam,
        wanted=measured_arrays(scenario),
        targets=needs_targets(scenario),
        detects_later=scenario.colour.intensity_from_layers,
        driven=scenario.scan.platform.kind == "vehicle",
    )


def kept_arrays(scenario: Scenario) -> frozenset[str]:
    """Return the names of `PointBlock`'s optional arrays that the files hold."""
    return scenario.cloud.arrays() & frozenset(OPTIONAL) if "cloud" in scenario.outputs else frozenset()


def measured_arrays(scenario: Scenario) -> frozenset[str]:
    """Return the names of `PointBlock`'s optional arrays that the scan itself must fill."""
    relief = {"normal", "material"} if scenario.scan.relief > 0.0 else set()
    return (kept_arrays(scenario) - set(LAYERS) - {"color_source"}) | relief


def wanted_layers(scenario: Scenario) -> frozenset[str]:
    """Return what the points get besides what the scanner measures: ``rgb`` and material layers."""
    rgb = {"rgb"} if scenario.colour.rgb else set()
    return frozenset(rgb | (kept_arrays(scenario) & set(LAYERS)))


def _camera_layers(scenario: Scenario) -> frozenset[str]:
    """Return what the cameras are asked for."""
    return wanted_layers(scenario) | ({"base_color"} if scenario.colour.intensity_from_layers else frozenset())


def may_render(scenario: Scenario) -> bool:
    """Return whether a scan may have to render: whether it does depends on the scene's materials as well."""
    points = bool(set(scenario.outputs) & {"cloud", "previews"})
    return points and scenario.colour.source != "material" and bool(_camera_layers(scenario))


def needs_targets(scenario: Scenario) -> bool:
    """Return whether the scan must say where its points were seen."""
    layers = bool(wanted_layers(scenario)) or scenario.colour.intensity_from_layers
    return layers or scenario.scan.relief > 0.0


def make_finish(
    scenario: Scenario, scan: Scan, source: LayerSource, rows: Sequence[Material] | None = None
) -> Finish:
    """Return what is done to the points after the scan; `rows` as in `make_scan`."""
    rows = material_rows(scan.target.materials) if rows is None else rows
    return Finish(
        source=source,
        wanted=wanted_layers(scenario),
        surfaces=surfaces_of(rows),
        scanned=scan.surfaces,
        setting=scan.setting,
        intensity_from_layers=scenario.colour.intensity_from_layers,
        range_corrected=scenario.cloud.intensity == "range_corrected",
        relief=micro_relief(scan.target.materials, rows) if scenario.scan.relief > 0.0 else None,
        strength=scenario.scan.relief,
        octaves=scenario.settings().relief_octaves,
        seed=scenario.seed,
        kept=kept_arrays(scenario),
        frame=scan.frame,
    )


def colour_job(
    scenario: Scenario, scan: Scan, scene: ScannedScene, environment: Environment | None = None
) -> ColourJob:
    """Return what the cameras are asked for."""
    from ...blender.cameras import ColourJob

    return ColourJob(
        scenario=scenario.colour,
        fidelity=scenario.fidelity,
        wanted=_camera_layers(scenario),
        mesh=scene.static,
        environment=environment or Environment(),
        path=scan.path,
        field_of_view=scan.setting.field_of_view,
        seed=scenario.seed,
    )


def material_rows(names: Sequence[str]) -> list[Material]:
    """Return the means of materials of the open file."""
    from ...blender.materials import constants

    return list(constants(names).values())


def scan_blocks(scan: Scan, threads: int = 0, finish: Finish | None = None) -> Iterator[BlockResult]:
    """Yield the blocks of a scan in their order, computed side by side; only a few are held at a time.

    Where colours are rendered return by return, several blocks come as one.

    Args:
        scan: see `make_scan`.
        threads: as many blocks are worked on at once; 0 for every core.
        finish: what is done to the points; where its source renders, that happens in the calling thread.
    """
    tasks = iter(scan.blocks())
    renders = finish is not None and finish.source.main_thread_only

    def work(strip: Strip, block: int) -> BlockResult:
        result = scan_block(scan, strip, block)
        return result if finish is None or renders else finish(result)

    if scan.target.caster.main_thread_only:
        results: Iterator[BlockResult] = (work(*task) for task in tasks)
    else:
        results = _side_by_side(work, tasks, threads or available_cores())
    if finish is None or not renders:
        yield from results
        return
    for result in _in_batches(results):
        yield finish(result)


RETURNS_AT_ONCE = 400_000
"""Points that are rendered together: each rendering takes a tenth of a second whatever their number."""


def _in_batches(results: Iterator[BlockResult]) -> Iterator[BlockResult]:
    """Yield blocks joined until they have `RETURNS_AT_ONCE`."""
    batch: list[BlockResult] = []
    for result in results:
        batch.append(result)
        if sum(len(one.points) for one in batch) >= RETURNS_AT_ONCE:
            yield joined_results(batch)
            batch = []
    if batch:
        yield joined_results(batch)


def _side_by_side(
    work: Callable[[Strip, int], BlockResult], tasks: Iterator[tuple[Strip, int]], workers: int
) -> Iterator[BlockResult]:
    with _pool(workers) as pool:
        pending: list[Future[BlockResult]] = [pool.submit(work, *task) for task in islice(tasks, workers + 1)]
        while pending:
            yield pending.pop(0).result()
            pending += [pool.submit(work, *task) for task in islice(tasks, 1)]


@contextmanager
def _pool(workers: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a thread pool that drops what it has not begun when the work is stopped."""
    pool = ThreadPoolExecutor(workers)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def scan_to_files(
    scenario: Scenario,
    scan: Scan,
    cameras: ColourJob,
    folder: Path,
    epsg: int | None,
    view: TopView | None,
    timer: StageTimer,
) -> dict[str, Any]:
    """Render what the colours need, scan, and write the cloud and the previews; return the counts as JSON data."""
    from ...blender.cameras import layer_source

    with ExitStack() as stack:
        with timer.stage("images"):
            source = stack.enter_context(
                layer_source(cameras, progress=lambda share: timer.progress("images", share))
            )
        with timer.stage("scan"):
            task = ScanToFiles(scenario, scan, source, folder, epsg, view)
            for share in task.run():
                timer.progress("scan", share)
        return task.summary()


class ScanToFiles:
    """A scan into the cloud and the previews, a block at a time, so that its caller can show progress or stop it.

    Args:
        scenario: says which files are wanted.
        scan: see `make_scan`.
        source: of colours and layers.
        folder: where the files go.
        epsg: map coordinate system; None if unknown.
        view: raster for the previews; None without.
        rows: the materials' means, see `make_scan`.
    """

    def __init__(
        self,
        scenario: Scenario,
        scan: Scan,
        source: LayerSource,
        folder: Path,
        epsg: int | None = None,
        view: TopView | None = None,
        rows: Sequence[Material] | None = None,
    ) -> None:
        self.scan, self._threads = scan, scenario.scan.threads
        self.finish = make_finish(scenario, scan, source, rows)
        self.files = CloudFiles(scenario, folder, scan.target.origin, scan.path.typical_range, epsg, view)

    @property
    def counts(self) -> ScanCounts:
        """Return what was counted so far."""
        return self.files.counts

    def run(self) -> Generator[float, None, None]:
        """Scan; yield the share that is done after each block. The files are complete when the iteration ends."""
        total, done = len(self.scan.blocks()), 0
        with self.files.opened():
            for blocks in self.files.take(scan_blocks(self.scan, self._threads, self.finish)):
                done += blocks
                yield done / total

    def summary(self) -> dict[str, Any]:
        """Return the counts as JSON data."""
        return of_scan(self.scan) | self.files.summary() | {"rendered": self.finish.source.report}


def of_scan(scan: Scan) -> dict[str, Any]:
    """Return what is counted of a scan before it begins, as JSON data."""
    target = scan.target
    return {
        "triangles": target.triangles,
        "vertices": target.vertices,
        "caster": target.caster.name,
        "attenuation": scan.attenuation,
    }


def road_path(scenario: Scenario, geometry: RoadGeometry) -> ScanPath:
    """Return the scanner's path along a road."""
    return make_path(scenario.scan.platform, RoadGuide(geometry))


def top_view(geometry: RoadGeometry) -> TopView:
    """Return a raster that holds the whole swath."""
    origin = np.array(geometry.parameters.transform.translate)[:2]
    stations = np.linspace(0.0, geometry.length, 50)
    terrain = geometry.parameters.terrain
    reach = terrain.half_width if terrain else float(np.abs(geometry.offsets(stations)).max())
    plan, heading, _ = geometry.alignment.frame(stations)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    chord = plan[-1] - plan[0]
    normal = np.array([-chord[1], chord[0]]) / max(np.hypot(*chord), 1e-9)
    edges = np.concatenate([plan + reach * left, plan - reach * left])
    across = (edges - plan[0]) @ normal
    return TopView(plan[0] + origin, plan[-1] + origin, float(across.min()) - 2, float(across.max()) + 2)
