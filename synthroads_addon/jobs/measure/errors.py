"""Errors of a job's points against the analytic road, the converged footprint, and colours rendered as well as can be.

- *height*: largest vertical distance of 100,000 random points of the road's mesh from the analytic surface;
- *beam*: position and intensity of first returns against those of the same pulses with 61 rays among all plants, 95th
  percentile; share of the first returns whose class is another; and how many points fewer there are in the file;
- *relief*: distance of the shifted points from those that all octaves shift with full strength, 95th percentile;
- *colour*: CIEDE2000 from the true colours, and the largest root mean square error of a material layer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...blender.cameras import HAS_RETURN_CAMERA, ColourJob, layer_source
from ...cloud.points import PointBlock
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.beam import RINGS
from ...scanning.colour.colour import FROM_MATERIAL, MATERIAL_LAYERS, NEARBY, LayerValues, sample_targets, source_name
from ...scanning.colour.difference import ciede2000, lab
from ...scanning.relief import adjusted, micro_relief
from ...scanning.samples import middle
from ...scanning.scan import BlockResult, Scan, joined_results, scan_block
from ...scanning.scene.motion import ScannedScene
from ...scanning.scene.target import Target
from ...scenario.colour import image_scale
from ...scenario.scenario import Scenario
from ..scan.files import material_rows
from .mesh_errors import mesh_height_errors
from .tradeoff import DENSEST, TRUE_SAMPLES, Knob

LAYERS = frozenset({"rgb", *MATERIAL_LAYERS})
"""Colours and all layers, which the rows on colours ask for."""
CONVERGED = max(RINGS)
"""Rays per pulse of the footprint that counts as truth."""
_OCTAVES = 8
"""Of the micro-relief that counts as truth."""
_TENTH = 10
"""One in so many points is compared with whole light paths."""
_MIDDLE = 0.2
"""Share of each strip that the densest images are rendered of."""


@dataclass(frozen=True)
class Sample:
    """What a row's errors are taken of.

    Attributes:
        scan: of stretches of the path.
        result: its points as measured, with normals and materials, and where they were seen.
        values: their colours and layers; None without.
        written: points in the file.
        truth: returns the scan of the same stretches with the converged footprint among all plants, or None if `scan`
            is that itself. It may build that scene in place of the one scanned.
    """

    scenario: Scenario
    scene: ScannedScene
    scan: Scan
    result: BlockResult
    values: LayerValues | None
    written: int
    truth: Callable[[], Scan | None]


def errors_of(knob: Knob, sample: Sample, parameters: RoadParameters, job: ColourJob) -> dict[str, Any]:
    """Return ``errors`` by name of `tradeoff.ROW_TITLES`, and of colours ``colour_truth`` and ``errors_by_source``.

    The former is what they were compared with, the latter their errors by what gave them to the points.
    """
    errors: dict[str, float] = {}
    more: dict[str, Any] = {}
    if "height" in knob.errors:
        heights = mesh_height_errors(sample.scene.static, RoadGeometry(parameters))
        errors["height_mm"] = 1e3 * float(np.abs(heights).max())
    if "relief" in knob.errors:
        errors["relief_mm"] = _relief_error(sample)
    if "colour" in knob.errors:
        truth, more["colour_truth"], chosen = _true_colours(knob, sample, job)
        of_all, more["errors_by_source"] = _compared(sample.values, truth, chosen)
        errors |= of_all
    if "beam" in knob.errors:  # last, as its truth may be another scene
        errors |= _beam_errors(sample)
    return {"errors": {name: round(error, 6) for name, error in errors.items()}, **more}


def _scanned(scan: Scan) -> BlockResult:
    return joined_results([scan_block(scan, *block) for block in scan.blocks()])


def _beam_errors(sample: Sample) -> dict[str, float]:
    """Compare first returns with those of the converged footprint, pulse by pulse (told by their time)."""
    mine, converged = sample.result.points, sample.truth()
    truth = mine if converged is None else _scanned(converged).points
    return beam_errors(*paired(mine, truth)) | {"density_percent": 100.0 * (1.0 - sample.written / len(truth))}


def paired(mine: PointBlock, truth: PointBlock) -> tuple[PointBlock, PointBlock]:
    """Return the first returns of the pulses that both have, in one order."""
    a, b = (points.select(points.return_number == 1) for points in (mine, truth))
    _times, first, second = np.intersect1d(a.gps_time, b.gps_time, return_indices=True)
    return a.select(first), b.select(second)


def beam_errors(mine: PointBlock, truth: PointBlock) -> dict[str, float]:
    """Return the errors of first returns against those of the same pulses, see `paired`; by name of the table."""
    return {
        "position_mm": 1e3 * float(np.quantile(np.linalg.norm(mine.xyz - truth.xyz, axis=1), 0.95)),
        "intensity_percent": 100.0 * float(np.quantile(np.abs(mine.intensity / truth.intensity - 1.0), 0.95)),
        "labels_percent": 100.0 * float(np.mean(mine.class_id != truth.class_id)),
    }


def fast_target(scan: Scan, scene: ScannedScene) -> Target:
    """Return a fast target for the truth."""
    from ...blender.casters import make_caster

    if scan.target.caster.name == "embree":
        return scan.target
    return Target(scene, lambda mesh: make_caster("auto", mesh))


def _relief_error(sample: Sample) -> float:
    """Return how far the points' micro-relief is from the finest, mm, 95th percentile."""
    scan, seen, points = sample.scan, sample.result.seen, sample.result.points
    assert seen is not None
    relief = micro_relief(scan.target.materials, material_rows(scan.target.materials))
    mine, finest = (
        adjusted(points, seen.position, relief, strength, sample.scenario.seed, octaves).xyz
        for strength, octaves in (
            (sample.scenario.scan.relief, sample.scenario.settings().relief_octaves),
            (1.0, _OCTAVES),
        )
    )
    return 1e3 * float(np.quantile(np.linalg.norm(mine - finest, axis=1), 0.95))


def _true_colours(
    knob: Knob, sample: Sample, job: ColourJob
) -> tuple[LayerValues, str, NDArray[np.intp]]:
    """Return colours and layers rendered as well as can be, what they are, and which points (K,) they are of."""
    seen = sample.result.seen
    assert seen is not None
    colour = job.scenario.to_dict() | {"source": "returns", "lighting": "direct", "samples": None}
    chosen, name = np.arange(len(seen)), "a pixel per return"
    if knob.whole_paths:
        colour |= {"lighting": "path", "samples": TRUE_SAMPLES}
        chosen, name = chosen[::_TENTH], f"a pixel per return with {TRUE_SAMPLES} samples of whole light paths"
    elif not HAS_RETURN_CAMERA:
        scale = image_scale(job.path.typical_range)
        densest = {name: scale * length for name, length in DENSEST.items()}
        colour |= {"source": "images"} | densest
        part = middle(job.path, _MIDDLE)  # type: ignore[arg-type]
        job = replace(job, path=part)
        within = [(strip.start_time, strip.start_time + strip.duration) for strip in part.strips]
        chosen = np.flatnonzero(np.any([(low <= seen.time) & (seen.time <= high) for low, high in within], axis=0))
        distance, spacing = densest["ground_sampling_distance"], densest["image_spacing"]
        name = f"images of {distance:g} m pixels every {spacing:g} m, of the points that these show"
    with layer_source(replace(job, scenario=job.scenario.from_dict(colour), wanted=LAYERS)) as source:
        of = seen.select(chosen)
        truth = sample_targets(source, of, LAYERS)
    return truth, name, chosen


def _compared(
    values: LayerValues | None, truth: LayerValues, chosen: NDArray[np.intp]
) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Return the errors of colours and layers, of all points and by what gave them to these."""
    assert values is not None
    known = ~np.isin(truth.source, (FROM_MATERIAL, NEARBY))
    mine: dict[str, Any] = {name: array[chosen][known] for name, array in values.arrays.items()}
    true: dict[str, Any] = {name: array[known] for name, array in truth.arrays.items()}
    difference = ciede2000(lab(mine["rgb"]), lab(true["rgb"]))
    apart = [mine[name].astype(np.float64) - true[name] for name in MATERIAL_LAYERS]
    squares = [np.square(error).reshape(len(difference), -1) for error in apart]

    def of(rows: NDArray[np.bool_]) -> dict[str, float]:
        return {
            "colour_median": round(float(np.median(difference[rows])), 6),
            "colour_95": round(float(np.quantile(difference[rows], 0.95)), 6),
            "layers_rmse": round(max(float(np.sqrt(square[rows].mean())) for square in squares), 6),
        }

    names = np.array([source_name(number) for number in range(256)])[values.source[chosen][known]]
    return of(np.ones(len(difference), bool)), {str(name): of(names == name) for name in np.unique(names)}
