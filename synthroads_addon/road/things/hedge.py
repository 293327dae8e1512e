"""Hedges along the road: leaves and twigs within an outline that is cut to shape."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ...base.schema import quantity
from .body import Body, Course, sweep
from .limits import Interval, Limits, interval
from .thing import Block, LengthwiseThing, TwinTypes

OUTLINE = ((0.92, 0.0), (1.0, 0.45), (0.9, 0.88), (0.6, 1.0))
"""One flank of a hedge from its foot to its top, as shares of half its width and of its height."""
LEAVES = 42.0
"""Leaves for each square metre of a hedge's flanks and top."""


class HedgeLimits(Limits):
    """Limits of hedges."""

    group: ClassVar = "roadside"
    place: ClassVar = 20
    allowed: ClassVar = {
        "hedges_per_km": (0.0, 50.0),
        "hedge_distance": (0.5, 50.0),
        "hedge_length": (2.0, 1e4),
        "hedge_height": "height",
        "hedge_width": "width",
    }

    hedges_per_km: Interval = interval(0.0, 4.0, "1/km", "Hedges per km of either side.", title="Hedges (per km)")
    hedge_distance: Interval = interval(
        3.5, 6.0, "m", "From the verge's outer edge to hedges.", title="Hedges' Distance"
    )
    hedge_length: Interval = interval(15.0, 70.0, "m", "Length of hedges.")
    hedge_height: Interval = interval(1.2, 3.0, "m", "Height of hedges.")
    hedge_width: Interval = interval(0.8, 1.6, "m", "Width of hedges.")


class Hedge(LengthwiseThing):
    """A hedge along the road. Its offset is that of its middle."""

    points_class: ClassVar = "vegetation"
    order: ClassVar = 155
    limits: ClassVar = HedgeLimits
    clearing: ClassVar = 0.5
    left_out: ClassVar = "leaves and twigs: the outline that they are cut to stands for them"
    type: Literal["Hedge"] = "Hedge"
    height: float = quantity(1.8, ge=0.3, le=8, unit="m", description="Top above the surface.")
    width: float = quantity(1.2, ge=0.3, le=5, unit="m", description="Width where it is widest.")
    seed: int = quantity(0, ge=0, le=2**31 - 1, unit="1", description="Seed of its leaves.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: vegetation."""
        return TwinTypes("IfcGeographicElement.VEGETATION", "vegetation.hedge", "PlantCover")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half its width."""
        return self.width / 2.0, self.width / 2.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed outline that its leaves fill, in local coordinates; none off the road."""
        line = self.line(course)
        if line is None:
            return []
        flank = np.array(OUTLINE)
        flank_offsets = np.append(flank[:, 0], -flank[::-1, 0]) * self.width / 2.0
        flank_heights = np.append(flank[:, 1], flank[::-1, 1]) * self.height
        return [Body(sweep(*line, flank_offsets, flank_heights), "leaves")]

    def leaves_per_metre(self) -> int:
        """Return the number of leaves in each metre of its length."""
        return max(1, round(LEAVES * (2.0 * self.height + self.width)))

    def footprint(self) -> Iterator[Block]:
        """Yield the box around the hedge, in which nothing else may stand."""
        yield self.strip(*self.reach(), self.height)
