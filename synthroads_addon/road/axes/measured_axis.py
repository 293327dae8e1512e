"""`MeasuredAxis`: a line along a road by running length, with the gaps that a measured one has.

All that is told by station and offset beside a polyline is told by it: training truth, scores, materials beside an
axis. Two lines have frames of their own: a road's `Alignment`, which is exact, and the path of a reconstruction, whose
heading turns from metre to metre and not at vertices.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Bool, Float, Index
from ...base.errors import InputError
from ...base.maps.places import Placement
from ...base.remarks import assume
from ..geometry import RoadGeometry
from .centerline import read_axis

GAP = 3.5
"""Neighbouring points of a measured axis that lie farther apart than so many times their usual distance, and than so
many metres, leave a gap between them."""
_EVEN_SHARE, _EVEN_FACTOR = 0.7, 2.0
"""An axis is one of evenly spaced points, which can have gaps, where this share of its steps is within this factor of
their median; else it is a drawn line with vertices where they are needed."""
_CELL = 8.0
"""Edge of the cells of points that share the segments among which each one's nearest is looked for, m."""
_RUN = 32
"""Segments that are looked at as one, by the circle around them, first."""
_PAIRS = 100_000
"""Pairs of point or frame and segment that are tried at once: their arrays stay in the cache."""


class MeasuredAxis:
    """A 3D polyline with gaps, parametrised by station: running length in plan, m, counted across gaps as well.

    Attributes:
        points: (N, 3) float64 vertices, m.
        joined: (N - 1,) bool, whether the line runs from a vertex to the next one; False: a gap.
        station: (N,) float64 running length in plan, m, strictly increasing from 0.

    Example:
        >>> import numpy as np
        >>> corner = np.array([[0.0, 0.0, 10.0], [30.0, 0.0, 10.0], [30.0, 40.0, 12.0]])
        >>> axis = MeasuredAxis(corner, np.ones(2, dtype=bool))
        >>> axis.length, axis.elevation(50.0).round(3).tolist()
        (70.0, 11.0)
    """

    def __init__(self, points: ArrayLike, joined: ArrayLike | None = None) -> None:
        vertices = np.asarray(points, dtype=np.float64)
        if vertices.ndim != 2 or vertices.shape[1] not in (2, 3) or not np.isfinite(vertices).all():
            raise InputError("axis", vertices.shape, "must be (N, 2) or (N, 3) finite coordinates")
        if vertices.shape[1] == 2:
            vertices = np.column_stack([vertices, np.zeros(len(vertices))])
        lengths = np.hypot(*np.diff(vertices[:, :2], axis=0).T)
        links = np.ones(len(lengths), dtype=bool) if joined is None else np.asarray(joined, dtype=bool)
        # A vertex that stands on the one before would have no direction.
        keep_mask = np.concatenate([[True], lengths > 1e-9])
        self.points = vertices[keep_mask]
        self.joined = links[keep_mask[1:]]
        self.station = np.concatenate([[0.0], np.cumsum(lengths[keep_mask[1:]])])
        if len(self.points) < 2:
            raise InputError("axis", len(self.points), "must have at least two distinct points")

    @classmethod
    def read(cls, path: Path, gap: float | None = None, place: Placement | None = None) -> MeasuredAxis:
        """Read an axis from CSV (a header that names x, y and perhaps z) or GeoJSON; tell the user of gaps.

        Args:
            path: the file; its columns other than x, y and z aren't used.
            gap: points farther apart than this (m) aren't joined; None: see `usual_gap` for the points of CSV; the
                line of GeoJSON has no gaps, since that is what a LineString is.
            place: the coordinate system that it is wanted in, see `read_axis`.

        Raises:
            MissingFileError, InputError: see `read_axis`.
        """
        points = read_axis(path, place)
        steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
        if gap is None:
            gap = np.inf if path.suffix.lower() in (".geojson", ".json") else usual_gap(steps)
        gap_mask = steps > gap
        if gap_mask.any():
            count, longest_step = np.count_nonzero(gap_mask), float(steps[gap_mask].max())
            steps_text = "1 step" if count == 1 else f"{count:,} steps"
            text = (
                f"{steps_text} of more than {gap:.3g} m between its points, {longest_step:.1f} m at most, count as gaps"
            )
            assume(f"{path.name}: {text}")
        return cls(points, ~gap_mask)

    @classmethod
    def of_road(cls, geometry: RoadGeometry, step: float = 0.5) -> MeasuredAxis:
        """Return the centreline of a road's exact geometry as a polyline in the road's local coordinates.

        Vertices lie ``step`` apart at most; chords of 0.5 m are 0.1 mm off a radius of 280 m.
        """
        stations = np.linspace(0.0, geometry.length, max(2, int(np.ceil(geometry.length / step)) + 1))
        return cls(np.column_stack([geometry.alignment.position(stations), geometry.profile.elevation(stations)]))

    @property
    def length(self) -> float:
        """Return the line's length in plan, gaps included, m."""
        return float(self.station[-1])

    def translate(self, vector: ArrayLike) -> MeasuredAxis:
        """Return the line moved by a vector (3,), m."""
        return MeasuredAxis(self.points + np.asarray(vector, dtype=np.float64), self.joined)

    @cached_property
    def parts(self) -> Float:
        """First and last station (K, 2), m, of every stretch without a gap; lone vertices between gaps are left out."""
        ends = np.flatnonzero(~self.joined)
        first_vertex, last_vertex = np.concatenate([[0], ends + 1]), np.concatenate([ends, [len(self.points) - 1]])
        has_length = last_vertex > first_vertex
        return np.column_stack([self.station[first_vertex[has_length]], self.station[last_vertex[has_length]]])

    def stations(self, spacing: float = 1.0) -> Float:
        """Return the stations (K,), m, that are multiples of `spacing` (m) and lie in no gap."""
        multiples = spacing * np.arange(int(np.floor(self.length / spacing)) + 1)
        return multiples[self.inside(multiples)]

    def inside(self, station: ArrayLike) -> Bool:
        """Return whether there is a line at the stations (M,): not in a gap, nor beyond the ends."""
        stations = np.asarray(station, dtype=np.float64)
        # A vertex at a gap's edge belongs to the line.
        is_joined_ahead = self.joined[
            np.clip(np.searchsorted(self.station, stations, "right") - 1, 0, len(self.joined) - 1)
        ]
        is_joined_behind = self.joined[
            np.clip(np.searchsorted(self.station, stations, "left") - 1, 0, len(self.joined) - 1)
        ]
        return (is_joined_ahead | is_joined_behind) & (stations >= 0.0) & (stations <= self.length)

    def position(self, station: ArrayLike) -> Float:
        """Return the points (M, 2) in plan at stations (M,), m; NaN in gaps and beyond the ends."""
        stations = np.asarray(station, dtype=np.float64)
        points = np.column_stack([np.interp(stations, self.station, self.points[:, column]) for column in (0, 1)])
        points[~self.inside(stations)] = np.nan
        return points

    def elevation(self, station: ArrayLike) -> Float:
        """Return the line's elevations (M,) at stations (M,), m; NaN in gaps and beyond the ends."""
        stations = np.asarray(station, dtype=np.float64)
        return np.where(self.inside(stations), np.interp(stations, self.station, self.points[:, 2]), np.nan)

    def direction(self, station: ArrayLike, reach: float = 2.0) -> Float:
        """Return the line's direction (M,), rad counter-clockwise from x; NaN in gaps and beyond the ends.

        It is that of the chord from ``reach`` before to ``reach`` behind, cut at gaps and ends, so that measured points
        that jump by centimetres don't turn it.
        """
        stations = np.asarray(station, dtype=np.float64)
        part_start, part_end = self._part_around(stations)
        chord_start, chord_end = np.maximum(stations - reach, part_start), np.minimum(stations + reach, part_end)
        # At an end the chord is one-sided, and on a curve would be turned: take it as short as the nearer end allows.
        symmetric_reach = np.minimum(stations - chord_start, chord_end - stations)
        symmetric_reach = np.where(symmetric_reach > 0.25 * reach, symmetric_reach, np.nan)
        chord_start, chord_end = (
            np.where(np.isnan(symmetric_reach), chord_start, stations - symmetric_reach),
            np.where(np.isnan(symmetric_reach), chord_end, stations + symmetric_reach),
        )
        chord = self.position(chord_end) - self.position(chord_start)
        return np.where(self.inside(stations), np.arctan2(chord[:, 1], chord[:, 0]), np.nan)

    def project(self, xy: ArrayLike) -> tuple[Float, Float]:
        """Return station and offset (left positive, m) of points (M, 2) or (M, 3): the foot on the nearest segment.

        Gaps are bridged by straight lines, and before and behind the ends the line goes on straight, so that every
        point has a station; `inside` says where it means something.
        """
        points = np.asarray(xy, dtype=np.float64)[:, :2]
        station, offset = np.empty(len(points)), np.empty(len(points))
        for rows, segments in self._candidates(points):
            for begin in range(0, len(rows), step := max(1, _PAIRS // len(segments))):
                block = rows[begin : begin + step]
                station[block], offset[block] = self._nearest_foot(points[block], segments)
        return station, offset

    def beside(self, xy: ArrayLike, reach: float, past: float = 0.0) -> tuple[Float, Float]:
        """Return station and offset (left positive, m) of points (M, 2) or (M, 3) beside the line; NaN elsewhere.

        Args:
            xy: the points.
            reach: points farther from the line than this, m, are beside none of it.
            past: points up to this, m, past an end or into a gap are beside it as well.
        """
        station, offset = self.project(xy)
        is_beside = (np.abs(offset) <= reach) & (self.distance_to_line(station) <= past)
        return np.where(is_beside, station, np.nan), np.where(is_beside, offset, np.nan)

    def distance_to_line(self, station: ArrayLike) -> Float:
        """Return how far along (M,), m, it is from stations (M,) to the nearest that isn't in a gap; 0 on the line."""
        stations = np.asarray(station, dtype=np.float64)
        if not len(self.parts):
            return np.full(stations.shape, np.inf)
        part_ahead = np.clip(np.searchsorted(self.parts[:, 0], stations, "right"), 0, len(self.parts) - 1)
        part_behind = np.maximum(part_ahead - 1, 0)
        gaps = [np.maximum(self.parts[i, 0] - stations, stations - self.parts[i, 1]) for i in (part_behind, part_ahead)]
        return np.maximum(np.minimum(*gaps), 0.0)

    def crossing(self, origin: ArrayLike, direction: ArrayLike, reach: float = 60.0) -> tuple[Float, Float]:
        """Return y (m) and station (m) where the y axis of each of M frames crosses the line; NaN where it doesn't.

        Args:
            origin: (M, 2) origins of the frames.
            direction: (M,) directions of their x axes, rad.
            reach: crossings farther than this from the origin don't count, m.

        Returns:
            y in the frame (M,), m, of the crossing nearest to the origin, and its station (M,); NaN where there is
            none, in gaps above all.
        """
        origins, headings = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        y, station = np.full(len(origins), np.nan), np.full(len(origins), np.nan)
        rows = max(1, _PAIRS // len(self.points))
        for begin in range(0, len(origins), rows):
            block = slice(begin, begin + rows)
            y[block], station[block] = self._crossing(origins[block], headings[block], reach)
        return y, station

    def _crossing(self, origin: Float, direction: Float, reach: float) -> tuple[Float, Float]:
        """Return y and station (M,) of the line's crossings with the y axes of a block of frames; see `crossing`.

        All vertices are brought into all frames at once, (M, N); a segment crosses where x changes its sign.
        """
        dx = self.points[None, :, 0] - origin[:, None, 0]
        dy = self.points[None, :, 1] - origin[:, None, 1]
        cos, sin = np.cos(direction)[:, None], np.sin(direction)[:, None]
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        row, segment = np.nonzero(((x[:, :-1] > 0.0) != (x[:, 1:] > 0.0)) & self.joined)
        share = x[row, segment] / (x[row, segment] - x[row, segment + 1])
        crossing_y = y[row, segment] + share * (y[row, segment + 1] - y[row, segment])
        order = np.argsort(-np.abs(crossing_y), kind="stable")  # the nearest is written last
        order = order[np.abs(crossing_y[order]) <= reach]
        offset, station = np.full(len(origin), np.nan), np.full(len(origin), np.nan)
        offset[row[order]] = crossing_y[order]
        crossing_station = self.station[segment] + share * (self.station[segment + 1] - self.station[segment])
        station[row[order]] = crossing_station[order]
        return offset, station

    def _part_around(self, stations: Float) -> tuple[Float, Float]:
        """Return the first and the last station of the gapless stretch that each station lies on, m."""
        if not len(self.parts):
            return stations, stations
        index = np.clip(np.searchsorted(self.parts[:, 0], stations, "right") - 1, 0, len(self.parts) - 1)
        return self.parts[index, 0], self.parts[index, 1]

    @cached_property
    def _segments(self) -> Float:
        """Return of each segment (6, N - 1) its begin and unit vector, and between which running lengths feet lie."""
        begin, length = self.points[:-1, :2], np.diff(self.station)
        unit = np.diff(self.points[:, :2], axis=0) / length[:, None]
        lower_limit, upper_limit = np.zeros(len(length)), length.copy()
        lower_limit[0], upper_limit[-1] = -np.inf, np.inf  # the ends go on
        return np.stack([*begin.T, *unit.T, lower_limit, upper_limit])

    @cached_property
    def _circles(self) -> tuple[Float, Float]:
        """Return centres (2, K) and radii (K,), m, of circles around each run of `_RUN` segments; cached."""
        starts = np.arange(0, len(self.joined), _RUN)
        runs = [self.points[start : start + _RUN + 1, :2] for start in starts]
        centres = np.array([run.mean(axis=0) for run in runs])
        radii = [np.hypot(*(run - centre).T).max() for run, centre in zip(runs, centres, strict=True)]
        return centres.T, np.array(radii)

    def _candidates(self, points: Float) -> Iterator[tuple[Index, Index]]:
        """Yield indices of points (M, 2) in one cell each, and those of all segments that can be nearest to them."""
        if not len(points):
            return
        cell = np.floor(points / _CELL).astype(np.int64)
        first_cell = cell.min(axis=0)
        key = (cell[:, 0] - first_cell[0]) * (cell[:, 1].max() - first_cell[1] + 1) + (cell[:, 1] - first_cell[1])
        order = np.argsort(key, kind="stable")
        starts = np.flatnonzero(np.diff(key[order], prepend=key[order[0]] - 1))
        (x, y), radii = self._circles
        last_segment, diagonal = len(self.joined) - 1, np.sqrt(2.0) * _CELL
        for rows in np.split(order, starts[1:]):
            cell_middle = (cell[rows[0]] + 0.5) * _CELL
            distances = np.hypot(x - cell_middle[0], y - cell_middle[1])
            # A point is at most half a diagonal from the middle: its nearest segment is at most a diagonal farther.
            runs = np.flatnonzero(distances - radii <= (distances + radii).min() + diagonal)
            segments = (runs[:, None] * _RUN + np.arange(_RUN)).ravel()
            segments = (
                np.r_[0, segments[(segments > 0) & (segments < last_segment)], last_segment]
                if last_segment
                else np.zeros(1, np.intp)
            )
            distance = np.sqrt(self._feet(cell_middle[None], segments)[2][0])
            yield rows, segments[distance <= distance.min() + diagonal]

    def _feet(self, points: Float, segments: Index) -> tuple[Float, Float, Float]:
        """Return how far along S segments the feet of P points (P, 2) are, offsets and squared distances (P, S)."""
        x, y, unit_x, unit_y, lower_limit, upper_limit = self._segments[:, segments]
        dx, dy = points[:, 0, None] - x, points[:, 1, None] - y
        along_segment, offset = unit_x * dx + unit_y * dy, unit_x * dy - unit_y * dx
        foot = np.clip(along_segment, lower_limit, upper_limit)
        return foot, offset, (along_segment - foot) ** 2 + offset**2

    def _nearest_foot(self, points: Float, segments: Index) -> tuple[Float, Float]:
        """Return station and offset (P,) of points (P, 2): of the foot on the nearest of some segments."""
        foot, offsets, squared_distances = self._feet(points, segments)
        nearest_segment = squared_distances.argmin(axis=1)
        row = np.arange(len(points))
        # Outside a bend the foot of many points is the corner: their offset is the distance, not that from the chord.
        offset = np.copysign(np.sqrt(squared_distances[row, nearest_segment]), offsets[row, nearest_segment])
        return self.station[segments[nearest_segment]] + foot[row, nearest_segment], offset


def usual_gap(steps: Float) -> float:
    """Return the distance (m) beyond which neighbouring points of an axis with these steps (N,), m, leave a gap.

    It is `GAP` times their median, and no less than `GAP` metres; infinite for lines whose points aren't evenly spaced.
    """
    positive_steps = steps[steps > 0.0]
    if not len(positive_steps):
        return np.inf
    median_step = float(np.median(positive_steps))
    is_usual = (positive_steps <= _EVEN_FACTOR * median_step) & (positive_steps * _EVEN_FACTOR >= median_step)
    return max(GAP, GAP * median_step) if is_usual.mean() >= _EVEN_SHARE else np.inf
