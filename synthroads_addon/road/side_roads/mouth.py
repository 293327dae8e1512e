"""The mouth of a side road, exactly: where its edges run and how high its pavement and verges lie.

It has two systems of coordinates. Along the main road count the station and the depth: the distance from the main
pavement's edge, outwards along the station's normal. Along the side road count u, from that edge along its axis, and v
across, positive towards higher stations. Where the depth is 0 heights and crossfalls are the main road's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...base.arrays import Bool, Float
from ..alignment import Alignment
from ..profile import Profile
from ..section_geometry import CarriagewaySection
from .side_road import SideRoad

ARC_STEP = np.deg2rad(1.5)
"""Turn between two points of a corner: of a radius of 10 m the chord is 0.9 mm off."""
_TABLE_STEP = np.deg2rad(0.05)
_ROUNDS = 30
ALONG = 0.5
"""Spacing of points along the main road's edge, m: on a radius of 200 m the chord is 0.2 mm off."""
MARGIN = 30.0
"""Length of the main road to either side of the mouth whose ground belongs to it, m."""
FADE = 8.0
"""Length over which that ground comes back to the main road's, m."""
_BATTER = 8.0
"""Length beside a corner where points lie closer, as its batter is there, m."""
_FAR = 250.0
"""How far edges are followed, m."""
LOW, HIGH = -1.0, 1.0
"""The sides of a side road, towards lower and higher stations: the signs of v."""


@dataclass(frozen=True)
class Corner:
    """One rounded corner of a mouth.

    Attributes:
        sign: `LOW` or `HIGH`.
        radius: m.
        centre: (2,) of its arc, local, m.
        start_angle, sweep: direction (rad) from the centre to where the arc leaves the main road's edge, and its turn
            from there to the side road's edge.
        start_station: where it leaves the main road's edge, m.
        end_u: u at which it meets the side road's edge, m.
    """

    sign: float
    radius: float
    centre: Float
    start_angle: float
    sweep: float
    start_station: float
    end_u: float

    def arc(self, share: Float, radius: float) -> Float:
        """Return points (N, 2) at shares (N,) of the turn, on the arc of a radius (m) about the same centre."""
        angle = self.start_angle + share * self.sweep
        return self.centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def share_of(self, points: Float) -> Float:
        """Return the shares (N,) of the turn in whose directions points (N, 2) lie from the centre, 0 to 1."""
        vector = points - self.centre
        turn = np.arctan2(vector[:, 1], vector[:, 0]) - self.start_angle
        # Beyond either end of the arc the nearer end holds.
        middle = self.sweep / 2.0
        turn = middle + np.angle(np.exp(1j * (turn - middle)))
        return np.clip(turn / self.sweep, 0.0, 1.0)


@dataclass(frozen=True)
class EdgePlace:
    """Where points lie against a side road's edge.

    Attributes:
        distance: (N,) outwards from the edge of its pavement, m; negative on the pavement.
        edge: (N, 2) nearest points of that edge, local, m.
    """

    distance: Float
    edge: Float


class Mouth:
    """A side road's mouth and first stretch at one carriageway.

    Attributes:
        side_road: what the set says of it.
        sign: 1 at the left carriageway, -1 at the right one.
        incoming: `LOW` or `HIGH`: the side of its axis on which those drive who come to the main road.
        station: of its axis at the main road's edge, m.
        verge_width: m; the main road's, around its corners and along it.
        low, high: its corners.
        start, end: stations between which the ground beside the main road is its own, m.
    """

    def __init__(
        self, side_road: SideRoad, alignment: Alignment, profile: Profile, section: CarriagewaySection
    ) -> None:
        self.side_road, self._alignment, self._profile, self.section = side_road, alignment, profile, section
        self.sign = float(section.carriageway.sign)
        self.incoming = float(section.carriageway.traffic)
        self.station = side_road.station
        at = np.array([self.station])
        edge = section.paved_edge(at)
        self.verge_width = float(section.road_edge(at)[0] - edge[0])
        self.origin = alignment.place(at, self.sign * edge)[0]
        heading = float(alignment.heading(at)[0]) + self.sign * np.deg2rad(side_road.angle_deg)
        self.ahead = np.array([np.cos(heading), np.sin(heading)])
        # Towards higher stations: to the right of its axis at the left carriageway, to the left of it at the right one.
        self.across = self.sign * np.array([np.sin(heading), -np.cos(heading)])
        self.low, self.high = self._corner(LOW), self._corner(HIGH)
        self.start, self.end = self.low.start_station - MARGIN, self.high.start_station + MARGIN

    # --- plan -------------------------------------------------------------------------------------------------------

    def local(self, points: Float) -> tuple[Float, Float]:
        """Return u and v (N,) of local points (N, 2), m."""
        vector = points - self.origin
        return vector @ self.ahead, vector @ self.across

    def place(self, u: Float, v: Float) -> Float:
        """Return local points (N, 2) at u and v (N,), m."""
        return self.origin + u[:, None] * self.ahead + v[:, None] * self.across

    def main_coordinates(self, points: Float) -> tuple[Float, Float]:
        """Return station and depth (N,) of local points (N, 2), m."""
        station, offset = self._alignment.project_near(points, np.full(len(points), self.station), _FAR)
        return station, self.sign * offset - self.section.paved_edge(station)

    def plan(self, station: Float, depth: Float) -> Float:
        """Return local points (N, 2) at stations and depths (N,), m."""
        return self._alignment.place(station, self.offset(station, depth))

    def offset(self, station: Float, depth: Float) -> Float:
        """Return the offsets (N,) of depths (N,) at stations (N,), m."""
        return self.sign * (self.section.paved_edge(station) + depth)

    def depth(self, station: Float, offset: Float) -> Float:
        """Return the depths (N,) of offsets (N,) at stations (N,), m."""
        return self.sign * offset - self.section.paved_edge(station)

    def fade(self, station: Float) -> Float:
        """Return the share (N,) that it has of the ground at stations (N,): less towards both ends of its stretch."""
        inside = np.clip(np.minimum(station - self.start, self.end - station) / FADE, 0.0, 1.0)
        return inside**2 * (3.0 - 2.0 * inside)

    def end_share(self, depth: Float) -> Float:
        """Return the share (N,) that it has of the ground at depths (N,), m: less and less behind its end."""
        behind = np.clip((depth - self.reach) / FADE, 0.0, 1.0)
        return 1.0 - behind**2 * (3.0 - 2.0 * behind)

    def _corner(self, sign: float) -> Corner:
        """Return one corner: its centre is as far from the main road's edge as from the side road's."""
        road = self.side_road
        radius = road.near_radius if sign == LOW else road.far_radius
        v = np.array([sign * (road.half_width + radius)])
        u, slope = np.array([radius]), np.sin(np.deg2rad(road.angle_deg))
        for _ in range(_ROUNDS):
            station, depth = self.main_coordinates(self.place(u, v))
            u = u + (radius - depth) / slope
        centre = self.place(u, v)[0]
        station, _ = self.main_coordinates(centre[None])
        start = self.plan(station, np.zeros(1))[0] - centre
        end = self.place(u, np.array([sign * road.half_width]))[0] - centre
        start_angle, end_angle = np.arctan2(start[1], start[0]), np.arctan2(end[1], end[0])
        sweep = float(np.angle(np.exp(1j * (end_angle - start_angle))))
        return Corner(sign, radius, centre, float(start_angle), sweep, float(station[0]), float(u[0]))

    def corner(self, sign: float) -> Corner:
        """Return the corner on a side, `LOW` or `HIGH`."""
        return self.low if sign == LOW else self.high

    def edge_point(self, sign: float, points: Float) -> EdgePlace:
        """Return where local points (N, 2) lie against the pavement's edge on a side, corner and straight."""
        corner, road = self.corner(sign), self.side_road
        u, v = self.local(points)
        is_straight = u >= corner.end_u
        share = corner.share_of(points)
        on_arc = corner.arc(share, corner.radius)
        on_line = self.place(u, np.full(len(u), sign * road.half_width))
        edge = np.where(is_straight[:, None], on_line, on_arc)
        beyond = np.linalg.norm(points - on_arc, axis=1)
        inwards = corner.radius - np.linalg.norm(points - corner.centre, axis=1)
        # Before its beginning on the main road's edge everything is beside the verge that begins there.
        verge_begin = corner.arc(np.zeros(1), corner.radius - self.verge_width)
        before = self.verge_width + np.linalg.norm(points - verge_begin, axis=1)
        away = np.where(share <= 0.0, before, np.where(inwards < 0.0, inwards, np.maximum(inwards, beyond)))
        return EdgePlace(np.where(is_straight, sign * v - road.half_width, away), edge)

    @cached_property
    def _tables(self) -> dict[float, tuple[Float, Float]]:
        """Depth and station (T,) along the pavement's edge of either side, finely; the depth increases."""
        return {sign: self._table(self.corner(sign)) for sign in (LOW, HIGH)}

    def _table(self, corner: Corner) -> tuple[Float, Float]:
        count = int(np.ceil(abs(corner.sweep) / _TABLE_STEP)) + 1
        arc = corner.arc(np.linspace(0.0, 1.0, count), corner.radius)
        u = np.arange(corner.end_u + 1.0, _FAR, 1.0)
        line = self.place(u, np.full(len(u), corner.sign * self.side_road.half_width))
        station, depth = self.main_coordinates(np.concatenate([arc, line]))
        depth[0], station[0] = 0.0, corner.start_station
        rising = np.concatenate([[True], np.diff(np.maximum.accumulate(depth)) > 0.0])
        return depth[rising], station[rising]

    def edge_station(self, sign: float, depth: Float) -> Float:
        """Return the stations (N,) of the pavement's edge on a side at depths (N,), m."""
        depths, stations = self._tables[sign]
        return np.interp(depth, depths, stations)

    def axis_station(self, depth: Float) -> Float:
        """Return the stations (N,) of the side road's axis at depths (N,), m."""
        u = depth / np.sin(np.deg2rad(self.side_road.angle_deg))
        station, reached = self.main_coordinates(self.place(u, np.zeros(len(u))))
        for _ in range(_ROUNDS - 1):
            u = u + (depth - reached)
            station, reached = self.main_coordinates(self.place(u, np.zeros(len(u))))
        return station

    def contains(self, station: Float, depth: Float) -> Bool:
        """Return whether places (N,) lie on its pavement, whose length is that of the axis, or on its verges."""
        points = self.plan(station, np.maximum(depth, 0.0))
        outwards = [self.edge_point(sign, points).distance for sign in (LOW, HIGH)]
        beside = np.maximum(*outwards)
        return (depth >= 0.0) & (depth <= self.reach) & (beside <= self.verge_width) & self.is_near(station)

    def is_beside(self, station: Float, offset: Float, clearing: float) -> Bool:
        """Return whether places (N,) lie on it or nearer than a distance (m) to its verges, or behind its mouth."""
        result = np.zeros(station.shape, dtype=bool)
        near = np.flatnonzero(self.is_near(station) & (self.sign * offset > 0.0))
        if len(near):
            depth = np.maximum(self.depth(station[near], offset[near]), 0.0)
            points = self.plan(station[near], depth)
            beside = np.maximum(*(self.edge_point(sign, points).distance for sign in (LOW, HIGH)))
            result[near] = (beside < self.verge_width + clearing) & (depth <= self.reach + clearing)
        return result

    def is_paved(self, station: Float, depth: Float) -> Bool:
        """Return whether places (N,) lie on its pavement."""
        points = self.plan(station, np.maximum(depth, 0.0))
        outwards = [self.edge_point(sign, points).distance for sign in (LOW, HIGH)]
        return (depth >= 0.0) & (depth <= self.reach) & (np.maximum(*outwards) <= 0.0) & self.is_near(station)

    def is_near(self, station: Float) -> Bool:
        """Return whether stations (N,) lie where the ground is the mouth's."""
        return (station >= self.start) & (station <= self.end)

    @property
    def reach(self) -> float:
        """Return the depth at which its pavement ends, m."""
        return self.side_road.length * float(np.sin(np.deg2rad(self.side_road.angle_deg)))

    # --- heights ----------------------------------------------------------------------------------------------------

    def main_plane(self, station: Float, depth: Float) -> Float:
        """Return the heights (N,) of the main road's plane, carried on beyond its edge, m."""
        section = self.section
        slope = section.carriageway.sign * self._crossfall(station)
        pivot = section.pivot(station)
        return self._profile.elevation(station) + slope * (section.paved_edge(station) + depth - pivot)

    def _crossfall(self, station: Float) -> Float:
        stations, percent = zip(
            *((p.station, p.crossfall_percent) for p in self.section.carriageway.crossfall), strict=True
        )
        return np.interp(station, stations, percent) / 100.0

    @cached_property
    def _begin(self) -> tuple[float, float]:
        """Height (m) of the axis at the main road's edge, and its slope (m/m) in the main road's plane there."""
        step = 1e-3
        u = np.array([0.0, step])
        station, depth = self.main_coordinates(self.place(u, np.zeros(2)))
        first, second = self.main_plane(station, depth).tolist()
        return first, (second - first) / step

    def own_surface(self, u: Float, v: Float) -> Float:
        """Return the heights (N,) of the side road's own surface at u and v (N,), m: its grade and crossfall."""
        road, (height, slope) = self.side_road, self._begin
        grade, length = road.grade_percent / 100.0, road.blend_length
        curved = np.clip(u, 0.0, length)
        along = height + slope * curved + (grade - slope) * curved**2 / (2.0 * length) + grade * (u - curved)
        fall = road.crossfall_percent / 100.0
        return along - fall * (np.abs(v) if road.lanes > 1 else v)

    def pavement_height(self, station: Float, depth: Float) -> Float:
        """Return the local elevations (N,) of its pavement at stations and depths (N,), m."""
        u, v = self.local(self.plan(station, depth))
        share = np.clip(depth / self.side_road.blend_length, 0.0, 1.0)
        weight = share**2 * (3.0 - 2.0 * share)
        return (1.0 - weight) * self.main_plane(station, depth) + weight * self.own_surface(u, v)

    def verge_height(self, sign: float, points: Float) -> tuple[Float, Float]:
        """Return the local elevations (N,) of its verge's outer edge beside local points (N, 2), and their distance.

        The distance (m) counts from that edge outwards; it is negative on the verge.
        """
        place = self.edge_point(sign, points)
        station, depth = self.main_coordinates(place.edge)
        height = self.pavement_height(station, np.maximum(depth, 0.0))
        fall = self.section.carriageway.verge_slope_percent / 100.0
        return height - fall * self.verge_width, place.distance - self.verge_width

    def height_at(self, station: Float, offset: Float) -> Float:
        """Return `height` (N,) at stations and offsets (N,), m; NaN elsewhere."""
        result = np.full(station.shape, np.nan)
        near = np.flatnonzero(self.is_near(station) & (self.sign * offset > 0.0))
        if len(near):
            result[near] = self.height(station[near], self.depth(station[near], offset[near]))
        return result

    def height(self, station: Float, depth: Float) -> Float:
        """Return the local elevations (N,) of pavement and verges at stations and depths (N,), m; NaN elsewhere."""
        result = np.full(station.shape, np.nan)
        there = np.flatnonzero(self.contains(station, depth))
        if len(there):
            result[there] = self.continued_height(station[there], depth[there])
        return result

    def continued_height(self, station: Float, depth: Float) -> Float:
        """Return `height` (N,) of places between the verges' outer edges, also behind the pavement's end, m."""
        points = self.plan(station, depth)
        height = self.pavement_height(station, depth)
        fall = self.section.carriageway.verge_slope_percent / 100.0
        for sign in (LOW, HIGH):
            place = self.edge_point(sign, points)
            beside = np.flatnonzero(place.distance > 0.0)
            if len(beside):
                edge_station, edge_depth = self.main_coordinates(place.edge[beside])
                edge_height = self.pavement_height(edge_station, np.maximum(edge_depth, 0.0))
                height[beside] = edge_height - fall * place.distance[beside]
        return height

    # --- where it needs points --------------------------------------------------------------------------------------

    @cached_property
    def stations(self) -> Float:
        """Stations (K,) of the main road's edge at which mouth and ground have points, m."""
        low, high = self.low.start_station, self.high.start_station
        marks = [self.start, low - _BATTER, low, self.station, high, high + _BATTER, self.end]
        pieces = []
        for begin, end in pairwise(marks):
            spacing = ALONG / 2.0 if end - begin <= _BATTER + 1e-9 and (end == low or begin == high) else ALONG
            count = max(2, int(np.ceil((end - begin) / spacing - 1e-9)) + 1)
            pieces.append(np.linspace(begin, end, count)[:-1])
        return np.append(np.concatenate(pieces), self.end)
