"""Vehicles that are parked beside the road, in yards."""

import math
from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ..objects import Color
from .body import Body, Place, box
from .limits import Interval, Limits, interval
from .thing import Block, StandingThing, TwinTypes
from .vehicles import VEHICLE_TYPES


class ParkedVehicleLimits(Limits):
    """Limits of parked vehicles."""

    group: ClassVar = "roadside"
    place: ClassVar = 50
    allowed: ClassVar = {"parked_per_building": (0.0, 20.0)}

    parked_per_building: Interval = interval(
        0.0, 3.0, "1", "Vehicles parked beside each building.", title="Parked Vehicles"
    )


class ParkedVehicle(StandingThing):
    """A vehicle that stands beside the road; it looks along the stations if it isn't turned."""

    points_class: ClassVar = "vehicle"
    order: ClassVar = 180
    limits: ClassVar = ParkedVehicleLimits
    clearing: ClassVar = 0.3
    left_out: ClassVar = "the vehicle's shape: the box around it stands for it"
    type: Literal["ParkedVehicle"] = "ParkedVehicle"
    model: Literal["car", "estate", "van", "truck", "semitrailer", "bus", "motorcycle"] = Field(
        "car", description="Type of vehicle."
    )
    color: Color = (0.4, 0.4, 0.4)

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a vehicle."""
        return TwinTypes("IfcVehicle.VEHICLEWHEELED", "obstacle.vehicle", kind=self.model)

    def bodies(self, place: Place) -> list[Body]:
        """Return the box around it in its frame."""
        kind = VEHICLE_TYPES[self.model]
        size = (kind.width, kind.length, kind.height)
        return [Body(box(size, (0.0, 0.0, kind.height / 2.0)), "car_paint")]

    def footprint(self) -> Iterator[Block]:
        """Yield the box that holds it, in which nothing else may stand."""
        kind = VEHICLE_TYPES[self.model]
        sine, cosine = abs(math.sin(self.turn)), abs(math.cos(self.turn))
        length, width = cosine * kind.length + sine * kind.width, sine * kind.length + cosine * kind.width
        s, d, z = self.station, self.offset, self.elevation
        yield Block("foot", s - length / 2.0, s + length / 2.0, d - width / 2.0, d + width / 2.0, z, z + kind.height)
