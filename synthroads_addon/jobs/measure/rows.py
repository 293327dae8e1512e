"""Rows of the trade-off: one setting, the time and memory of the whole job, and its errors against truth."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...base.machine import machine
from ...base.progress import StageTimer, peak_memory_mb
from ...blender.cameras import HAS_RETURN_CAMERA, layer_source, takes_returns
from ...blender.cameras.returns import RENDERINGS_KEPT
from ...blender.services import BlenderServices
from ...road.geometry import RoadGeometry
from ...sampling.road import sample_road
from ...scanning.beam import RINGS
from ...scanning.colour.colour import LayerSource, LayerValues, Targets, shares_by_source
from ...scanning.colour.request import LayerRequest
from ...scanning.plan import ScanPlan
from ...scanning.record import RETURNS_AT_ONCE, record_as_measured
from ...scanning.samples import spread
from ...scanning.scan import joined_results
from ...scanning.scene.motion import ScannedScene
from ...scenario.scenario import Scenario, load_scenario
from ..road_scene import build_model, plan_road_scan, read_scene
from ..scan.files import CloudFiles, ScanCounts, record_to_files
from .errors import CONVERGED, LAYERS, Sample, errors_of
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
    road = RoadGeometry(sample_road(scenario.road, scenario.seed))
    start = time.process_time()
    build_model(scenario, road)
    scene = read_scene(scenario, road)
    built = time.process_time()
    plan = plan_road_scan(scenario, road, scene)
    ready = time.process_time()
    whole = load_scenario(scenario_name).vegetation_detail or 1.0
    cost, errors = _run(scenario, knob, road, scene, plan, whole)
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
        "triangles": plan.target.triangles,
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
    scenario: Scenario, knob: str, road: RoadGeometry, scene: ScannedScene, plan: ScanPlan, plants: float
) -> tuple[_Cost, dict[str, Any]]:
    """Do the job on stretches of the path; return what it costs and the errors.

    Args:
        plants: share of the plants that the truth has.
    """
    coloured = "colour" in KNOBS[knob].errors
    request = plan.request
    assert request is not None
    if coloured:
        request = replace(request, wanted=LAYERS)
    path = spread(plan.path, _STRETCHES, _SECONDS)
    part = replace(plan, path=path)
    result = joined_results(record_as_measured(part))
    start = time.process_time()
    with layer_source(request) as source:
        if coloured and result.seen is not None:
            _coloured(source, result.seen.select(slice(0, _FEW)))
        prepared, rendered = time.process_time(), dict(source.report)
        counts = _count_points_in_file(scenario, part, source)
        done = time.process_time()
        peak = peak_memory_mb()
        values = _coloured(source, result.seen) if coloured and result.seen is not None else None
    seconds, images = done - prepared, prepared - start
    restarts = 0
    if coloured and takes_returns(request.settings):  # stretches are too few for the renderer to begin anew
        restarts = int(counts.points / path.share / RETURNS_AT_ONCE / RENDERINGS_KEPT)
    cost = _Cost(
        image_seconds=images,
        scan_seconds=seconds / path.share + restarts * images,
        rays_per_second=round(counts.rays / seconds),
        peak_memory_mb=peak,
        rendered=rendered,
        shares=shares_by_source(counts.by_source),
    )

    def truth() -> ScanPlan | None:
        return _truth(scenario, road, part, plants)

    sample = Sample(scene, part, request, result, values, counts.points, truth)
    return cost, errors_of(KNOBS[knob], sample, road)


def _truth(scenario: Scenario, road: RoadGeometry, part: ScanPlan, plants: float) -> ScanPlan | None:
    """Return the plan that counts as true, see `Sample.truth`; builds the road anew if it lacks plants."""
    detail = scenario.settings().vegetation_detail
    if detail == plants and part.rays_per_pulse == CONVERGED:
        return None
    fast = scenario.model_copy(
        update={"scan": scenario.scan.model_copy(update={"caster": "auto"}), "vegetation_detail": plants}
    )
    if detail != plants:
        build_model(fast, road)
    elif part.target.caster.name == "embree":
        return replace(part, rings=RINGS[CONVERGED])
    plan = plan_road_scan(fast, road, read_scene(fast, road))
    return replace(plan, path=part.path, rings=RINGS[CONVERGED])


def _coloured(source: LayerSource, seen: Targets) -> LayerValues:
    return source.sample(seen.position, seen.scanner, seen.normal, seen.material, seen.time, LAYERS)


class _OpenedLayers(BlenderServices):
    """Blender's services, with a source of layers that is open already."""

    def __init__(self, source: LayerSource) -> None:
        self._source = source

    def layers(
        self, request: LayerRequest, progress: Callable[[float], None]
    ) -> AbstractContextManager[LayerSource]:
        """Return the open source."""
        return nullcontext(self._source)


def _count_points_in_file(scenario: Scenario, part: ScanPlan, source: LayerSource) -> ScanCounts:
    """Scan into a file that is thrown away; return what was counted."""
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        files = CloudFiles(scenario, Path(folder), part.target.origin, part.path.typical_range)
        record_to_files([replace(part, services=_OpenedLayers(source))], files, StageTimer())
    return files.counts
