"""Gutters of concrete with a kerb, which lead water along the pavement's edge."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Course, sweep
from .limits import Limits
from .thing import Block, LengthwiseThing, TwinTypes

KERB = 0.4
"""Where the kerb begins, as a share of half the gutter's width from its middle."""
RIM, BOTTOM = 0.012, 0.004
"""Heights of the channel's edges and of its middle above the surface below them, m."""
_DEEPEST = -0.3
_FLOOR = (BURIED + BOTTOM) / (BURIED + RIM)
CHANNEL = ((KERB, 1.0), (_DEEPEST, _FLOOR), (-1.0, 1.0), (-1.0, 0.0), (_DEEPEST, 0.0), (KERB, 0.0))
"""Cross-section of the channel beside a kerb on its left: x to the left as a share of half the gutter's width, z as one
of the height from `BURIED` below the surface to its rim; clockwise as seen along the road."""
BLOCK = ((1.0, 0.0), (1.0, 1.0), (KERB, 1.0), (KERB, 0.0))
"""That of the kerb, z as a share of the height up to its top."""


class GutterLimits(Limits):
    """Whether there are gutters."""

    place: ClassVar = 74

    gutters: bool = Field(True, description="Gutters in the median where a carriageway falls towards it.")


class Gutter(LengthwiseThing):
    """A gutter along a pavement's edge. Its offset is that of its middle."""

    points_class: ClassVar = "utility"
    order: ClassVar = 157
    limits: ClassVar = GutterLimits
    type: Literal["Gutter"] = "Gutter"
    kerb_side: Literal["left", "right"] = Field("left", description="Side of its kerb, seen with the stations.")
    width: float = quantity(0.4, ge=0.2, le=1, unit="m", description="Width, kerb included.")
    height: float = quantity(0.08, ge=0.02, le=0.2, unit="m", description="Top of the kerb above the surface.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a gutter, which IFC counts among the pipes."""
        return TwinTypes("IfcPipeSegment.GUTTER", "obstacle.gutter")

    def reach(self) -> tuple[float, float]:
        """Return how far it reaches to the right and to the left of its axis, m: half its width."""
        return self.width / 2.0, self.width / 2.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of channel and kerb in local coordinates; none off the road."""
        line = self.line(course)
        if line is None:
            return []
        solids = []
        for outline, top in ((CHANNEL, RIM), (BLOCK, self.height)):
            width_shares, height_shares = np.array(outline if self.kerb_side == "left" else mirrored(outline)).T
            heights = height_shares * (top + BURIED) - BURIED
            solids.append(Body(sweep(*line, width_shares * self.width / 2.0, heights), "concrete"))
        return solids

    def footprint(self) -> Iterator[Block]:
        """Yield the box around the gutter, in which nothing else may stand."""
        yield self.strip(*self.reach(), self.height)


def mirrored(outline: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
    """Return a cross-section with left and right exchanged, clockwise as before."""
    return [(-x, z) for x, z in reversed(outline)]
