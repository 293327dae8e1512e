"""The reference line and the plane of a carriageway through it: plan view, elevation profile, superelevation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...road.alignment import left_vectors
from ...road.geometry import RoadGeometry
from ...road.guidelines import is_single
from ...road.objects import Side
from .pieces import Cubics, Float, fit_cubics, fit_pieces, join_cubics, merge_similar, merged_stations
from .xml import PLAN_DIGITS, Element, Value, add_cubic, element

_APPROXIMATIONS = 2
SIDES: tuple[Side, ...] = ("right", "left")
"""From right to left, as t grows."""
BESIDE = 0.5
"""Distance (m) along the main road from a side road's corners to the junction's ends; chosen."""
CONNECTOR = 8.0
"""Length of a junction where a ramp leaves the main road or comes to it, m; chosen."""
MEETING = 1e-4
"""Distance (m), in plan and in height, up to which the inner edges of two carriageways are one line."""
_LINE_APART = 1e-4  # m, between the end of a line that stands for several and where it should be
_LINE_TURN = 1e-6  # rad, up to which the standard's checker takes two lines for one


def plan_view(road: Element, geometry: RoadGeometry) -> None:
    """Add the `planView` element: a line, arc or spiral per element of the alignment, straight lines joined.

    Each begins where the alignment, evaluated in float64, has its border, so that nothing adds up along the road.
    """
    alignment = geometry.alignment
    starts = alignment.element_starts
    position, heading, _ = alignment.frame(starts)
    parent = element(road, "planView")
    for first_element, last_element in _joined_lines(geometry, position, heading):
        item = alignment.elements[first_element]
        attributes: dict[str, Value] = {
            "s": float(starts[first_element]),
            "x": _plan(position[first_element, 0]),
            "y": _plan(position[first_element, 1]),
            "hdg": f"{heading[first_element] + 0.0:.13g}",
            "length": float(starts[last_element + 1] - starts[first_element]),
        }
        kind = element(parent, "geometry", attributes)
        if item.kind == "line":
            element(kind, "line")
        elif item.kind == "arc":
            element(kind, "arc", {"curvature": _curvature(item.mean_curvature)})
        else:
            ends = {"curvStart": _curvature(item.curvature_start), "curvEnd": _curvature(item.curvature_end)}
            element(kind, "spiral", ends)


def plan_range(road: Element, geometry: RoadGeometry, start: float, end: float) -> None:
    """Add the `planView` element of the line between two stations (m), counted from the first."""
    alignment = geometry.alignment
    starts = alignment.element_starts
    position, heading, _ = alignment.frame(starts)
    parent = element(road, "planView")
    for first_element, last_element in _joined_lines(geometry, position, heading):
        begin, until = float(starts[first_element]), float(starts[last_element + 1])
        low, high = max(begin, start), min(until, end)
        if high - low <= MEETING / 100.0:
            continue
        place, turn, curvature = alignment.frame(np.array([low, np.nextafter(high, low)]))
        attributes: dict[str, Value] = {
            "s": low - start,
            "x": _plan(place[0, 0]),
            "y": _plan(place[0, 1]),
            "hdg": f"{turn[0] + 0.0:.13g}",
            "length": high - low,
        }
        item = alignment.elements[first_element]
        kind = element(parent, "geometry", attributes)
        if item.kind == "line":
            element(kind, "line")
        elif item.kind == "arc":
            element(kind, "arc", {"curvature": _curvature(item.mean_curvature)})
        else:
            ends = {"curvStart": _curvature(float(curvature[0])), "curvEnd": _curvature(float(curvature[1]))}
            element(kind, "spiral", ends)


def _plan(value: float) -> str:
    """Return the text of a plan coordinate (m), rounded to `PLAN_DIGITS` decimals and without a negative zero."""
    return repr(round(float(value), PLAN_DIGITS) + 0.0)


def _curvature(value: float) -> str:
    """Return the text of a curvature (1/m) with 15 significant digits and without a negative zero."""
    return f"{value + 0.0:.15g}"


def _joined_lines(geometry: RoadGeometry, position: Float, heading: Float) -> list[tuple[int, int]]:
    """Return (first, last) alignment elements of each plan geometry, consecutive collinear lines joined."""
    joined: list[tuple[int, int]] = []
    for number, item in enumerate(geometry.alignment.elements):
        if joined and item.kind == "line" and geometry.alignment.elements[joined[-1][0]].kind == "line":
            first_element = joined[-1][0]
            vector = position[number + 1] - position[first_element]
            distance = abs(vector[1] * np.cos(heading[first_element]) - vector[0] * np.sin(heading[first_element]))
            if abs(heading[number] - heading[first_element]) < _LINE_TURN and distance < _LINE_APART:
                joined[-1] = (first_element, number)
                continue
        joined.append((number, number))
    return joined


@dataclass(frozen=True)
class RoadCoordinates:
    """Points in an OpenDRIVE road's coordinates: s, t and h normal to its superelevated surface, (N,) each, m."""

    s: Float
    t: Float
    h: Float


class RoadFrame:
    """One carriageway as an OpenDRIVE road: its elevation profile and superelevation describe its plane.

    `BothWaysFrame` is that of a road whose one carriageway has both directions.

    That line is the road's elevation profile, the plane's tilt its superelevation: what readers of OpenDRIVE know.
    By the standard t lies in the tilted plane and h at right angles to it, both turned with the grade as well.

    Attributes:
        geometry: the road that it is a carriageway of.
        side: which one; of a road with both directions the one along the stations.
        sides: of the carriageways that belong to it.
        has_median: whether the median belongs to it.
        cuts: stations of a junction's end and a side road's corner there, m, lower one first.
        borders: (B,) stations between which all is smooth, m.
    """

    def __init__(self, geometry: RoadGeometry, side: Side) -> None:
        self.geometry, self.side = geometry, side
        self.sides: tuple[Side, ...] = (side,)
        self.section = geometry.sections[side]
        self.cuts = [(m.low.start_station - BESIDE, m.low.start_station) for m in geometry.mouths.values()]
        self.cuts += [(m.high.start_station, m.high.start_station + BESIDE) for m in geometry.mouths.values()]
        self.has_median = side == "right" and len(geometry.sections) == 2
        stations = [s for section in geometry.sections.values() for s in section.kinks()]
        for section in geometry.sections.values():
            stations += [point.station for point in section.carriageway.crossfall]
        stations += geometry.profile.breakpoints.tolist()
        self.cuts += [(s, s) for s in self._cut_stations()]
        stations += [s for span in self.cuts for s in span]
        self.borders = merged_stations(stations, 0.0, geometry.length)
        self.elevation: Cubics = fit_cubics(lambda s: self.plane_elevation(s, np.zeros(len(s)))[:, None], self.borders)
        self.superelevation: Cubics = self._fit_superelevation()

    def _cut_stations(self) -> list[float]:
        """Return the stations (m) at which the junctions of ramps that go on as roads begin and end."""
        shapes = [shape for shape in self.section.turnouts if shape.joined]
        signs = [1.0 if shape.leaves_forward() else -1.0 for shape in shapes]
        ends = [(shape.ramp_end(), sign) for shape, sign in zip(shapes, signs, strict=True)]
        return [s for end, sign in ends for s in (end, end + sign * CONNECTOR)]

    def crossfall(self, station: Float) -> Float:
        """Return the crossfall (N,) of the carriageway's plane at stations (N,), as a ratio, rising to the left."""
        return np.asarray(self.geometry.crossfall(self.section.carriageway, station))

    def plane_elevation(self, station: Float, offset: Float) -> Float:
        """Return the elevations (N,) of this carriageway's plane at stations and offsets (N,), m."""
        return self.elevation_of_plane(self.geometry, self.side, station, offset)

    @staticmethod
    def elevation_of_plane(geometry: RoadGeometry, side: Side, station: Float, offset: Float) -> Float:
        """Return the elevations (N,) of the plane of the carriageway on a side at stations and offsets (N,), m."""
        section = geometry.sections[side]
        rise = geometry.crossfall(section.carriageway, station)
        pivot = section.carriageway.sign * section.pivot(station)
        return np.asarray(geometry.profile.elevation(station) + rise * (offset - pivot))

    def fall(self, side: Side, station: Float, distances: Float) -> Float:
        """Return how far (N, B) a carriageway's borders lie below the plane, m, by distances (N, B) from the line."""
        section = self.geometry.sections[side]
        crossfall = self.geometry.crossfall(section.carriageway, station)
        rise = section.carriageway.sign * crossfall[:, None]
        plane = rise * (distances - section.pivot(station)[:, None])
        return np.asarray(plane - section.elevations(station, crossfall, distances))

    def t_coordinate(self, station: Float, offset: Float, depth: Float | float = 0.0) -> Float:
        """Return the coordinate t (N,) of points at offsets (N,) that lie ``depth`` below the plane vertically, m."""
        # In the section normal to a line that climbs, tan(tilt) = rise * cos(climb), and a metre down is cos(climb).
        cosine = self._cosine(station)
        slant = self.crossfall(station) * cosine
        stretch = np.sqrt(1.0 + slant**2)
        return np.asarray(offset * stretch - depth * cosine * slant / stretch)

    def h_coordinate(self, station: Float, depth: Float) -> Float:
        """Return the coordinate h (N,), normal to the plane, of points that lie ``depth`` below it vertically, m."""
        cosine = self._cosine(station)
        return np.asarray(-depth * cosine / np.sqrt(1.0 + (self.crossfall(station) * cosine) ** 2))

    def road_coordinates(self, station: Float, offset: Float, height: Float) -> RoadCoordinates:
        """Convert stations, offsets and heights above the profile (N,) to OpenDRIVE road coordinates s, t, h, m."""
        geometry = self.geometry
        station, offset, height = (np.asarray(values, dtype=np.float64) for values in (station, offset, height))
        station = np.clip(station, 0.0, geometry.length)
        elevation = height + geometry.profile.elevation(station)
        origin, heading, _ = geometry.alignment.frame(station)
        xy = origin + offset[:, None] * left_vectors(heading)
        s = station
        # A point above the line lies at right angles to a place of it farther on, where it climbs.
        for _ in range(_APPROXIMATIONS):
            ahead_distance, _, normal_distance = self._line_coordinates(s, xy, elevation)
            stretch_factor = 1.0 - geometry.alignment.curvature(s) * offset
            s = np.clip(s + ahead_distance * self._cosine(s) / stretch_factor, 0.0, geometry.length)
        _, left_distance, normal_distance = self._line_coordinates(s, xy, elevation)
        tilt = self.superelevation.at(s)
        cos, sin = np.cos(tilt), np.sin(tilt)
        return RoadCoordinates(
            s, left_distance * cos + normal_distance * sin, normal_distance * cos - left_distance * sin
        )

    def ahead_of_station(self, station: float, height: float) -> float:
        """Return how far (m) along the line a place lies ahead of its s: its height (m) above the line times the climb.

        By the standard t and h lie in a plane at right angles to the line in space, which leans where the line climbs.
        """
        grade = float(self.elevation.slope(np.array([station]))[0])
        return -(height - float(self.elevation.at(np.array([station]))[0])) * grade

    def _line_coordinates(self, s: Float, xy: Float, elevation: Float) -> tuple[Float, Float, Float]:
        """Return distances (N,) of points from the line at s: ahead along it, to its left, and normal above it, m."""
        origin, heading, _ = self.geometry.alignment.frame(s)
        vectors, left_normals = xy - origin, left_vectors(heading)
        ahead_distance = vectors[:, 0] * left_normals[:, 1] - vectors[:, 1] * left_normals[:, 0]
        height_above, grade, cosine = elevation - self.elevation.at(s), self.elevation.slope(s), self._cosine(s)
        return (
            (ahead_distance + grade * height_above) * cosine,
            (vectors * left_normals).sum(axis=1),
            (height_above - grade * ahead_distance) * cosine,
        )

    def _cosine(self, station: Float) -> Float:
        """Return the cosine (N,) of the reference line's slope angle at stations (N,)."""
        return np.asarray(1.0 / np.sqrt(1.0 + self.elevation.slope(station) ** 2))

    def _fit_superelevation(self) -> Cubics:
        """Return the superelevation as cubics, rad: measured in the section normal to the line, not vertical."""
        levels = self.elevation

        def tilt(station: Float, piece: NDArray[np.intp]) -> Float:
            """Return the tilt (N,) at stations on pieces of given numbers: arctan of the crossfall times cos(slope)."""
            _, b, c, d = levels.coefficients[piece, 0].T
            u = station - levels.borders[piece]
            grade = b + u * (2.0 * c + 3.0 * d * u)
            return np.asarray(np.arctan(self.crossfall(station) / np.sqrt(1.0 + grade**2)))

        return fit_pieces(tilt, levels.borders)


class BothWaysFrame(RoadFrame):
    """A carriageway with both directions as one OpenDRIVE road: its plane has the mean crossfall of both halves.

    The plane goes through the line at which they meet. On one plane both halves lie in it; those of a roof lie below
    it outwards, which heights of their lanes say.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        super().__init__(geometry, "right")
        self.sides = ("left", "right")
        self.has_median = False

    def crossfall(self, station: Float) -> Float:
        """Return the mean crossfall (N,) of both halves at stations (N,), as a ratio, rising to the left."""
        falls = [self.geometry.crossfall(section.carriageway, station) for section in self.geometry.sections.values()]
        return np.asarray(sum(falls) / len(falls))

    def plane_elevation(self, station: Float, offset: Float) -> Float:
        """Return the elevations (N,) of the plane at stations and offsets (N,), m."""
        meeting_offset = self.section.carriageway.sign * self.section.distances(station)[:, 0]
        height = self.elevation_of_plane(self.geometry, self.side, station, meeting_offset)
        return np.asarray(height + self.crossfall(station) * (offset - meeting_offset))

    def fall(self, side: Side, station: Float, distances: Float) -> Float:
        """Return how far (N, B) a half's borders lie below the plane, m, by distances (N, B) from the line."""
        section = self.geometry.sections[side]
        crossfall = self.geometry.crossfall(section.carriageway, station)
        heights = section.elevations(station, crossfall, distances)
        rows = np.repeat(station, distances.shape[1])
        plane = self.plane_elevation(rows, section.carriageway.sign * distances.ravel()).reshape(distances.shape)
        return np.asarray(plane - self.geometry.profile.elevation(station)[:, None] - heights)


def road_frames(geometry: RoadGeometry) -> list[RoadFrame]:
    """Return the roads that a file has: one of a country road, whose halves meet, else one for each carriageway."""
    if is_single(geometry.parameters.design_class) and _halves_meet(geometry):
        return [BothWaysFrame(geometry)]
    return [RoadFrame(geometry, side) for side in geometry.sections]


def _halves_meet(geometry: RoadGeometry) -> bool:
    """Return whether both carriageways have one inner edge all along the road."""
    if len(geometry.sections) < len(SIDES):
        return False
    kinks = [s for section in geometry.sections.values() for s in section.kinks()]
    falls = [point.station for s in geometry.sections.values() for point in s.carriageway.crossfall]
    stations = np.clip([0.0, geometry.length, *kinks, *falls], 0.0, geometry.length)
    inner = []
    for section in geometry.sections.values():
        distance = section.distances(stations)
        height = section.elevations(stations, geometry.crossfall(section.carriageway, stations), distance)
        inner.append(np.stack([section.carriageway.sign * distance[:, 0], height[:, 0]]))
    first_edge, second_edge = inner
    return bool(np.abs(first_edge - second_edge).max() < MEETING)


def elevation_profile(road: Element, frame: RoadFrame) -> None:
    """Add the `elevationProfile` element: elevations of the carriageway's plane along the centreline."""
    _cubics(element(road, "elevationProfile"), "elevation", frame.elevation)


def lateral_profile(road: Element, frame: RoadFrame) -> None:
    """Add the `lateralProfile` element with the carriageway's superelevation."""
    _cubics(element(road, "lateralProfile"), "superelevation", frame.superelevation)


def _cubics(parent: Element, tag: str, function: Cubics) -> None:
    """Add an element for each cubic of a function of the station, neighbours that continue each other as one."""
    rows = join_cubics(function.borders, function.coefficients[:, 0])
    for start, coefficients in merge_similar(rows, float(function.borders[-1])):
        add_cubic(parent, tag, {"s": start}, coefficients)


def edge_points(geometry: RoadGeometry) -> Float:
    """Return local coordinates (N, 2), m, of points on both edges of the road, every 10 m."""
    stations = np.linspace(0.0, geometry.length, max(2, int(geometry.length / 10.0) + 2))
    edges = geometry.offsets(stations)
    return np.concatenate([geometry.alignment.place(stations, edges[:, i]) for i in (0, -1)])


def header_bounds(geometry: RoadGeometry) -> dict[str, float]:
    """Return the header's bounding box of the road: north, south, east, west in local coordinates, whole metres."""
    points = edge_points(geometry)
    lower, upper = np.floor(points.min(axis=0)) - 1.0, np.ceil(points.max(axis=0)) + 1.0
    return {"north": float(upper[1]), "south": float(lower[1]), "east": float(upper[0]), "west": float(lower[0])}
