"""Vehicles in traffic."""

from __future__ import annotations

import numpy as np

from ....road.lane_lines import LaneLine, lane_of
from ....road.parameters import PointObject, Vehicle
from ....road.things.vehicles import CHASSIS
from ...materials.looks import COLOR
from ..model_builder import ModelBuilder
from .vehicle import vehicle_group

MATERIALS = {
    "Paint Material": "car_paint",
    "Glass Material": "glass",
    "Rubber Material": "rubber",
    "Chrome Material": "chrome",
    "Black Material": "plastic_black",
    "White Light Material": "lamp_glass",
    "Red Light Material": "lamp_red",
    "Plate Material": "number_plate",
    "Cover Material": "tarpaulin",
}
"""Material inputs of the groups -> entries of the material table."""


def build_vehicles(builder: ModelBuilder) -> None:
    """Make one object per vehicle, so that each can be moved on its own."""
    lines: dict[tuple[str, int], LaneLine] = {}
    for name, vehicle in builder.parameters.of_type(Vehicle).items():
        lane = (vehicle.carriageway, vehicle.lane)
        if lane not in lines:
            lines[lane] = lane_of(builder.geometry, vehicle)
        grade = lines[lane].carriageway.traffic * builder.geometry.profile.grade(np.array([vehicle.station]))
        place = vehicle_place(lines[lane], vehicle)
        mesh = builder.points("Vehicle", [place], {COLOR: np.array([vehicle.color]), "grade": grade})
        builder.add(name, mesh, vehicle_group(vehicle.model), MATERIALS)


def vehicle_place(line: LaneLine, vehicle: Vehicle) -> PointObject:
    """Return where a vehicle is at the time 0: its middle on its lane's line, looking along it with the traffic."""
    station = np.array([vehicle.station])
    turn = float(np.rad2deg(line.turn(station, CHASSIS[vehicle.model].wheel_base / 2.0)[0]))
    return PointObject(
        instance=vehicle.instance,
        station=vehicle.station,
        offset=float(line.offset(station)[0]),
        rotation_deg=turn if line.carriageway.traffic > 0 else 180.0 + turn,
    )
