"""`Stretch`: a sequence of slices with its points and its truth, as effects change it and samples are made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .corridor import CORRIDOR
from .frames import Frames

Float = NDArray[np.float64]

LEFT, RIGHT, HEADING, HEIGHT = (CORRIDOR.index(name) for name in ("left_edge", "right_edge", "heading", "height"))
_NO_SHOULDER = 1.2
"""Pavement beyond an edge line that is no shoulder yet, m."""


@dataclass
class Stretch:
    """A sequence of S slices with K points; effects change it in place.

    Attributes:
        xyz: (K, 3) float64 in the slices' frames, m; z still that of the cloud.
        number: (K,) slice of each point, ascending.
        intensity: (K,) float64, 0 where there is none.
        rgb: (K, 3) float64 from 0 to 1.
        paved, marked: (K,) whether a point is known to lie on the pavement (markings included), or on a marking.
        has_color: whether the colours mean something.
        frames: the S frames.
        center: (S,) y of the true centreline, m, or NaN.
        corridor: (S, len(CORRIDOR)); height is above the cloud's zero.
        lines, room: (S, 2) see `Crossings`.
        carriageway: whether the truth is a carriageway's, beside which the other one must not be seen.
    """

    xyz: Float
    number: NDArray[np.intp]
    intensity: Float
    rgb: Float
    paved: NDArray[np.bool_]
    marked: NDArray[np.bool_]
    has_color: bool
    frames: Frames
    center: Float
    corridor: Float
    lines: Float
    room: Float
    carriageway: bool

    def keep(self, points: NDArray[np.bool_] | NDArray[np.intp]) -> None:
        """Leave out all points but those of a mask or of ascending indices."""
        for name in ("xyz", "number", "intensity", "rgb", "paved", "marked"):
            setattr(self, name, getattr(self, name)[points])

    def along(self) -> Float:
        """Return how far along the path each slice lies from the first (S,), m."""
        return np.abs(self.frames.station - self.frames.station[0])

    def points_along(self) -> Float:
        """Return how far along the path each point lies from the first slice (K,), m."""
        return self.xyz[:, 0] + self.along()[self.number]

    def paved_sides(self) -> Float:
        """Return how far the pavement reaches to the left and to the right of the centre (S, 2), m, or NaN."""
        return np.column_stack([self.corridor[:, LEFT] - self.center, self.center - self.corridor[:, RIGHT]])

    def without_shoulders(self) -> bool:
        """Return whether it is a carriageway whose pavement ends near its edge lines, as that of rural roads."""
        beyond = self.paved_sides() - self.lines
        beyond = beyond[np.isfinite(beyond)]
        return self.carriageway and bool(len(beyond)) and float(beyond.max()) <= _NO_SHOULDER
