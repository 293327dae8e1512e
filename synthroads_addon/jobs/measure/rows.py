"""Rows of the trade-off: one setting, the time and memory of the whole job, and its errors against truth."""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...base.machine import machine
from ...base.progress import peak_memory_mb
from ...blender.cameras import HAS_RETURN_CAMERA, layer_source, takes_returns
from ...blender.cameras.returns import RENDERINGS_KEPT
from ...blender.model.build import build_road
from ...blender.scene.evaluated import scanned_scene
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...sampling.road import sample_road
from ...scanning.beam import RINGS
from ...scanning.colour.colour import LayerSource, sample_targets, shares_by_source
from ...scanning.samples import spread
from ...scanning.scan import BlockResult, Scan, joined_results, scan_block
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario, load_scenario
from ..scan.files import RETURNS_AT_ONCE, ScanToFiles, colour_job, make_scan, road_path
from .errors import CONVERGED, LAYERS, Sample, errors_of, fast_target
from .tradeoff import KNOBS, row_scenario

_STRETCHES, _SECONDS = 16, 0.08
"""Stretches of each strip that are scanned, spread evenly over it, and the duration of each."""
_QUIET = ("scan.noise.range_sigma=0", 'outputs=["cloud"]')
_FEW = 64
"""Points that bring the scene into a renderer."""


def measure_row(scenario_name: str, knob: str, value: Any) -> dict[str, Any]:
    """Measure one row of the trade-off; it says why if this Blender can't do it.

    Times are processor seconds, which other work on the machine hardly touches: building the model, building the
    caster's tree, rendering the images, and the rest of the job - scan, colours, relief, thinning out and the file -
    projected from stretches of the path. Errors: see `jobs.measure.errors`.
    """
    scenario = row_scenario(scenario_name, knob, value, _QUIET)
    if scenario.colour.source == "returns" and not HAS_RETURN_CAMERA:
        return {"knob": knob, "value": value, "left_out": "a pixel per return needs Blender 5.0 or newer"}
    parameters = sample_road(scenario.road, scenario.seed)
    geometry = RoadGeometry(parameters)
    start = time.process_time()
    settings = scenario.settings()
    build_road(parameters, settings.tolerance, settings.vegetation_detail)
    scene = scanned_scene(geometry=geometry, speed_factor=scenario.scan.traffic_speed_factor)
    built = time.process_time()
    scan = make_scan(scenario, scene, road_path(scenario, geometry), parameters.environment)
    ready = time.process_time()
    whole = load_scenario(scenario_name).vegetation_detail or 1.0
    cost, errors = _run(scenario, knob, parameters, scene, scan, whole)
    return {
        "knob": knob,
        "value": value,
        "seconds": round(ready - start + cost.image_seconds + cost.scan_seconds, 3),
        "model_seconds": round(built - start, 3),
        "caster_seconds": round(ready - built, 3),
        "image_seconds": round(cost.image_seconds, 3),
        "scan_seconds": round(cost.scan_seconds, 3),
        "rays_per_second": cost.rays_per_second,
        "peak_memory_mb": cost.peak_memory_mb,
        "triangles": scan.target.triangles,
        "images": cost.rendered.get("images", 0),
        "megapixels": round(cost.rendered.get("pixels", 0) / 1e6, 3),
        "shares": cost.shares,
        "machine": machine({"Blender": sys.modules["bpy"].app.version_string}),
        **errors,
    }


@dataclass(frozen=True)
class _Cost:
    """What the job after the caster costs.

    Attributes:
        image_seconds: before the first point.
        scan_seconds: from there to the file, of the whole path.
        rays_per_second: of that.
        rendered: as a report has it, before the first point.
        shares: of the points by the source of their colour.
    """

    image_seconds: float
    scan_seconds: float
    rays_per_second: int
    peak_memory_mb: float | None
    rendered: dict[str, Any]
    shares: dict[str, float]


def _run(
    scenario: Scenario, knob: str, parameters: RoadParameters, scene: ScannedScene, scan: Scan, plants: float
) -> tuple[_Cost, dict[str, Any]]:
    """Do the job on stretches of the path; return what it costs and the errors.

    Args:
        plants: share of the plants that the truth has.
    """
    coloured = "colour" in KNOBS[knob].errors
    job = colour_job(scenario, scan, scene, parameters.environment)
    if coloured:
        job = replace(job, wanted=LAYERS)
    path = spread(scan.path, _STRETCHES, _SECONDS)
    part = replace(scan, path=path)
    result = _measured(part)
    start = time.process_time()
    with layer_source(job) as source:
        if coloured and result.seen is not None:
            sample_targets(source, result.seen.select(slice(0, _FEW)), LAYERS)
        prepared, rendered = time.process_time(), dict(source.report)
        task = _to_file(scenario, part, source)
        done = time.process_time()
        peak = peak_memory_mb()
        values = sample_targets(source, result.seen, LAYERS) if coloured and result.seen is not None else None
    seconds, images = done - prepared, prepared - start
    restarts = 0
    if coloured and takes_returns(scenario.colour):  # stretches are too few for the renderer to begin anew
        restarts = int(task.counts.points / path.share / RETURNS_AT_ONCE / RENDERINGS_KEPT)
    cost = _Cost(
        image_seconds=images,
        scan_seconds=seconds / path.share + restarts * images,
        rays_per_second=round(task.counts.rays / seconds),
        peak_memory_mb=peak,
        rendered=rendered,
        shares=shares_by_source(task.counts.by_source),
    )

    def truth() -> Scan | None:
        return _truth(scenario, parameters, scene, part, plants)

    sample = Sample(scenario, scene, part, result, values, task.counts.points, truth)
    return cost, errors_of(KNOBS[knob], sample, parameters, job)


def _truth(
    scenario: Scenario, parameters: RoadParameters, scene: ScannedScene, part: Scan, plants: float
) -> Scan | None:
    """Return the scan that counts as true, see `Sample.truth`; builds the road anew if it lacks plants."""
    settings = scenario.settings()
    if settings.vegetation_detail == plants:
        if part.rays_per_pulse == CONVERGED:
            return None
        return replace(part, rings=RINGS[CONVERGED], target=fast_target(part, scene), targets=False)
    build_road(parameters, settings.tolerance, plants)
    geometry = RoadGeometry(parameters)
    scene = scanned_scene(geometry=geometry, speed_factor=scenario.scan.traffic_speed_factor)
    data = scenario.to_dict()
    data["scan"] |= {"caster": "auto"}
    scan = make_scan(Scenario.from_dict(data), scene, part.path, parameters.environment)
    return replace(scan, rings=RINGS[CONVERGED], targets=False)


def _measured(part: Scan) -> BlockResult:
    """Return the points, with all that errors are taken of, as they are before anything is done to them."""
    part = replace(part, targets=True, wanted=part.wanted | {"normal", "material"})
    return joined_results([scan_block(part, *block) for block in part.blocks()])


def _to_file(scenario: Scenario, part: Scan, source: LayerSource) -> ScanToFiles:
    """Scan into a file that is thrown away."""
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        task = ScanToFiles(scenario, part, source, Path(folder))
        for _ in task.run():
            pass
    return task
