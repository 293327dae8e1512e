"""The frame of something that stands at one place: x right and y on, as those see it who drive towards it, z up."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.road.objects import PointObject
from tests.helpers.scenes.furnished_road import Float, FurnishedRoad


def axes(road: FurnishedRoad, name: str) -> Float:
    """Return the axes x, y, z (3, 3) of an object's frame as rows."""
    item = road.parameters.objects[name]
    assert isinstance(item, PointObject)
    turn = float(road.geometry.alignment.heading(item.station)) + np.deg2rad(item.rotation_deg)
    return np.array([[np.sin(turn), -np.cos(turn), 0.0], [np.cos(turn), np.sin(turn), 0.0], [0.0, 0.0, 1.0]])


def own_frame(road: FurnishedRoad, name: str, points: NDArray[Any]) -> Float:
    """Return scene points (..., 3) in an object's frame, whose origin is its foot."""
    item = road.parameters.objects[name]
    assert isinstance(item, PointObject)
    foot = road.point(item.station, item.offset) + [0.0, 0.0, item.elevation]
    return (points.astype(np.float64) - foot) @ axes(road, name).T
