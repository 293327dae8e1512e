"""Power lines that cross the road: two lattice pylons, and the conductors between them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place, bar
from .limits import Interval, Limits, interval, share
from .thing import Block, StandingThing, TwinTypes

ARMS = ((0.66, 0.62), (0.78, 0.8), (0.9, 0.55))
"""Heights of a pylon's crossarms as shares of its own, and their reach as shares of the widest's half width."""
HALF_ARM = 0.26
"""Half the widest crossarm, as a share of the pylon's height."""
FOOT, TOP, WAIST = 0.075, 0.012, (0.6, 0.022)
"""Half a pylon's width at its foot and its top, and (height, half width) between, as shares of its height."""
PANELS = 7
"""Panels of bracing up to the waist."""
LEG, BRACE = 0.16, 0.07
"""Widths of legs and of braces, m."""
INSULATOR = 1.6
"""Length by which conductors hang below the crossarms, m."""
DIAMETER = 0.028
"""Diameter of a conductor, m."""
_ROWS = 24
"""Straight pieces of a conductor from pylon to pylon."""


class PowerLineLimits(Limits):
    """Limits of power lines that cross the road."""

    group: ClassVar = "roadside"
    place: ClassVar = 60
    allowed: ClassVar = {"pylon_height": "height"}

    power_line: float = share(0.25, "Probability that a power line crosses the road.")
    pylon_height: Interval = interval(28.0, 48.0, "m", "Height of its pylons.")


class PowerLine(StandingThing):
    """A span of a power line across the road at its station; at a rotation of 0 it crosses at right angles."""

    points_class: ClassVar = "utility"
    order: ClassVar = 190
    limits: ClassVar = PowerLineLimits
    clearing: ClassVar = 2.0
    type: Literal["PowerLine"] = "PowerLine"
    left_distance: float = quantity(130.0, ge=20, le=400, unit="m", description="From the axis to the left pylon.")
    right_distance: float = quantity(150.0, ge=20, le=400, unit="m", description="From the axis to the right pylon.")
    height: float = quantity(36.0, ge=12, le=90, unit="m", description="Height of the pylons.")
    sag: float = quantity(7.0, ge=0, le=30, unit="m", description="How much the conductors hang through.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: pylons with a line between them."""
        return TwinTypes("IfcElementAssembly.USERDEFINED.SITE", "pole.powerLine", "OtherConstruction")

    def pylons(self) -> tuple[float, float]:
        """Return x (m) of its pylons in its frame, the left one first."""
        return -self.left_distance, self.right_distance

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of pylons and conductors in its frame."""
        x = np.array(self.pylons())
        feet = np.column_stack([x, np.zeros(2), place.ground(x, np.zeros(2))])
        return [*self.pylon(feet[0]), *self.pylon(feet[1]), *self.conductors(feet[0], feet[1])]

    def pylon(self, foot: Float) -> list[Body]:
        """Return the bars of a pylon on a foot (3,), in its frame."""
        levels = np.append(np.linspace(0.0, WAIST[0], PANELS + 1), [0.8, 1.0])
        half_widths = np.interp(levels, [0.0, WAIST[0], 1.0], [FOOT, WAIST[1], TOP]) * self.height
        corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])

        def corner(level: int, number: int) -> Float:
            """Return the point (3,) of a leg (0 to 3, round the pylon) at the number of a level."""
            return foot + np.append(corners[number % 4] * half_widths[level], levels[level] * self.height)

        bars = []
        for number in range(4):
            bars.append(bar(corner(0, number) - (0.0, 0.0, BURIED), corner(PANELS, number), LEG))
            bars.append(bar(corner(PANELS, number), corner(len(levels) - 1, number), LEG))
            for level in range(len(levels) - 1):
                bars.append(bar(corner(level, number), corner(level + 1, number + 1), BRACE))
                bars.append(bar(corner(level + 1, number), corner(level, number + 1), BRACE))
        return [Body(shape, "galvanised_steel") for shape in (*bars, *self._arms(foot))]

    def _arms(self, foot: Float) -> Iterator[Float]:
        """Yield the sections of the crossarms' bars and of the insulators that hang from their tips."""
        for level_share, reach_share in ARMS:
            middle = foot + (0.0, 0.0, level_share * self.height)
            for side in (-1.0, 1.0):
                tip = middle + (0.0, side * reach_share * HALF_ARM * self.height, 0.0)
                for corner_side in (-1.0, 1.0):
                    yield bar(middle + (corner_side * TOP * self.height, 0.0, 0.0), tip, BRACE)
                yield bar(middle + (0.0, 0.0, 0.05 * self.height), tip, BRACE)
                yield bar(tip, tip - (0.0, 0.0, INSULATOR), BRACE)

    def conductors(self, start: Float, end: Float) -> Iterator[Body]:
        """Yield the conductors between two pylons' feet (3,), which hang as parabolas, and the earth wire over them."""
        shares = np.linspace(0.0, 1.0, _ROWS + 1)
        suspension_points = [
            (side * reach * HALF_ARM, level_share, INSULATOR, 1.0)
            for level_share, reach in ARMS
            for side in (-1.0, 1.0)
        ]
        angles = 2.0 * np.pi * np.arange(3) / 3.0
        section = np.column_stack([np.zeros(3), np.cos(angles), np.sin(angles)]) * DIAMETER / 2.0
        for lateral_share, level_share, hanging_length, sag_share in [*suspension_points, (0.0, 1.0, 0.0, 0.8)]:
            line = (
                start
                + (end - start) * shares[:, None]
                + (0.0, lateral_share * self.height, level_share * self.height - hanging_length)
            )
            line[:, 2] -= 4.0 * sag_share * self.sag * shares * (1.0 - shares)
            yield Body(line[:, None] + section, "conductor")

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its pylons, in which nothing else may stand."""
        rotation = np.radians(self.rotation_deg)
        half_foot = FOOT * self.height + LEG
        for x in self.pylons():
            station, offset = self.station + x * float(np.sin(rotation)), self.offset - x * float(np.cos(rotation))
            yield Block(
                "foot",
                station - half_foot,
                station + half_foot,
                offset - half_foot,
                offset + half_foot,
                0.0,
                self.height,
            )
