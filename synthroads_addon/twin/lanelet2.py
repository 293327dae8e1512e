"""Lanelet2's map in OpenStreetMap's XML: a lanelet for each lane between two places where lanes begin or end.

Lanelets beside each other share the line between them, and those behind each other its ends, by which Lanelet2 finds
neighbours and followers. A lane that opens or closes along a taper begins or ends in a point. Lines are dashed or solid
as they are marked: where one is dashed lanes may be changed. On roads of one carriageway the lanes of both directions
share the line between them. Speed limits are regulatory elements, where they aren't those that Lanelet2's German rules
take from a lanelet's subtype and location. Source: the documentation of Lanelet2, "LaneletPrimitives",
"LinestringTagging" and "RegulatoryElementTagging".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr  # nosec B406 # it writes files and reads none

import numpy as np

from ..base.arrays import Bool, Float, Index
from ..base.version import generator
from ..road.geometry import RoadGeometry
from ..road.guidelines import is_single
from ..road.objects import width_at
from ..road.parameters import RoadParameters
from ..road.section import Carriageway, LineMarking, Turnout
from ..road.tessellation import sample_stations
from .speeds import SpeedLimits
from .surfaces import surface_points
from .trace import Trace

_LEVEL = "lanes between their boundaries, which are lines"
_NO_LANE = "it is no lane: the file has lanes and their boundaries"
_LOST = dict.fromkeys(
    ("RoadObject", "dash", "strip", "rut", "pothole", "patch", "crack", "removed", "tree", "shrub"), _NO_LANE
)
"""Type of object, or kind of part -> why the file has none."""
_THERE = 1e-6
"""Width above which a lane is there, m."""
_SHARED = 1e-3
"""Distance (m) up to which two boundaries are one line. Chosen."""
_STRIP = "outer_edge_strip"
_BESIDE = 0.35
"""Distance (m) up to which a line that follows no boundary is marked on one, between the directions: double lines lie
0.12 to 0.25 m beside it. Chosen."""
_WIDEST = 0.35
"""Width (m) from which on a line between the directions is none, but a stripe of a crossing, say. Chosen."""
_SHORTEST = 0.5
"""Length (m) up to which a change of markings or limits is where lanelets are cut already. Chosen."""
_RULED_SPEED = {("highway", "nonurban"): 130.0, ("road", "nonurban"): 100.0, ("road", "urban"): 50.0}
"""Subtype and location of a lanelet -> speed, km/h, that Lanelet2's rules of Germany take without another."""
_MOST_DIGITS = 11
"""Decimals of longitudes and latitudes: a micrometre."""
_FIRST_NODE = 1_000_001
"""Number of the first node: lines and lanelets, of which there are fewer, have the numbers below it."""
_STEP = 1e-4
"""Distance (m) up to which two points of lines are one. Chosen."""


@dataclass
class _Map:
    """Nodes, lines and lanelets of a file, with their numbers.

    Attributes:
        nodes: (3,) map coordinates of each, m, in the order of their numbers, from `_FIRST_NODE`.
        ways: numbers of nodes, and tags, by number.
        lanelets: numbers of the left and right line, of the speed limit, if it has one, and tags, by number.
        limits: tags of speed limits by number.
    """

    nodes: list[Float] = field(default_factory=list)
    ways: dict[int, tuple[list[int], dict[str, str]]] = field(default_factory=dict)
    lanelets: dict[int, tuple[int, int, int | None, dict[str, str]]] = field(default_factory=dict)
    limits: dict[int, dict[str, str]] = field(default_factory=dict)
    _number_of: dict[tuple[int, ...], int] = field(default_factory=dict)
    _way_of: dict[tuple[int, ...], int] = field(default_factory=dict)
    _limit_of: dict[float, int] = field(default_factory=dict)
    _next: int = 1

    def node(self, place: Float) -> int:
        """Return the number of the node at a place (3,), m; a new one unless there is one."""
        key = tuple(np.rint(place / _STEP).astype(np.int64).tolist())
        if key not in self._number_of:
            self._number_of[key] = _FIRST_NODE + len(self.nodes)
            self.nodes.append(place)
        return self._number_of[key]

    def way(self, places: Float, tags: dict[str, str]) -> int:
        """Return the number of the line through places (N, 3), m, in either direction; a new one unless there is one.

        Lanes of both directions share the line between them: it has the tags of the one by which it is marked.
        """
        nodes = [self.node(place) for place in places]
        kept = [number for i, number in enumerate(nodes) if not i or number != nodes[i - 1]]
        key = min(tuple(kept), tuple(kept[::-1]))
        if key not in self._way_of:
            self._way_of[key] = self._take()
            self.ways[self._way_of[key]] = (kept, tags)
        elif self.ways[self._way_of[key]][1] == _UNMARKED:
            self.ways[self._way_of[key]] = (kept, tags)
        return self._way_of[key]

    def lanelet(self, left: int, right: int, limit: int | None, tags: dict[str, str]) -> int:
        """Return the number of a new lanelet between two lines, with a speed limit or none of its own."""
        number = self._take()
        self.lanelets[number] = (left, right, limit, tags)
        return number

    def limit(self, speed: float) -> int:
        """Return the number of a speed limit, km/h; a new one unless there is one."""
        if speed not in self._limit_of:
            self._limit_of[speed] = self._take()
            tags = {"type": "regulatory_element", "subtype": "speed_limit", "sign_type": f"{speed:g} km/h"}
            self.limits[self._limit_of[speed]] = tags
        return self._limit_of[speed]

    def _take(self) -> int:
        """Return the next number of a line or a lanelet."""
        number = self._next
        self._next += 1
        return number


def write_lanelet2(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road's lanes as a Lanelet2 map; return the trace of what became of each object.

    Args:
        parameters: the road.
        path: of the file.
        tolerance: largest chord error of curved lines, m; their points are exact.
    """
    geometry = RoadGeometry(parameters)
    trace = Trace(geometry, _LEVEL, reasons=_LOST)
    carriageways = parameters.of_type(Carriageway)
    limits = {name: SpeedLimits(geometry, item.side) for name, item in carriageways.items()}
    groups = [list(carriageways)] if is_single(parameters.design_class) else [[name] for name in carriageways]
    content = _Map()
    for names in groups:
        changes = [station for name in names for station in _changes(geometry, carriageways[name], limits[name])]
        stations = np.unique(np.concatenate([sample_stations(geometry, tolerance), changes]))
        parts = [
            _Direction(carriageways[name], *_lanes(geometry, name, carriageways[name], stations), limits[name])
            for name in names
        ]
        presence = np.stack([lane.present for part in parts for lane in part.lanes])
        # Lanes of both directions that share a line are cut at the same places.
        borders = stations[1:-1][(np.diff(presence.astype(np.int8), axis=1) != 0).any(axis=0)]
        cuts = np.searchsorted(stations, _cuts(borders.tolist(), changes, geometry.length))
        for part in parts:
            _add_direction(content, geometry, part, stations, cuts, trace)
    path.write_text("".join(f"{line}\n" for line in _lines(content, parameters)), encoding="utf-8", newline="\n")
    return trace


def _changes(geometry: RoadGeometry, item: Carriageway, limits: SpeedLimits) -> Iterator[float]:
    """Yield the stations, m, at which the speed limit of a carriageway or a line between its lanes changes."""
    for rows in (limits.stretches, limits.towns):
        yield from (station for row in rows for station in row[:2])
    for line in geometry.parameters.of_type(LineMarking).values():
        edge = _edge_of(geometry, line)
        if geometry.parameters.carriageway_of(line) is item and edge is not None and edge.isdigit() and edge != "0":
            yield from (line.start_station, line.end_station)


def _cuts(borders: list[float], changes: Iterable[float], length: float) -> list[float]:
    """Return the stations, m, at which lanelets end: all borders of lanes, and changes that are apart from others."""
    kept = [0.0, *borders, length]
    for station in sorted(changes):
        if min(abs(station - other) for other in kept) > _SHORTEST:
            kept.append(station)
    return sorted(kept)[1:-1]


@dataclass(frozen=True)
class _LaneEdges:
    """A lane of a carriageway, or of a turnout, between its boundaries.

    Attributes:
        name: of the lane in the file.
        instance: of the object that it belongs to.
        inner, outer: names of its boundaries.
        present: (S - 1,) whether it is there between two stations.
    """

    name: str
    instance: int
    inner: str
    outer: str
    present: Bool


@dataclass(frozen=True)
class _Direction:
    """A carriageway with what its lanelets need.

    Attributes:
        item: the carriageway.
        lanes: of it and of its turnouts.
        boundaries: distances (S,) of the lanes' boundaries, m, by name.
        limits: speed limits along it.
    """

    item: Carriageway
    lanes: list[_LaneEdges]
    boundaries: dict[str, Float]
    limits: SpeedLimits


def _add_direction(
    content: _Map, geometry: RoadGeometry, part: _Direction, stations: Float, cuts: Index, trace: Trace
) -> None:
    """Add the lanelets of a carriageway and of its turnouts, between stations with the numbers `cuts`, to a map."""
    item = part.item
    is_inner_left = item.traffic * item.sign < 0
    for rows in np.split(np.arange(len(stations) - 1), cuts):
        points = np.r_[rows, rows[-1] + 1][:: item.traffic]
        begin, end = float(stations[rows[0]]), float(stations[rows[-1] + 1])
        place, limit = _place_and_limit(content, geometry, part.limits, (begin + end) / 2.0)
        ways: dict[str, int] = {}
        for lane in part.lanes:
            if not lane.present[rows[0]]:
                continue
            inner, outer = (
                _boundary(content, geometry, item, stations, part.boundaries, points, edge, ways)
                for edge in (lane.inner, lane.outer)
            )
            left, right = (inner, outer) if is_inner_left else (outer, inner)
            tags = {"type": "lanelet", **place, "one_way": "yes"}
            tags |= {"synthroads_id": lane.name, "synthroads_instance": str(lane.instance)}
            trace.record_entity(lane.instance, lanelet=content.lanelet(left, right, limit, tags))


def _place_and_limit(
    content: _Map, geometry: RoadGeometry, limits: SpeedLimits, station: float
) -> tuple[dict[str, str], int | None]:
    """Return the tags of a lanelet's kind of road and place at a station, and its speed limit unless these say it."""
    subtype = "road" if is_single(geometry.parameters.design_class) else "highway"
    location = "urban" if any(start <= station <= end for start, end in limits.towns) else "nonurban"
    speed = next(speed for start, end, speed in limits.stretches if start <= station <= end)
    is_ruled = _RULED_SPEED.get((subtype, location)) == speed
    return {"subtype": subtype, "location": location}, None if is_ruled else content.limit(speed)


def _lanes(
    geometry: RoadGeometry, name: str, item: Carriageway, stations: Float
) -> tuple[list[_LaneEdges], dict[str, Float]]:
    """Return the lanes of a carriageway, and the distances (S,) of their boundaries by name."""
    section = geometry.sections[item.side]
    distances = section.lane_boundaries(stations)
    boundaries = {str(number): distances[:, number] for number in range(len(item.lanes) + 1)}
    lanes = [
        _LaneEdges(
            f"{name}/lane-{number}",
            item.instance,
            str(number + 1),
            str(number),
            _between(distances[:, number] - distances[:, number + 1]),
        )
        for number in range(len(item.lanes))
    ]
    for shape in section.turnouts:
        turnout: Turnout = shape.turnout
        if turnout.ramp is None:
            continue
        inner, outer = section.boundaries_of("turnout_lane", stations)
        start, end = shape.range()
        is_inside = (stations >= start - _STEP) & (stations <= end + _STEP)
        width = np.where(is_inside, outer - inner, 0.0)
        key = f"turnout-{turnout.instance}"
        present = _between(width)
        # Beside the through lanes both have one line between them, and the strip that it is marked on belongs to the
        # turnout's lane; where the ramp has left them it has a line of its own.
        strip = section.boundaries_of(_STRIP, stations)[1] if _STRIP in section.kinds else distances[:, 0]
        is_beside = inner < strip + _SHARED
        boundaries |= {f"{key}-inner": np.where(is_beside, distances[:, 0], inner), f"{key}-outer": outer}
        beside = is_beside[:-1] & is_beside[1:]
        turnout_name = next(
            key for key, other in geometry.parameters.objects.items() if other.instance == turnout.instance
        )
        for edge, part in (("0", present & beside), (f"{key}-inner", present & ~beside)):
            if part.any():
                lanes.append(_LaneEdges(turnout_name, turnout.instance, edge, f"{key}-outer", part))
    return lanes, boundaries


def _between(width: Float) -> Bool:
    """Return whether (S - 1,) a lane with widths (S,) at stations is there between two of them."""
    is_wide = width > _THERE
    return np.asarray(is_wide[:-1] | is_wide[1:])


def _boundary(
    content: _Map,
    geometry: RoadGeometry,
    item: Carriageway,
    stations: Float,
    boundaries: dict[str, Float],
    points: Index,
    edge: str,
    ways: dict[str, int],
) -> int:
    """Return the line of a boundary at chosen stations, in the direction of traffic; a new one unless there is one."""
    if edge not in ways:
        offsets = item.sign * boundaries[edge][points]
        places = surface_points(geometry, stations[points], offsets)
        middle = float(stations[points].mean())
        ways[edge] = content.way(
            places + np.array(geometry.parameters.transform.translate), _marking(geometry, item, edge, middle)
        )
    return ways[edge]


_UNMARKED = {"type": "virtual"}
"""Tags of a line that isn't marked."""


def _marking(geometry: RoadGeometry, item: Carriageway, edge: str, station: float) -> dict[str, str]:
    """Return the tags of a boundary by the lines that are marked on it at a station; a virtual one without."""
    found: list[tuple[float, str, LineMarking]] = []
    for name, line in geometry.parameters.of_type(LineMarking).items():
        is_here = line.start_station <= station <= line.end_station and _edge_of(geometry, line) == edge
        if is_here and geometry.parameters.carriageway_of(line) is item:
            place = item.sign * float(width_at(line.offset, np.array([station]))[0]) if line.kind == "free" else 0.0
            found.append((place, name, line))
    if not found:
        return dict(_UNMARKED)
    found.sort(reverse=item.traffic > 0)  # offsets grow to the left of the stations: from left to right of the traffic
    kinds = ["dashed" if line.dash_length else "solid" for _, _, line in found]
    kind = "line_thick" if any(line.kind == "block" for _, _, line in found) else "line_thin"
    subtype = kinds[0] if len(kinds) == 1 or kinds[0] == kinds[-1] == "dashed" else f"{kinds[0]}_{kinds[-1]}"
    return {"type": kind, "subtype": subtype, "synthroads_id": ",".join(name for _, name, _ in found)}


def _edge_of(geometry: RoadGeometry, line: LineMarking) -> str | None:
    """Return the name of the boundary that a line is marked on; None for one that lies free.

    The line between the directions follows no boundary: it lies free at the innermost one.
    """
    if line.kind in ("turnout_edge", "gore_edge") and line.turnout:
        side = "outer" if line.kind == "turnout_edge" else "inner"
        return f"turnout-{geometry.parameters.objects[line.turnout].instance}-{side}"
    if line.kind != "free":
        return str(line.boundary)
    item = geometry.parameters.carriageway_of(line)
    if not is_single(geometry.parameters.design_class) or line.width > _WIDEST:
        return None
    middle = np.array([(line.start_station + line.end_station) / 2.0])
    innermost = geometry.sections[item.side].lane_boundaries(middle)[0, -1]
    return str(len(item.lanes)) if abs(line.offset - innermost) < _BESIDE else None


def _lines(content: _Map, parameters: RoadParameters) -> Iterator[str]:
    """Yield the lines of the file."""
    from pyproj import Transformer  # takes a fifth of a second

    places = np.array(content.nodes).reshape(-1, 3)
    degrees = Transformer.from_crs(parameters.metadata.epsg, 4326, always_xy=True)
    longitude, latitude = degrees.transform(places[:, 0], places[:, 1])
    yield "<?xml version='1.0' encoding='UTF-8'?>"
    yield f'<osm version="0.6" generator={quoteattr(generator())}>'
    for number, (lon, lat, height) in enumerate(zip(longitude, latitude, places[:, 2], strict=True), _FIRST_NODE):
        place = f'lat="{lat:.{_MOST_DIGITS}f}" lon="{lon:.{_MOST_DIGITS}f}"'
        yield f'  <node id="{number}" visible="true" version="1" {place}><tag k="ele" v="{height:.4f}"/></node>'
    for number, (nodes, tags) in content.ways.items():
        yield f'  <way id="{number}" visible="true" version="1">'
        yield from (f'    <nd ref="{node}"/>' for node in nodes)
        yield from _tags(tags)
        yield "  </way>"
    for number, tags in content.limits.items():
        yield f'  <relation id="{number}" visible="true" version="1">'
        yield from _tags(tags)
        yield "  </relation>"
    for number, (left, right, limit, tags) in content.lanelets.items():
        yield f'  <relation id="{number}" visible="true" version="1">'
        yield f'    <member type="way" ref="{left}" role="left"/>'
        yield f'    <member type="way" ref="{right}" role="right"/>'
        if limit is not None:
            yield f'    <member type="relation" ref="{limit}" role="regulatory_element"/>'
        yield from _tags(tags)
        yield "  </relation>"
    yield "</osm>"


def _tags(tags: dict[str, str]) -> Iterator[str]:
    """Yield the lines of tags."""
    return (f"    <tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items())
