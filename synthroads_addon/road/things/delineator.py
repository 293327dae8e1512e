"""Delineator posts, Leitpfosten."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Place, box
from .limits import Limits
from .thing import Block, StandingThing, TwinTypes

OUTLINE = (
    (-0.06, -0.050), (-0.045, -0.055), (0.05, -0.014), (0.06, 0.0), (0.05, 0.014), (-0.045, 0.055), (-0.06, 0.05),
)  # fmt: skip
"""A delineator's cross-section from above, x away from the road, y along the driver's way: a triangle 0.12 m wide."""
TOP, SLANT = 0.964, 0.6
"""Top of a delineator of 1 m on its axis (m), and the rise of its top and its band away from the road (m/m)."""
REFLECTOR = (0.04, 0.18, 0.765)
"""Width and height of the upright reflector, and the height of the reflectors' middle on a post of 1 m, m."""
REACH = 0.06
"""Half the width of a delineator, m."""


class DelineatorLimits(Limits):
    """Whether there are delineators."""

    place: ClassVar = 20

    delineators: bool = Field(True, description="Delineator posts.")


class Delineator(StandingThing):
    """A delineator post (Leitpfosten) beside the road."""

    points_class: ClassVar = "warning_post"
    order: ClassVar = 50
    limits: ClassVar = DelineatorLimits
    type: Literal["Delineator"] = "Delineator"
    height: float = quantity(1.0, ge=0.3, le=1.5, unit="m", description="Top above the surface.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a marker."""
        return TwinTypes("IfcSign.MARKER", "pole.delineator")

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solid of the post with its slanted top, in its frame, and the box of its reflectors."""
        outline = np.array(OUTLINE)
        top = TOP + SLANT * outline[:, 0]
        ends = [np.column_stack([outline, z * self.height]) for z in (np.full(len(outline), -BURIED), top)]
        glass_width, glass_height, glass_middle = REFLECTOR
        glass = box(
            (glass_width + 0.03, 0.104, (glass_height + 0.02) * self.height), (0.0, 0.0, glass_middle * self.height)
        )
        return [Body(np.stack(ends), "plastic_white"), Body(glass, "reflector", detail=glass_width)]

    def footprint(self) -> Iterator[Block]:
        """Yield the post's box, in which nothing else may stand."""
        yield self.upright(REACH, self.height)
