"""Beacons (Leitbaken) of construction zones."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from ..objects import Side
from .body import Body, Place, box, circle, plate, prism, shift
from .limits import Interval, Limits, interval, share
from .thing import Block, StandingThing, TwinTypes

FOOT = (0.40, 0.80, 0.11)
"""A beacon's rubber foot: across the blade, along the road, height (m)."""
BLADE_BOTTOM = 0.16
"""Lower edge of a beacon's blade above the surface, m."""
BLADE = 0.045
"""Thickness of a beacon's blade, m."""
SHEETING = 0.002
"""Distance of the stripes from the blade, m."""
CORNER, SUNK = 0.06, 0.01
"""Cut at a foot's corners, and how far it is sunk, m."""
LEVELS = (0.7, (0.86, 0.92))
"""Height of a foot's lower part as a share, and the size of its upper one as shares of the lower's."""
TENON, TENON_MIDDLE = (0.07, 0.05, 0.1), 0.12
"""The tenon between foot and blade, and the height of its middle, m."""
HOUSING, HOUSING_MIDDLE = (0.11, 0.07, 0.12), 0.05
"""The lamp's housing, and the height of its middle above the blade, m."""
LENS, LENS_MIDDLE, LENS_SIDES = (0.095, 0.075), 0.17, 16
"""Radius and depth of the lamp's drum, the height of its middle above the blade (m), and its corners."""
LENS_PROUD = 0.03
"""How much deeper than the drum its glass is, m."""


def foot_outline() -> Float:
    """Return the outline (8, 2) of a beacon's foot, m, anticlockwise from above."""
    x, y, cut = FOOT[0] / 2.0, FOOT[1] / 2.0, CORNER
    half_outline = np.array([(x, cut - y), (x, y - cut), (x - cut, y), (cut - x, y)])
    return np.concatenate([half_outline, -half_outline])


_REACH = 0.1
"""Half of the room along the road, m."""


class ConstructionLimits(Limits):
    """Limits of construction zones."""

    place: ClassVar = 90
    allowed: ClassVar = {"construction_length": (0.0, 1e6)}

    construction_zone: float = share(0.1, "Probability that a sufficiently long carriageway has a construction zone.")
    construction_length: Interval = interval(120.0, 400.0, "m", "Length of a construction zone.")


class ConstructionBeacon(StandingThing):
    """A beacon (Leitbake) of a construction zone, red and white, its stripes falling to the side to pass it on."""

    points_class: ClassVar = "construction_barrier"
    order: ClassVar = 120
    limits: ClassVar = ConstructionLimits
    type: Literal["ConstructionBeacon"] = "ConstructionBeacon"
    pass_side: Side = Field(description="Side, seen along the stations, on which traffic passes it.")
    width: float = quantity(0.25, ge=0.1, le=0.6, unit="m", description="Width of its blade.")
    height: float = quantity(1.0, ge=0.5, le=2, unit="m", description="Height of its blade.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a marker."""
        return TwinTypes("IfcSign.MARKER", "obstacle.constructionBeacon")

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of blade, foot and lamp, in its frame."""
        top = BLADE_BOTTOM + self.height
        thickness = BLADE + 2.0 * SHEETING
        blade = box((self.width, thickness, self.height), (0.0, 0.0, (BLADE_BOTTOM + top) / 2.0))
        outline, (share, upper_scale) = foot_outline(), LEVELS
        feet = [
            prism(outline, -SUNK, FOOT[2] * share),
            prism(outline * upper_scale, 0.0, FOOT[2]),
            box(TENON, (0.0, 0.0, TENON_MIDDLE)),
        ]
        radius, lens_depth = LENS
        drum = plate(circle(2.0 * radius, LENS_SIDES), -lens_depth / 2.0, lens_depth / 2.0)
        lamp = [
            box(HOUSING, (0.0, 0.0, top + HOUSING_MIDDLE)),
            shift(drum, (0.0, 0.0, top + LENS_MIDDLE)),
        ]
        glass = box((2.0 * radius, lens_depth + LENS_PROUD, 2.0 * radius), (0.0, 0.0, top + LENS_MIDDLE))
        return [
            Body(blade, "sheeting_red"),
            *(Body(shape, "rubber") for shape in feet),
            *(Body(shape, "plastic_black") for shape in lamp),
            Body(glass, "lamp_yellow", "lens", detail=LENS_PROUD),
        ]

    def footprint(self) -> Iterator[Block]:
        """Yield the box of its blade, in which nothing else may stand."""
        body = self.upright(self.width / 2.0, self.height)
        yield body._replace(start=self.station - _REACH, end=self.station + _REACH)
