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

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...base.classes import class_id
from ...base.random_streams import stream
from ...blender.cameras import HAS_RETURN_CAMERA
from ...cloud.points import PointBlock
from ...road.geometry import RoadGeometry
from ...scanning.beam import RINGS
from ...scanning.colour.colour import FROM_MATERIAL, MATERIAL_LAYERS, NEARBY, ColourSettings, LayerValues, source_name
from ...scanning.colour.difference import cie_lab, ciede2000
from ...scanning.colour.request import LayerRequest
from ...scanning.relief import MicroRelief, shift_along_normals
from ...scanning.scan import BlockResult
from ...scanning.scene.mesh import SceneMesh
from ...scenario.colour import image_scale

Float = NDArray[np.float64]
Errors = dict[str, tuple[float, float]]
"""Kind of error -> estimate, and its upper bound with the confidence `LEVEL`."""

LEVEL = 0.95
"""Confidence of the upper bounds that tolerances are held against."""
QUANTILE = 0.95
CONVERGED = max(RINGS)
"""Rays per pulse of the footprint that counts as truth."""
FINEST = 8
"""Octaves of the micro-relief that counts as truth."""
DENSEST = {"image_spacing": 7.5, "ground_sampling_distance": 0.03}
"""Images that count as true where Blender has no pixel per return: for a range of 60 m. Denser than any preset's."""
_DRAWS = 400
_STEPS = 512
"""Places at which a distribution's shares are counted."""
_LEAST = 1e-9
_BESIDE_STEPS = 0.01
"""To either side of a step, m: faces at it may begin a little aside."""


def mesh_height_errors(
    mesh: SceneMesh, geometry: RoadGeometry, samples: int = 100_000, names: tuple[str, ...] = ("road", "roadside")
) -> Float:
    """Return signed height errors (N,) in metres of random points of the mesh's road surface.

    Without the centimetres along which the pavement changes at once, at noses and ends of ramps: faces there go
    slantwise from one cross-section to quite another one.

    Args:
        mesh: scene mesh in local coordinates.
        geometry: the analytic road.
        samples: points, drawn evenly by area with a fixed seed.
        names: classes of the faces that belong to the analytic surface.
    """
    rng = stream(0, "mesh height errors")
    faces = np.flatnonzero(np.isin(mesh.class_id, [class_id(name) for name in names]))
    area = mesh.areas()[faces]
    chosen = faces[rng.choice(len(faces), size=samples, p=area / area.sum())]
    corners = mesh.vertices[mesh.triangles[chosen]].astype(np.float64)
    u, v = rng.random((2, samples))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
    station, offset = geometry.alignment.project(points[:, :2])
    inside = (station >= 0) & (station <= geometry.length)
    for low, high in (step for section in geometry.sections.values() for step in section.steps()):
        inside &= (station < low - _BESIDE_STEPS) | (station > high + _BESIDE_STEPS)
    error = points[inside, 2] - geometry.elevation(station[inside], offset[inside])
    return np.asarray(error[np.isfinite(error)])


def match_pulses(mine: PointBlock, truth: PointBlock) -> tuple[PointBlock, PointBlock]:
    """Return the first returns of the pulses that both have, in one order; pulses are known by their time."""
    a, b = (points.select(points.return_number == 1) for points in (mine, truth))
    _times, first, second = np.intersect1d(a.gps_time, b.gps_time, return_indices=True)
    return a.select(first), b.select(second)


def beam_errors(mine: Sequence[PointBlock], truth: Sequence[PointBlock]) -> Errors:
    """Return position (m), intensity, labels and density (shares) of parts of a cloud against the truth."""
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


def shift_points(
    results: Sequence[BlockResult], relief: MicroRelief, strength: float, seed: int, octaves: int
) -> list[Float]:
    """Return the places (N, 3) of the points of each part as micro-relief shifts them, m."""
    return [
        shift_along_normals(one.points, one.seen.position, relief, strength, seed, octaves).xyz
        for one in results
        if one.seen is not None
    ]


def relief_errors(mine: Sequence[Float], truth: Sequence[Float]) -> Errors:
    """Return the error of parts of shifted points (N, 3) against others, m."""
    parts = [np.linalg.norm(a - b, axis=1) for a, b in zip(mine, truth, strict=True)]
    return {"relief": quantile_bound(parts, QUANTILE, "relief")}


def truest_settings(request: LayerRequest) -> ColourSettings:
    """Return the settings of a request whose colours count as true, under direct light.

    That is a pixel per return where Blender has it, else the densest images, for the points that these show.
    """
    true = replace(request.settings, lighting="direct", samples=1)
    if HAS_RETURN_CAMERA:
        return replace(true, source="returns")
    scale = image_scale(request.path.typical_range)
    lengths = {name: scale * length for name, length in DENSEST.items()}
    return replace(true, source="images", **lengths)  # type: ignore[arg-type]


def known_rows(truth: LayerValues) -> NDArray[np.bool_]:
    """Return which points (N,) the truth was rendered for."""
    return ~np.isin(truth.source, (FROM_MATERIAL, NEARBY))


def colour_difference(mine: LayerValues, truth: LayerValues, rows: NDArray[np.bool_]) -> Float:
    """Return CIEDE2000 between the colours of chosen points (N,)."""
    return ciede2000(cie_lab(mine.arrays["rgb"][rows]), cie_lab(truth.arrays["rgb"][rows]))  # type: ignore[arg-type]


def squared_error(name: str, mine: LayerValues, truth: LayerValues, rows: NDArray[np.bool_]) -> Float:
    """Return the squared errors of a material layer at chosen points (N, components)."""
    difference = mine.arrays[name][rows].astype(np.float64) - truth.arrays[name][rows].astype(np.float64)
    return np.square(difference).reshape(len(difference), -1)


def colour_errors(mine: Sequence[LayerValues], truth: Sequence[LayerValues], wanted: frozenset[str]) -> Errors:
    """Return the errors of the wanted colours and layers of parts of a cloud, of the points whose truth is known."""
    parts = [(a, b, known_rows(b)) for a, b in zip(mine, truth, strict=True)]
    result: Errors = {}
    if "rgb" in wanted:
        result["colour"] = quantile_bound([colour_difference(*part) for part in parts], QUANTILE, "colour")
    layers = []
    for name in sorted(wanted & set(MATERIAL_LAYERS)):
        squares = [squared_error(name, *part) for part in parts]
        total, number = np.array([s.sum() for s in squares]), np.array([float(s.size) for s in squares])
        layers.append(ratio_bound(total, number, name))
    if layers:
        estimate, bound = max(layers, key=lambda pair: pair[1])
        result["layers"] = float(np.sqrt(estimate)), float(np.sqrt(bound))
    return result


def errors_by_source(mine: LayerValues, truth: LayerValues) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Return the errors of colours and layers, of all points and by what gave them to these."""
    known = known_rows(truth)
    difference = colour_difference(mine, truth, known)
    squares = [squared_error(name, mine, truth, known) for name in MATERIAL_LAYERS]

    def of(rows: NDArray[np.bool_]) -> dict[str, float]:
        return {
            "colour_median": round(float(np.median(difference[rows])), 6),
            "colour_95": round(float(np.quantile(difference[rows], QUANTILE)), 6),
            "layers_rmse": round(max(float(np.sqrt(square[rows].mean())) for square in squares), 6),
        }

    names = np.array([source_name(number) for number in range(256)])[mine.source[known]]
    return of(np.ones(len(difference), bool)), {str(name): of(names == name) for name in np.unique(names)}


def quantile_bound(parts: Sequence[Float], quantile: float, key: str = "") -> tuple[float, float]:
    """Return a quantile of all values and its upper confidence bound, drawn from whole parts.

    The parts (stretches of a path) are drawn anew, with replacement: values within a part are alike, so that their
    number says less than that of the parts. Efron & Tibshirani 1993, An Introduction to the Bootstrap.

    Args:
        parts: values (N,) of each part.
        quantile: 0 to 1.
        key: of the random numbers.
    """
    every = np.concatenate([*parts, np.empty(0)])
    if not len(every):
        return 0.0, 0.0
    estimate = float(np.quantile(every, quantile))
    places = np.unique(np.quantile(every, np.linspace(0.0, 1.0, _STEPS)))
    below = np.stack([np.searchsorted(np.sort(part), places, side="right") for part in parts]).astype(np.float64)
    total = np.array([len(part) for part in parts], dtype=np.float64)
    weights = _draw_parts(len(parts), key)
    share = (weights @ below) / np.maximum(weights @ total, 1.0)[:, None]
    first = np.minimum((share < quantile).sum(axis=1), len(places) - 1)
    return estimate, max(estimate, float(np.quantile(places[first], LEVEL)))


def ratio_bound(above: Float, below: Float, key: str = "") -> tuple[float, float]:
    """Return the ratio of two sums over parts, and its upper confidence bound; see `quantile_bound`.

    Args:
        above, below: (S,) of each part.
        key: of the random numbers.
    """
    if not below.sum() > 0.0:
        return 0.0, 0.0
    estimate = float(above.sum() / below.sum())
    weights = _draw_parts(len(below), key)
    ratios = (weights @ above) / np.maximum(weights @ below, _LEAST)
    ratios = ratios[weights @ below > 0.0]
    return estimate, max(estimate, float(np.quantile(ratios, LEVEL)))


def _draw_parts(parts: int, key: str) -> Float:
    """Return how often each part is drawn (draws, parts)."""
    rng = stream(0, "choice", key)
    return rng.multinomial(parts, np.full(parts, 1.0 / parts), size=_DRAWS).astype(np.float64)
