"""Parked vehicles: those of the traffic, on the ground beside the road."""

from __future__ import annotations

import numpy as np

from ...road.things.parked_vehicle import ParkedVehicle
from ..materials.looks import COLOR
from .model_builder import ModelBuilder
from .registry import model_part
from .vehicle.vehicle import vehicle_group


@model_part("parked_vehicles", 164)
def build_parked_vehicles(builder: ModelBuilder) -> None:
    """Add one object per parked vehicle to the model."""
    ground = builder.objects.get("Terrain", builder.objects["Road"])
    for name, vehicle in builder.parameters.of_type(ParkedVehicle).items():
        attributes = {COLOR: np.array([vehicle.color]), "grade": np.zeros(1)}
        mesh = builder.points("Vehicle", [vehicle], attributes)
        builder.add(name, mesh, vehicle_group(vehicle.model), {"Road": ground}, frame=builder.frame(vehicle))
