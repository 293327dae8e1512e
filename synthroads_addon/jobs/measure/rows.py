"""Rows of the trade-off: one setting, the time and memory of the whole job, and its errors against truth."""

import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.machine import machine
from ...base.progress import peak_memory_mb
from ...blender.cameras import HAS_RETURN_CAMERA, layer_source, renders_returns
from ...blender.cameras.returns import RENDERINGS_KEPT
from ...blender.services import BlenderServices
from ...road.geometry import RoadGeometry
from ...sampling.road import sample_road
from ...scanning.beam import RINGS
from ...scanning.colour.colour import MATERIAL_LAYERS, LayerValues, sample_points, shares_by_source
from ...scanning.colour.request import LayerRequest
from ...scanning.plan import ScanPlan
from ...scanning.platforms.stretches import spread_stretches
from ...scanning.record import RETURNS_AT_ONCE, record_as_measured, scan_blocks
from ...scanning.relief.micro_relief import micro_relief
from ...scanning.scan import BlockResult, join_results
from ...scanning.scene.height_errors import mesh_height_errors
from ...scenario.scenario import load_scenario
from ..open_scene import RoadScene
from ..scan.plan import Site
from .errors import (
    CONVERGED,
    FINEST,
    beam_errors,
    errors_by_source,
    relief_errors,
    render_layers,
    shift_points,
    truest_settings,
)
from .tradeoff import KNOBS, TRUE_SAMPLES, Knob, row_scenario

_STRETCHES, _SECONDS = 16, 0.08
"""Stretches of each strip that are scanned, spread evenly over it, and the duration of each."""
_QUIET = ("scan.noise.range_sigma=0", 'outputs=["cloud"]')
_TENTH = 10
"""One in so many points is compared with whole light paths."""
LAYERS = frozenset({"rgb", *MATERIAL_LAYERS})
"""Colours and all layers, which the rows on colours ask for."""
_FEW = 64
"""Points that bring the scene into a renderer."""


def measure_row(scenario_name: str, knob: str, value: Any) -> dict[str, Any]:
    """Measure time, memory and errors of one knob value of the trade-off; return them, or why it can't be done here.

    Times are processor seconds, which other work on the machine hardly touches: building the model, building the
    caster's tree, rendering the images, and the rest of the job - scan, colours, relief, thinning out and the file -
    projected from stretches of the path. Errors: see
    `jobs.measure.errors`; height is the largest vertical distance of 100,000 random points of the road's mesh from the
    analytic surface, and points in the file count for the density.
    """
    scenario = row_scenario(scenario_name, knob, value, _QUIET)
    if scenario.colour.source == "returns" and not HAS_RETURN_CAMERA:
        return {"knob": knob, "value": value, "left_out": "a pixel per return needs Blender 5.0 or newer"}
    road = RoadGeometry(sample_road(scenario.road, scenario.seed))
    start = time.process_time()
    road_scene = RoadScene.of(scenario, road)
    road_scene.build()
    scene = road_scene.read()
    time_built = time.process_time()
    plan = road_scene.plan()
    time_ready = time.process_time()
    costs, sample = _measure_stretches(road_scene.site, KNOBS[knob], plan)
    errors: dict[str, float] = {}
    details: dict[str, Any] = {}
    if "relief" in KNOBS[knob].errors:
        errors["relief_mm"] = 1e3 * _relief_error(sample)
    if "colour" in KNOBS[knob].errors:
        errors_of_colours, details = _colour_errors(KNOBS[knob], sample)
        errors |= errors_of_colours
    if "height" in KNOBS[knob].errors:
        errors["height_mm"] = 1e3 * float(np.abs(mesh_height_errors(scene.static, road)).max())
    if "beam" in KNOBS[knob].errors:  # last, as its truth may be another scene
        plants = load_scenario(scenario_name).vegetation_detail or 1.0
        errors |= _beam_errors(sample, _true_plan(road_scene, sample.plan, plants))
    return {
        "knob": knob,
        "value": value,
        "seconds": round(time_ready - start + costs["image_seconds"] + costs["scan_seconds"], 3),
        "model_seconds": round(time_built - start, 3),
        "caster_seconds": round(time_ready - time_built, 3),
        "triangles": plan.target.triangles,
        "kernels": plan.summary()["kernels"],
        "machine": machine({"Blender": sys.modules["bpy"].app.version_string}),
        **{name: round(cost, 3) if isinstance(cost, float) else cost for name, cost in costs.items()},
        "errors": {name: round(error, 6) for name, error in errors.items()},
        **details,
    }


@dataclass(frozen=True)
class StretchPoints:
    """Points of short stretches of a path, from which a row's errors are taken.

    Attributes:
        plan: of the stretches.
        request: for the colours and layers of all of the path.
        result: the points as measured, with normals and materials, and where they were seen.
        values: their colours and layers; None without.
        written: points in the file.
    """

    plan: ScanPlan
    request: LayerRequest
    result: BlockResult
    values: LayerValues | None
    written: int


def _measure_stretches(site: Site, knob: Knob, plan: ScanPlan) -> tuple[dict[str, Any], StretchPoints]:
    """Run the job on stretches of the path; return projected costs after the caster is built, and the points.

    Returns:
        ``image_seconds`` before the first point, and ``images`` and ``megapixels`` that are rendered then;
        ``scan_seconds`` from there to the file, of the whole path, and ``rays_per_second`` of that;
        ``peak_memory_mb``; ``shares`` of the points by the source of their colour.
    """
    request, is_coloured = plan.layers.request, "colour" in knob.errors
    assert request is not None
    if is_coloured:
        request = replace(request, names=LAYERS)
    path = spread_stretches(plan.path, _STRETCHES, _SECONDS)
    stretch_plan = replace(plan, emission=replace(plan.emission, path=path))
    result = join_results(record_as_measured(stretch_plan))
    start = time.process_time()
    with layer_source(request) as source, tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        if is_coloured and result.seen is not None:
            sample_points(source, result.seen.select(slice(0, _FEW)), LAYERS)
        time_prepared, render_report = time.process_time(), dict(source.report)
        files = site.files(Path(folder), stretch_plan.target.origin)
        with files.open():
            for block in scan_blocks(stretch_plan, source):
                files.write(block)
        time_done, peak_memory, counts = time.process_time(), peak_memory_mb(), files.counts
        values = sample_points(source, result.seen, LAYERS) if is_coloured and result.seen is not None else None
    image_seconds, restarts = time_prepared - start, 0
    if is_coloured and renders_returns(request.settings):  # stretches are too few for the renderer to begin anew
        restarts = int(counts.points / path.share / RETURNS_AT_ONCE / RENDERINGS_KEPT)
    costs = {
        "image_seconds": image_seconds,
        "scan_seconds": (time_done - time_prepared) / path.share + restarts * image_seconds,
        "rays_per_second": round(counts.rays / (time_done - time_prepared)),
        "peak_memory_mb": peak_memory,
        "images": render_report.get("images", 0),
        "megapixels": render_report.get("pixels", 0) / 1e6,
        "shares": shares_by_source(counts.by_source),
    }
    return costs, StretchPoints(stretch_plan, request, result, values, counts.points)


def _true_plan(road_scene: RoadScene, stretch_plan: ScanPlan, plant_share: float) -> ScanPlan | None:
    """Return the plan of the same stretches with 61 rays per pulse among all plants; None if it is that already.

    All of these rays are cast. The road is built anew, in place of the one scanned, if it lacks plants.

    Args:
        road_scene: that was scanned.
        stretch_plan: the plan of the stretches.
        plant_share: share of the plants that the truth has.
    """
    detail = road_scene.scenario.settings().vegetation_detail
    if detail == plant_share and stretch_plan.rays_per_pulse == CONVERGED and not stretch_plan.spares:
        return None
    if detail == plant_share and stretch_plan.target.caster.name == "embree":
        return replace(stretch_plan, emission=replace(stretch_plan.emission, rings=RINGS[CONVERGED], ground=None))
    scan = road_scene.scenario.scan.model_copy(update={"caster": "auto"})
    scenario = road_scene.scenario.model_copy(update={"scan": scan, "vegetation_detail": plant_share})
    true_scene = RoadScene(scenario, road_scene.road, road_scene.inputs)
    if detail != plant_share:
        true_scene.build()
    plan = true_scene.plan()
    emission = replace(plan.emission, path=stretch_plan.path, rings=RINGS[CONVERGED], ground=None)
    return replace(plan, emission=emission)


def _beam_errors(sample: StretchPoints, plan: ScanPlan | None) -> dict[str, float]:
    """Return errors of first returns against a plan of the truth: position (mm), intensity, labels, density (%)."""
    measured = sample.result.points
    truth = measured if plan is None else join_results(record_as_measured(plan)).points
    errors = beam_errors([measured], [truth])
    return {
        "position_mm": 1e3 * errors["position"][0],
        "intensity_percent": 100.0 * errors["intensity"][0],
        "labels_percent": 100.0 * errors["labels"][0],
        "density_percent": 100.0 * (1.0 - sample.written / len(truth)),
    }


def _relief_error(sample: StretchPoints) -> float:
    """Return the points' 95th percentile distance from the finest micro-relief at full strength, m."""
    plan, materials = sample.plan, sample.plan.target.materials
    micro = plan.relief.micro or micro_relief(materials, BlenderServices().materials(materials))
    relief = replace(plan.relief, micro=micro)
    measured = shift_points([sample.result], replace(plan, relief=relief), plan.relief.octaves)
    truth = shift_points([sample.result], replace(plan, relief=replace(relief, strength=1.0)), FINEST)
    return relief_errors(measured, truth)["relief"][0]


def _colour_errors(knob: Knob, sample: StretchPoints) -> tuple[dict[str, float], dict[str, Any]]:
    """Return colour and layer errors against the truest rendering, and details of the comparison.

    That is ``colour_truth``, what they were compared with, and ``errors_by_source``, their errors by what gave them to
    the points.
    """
    seen_points, request = sample.result.seen, sample.request
    assert seen_points is not None
    assert sample.values is not None
    settings, rows = truest_settings(request), np.arange(len(seen_points))
    name = "a pixel per return" if HAS_RETURN_CAMERA else "the materials' nodes at the returns"
    if knob.whole_paths:
        settings = replace(settings, lighting="path", samples=TRUE_SAMPLES)
        rows, name = rows[::_TENTH], f"a pixel per return with {TRUE_SAMPLES} samples of whole light paths"
    (truth,) = render_layers(replace(request, settings=settings, names=LAYERS), [seen_points.select(rows)])
    arrays = {name: array[rows] for name, array in sample.values.arrays.items()}
    errors, by_source = errors_by_source(LayerValues(arrays, sample.values.source[rows]), truth)
    return errors, {"colour_truth": name, "errors_by_source": by_source}
