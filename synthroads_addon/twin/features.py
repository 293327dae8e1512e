"""A road as lines, areas and places of geographic information systems: GeoJSON features in map coordinates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..road.geometry import RoadGeometry
from ..road.network.grid import SurfaceGrid
from ..road.network.network import network_of
from ..road.objects import LineObject, PointObject, RoadObject
from ..road.other_roads.guardrail import RampGuardrail
from ..road.other_roads.parts import ConnectingRamp, CrossingRoad
from ..road.pavement.outlines import patch_outline, removed_outlines
from ..road.section import (
    Arrow,
    Carriageway,
    Crack,
    Hatching,
    LineMarking,
    Median,
    Patch,
    Pavement,
    Pothole,
    RemovedMarking,
    Rut,
    Turnout,
)
from ..road.side_roads.mouth import HIGH, LOW
from ..road.side_roads.side_road import SideRoad
from ..road.streets.street_side import StreetSide
from .attributes import attributes_of
from .plants import placed_plants
from .surfaces import dash_stations, line_points, painted_surface, simplify_polyline, surface_points
from .things import other_road_course
from .trace import Trace
from .vehicles import placed_vehicles

Float = NDArray[np.float64]
Feature = dict[str, Any]

_EDGES = {"near": LOW, "far": HIGH}
"""Edges of side roads by name: at lower and at higher stations."""
DIGITS = 4
"""Decimals of coordinates and of stations and widths beside them: 0.1 mm."""
_THERE = 1e-6
"""Width above which a lane is there, m."""
_DAMAGE_NAMES: dict[type, str] = {
    Rut: "rut",
    Pothole: "pothole",
    Patch: "patch",
    Crack: "crack",
    RemovedMarking: "removed_marking",
}
"""Names of damages as features."""
_ELLIPSE_CORNERS = 24
"""Corners of a pothole's edge."""
LEVEL = "lines and places, without bodies"
LOST = {
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


class RoadFeatures:
    """Generator of the features of one road: axis, lanes, boundaries, markings, and where furniture stands.

    Args:
        geometry: the road.
        stations: (S,) stations that follow the axis within the tolerance, m.
        tolerance: largest chord error of curved lines, m.
        trace: is told of plants.
    """

    def __init__(self, geometry: RoadGeometry, stations: Float, tolerance: float, trace: Trace) -> None:
        self.geometry = geometry
        self.trace = trace
        self.stations = stations
        self.tolerance = tolerance
        self.origin = np.array(geometry.parameters.transform.translate)

    def features(self) -> Iterator[Feature]:
        """Yield the features of all objects in the parameter set's order, then of plants and vehicles."""
        makers: dict[type, Callable[[str, Any], Iterator[Feature]]] = {
            Carriageway: self._carriageway,
            Turnout: self._turnout,
            StreetSide: self._street_side,
            SideRoad: self._side_road,
            CrossingRoad: self._crossing_road,
            ConnectingRamp: self._ramp,
            RampGuardrail: self._ramp_guardrail,
            Median: self._median,
            LineMarking: self._line_marking,
            Hatching: self._painted,
            Arrow: self._painted,
        }
        for name, item in self.geometry.parameters.objects.items():
            if type(item) in makers:
                yield from makers[type(item)](name, item)
            elif isinstance(item, PointObject):
                xyz = surface_points(self.geometry, np.array([item.station]), np.array([item.offset]))
                xyz[:, 2] += item.elevation
                yield _feature(self._furniture(name, item), "Point", self._map(xyz)[0])
            elif isinstance(item, LineObject):
                line = self._map(line_points(self.geometry, item, self.tolerance))
                yield _feature(self._furniture(name, item), "LineString", line)
        yield from self._plants()
        yield from self._vehicles()

    def axis(self) -> Feature:
        """Return the centreline as a LineString with the stations of its points."""
        alignment, length = self.geometry.parameters.alignment, round(self.geometry.length, 6)
        plan = self.geometry.alignment.position(self.stations)
        points = np.column_stack([plan, self.geometry.profile.elevation(self.stations)])
        properties = {"id": "alignment", "instance": alignment.instance, "object_type": "Alignment", "length": length}
        properties |= {"feature": "centerline", "stations": np.round(self.stations, DIGITS).tolist()}
        return _feature(properties, "LineString", self._map(points))

    def damages(self) -> Iterator[Feature]:
        """Yield the damage of the pavements: ruts and cracks as lines, the rest as areas."""
        for name, carriageway in self.geometry.parameters.of_type(Carriageway).items():
            pavement = carriageway.pavement
            shapes: list[tuple[Rut | Pothole | Patch | Crack | RemovedMarking, str, list[Any]]] = [
                *((rut, "MultiLineString", self._wheel_tracks(carriageway, rut)) for rut in pavement.ruts),
                *((hole, "Polygon", [self._ring(_ellipse(hole))]) for hole in pavement.potholes),
                *((patch, "Polygon", [self._ring(patch_outline(patch))]) for patch in pavement.patches),
                *(
                    (crack, "MultiLineString", [self._on_surface(np.array(line)) for line in crack.lines])
                    for crack in pavement.cracks
                ),
                *(
                    (line, "MultiPolygon", [[self._ring(outline)] for outline in self._ground_off(line, pavement)])
                    for line in pavement.removed_markings
                ),
            ]
            for number, (item, kind, coordinates) in enumerate(shapes):
                part, instance = self.geometry.numbers.part(name, number)
                properties = {"id": part, "instance": instance, "feature": _DAMAGE_NAMES[type(item)]}
                properties |= {"object_type": type(item).__name__, "side": carriageway.side}
                if coordinates and coordinates[0]:
                    yield _feature(properties | item.model_dump(exclude={"outline", "lines"}), kind, coordinates)

    def _ground_off(self, marking: RemovedMarking, pavement: Pavement) -> list[Float]:
        """Return the outlines (K, 2) of a removed marking's dashes, in stations and offsets."""
        return list(removed_outlines(marking, pavement, self.geometry.length))

    def _wheel_tracks(self, carriageway: Carriageway, rut: Rut) -> list[Any]:
        """Return the middles of a rut's two wheel tracks in map coordinates."""
        inside = self.stations[(self.stations > rut.start_station) & (self.stations < rut.end_station)]
        station = np.unique([rut.start_station, *inside, min(rut.end_station, self.geometry.length)])
        boundaries = self.geometry.sections[carriageway.side].lane_boundaries(station)
        middle = (boundaries[:, rut.lane] + boundaries[:, rut.lane + 1]) / 2.0
        tracks = (carriageway.sign * (middle + sign * rut.track / 2.0) for sign in (-1.0, 1.0))
        return [self._on_surface(np.column_stack([station, track])) for track in tracks]

    def _on_surface(self, places: Float) -> list[Any]:
        """Return map coordinates on the surface of places (N, 2) in stations and offsets."""
        return self._map(surface_points(self.geometry, places[:, 0], places[:, 1]))

    def _ring(self, outline: Float) -> list[Any]:
        """Return an outline (K, 2), in stations and offsets, as a closed ring on the surface; empty below 3 corners."""
        return self._on_surface(np.concatenate([outline, outline[:1]])) if len(outline) > 2 else []

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

    def _side_road(self, name: str, item: SideRoad) -> Iterator[Feature]:
        """Yield LineStrings along a side road's axis and along its pavement's edges."""
        mouth = self.geometry.mouths[name]
        side = mouth.section.carriageway.side
        properties = {"id": name, "instance": item.instance, "object_type": "SideRoad", "side": side}
        depth = np.unique([*np.arange(0.0, mouth.reach, 0.25), mouth.reach])
        lines = {"side_road_axis": mouth.axis_station(depth)}
        lines |= {f"side_road_{word}_edge": mouth.edge_station(sign, depth) for word, sign in _EDGES.items()}
        for feature, station in lines.items():
            points = np.column_stack([mouth.plan(station, depth), mouth.pavement_height(station, depth)])
            kept = points[simplify_polyline(points, self.tolerance)]
            yield _feature(properties | {"feature": feature}, "LineString", self._map(kept))

    def _crossing_road(self, name: str, item: CrossingRoad) -> Iterator[Feature]:
        """Yield LineStrings along a crossing road's axis and along its pavement's edges."""
        yield from self._grid_lines(name, item, network_of(self.geometry).crossings[name].grid, (5, 1, -2))

    def _ramp(self, name: str, item: ConnectingRamp) -> Iterator[Feature]:
        """Yield LineStrings along a ramp's axis and along its pavement's edges."""
        yield from self._grid_lines(name, item, network_of(self.geometry).joints[name].surface.grid, (4, 1, -2))

    def _ramp_guardrail(self, name: str, item: RampGuardrail) -> Iterator[Feature]:
        """Yield a LineString along the foot of a guardrail beside a ramp or a crossing road."""
        line = item.rail().line(other_road_course(self.geometry, item.road, self.tolerance))
        if line is not None:
            yield _feature(self._furniture(name, item), "LineString", self._map(line[0]))

    def _grid_lines(
        self, name: str, item: CrossingRoad | ConnectingRamp, grid: SurfaceGrid, columns: tuple[int, int, int]
    ) -> Iterator[Feature]:
        """Yield LineStrings along the axis and the left and right edge of a road, columns of its grid."""
        properties = {"id": name, "instance": item.instance, "object_type": item.type}
        word = "crossing_road" if isinstance(item, CrossingRoad) else "ramp"
        for part, column in zip(("axis", "left_edge", "right_edge"), columns, strict=True):
            points = grid.points[:, column]
            kept = points[simplify_polyline(points, self.tolerance)]
            yield _feature(properties | {"feature": f"{word}_{part}"}, "LineString", self._map(kept))

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
        """Yield LineStrings of a street side: top edge of its kerb, and the middle of its footway with its widths."""
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


def _ellipse(pothole: Pothole) -> Float:
    """Return a pothole's edge (K, 2) in stations and offsets."""
    turn = np.linspace(0.0, 2.0 * np.pi, _ELLIPSE_CORNERS, endpoint=False)
    return np.column_stack(
        [
            pothole.station + pothole.length / 2.0 * np.cos(turn),
            pothole.offset + pothole.width / 2.0 * np.sin(turn),
        ]
    )
