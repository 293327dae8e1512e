"""Figures of the scan lines of airborne clouds without times: how straight, how parallel, how evenly apart they are.

    python studies/realism/lines.py real.yaml

The argument is a cloud, a folder or a list of clouds as `synthroads compare` takes them (docs/compare.md). On the
pavement, and what lies up to 1 m beside it, points are followed from one to the next along the lines, whose direction
is sought in blocks of `BLOCK`. Of lines of `FEWEST` points and more the Markdown table has

- how far points lie off their straight line, mm: the root mean square of each line, median;
- how far they lie from even steps along it, mm: from second differences, median;
- the step, m, median;
- the distance to the next line of the same direction (within `SAME_DEG`) whose ends overlap, m: median, and the
  interquartile range over 1.349, as a share of the median;
- the angle between these two, deg: the same of its distribution.

Where two strips have the same direction, a line of the other one counts as the next.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.arrays import AnyArray, Float, Index  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.comparison.clouds import ROAD, find_clouds, name_of, read_compared  # noqa: E402

BLOCK = 30.0
"""Edge of the blocks within which all lines have nearly one direction, m."""
FEWEST = 12
"""Points of a line that is looked at."""
SAME_DEG = 0.1
"""Lines of one strip differ by less than this."""
_NEAREST, _FARTHEST, _AWAY = 0.28, 0.48, 0.035
"""Consecutive points of a line are so far apart along it, m, and at most so far across."""
_DIRECTIONS = 180
_FEWEST_OF_BLOCK, _OVERLAP, _NEXT = 300, 3.0, 1.0
"""Points of a block; two lines lie side by side over so many metres, and so near to each other, m."""
_OWN_FIGURES = slice(4, 7)
"""Columns of a line in `_lines_of`: root mean squares off it and along it, m, and its step, m."""
_NORMAL = 1.349
"""Interquartile range of the normal distribution over its standard deviation."""


@dataclass(frozen=True)
class LineFigures:
    """Figures of a cloud's scan lines.

    Attributes:
        lines: that were looked at.
        off_mm: off the straight line.
        along_mm: off even steps along it.
        step: m.
        gap: to the next line, m.
        gap_variation: of that distance.
        turned_deg: between neighbouring lines.
    """

    lines: int
    off_mm: float
    along_mm: float
    step: float
    gap: float
    gap_variation: float
    turned_deg: float


def line_figures(place: Float, name: str) -> LineFigures:
    """Return the figures of the scan lines among points, medians over the lines of all blocks.

    Args:
        place: (N, 2) of the points in plan, m.
        name: of the cloud, for errors.

    Raises:
        InputError: they have no two lines side by side.
    """
    cell = np.floor(place / BLOCK).astype(np.int64)
    _, block_number, point_count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    rows_by_block = np.argsort(block_number.ravel(), kind="stable")
    lines, gaps = [], []  # of each block: (M, 7) of `_lines_of`, (K, 2) of `_next_ones`
    for rows in np.split(rows_by_block, np.cumsum(point_count)[:-1]):
        if len(rows) < _FEWEST_OF_BLOCK:
            continue
        block_lines = _lines_of(place[rows] - place[rows].mean(axis=0))
        lines.append(block_lines)
        gaps.append(_next_ones(block_lines))
    if not lines or not sum(map(len, gaps)):
        raise InputError(name, len(place), f"has no two scan lines of {FEWEST} points side by side")
    all_lines, (distances, angles) = np.concatenate(lines), np.concatenate(gaps).T
    # Standard deviations that normal distributions of the same interquartile ranges have.
    distance_std, angle_std = (
        float(np.subtract(*np.quantile(values, (0.75, 0.25)))) / _NORMAL for values in (distances, angles)
    )
    off_line, along, step = np.median(all_lines[:, _OWN_FIGURES], axis=0)
    gap = float(np.median(distances))
    return LineFigures(
        lines=len(all_lines),
        off_mm=1e3 * off_line,
        along_mm=1e3 * along,
        step=step,
        gap=gap,
        gap_variation=distance_std / gap,
        turned_deg=angle_std,
    )


def _lines_of(place: Float) -> Float:
    """Return a block's lines (M, 7): slope over the block's direction, place across at 0, both ends, and figures."""
    along, across = _turned(place)
    pairs = cKDTree(place).query_pairs(_FARTHEST, output_type="ndarray")
    is_forward = along[pairs[:, 1]] > along[pairs[:, 0]]
    first_points, second_points = np.where(is_forward, pairs.T, pairs.T[::-1])
    step, sideways = along[second_points] - along[first_points], np.abs(across[second_points] - across[first_points])
    is_link = (step > _NEAREST) & (sideways < _AWAY)
    order = np.argsort(sideways[is_link], kind="stable")
    links = _one_each(first_points[is_link][order], second_points[is_link][order])
    owner = connected_components(coo_matrix((np.ones(len(links)), links.T), (len(place),) * 2), directed=False)[1]
    rows = np.split(np.argsort(owner, kind="stable"), np.cumsum(np.bincount(owner))[:-1])
    rows_of_lines = [_described(along[line], across[line]) for line in rows if len(line) >= FEWEST]
    return np.array(rows_of_lines).reshape(-1, 7)


def _one_each(first_points: Index, second_points: Index) -> Index:
    """Return the links (K, 2) that are kept, the best first: each point has one before it and one behind it at most."""
    ends: tuple[set[int], set[int]] = (set(), set())
    links = []
    for first_point, second_point in zip(first_points.tolist(), second_points.tolist(), strict=True):
        if first_point not in ends[0] and second_point not in ends[1]:
            ends[0].add(first_point)
            ends[1].add(second_point)
            links.append((first_point, second_point))
    return np.array(links, dtype=np.int64).reshape(-1, 2)


def _turned(place: Float) -> tuple[AnyArray, AnyArray]:
    """Return places along and across a block's lines: the direction in which most pairs of points follow each other."""
    pairs = cKDTree(place).query_pairs(_FARTHEST, output_type="ndarray")
    vectors = place[pairs[:, 1]] - place[pairs[:, 0]]
    vectors = vectors[np.hypot(*vectors.T) > _NEAREST]
    angle = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    is_along = np.abs(np.outer(vectors[:, 0], -np.sin(angle)) + np.outer(vectors[:, 1], np.cos(angle))) < _AWAY
    best_angle = angle[int(is_along.sum(axis=0).argmax())]
    return place @ [np.cos(best_angle), np.sin(best_angle)], place @ [-np.sin(best_angle), np.cos(best_angle)]


def _described(along: AnyArray, across: AnyArray) -> list[float]:
    """Return a line's slope, place across at 0, ends, and root mean squares off it and along it, m, and its step."""
    order = np.argsort(along)
    along, across = along[order], across[order]
    slope, place_at_0 = np.polyfit(along, across, 1)
    off_line = across - slope * along - place_at_0
    # Of independent errors of the places second differences have six times the variance.
    unevenness = np.diff(along, 2).std() / np.sqrt(6.0)
    return [
        slope,
        place_at_0,
        along[0],
        along[-1],
        float(off_line.std()),
        float(unevenness),
        float(np.median(np.diff(along))),
    ]


def _next_ones(lines: Float) -> Float:
    """Return distance, m, and angle, deg, (K, 2) from each line to the next one of its strip beside it."""
    rows = []
    lines = lines[np.argsort(lines[:, 1])]
    for number, line in enumerate(lines):
        later_lines = lines[number + 1 :]
        overlap_start, overlap_end = np.maximum(later_lines[:, 2], line[2]), np.minimum(later_lines[:, 3], line[3])
        middle, angle = (overlap_start + overlap_end) / 2.0, np.rad2deg(later_lines[:, 0] - line[0])
        distances = later_lines[:, 1] - line[1] + (later_lines[:, 0] - line[0]) * middle
        is_beside = (
            (overlap_end - overlap_start > _OVERLAP)
            & (np.abs(angle) < SAME_DEG)
            & (distances > 0.0)
            & (distances < _NEXT)
        )
        if is_beside.any():
            nearest = int(np.where(is_beside, distances, np.inf).argmin())
            rows.append((distances[nearest], angle[nearest]))
    return np.array(rows).reshape(-1, 2)


def main() -> int:
    """Print the table of the command line's clouds; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clouds", type=Path, help="cloud, folder or list")
    names = [field.name for field in fields(LineFigures)]
    print(f"| | {' | '.join(names)} |\n|---|{'--:|' * len(names)}")
    for path, row in find_clouds(parser.parse_args().clouds):
        road = read_compared(path, row).classes[ROAD]
        parts = [road.place[:, :2]] if road.beside is None else [road.place[:, :2], road.beside]
        figures = line_figures(np.concatenate(parts), name_of(path, row))
        print(f"| {name_of(path, row)} | {' | '.join(f'{getattr(figures, name):.3g}' for name in names)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
