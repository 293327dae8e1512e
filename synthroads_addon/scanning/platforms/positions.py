"""A tripod at places of one's choice, in any scene: no guide is needed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...base.rotations import rotation_matrix
from ...scenario.scan import Platform
from .base import KNOT_RANGE, USUAL, Strip, knots_for, mounting, strips_of, turning

Float = NDArray[np.float64]


class PositionsPath:
    """One strip at each position; the scanner stands upright, begins facing along x and turns counter-clockwise.

    Attributes:
        strips: in the order of the positions.
        positions: (S, 3) local positions of the scanner, m.
        knot_spacing: s, see `Path`.
        typical_range: m, see `Path`.
        deviation: 0.

    Args:
        platform: its turning and mounting.
        positions: of the scanner itself, local, m; at least one.
    """

    deviation = 0.0

    def __init__(self, platform: Platform, positions: Sequence[Sequence[float]]) -> None:
        self.positions = np.array(positions, dtype=np.float64).reshape(-1, 3)
        self._turning = turning(platform)
        self._mounting = mounting(platform)
        self.strips = strips_of([platform.turn_seconds] * len(self.positions))
        self.knot_spacing = knots_for(KNOT_RANGE * self._turning**2)
        self.typical_range = USUAL["tripod"].typical_range or USUAL["tripod"].height

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first strip's start."""
        time = np.asarray(time, dtype=np.float64)
        position = np.repeat(self.positions[strip.index][None], len(time), axis=0)
        return position, rotation_matrix((time - strip.start_time) * self._turning) @ self._mounting
