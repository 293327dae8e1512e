"""Vehicles in traffic."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....road.lane_lines import LaneLine, lane_of
from ....road.parameters import PointObject, Vehicle
from ....road.things.vehicles import CHASSIS
from ...materials import material
from ...materials.vehicles import COLOR
from ..model_builder import ModelBuilder
from .vehicle import vehicle_group

MATERIALS = {
    "Paint": "car_paint",
    "Glass": "glass",
    "Rubber": "rubber",
    "Chrome": "chrome",
    "Black": "plastic_black",
    "White Light": "lamp_glass",
    "Red Light": "lamp_red",
    "Plate": "number_plate",
    "Cover": "tarpaulin",
}
"""Material inputs of the groups (their names go on with "Material") -> entries of the material table."""


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
        inputs: dict[str, Any] = {f"{key} Material": material(entry) for key, entry in MATERIALS.items()}
        inputs["Road"] = builder.objects["Road"]
        builder.add(name, mesh, vehicle_group(vehicle.model), inputs)


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
