"""Vehicles as they stand at the time 0: boxes around them, on their wheels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..base.arrays import Float
from ..road.geometry import RoadGeometry
from ..road.lane_lines import wheel_pose
from ..road.lanes import lane_of
from ..road.surroundings import RampVehicle, Vehicle
from ..road.things.body import box
from ..road.things.vehicles import CHASSIS, VEHICLE_TYPES


class PlacedVehicle(NamedTuple):
    """A vehicle at time 0: its place on the road and its rotation.

    Attributes:
        name: its id.
        vehicle: what it is.
        station, offset: of its middle along the main road, m.
        place: (3,) local, on the road below its middle, m.
        rotation: (3, 3) whose columns point ahead, to the left and up.
    """

    name: str
    vehicle: Vehicle
    station: float
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
        offset = line.offset(station)
        if isinstance(vehicle, RampVehicle):
            station, offset = geometry.alignment.project(place[:, :2])
        yield PlacedVehicle(name, vehicle, float(station[0]), float(offset[0]), place[0], rotation[0])
