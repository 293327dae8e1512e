"""Walls of gardens and yards, with a coping."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Course, sweep
from .limits import Interval, Limits, interval, share
from .thing import Block, LengthwiseThing, TwinTypes

COPING, OVERHANG = 0.07, 0.03
"""Height of a wall's coping, and how far it stands out on either side, m."""
MATERIALS = {"plaster": "plaster", "brick": "brick", "concrete": "noise_concrete"}
"""Kind of wall -> its material; the coping is of concrete."""


class WallLimits(Limits):
    """Limits of walls."""

    group: ClassVar = "roadside"
    place: ClassVar = 40
    allowed: ClassVar = {"wall_height": "height"}

    walls: float = share(0.4, "Probability that a building's yard has a wall towards the road.")
    wall_height: Interval = interval(1.0, 2.2, "m", "Height of walls.")


class Wall(LengthwiseThing):
    """A wall along the road, with a coping. Its offset is that of its middle."""

    points_class: ClassVar = "roadside"
    order: ClassVar = 160
    limits: ClassVar = WallLimits
    clearing: ClassVar = 0.5
    type: Literal["Wall"] = "Wall"
    kind: Literal["plaster", "brick", "concrete"] = Field("plaster", description="What its faces are of.")
    height: float = quantity(1.8, ge=0.3, le=6, unit="m", description="Top of the coping above the surface.")
    thickness: float = quantity(0.24, ge=0.08, le=1, unit="m", description="Thickness below the coping.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a wall that stands by itself."""
        return TwinTypes("IfcWall.SOLIDWALL", "barrier.wall")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half its coping."""
        half_width = self.thickness / 2.0 + OVERHANG
        return half_width, half_width

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of wall and coping in local coordinates; none off the road."""
        line = self.line(course)
        if line is None:
            return []
        side, is_upper = np.array([1.0, 1.0, -1.0, -1.0]), np.array([False, True, True, False])
        body_top, half_thickness = self.height - COPING, self.thickness / 2.0
        wall = sweep(*line, side * half_thickness, np.where(is_upper, body_top, -BURIED))
        coping = sweep(*line, side * (half_thickness + OVERHANG), np.where(is_upper, self.height, body_top))
        return [Body(wall, MATERIALS[self.kind]), Body(coping, "noise_concrete")]

    def footprint(self) -> Iterator[Block]:
        """Yield the box around the wall, in which nothing else may stand."""
        yield self.strip(*self.reach(), self.height)
