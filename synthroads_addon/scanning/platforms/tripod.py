"""A tripod: beside a road, or at places of one's choice in any scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.rotations import rotation_matrix
from ...base.schema import Finite, notes, quantity
from .guides import Guide
from .path import KNOT_RANGE, Strip, knot_spacing_for, make_strips
from .platform import Platform

_USUAL_RANGE = 15.0
"""Usual distance to what is scanned, m. Chosen: a carriageway's width."""


class Tripod(Platform):
    """Tripod beside the road that turns the scanner at each of its positions, usually 1.8 m above the ground."""

    order: ClassVar[int] = 2
    usual: ClassVar[Mapping[str, Any]] = {"height": 1.8}
    usual_range: ClassVar[float | None] = _USUAL_RANGE

    kind: Literal["tripod"] = Field("tripod", title="Platform", description="Platform.")
    height: float | None = quantity(None, "m", "Height above the ground below.", (0.1, 5000))
    lateral_offsets: tuple[Finite, ...] | None = Field(
        None,
        min_length=1,
        max_length=64,
        title="Offsets (m)",
        description="Offsets from the centreline, used in turn, m; the pavement's outer edges if not given.",
        json_schema_extra=notes(unset="At the edges"),
    )
    stations: tuple[Finite, ...] | None = Field(
        None,
        min_length=1,
        max_length=1000,
        title="Stations (m)",
        description="Stations of a tripod's positions, m.",
        json_schema_extra=notes(unset="By the spacing"),
    )
    station_spacing: float = quantity(
        80.0, "m", "Spacing of a tripod's positions where no stations are given.", (1, 5000)
    )
    turn_seconds: float = quantity(
        60.0, "s", "Time in which a tripod turns the scanner at each position.", gt=0, le=3600, title="Time of a Turn"
    )
    turn_deg: float = quantity(
        360.0, "deg", "Angle of this turn; 0 if the head rotates by itself.", (0, 360), title="Angle of a Turn (°)"
    )

    def make_path(self, guide: Guide, origin: Sequence[float] | None = None) -> TripodPath:
        """Return the path of one strip at each position along the guide, in the order of the stations.

        The scanner begins facing along the guide. Without stations, positions are a spacing apart, and what is left of
        the length is shared between both ends.

        Raises:
            InputError: a station isn't on the guide, or the ground there isn't known.
        """
        station = _stations(self, guide.length)
        if self.lateral_offsets is None:
            offset = guide.roadside_offsets(station)
        else:
            offset = np.resize(np.array(self.lateral_offsets, dtype=np.float64), len(station))
        plan, heading, _, _ = guide.frame(station)
        leftward = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        ground = guide.known_ground(station, offset, True)
        positions = np.column_stack([plan + offset[:, None] * leftward, ground + self.value("height")])
        return TripodPath(self, positions, heading)


class TripodPath:
    """One strip at each position; the scanner stands upright and turns counter-clockwise at an even rate.

    Attributes:
        strips: in the order of the positions.
        positions: (S, 3) local positions of the scanner, m.
        knot_spacing: s, see `Path`.
        typical_range: m, see `Path`.

    Args:
        platform: its turning and mounting.
        positions: (S, 3) of the scanner itself, local, m; at least one.
        headings: (S,) in which it begins, rad; along x if not given.
    """

    def __init__(self, platform: Tripod, positions: ArrayLike, headings: Float | None = None) -> None:
        self.positions = np.array(positions, dtype=np.float64).reshape(-1, 3)
        self._headings = np.zeros(len(self.positions)) if headings is None else headings
        self._turning = math.radians(platform.turn_deg) / platform.turn_seconds  # counter-clockwise
        self._mounting = platform.mounting()
        self.strips = make_strips([platform.turn_seconds] * len(self.positions))
        self.knot_spacing = knot_spacing_for(KNOT_RANGE * self._turning**2)
        self.typical_range = _USUAL_RANGE

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first strip's start."""
        time = np.asarray(time, dtype=np.float64)
        heading = self._headings[strip.index] + (time - strip.start_time) * self._turning
        position = np.repeat(self.positions[strip.index][None], len(time), axis=0)
        return position, rotation_matrix(heading) @ self._mounting


def _stations(platform: Tripod, length: float) -> Float:
    """Return the stations (S,) of a tripod along a line, m: the given ones, else by the spacing, centred on the line.

    Raises:
        InputError: a given station isn't on the line.
    """
    if platform.stations is None:
        spaces = int(length / platform.station_spacing + 1e-9)
        first_station = (length - spaces * platform.station_spacing) / 2.0
        return np.clip(first_station + np.arange(spaces + 1) * platform.station_spacing, 0.0, length)
    station = np.array(platform.stations, dtype=np.float64)
    outside_rows = np.flatnonzero((station < 0.0) | (station > length))
    if len(outside_rows):
        field = f"scan.platform.stations[{outside_rows[0]}]"
        raise InputError(field, float(station[outside_rows[0]]), f"from 0 to {length:g} m, the length of the road")
    return station
