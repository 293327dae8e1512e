"""Stations of a road before and after an edit of its elements: what lies behind an edited element moves along."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.schema import round_value

_STEP = 1e-6
"""Length, m, over which stations jump where an element is inserted: a station there stays before the element."""


@dataclass(frozen=True)
class StationMap:
    """Map from the stations of a road to those of the same places after edits of its elements.

    Piecewise linear between knots; beyond the first and the last knot a station keeps its distance from it. Where two
    knots have one station afterwards, the stretch between them was deleted.

    Attributes:
        before: (K,) increasing stations, m.
        after: (K,) stations of the same places afterwards, m, not decreasing.

    Example:
        >>> longer = StationMap((0.0, 100.0, 300.0), (0.0, 120.0, 320.0))
        >>> [longer(station) for station in (50.0, 100.0, 250.0)]
        [60.0, 120.0, 270.0]
    """

    before: tuple[float, ...]
    after: tuple[float, ...]

    def __call__(self, station: float) -> float:
        """Return a station, m, after the edits."""
        if station <= self.before[0]:
            return self.after[0] + (station - self.before[0])
        if station >= self.before[-1]:
            return self.after[-1] + (station - self.before[-1])
        return float(np.interp(station, self.before, self.after))

    def is_deleted(self, station: float) -> bool:
        """Return whether a station lies within a stretch that was deleted; its borders don't."""
        knot = int(np.searchsorted(self.before, station))
        return (
            0 < knot < len(self.before)
            and self.before[knot - 1] < station < self.before[knot]
            and self.after[knot] <= self.after[knot - 1]
        )

    def then(self, edit: StationMap) -> StationMap:
        """Return the map of these edits followed by one more."""
        # A knot of the further edit lies where this map, which doesn't decrease, reaches its station.
        pulled_back = [self.place_before(station) for station in edit.before]
        knots = sorted({*self.before, *pulled_back})
        return StationMap(tuple(knots), tuple(edit(self(knot)) for knot in knots))

    def place_before(self, station: float) -> float:
        """Return a station before these edits whose place has the given station afterwards, m."""
        if station <= self.after[0]:
            return self.before[0] + (station - self.after[0])
        if station >= self.after[-1]:
            return self.before[-1] + (station - self.after[-1])
        return float(np.interp(station, self.after, self.before))


def same_stations(length: float) -> StationMap:
    """Return the map of a road of a length, m, along which nothing was moved."""
    return StationMap((0.0, length), (0.0, length))


def stretched(lengths: list[float], new_lengths: list[float]) -> StationMap:
    """Return the map of a road whose elements have new lengths, m: each is stretched, what lies behind it is moved.

    Example:
        >>> stretched([100.0, 200.0], [120.0, 200.0])(150.0)
        170.0
    """
    return StationMap(_borders(lengths), _borders(new_lengths))


def with_insertion(lengths: list[float], number: int, length: float) -> StationMap:
    """Return the map of a road with an element of a length, m, inserted as its element of a number, from 0.

    Args:
        lengths: of the elements before, m.
        number: of the new element.
        length: of the new element, m.
    """
    borders = _borders(lengths)
    place = borders[number]
    before = (*borders[: number + 1], place + _STEP, *borders[number + 1 :])
    after = (*borders[: number + 1], place + _STEP + length, *(border + length for border in borders[number + 1 :]))
    return StationMap(before, after)


def without_element(lengths: list[float], number: int) -> StationMap:
    """Return the map of a road without its element of a number, from 0."""
    return StationMap(_borders(lengths), _borders([*lengths[:number], 0.0, *lengths[number + 1 :]]))


def _borders(lengths: list[float]) -> tuple[float, ...]:
    """Return the stations of the elements' borders, m, from 0 to the road's length."""
    return (0.0, *(round_value(station) for station in np.cumsum(lengths)))
