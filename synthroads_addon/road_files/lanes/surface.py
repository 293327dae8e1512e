"""The surface of an OpenDRIVE road: offsets and heights of the borders of its lanes, by station.

ASAM OpenDRIVE 1.8.1, 10.5: t lies in the plane that the superelevation turns about the reference line, at right angles
to the line as it climbs; shape, crossfall and heights of lanes come on top, normal to that plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from .records import FileLane, FileRoad, FileSection, ShapeProfile

_DRIVEN = "driving"
"""Type of the lanes that vehicles drive on."""
_TILTED = 1e-4
"""Height (m) between a lane's borders from which it is tilted against the road's plane."""


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
    """The plane of the superelevation at stations (N,), m.

    Attributes:
        cos, sin: of its tilt about the reference line.
        climb: cosine of the slope angle of the line.
        falls: by sign of the side, tangent of the crossfall that comes on top; sides without any are missing.
    """

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

    @property
    def has_tilted_lanes(self) -> bool:
        """Return whether any lane that is driven on has heights of its own that differ across it: a roof's."""
        lanes = (lane for section in self.road.sections for side in section.lanes.values() for lane in side)
        return any(
            lane.type == _DRIVEN and len(lane.heights) and np.ptp(lane.heights[:, 1:], axis=1).max() > _TILTED
            for lane in lanes
        )

    def section_at(self, station: float) -> FileSection:
        """Return the lane section at a station, m."""
        before = [section for section in self.road.sections if section.start <= station]
        return before[-1] if before else self.road.sections[0]

    def rise(self, station: Float, record_station: Float) -> Float:
        """Return the rise (N,) to the left, m/m in plan, of the superelevation's plane at stations (N,)."""
        tilt = self.road.superelevation.at(station, record_station)
        return np.asarray(np.tan(tilt) / self._cosine(station, record_station))

    def centre(self, station: Float, record_station: Float) -> Edge:
        """Return the centre lane's line at stations (N,)."""
        return self._place(self._frame(station, record_station), self.road.offset.at(station, record_station), 0.0)

    def lanes(self, section: FileSection, station: Float, record_station: Float) -> dict[int, list[LaneEdges]]:
        """Return a section's lanes with their edges at stations (N,), by the sign of their ids, from the inside out.

        `record_station` (N,) are stations that choose the cubics: an end of a stretch belongs to its own stretch.
        """
        borders = section.borders(station, record_station, self.road.offset.at(station, record_station))
        frame = self._frame(station, record_station)
        lane_edges: dict[int, list[LaneEdges]] = {}
        for sign, lanes in section.lanes.items():
            lane_edges[sign] = []
            level_height: Float | None = None  # of the innermost level lane's inner border
            for lane, inner_t, outer_t in zip(lanes, borders[sign][:-1], borders[sign][1:], strict=True):
                inner_rise, outer_rise = _lane_heights(lane, station)
                inner = self._place(frame, inner_t, inner_rise)
                outer = self._place(frame, outer_t, outer_rise)
                if lane.level and level_height is None:
                    level_height = inner.height
                # From the inner border of a level lane outwards all lanes are level, as the standard's figures show.
                if level_height is not None:
                    inner = Edge(inner.offset, level_height + inner_rise)
                    outer = Edge(outer.offset, level_height + outer_rise)
                lane_edges[sign].append(LaneEdges(lane, inner, outer))
        return lane_edges

    def profile_points(self, edges: LaneEdges, share: float, station: Float, record_station: Float) -> Edge:
        """Return points at a share of a lane's width, on its true surface where that is no straight line."""
        offset = edges.inner.offset + share * (edges.outer.offset - edges.inner.offset)
        height = edges.inner.height + share * (edges.outer.height - edges.inner.height)
        if not self.road.shapes or edges.lane.level:
            return Edge(offset, height)
        cosine = np.cos(self.road.superelevation.at(station, record_station))
        inner_t, outer_t = edges.inner.offset / cosine, edges.outer.offset / cosine
        t = inner_t + share * (outer_t - inner_t)
        # What the shape rises above its chord between the lane's borders.
        bulge = (
            self._shape(station, t)
            - (1.0 - share) * self._shape(station, inner_t)
            - share * self._shape(station, outer_t)
        )
        return Edge(offset, height + bulge)

    def _frame(self, station: Float, record_station: Float) -> _Frame:
        """Return the plane of the superelevation and the crossfall of both sides at stations (N,), m."""
        tilt = self.road.superelevation.at(station, record_station)
        falls = {
            sign: np.tan(cubics.at(station, record_station)) for sign, cubics in self.road.crossfall.items() if cubics
        }
        return _Frame(station, np.cos(tilt), np.sin(tilt), self._cosine(station, record_station), falls)

    def _place(self, frame: _Frame, t: Float, height: Float | float) -> Edge:
        """Return the edges at t (N,), m, that lie a height (m) above the surface, measured normal to the plane."""
        normal_height = height + self._shape(frame.station, t)
        for sign, fall in frame.falls.items():
            normal_height = normal_height - np.where(t * sign > 0.0, fall * np.abs(t), 0.0)
        # Turned about the line by the superelevation; heights are measured upright, not normal to the climbing line.
        offset = t * frame.cos - normal_height * frame.sin
        return Edge(offset, (t * frame.sin + normal_height * frame.cos) / frame.climb)

    def _cosine(self, station: Float, record_station: Float) -> Float:
        """Return the cosine (N,) of the line's slope angle."""
        grade = self.road.elevation.at(station, record_station, slope=True)
        return np.asarray(1.0 / np.sqrt(1.0 + grade**2))

    def _shape(self, station: Float, t: Float) -> Float:
        """Return the heights (N,), m, of the lateral shape at stations and t (N,), linear between its profiles."""
        shapes = self.road.shapes
        if not shapes:
            return np.zeros(np.shape(t))
        shape_stations = np.array([shape.station for shape in shapes])
        count_before = np.searchsorted(shape_stations, station, side="right")
        shape_before, shape_behind = (
            np.clip(count_before - 1, 0, len(shape_stations) - 1),
            np.clip(count_before, 0, len(shape_stations) - 1),
        )
        span = np.where(shape_behind > shape_before, shape_stations[shape_behind] - shape_stations[shape_before], 1.0)
        share = np.clip((station - shape_stations[shape_before]) / span, 0.0, 1.0)
        values = np.stack([_profile(shape, t) for shape in shapes])
        columns = np.arange(len(t))
        return np.asarray(values[shape_before, columns] * (1.0 - share) + values[shape_behind, columns] * share)


def _profile(shape: ShapeProfile, t: Float) -> Float:
    """Return the heights (N,), m, of one lateral profile at t (N,), m."""
    return shape.cubics.at(t)


def _lane_heights(lane: FileLane, station: Float) -> tuple[Float, Float]:
    """Return the heights (N,) of a lane's inner and outer border above the surface, m: linear between records."""
    if not len(lane.heights):
        return np.zeros(station.shape), np.zeros(station.shape)
    stations, inner_heights, outer_heights = lane.heights.T
    return np.interp(station, stations, inner_heights), np.interp(station, stations, outer_heights)
