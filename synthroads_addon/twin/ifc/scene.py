"""Scene that the writers of an IFC file share: the road, where its parts are, how an object is put into the file."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.objects import RoadObject
from ..surfaces import on_ground
from .alignment import Axis, linear_placement, local_placement
from .entities import Entity, Float, IfcFile


@dataclass(frozen=True)
class IfcPlace:
    """An upright frame on the road: x along it, y to the left, z up.

    Attributes:
        placement: the IfcLinearPlacement or IfcLocalPlacement.
        origin: (3,) local point.
        heading: of its x axis, rad.
    """

    placement: Entity
    origin: Float
    heading: float

    def frame(self, ifc: IfcFile) -> Entity:
        """Add a placement in this frame, at its origin."""
        return ifc.add("IfcLocalPlacement", self.placement, ifc.flat_axes)

    def inside(self, points: Float) -> Float:
        """Return local points (..., 3) in this frame."""
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return (points - self.origin) @ rotation


@dataclass(frozen=True)
class Scene:
    """A road that is being written.

    Attributes:
        geometry: the analytic road.
        axis: its alignment in the file.
        tolerance: largest chord error of its surfaces, m.
        stations: (N,) where its surfaces have rows, m.
        site, road: IfcSite and IfcRoad.
        along_axis: whether objects are placed along the alignment; else by coordinates.
        parts: IfcRoadParts by name: ``carriageway-left``, ``roadside-left``, ..., ``median``.
    """

    ifc: IfcFile
    geometry: RoadGeometry
    axis: Axis
    tolerance: float
    stations: NDArray[np.float64]
    site: Entity
    road: Entity
    along_axis: bool = True
    parts: dict[str, Entity] = field(default_factory=dict)
    _known: dict[tuple[float, float], tuple[float, int]] = field(default_factory=dict)

    def look_up(self, places: Iterable[tuple[float, float]]) -> None:
        """Find surface and strip at stations and offsets (m) at once: one by one it takes a hundred times longer."""
        unknown = [place for place in dict.fromkeys(places) if place not in self._known]
        if not unknown:
            return
        station, offset = np.array(unknown).T
        station = np.clip(station, 0.0, self.geometry.length)
        heights, strips = self.surface(station, offset), self.geometry.strip_index(station, offset)
        self._known.update(zip(unknown, zip(heights.tolist(), strips.tolist(), strict=True), strict=True))

    def at(self, station: float, offset: float) -> tuple[float, int]:
        """Return the surface's local elevation (m) and the strip's index, -1 beside the road."""
        self.look_up([(station, offset)])
        return self._known[station, offset]

    def surface(self, station: Float, offset: Float) -> Float:
        """Return the local elevations (N,) of the road or the ground."""
        return on_ground(self.geometry, station, offset)[:, 2]

    def points(self, station: Float, offset: Float, above: float | Float = 0.0) -> Float:
        """Return local points (N, 3) on the surface, or above it."""
        points = on_ground(self.geometry, station, offset)
        points[:, 2] += above
        return points

    def rows(self, start: float, end: float) -> Float:
        """Return the stations (N,) of rows from a start to an end (m), both included."""
        inside = self.stations[(self.stations > start) & (self.stations < end)]
        return np.unique(np.concatenate([[start], inside, [end]]))

    def place(self, station: float, offset: float, above: float = 0.0) -> IfcPlace:
        """Return a frame on the surface, or above it; beyond the road's ends it lies on its end."""
        height = self.at(station, offset)[0] + above
        station = min(max(station, 0.0), self.geometry.length)
        at = np.array([station])
        position, heading, _ = self.geometry.alignment.frame(at)
        left = np.array([-math.sin(heading[0]), math.cos(heading[0])])
        origin = np.array([*(position[0] + offset * left), height])
        if self.along_axis:
            placement = linear_placement(self.ifc, self.geometry, self.axis, station, offset, height)
        else:
            placement = local_placement(self.ifc, origin, float(heading[0]))
        return IfcPlace(placement, origin, float(heading[0]))

    def container(self, station: float, offset: float) -> Entity:
        """Return the part of the road that something stands in: a carriageway, the median, or beside the road."""
        _, index = self.at(station, offset)
        strip = self.geometry.strips[index] if index >= 0 else None
        if strip is not None and strip.kind == "median":
            return self.parts["median"]
        if strip is not None and strip.class_name == "road":
            return self.parts[f"carriageway-{strip.side}"]
        return self.parts["roadside-left" if offset > 0.0 else "roadside-right"]

    def describe(self, entity: Entity, item: RoadObject) -> None:
        """Give an entity what the parameter set says of its object, under the same names, and its class."""
        label = item.semantic_class
        values = self.ifc.parameters_of(item) | ({"class": self.ifc.value(label)} if label else {})
        numbers = self.geometry.numbers.part_attributes(item.instance)
        values |= {key: self.ifc.value(number) for key, number in numbers.items()}
        self.ifc.properties(entity, "SynthRoads", values)

    def stand(self, entity: Entity, container: Entity) -> None:
        """Put an element that is placed along the alignment into its container."""
        self.ifc.gather("IfcRelContainedInSpatialStructure", container, [entity])
        self.ifc.gather("IfcRelPositions", self.axis.alignment, [entity])


def grid_triangles(rows: int, columns: int, closed: bool = False, flip: bool = False) -> NDArray[np.intp]:
    """Return the triangles (T, 3) of a grid of points, row by row along the road, each row from right to left.

    Seen from above they run counter-clockwise. ``closed`` joins the last column to the first; ``flip`` turns them over.
    """
    column = np.arange(columns if closed else columns - 1)
    first = (np.arange(rows - 1)[:, None] * columns + column).ravel()
    beside = (np.arange(rows - 1)[:, None] * columns + (column + 1) % columns).ravel()
    quads = np.column_stack([first, first + columns, beside + columns, beside])
    if flip:
        quads = quads[:, ::-1]
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
