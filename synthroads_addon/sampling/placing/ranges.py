"""Stretches along the road that are taken, and how something finds room between them."""

import math
from collections.abc import Iterable

import numpy as np

Range = tuple[float, float]
"""Lowest and highest station, m."""


class Reservations:
    """Stretches of road that are taken; they may overlap."""

    def __init__(self, stretches: Iterable[Range] = ()) -> None:
        self.stretches = list(stretches)

    def add(self, start: float, end: float) -> None:
        """Take the stretch between two stations."""
        self.stretches.append((start, end))

    def within(self, start: float, end: float) -> list[Range]:
        """Return the taken stretches that overlap the one between two stations; what only touches it is left out."""
        return [(low, high) for low, high in self.stretches if high > start and low < end]

    def is_free(self, start: float, end: float) -> bool:
        """Return whether nothing of a stretch is taken; what only touches it does no harm."""
        return not self.within(start, end)


def free_ranges(low: float, high: float, *taken: Reservations) -> list[Range]:
    """Return the parts of the stretch from low to high (m) that none has taken, in order."""
    free, reached = [], low
    for start, end in sorted(stretch for item in taken for stretch in item.within(low, high)):
        if start > reached:
            free.append((reached, start))
        reached = max(reached, end)
    if high > reached:
        free.append((reached, high))
    return free


def draw_start(rng: np.random.Generator, ranges: list[Range], length: float) -> float | None:
    """Return a drawn start (m) of a thing of a length (m) that fits in one of the ranges; None without room."""
    rooms = [(start, end - start - length) for start, end in ranges if end - start >= length]
    if not rooms:
        return None
    left = rng.random() * math.fsum(room for _, room in rooms)
    for start, room in rooms:
        if left <= room:
            return start + left
        left -= room
    return rooms[-1][0] + rooms[-1][1]


def draw_stretch(rng: np.random.Generator, ranges: list[Range], least: float, most: float = math.inf) -> Range | None:
    """Return a drawn stretch in the ranges, of a length from the least to the most (m); None without room."""
    longest = min(most, max((end - start for start, end in ranges), default=0.0))
    length = least + max(0.0, longest - least) * rng.random()
    start = draw_start(rng, ranges, length)
    return None if start is None else (start, start + length)


def nearest_free(station: float, half: float, room: float, length: float, *taken: Reservations) -> float | None:
    """Return the station (m) nearest to the wanted one at which a thing fits between what is taken, or None.

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
    """Return the ranges sorted, those joined that overlap or lie less than a gap (m) apart."""
    merged: list[Range] = []
    for start, end in sorted(ranges):
        if merged and start - merged[-1][1] < gap:
            merged[-1] = merged[-1][0], max(merged[-1][1], end)
        else:
            merged.append((start, end))
    return merged


def lengthen_range(start: float, end: float, least: float, low: float, high: float) -> Range:
    """Return a range lengthened to both sides to at least ``least``, as far as low and high (all m) allow."""
    lack = max(0.0, least - (end - start))
    start = max(low, start - lack / 2.0)
    end = min(high, max(end, start + least))
    return max(low, min(start, end - least)), end
