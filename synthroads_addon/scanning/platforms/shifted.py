"""A path and motions in another local frame: that of a section of the road, which lies near the section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.motion import Motion, Pose
from .path import Path, Strip

Float = NDArray[np.float64]


@dataclass(frozen=True)
class ShiftedPath:
    """A path in a frame that begins elsewhere; see `platforms.base.Path`.

    Attributes:
        whole: the path in the road's local frame.
        origin: (3,) where the frame begins in the road's, m.
        strips: the path's; or parts of them, each with the index of the strip that it is of.
    """

    whole: Path
    origin: Float
    strips: tuple[Strip, ...]

    @property
    def knot_spacing(self) -> float:
        """Return the whole path's."""
        return self.whole.knot_spacing

    @property
    def typical_range(self) -> float:
        """Return the whole path's."""
        return self.whole.typical_range

    @property
    def deviation(self) -> float:
        """Return the whole path's."""
        return self.whole.deviation

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return the whole path's pose in this frame."""
        of = next(whole for whole in self.whole.strips if whole.index == strip.index)
        position, rotation = self.whole.pose(of, time)
        return position - self.origin, rotation


@dataclass(frozen=True)
class ShiftedMotion:
    """A motion in a frame that begins elsewhere; see `motion.Motion`.

    Attributes:
        whole: the motion in the road's local frame.
        origin: (3,) where the frame begins in the road's, m.
    """

    whole: Motion
    origin: Float

    def pose(self, time: Float) -> Pose:
        """Return the motion's pose in this frame."""
        rotation, place, present = self.whole.pose(time)
        return rotation, place - self.origin, present
