"""Points on their way into a network, as effects change them: `Crop` of a tile, `Stretch` of a road."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.arrays import AnyArray, Bool, Float, Index

from .corridor import CORRIDOR, NO_SHOULDER
from .frames import Frames

LEFT, RIGHT, HEADING, HEIGHT = (CORRIDOR.index(name) for name in ("left_edge", "right_edge", "heading", "height"))


@dataclass
class Sample:
    """N points that augmentation changes by assigning new arrays, never in place, as arrays may be shared with a tile.

    Attributes:
        coord: (N, 3) m.
        strength: (N,) intensities; None or all 0 where there are none.
        color: (N, 3) from 0 to 1, or None.
    """

    coord: AnyArray
    strength: AnyArray | None
    color: AnyArray | None
    per_point: ClassVar[tuple[str, ...]] = ("coord", "strength", "color")

    def __len__(self) -> int:
        return len(self.coord)

    def keep(self, points: Bool | Index) -> None:
        """Drop all points but those of a mask or of ascending indices, in place."""
        for name in self.per_point:
            if (values := getattr(self, name)) is not None:
                setattr(self, name, values[points])


@dataclass
class Crop(Sample):
    """A crop of a tile, to be augmented; coordinates are relative to the tile, intensities scaled, all float32.

    Attributes:
        segment: (N,) int16 places of classes, or -1.
        offset: (N,) distances to the left of the road's axis, m, or None.
        classes: names of the classes by their places.
    """

    segment: NDArray[np.int16]
    offset: AnyArray | None = None
    classes: tuple[str, ...] = ()
    per_point: ClassVar[tuple[str, ...]] = (*Sample.per_point, "segment", "offset")

    def points_of(self, names: Collection[str]) -> Bool:
        """Return a mask (N,) of the points whose class has one of some names."""
        places = [place for place, name in enumerate(self.classes) if name in names]
        return np.isin(self.segment, places)


@dataclass
class Stretch(Sample):
    """A sequence of S slices, to be augmented; x and y are in the slices' frames, z is the cloud's; all float64.

    Attributes:
        number: (N,) slice of each point, ascending.
        paved, marked: (N,) whether a point is known to lie on the pavement (markings included), or on a marking.
        frames: the S frames.
        center: (S,) y of the true centreline, m, or NaN.
        corridor: (S, len(CORRIDOR)); height is above the cloud's zero.
        lines, room: (S, 2) see `Crossings`.
        carriageway: whether the truth is a carriageway's, beside which the other one must not be seen.
    """

    strength: Float
    number: Index
    paved: Bool
    marked: Bool
    frames: Frames
    center: Float
    corridor: Float
    lines: Float
    room: Float
    carriageway: bool
    per_point: ClassVar[tuple[str, ...]] = (*Sample.per_point, "number", "paved", "marked")

    def along(self) -> Float:
        """Return each slice's distance from the first along the path (S,), m."""
        return np.abs(self.frames.station - self.frames.station[0])

    def points_along(self) -> Float:
        """Return each point's distance from the first slice along the path (N,), m."""
        return np.asarray(self.coord[:, 0] + self.along()[self.number])

    def paved_sides(self) -> Float:
        """Return the pavement's extent to the left and to the right of the true centre (S, 2), m; NaN if unknown."""
        return np.column_stack([self.corridor[:, LEFT] - self.center, self.center - self.corridor[:, RIGHT]])

    def without_shoulders(self) -> bool:
        """Return whether a carriageway's pavement ends within `NO_SHOULDER` of its edge lines everywhere."""
        excesses = self.paved_sides() - self.lines
        excesses = excesses[np.isfinite(excesses)]
        return self.carriageway and bool(len(excesses)) and float(excesses.max()) <= NO_SHOULDER
