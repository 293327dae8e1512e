"""Viewpoints on a road: a driver's, and one in the air.

Dimensions (m) and shares without a name here are chosen.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.section import Carriageway

EYE = 1.2
"""Height of a driver's eyes, m."""


@dataclass(frozen=True)
class Viewpoint:
    """Place, target and focal length of a camera.

    Attributes:
        place, target: local coordinates (3,) of the camera and of the point that it looks at, m.
        lens: focal length, mm on 36 mm.
    """

    place: NDArray[np.float64]
    target: NDArray[np.float64]
    lens: float


def aerial_view(parameters: RoadParameters) -> Viewpoint:
    """Return a view ahead from a quarter of the road's length, 46 m to the right of the axis and 26 m above."""
    station = 0.25 * parameters.alignment.length
    place, target = (station, -46.0, 26.0), (min(station + 95.0, parameters.alignment.length), 2.0, 0.0)
    return Viewpoint(place_on_road(parameters, *place), place_on_road(parameters, *target), 28.0)


def driver_view(parameters: RoadParameters) -> Viewpoint:
    """Return a driver's view 60 m ahead from the outermost lane with the stations, else of the only carriageway."""
    length = parameters.alignment.length
    carriageway = parameters.carriageway(parameters.traffic_side) or next(
        iter(parameters.of_type(Carriageway).values())
    )
    section = RoadGeometry(parameters).sections[carriageway.side]

    def lane_offset(station: float) -> float:
        """Return the offset (m) of the outermost lane's middle."""
        boundaries = section.lane_boundaries(station)[0]
        return carriageway.sign * float(boundaries[:2].mean())

    view_share = 60.0 / length
    place_share, target_share = (0.3, 0.3 + view_share) if carriageway.traffic > 0 else (0.7, 0.7 - view_share)
    target_share = float(np.clip(target_share, 0.0, 1.0))
    return Viewpoint(
        place_on_road(parameters, place_share * length, lane_offset(place_share * length), EYE),
        place_on_road(parameters, target_share * length, lane_offset(target_share * length), EYE + 0.6),
        26.0,
    )


def place_on_road(parameters: RoadParameters, station: float, offset: float, height: float) -> NDArray[np.float64]:
    """Return the local point (3,), m, at a height above the surface; beside the road, above its edge."""
    geometry = RoadGeometry(parameters)
    offsets = geometry.offsets(station)[0]
    point = geometry.point(station, np.clip(offset, float(offsets[-1]), float(offsets[0])))[0]
    plan, heading, _ = geometry.alignment.frame(np.array([station]))
    left_direction = np.array([-np.sin(heading[0]), np.cos(heading[0])])
    return np.array([*(plan[0] + offset * left_direction), point[2] + height])
