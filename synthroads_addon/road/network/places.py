"""Places along the roads of a network: which road a point belongs to, and its station and offset there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float, Index
from ..alignment import Alignment
from ..geometry import RoadGeometry
from ..objects import RoadObject
from ..other_roads.guardrail import RampGuardrail
from ..surroundings import RampVehicle, Terrain, Vegetation
from ..things.overpass import Overpass
from ..things.thing import StandingThing
from .network import Network, network_of

_ANYWHERE = (Terrain, Vegetation, StandingThing)
"""Types of what lies or stands on and beside any road: it belongs to the nearest one."""


@dataclass(frozen=True)
class _OtherRoad:
    """A ramp or a crossing road as places are told by it.

    Attributes:
        number: its instance number.
        axis: its axis.
        half_width: of its pavement and one verge, m.
        spans: own stations (m) between which it lies on the ground.
    """

    number: int
    axis: Alignment
    half_width: float
    spans: tuple[tuple[float, float], ...]

    def distance(self, station: Float, offset: Float) -> Float:
        """Return the distances (N,) in plan of own stations and offsets (N,) from it on the ground, m."""
        across = np.maximum(np.abs(offset) - self.half_width, 0.0)
        along = [np.maximum(np.maximum(start - station, station - end), 0.0) for start, end in self.spans]
        return np.hypot(across, np.min(along, axis=0))


class RoadPlaces:
    """Stations and offsets along the roads that places belong to.

    A road's own surface and markings belong to it, and so does what is built for it. Ground, plants and what stands
    somewhere belong to the road whose verges are the nearest in plan; where two are as near, to the main road.

    Args:
        geometry: the main road.

    Attributes:
        origin: (3,) map coordinates of the local origin, m.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        self._geometry = geometry
        self.origin: Float = np.array(geometry.parameters.transform.translate)
        self._main = geometry.parameters.alignment.instance
        self._numbers: dict[int, int] = {}

    def at(self, points: Float, instance: NDArray[np.integer]) -> tuple[Float, Float, NDArray[np.uint32]]:
        """Return the stations, the offsets (m) and the instance numbers of the roads of points, (N,) each.

        A road's axis goes on straight beyond its ends. The main road has its alignment's number.

        Args:
            points: (N, 2) local, m.
            instance: (N,) of what the points are on.
        """
        station, offset = self._geometry.alignment.project(points)
        road = np.full(len(points), self._main, np.uint32)
        others = self._others
        if not others:
            return station, offset, road
        numbers, members = np.unique(np.asarray(instance), return_inverse=True)
        owner = np.array([self._owner(number) for number in numbers.tolist()])[members.ravel()]
        open_rows = np.flatnonzero(owner == 0)
        nearest = self._main_distance(station[open_rows], offset[open_rows])
        for other in others:
            rows = np.flatnonzero(owner == other.number)
            station[rows], offset[rows] = other.axis.project(points[rows])
            road[rows] = other.number
            self._claim(other, points, open_rows, nearest, (station, offset, road))
        return station, offset, road

    @staticmethod
    def _claim(
        other: _OtherRoad,
        points: Float,
        rows: Index,
        nearest: Float,
        result: tuple[Float, Float, NDArray[np.uint32]],
    ) -> None:
        """Give those of some points, in place, to a road that they are nearer to than to the ones before.

        Args:
            other: the road.
            points: (N, 2) local, m.
            rows: (R,) indices of the points that may belong to any road.
            nearest: (R,) distances from the nearest road so far, m.
            result: stations, offsets and roads (N,).
        """
        station, offset, road = result
        own_station, own_offset = other.axis.project(points[rows])
        distance = other.distance(own_station, own_offset)
        closer = np.flatnonzero(distance < nearest)
        nearest[closer] = distance[closer]
        of_points = rows[closer]
        station[of_points], offset[of_points], road[of_points] = own_station[closer], own_offset[closer], other.number

    @cached_property
    def _others(self) -> list[_OtherRoad]:
        """The ramps and the crossing roads."""
        return list(_other_roads(network_of(self._geometry))) if self._geometry.crossing_roads else []

    @cached_property
    def _bridges(self) -> dict[str, int]:
        """The instance numbers of the crossing roads by the ids of the overpasses that carry them."""
        roads, objects = self._geometry.crossing_roads.values(), self._geometry.parameters.objects
        return {road.bridge: road.instance for road in roads if isinstance(objects[road.bridge], Overpass)}

    def _owner(self, number: int) -> int:
        """Return the number of the road that what has an instance number belongs to; 0 where the nearest one counts."""
        if number not in self._numbers:
            name = self._geometry.numbers.owner(number)
            self._numbers[number] = 0 if name is None else self._road_of(name)
        return self._numbers[number]

    def _road_of(self, name: str) -> int:
        """Return the number of the road that an object belongs to; 0 where the nearest one counts."""
        item: RoadObject = self._geometry.parameters.objects[name]
        if name in self._bridges:
            return self._bridges[name]
        if isinstance(item, RampVehicle | RampGuardrail):
            item = self._geometry.parameters.objects[item.carriageway if isinstance(item, RampVehicle) else item.road]
        if any(item.instance == other.number for other in self._others):
            return item.instance
        return 0 if isinstance(item, _ANYWHERE) else self._main

    def _main_distance(self, station: Float, offset: Float) -> Float:
        """Return the distances (N,) of stations and offsets (N,) from the main road's verges, m."""
        geometry = self._geometry
        edges = geometry.offsets(np.clip(station, 0.0, geometry.length)) if len(station) else np.zeros((0, 2))
        across = np.maximum(np.maximum(offset - edges[:, 0], edges[:, -1] - offset), 0.0)
        return np.hypot(across, np.maximum(np.maximum(-station, station - geometry.length), 0.0))


def _other_roads(network: Network) -> Iterator[_OtherRoad]:
    """Yield the roads of a network other than the main one."""
    for joint in network.joints.values():
        ramp, axis = joint.ramp, joint.surface.axis
        spans = ((0.0, axis.length + ramp.mouth_length),)
        yield _OtherRoad(ramp.instance, axis, ramp.half_width + ramp.verge_width, spans)
    for crossing in network.crossings.values():
        road, axis = crossing.road, crossing.geometry.alignment
        bridge = crossing.bridge
        ends = ((0.0, bridge[0]), (bridge[1], road.length)) if bridge else ((0.0, road.length),)
        yield _OtherRoad(road.instance, axis, road.half_width + road.verge_width, ends)
