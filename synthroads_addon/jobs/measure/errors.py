"""Errors of points against truth: beam, micro-relief and colours, each with an upper confidence bound.

- *beam*: position and intensity of first returns against those of the same pulses with 61 rays among all plants, 95th
  percentile; share of the first returns whose class is another; and how many points are missing or too many;
- *height*: distance of a road's mesh from the analytic surface that it was made from;
- *relief*: distance of the shifted points from those that all octaves shift, 95th percentile;
- *colour*: CIEDE2000 from colours rendered as well as can be, 95th percentile;
- *layers*: the largest root mean square error of a material layer.

Points come in parts, short stretches of a path: values within a part are alike, so that the confidence of an error
follows from the number of parts. Kinds, units and names are those of `scenario.tolerance.KINDS`.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...base.arrays import Bool, Float
from ...base.random_streams import quantile_bound, ratio_bound
from ...blender.cameras import HAS_RETURN_CAMERA, layer_source
from ...cloud.points import PointBlock
from ...scanning.beam import RINGS
from ...scanning.colour.colour import (
    MATERIAL_LAYERS,
    ColourSettings,
    ColourSource,
    LayerValues,
    SeenPoints,
    sample_points,
    source_name,
)
from ...scanning.colour.difference import colour_difference, known_rows, squared_error
from ...scanning.colour.request import LayerRequest
from ...scanning.plan import ScanPlan
from ...scanning.relief.micro_relief import BeamEnds, shift_by_relief
from ...scanning.scan import BlockResult

Errors = dict[str, tuple[float, float]]
"""Kind of error -> estimate, and its upper bound with the confidence `base.random_streams.LEVEL`."""

QUANTILE = 0.95
CONVERGED = max(RINGS)
"""Rays per pulse of the footprint that counts as truth."""
FINEST = 8
"""Octaves of the micro-relief that counts as truth."""


def match_pulses(measured: PointBlock, truth: PointBlock) -> tuple[PointBlock, PointBlock]:
    """Return the first returns of pulses in both clouds, in the same order, matched by GPS time."""
    measured_returns, true_returns = (points.select(points.return_number == 1) for points in (measured, truth))
    _, measured_rows, true_rows = np.intersect1d(measured_returns.gps_time, true_returns.gps_time, return_indices=True)
    return measured_returns.select(measured_rows), true_returns.select(true_rows)


def beam_errors(measured: Sequence[PointBlock], truth: Sequence[PointBlock]) -> Errors:
    """Return a cloud's errors against the truth: position (m), intensity, labels, density (shares), with bounds."""
    pairs = [match_pulses(a, b) for a, b in zip(measured, truth, strict=True)]
    position = [np.linalg.norm(a.xyz - b.xyz, axis=1) for a, b in pairs]
    intensity = [np.abs(a.intensity / b.intensity - 1.0) for a, b in pairs]
    wrong_labels = np.array([float((a.class_id != b.class_id).sum()) for a, b in pairs])
    counts = np.array([float(len(a)) for a, _ in pairs])
    point_counts, true_counts = (np.array([float(len(block)) for block in blocks]) for blocks in (measured, truth))
    deficit, surplus = (
        ratio_bound(true_counts - point_counts, true_counts, "density"),
        ratio_bound(point_counts - true_counts, true_counts, "density"),
    )
    return {
        "position": quantile_bound(position, QUANTILE, "position"),
        "intensity": quantile_bound(intensity, QUANTILE, "intensity"),
        "labels": ratio_bound(wrong_labels, counts, "labels"),
        "density": (max(deficit[0], surplus[0]), max(deficit[1], surplus[1])),
    }


def shift_points(results: Sequence[BlockResult], plan: ScanPlan, octaves: int) -> list[Float]:
    """Return the points (N, 3) of each part, moved along their normals by the heights of a plan's micro-relief, m."""
    assert plan.relief.micro is not None
    strength, seed = plan.relief.strength, plan.reflection.surface_seed
    shift = partial(shift_by_relief, relief=plan.relief.micro, strength=strength, seed=seed)
    # As if seen at a right angle: how far a slanting beam carries a height is not the relief's error.
    points_and_places = (
        (result.points.with_arrays({"incidence_deg": np.zeros(len(result.points), np.float32)}), result.seen)
        for result in results
        if result.seen is not None
    )
    return [
        shift(points, BeamEnds(place.position, place.normal), octaves=octaves).xyz
        for points, place in points_and_places
    ]


def relief_errors(measured: Sequence[Float], truth: Sequence[Float]) -> Errors:
    """Return the 95th percentile of distances between two sets of shifted points (N, 3), m, with its upper bound."""
    parts = [np.linalg.norm(a - b, axis=1) for a, b in zip(measured, truth, strict=True)]
    return {"relief": quantile_bound(parts, QUANTILE, "relief")}


def truest_settings(request: LayerRequest) -> ColourSettings:
    """Return a request's colour settings with the most accurate source, under direct light and one sample.

    That is a pixel per return where Blender has it, else the materials' nodes at the returns.
    """
    source: ColourSource = "returns" if HAS_RETURN_CAMERA else "nodes"
    return replace(request.settings, lighting="direct", samples=1, engine="cycles", source=source)


def render_layers(request: LayerRequest, parts: Sequence[SeenPoints]) -> list[LayerValues]:
    """Render and return the requested colours and layers at the seen points of each part."""
    with layer_source(request) as source:
        return [sample_points(source, points, request.names) for points in parts]


def colour_errors(measured: Sequence[LayerValues], truth: Sequence[LayerValues], kinds: frozenset[str]) -> Errors:
    """Return the 95th percentile of CIEDE2000 and the largest RMSE of a layer, with bounds, where truth is known."""
    parts = [(a, b, known_rows(b)) for a, b in zip(measured, truth, strict=True)]
    errors: Errors = {}
    if "rgb" in kinds:
        errors["colour"] = quantile_bound([colour_difference(*part) for part in parts], QUANTILE, "colour")
    layers = []
    for name in sorted(kinds & set(MATERIAL_LAYERS)):
        squares = [squared_error(name, *part) for part in parts]
        sums, counts = np.array([s.sum() for s in squares]), np.array([float(s.size) for s in squares])
        layers.append(ratio_bound(sums, counts, name))
    if layers:
        estimate, bound = max(layers, key=lambda pair: pair[1])
        errors["layers"] = float(np.sqrt(estimate)), float(np.sqrt(bound))
    return errors


def errors_by_source(measured: LayerValues, truth: LayerValues) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Return colour and layer errors of all points, and the same by the source of each point's colour."""
    known_mask = known_rows(truth)
    difference = colour_difference(measured, truth, known_mask)
    squares = [squared_error(name, measured, truth, known_mask) for name in MATERIAL_LAYERS]

    def of(rows: Bool) -> dict[str, float]:
        """Return the errors of a mask's points by name: median and 95th percentile of colours, RMSE of layers."""
        return {
            "colour_median": round(float(np.median(difference[rows])), 6),
            "colour_95": round(float(np.quantile(difference[rows], QUANTILE)), 6),
            "layers_rmse": round(max(float(np.sqrt(square[rows].mean())) for square in squares), 6),
        }

    names = np.array([source_name(number) for number in range(256)])[measured.source[known_mask]]
    return of(np.ones(len(difference), bool)), {str(name): of(names == name) for name in np.unique(names)}
