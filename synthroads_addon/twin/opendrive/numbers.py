"""Ids of what has no instance number of its own: numbers, as some readers insist on."""

from __future__ import annotations

from ...road.parameters import RoadParameters


class Numbers:
    """Numbers beyond those that the road's objects have."""

    def __init__(self, parameters: RoadParameters) -> None:
        self._last = max(item.instance for item in parameters.objects.values())

    def next(self) -> int:
        """Return the next number."""
        self._last += 1
        return self._last
