"""A tripod: beside a road, or at places of one's choice in any scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.errors import InputError
from ...base.rotations import rotation_matrix
from .base import KNOT_RANGE, USUAL, Strip, knots_for, mounting, strips_of, turning
from .guides import Float, Guide
from .platform import Platform


class TripodPath:
    """Positions along a guide, one strip each; the scanner stands upright and turns counter-clockwise at an even rate.

    It begins facing along the guide. Without stations, positions are a spacing apart, and what is left of the length
    is shared between both ends.

    Attributes:
        strips: in the order of the stations given.
        positions: (S, 3) local positions, m.
        knot_spacing: s, see `Path`.
        typical_range: m, see `Path`.
        deviation: 0.

    Raises:
        InputError: a station isn't on the guide, or the ground there isn't known.
    """

    deviation = 0.0

    def __init__(self, platform: Platform, guide: Guide) -> None:
        station = _stations(platform, guide.length)
        if platform.lateral_offsets is None:
            offset = guide.roadside_offsets(station)
        else:
            offset = np.resize(np.array(platform.lateral_offsets, dtype=np.float64), len(station))
        plan, self._headings, _, _ = guide.frame(station)
        left = np.stack([-np.sin(self._headings), np.cos(self._headings)], axis=1)
        ground = guide.ground(station, offset, True)
        if not np.isfinite(ground).all():
            place = int(np.argmin(np.isfinite(ground)))
            allowed = f"there is no ground known at station {station[place]:.1f} m; a smaller one is needed"
            raise InputError("scan.platform.lateral_offsets", float(offset[place]), allowed)
        height = USUAL["tripod"].height if platform.height is None else platform.height
        self.positions = np.column_stack([plan + offset[:, None] * left, ground + height])
        self._turning = turning(platform)
        self._mounting = mounting(platform)
        self.strips = strips_of([platform.turn_seconds] * len(station))
        self.knot_spacing = knots_for(KNOT_RANGE * self._turning**2)
        self.typical_range = USUAL["tripod"].typical_range or height

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first strip's start."""
        time = np.asarray(time, dtype=np.float64)
        heading = self._headings[strip.index] + (time - strip.start_time) * self._turning
        position = np.repeat(self.positions[strip.index][None], len(time), axis=0)
        return position, rotation_matrix(heading) @ self._mounting


def _stations(platform: Platform, length: float) -> Float:
    if platform.stations is None:
        spaces = int(length / platform.station_spacing + 1e-9)
        first = (length - spaces * platform.station_spacing) / 2.0
        return np.clip(first + np.arange(spaces + 1) * platform.station_spacing, 0.0, length)
    station = np.array(platform.stations, dtype=np.float64)
    outside = np.flatnonzero((station < 0.0) | (station > length))
    if len(outside):
        field = f"scan.platform.stations[{outside[0]}]"
        raise InputError(field, float(station[outside[0]]), f"from 0 to {length:g} m, the length of the road")
    return station


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
