"""Objects with a frame of their own: x to the right of traffic with the stations, y along it, z up."""

from __future__ import annotations

import numpy as np

from ...road.parameters import PointObject
from .model_builder import ModelBuilder


def stand(builder: ModelBuilder, role: str, item: PointObject, rotation_deg: float = 0.0) -> None:
    """Put an added object to a point object's place in plan, at the axis's elevation, turned by `rotation_deg`."""
    station = np.array([item.station])
    position, heading, _ = builder.geometry.alignment.frame(station)
    left = np.array([-np.sin(heading[0]), np.cos(heading[0])])
    place = np.array([*(position[0] + item.offset * left), builder.geometry.profile.elevation(station)[0]])
    made = builder.objects[role]
    made.location = tuple((place - builder.origin).tolist())
    made.rotation_euler = (0.0, 0.0, float(heading[0] - np.pi / 2 + np.deg2rad(rotation_deg)))
