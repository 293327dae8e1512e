"""Benches: fields, limits, bodies and types of a thing of the road."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from synthroads_addon.base.schema import quantity
from synthroads_addon.road.things.body import Body, Place, box
from synthroads_addon.road.things.limits import Interval, Limits, interval
from synthroads_addon.road.things.thing import Block, StandingThing, TwinTypes

SEAT, LEG = 0.08, 0.12
"""Thickness of the seat, and width of a leg, m."""


class BenchLimits(Limits):
    """Limits of benches."""

    allowed: ClassVar = {"benches_per_km": (0.0, 100.0), "bench_width": "width"}

    benches_per_km: Interval = interval(0.0, 0.0, "1/km", "Benches per km.", title="Benches (per km)")
    bench_width: Interval = interval(1.5, 2.0, "m", "Width of benches.", title="Their Width")


class Bench(StandingThing):
    """A bench beside the road: a seat on two legs."""

    points_class: ClassVar = "utility"
    limits: ClassVar = BenchLimits
    type: Literal["Bench"] = "Bench"
    width: float = quantity(1.8, "m", "Width of the seat, seen by the traffic beside it.", (0.8, 4))
    depth: float = quantity(0.5, "m", "Depth of the seat.", (0.3, 1))
    height: float = quantity(0.5, "m", "Top above the surface.", (0.3, 1))

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats."""
        return TwinTypes("IfcFurniture.USERDEFINED", "obstacle.bench")

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of the seat and its two legs, in its frame."""
        low, side = self.height - SEAT, (self.width - LEG) / 2.0
        seat = Body(box((self.width, self.depth, SEAT), (0.0, 0.0, self.height - SEAT / 2.0)), "noise_wood")
        legs = [Body(box((LEG, self.depth, low), (x, 0.0, low / 2.0)), "concrete") for x in (-side, side)]
        return [seat, *legs]

    def footprint(self) -> Iterator[Block]:
        """Yield the box that holds it, however it is turned; nothing else may stand there."""
        yield self.upright(max(self.width, self.depth) / 2.0, self.height)
