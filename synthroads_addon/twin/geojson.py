"""GeoJSON in map coordinates: centreline, lanes, lane lines, boundaries, markings, and where furniture stands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.schema import compact_json
from ..road.axes.centerline import centerline_geojson
from ..road.geometry import RoadGeometry
from ..road.objects import LineObject, PointObject, RoadObject
from ..road.parameters import RoadParameters
from ..road.section import Arrow, Carriageway, Hatching, LineMarking, Median, Turnout
from ..road.streets.street_side import StreetSide
from .attributes import attributes_of
from .plants import placed_plants
from .surfaces import dash_stations, line_points, painted_surface, road_stations, surface_points
from .trace import Trace
from .vehicles import placed_vehicles

Float = NDArray[np.float64]
Feature = dict[str, Any]

DIGITS = 4
"""Decimals of coordinates and of stations and widths beside them: 0.1 mm."""
_THERE = 1e-6
"""Width above which a lane is there, m."""
_LEVEL = "lines and places, without bodies"
_LOST = {
    "Terrain": "there are no surfaces here but the median's",
    "Landscape": "it lies beyond the ground that the road stands on",
    "strip": "there are no surfaces here but the median's",
    "rut": "there is no damage here",
    "pothole": "there is no damage here",
    "patch": "there is no damage here",
    "crack": "there is no damage here",
    "removed": "there are no traces of markings that were ground off",
}
"""Type of object, or kind of part -> why the file has none."""


def write_geojson(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road's lines and points as GeoJSON in map coordinates; return the trace of what became of each object.

    Coordinates are those of the parameter set's reference system, named by the member ``crs`` (GeoJSON 2008): degrees
    of WGS 84, which RFC 7946 wants, would cost millimetres.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of curved lines, m, > 0.
    """
    geometry = RoadGeometry(parameters)
    stations = road_stations(geometry, tolerance)
    trace = Trace(geometry, _LEVEL, ("dash",), _LOST)
    collection = centerline_geojson(geometry, stations) | {"level_of_detail": _LEVEL}
    features = collection.pop("features")
    for feature in features:
        feature["properties"] = {"feature": "centerline", "object_type": "Alignment"} | feature["properties"]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(compact_json(collection)[:-1] + ',"features":[')
        separator = "\n"
        for number, feature in enumerate((*features, *_Writer(geometry, stations, tolerance, trace).features())):
            trace.record_entity(feature["properties"]["instance"], feature=number)
            file.write(separator + compact_json(feature))
            separator = ",\n"
        file.write("\n]}\n")
    return trace


class _Writer:
    """Generator of the GeoJSON features of one road."""

    def __init__(self, geometry: RoadGeometry, stations: Float, tolerance: float, trace: Trace) -> None:
        self.geometry = geometry
        self.trace = trace
        self.stations = stations
        self.tolerance = tolerance
        self.origin = np.array(geometry.parameters.transform.translate)

    def features(self) -> Iterator[Feature]:
        """Yield the GeoJSON features of all objects in the parameter set's order, then of plants and vehicles."""
        for name, item in self.geometry.parameters.objects.items():
            if isinstance(item, Carriageway):
                yield from self._carriageway(name, item)
            elif isinstance(item, Turnout):
                yield from self._turnout(name, item)
            elif isinstance(item, StreetSide):
                yield from self._street_side(name, item)
            elif isinstance(item, Median):
                yield from self._median(name, item)
            elif isinstance(item, LineMarking):
                yield from self._line_marking(name, item)
            elif isinstance(item, Hatching | Arrow):
                yield from self._painted(name, item)
            elif isinstance(item, PointObject):
                xyz = surface_points(self.geometry, np.array([item.station]), np.array([item.offset]))
                xyz[:, 2] += item.elevation
                yield _feature(self._furniture(name, item), "Point", self._map(xyz)[0])
            elif isinstance(item, LineObject):
                line = self._map(line_points(self.geometry, item, self.tolerance))
                yield _feature(self._furniture(name, item), "LineString", line)
        yield from self._plants()
        yield from self._vehicles()

    def _plants(self) -> Iterator[Feature]:
        """Yield every tree and shrub as a Point at its foot."""
        for plant in placed_plants(self.geometry):
            self.trace.record_plant(plant)
            properties = {"id": plant.name, "feature": "plant"} | plant.attributes()
            yield _feature(properties, "Point", self._map(plant.foot[None])[0])

    def _vehicles(self) -> Iterator[Feature]:
        """Yield every vehicle at time 0 as a Point with its heading (degrees anticlockwise from east)."""
        for placed in placed_vehicles(self.geometry):
            properties = attributes_of(placed.vehicle) | {"id": placed.name, "feature": "vehicle"}
            properties |= self.geometry.numbers.part_attributes(placed.vehicle.instance)
            forward_axis = placed.rotation[:, 0]
            properties["heading_deg"] = round(math.degrees(math.atan2(forward_axis[1], forward_axis[0])), 4)
            yield _feature(properties, "Point", self._map(placed.place[None])[0])

    def _furniture(self, name: str, item: RoadObject) -> Feature:
        """Return the properties of a feature for an object on or beside the road."""
        return attributes_of(item) | {"id": name, "feature": "furniture"}

    def _carriageway(self, name: str, item: Carriageway) -> Iterator[Feature]:
        """Yield LineStrings of a carriageway's edges, of the boundaries of its lanes, and of the lanes' middles."""
        section = self.geometry.sections[item.side]
        properties = {"id": name, "instance": item.instance, "object_type": "Carriageway", "side": item.side}
        edges = {
            "inner_edge": section.distances(self.stations)[:, 0],
            "paved_edge": section.paved_edge(self.stations),
            "road_edge": section.road_edge(self.stations),
        }
        for kind, distance in edges.items():
            yield self._along(properties | {"feature": kind}, item.sign * distance)
        boundaries = section.lane_boundaries(self.stations)
        for number in range(len(item.lanes) + 1):
            offset = item.sign * boundaries[:, number]
            yield self._along(properties | {"feature": "lane_boundary", "boundary": number}, offset)
        for number, lane in enumerate(item.lanes):
            lane_properties = {"feature": "lane", "lane": number, "lane_kind": lane.kind}
            yield from self._lanes(
                properties | lane_properties, item, (boundaries[:, number + 1], boundaries[:, number])
            )

    def _turnout(self, name: str, item: Turnout) -> Iterator[Feature]:
        """Yield LineStrings along the middle of a turnout's lane or bay, within the stations that it takes up."""
        carriageway = self.geometry.parameters.carriageway_of(item)
        section = self.geometry.sections[carriageway.side]
        shape = next(shape for shape in section.turnouts if shape.turnout.instance == item.instance)
        kind = "bay" if item.ramp is None else "turnout_lane"
        inner, outer = section.boundaries_of(kind, self.stations)
        start_station, end_station = shape.range()
        in_range = (self.stations >= start_station) & (self.stations <= end_station)
        properties = {"id": name, "instance": item.instance, "object_type": "Turnout", "side": carriageway.side}
        properties |= {"turnout": item.kind, "feature": "lane" if item.ramp else "bay"}
        yield from self._lanes(
            properties, carriageway, (np.where(in_range, inner, 0.0), np.where(in_range, outer, 0.0))
        )

    def _street_side(self, name: str, item: StreetSide) -> Iterator[Feature]:
        """Yield LineStrings of a street side: top edge of its kerb, and its footway's middle with the widths."""
        carriageway = self.geometry.parameters.carriageway_of(item)
        section = self.geometry.sections[carriageway.side]
        rows = np.flatnonzero((self.stations >= item.start_station) & (self.stations <= item.end_station))
        properties = {"id": name, "instance": item.instance, "object_type": "StreetSide", "side": carriageway.side}
        kerb_distance = section.boundaries_of("kerb", self.stations)[0]
        if len(rows) > 1:
            yield self._along(properties | {"feature": "kerb"}, carriageway.sign * kerb_distance[rows], rows)
        inner, outer = section.boundaries_of("footway", self.stations)
        in_range = np.isin(np.arange(len(self.stations)), rows)
        yield from self._lanes(
            properties | {"feature": "footway"},
            carriageway,
            (np.where(in_range, inner, 0.0), np.where(in_range, outer, 0.0)),
        )

    def _lanes(
        self, properties: Feature, carriageway: Carriageway, distances: tuple[Float, Float]
    ) -> Iterator[Feature]:
        """Yield a LineString with widths along a lane's middle for each stretch on which the lane is wider than 0."""
        inner, outer = distances
        wide_rows = np.flatnonzero(outer - inner > _THERE)
        for stretch in np.split(wide_rows, np.flatnonzero(np.diff(wide_rows) > 1) + 1):
            # A row more at either end: there the lane's width is 0, or the road ends.
            rows = np.arange(max(stretch[0] - 1, 0), min(stretch[-1] + 2, len(outer))) if len(stretch) else stretch
            rows = rows[(outer - inner)[rows] >= 0.0]
            if len(rows) > 1:
                middle = carriageway.sign * (inner[rows] + outer[rows]) / 2.0
                widths = {"widths": np.round((outer - inner)[rows], DIGITS).tolist()}
                yield self._along(properties | widths, middle, rows)

    def _median(self, name: str, item: Median) -> Iterator[Feature]:
        """Yield the median as a Polygon between the inner edges of two carriageways; none if there is only one."""
        inner_distances = {
            side: section.distances(self.stations)[:, 0] for side, section in self.geometry.sections.items()
        }
        if len(inner_distances) < 2:
            return
        left_edge = surface_points(self.geometry, self.stations, inner_distances["left"])
        right_edge = surface_points(self.geometry, self.stations, -inner_distances["right"])
        ring = self._map(np.concatenate([right_edge, left_edge[::-1], right_edge[:1]]))
        properties = {"id": name, "instance": item.instance, "object_type": "Median", "feature": "median"}
        yield _feature(properties, "Polygon", [ring])

    def _line_marking(self, name: str, item: LineMarking) -> Iterator[Feature]:
        """Yield a line marking as a MultiLineString: the middle of each dash, at the height of its film."""
        dashes, station, owner = dash_stations(self.geometry, item, self.stations)
        if not len(dashes):
            return
        left_offset, right_offset = self.geometry.marking_edges(item, station)
        points = surface_points(self.geometry, station, (left_offset + right_offset) / 2.0)
        points[:, 2] += item.film_thickness
        lines = np.split(points, np.flatnonzero(np.diff(owner)) + 1)
        properties = attributes_of(item) | {
            "id": name,
            "feature": "marking",
            "dashes": np.round(dashes, DIGITS).tolist(),
        }
        properties |= self.geometry.numbers.part_attributes(item.instance)
        yield _feature(properties, "MultiLineString", [self._map(line) for line in lines])

    def _painted(self, name: str, item: Hatching | Arrow) -> Iterator[Feature]:
        """Yield a hatching or an arrow as a MultiPolygon of its painted area."""
        faces = painted_surface(self.geometry, item, self.stations)
        if not len(faces):
            return
        points = self._map(faces.points)
        rings = np.split(faces.corners, np.cumsum(faces.sizes)[:-1])
        polygons = [[[points[i] for i in (*ring, ring[0])]] for ring in rings]
        yield _feature(attributes_of(item) | {"id": name, "feature": "marking"}, "MultiPolygon", polygons)

    def _along(self, properties: Feature, offset: Float, rows: NDArray[np.intp] | None = None) -> Feature:
        """Return a LineString on the surface at offsets (R,) from the centreline, m; at all stations if `rows` is None.

        The properties get the stations and the offsets of the line's points.
        """
        station = self.stations if rows is None else self.stations[rows]
        points = surface_points(self.geometry, station, offset)
        properties = properties | {
            "stations": np.round(station, DIGITS).tolist(),
            "offsets": np.round(offset, DIGITS).tolist(),
        }
        return _feature(properties, "LineString", self._map(points))

    def _map(self, points: Float) -> list[Any]:
        """Return local points (..., 3) as lists of map coordinates rounded to `DIGITS` decimals."""
        return np.round(points + self.origin, DIGITS).tolist()


def _feature(properties: Feature, kind: str, coordinates: list[Any]) -> Feature:
    """Return a GeoJSON feature with a geometry of a kind."""
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}
