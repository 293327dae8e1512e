"""Vehicles as they stand at the time 0: boxes around them, on their wheels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..base.arrays import Float
from ..road.geometry import RoadGeometry
from ..road.lane_lines import lane_of, wheel_pose
from ..road.surroundings import Vehicle
from ..road.things.body import box
from ..road.things.vehicles import CHASSIS, VEHICLE_TYPES


class PlacedVehicle(NamedTuple):
    """A vehicle at time 0: its place on the road and its rotation.

    Attributes:
        name: its id.
        vehicle: what it is.
        offset: of its middle, m.
        place: (3,) local, on the road below its middle, m.
        rotation: (3, 3) whose columns point ahead, to the left and up.
    """

    name: str
    vehicle: Vehicle
    offset: float
    place: Float
    rotation: Float

    def box(self) -> Float:
        """Return the vehicle's bounding box as local sections (2, 4, 3), m."""
        kind = VEHICLE_TYPES[self.vehicle.model]
        around = box((kind.length, kind.width, kind.height), (0.0, 0.0, kind.height / 2.0))
        return around @ self.rotation.T + self.place


def placed_vehicles(geometry: RoadGeometry) -> Iterator[PlacedVehicle]:
    """Yield all vehicles of a road with their poses at time 0, in the parameter set's order."""
    for name, vehicle in geometry.parameters.of_type(Vehicle).items():
        line, station = lane_of(geometry, vehicle), np.array([vehicle.station])
        rotation, place = wheel_pose(line, CHASSIS[vehicle.model], station)
        yield PlacedVehicle(name, vehicle, float(line.offset(station)[0]), place[0], rotation[0])
