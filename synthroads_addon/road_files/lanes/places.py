"""Where objects of an OpenDRIVE road stand: stations and offsets of a parameter set from s, t and height."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ...road.alignment import Alignment
from .records import SHORTEST
from .surface import FileSurface

_APPROXIMATIONS = 2
"""Newton's steps to the foot of a point on the line (chosen)."""


@dataclass(frozen=True)
class Places:
    """Places beside one road of a file.

    Attributes:
        surface: the road's.
        alignment: its line, in the file's coordinates.
        stations: stations along it at those of the file, m.
    """

    surface: FileSurface
    alignment: Alignment
    stations: Callable[[Float], Float]

    def along(self, s: Float) -> Float:
        """Return stations (N,), m, of the alignment at stations `s` (N,) of the file, clipped to the road."""
        return self.stations(np.clip(s, 0.0, self.surface.road.length))

    def at(self, s: Float, t: Float, height: Float) -> tuple[Float, Float]:
        """Return stations and offsets (N,), m, of points at s, t and heights (N,) normal to the road's plane.

        The plane is tilted about the line as the line climbs. So a point off the line lies, in plan, a little behind or
        before the place at s.
        """
        s, t, height = (np.asarray(values, dtype=np.float64) for values in (s, t, height))
        road = self.surface.road
        s = np.clip(s, 0.0, road.length)
        climb = np.arctan(road.elevation.at(s, slope=True))
        bank = road.superelevation.at(s)
        rise = t * np.sin(bank) + height * np.cos(bank)
        forward, offset = -np.sin(climb) * rise, t * np.cos(bank) - height * np.sin(bank)
        line_station = self.stations(s)
        plan, heading, _ = self.alignment.frame(line_station)
        direction = np.column_stack([np.cos(heading), np.sin(heading)])
        point = (
            plan + forward[:, None] * direction + offset[:, None] * np.column_stack([-direction[:, 1], direction[:, 0]])
        )
        station = line_station
        # The foot on the curved line is found by Newton's steps: a metre along it is 1 - k t metres at the offset t.
        for _ in range(_APPROXIMATIONS):
            plan, heading, curvature = self.alignment.frame(station)
            direction = np.column_stack([np.cos(heading), np.sin(heading)])
            gap = point - plan
            offset = gap[:, 1] * direction[:, 0] - gap[:, 0] * direction[:, 1]
            station = np.clip(
                station + (gap * direction).sum(axis=1) / (1.0 - curvature * offset), 0.0, self.alignment.length
            )
        # What begins or ends with the road does so on its plane as well.
        road_station = np.where(
            s <= SHORTEST, 0.0, np.where(s >= road.length - SHORTEST, self.alignment.length, station)
        )
        return road_station, offset
