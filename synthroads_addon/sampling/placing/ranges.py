"""Stretches along the road that are taken, and how something finds room between them."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable

import numpy as np

Range = tuple[float, float]
"""Lowest and highest station, m."""


class Taken:
    """Stretches that are taken, merged where they overlap."""

    def __init__(self, stretches: Iterable[Range] = ()) -> None:
        self._starts: list[float] = []
        self._ends: list[float] = []
        for start, end in stretches:
            self.add(start, end)

    def add(self, start: float, end: float) -> None:
        """Take a stretch."""
        first, last = bisect_left(self._ends, start), bisect_right(self._starts, end)
        if first < last:
            start, end = min(start, self._starts[first]), max(end, self._ends[last - 1])
        self._starts[first:last], self._ends[first:last] = [start], [end]

    def is_free(self, start: float, end: float) -> bool:
        """Return whether nothing of a stretch is taken; what only touches it does no harm."""
        first = bisect_right(self._ends, start)
        return first == len(self._ends) or self._starts[first] >= end

    def within(self, start: float, end: float) -> list[Range]:
        """Return what is taken between two stations, in order; the outermost may reach beyond them."""
        first, last = bisect_right(self._ends, start), bisect_left(self._starts, end)
        return list(zip(self._starts[first:last], self._ends[first:last], strict=True))

    def all(self) -> list[Range]:
        """Return all that is taken, in order."""
        return list(zip(self._starts, self._ends, strict=True))


def free_ranges(low: float, high: float, *taken: Taken) -> list[Range]:
    """Return the parts of low to high (m) that none has taken, in order."""
    free, reached = [], low
    for start, end in sorted(stretch for item in taken for stretch in item.within(low, high)):
        if start > reached:
            free.append((reached, start))
        reached = max(reached, end)
    if high > reached:
        free.append((reached, high))
    return free


def draw_start(rng: np.random.Generator, ranges: list[Range], length: float) -> float | None:
    """Return where a thing of a length (m) begins, anywhere in the ranges with the same chance; None without room."""
    rooms = [(start, end - start - length) for start, end in ranges if end - start >= length]
    if not rooms:
        return None
    left = rng.random() * math.fsum(room for _, room in rooms)
    for start, room in rooms:
        if left <= room:
            return start + left
        left -= room
    return rooms[-1][0] + rooms[-1][1]


def nearest_free(station: float, half: float, room: float, length: float, *taken: Taken) -> float | None:
    """Return the nearest station at which a thing fits between what is taken, or None.

    Args:
        station: where it should stand, m.
        half: what it needs to either side along the road, m.
        room: how far it may be moved, m.
        length: of the road; the thing's axis stays on it, m.
        taken: what it has to keep clear of.
    """
    if all(item.is_free(station - half, station + half) for item in taken):
        return station
    low, high = max(0.0, station - room) - half, min(length, station + room) + half
    places = [
        min(max(station, start + half), end - half)
        for start, end in free_ranges(low, high, *taken)
        if end - start >= 2.0 * half
    ]
    return min(places, key=lambda place: abs(place - station), default=None)


def merge_ranges(ranges: Iterable[Range], gap: float) -> list[Range]:
    """Return the ranges in order, those joined that overlap or lie less than a gap (m) apart."""
    merged: list[Range] = []
    for start, end in sorted(ranges):
        if merged and start - merged[-1][1] < gap:
            merged[-1] = merged[-1][0], max(merged[-1][1], end)
        else:
            merged.append((start, end))
    return merged


def lengthen_range(start: float, end: float, least: float, low: float, high: float) -> Range:
    """Return a range made at least so long to both sides, as far as low and high (all m) allow."""
    lack = max(0.0, least - (end - start))
    start = max(low, start - lack / 2.0)
    end = min(high, max(end, start + least))
    return max(low, min(start, end - least)), end
