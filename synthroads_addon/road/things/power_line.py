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
    pylon_height: Interval = interval(28.0, 48.0, "m", "Height of its pylons.", title="Its Pylons' Height")


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
        return TwinTypes("IfcElementAssembly.USERDEFINED", "pole.powerLine", "OtherConstruction")

    def pylons(self) -> tuple[float, float]:
        """Return x (m) of its pylons in its frame, the left one first."""
        return -self.left_distance, self.right_distance

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of pylons and conductors in its frame."""
        x = np.array(self.pylons())
        feet = place.ground(x, np.zeros(2))
        made = [Body(shape, "galvanised_steel") for at, z in zip(x, feet, strict=True) for shape in self._pylon(at, z)]
        return made + [Body(wire, "conductor") for wire in self._conductors(x, feet)]

    def _pylon(self, x: float, z: float) -> Iterator[Float]:
        """Yield the bars of a pylon with its foot at (x, 0, z)."""
        foot = np.array([x, 0.0, z])
        levels = np.append(np.linspace(0.0, WAIST[0], PANELS + 1), [0.8, 1.0]) * self.height
        half = np.interp(levels, np.array([0.0, WAIST[0], 1.0]) * self.height, np.array([FOOT, WAIST[1], TOP]) * self.height)
        corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]

        def corner(level: int, number: int) -> Float:
            cx, cy = corners[number % 4]
            return foot + (cx * half[level], cy * half[level], levels[level])

        for number in range(4):
            yield bar(corner(0, number) - (0.0, 0.0, BURIED), corner(PANELS, number), LEG)
            yield bar(corner(PANELS, number), corner(len(levels) - 1, number), LEG)
            for level in range(len(levels) - 1):
                yield bar(corner(level, number), corner(level + 1, number + 1), BRACE)
                yield bar(corner(level + 1, number), corner(level, number + 1), BRACE)
        yield from self._arms(foot)

    def _arms(self, foot: Float) -> Iterator[Float]:
        for share_, reach in ARMS:
            level, wide = share_ * self.height, reach * HALF_ARM * self.height
            for side in (-1.0, 1.0):
                tip = foot + (0.0, side * wide, level)
                for beside in (-1.0, 1.0):
                    yield bar(foot + (beside * TOP * self.height, 0.0, level), tip, BRACE)
                yield bar(foot + (0.0, 0.0, level + 0.05 * self.height), tip, BRACE)
                yield bar(tip, tip - (0.0, 0.0, INSULATOR), BRACE)

    def _conductors(self, x: Float, z: Float) -> Iterator[Float]:
        """Yield the sections of the conductors, which hang as parabolas, and of the earth wire over them."""
        share_ = np.linspace(0.0, 1.0, _ROWS + 1)
        ends = [(side * reach * HALF_ARM * self.height, level * self.height - INSULATOR, self.sag)
                for level, reach in ARMS for side in (-1.0, 1.0)]  # fmt: skip
        turn = 2.0 * np.pi * np.arange(3) / 3.0
        ring = np.column_stack([np.zeros(3), np.cos(turn), np.sin(turn)]) * DIAMETER / 2.0
        for y, level, sag in [*ends, (0.0, self.height, 0.8 * self.sag)]:
            height = z[0] + (z[1] - z[0]) * share_ + level - 4.0 * sag * share_ * (1.0 - share_)
            line = np.column_stack([x[0] + (x[1] - x[0]) * share_, np.full(len(share_), y), height])
            yield line[:, None] + ring

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its pylons, in which nothing else may stand."""
        turn = np.radians(self.rotation_deg)
        half = FOOT * self.height + LEG
        for x in self.pylons():
            station, offset = self.station + x * float(np.sin(turn)), self.offset - x * float(np.cos(turn))
            yield Block("foot", station - half, station + half, offset - half, offset + half, 0.0, self.height)
