"""Light in tunnels: daylight fades behind the portals, and lamps shine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Float, Float32
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...road.structures.tunnel import Tunnel

_FADE = 12.0
"""Depth behind a portal at which 37 % of the daylight is left, m: some two heights of a tube. Chosen."""
_LAMPS = np.array([0.075, 0.068, 0.052])
"""Light of lamps on white matt surfaces, as exposed in the open: an eighth of the sun's, and warmer. Chosen."""
_SPACING = 2.0
"""Distance of the stations of a tunnel's outline in plan, m."""
_MARGIN = 3.0
"""Distance around a tunnel within which points are looked at, m."""


@dataclass(frozen=True)
class TunnelLight:
    """The light in a road's tunnels.

    Attributes:
        road: the road.
        frame: where (3,) the scene's local frame begins in the road's, m.
    """

    road: RoadParameters
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, road: RoadParameters | None, frame: ArrayLike = (0.0, 0.0, 0.0)) -> TunnelLight | None:
        """Return the light in a road's tunnels; None without any."""
        if road is None or not road.of_type(Tunnel):
            return None
        x, y, z = np.asarray(frame, dtype=np.float64).tolist()
        return cls(road, (x, y, z))

    @cached_property
    def _geometry(self) -> RoadGeometry:
        return RoadGeometry(self.road)

    @cached_property
    def _boxes(self) -> list[tuple[Tunnel, Float, Float]]:
        """The tunnels with the lowest and the highest corner (3,) of what lies in them, in the road's frame, m."""
        geometry, boxes = self._geometry, []
        for tunnel in geometry.tunnels.values():
            station = np.linspace(max(tunnel.start_station, 0.0), min(tunnel.end_station, geometry.length),
                                  max(2, int((tunnel.end_station - tunnel.start_station) / _SPACING)))  # fmt: skip
            edges = geometry.offsets(station)
            plan = np.concatenate([geometry.alignment.place(station, edges[:, column]) for column in (0, -1)])
            height = geometry.profile.elevation(station)
            low = np.array([*plan.min(axis=0), height.min()]) - _MARGIN
            high = np.array([*plan.max(axis=0), height.max() + tunnel.height]) + _MARGIN
            boxes.append((tunnel, low, high))
        return boxes

    def light(self, position: Float) -> tuple[Float32, Float32]:
        """Return the share of the daylight (N, 1), and the lamps' light (N, 3), at local positions (N, 3), m."""
        daylight, lamps = np.ones((len(position), 1), np.float32), np.zeros((len(position), 3), np.float32)
        place = position + np.array(self.frame)
        geometry = self._geometry
        for tunnel, low, high in self._boxes:
            near = np.flatnonzero(((place >= low) & (place <= high)).all(axis=1))
            if not len(near):
                continue
            station, offset = geometry.alignment.project(place[near, :2])
            within = np.clip(station, 0.0, geometry.length)
            offsets, heights = geometry.boundaries(within)
            crown = np.maximum(heights[:, 1], heights[:, -2]) + tunnel.height
            depth = np.minimum(station - tunnel.start_station, tunnel.end_station - station)
            inside = (depth > 0.0) & (offset <= offsets[:, 0] + 0.05) & (offset >= offsets[:, -1] - 0.05)
            inside &= place[near, 2] <= crown + 0.05
            share = np.exp(-depth[inside] / _FADE).astype(np.float32)[:, None]
            daylight[near[inside]] = share
            if tunnel.lamp_spacing:
                lamps[near[inside]] = (1.0 - share) * _LAMPS.astype(np.float32)
        return daylight, lamps
