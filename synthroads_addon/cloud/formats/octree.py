"""The octree of a COPC file: the node that each point is stored in, found in bounded memory.

A node holds the first point, in the file's order, of each of its 128 x 128 x 128 cells of which no node above it holds
one; where few points are left, their node holds them all (COPC 1.0, section on the hierarchy; how points are chosen is
left to the writer).
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import AnyArray, Int

CELL_LEVELS = 7
"""A node's edge is 2 to this power times that of its cells."""
_FEW_POINTS = 30_000
"""Points of a node that aren't divided further."""
_BUCKET_POINTS = 2_000_000
"""Points that are worked on at a time, about, unless more lie in a node of `_DEEPEST_SPLIT`."""
_DEEPEST_SPLIT = 6
"""Level down to which points are parted into buckets."""
_BLOCK = 500_000
_BITS = 21
"""Bits per axis of a key: three of them fit into 64."""
_DEEPEST = _BITS - CELL_LEVELS
"""Level below which no point is parted from another: its cells are then 2 ** -21 of the root's edge."""

Steps = Callable[[slice | Int], AnyArray]
"""Gives coordinates (n, 3) in steps from the root's corner, of points by their numbers."""


@dataclass(frozen=True)
class Node:
    """A node of the octree and its points.

    Attributes:
        level: 0 for the root.
        place: number along x, y and z among the nodes of its level.
        points: (n,) numbers of its points, ascending.
    """

    level: int
    place: tuple[int, int, int]
    points: Int


def octree_nodes(steps: Steps, count: int, side: int, folder: Path) -> Iterator[Node]:
    """Yield all nodes that hold points, each above those below it.

    Args:
        steps: coordinates of the points.
        count: number of points.
        side: edge of the root, in the same steps; all coordinates are from 0 to below it.
        folder: for files of numbers of points, which are removed.
    """
    split = _split_level(steps, count, side)
    held, bucket_files = _hold_at_the_top(steps, count, side, split, folder)
    for level, numbers in enumerate(held):
        if len(numbers):
            yield from _nodes_of(numbers, _keys(steps(numbers), level, side), level)
    for path in bucket_files:
        numbers = np.fromfile(path, dtype=np.int64)
        path.unlink()
        yield from _nodes_below(numbers, steps(numbers), side, split)


def _keys(steps: AnyArray, level: int, side: int) -> Int:
    """Return keys (n,) of the cells that points lie in where the root is parted into 2 ** level cells per axis."""
    places = (steps.astype(np.int64) << level) // side
    return (places[:, 0] << (2 * _BITS)) | (places[:, 1] << _BITS) | places[:, 2]


def _place(key: int) -> tuple[int, int, int]:
    """Return the number along x, y and z of a cell from its key."""
    mask = (1 << _BITS) - 1
    return key >> (2 * _BITS), (key >> _BITS) & mask, key & mask


def _split_level(steps: Steps, count: int, side: int) -> int:
    """Return the least level at which no node holds more than `_BUCKET_POINTS` points, at most `_DEEPEST_SPLIT`."""
    if count <= _BUCKET_POINTS:
        return 0
    counts: Counter[int] = Counter()
    for begin in range(0, count, _BLOCK):
        keys, numbers = np.unique(
            _keys(steps(slice(begin, min(begin + _BLOCK, count))), _DEEPEST_SPLIT, side), return_counts=True
        )
        counts.update(dict(zip(keys.tolist(), numbers.tolist(), strict=True)))
    for level in range(1, _DEEPEST_SPLIT):
        shift = _DEEPEST_SPLIT - level
        sums: Counter[tuple[int, ...]] = Counter()
        for key, number in counts.items():
            sums[tuple(place >> shift for place in _place(key))] += number
        if max(sums.values()) <= _BUCKET_POINTS:
            return level
    return _DEEPEST_SPLIT


def _hold_at_the_top(steps: Steps, count: int, side: int, split: int, folder: Path) -> tuple[list[Int], list[Path]]:
    """Return the points held by nodes above a level, by their level, and files with the numbers of the others.

    There is one file of others, in the order of their keys, for each node of the level.
    """
    filled = [np.zeros(0, dtype=np.int64) for _ in range(split)]
    held: list[list[Int]] = [[] for _ in range(split)]
    bucket_paths: dict[int, Path] = {}
    for begin in range(0, count, _BLOCK):
        numbers = np.arange(begin, min(begin + _BLOCK, count), dtype=np.int64)
        coordinates = steps(slice(begin, begin + len(numbers)))
        for level in range(split):
            keys, first = np.unique(_keys(coordinates, level + CELL_LEVELS, side), return_index=True)
            is_new = ~np.isin(keys, filled[level], assume_unique=True)
            filled[level] = np.concatenate([filled[level], keys[is_new]])
            chosen = np.sort(first[is_new])
            held[level].append(numbers[chosen])
            stays = np.ones(len(numbers), dtype=bool)
            stays[chosen] = False
            numbers, coordinates = numbers[stays], coordinates[stays]
        keys = _keys(coordinates, split, side)
        for key in np.unique(keys).tolist():
            path = bucket_paths.setdefault(key, folder / f"bucket {key}")
            with path.open("ab") as file:
                file.write(numbers[keys == key].data)
    joined = [np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64) for parts in held]
    return joined, [bucket_paths[key] for key in sorted(bucket_paths)]


def _nodes_below(numbers: Int, coordinates: AnyArray, side: int, level: int) -> Iterator[Node]:
    """Yield the nodes that hold points of one node of a level, from it downwards.

    Args:
        numbers: (n,) of the points.
        coordinates: (n, 3), in steps.
        side: edge of the root, in steps.
        level: of that node.
    """
    while len(numbers):
        keys = _keys(coordinates, level, side)
        _, inverse, node_counts = np.unique(keys, return_inverse=True, return_counts=True)
        is_held = (node_counts <= _FEW_POINTS)[inverse] if level < _DEEPEST else np.ones(len(numbers), dtype=bool)
        crowded = np.flatnonzero(~is_held)
        if len(crowded):
            _, first = np.unique(_keys(coordinates[crowded], level + CELL_LEVELS, side), return_index=True)
            is_held[crowded[first]] = True
        yield from _nodes_of(numbers[is_held], keys[is_held], level)
        numbers, coordinates = numbers[~is_held], coordinates[~is_held]
        level += 1


def _nodes_of(numbers: Int, keys: NDArray[np.int64], level: int) -> Iterator[Node]:
    """Yield the nodes of a level from the numbers (n,) of the points that they hold, and their nodes' keys (n,)."""
    order = np.argsort(keys, kind="stable")
    keys, numbers = keys[order], numbers[order]
    begins = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]]))
    for begin, end in zip(begins, [*begins[1:], len(keys)], strict=True):
        yield Node(level, _place(int(keys[begin])), np.sort(numbers[begin:end]))
