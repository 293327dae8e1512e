"""Where vehicles stand on the road: the places of their axles and wheels."""

from __future__ import annotations

from typing import NamedTuple


class Chassis(NamedTuple):
    """Where a vehicle stands on the road, m.

    Attributes:
        front, rear: places along it, from its middle to the front, of the middles of its front axles (a tractor's are
            all such) and of its hind ones.
        half_track: half the distance between its left and right wheels.
    """

    front: float
    rear: float
    half_track: float


CHASSIS = {
    "car": Chassis(1.29, -1.34, 0.78),
    "estate": Chassis(1.505, -1.285, 0.79),
    "van": Chassis(1.955, -1.71, 0.86),
    "truck": Chassis(3.40, -1.65, 1.0),
    "semitrailer": Chassis(5.0, -3.95, 1.02),
    "bus": Chassis(3.80, -2.975, 1.05),
    "motorcycle": Chassis(0.79, -0.73, 0.3),
}
"""Model of vehicle -> where it stands."""


def wheel_base(model: str) -> float:
    """Return the distance between a vehicle's front and hind axles, m."""
    return CHASSIS[model].front - CHASSIS[model].rear
