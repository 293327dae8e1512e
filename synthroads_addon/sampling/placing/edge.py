"""The pavement's edge along one carriageway, made ready for the many questions of the placement."""

from typing import NamedTuple

import numpy as np

from ...base.arrays import Float
from ...road.guidelines import SHORTEST_BARRIER
from ...road.objects import width_at
from ...road.section import Ramp
from ...road.section_geometry import CarriagewaySection
from ...road.turnout_geometry import STEP, TurnoutShape

ISLAND_ROOM = 3.2
"""Where the island between main road and ramp is wider than this, barriers and delineators leave the ramp's outer
side for the main road's (m)."""
STEP_OF_BARRIERS = 0.8
"""Barriers stand on one line where the lines differ by less, and may overlap along the road where by more, m."""
_RAMP_GRID = 5.0  # m; the wedge beside a ramp is convex, so that what is linear in between never lies inside it
_BEHIND_RAMP = 0.0005  # m: the pavement ends with the ramp, over `STEP` only to have a finite slope
_LEVEL = 1e-6  # m; edges that differ by less run parallel


class Segment(NamedTuple):
    """A stretch of road along which a barrier may stand at one distance.

    Attributes:
        start, end: stations, m.
        base: the largest distance of the edge from the centreline along it, m.
        ramp: it lies beside a gore, where the edge moves away from the road.
    """

    start: float
    end: float
    base: float
    ramp: bool = False


class EdgeProfile:
    """Distances (m) of the pavement's edges from the centreline by station, linear in between.

    Attributes:
        stations: (K,) m.
        paved: (K,) outer edge of the pavement, of ramps and bays too.
        main: (K,) outer edge of the main road's pavement.
        line: (K,) what barriers and delineators follow: the pavement's edge, but the main road's beside a wide island.
        island: (K,) width of the island between main road and ramp.
        segments: where a barrier may stand at one distance, in order, from the road's begin to its end.
    """

    def __init__(self, section: CarriagewaySection, length: float) -> None:
        marks, island_ranges = [np.array([0.0, length, *section.kinks()])], []
        for shape in section.turnouts:
            if shape.turnout.ramp:
                grid, beside_island = _ramp_marks(shape, shape.turnout.ramp)
                marks.append(grid)
                island_ranges.append(beside_island)
        stations = np.unique(np.clip(np.concatenate(marks), 0.0, length))
        distances = section.distances(stations)
        self.stations, self.paved, self.main = stations, distances[:, -2], section.main_edge(stations)
        self.island, self.line = np.zeros(stations.shape), self.paved.copy()
        if island_ranges:
            self.island = np.diff(distances, axis=1)[:, section.kinds.index("island")]
        for start, end in island_ranges:
            is_beside_island = (stations > start) & (stations < end)
            self.line[is_beside_island] = self.main[is_beside_island]
        self.segments = _segments(stations, self.line, self.paved)

    def tapers(self) -> list[tuple[float, float]]:
        """Return the stretches (m) between two stations along which the paved edge moves."""
        moving = np.flatnonzero(np.abs(np.diff(self.paved)) > _LEVEL)
        return [(float(self.stations[i]), float(self.stations[i + 1])) for i in moving]

    def largest_paved(self, start: float, end: float) -> float:
        """Return the largest distance of the paved edge between two stations, m."""
        return float(self._values(self.paved, start, end).max())

    def largest_main(self, start: float, end: float) -> float:
        """Return the largest distance of the main road's paved edge between two stations, m."""
        return float(self._values(self.main, start, end).max())

    def is_clear_beside_main(self, start: float, end: float, room: float) -> bool:
        """Return whether nothing is paved within so much room (m) outside of the main road between two stations."""
        paved, main, island = (self._values(values, start, end) for values in (self.paved, self.main, self.island))
        return bool(((paved - main < _LEVEL) | (island >= room)).all())

    def line_beside(self, station: Float, reach: float) -> Float:
        """Return the largest distance (N,) of the line within a reach of stations (N,), all m.

        Where the line passes from the ramp's outer side to the main road's, it is the ramp's.
        """
        samples = np.stack([station - reach, station, station + reach])
        line, paved, main = (np.interp(samples, self.stations, values) for values in (self.line, self.paved, self.main))
        is_on_ramp_side = (line > main + _LEVEL).any(axis=0)
        return np.where(is_on_ramp_side, paved.max(axis=0), line.max(axis=0))

    def base_at(self, station: float) -> float:
        """Return the base (m) of the segment at a station: where barriers are placed from."""
        return next((s.base for s in self.segments if station <= s.end), self.segments[-1].base)

    def _values(self, values: Float, start: float, end: float) -> Float:
        """Return the values at two stations, and at the profile's own between them."""
        inner_values = values[(self.stations > start) & (self.stations < end)]
        return np.append(inner_values, np.interp([start, end], self.stations, values))


def ramp_station(shape: TurnoutShape, x: float) -> float:
    """Return the station (m) at a distance x (m) from the gore's tip, away from the turnout's lane."""
    direction = shape.carriageway.traffic if shape.turnout.kind == "exit" else -shape.carriageway.traffic
    return shape.gore_tip() + direction * x


def island_begin(shape: TurnoutShape, ramp: Ramp, room: float) -> float:
    """Return the distance x (m) from the gore's tip at which the island is ``room`` (m) wide."""
    hard_shoulder = float(width_at(shape.carriageway.hard_shoulder_width, shape.gore_tip()))
    return float((6.0 * ramp.clothoid_parameter**2 * (hard_shoulder + room)) ** (1.0 / 3.0))


def _ramp_marks(shape: TurnoutShape, ramp: Ramp) -> tuple[Float, tuple[float, float]]:
    """Return the stations (m) that follow a ramp's bend, and the range in which its island is wide enough."""
    leaving_distance = min(max(island_begin(shape, ramp, ISLAND_ROOM), shape.nose + STEP), ramp.length)
    distances = np.concatenate([np.arange(0.0, ramp.length, _RAMP_GRID), [leaving_distance, leaving_distance + STEP]])
    tip, direction = ramp_station(shape, 0.0), ramp_station(shape, 1.0) - ramp_station(shape, 0.0)
    range_ends = (ramp_station(shape, leaving_distance), ramp_station(shape, ramp.length + STEP))
    return tip + direction * distances, (min(range_ends), max(range_ends))


def _segments(stations: Float, line: Float, paved: Float) -> list[Segment]:
    """Return the segments, each of one base: where the line runs level, or lies farther out than on both sides."""
    is_level = np.abs(np.diff(line)) < _LEVEL
    # Where the line leaves a ramp's outer side, the ramp goes on to move away.
    is_beside_island = line < paved - _LEVEL
    is_leaving = ~is_level & (is_beside_island[1:] != is_beside_island[:-1])
    edges = np.where(np.append(is_leaving, False) | np.append(False, is_leaving), paved, line)
    bases_of_intervals = np.where(is_leaving, np.maximum(edges[:-1], edges[1:]), np.maximum(line[:-1], line[1:]))
    starts_segment = np.append(
        True, (is_level[1:] != is_level[:-1]) | (is_level[1:] & (np.abs(np.diff(bases_of_intervals)) > _LEVEL))
    )
    first_intervals = np.flatnonzero(starts_segment)
    borders = [*stations[first_intervals].tolist(), float(stations[-1])]
    bases, levels = (
        np.maximum.reduceat(bases_of_intervals, first_intervals).tolist(),
        is_level[first_intervals].tolist(),
    )
    runs = [Segment(borders[i], borders[i + 1], bases[i], not levels[i]) for i in range(len(bases))]
    # A taper belongs to its wider side; what is wider than both sides lies beside a gore.
    bases_with_ends = [-np.inf, *bases, -np.inf]
    segments = [
        run._replace(ramp=run.ramp and run.base > max(bases_with_ends[i], bases_with_ends[i + 2]) + _LEVEL)
        for i, run in enumerate(runs)
    ]
    return _join_segments(_raise_short_segments(_join_segments(segments), stations[is_beside_island].tolist()))


def _join_segments(segments: list[Segment]) -> list[Segment]:
    """Return segments with neighbours joined whose bases differ too little for two lines of barriers."""
    joined: list[Segment] = []
    for segment in segments:
        joined.append(segment)
        while len(joined) > 1 and _in_line(*joined[-2:]):
            later, earlier = joined.pop(), joined.pop()
            is_ramp = earlier.ramp and later.ramp
            joined.append(Segment(earlier.start, later.end, max(earlier.base, later.base), is_ramp))
    return joined


def _in_line(earlier: Segment, later: Segment) -> bool:
    """Return whether two segments follow each other at bases so near that one line of barriers serves both."""
    return earlier.end == later.start and abs(earlier.base - later.base) < STEP_OF_BARRIERS


def _raise_short_segments(segments: list[Segment], beside_island: list[float]) -> list[Segment]:
    """Return segments, those too short for a barrier between wider ones set out to the less wide one's base.

    Beside an island (stations, m) a barrier can't stand farther out: that part of the segment falls away.
    """
    result = segments[:1]
    for earlier, segment, later in zip(segments, segments[1:], segments[2:], strict=False):
        wider_bases = [s.base for s in (earlier, later) if not s.ramp]
        is_short = segment.end - segment.start < SHORTEST_BARRIER and segment.base < min(earlier.base, later.base)
        if is_short and wider_bases and not segment.ramp:
            island_stations = [s for s in beside_island if segment.start <= s <= segment.end]
            start = max(island_stations) + _BEHIND_RAMP if island_stations and earlier.ramp else segment.start
            end = min(island_stations) - _BEHIND_RAMP if island_stations and later.ramp else segment.end
            result.append(Segment(start, max(start, end), min(wider_bases)))
        else:
            result.append(segment)
    return [*result, *segments[1:][-1:]]
