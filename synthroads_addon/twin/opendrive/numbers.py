"""Ids of what has no instance number of its own: numbers, as some readers insist on."""

from __future__ import annotations

from ...road.parameters import RoadParameters

HIGHEST = 2**31 - 1
"""Largest id that readers with whole numbers of 32 bits can hold."""


class FreeIds:
    """Issuer of element ids that no object of the road has as instance number, from 2^31 - 1 downwards.

    Args:
        parameters: the road.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self._numbers_in_use = {item.instance for item in parameters.objects.values()}
        self._next = HIGHEST

    def take(self) -> int:
        """Return an unused id, each time a lower one."""
        while self._next in self._numbers_in_use:
            self._next -= 1
        self._next -= 1
        return self._next + 1
