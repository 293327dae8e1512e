"""How high the pavement lies below what spans the road."""

from __future__ import annotations

import math

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.surface import highest_pavement
from .scene import IfcPlace

_ACROSS = 0.05
"""Distance (m) of the points across the road at which the pavement is looked at: 3.5 mm at 7 % crossfall."""
_ROWS = 7


def pavement_below(
    geometry: RoadGeometry, place: IfcPlace, along: tuple[float, float], across: tuple[float, float], shear: float = 0.0
) -> float:
    """Return the local elevation (m) of the pavement's highest point below something; without any, the place's.

    Args:
        geometry: the road.
        place: frame of what spans the road.
        along: its rear and front end in the frame, m.
        across: its left and right end there, m.
        shear: by how much it lies farther back per metre to the left (m/m): a skew bridge.
    """
    left, right = across
    count = max(2, math.ceil((left - right) / _ACROSS) + 1)
    beside, ahead = np.meshgrid(np.linspace(left, right, count), np.linspace(*along, _ROWS))
    y, x = beside.ravel(), (ahead - shear * beside).ravel()
    cosine, sine = math.cos(place.heading), math.sin(place.heading)
    plan = place.origin[:2] + np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
    station, offset = geometry.alignment.project(plan)
    highest = highest_pavement(geometry, station, offset)
    return float(place.origin[2]) if highest is None else highest
