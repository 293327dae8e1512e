"""`AwaitedSweeps`: which sweeps of a scan by sections are complete, and which wait for another section's blocks."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...base.arrays import AnyArray, Bool
from ...scanning.blocks import Block, Blocks

_SPARE = 1e-6
"""Time (s) by which a pulse may lie beyond a block's first and last one. Chosen: rounding."""


class AwaitedSweeps:
    """Number of blocks of pulses that each sweep of a scan still waits for.

    Args:
        cut: the scan's blocks, which come section by section.
        duration: of a sweep, s.
    """

    def __init__(self, cut: Blocks, duration: float) -> None:
        self._cut, self._duration = cut, duration
        self._awaited: dict[int, AnyArray] = {}
        for block in cut.all():
            strip, (first, last) = block[0], self._sweeps_of(block)
            counts = self._awaited.get(strip.index, np.zeros(0, dtype=np.int32))
            if len(counts) <= last:
                counts = np.r_[counts, np.zeros(max(last + 1, 2 * len(counts)) - len(counts), dtype=np.int32)]
            counts[first : last + 1] += 1
            self._awaited[strip.index] = counts

    def take(self, blocks: Iterable[Block]) -> None:
        """Take notice of blocks that come now: no sweep waits for them any longer."""
        for block in blocks:
            first, last = self._sweeps_of(block)
            self._awaited[block[0].index][first : last + 1] -= 1

    def is_complete(self, keys: AnyArray) -> Bool:
        """Return a mask (N,) of the sweeps, by strip and number in it (2, N), that wait for no further blocks."""
        result = np.zeros(keys.shape[1], dtype=bool)
        for strip in np.unique(keys[0]).tolist():
            rows, counts = np.flatnonzero(keys[0] == strip), self._awaited[strip]
            result[rows] = counts[np.minimum(keys[1, rows], len(counts) - 1)] == 0
        return result

    def _sweeps_of(self, block: Block) -> tuple[int, int]:
        """Return the numbers of the first and the last sweep of its strip that a block has pulses of."""
        strip, number = block
        first_pulse, count = self._cut.pulse_span(strip, number)
        begin, end = (self._cut.time(strip, pulse) for pulse in (first_pulse, first_pulse + count - 1))
        numbers = [(time - strip.start_time) / self._duration for time in (begin - _SPARE, end + _SPARE)]
        return max(0, int(numbers[0])), max(0, int(numbers[1]))
