"""Ids of what has no instance number of its own: numbers, as some readers insist on."""

from __future__ import annotations

from ...road.parameters import RoadParameters

HIGHEST = 2**31 - 1
"""Largest id that readers with whole numbers of 32 bits can hold."""


class Numbers:
    """Numbers that nothing of the road has, from the highest downwards: those of passes follow all others.

    Args:
        parameters: the road.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self._taken = {item.instance for item in parameters.objects.values()}
        self._next = HIGHEST

    def next(self) -> int:
        """Return the next number."""
        while self._next in self._taken:
            self._next -= 1
        self._next -= 1
        return self._next + 1
