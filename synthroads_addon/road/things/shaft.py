"""Shafts of the road's drainage: inlets under a grating, manholes under a round cover."""

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .body import BURIED, Body, Place, box, post
from .limits import Interval, Limits, interval
from .thing import Block, StandingThing, TwinTypes

SIDES = 16
"""Corners of a manhole's ring and cover."""
LID, LID_RISE = 0.76, 0.006
"""Width of grating or cover as a share of the shaft's, and height by which it stands out of the concrete, m."""
SLOTS, SLOT_RISE = 7, 0.001
"""Slots of a grating, and by how much what shows them stands out of it, m."""
SLOT = (0.86, 0.45)
"""Length of a slot as a share of the grating's, and its width as one of the distance between two."""


class ShaftLimits(Limits):
    """Limits of shafts."""

    place: ClassVar = 75
    allowed: ClassVar = {"shaft_spacing": (10.0, 1e4), "shaft_size": "size"}

    shafts: bool = Field(True, description="Shafts of the drainage beside the road.")
    shaft_spacing: Interval = interval(50.0, 80.0, "m", "Distance from one shaft to the next.", title="Shafts (every)")
    shaft_size: Interval = interval(0.5, 0.7, "m", "Width of inlets, diameter of manholes.")


class Shaft(StandingThing):
    """The top of a shaft, of concrete, with a grating or a cover of cast iron."""

    points_class: ClassVar = "utility"
    order: ClassVar = 115
    limits: ClassVar = ShaftLimits
    type: Literal["Shaft"] = "Shaft"
    kind: Literal["inlet", "manhole"] = Field("inlet", description="Square with a grating, or round with a cover.")
    size: float = quantity(0.6, ge=0.3, le=1.5, unit="m", description="Width of an inlet, diameter of a manhole.")
    height: float = quantity(0.05, ge=0, le=0.5, unit="m", description="Top of its concrete above the surface.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a gully or a manhole."""
        entity = "IfcWasteTerminal.GULLYSUMP" if self.kind == "inlet" else "IfcDistributionChamberElement.MANHOLE"
        return TwinTypes(entity, f"obstacle.{self.kind}", kind=self.kind)

    def bodies(self, place: Place) -> list[Body]:
        """Return the shaft's bodies in its own frame: its concrete, and grating and slots, or the cover, as details."""
        lid_width, concrete_height, top = self.size * LID, self.height + BURIED, self.height + LID_RISE
        if self.kind == "manhole":
            concrete, cover = (
                post(self.size, -BURIED, self.height, sides=SIDES),
                post(lid_width, self.height, top, sides=SIDES),
            )
            return [Body(concrete, "concrete"), Body(cover, "galvanised_steel", "cover", detail=LID_RISE)]
        frame = box((self.size, self.size, concrete_height), (0.0, 0.0, concrete_height / 2.0 - BURIED))
        grating = box((lid_width, lid_width, LID_RISE), (0.0, 0.0, self.height + LID_RISE / 2.0))
        slots = box((lid_width, lid_width, SLOT_RISE), (0.0, 0.0, top + SLOT_RISE / 2.0))
        return [
            Body(frame, "concrete"),
            Body(grating, "galvanised_steel", "grating", detail=LID_RISE),
            Body(slots, "plastic_black", "slots", detail=SLOT_RISE),
        ]

    def footprint(self) -> Iterator[Block]:
        """Yield the box that holds it, however it is turned; nothing else may stand there."""
        radius = self.size / 2.0 * (2.0**0.5 if self.kind == "inlet" else 1.0)
        yield self.upright(radius, self.height + LID_RISE)
