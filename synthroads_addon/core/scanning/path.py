"""The platform's path: strips along the centreline, there and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..parameters.geometry import RoadGeometry
from ..scenario import Platform

Float = NDArray[np.float64]

TURNAROUND = 10.0
"""Seconds between two strips."""


@dataclass(frozen=True)
class Strip:
    """One pass along the road.

    Attributes:
        index: number of the strip, from 0.
        start_time: time of its first pulse, s.
        duration: s.
        lateral_offset: offset from the centreline, m.
        forward: with the stations, or against them.
    """

    index: int
    start_time: float
    duration: float
    lateral_offset: float
    forward: bool


class FlightPath:
    """Strips at a constant height above the centreline's elevation, parallel to the centreline.

    Raises:
        InputError: never; the platform's limits are checked by the scenario.
    """

    def __init__(self, geometry: RoadGeometry, platform: Platform) -> None:
        self.geometry = geometry
        self.platform = platform
        duration = geometry.length / platform.speed
        self.strips = tuple(
            Strip(i, i * (duration + TURNAROUND), duration, offset, i % 2 == 0)
            for i, offset in enumerate(platform.lateral_offsets)
        )

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (N, 3) and headings (N,) in radians at times (N,) since the first strip's start."""
        run = (time - strip.start_time) * self.platform.speed
        station = run if strip.forward else self.geometry.length - run
        plan, heading, _ = self.geometry.alignment.frame(station)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        height = self.geometry.profile.elevation(station) + self.platform.height
        position = np.column_stack([plan + strip.lateral_offset * left, height])
        return position, heading if strip.forward else heading + np.pi
