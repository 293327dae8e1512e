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
        apart: to the next line, m.
        apart_variation: of that distance.
        turned_deg: between neighbouring lines.
    """

    lines: int
    off_mm: float
    along_mm: float
    step: float
    apart: float
    apart_variation: float
    turned_deg: float


def line_figures(place: Float, name: str) -> LineFigures:
    """Return the figures of the scan lines among points (N, 2), m.

    Raises:
        InputError: they have no two lines side by side.
    """
    cell = np.floor(place / BLOCK).astype(np.int64)
    _, owner, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    blocks = np.split(np.argsort(owner.ravel(), kind="stable"), np.cumsum(count)[:-1])
    lines, gaps = [], []
    for rows in blocks:
        if len(rows) < _FEWEST_OF_BLOCK:
            continue
        found = _lines_of(place[rows] - place[rows].mean(axis=0))
        lines.append(found)
        gaps.append(_next_ones(found))
    if not lines or not sum(map(len, gaps)):
        raise InputError(name, len(place), f"has no two scan lines of {FEWEST} points side by side")
    every, (apart, turned) = np.concatenate(lines), np.concatenate(gaps).T
    spread = [float(np.subtract(*np.quantile(values, (0.75, 0.25)))) / _NORMAL for values in (apart, turned)]
    off, along, step = np.median(every[:, 4:], axis=0)
    middle = float(np.median(apart))
    return LineFigures(len(every), 1e3 * off, 1e3 * along, step, middle, spread[0] / middle, spread[1])


def _lines_of(place: Float) -> Float:
    """Return a block's lines (M, 7): slope over the block's direction, place across at 0, both ends, and figures."""
    along, across = _turned(place)
    pairs = cKDTree(place).query_pairs(_FARTHEST, output_type="ndarray")
    ahead = along[pairs[:, 1]] > along[pairs[:, 0]]
    first, second = np.where(ahead, pairs.T, pairs.T[::-1])
    step, aside = along[second] - along[first], np.abs(across[second] - across[first])
    near = (step > _NEAREST) & (aside < _AWAY)
    order = np.argsort(aside[near], kind="stable")
    links = _one_each(first[near][order], second[near][order])
    owner = connected_components(coo_matrix((np.ones(len(links)), links.T), (len(place),) * 2), directed=False)[1]
    rows = np.split(np.argsort(owner, kind="stable"), np.cumsum(np.bincount(owner))[:-1])
    found = [_described(along[line], across[line]) for line in rows if len(line) >= FEWEST]
    return np.array(found).reshape(-1, 7)


def _one_each(first: Index, second: Index) -> Index:
    """Return the links (K, 2) that are kept, the best first: each point has one before it and one behind it at most."""
    ends: tuple[set[int], set[int]] = (set(), set())
    kept = []
    for one, other in zip(first.tolist(), second.tolist(), strict=True):
        if one not in ends[0] and other not in ends[1]:
            ends[0].add(one)
            ends[1].add(other)
            kept.append((one, other))
    return np.array(kept, dtype=np.int64).reshape(-1, 2)


def _turned(place: Float) -> tuple[AnyArray, AnyArray]:
    """Return places along and across a block's lines: the direction in which most pairs of points follow each other."""
    pairs = cKDTree(place).query_pairs(_FARTHEST, output_type="ndarray")
    apart = place[pairs[:, 1]] - place[pairs[:, 0]]
    apart = apart[np.hypot(*apart.T) > _NEAREST]
    angle = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    inside = np.abs(np.outer(apart[:, 0], -np.sin(angle)) + np.outer(apart[:, 1], np.cos(angle))) < _AWAY
    best = angle[int(inside.sum(axis=0).argmax())]
    return place @ [np.cos(best), np.sin(best)], place @ [-np.sin(best), np.cos(best)]


def _described(along: AnyArray, across: AnyArray) -> list[float]:
    """Return a line's slope, place across at 0, ends, and root mean squares off it and along it, m, and its step."""
    order = np.argsort(along)
    along, across = along[order], across[order]
    slope, at = np.polyfit(along, across, 1)
    off = across - slope * along - at
    # Of independent errors of the places second differences have six times the variance.
    uneven = np.diff(along, 2).std() / np.sqrt(6.0)
    return [slope, at, along[0], along[-1], float(off.std()), float(uneven), float(np.median(np.diff(along)))]


def _next_ones(lines: Float) -> Float:
    """Return distance, m, and angle, deg, (K, 2) from each line to the next one of its strip beside it."""
    found = []
    lines = lines[np.argsort(lines[:, 1])]
    for number, line in enumerate(lines):
        others = lines[number + 1 :]
        low, high = np.maximum(others[:, 2], line[2]), np.minimum(others[:, 3], line[3])
        middle, angle = (low + high) / 2.0, np.rad2deg(others[:, 0] - line[0])
        apart = others[:, 1] - line[1] + (others[:, 0] - line[0]) * middle
        beside = (high - low > _OVERLAP) & (np.abs(angle) < SAME_DEG) & (apart > 0.0) & (apart < _NEXT)
        if beside.any():
            nearest = int(np.where(beside, apart, np.inf).argmin())
            found.append((apart[nearest], angle[nearest]))
    return np.array(found).reshape(-1, 2)


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
