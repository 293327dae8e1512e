"""Fences: wildlife fences of knotted wire, and pasture fences of rails, between posts."""

from collections.abc import Iterator
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Course, circle, sweep
from .limits import Interval, Limits, interval, share
from .thing import Block, LengthwiseThing, TwinTypes

SIDES = 8
"""Corners of a post."""


class Band(NamedTuple):
    """A band that runs from post to post.

    Attributes:
        low, high: its edges as shares of the fence's height.
        thickness: m.
    """

    low: float
    high: float
    thickness: float


KINDS = {
    "wildlife": (Band(0.02, 0.97, 0.003),),
    "rails": tuple(Band(middle - 0.05, middle + 0.05, 0.035) for middle in (0.3, 0.6, 0.9)),
}
"""Kind of fence -> its bands. A wire mesh is one thin plate, which lets most light through."""
MATERIALS = {"wildlife": "wire_mesh", "rails": "noise_wood"}
"""Kind of fence -> material of its bands; its posts are of wood."""


class FenceLimits(Limits):
    """Limits of fences."""

    group: ClassVar = "roadside"
    place: ClassVar = 10
    allowed: ClassVar = {"fence_height": "height"}

    fences: float = share(0.5, "Probability that a fence runs along a side of the road.")
    fence_height: Interval = interval(1.6, 2.2, "m", "Height of fences.")


class Fence(LengthwiseThing):
    """A fence along the road. Its offset is that of its posts' axes."""

    points_class: ClassVar = "utility"
    order: ClassVar = 150
    limits: ClassVar = FenceLimits
    clearing: ClassVar = 0.5
    type: Literal["Fence"] = "Fence"
    kind: Literal["wildlife", "rails"] = Field("wildlife", description="Wire mesh or rails of wood.")
    height: float = quantity(1.8, ge=0.5, le=4, unit="m", description="Top of the posts above the surface.")
    post_spacing: float = quantity(5.0, ge=1, le=20, unit="m", description="Distance between posts.")
    post_diameter: float = quantity(0.1, ge=0.03, le=0.4, unit="m", description="Diameter of the posts.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a fence."""
        return TwinTypes("IfcRailing.FENCE", "barrier.fence")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half a post."""
        return self.post_diameter / 2.0, self.post_diameter / 2.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of bands and posts in local coordinates; none off the road."""
        end = self.end_on(course.length)
        if end is None:
            return []
        station = self.posts(end)
        feet, left_vectors = course.feet(station, self.offset_at(station)), course.left(station)
        corner_sides, corner_levels = np.array([1.0, 1.0, -1.0, -1.0]), np.array([0.0, 1.0, 1.0, 0.0])
        bands = []
        for band in KINDS[self.kind]:
            height = self.height * (band.low + (band.high - band.low) * corner_levels)
            bands.append(
                Body(sweep(feet, left_vectors, corner_sides * band.thickness / 2.0, height), MATERIALS[self.kind])
            )
        return bands + [Body(self._post(*place), "noise_wood") for place in zip(feet, left_vectors, strict=True)]

    def posts(self, end: float) -> Float:
        """Return the stations (N,), m, of its posts if it ends at a station (m)."""
        last_station = min(self.end_station, end)  # the fence may say that it goes on far beyond the road's end
        count = int(np.ceil((last_station - self.start_station) / self.post_spacing - 1e-4)) + 1
        station = np.minimum(self.start_station + np.arange(count) * self.post_spacing, last_station)
        return np.append(station[station < end - 1e-3], end)

    def _post(self, foot: Float, left: Float) -> Float:
        """Return the sections of a post on a foot (3,), one of its corners to the left (unit vector (3,))."""
        outline, forward = circle(self.post_diameter, SIDES), np.array([-left[1], left[0], 0.0])
        corners = foot + outline[:, :1] * left + outline[:, 1:] * forward
        return np.stack([corners - (0.0, 0.0, BURIED), corners + (0.0, 0.0, self.height)])

    def footprint(self) -> Iterator[Block]:
        """Yield the box around posts and bands, in which nothing else may stand."""
        yield self.strip(*self.reach(), self.height)
