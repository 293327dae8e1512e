"""Figures of single sweeps of a rotating head, synthetic beside real: points, numbers, noise, what a threshold tells.

    synthroads dataset sweeps --splits test --set 'cloud.attributes=["range"]' --output out/sweeps
    python studies/realism/sweeps.py out/sweeps/scenes --real sweeps.yaml

Both are a cloud, a folder or a list of clouds as `synthroads compare` takes them (docs/compare.md); ranges must be in
the file, or the list says where all was seen from. For each cloud the Markdown table has

- the road's points to the square metre of road in rings of range, and the median of their numbers in dB over the first
  real cloud's;
- the median number of markings, and of vegetation, over the road's;
- the noise of the numbers: by how much the logarithms of neighbours closer than `CLOSE` differ on average;
- the share of the road's numbers that are 0;
- the thickness of the road: the root of the least eigenvalue of `NEAREST` neighbours' covariance, median, mm;
- the best balanced accuracy with which one threshold on the number parts road from marking, and from vegetation.

With ``--limits`` each figure is held against the real one's, and the exit code is 3 if one is beyond its limit.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.arrays import Float  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.cloud.selection.classes import RealClass, class_by_label, read_real_cloud  # noqa: E402
from synthroads_addon.comparison.clouds import (  # noqa: E402
    CLASSES,
    ROAD,
    ListedCloud,
    between_azimuths,
    find_clouds,
    name_of,
)

RINGS = (4.0, 6.0, 10.0, 15.0, 20.0, 30.0, 50.0)
"""Edges of the rings of range, m."""
NEAR = (6.0, 20.0)
"""Ranges within which noise and thickness are measured, m; nearer ones the car hides in part."""
CLOSE = 0.15
"""Neighbours are closer than this, m."""
NEAREST = 20
"""Points whose covariance gives the thickness."""
_SECTORS, _LENGTHENS = 180, 1.2
"""Sectors of the azimuth, and factor of the range, within which a point stands for all of the road that is there."""
_FEWEST = 30
_LEVELS = 512

LIMITS: dict[str, tuple[float, float]] = {
    "marking over road": (1.2, 2.0),
    "vegetation over road": (0.8, 1.6),
    "noise": (0.15, 0.35),
    "zeros": (0.03, 0.15),
}
"""Least and largest value that these figures of a synthetic sweep may have."""
_DENSITY_FACTORS = {20.0: 1.5, 50.0: 2.0}
"""Up to a range, m, densities differ from the real ones by this factor at most."""
_DECIBELS, _ACCURACY = 3.0, 0.05
"""How far median numbers (dB), and accuracies of a threshold, may lie from, and above, the real ones."""


@dataclass(frozen=True)
class SweepFigures:
    """Figures of one sweep; NaN where it has too few points.

    Attributes:
        name: of the file.
        density: (R,) road points to the square metre of road in each ring.
        level: (R,) median of the road's numbers there, dB.
        values: all other figures by name, in the order of the table.
    """

    name: str
    density: Float
    level: Float
    values: dict[str, float]


def sweep_figures(path: Path, row: ListedCloud) -> SweepFigures:
    """Return the figures of a cloud.

    Raises:
        InputError: it can't be read, has too little road, or nobody says from where it was seen.
    """
    cloud = between_azimuths(read_real_cloud(path, row.class_field), row)
    points_of_class: dict[str, RealClass] = {}
    for name in CLASSES:
        code = getattr(row, name)
        try:
            if code is not None:
                points_of_class[name] = class_by_label(cloud, code, f"{path.name}: {name}")
        except InputError:
            if name == ROAD:
                raise
    ranges = {name: _ranges(points, row, path.name) for name, points in points_of_class.items()}
    road, distance = points_of_class[ROAD], ranges[ROAD]
    rings = [(distance >= nearest) & (distance < farthest) for nearest, farthest in pairwise(RINGS)]
    has_enough = [int(ring.sum()) >= _FEWEST for ring in rings]
    # Lost numbers are points all the same, alike many at all ranges.
    share = len(road.intensity) / (len(road.intensity) + road.zeros)
    azimuth = _azimuth(road, row)
    density = [
        _density(distance[ring], azimuth[ring], nearest, farthest) / share if is_enough else np.nan
        for ring, is_enough, (nearest, farthest) in zip(rings, has_enough, pairwise(RINGS), strict=True)
    ]
    level = [
        10.0 * np.log10(np.median(road.intensity[ring])) if is_enough else np.nan
        for ring, is_enough in zip(rings, has_enough, strict=True)
    ]
    numbers = {name: points.intensity for name, points in points_of_class.items()}
    values: dict[str, float] = {}
    for name in CLASSES[1:]:
        values[f"{name} over road"] = _ratio(numbers.get(name), numbers[ROAD])
    is_near = (distance >= NEAR[0]) & (distance < NEAR[1])
    place = road.place[is_near]
    values["noise"] = number_noise(place, road.intensity[is_near])
    values["zeros"] = 1.0 - share
    values["thickness, mm"] = 1e3 * thickness(place)
    for name in CLASSES[1:]:
        values[f"threshold: road or {name}"] = best_accuracy(numbers[ROAD], numbers.get(name))
    return SweepFigures(
        path.parent.name if path.stem == "cloud" else name_of(path, row), np.array(density), np.array(level), values
    )


def _ranges(points: RealClass, row: ListedCloud, file: str) -> Float:
    """Return the ranges (N,) of a class's points, m."""
    if row.scanner is not None:
        return np.asarray(np.linalg.norm(points.place - np.asarray(row.scanner), axis=1))
    if not np.isfinite(points.distance).all():
        raise InputError(file, None, 'has no ranges: give cloud.attributes=["range"] to the scan, or a list a scanner')
    return points.distance


def _azimuth(road: RealClass, row: ListedCloud) -> Float:
    """Return the azimuth (N,) of points about the scanner, rad: about the one place that the ranges agree with."""
    middle = np.asarray(row.scanner) if row.scanner is not None else scanner_place(road.place, road.distance)
    from_scanner = road.place - middle
    return np.asarray(np.arctan2(from_scanner[:, 1], from_scanner[:, 0]))


def scanner_place(place: Float, distance: Float) -> Float:
    """Return the place (3,) whose distances from points (N, 3) are nearest to (N,), above most of them (least squares).

    Spheres about the points meet in a line of equations: |p|^2 - d^2 = 2 p . c - |c|^2. Of the two mirror images on
    either side of a level road the upper one is taken.
    """
    origin = place.mean(axis=0)
    local_place = place - origin
    plane = np.linalg.svd(local_place[:: max(len(local_place) // 5000, 1)], full_matrices=False)[2]
    plane[2] *= np.sign(plane[2, 2]) or 1.0
    plane_coordinates = local_place @ plane[:2].T
    terms = np.column_stack([2.0 * plane_coordinates, -np.ones(len(plane_coordinates))])
    solution = np.linalg.lstsq(terms, (local_place**2).sum(axis=1) - distance**2, rcond=None)[0]
    height = np.sqrt(max(solution[2] - solution[:2] @ solution[:2], 0.0))
    return np.asarray(origin + solution[:2] @ plane[:2] + height * plane[2])


def _density(distance: Float, azimuth: Float, nearest: float, farthest: float) -> float:
    """Return points to the square metre of the cells, by range and azimuth, that hold any.

    Cells are as long as lasers' rings on the road lie apart there: with the range by equal factors.
    """
    parts = int(np.ceil(np.log(farthest / nearest) / np.log(_LENGTHENS)))
    edges = np.geomspace(nearest, farthest, parts + 1)
    part = np.clip(np.searchsorted(edges, distance, side="right") - 1, 0, parts - 1)
    sector = np.floor((azimuth / (2.0 * np.pi) + 0.5) * _SECTORS).astype(np.int64) % _SECTORS
    cells = np.unique(part * _SECTORS + sector) // _SECTORS
    area = np.pi / _SECTORS * (edges[cells + 1] ** 2 - edges[cells] ** 2)
    return len(distance) / float(area.sum())


def _ratio(numerators: Float | None, denominators: Float) -> float:
    """Return the ratio of the medians of two classes' numbers; NaN of too few."""
    is_sparse = numerators is None or len(numerators) < _FEWEST or len(denominators) < _FEWEST
    return float("nan") if is_sparse or numerators is None else float(np.median(numerators) / np.median(denominators))


def number_noise(place: Float, number: Float) -> float:
    """Return by how much the logarithms of numbers (N,) of neighbours closer than `CLOSE` differ on average."""
    distance, nearest = cKDTree(place).query(place, k=2)
    is_close = distance[:, 1] < CLOSE
    log_ratios = np.abs(np.log(number[is_close] / number[nearest[is_close, 1]]))
    return float(log_ratios.mean()) if len(log_ratios) >= _FEWEST else float("nan")


def thickness(place: Float) -> float:
    """Return the median root of the least eigenvalue of the covariance of `NEAREST` neighbours of points (N, 3), m."""
    if len(place) < NEAREST:
        return float("nan")
    neighbours = cKDTree(place).query(place, k=NEAREST)[1]
    groups = place[neighbours] - place[neighbours].mean(axis=1, keepdims=True)
    covariance = np.einsum("nki,nkj->nij", groups, groups) / NEAREST
    return float(np.median(np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, 0], 0.0))))


def best_accuracy(numbers: Float, other_numbers: Float | None) -> float:
    """Return the best balanced accuracy with which a threshold parts numbers (N,) from (M,), whichever way."""
    if other_numbers is None or len(other_numbers) < _FEWEST or len(numbers) < _FEWEST:
        return float("nan")
    levels = np.quantile(np.concatenate([numbers, other_numbers]), np.linspace(0.0, 1.0, _LEVELS))
    shares_below = [
        np.searchsorted(np.sort(values), levels, side="right") / len(values) for values in (numbers, other_numbers)
    ]
    return float(0.5 + 0.5 * np.abs(shares_below[0] - shares_below[1]).max())


def named_figures(figures: SweepFigures) -> dict[str, float]:
    """Return figures of a sweep by name; NaN where it has too few points.

    Densities are those from `NEAR` on: nearer the car hides the road in part.
    """
    result = {}
    for (nearest, farthest), density, level in zip(pairwise(RINGS), figures.density, figures.level, strict=True):
        ring = f"{nearest:g} to {farthest:g} m"
        if nearest >= NEAR[0]:
            result[f"road points/m², {ring}"] = float(density)
        result[f"median road number, {ring}, dB"] = float(level)
    return result | figures.values


def misses(figures: SweepFigures, real: SweepFigures) -> list[str]:
    """Return what of a synthetic sweep's figures is beyond its limit, in words."""
    texts = []
    for (lowest, highest), synthetic_value, real_value in zip(
        pairwise(RINGS), figures.density, real.density, strict=True
    ):
        factor = next(value for reach, value in _DENSITY_FACTORS.items() if highest <= reach)
        if lowest >= NEAR[0] and np.isfinite(real_value) and not 1.0 / factor <= synthetic_value / real_value <= factor:
            texts.append(f"density at {lowest:g} to {highest:g} m: {synthetic_value:.3g} against {real_value:.3g}")
    for lowest, synthetic_value, real_value in zip(RINGS, figures.level, real.level, strict=False):
        if np.isfinite(real_value) and not abs(synthetic_value - real_value) <= _DECIBELS:
            texts.append(f"median from {lowest:g} m on: {synthetic_value - real_value:+.1f} dB")
    for name, (lowest, highest) in LIMITS.items():
        value = figures.values[name]
        if np.isfinite(value) and not lowest <= value <= highest:
            texts.append(f"{name}: {value:.3g}, {lowest:g} to {highest:g} allowed")
    for name, value in figures.values.items():
        real_value = real.values[name]
        if name.startswith("threshold") and value > real_value + _ACCURACY:
            texts.append(f"{name}: {value:.2f} against {real_value:.2f}")
    return texts


def table(rows: list[SweepFigures], real: SweepFigures) -> str:
    """Return a Markdown table of figures, a column for each cloud."""
    lines = [f"| | {' | '.join(row.name for row in rows)} |", "|---|" + "--:|" * len(rows)]
    for number, (nearest, farthest) in enumerate(pairwise(RINGS)):
        cells = [_cell(row.density[number]) for row in rows]
        lines.append(f"| road points/m², {nearest:g} to {farthest:g} m | {' | '.join(cells)} |")
    for number, (nearest, farthest) in enumerate(pairwise(RINGS)):
        cells = [_cell(row.level[number] - real.level[number], "+.1f") for row in rows]
        lines.append(f"| median road number, {nearest:g} to {farthest:g} m, dB | {' | '.join(cells)} |")
    lines += [f"| {name} | {' | '.join(_cell(row.values[name]) for row in rows)} |" for name in rows[0].values]
    return "\n".join(lines)


def _cell(value: float, form: str = ".3g") -> str:
    """Return a number as text; a dash where it isn't finite."""
    return format(value, form) if np.isfinite(value) else "–"


def main() -> int:
    """Print the table of the command line's clouds, and what is beyond its limits; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("synthetic", type=Path, help="cloud, folder or list")
    parser.add_argument("--real", type=Path, required=True, metavar="LIST", help="real sweeps, see docs/compare.md")
    parser.add_argument("--limits", action="store_true", help="exit with 3 if a figure is beyond its limit")
    arguments = parser.parse_args()
    real, synthetic = (
        [sweep_figures(*cloud_and_row) for cloud_and_row in find_clouds(path)]
        for path in (arguments.real, arguments.synthetic)
    )
    print(table([*real, *synthetic], real[0]))
    misses_texts = [f"{row.name}: {miss}" for row in synthetic for miss in misses(row, real[0])]
    print("\n".join(misses_texts) or "all within limits", file=sys.stderr)
    return 3 if misses_texts and arguments.limits else 0


if __name__ == "__main__":
    sys.exit(main())
