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


def match_pulses(mine: PointBlock, truth: PointBlock) -> tuple[PointBlock, PointBlock]:
    """Return the first returns of pulses in both clouds, in the same order, matched by GPS time."""
    a, b = (points.select(points.return_number == 1) for points in (mine, truth))
    _times, first, second = np.intersect1d(a.gps_time, b.gps_time, return_indices=True)
    return a.select(first), b.select(second)


def beam_errors(mine: Sequence[PointBlock], truth: Sequence[PointBlock]) -> Errors:
    """Return a cloud's errors against the truth: position (m), intensity, labels, density (shares), with bounds."""
    pairs = [match_pulses(a, b) for a, b in zip(mine, truth, strict=True)]
    position = [np.linalg.norm(a.xyz - b.xyz, axis=1) for a, b in pairs]
    intensity = [np.abs(a.intensity / b.intensity - 1.0) for a, b in pairs]
    wrong = np.array([float((a.class_id != b.class_id).sum()) for a, b in pairs])
    number = np.array([float(len(a)) for a, _ in pairs])
    points, true = (np.array([float(len(one)) for one in several]) for several in (mine, truth))
    fewer, more = ratio_bound(true - points, true, "density"), ratio_bound(points - true, true, "density")
    return {
        "position": quantile_bound(position, QUANTILE, "position"),
        "intensity": quantile_bound(intensity, QUANTILE, "intensity"),
        "labels": ratio_bound(wrong, number, "labels"),
        "density": (max(fewer[0], more[0]), max(fewer[1], more[1])),
    }


def shift_points(results: Sequence[BlockResult], plan: ScanPlan, octaves: int) -> list[Float]:
    """Return the points (N, 3) of each part, moved along their normals by the heights of a plan's micro-relief, m."""
    assert plan.relief.micro is not None
    shift = partial(shift_by_relief, relief=plan.relief.micro, strength=plan.relief.strength, seed=plan.run.seed)
    # As if seen at a right angle: how far a slanting beam carries a height is not the relief's error.
    seen = (
        (one.points.with_arrays({"incidence_deg": np.zeros(len(one.points), np.float32)}), one.seen)
        for one in results
        if one.seen is not None
    )
    return [shift(points, BeamEnds(at.position, at.normal), octaves=octaves).xyz for points, at in seen]


def relief_errors(mine: Sequence[Float], truth: Sequence[Float]) -> Errors:
    """Return the 95th percentile of distances between two sets of shifted points (N, 3), m, with its upper bound."""
    parts = [np.linalg.norm(a - b, axis=1) for a, b in zip(mine, truth, strict=True)]
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
        return [sample_points(source, seen, request.names) for seen in parts]


def colour_errors(mine: Sequence[LayerValues], truth: Sequence[LayerValues], kinds: frozenset[str]) -> Errors:
    """Return the 95th percentile of CIEDE2000 and the largest RMSE of a layer, with bounds, where truth is known."""
    parts = [(a, b, known_rows(b)) for a, b in zip(mine, truth, strict=True)]
    result: Errors = {}
    if "rgb" in kinds:
        result["colour"] = quantile_bound([colour_difference(*part) for part in parts], QUANTILE, "colour")
    layers = []
    for name in sorted(kinds & set(MATERIAL_LAYERS)):
        squares = [squared_error(name, *part) for part in parts]
        total, number = np.array([s.sum() for s in squares]), np.array([float(s.size) for s in squares])
        layers.append(ratio_bound(total, number, name))
    if layers:
        estimate, bound = max(layers, key=lambda pair: pair[1])
        result["layers"] = float(np.sqrt(estimate)), float(np.sqrt(bound))
    return result


def errors_by_source(mine: LayerValues, truth: LayerValues) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Return colour and layer errors of all points, and the same by the source of each point's colour."""
    known = known_rows(truth)
    difference = colour_difference(mine, truth, known)
    squares = [squared_error(name, mine, truth, known) for name in MATERIAL_LAYERS]

    def of(rows: Bool) -> dict[str, float]:
        return {
            "colour_median": round(float(np.median(difference[rows])), 6),
            "colour_95": round(float(np.quantile(difference[rows], QUANTILE)), 6),
            "layers_rmse": round(max(float(np.sqrt(square[rows].mean())) for square in squares), 6),
        }

    names = np.array([source_name(number) for number in range(256)])[mine.source[known]]
    return of(np.ones(len(difference), bool)), {str(name): of(names == name) for name in np.unique(names)}
