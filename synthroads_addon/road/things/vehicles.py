"""The types of vehicles: their sizes, where they stand on the road, how often they occur, and in what colours."""

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class VehicleType:
    """A type of vehicle, with the outer dimensions of a common one.

    Attributes:
        length, width, height: m, without mirrors; a motorcycle's with its rider.
        heavy: whether it is one of those that drive slowly and keep to the outer lanes.
        weight: how often it occurs among the heavy, or the other, vehicles.
    """

    length: float
    width: float
    height: float
    heavy: bool
    weight: float


VEHICLE_TYPES = {
    "car": VehicleType(4.30, 1.80, 1.47, heavy=False, weight=0.52),
    "estate": VehicleType(4.77, 1.83, 1.50, heavy=False, weight=0.26),
    "van": VehicleType(5.93, 2.02, 2.64, heavy=False, weight=0.18),
    "motorcycle": VehicleType(2.20, 0.90, 1.45, heavy=False, weight=0.04),
    "truck": VehicleType(9.50, 2.55, 3.60, heavy=True, weight=0.30),
    "semitrailer": VehicleType(16.50, 2.55, 4.00, heavy=True, weight=0.58),
    "bus": VehicleType(13.00, 2.55, 3.75, heavy=True, weight=0.12),
}
"""Model of a `Vehicle` -> its type. The widths of heavy ones, and the semitrailer's length and height, are the EU's
limits (directive 96/53/EC)."""


class Chassis(NamedTuple):
    """Places of a vehicle's axles and wheels, by which it stands on the road, m.

    Attributes:
        front, rear: places along it, from its middle to the front, of the middles of its front axles (a tractor's are
            all such) and of its hind ones.
        half_track: half the distance between its left and right wheels.
    """

    front: float
    rear: float
    half_track: float

    @property
    def wheel_base(self) -> float:
        """Return the distance between the middles of its front and its hind axles, m."""
        return self.front - self.rear


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

HEAVY_SPEED = 25.0
"""Heavy vehicles drive at most so fast, m/s: their limiters act at 90 km/h."""
VEHICLE_GAP = 15.0
"""Least clear distance between two vehicles in a lane, m."""
VEHICLE_LANE_WIDTH = 2.5
"""Nobody drives where the lane is narrower, m."""
VEHICLE_ROOM = 1.5
"""Room that a vehicle needs to either side of its lane's centre, m."""

COLORS = {
    (0.30, 0.31, 0.32): 0.31,  # grey and silver
    (0.015, 0.015, 0.017): 0.25,  # black
    (0.75, 0.75, 0.73): 0.21,  # white
    (0.02, 0.06, 0.20): 0.11,  # blue
    (0.35, 0.02, 0.02): 0.07,  # red
    (0.03, 0.09, 0.05): 0.02,  # green
    (0.60, 0.35, 0.02): 0.02,  # orange and yellow
    (0.12, 0.07, 0.04): 0.01,  # brown
}
"""Linear base colour -> its share, about as cars are registered in Germany."""
