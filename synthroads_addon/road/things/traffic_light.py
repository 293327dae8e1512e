"""Traffic lights."""

import math
from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place, box, post, shift
from .limits import Limits, share
from .thing import Block, Signal, StandingThing, TwinTypes

CHAMBER, BOARD = (1.3, 0.7, 1.25), 1.9
"""A chamber of the housing (across, along, up) and the width of the board behind it, in diameters of a light."""
MARGIN = 0.05
"""Height of the board beyond the housing, above and below, m."""
BEHIND, RIM = 0.005, 0.004
"""From the post to the middle of the board's rim, and the rim's depth, m."""
PANEL, EDGE = (0.008, 0.001), 0.018
"""Depth of the board, and how far its middle is before its rim's; the width of the rim, m."""
VISOR = (0.56, 0.004, 0.55, 0.5)
"""A visor: radius in diameters of a light, thickness (m), reach in diameters, and how much farther per m above."""
VISOR_TURNS = tuple(math.radians(-35.0 + 250.0 * i / 8.0) for i in range(9))
"""Where the corners of a visor are around its light, rad."""
JOINT = 0.02
"""Difference between the heights of a place and of its chamber, in diameters of a light."""
POST = 0.089
"""Diameter of a traffic light's post, m."""


class TrafficLightLimits(Limits):
    """How many entries are metered."""

    place: ClassVar = 50

    traffic_lights: float = share(
        0.3, "Probability that an entry is metered by traffic lights.", title="Traffic Lights at an Entry"
    )


class TrafficLight(StandingThing):
    """A traffic light on its post, e.g. where an entry is metered."""

    points_class: ClassVar = "traffic_light"
    order: ClassVar = 90
    limits: ClassVar = TrafficLightLimits
    type: Literal["TrafficLight"] = "TrafficLight"
    height: float = quantity(3.2, ge=1.5, le=8, unit="m", description="Top above the surface.")
    lights: int = quantity(3, ge=1, le=4, unit="1", description="Number of lights.")
    light_diameter: float = quantity(0.2, ge=0.1, le=0.4, unit="m", description="Diameter of a light.")

    def level(self, number: int) -> float:
        """Return the height of the middle of a light, 0 the uppermost, above the surface, m."""
        return self.height - MARGIN - (number + 0.5) * self.light_diameter * CHAMBER[2]

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a signal."""
        return TwinTypes("IfcSignal.VISUAL", "pole.signalPost")

    def signals(self) -> dict[str, Signal]:
        """Return one changing signal for its head, with OpenDRIVE's number of lights one above the other."""
        return {"head": Signal("1000001", country="OpenDRIVE", dynamic=True)}

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of post, board, chambers and visors, in its frame; lights are a detail."""
        diameter, board_y = self.light_diameter, -POST / 2.0
        chamber_width, chamber_depth, chamber_height = (share * diameter for share in CHAMBER)
        housing_height = chamber_height * self.lights
        middle = (0.0, board_y - BEHIND, self.height - MARGIN - housing_height / 2.0)
        shapes = [box((diameter * BOARD, RIM, housing_height + 2.0 * MARGIN), middle)]
        panel_depth, panel_shift = PANEL
        panel_excess, panel_middle = 2.0 * (MARGIN - EDGE), (0.0, middle[1] - panel_shift, middle[2])
        shapes.append(box((diameter * BOARD - 2.0 * EDGE, panel_depth, housing_height + panel_excess), panel_middle))
        front = -chamber_depth + board_y - 0.01
        lamps = []
        for number in range(self.lights):
            level = self.level(number)
            shapes.append(
                box(
                    (chamber_width, chamber_depth, chamber_height - JOINT * diameter),
                    (0.0, -chamber_depth / 2.0 - 0.055, level),
                )
            )
            shapes.append(shift(self._visor(), (0.0, front, level)))
            lamps.append(box((diameter, 0.12 * diameter, diameter), (0.0, front - 0.06 * diameter, level)))
        mast = Body(post(POST, -BURIED, self.height - 0.03), "galvanised_steel")
        head = [Body(shape, "plastic_black", "head") for shape in shapes]
        return [*head, mast, *(Body(lamp, "lamp_red", "lamps", detail=0.12 * diameter) for lamp in lamps)]

    def _visor(self) -> Float:
        """Return the sections of a sheet bent over a light, open below, which reaches forward from its middle."""
        radius, thickness, reach, extra_reach = VISOR
        angles, outer_radius = np.array(VISOR_TURNS), radius * self.light_diameter
        directions = np.column_stack([np.cos(angles), np.zeros(len(angles)), np.sin(angles)])
        outline = np.concatenate([directions * outer_radius, directions[::-1] * (outer_radius - thickness)])
        depths = reach * self.light_diameter + extra_reach * np.maximum(outline[:, 2], 0.0)
        return np.stack([outline, outline - depths[:, None] * (0.0, 1.0, 0.0)])

    def footprint(self) -> Iterator[Block]:
        """Yield the box of its post, in which nothing else may stand."""
        yield self.upright(self.light_diameter / 2.0, self.height)
