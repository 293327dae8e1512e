"""Scene that the writers of an IFC file share: the road, where its parts are, how an object is put into the file."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.objects import RoadObject
from ..surfaces import surface_points
from .alignment import Axis, linear_placement, local_placement
from .entities import Entity, Float, IfcFile

STAGE = "IFC"
"""Name of the work for progress."""


@dataclass(frozen=True)
class IfcPlace:
    """An upright placement on the road: x along it, y to the left, z up.

    Attributes:
        placement: the IfcLinearPlacement or IfcLocalPlacement.
        origin: (3,) local point.
        heading: of its x axis, rad.
    """

    placement: Entity
    origin: Float
    heading: float

    def frame(self, ifc: IfcFile) -> Entity:
        """Add and return an IfcLocalPlacement relative to this placement, at its origin."""
        return ifc.add("IfcLocalPlacement", self.placement, ifc.flat_axes)

    def to_frame(self, points: Float) -> Float:
        """Transform local points (..., 3) into this frame."""
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return (points - self.origin) @ rotation


@dataclass(frozen=True)
class Scene:
    """Context of an IFC export: the file, the road's geometry, its alignment and its spatial parts.

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
    _height_and_strip_of_place: dict[tuple[float, float], tuple[float, int]] = field(default_factory=dict)

    def cache_surface(self, places: Iterable[tuple[float, float]]) -> None:
        """Compute and cache surface elevation and strip index at stations and offsets (m), all at once for speed."""
        uncached = [place for place in dict.fromkeys(places) if place not in self._height_and_strip_of_place]
        if not uncached:
            return
        station, offset = np.array(uncached).T
        station = np.clip(station, 0.0, self.geometry.length)
        heights, strips = self.surface(station, offset), self.geometry.strip_index(station, offset)
        self._height_and_strip_of_place.update(
            zip(uncached, zip(heights.tolist(), strips.tolist(), strict=True), strict=True)
        )

    def surface_and_strip(self, station: float, offset: float) -> tuple[float, int]:
        """Return the surface's local elevation (m) and the strip's index, -1 beside the road; cached."""
        self.cache_surface([(station, offset)])
        return self._height_and_strip_of_place[station, offset]

    def surface(self, station: Float, offset: Float) -> Float:
        """Return the local elevations (N,) of road or ground at stations and offsets (N,), m."""
        return surface_points(self.geometry, station, offset)[:, 2]

    def points(self, station: Float, offset: Float, height_above: float | Float = 0.0) -> Float:
        """Return local points (N, 3) at stations and offsets, at a height (m) above the surface of road or ground."""
        points = surface_points(self.geometry, station, offset)
        points[:, 2] += height_above
        return points

    def rows(self, start: float, end: float) -> Float:
        """Return a range's ends (m) and the scene's sampling stations between them, sorted (N,)."""
        inner_stations = self.stations[
            np.searchsorted(self.stations, start, "right") : np.searchsorted(self.stations, end, "left")
        ]
        return np.unique(np.concatenate([[start], inner_stations, [end]]))

    def place(self, station: float, offset: float, height_above: float = 0.0) -> IfcPlace:
        """Return an upright placement at a height (m) above the surface; stations are clipped to the road's ends."""
        height = self.surface_and_strip(station, offset)[0] + height_above
        station = min(max(station, 0.0), self.geometry.length)
        station_array = np.array([station])
        position, heading, _ = self.geometry.alignment.frame(station_array)
        left_normal = np.array([-math.sin(heading[0]), math.cos(heading[0])])
        origin = np.array([*(position[0] + offset * left_normal), height])
        if self.along_axis:
            placement = linear_placement(self.ifc, self.geometry, self.axis, station, offset, height)
        else:
            placement = local_placement(self.ifc, origin, float(heading[0]))
        return IfcPlace(placement, origin, float(heading[0]))

    def container(self, station: float, offset: float) -> Entity:
        """Return the IfcRoadPart at a station and offset (m): a carriageway, the median or a roadside."""
        _, index = self.surface_and_strip(station, offset)
        strip = self.geometry.strips[index] if index >= 0 else None
        if strip is not None and strip.kind == "median":
            return self.parts["median"]
        if strip is not None and strip.class_name == "road":
            return self.parts[f"carriageway-{strip.side}"]
        return self.parts["roadside-left" if offset > 0.0 else "roadside-right"]

    def add_parameters(self, entity: Entity, item: RoadObject) -> None:
        """Give an entity the property set `SynthRoads` with all parameters of its object and its semantic class."""
        label = item.semantic_class
        values = self.ifc.parameters_of(item) | ({"class": self.ifc.value(label)} if label else {})
        numbers = self.geometry.numbers.part_attributes(item.instance)
        values |= {key: self.ifc.value(number) for key, number in numbers.items()}
        self.ifc.add_properties(entity, "SynthRoads", values)

    def contain(self, entity: Entity, container: Entity) -> None:
        """Note that an element is contained in a spatial part and positioned by the alignment."""
        self.ifc.note_relation("IfcRelContainedInSpatialStructure", container, [entity])
        self.ifc.note_relation("IfcRelPositions", self.axis.alignment, [entity])


def grid_triangles(rows: int, columns: int, is_ring: bool = False, flipped: bool = False) -> NDArray[np.intp]:
    """Return the triangles (T, 3) of a grid of points whose rows run from right to left and follow each other forwards.

    Seen from above the triangles run anticlockwise.

    Args:
        rows, columns: of the grid, whose points are numbered row by row.
        is_ring: whether the last column is joined to the first.
        flipped: whether the triangles run clockwise instead.
    """
    column = np.arange(columns if is_ring else columns - 1)
    this_column = (np.arange(rows - 1)[:, None] * columns + column).ravel()
    next_column = (np.arange(rows - 1)[:, None] * columns + (column + 1) % columns).ravel()
    quads = np.column_stack([this_column, this_column + columns, next_column + columns, next_column])
    if flipped:
        quads = quads[:, ::-1]
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
