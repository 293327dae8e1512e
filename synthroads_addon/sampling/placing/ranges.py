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
        return [
            (stretch_start, stretch_end)
            for stretch_start, stretch_end in self.stretches
            if stretch_end > start and stretch_start < end
        ]

    def is_free(self, start: float, end: float) -> bool:
        """Return whether nothing of a stretch is taken; what only touches it does no harm."""
        return not self.within(start, end)


def free_ranges(range_start: float, range_end: float, *reservations: Reservations) -> list[Range]:
    """Return the parts of the stretch from low to high (m) that none has taken, in order."""
    free_stretches, taken_up_to = [], range_start
    for stretch_start, stretch_end in sorted(
        stretch for item in reservations for stretch in item.within(range_start, range_end)
    ):
        if stretch_start > taken_up_to:
            free_stretches.append((taken_up_to, stretch_start))
        taken_up_to = max(taken_up_to, stretch_end)
    if range_end > taken_up_to:
        free_stretches.append((taken_up_to, range_end))
    return free_stretches


def draw_start(rng: np.random.Generator, ranges: list[Range], length: float) -> float | None:
    """Return a drawn start (m) of a thing of a length (m) that fits in one of the ranges; None without room."""
    rooms = [(start, end - start - length) for start, end in ranges if end - start >= length]
    if not rooms:
        return None
    distance = rng.random() * math.fsum(room for _, room in rooms)
    for start, room in rooms:
        if distance <= room:
            return start + distance
        distance -= room
    return rooms[-1][0] + rooms[-1][1]


def draw_stretch(
    rng: np.random.Generator, ranges: list[Range], least_length: float, largest_length: float = math.inf
) -> Range | None:
    """Return a drawn stretch in the ranges, of a length from the least to the most (m); None without room."""
    longest_length = min(largest_length, max((end - start for start, end in ranges), default=0.0))
    length = least_length + max(0.0, longest_length - least_length) * rng.random()
    start = draw_start(rng, ranges, length)
    return None if start is None else (start, start + length)


def nearest_free(station: float, half: float, room: float, length: float, *reservations: Reservations) -> float | None:
    """Return the station (m) nearest to the wanted one at which a thing fits between what is taken, or None.

    Args:
        station: where it should stand, m.
        half: what it needs to either side along the road, m.
        room: how far it may be moved, m.
        length: of the road; the thing's axis stays on it, m.
        reservations: what it has to keep clear of.
    """
    if all(item.is_free(station - half, station + half) for item in reservations):
        return station
    lowest, highest = max(0.0, station - room) - half, min(length, station + room) + half
    places = [
        min(max(station, start + half), end - half)
        for start, end in free_ranges(lowest, highest, *reservations)
        if end - start >= 2.0 * half
    ]
    return min(places, key=lambda place: abs(place - station), default=None)


def merge_ranges(ranges: Iterable[Range], gap: float) -> list[Range]:
    """Return the ranges sorted, those joined that overlap or lie less than a gap (m) apart."""
    result: list[Range] = []
    for start, end in sorted(ranges):
        if result and start - result[-1][1] < gap:
            result[-1] = result[-1][0], max(result[-1][1], end)
        else:
            result.append((start, end))
    return result


def lengthen_range(start: float, end: float, least_length: float, lower_limit: float, upper_limit: float) -> Range:
    """Return a range lengthened to both sides to at least ``least_length``, as far as low and high (all m) allow."""
    missing_length = max(0.0, least_length - (end - start))
    start = max(lower_limit, start - missing_length / 2.0)
    end = min(upper_limit, max(end, start + least_length))
    return max(lower_limit, min(start, end - least_length)), end
