"""Vehicles in traffic."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.parameters.geometry import RoadGeometry
from ...core.parameters.model import Carriageway, PointObject, Vehicle
from ..materials import material
from ..model_builder import ModelBuilder
from ..nodes.vehicle import COLOR, vehicle_group

MATERIALS = {
    "Paint": "car_paint",
    "Glass": "glass",
    "Rubber": "rubber",
    "Chrome": "chrome",
    "Black": "plastic_black",
    "White Light": "lamp_glass",
    "Red Light": "lamp_red",
    "Plate": "sheeting_white",
    "Cover": "tarpaulin",
}
"""Material inputs of the groups (their names go on with "Material") -> entries of the material table."""


def build_vehicles(builder: ModelBuilder) -> None:
    """Make one object per vehicle, so that each can be moved on its own."""
    for name, vehicle in builder.parameters.of_type(Vehicle).items():
        place = vehicle_place(builder.geometry, vehicle)
        ahead = -1.0 if place.rotation_deg else 1.0
        grade = ahead * builder.geometry.profile.grade(np.array([vehicle.station]))
        mesh = builder.points("Vehicle", [place], {COLOR: np.array([vehicle.color]), "grade": grade})
        inputs: dict[str, Any] = {f"{key} Material": material(entry) for key, entry in MATERIALS.items()}
        inputs["Road"] = builder.objects["Road"]
        builder.add(name, mesh, vehicle_group(vehicle.model), inputs)


def vehicle_place(geometry: RoadGeometry, vehicle: Vehicle) -> PointObject:
    """Return where a vehicle's middle is at the time 0: in the middle of its lane, turned as the traffic there."""
    carriageway = geometry.parameters.objects[vehicle.carriageway]
    assert isinstance(carriageway, Carriageway)
    boundaries = geometry.sections[carriageway.side].lane_boundaries(vehicle.station)[0]
    distance = float(boundaries[vehicle.lane] + boundaries[vehicle.lane + 1]) / 2.0
    return PointObject(
        instance=vehicle.instance,
        station=vehicle.station,
        offset=carriageway.sign * distance,
        rotation_deg=0.0 if carriageway.traffic > 0 else 180.0,
    )
