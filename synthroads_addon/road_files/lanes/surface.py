"""The surface of an OpenDRIVE road: offsets and heights of the borders of its lanes, by station.

ASAM OpenDRIVE 1.8.1, 10.5: t lies in the plane that the superelevation turns about the reference line, at right angles
to the line as it climbs; shape, crossfall and heights of lanes come on top, normal to that plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from .records import FileLane, FileRoad, FileSection, ShapeProfile


@dataclass(frozen=True)
class Edge:
    """A border of lanes at stations (N,).

    Attributes:
        offset: horizontal distance from the reference line, m, positive to the left.
        height: above its elevation, m.
    """

    offset: Float
    height: Float


@dataclass(frozen=True)
class LaneEdges:
    """A lane at stations (N,): its inner and its outer edge, which may be higher than the neighbour's."""

    lane: FileLane
    inner: Edge
    outer: Edge


@dataclass(frozen=True)
class _Frame:
    """The plane at stations (N,): cosine and sine of its tilt, cosine of the grade, crossfall of sides with any."""

    station: Float
    cos: Float
    sin: Float
    climb: Float
    falls: dict[int, Float]


class FileSurface:
    """The surface of a road of a file.

    Attributes:
        road: the road.
    """

    def __init__(self, road: FileRoad) -> None:
        self.road = road

    @property
    def is_plane(self) -> bool:
        """Return whether all of it lies in the plane of its superelevation, heights of single lanes left aside."""
        lanes = (lane for section in self.road.sections for side in section.lanes.values() for lane in side)
        return not (self.road.shapes or any(self.road.crossfall.values()) or any(lane.level for lane in lanes))

    def section_at(self, station: float) -> FileSection:
        """Return the lane section at a station, m."""
        before = [section for section in self.road.sections if section.start <= station]
        return before[-1] if before else self.road.sections[0]

    def rise(self, station: Float, inside: Float) -> Float:
        """Return how much (N,) the plane of the superelevation rises to the left at stations (N,), m/m."""
        tilt = self.road.superelevation.at(station, inside)
        return np.asarray(np.tan(tilt) / self._cosine(station, inside))

    def centre(self, station: Float, inside: Float) -> Edge:
        """Return the centre lane's line at stations (N,)."""
        return self._place(self._frame(station, inside), self.road.offset.at(station, inside), 0.0)

    def lanes(self, section: FileSection, station: Float, inside: Float) -> dict[int, list[LaneEdges]]:
        """Return a section's lanes by the sign of their ids, from the inside out, at stations (N,)."""
        borders = section.borders(station, inside, self.road.offset.at(station, inside))
        frame = self._frame(station, inside)
        lane_edges: dict[int, list[LaneEdges]] = {}
        for sign, lanes in section.lanes.items():
            lane_edges[sign] = []
            flat_from: Edge | None = None
            for lane, inner, outer in zip(lanes, borders[sign][:-1], borders[sign][1:], strict=True):
                low, high = _lane_heights(lane, station)
                edges = [self._place(frame, inner, low), self._place(frame, outer, high)]
                if lane.level and flat_from is None:
                    flat_from = edges[0]
                if flat_from is not None:  # level from the inner border on, as the standard's figures show
                    beyond = flat_from
                    edges = [
                        Edge(edge.offset, beyond.height + rise) for edge, rise in zip(edges, (low, high), strict=True)
                    ]
                lane_edges[sign].append(LaneEdges(lane, *edges))
        return lane_edges

    def profile_points(self, edges: LaneEdges, share: float, station: Float, inside: Float) -> Edge:
        """Return points at a share of a lane's width, on its true surface where that is no straight line."""
        offset = edges.inner.offset + share * (edges.outer.offset - edges.inner.offset)
        height = edges.inner.height + share * (edges.outer.height - edges.inner.height)
        if not self.road.shapes or edges.lane.level:
            return Edge(offset, height)
        tilt = np.cos(self.road.superelevation.at(station, inside))
        inner, outer = edges.inner.offset / tilt, edges.outer.offset / tilt
        t = inner + share * (outer - inner)
        bow = (
            self._shape(station, t) - (1.0 - share) * self._shape(station, inner) - share * self._shape(station, outer)
        )
        return Edge(offset, height + bow)

    def _frame(self, station: Float, inside: Float) -> _Frame:
        tilt = self.road.superelevation.at(station, inside)
        falls = {sign: np.tan(cubics.at(station, inside)) for sign, cubics in self.road.crossfall.items() if cubics}
        return _Frame(station, np.cos(tilt), np.sin(tilt), self._cosine(station, inside), falls)

    def _place(self, frame: _Frame, t: Float, height: Float | float) -> Edge:
        """Return where points of t (N,) lie that are so high (m) above the surface, normal to its plane."""
        above = height + self._shape(frame.station, t)
        for sign, fall in frame.falls.items():
            above = above - np.where(t * sign > 0.0, fall * np.abs(t), 0.0)
        offset = t * frame.cos - above * frame.sin
        return Edge(offset, (t * frame.sin + above * frame.cos) / frame.climb)

    def _cosine(self, station: Float, inside: Float) -> Float:
        grade = self.road.elevation.at(station, inside, slope=True)
        return np.asarray(1.0 / np.sqrt(1.0 + grade**2))

    def _shape(self, station: Float, t: Float) -> Float:
        shapes = self.road.shapes
        if not shapes:
            return np.zeros(np.shape(t))
        at = np.array([shape.station for shape in shapes])
        after = np.searchsorted(at, station, side="right")
        first, last = np.clip(after - 1, 0, len(at) - 1), np.clip(after, 0, len(at) - 1)
        span = np.where(last > first, at[last] - at[first], 1.0)
        share = np.clip((station - at[first]) / span, 0.0, 1.0)
        values = np.stack([_profile(shape, t) for shape in shapes])
        columns = np.arange(len(t))
        return np.asarray(values[first, columns] * (1.0 - share) + values[last, columns] * share)


def _profile(shape: ShapeProfile, t: Float) -> Float:
    return shape.cubics.at(t)


def _lane_heights(lane: FileLane, station: Float) -> tuple[Float, Float]:
    """Return the heights (N,) of a lane's inner and outer border above the surface, m: linear between records."""
    if not len(lane.heights):
        return np.zeros(station.shape), np.zeros(station.shape)
    at, inner, outer = lane.heights.T
    return np.interp(station, at, inner), np.interp(station, at, outer)
