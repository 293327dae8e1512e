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
        """Return stations (N,) of the line at those of the file, m, within the road."""
        return self.stations(np.clip(s, 0.0, self.surface.road.length))

    def at(self, s: Float, t: Float, height: Float) -> tuple[Float, Float]:
        """Return stations and offsets (N,), m, of points at s, t and heights (N,) normal to the road's plane.

        The plane is tilted about the line as it climbs: what stands off it lies a little behind or before s.
        """
        s, t, height = (np.asarray(values, dtype=np.float64) for values in (s, t, height))
        road = self.surface.road
        s = np.clip(s, 0.0, road.length)
        climb = np.arctan(road.elevation.at(s, slope=True))
        tilt = road.superelevation.at(s)
        above = t * np.sin(tilt) + height * np.cos(tilt)
        ahead, offset = -np.sin(climb) * above, t * np.cos(tilt) - height * np.sin(tilt)
        along = self.stations(s)
        plan, heading, _ = self.alignment.frame(along)
        way = np.column_stack([np.cos(heading), np.sin(heading)])
        point = plan + ahead[:, None] * way + offset[:, None] * np.column_stack([-way[:, 1], way[:, 0]])
        station = along
        for _ in range(_APPROXIMATIONS):
            plan, heading, bend = self.alignment.frame(station)
            way = np.column_stack([np.cos(heading), np.sin(heading)])
            away = point - plan
            offset = away[:, 1] * way[:, 0] - away[:, 0] * way[:, 1]
            station = np.clip(station + (away * way).sum(axis=1) / (1.0 - bend * offset), 0.0, self.alignment.length)
        # What begins or ends with the road does so on its plane as well.
        ends = np.where(s <= SHORTEST, 0.0, np.where(s >= road.length - SHORTEST, self.alignment.length, station))
        return ends, offset
