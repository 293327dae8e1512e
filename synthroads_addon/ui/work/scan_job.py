"""A scan of the open scene's road into a folder.

Where nothing is rendered the scene is read in the window's thread, and the rest needs a thread. Rendering needs the
main thread of a Blender: that is another one, which works on a copy of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from ...base.files import output_folder
from ...base.progress import StageTimer
from ...base.schema import canonical_json
from ...blender.cameras import material_layers
from ...blender.cameras.surfaces import scene_constants
from ...blender.files import save_scene
from ...blender.scene.evaluated import CopiedScene, scanned_scene_steps
from ...jobs.generate import Job as PipelineJob
from ...jobs.generate import check, check_not_empty, closing, file_names, opening
from ...jobs.road_files import write_road_files
from ...jobs.scan.files import ScanToFiles, make_scan, material_rows, may_render, road_path, top_view, wanted_layers
from ...materials.table import Material
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.colour.colour import LayerSource
from ...scenario.scenario import Scenario
from ...twin.formats import twin_file_names, write_twin
from .job import Aside, Report, Step, Work
from .rendered_scan import SavedScene, save_open_scene


@dataclass(frozen=True)
class RoadScan:
    """What is scanned, and where the files go.

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


@dataclass(frozen=True)
class Written:
    """What a scan has written: so many points into a folder."""

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
        measure = yield from (_saved(scan, folder, timer) if renders else _read(scan, timer))
        if "scene" in scenario.outputs:
            with timer.stage("scene file"):
                save_scene(folder / "scene.blend")

        def write(report: Report) -> int:
            return _write_files(scan, measure, _Output(folder, timer, report))

        points = yield Aside(write, "Rendering" if renders else "Scanning", _READ, 1.0)
    return Written(points, scan.target)


def _saved(scan: RoadScan, folder: Path, timer: StageTimer) -> Generator[Step, None, _Measure]:
    """Save a copy of the open file; return what has another Blender scan it."""
    with timer.stage("scene copy"):
        saved = save_open_scene(scan.scenario, scan.parameters, folder)
    yield Step(_READ)
    return lambda output: _scan_saved(saved, output)


def _scan_saved(saved: SavedScene, output: _Output) -> dict[str, Any]:
    done = saved.scan(output.report)
    output.timer.stages.update(done.stages)
    return done.counts


def _read(scan: RoadScan, timer: StageTimer) -> Generator[Step, None, _Measure]:
    """Read the open scene; return what scans it."""
    speed_factor = scan.scenario.scan.traffic_speed_factor
    with timer.stage("scene mesh"):
        steps = scanned_scene_steps(geometry=RoadGeometry(scan.parameters), speed_factor=speed_factor)
        copied = yield from _shares(steps)
    rows, constants = material_rows(copied.materials), scene_constants(copied.materials)
    # The materials' own: what is rendered takes the other way.
    lit = "rgb" in wanted_layers(scan.scenario) and scan.scenario.colour.mode == "lit"
    source = material_layers(scan.scenario.colour, constants, lit, scan.parameters.environment, scan.scenario.seed)
    return lambda output: _scan_copied(scan, copied, (rows, source), output)


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
    scan: RoadScan, copied: CopiedScene, materials: tuple[list[Material], LayerSource], output: _Output
) -> dict[str, Any]:
    """Scan what was read."""
    scenario, parameters, timer, (rows, source) = scan.scenario, scan.parameters, output.timer, materials
    geometry = RoadGeometry(parameters)
    with timer.stage("scene mesh"):
        scene = copied.put_together()
    check_not_empty(scene)
    output.report(0.02)
    with timer.stage("caster"):
        path = road_path(scenario, geometry)
        prepared = make_scan(scenario, scene, path, parameters.environment, rows, parameters.materials)
    del scene
    output.report(0.05)
    view = top_view(geometry) if "previews" in scenario.outputs else None
    task = ScanToFiles(scenario, prepared, source, output.folder, parameters.metadata.epsg, view, rows)
    with timer.stage("scan"):
        for share in task.run():
            output.report(0.05 + 0.95 * share)
    return task.summary()


def _write_files(scan: RoadScan, measure: _Measure, output: _Output) -> int:
    """Write all files; return the number of points. Runs in a thread: it touches no data of Blender."""
    scenario, parameters = scan.scenario, scan.parameters
    write_road_files(output.folder, scenario.outputs, parameters, RoadGeometry(parameters), scenario)
    if scenario.twin:
        with output.timer.stage("twin"):
            write_twin(parameters, output.folder, scenario.twin, scenario.settings().tolerance)
    report = opening()
    if set(scenario.outputs) & {"cloud", "previews"}:
        report["counts"] = measure(output)
    points = report.get("counts", {}).get("points", 0)
    report |= closing(scenario, output.timer)
    (output.folder / "report.json").write_text(canonical_json(report), encoding="utf-8")
    return int(points)
