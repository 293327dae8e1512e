"""Movable barriers of construction zones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...base.schema import quantity
from .thing import Block, LengthwiseThing

TEMPORARY_FLANKS = {
    "steel": (
        (1.0, -0.02), (1.0, 0.05), (0.5, 0.17), (0.3, 0.3), (0.3, 0.62), (0.5, 0.72), (0.5, 0.92), (0.36, 1.0),
    ),
    "plastic": (
        (1.0, -0.02), (1.0, 0.16), (0.66, 0.4), (0.58, 0.62), (0.62, 0.66), (0.62, 0.78), (0.55, 0.82), (0.45, 1.0),
    ),
}  # fmt: skip
"""One flank of a movable barrier's element, as those of concrete barriers; a little sunk."""
TEMPORARY_GAP = 0.03
"""Gap between two elements of a movable barrier, m."""
LONGEST_PLASTIC = 2.5
"""Elements up to this length (m) are of plastic, by turns red and white; longer ones are of steel."""


class TemporaryBarrier(LengthwiseThing):
    """A movable barrier of a construction zone, straight from its start offset to its end offset."""

    points_class: ClassVar = "construction_barrier"
    order: ClassVar = 40
    type: Literal["TemporaryBarrier"] = "TemporaryBarrier"
    end_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its axis at its end station.")
    height: float = quantity(0.55, ge=0.2, le=1.2, unit="m", description="Top above the surface.")
    base_width: float = quantity(0.4, ge=0.1, le=1.0, unit="m", description="Width of its foot.")
    segment_length: float = quantity(4.0, ge=1, le=12, unit="m", description="Length of one element.")

    def offset_at(self, station: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the offsets of its axis at stations of any shape, m."""
        share = (station - self.start_station) / max(self.end_station - self.start_station, 1e-3)
        return self.offset + (self.end_offset - self.offset) * share

    def footprint(self) -> Iterator[Block]:
        """Yield nothing: it stands on the pavement and runs obliquely."""
        yield from ()
