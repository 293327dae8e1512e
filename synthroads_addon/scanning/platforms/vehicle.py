"""A vehicle that drives on the road."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from .guides import Guide
from .moving import MovingPath, MovingPlatform
from .strip_line import StripTrack

AXLES = 3.0
"""Distance between a vehicle's axles, m: its pitch is that of the line through both. Chosen: as of a van."""
WHEELS = 1.6
"""Distance between a vehicle's left and right wheels, m: its roll is that of the line through both. Chosen: as of a
car."""


class Vehicle(MovingPlatform):
    """Vehicle that drives in the lanes with the traffic, usually 2.2 m up at 20 m/s."""

    order: ClassVar[int] = 1
    usual: ClassVar[Mapping[str, Any]] = {"height": 2.2, "speed": 20.0}
    usual_range: ClassVar[float | None] = 8.0
    driven: ClassVar[bool] = True

    kind: Literal["vehicle"] = Field("vehicle", title="Platform", description="Platform.")

    def make_path(self, guide: Guide, origin: Sequence[float] | None = None) -> DrivenPath:
        """Return the path of strips driven on the guide's ground, in its lanes unless offsets are given."""
        return DrivenPath(self, guide)

    def runs_forward(self, strip: int, offset: float) -> bool:
        """Return whether a strip is driven in the direction of the stations: right of the centreline and on it."""
        return offset <= 0.0


class DrivenPath(MovingPath):
    """Strips driven on the undamaged surface, on which the vehicle stands with four wheels."""

    def heights(self, track: StripTrack, distance: Float) -> Float:
        """Return the scanner's local elevation (K,), m: its height above the undamaged surface below."""
        return self.height + self.surface(track, distance, 0.0)

    def attitudes(self, track: StripTrack, distance: Float) -> Float:
        """Return heading, pitch, roll (K, 3), rad, of a body on four wheels, at distances travelled (K,), m."""
        course = track.place(distance)[1]
        half_base = min(AXLES, track.length) / 2.0
        # At the ends the axles stay on the track.
        middle = np.clip(distance, half_base, track.length - half_base)
        rise = self.surface(track, middle + half_base, 0.0) - self.surface(track, middle - half_base, 0.0)
        pitch = np.arctan(rise / (2.0 * half_base))
        left_rise = self.surface(track, distance, WHEELS / 2.0) - self.surface(track, distance, -WHEELS / 2.0)
        # Left of the body is a tangent of the surface: tan(roll) is the slope across times cos(pitch).
        return np.column_stack([course, pitch, np.arctan(left_rise / WHEELS * np.cos(pitch))])
