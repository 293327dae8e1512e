"""`MeasuredAxis`: a line along a road by running length, with the gaps that a measured one has."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from synthroads_addon.base.arrays import Bool, Float, Index
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.centerline import read_axis
from synthroads_addon.road.geometry import RoadGeometry

GAP = 3.5
"""Neighbouring points of a measured axis (one about every metre) that lie farther apart leave a gap between them, m."""
_SAMPLE = 0.25
"""Distance of the samples among which a point's nearest stretch of the line is looked for, m."""
_PAIRS = 4_000_000
"""Pairs of frame and segment that are tried at once."""


class MeasuredAxis:
    """A 3D polyline with gaps, parametrised by station: running length in plan, m, counted across gaps as well.

    Attributes:
        points: (N, 3) float64 vertices, m.
        joined: (N - 1,) bool, whether the line runs from a vertex to the next one; False: a gap.
        station: (N,) float64 running length in plan, m, strictly increasing from 0.
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
        keep = np.concatenate([[True], lengths > 1e-9])
        self.points = vertices[keep]
        self.joined = links[keep[1:]]
        self.station = np.concatenate([[0.0], np.cumsum(lengths[keep[1:]])])
        if len(self.points) < 2:
            raise InputError("axis", len(self.points), "must have at least two distinct points")

    @classmethod
    def read(cls, path: Path, gap: float | None = None) -> MeasuredAxis:
        """Read an axis from CSV (a header that names x, y and perhaps z; one point about every metre) or GeoJSON.

        Args:
            path: the file; its columns other than x, y and z aren't used.
            gap: points farther apart than this (m) aren't joined; None: `GAP` for CSV, none for GeoJSON.

        Raises:
            MissingFileError, InputError: see `read_axis`.
        """
        points = read_axis(path)
        if gap is None:
            gap = np.inf if path.suffix.lower() in (".geojson", ".json") else GAP
        return cls(points, np.hypot(*np.diff(points[:, :2], axis=0).T) <= gap)

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

    def translate(self, by: ArrayLike) -> MeasuredAxis:
        """Return the line moved by a vector (3,), m."""
        return MeasuredAxis(self.points + np.asarray(by, dtype=np.float64), self.joined)

    @cached_property
    def parts(self) -> Float:
        """First and last station (K, 2), m, of every stretch without a gap; lone vertices between gaps are left out."""
        ends = np.flatnonzero(~self.joined)
        first, last = np.concatenate([[0], ends + 1]), np.concatenate([ends, [len(self.points) - 1]])
        long = last > first
        return np.column_stack([self.station[first[long]], self.station[last[long]]])

    def stations(self, spacing: float = 1.0) -> Float:
        """Return the stations (K,), m, that are multiples of `spacing` (m) and lie in no gap."""
        every = spacing * np.arange(int(np.floor(self.length / spacing)) + 1)
        return every[self.inside(every)]

    def inside(self, station: ArrayLike) -> Bool:
        """Return whether there is a line at the stations (M,): not in a gap, nor beyond the ends."""
        at = np.asarray(station, dtype=np.float64)
        # A vertex at a gap's edge belongs to the line.
        after = self.joined[np.clip(np.searchsorted(self.station, at, "right") - 1, 0, len(self.joined) - 1)]
        before = self.joined[np.clip(np.searchsorted(self.station, at, "left") - 1, 0, len(self.joined) - 1)]
        return (after | before) & (at >= 0.0) & (at <= self.length)

    def position(self, station: ArrayLike) -> Float:
        """Return the points (M, 2) in plan at stations (M,), m; NaN in gaps and beyond the ends."""
        at = np.asarray(station, dtype=np.float64)
        found = np.column_stack([np.interp(at, self.station, self.points[:, column]) for column in (0, 1)])
        found[~self.inside(at)] = np.nan
        return found

    def elevation(self, station: ArrayLike) -> Float:
        """Return the line's elevations (M,) at stations (M,), m; NaN in gaps and beyond the ends."""
        at = np.asarray(station, dtype=np.float64)
        return np.where(self.inside(at), np.interp(at, self.station, self.points[:, 2]), np.nan)

    def direction(self, station: ArrayLike, reach: float = 2.0) -> Float:
        """Return the line's direction (M,), rad counter-clockwise from x; NaN in gaps and beyond the ends.

        It is that of the chord from ``reach`` before to ``reach`` behind, cut at gaps and ends, so that measured points
        that jump by centimetres don't turn it.
        """
        at = np.asarray(station, dtype=np.float64)
        low, high = self._part_around(at)
        back, ahead = np.maximum(at - reach, low), np.minimum(at + reach, high)
        # At an end the chord is one-sided, and on a curve would be turned: take it as short as the nearer end allows.
        even = np.minimum(at - back, ahead - at)
        even = np.where(even > 0.25 * reach, even, np.nan)
        back, ahead = np.where(np.isnan(even), back, at - even), np.where(np.isnan(even), ahead, at + even)
        chord = self.position(ahead) - self.position(back)
        return np.where(self.inside(at), np.arctan2(chord[:, 1], chord[:, 0]), np.nan)

    def project(self, xy: ArrayLike) -> tuple[Float, Float]:
        """Return station and offset (left positive, m) of points (M, 2) or (M, 3): the foot on the nearest segment.

        Gaps are bridged by straight lines, and before and behind the ends the line goes on straight, so that every
        point has a station; `inside` says where it means something.
        """
        points = np.asarray(xy, dtype=np.float64)[:, :2]
        tree, owner = self._samples
        nearest = owner[tree.query(points)[1]]
        best = np.full(len(points), np.inf)
        station, offset = np.empty(len(points)), np.empty(len(points))
        for neighbour in (-1, 0, 1):
            segment = np.clip(nearest + neighbour, 0, len(self.joined) - 1)
            along, across, distance = self._foot(points, segment)
            better = distance < best
            best[better] = distance[better]
            station[better], offset[better] = along[better], across[better]
        return station, offset

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
        start, heading = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        y, station = np.full(len(start), np.nan), np.full(len(start), np.nan)
        rows = max(1, _PAIRS // len(self.points))
        for first in range(0, len(start), rows):
            some = slice(first, first + rows)
            y[some], station[some] = self._crossing(start[some], heading[some], reach)
        return y, station

    def _crossing(self, origin: Float, direction: Float, reach: float) -> tuple[Float, Float]:
        dx = self.points[None, :, 0] - origin[:, None, 0]
        dy = self.points[None, :, 1] - origin[:, None, 1]
        cos, sin = np.cos(direction)[:, None], np.sin(direction)[:, None]
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        row, at = np.nonzero(((x[:, :-1] > 0.0) != (x[:, 1:] > 0.0)) & self.joined)
        share = x[row, at] / (x[row, at] - x[row, at + 1])
        across = y[row, at] + share * (y[row, at + 1] - y[row, at])
        order = np.argsort(-np.abs(across), kind="stable")  # the nearest is written last
        order = order[np.abs(across[order]) <= reach]
        found, station = np.full(len(origin), np.nan), np.full(len(origin), np.nan)
        found[row[order]] = across[order]
        along = self.station[at] + share * (self.station[at + 1] - self.station[at])
        station[row[order]] = along[order]
        return found, station

    def _part_around(self, at: Float) -> tuple[Float, Float]:
        """Return the first and the last station of the gapless stretch that each station lies on, m."""
        if not len(self.parts):
            return at, at
        index = np.clip(np.searchsorted(self.parts[:, 0], at, "right") - 1, 0, len(self.parts) - 1)
        return self.parts[index, 0], self.parts[index, 1]

    @cached_property
    def _samples(self) -> tuple[cKDTree, Index]:
        """Return a k-d tree of samples along the line (gaps too) and the segment that each lies on, cached."""
        counts = np.maximum(1, np.ceil(np.diff(self.station) / _SAMPLE).astype(int))
        owner = np.repeat(np.arange(len(counts)), counts)
        share = (np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[owner]
        start, end = self.points[owner, :2], self.points[owner + 1, :2]
        return cKDTree(start + share[:, None] * (end - start)), owner

    def _foot(self, points: Float, segment: Index) -> tuple[Float, Float, Float]:
        """Return station, signed offset and distance (m) of points (M, 2) from one segment each; the ends go on."""
        start = self.points[segment, :2]
        length = self.station[segment + 1] - self.station[segment]
        unit = (self.points[segment + 1, :2] - start) / length[:, None]
        delta = points - start
        along = np.einsum("ij,ij->i", unit, delta)
        across = unit[:, 0] * delta[:, 1] - unit[:, 1] * delta[:, 0]
        low = np.where(segment == 0, -np.inf, 0.0)
        high = np.where(segment == len(self.joined) - 1, np.inf, length)
        foot = np.clip(along, low, high)
        distance = np.hypot(along - foot, across)
        # Outside a bend the foot of many points is the corner: their offset is the distance, not that from the chord.
        return self.station[segment] + foot, np.copysign(distance, across), distance
