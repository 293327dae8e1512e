"""Concrete barriers."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.schema import quantity
from .body import Body, Course, sweep
from .limits import Limits, share
from .thing import Block, LengthwiseThing, TwinTypes

FLANKS = {
    "step": ((1.0, 0.0), (0.945, 0.275), (0.70, 0.29), (0.445, 0.972), (0.40, 1.0)),
    "new_jersey": ((1.0, 0.0), (1.0, 0.095), (0.44, 0.41), (0.31, 0.972), (0.265, 1.0)),
}
"""One flank of a concrete barrier from the foot to the top, as shares of half the foot's width and of the height
(EN 1317 barriers of 0.54 m x 0.90 m and 0.60 m x 0.81 m)."""
BURIED = 0.1
"""Depth of a concrete barrier's foot below the surface, m."""
TIP = 0.08
"""Height at which a concrete barrier's ramped end breaks off, m."""


class ConcreteLimits(Limits):
    """How many barriers are of concrete."""

    group: ClassVar = "barriers"
    place: ClassVar = 10

    concrete_median: float = share(
        0.3, "Probability that the median's barrier is of concrete.", title="Of Concrete in the Median"
    )
    concrete_roadside: float = share(
        0.1, "Probability that a roadside barrier is of concrete.", title="Of Concrete at the Edges"
    )


class ConcreteBarrier(LengthwiseThing):
    """A concrete barrier, symmetric about its axis."""

    points_class: ClassVar = "barrier"
    order: ClassVar = 20
    limits: ClassVar = ConcreteLimits
    type: Literal["ConcreteBarrier"] = "ConcreteBarrier"
    profile: Literal["new_jersey", "step"] = Field("step", description="Shape of its cross-section.")
    height: float = quantity(0.9, ge=0.4, le=2.0, unit="m", description="Top above the surface.")
    base_width: float = quantity(0.54, ge=0.3, le=1.2, unit="m", description="Width of its foot.")
    terminal_length: float = quantity(8.0, ge=0, le=50, unit="m", description="Length over which either end is ramped.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a barrier of concrete."""
        return TwinTypes("IfcRailing.GUARDRAIL", "barrier.concreteBarrier")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half its foot's width."""
        return self.base_width / 2.0, self.base_width / 2.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the barrier's closed solid in local coordinates, ramped down at its ends; none off the road."""
        end = self.end_on(course.length)
        if end is None:
            return []
        ramp = self.ramp_length(end)
        station = course.rows(self.offset_at, self.start_station, end, (self.start_station + ramp, end - ramp))
        flank = np.array([(1.0, 0.0), *FLANKS[self.profile]])
        half_width_shares, height_shares = (
            np.append(flank[:, 0], -flank[::-1, 0]),
            np.append(flank[:, 1], flank[::-1, 1]),
        )
        height = height_shares * np.maximum(self.height * self.height_share(end, station), TIP)[:, None]
        height[:, [0, -1]] = -BURIED
        feet = course.feet(station, self.offset_at(station))
        return [
            Body(
                sweep(feet, course.left(station), half_width_shares * self.base_width / 2.0, height), "barrier_concrete"
            )
        ]

    def footprint(self) -> Iterator[Block]:
        """Yield the barrier's box, in which nothing else may stand."""
        yield self.strip(*self.reach(), self.height)
