"""The line that a lane's traffic follows: its centre in plan, the surface below it, and how a vehicle stands on it."""

from functools import cached_property

import numpy as np

from ..base.arrays import Float, Index
from .alignment import clip_offset, running_sum
from .damage import damage_depth
from .geometry import RoadGeometry
from .objects import width_at, width_kinks
from .section import Carriageway
from .section_geometry import CarriagewaySection
from .things.vehicles import VEHICLE_LANE_WIDTH, Chassis

_PANEL = 5.0
"""Longest piece (m) over which the distance driven is integrated at once."""
_GAUSS = np.polynomial.legendre.leggauss(5)


class LaneLine:
    """The centre line of a lane, which vehicles follow, in plan and in height, ruts included.

    Distances are measured in plan along the lane's own line, from the road's beginning, and grow with the station.
    Potholes aren't part of the surface here: a tyre at speed leaves them before the body follows.

    Attributes:
        geometry, carriageway, lane: what it belongs to; lanes count from outside.
        main: the main road: the same, or the one whose network the lane's road belongs to.
    """

    def __init__(self, geometry: RoadGeometry, carriageway: Carriageway, lane: int) -> None:
        self.geometry = self.main = geometry
        self.carriageway = carriageway
        self.lane = lane
        pavement = carriageway.pavement.model_copy(update={"potholes": ()})
        self._section = CarriagewaySection(carriageway.model_copy(update={"pavement": pavement}))
        widths_inside = [carriageway.inner_offset, carriageway.inner_edge_strip_width]
        self._width = carriageway.lanes[lane].width
        self._inner_widths = [*widths_inside, *(item.width for item in carriageway.lanes[lane + 1 :])]

    def main_station(self, station: Float) -> Float:
        """Return the stations (N,) of the main road, m, for those of the lane's own one: the same."""
        return station

    def offset(self, station: Float) -> Float:
        """Return the offset of the lane's centre at stations of any shape, m."""
        distance = sum((width_at(width, station) for width in self._inner_widths), width_at(self._width, station) / 2.0)
        return np.asarray(self.carriageway.sign * distance)

    def turn(self, station: Float, reach: float) -> Float:
        """Return the angle (N,) from the centreline's heading to the lane's, rad; it is 0 where no width changes.

        It is that of the chord between the lane's places ``reach`` (m) before and behind: a vehicle that passes a
        point from which on its lane widens turns as its axles pass it, and not at once.
        """
        lateral_shift = self.offset(station + reach) - self.offset(station - reach)
        curvature = self.geometry.alignment.curvature(station)
        chord_length = 2.0 * reach * (1.0 - curvature * clip_offset(self.offset(station), curvature))
        return np.arctan2(lateral_shift, chord_length)

    def height(self, station: Float, offset: Float) -> Float:
        """Return the surface's local elevation (N,), m, at stations and offsets (N,) on the carriageway's pavement.

        The pavement's plane goes on beyond its edges.
        """
        slope = self.carriageway.sign * self.geometry.crossfall(self.carriageway, station)
        distance_from_pivot = self.carriageway.sign * offset - self._section.pivot(station)
        height = self.geometry.profile.elevation(station) + slope * distance_from_pivot
        if self.carriageway.pavement.ruts:
            height -= damage_depth(self._section, station, offset)
        return np.asarray(height)

    def range_at(self, station: float) -> tuple[float, float]:
        """Return the (start, end) stations, m, of the stretch around a station on which the lane can be driven on.

        It ends where the lane becomes narrower than `VEHICLE_LANE_WIDTH`, or than it is at the station itself.
        """
        inner_kinks = {s for s in width_kinks(self._width) if 0.0 < s < self.geometry.length}
        kinks = np.array(sorted({0.0, self.geometry.length, *inner_kinks}))
        least_width = min(VEHICLE_LANE_WIDTH, float(width_at(self._width, station)))
        spare_width = width_at(self._width, kinks) - least_width + 1e-9
        crossing_intervals = np.flatnonzero(spare_width[:-1] * spare_width[1:] < 0.0)
        share = spare_width[crossing_intervals] / (
            spare_width[crossing_intervals] - spare_width[crossing_intervals + 1]
        )
        ends = kinks[crossing_intervals] + share * np.diff(kinks)[crossing_intervals]
        ends_before, ends_after = ends[ends <= station], ends[ends > station]
        return float(ends_before[-1]) if len(ends_before) else 0.0, float(ends_after[0]) if len(
            ends_after
        ) else self.geometry.length

    def distance(self, station: Float) -> Float:
        """Return the distances (N,) along the lane's line from the road's beginning at stations (N,), m."""
        knots, distances, _ = self._table
        panel = _panel(knots, station)
        begin = knots[panel]
        return np.asarray(distances[panel] + self._length(begin, station - begin))

    def station(self, distance: Float) -> Float:
        """Return the stations (N,) at distances (N,) along the lane's line, m: the inverse of `distance`.

        In each panel it is the cubic with the right ends and rates there, which is less than 1e-6 m off; beyond the
        road's ends the line goes on with the rate that it has there.
        """
        knots, distances, rates = self._table
        panel = _panel(distances, distance)
        length, step = np.diff(distances)[panel], np.diff(knots)[panel]
        u = (distance - distances[panel]) / length
        start_rate, end_rate = length / rates[0][panel], length / rates[1][panel]
        cubic = u * (
            start_rate + u * (3.0 * step - 2.0 * start_rate - end_rate + u * (start_rate + end_rate - 2.0 * step))
        )
        stations = knots[panel] + np.where(
            u < 0.0, u * start_rate, np.where(u > 1.0, step + (u - 1.0) * end_rate, cubic)
        )
        return np.asarray(stations)

    @cached_property
    def _table(self) -> tuple[Float, Float, tuple[Float, Float]]:
        """Return stations of the panels' borders (P + 1,), distances there, and metres per station at panels' ends."""
        road = self.geometry
        kinks = [s for width in (self._width, *self._inner_widths) for s in width_kinks(width)]
        panel_borders = np.clip(
            np.concatenate([road.alignment.element_starts, kinks, [0.0, road.length]]), 0.0, road.length
        )
        panel_borders = np.unique(panel_borders)
        panel_borders = panel_borders[np.append(True, np.diff(panel_borders) > 1e-6)]
        panel_borders[-1] = road.length
        count = np.maximum(1, np.ceil(np.diff(panel_borders) / _PANEL)).astype(int)
        border_interval = np.repeat(np.arange(len(count)), count)
        number_in_interval = np.arange(len(border_interval)) - np.repeat(np.cumsum(count) - count, count)
        knots = np.append(
            panel_borders[border_interval] + number_in_interval * (np.diff(panel_borders) / count)[border_interval],
            road.length,
        )
        step = np.diff(knots)
        distances = running_sum(self._length(knots[:-1], step).tolist())
        return knots, distances, (self._rate(knots[:-1], step, 0.0), self._rate(knots[:-1], step, 1.0))

    def _length(self, begin: Float, step: Float) -> Float:
        """Return the lengths (N,) of the lane's line, m, from stations over steps (N,) within one panel each.

        By Gauss-Legendre quadrature of `_rate` with 5 nodes.
        """
        shares, weights = (_GAUSS[0] + 1.0) / 2.0, _GAUSS[1] / 2.0
        rates = (weight * self._rate(begin, step, share) for share, weight in zip(shares, weights, strict=True))
        return np.asarray(step * sum(rates))

    def _rate(self, begin: Float, step: Float, share: float) -> Float:
        """Return the metres along the lane's line per metre of station (N,), at a share of each step.

        Within a panel curvature and offset are linear; both are read inside of it, as they may jump or bend at its
        ends.
        """
        first_quarter, third_quarter = begin + 0.25 * step, begin + 0.75 * step
        offsets, curvatures = (
            (self.offset(first_quarter), self.offset(third_quarter)),
            self.geometry.alignment.curvature(np.stack([first_quarter, third_quarter])),
        )
        share_between = 2.0 * share - 0.5
        curvature = curvatures[0] + share_between * (curvatures[1] - curvatures[0])
        offset = offsets[0] + share_between * (offsets[1] - offsets[0])
        lateral_rate = (offsets[1] - offsets[0]) / np.where(step == 0.0, 1.0, 0.5 * step)
        return np.asarray(np.hypot(1.0 - curvature * clip_offset(offset, curvature), lateral_rate))


def _panel(borders: Float, value: Float) -> Index:
    """Return the index (N,) of the panel between borders (P + 1,) that values (N,) lie in, clipped to the ends."""
    return np.clip(np.searchsorted(borders, value, side="right") - 1, 0, len(borders) - 2)


def wheel_pose(line: LaneLine, chassis: Chassis, station: Float) -> tuple[Float, Float]:
    """Return rotations (K, 3, 3) and local places (K, 3), m, of a vehicle with its middle at stations (K,) of its lane.

    Its frame has its origin on the road below its middle, x forward, y left, z up. It stands on the road with its
    axles' wheels, so that grade and crossfall pitch and roll it.
    """
    alignment, traffic = line.geometry.alignment, line.carriageway.traffic
    position, axis, curvature = alignment.frame(station)
    offset = line.offset(station)
    middle_xy = np.stack([position[:, 0] - offset * np.sin(axis), position[:, 1] + offset * np.cos(axis)])
    turn = line.turn(station, chassis.wheel_base / 2.0)
    heading = axis + turn + (0.0 if traffic > 0 else np.pi)
    forward_xy = np.stack([np.cos(heading), np.sin(heading)])
    left_xy = np.stack([-forward_xy[1], forward_xy[0]])
    front, rear, track = chassis
    heights = {}
    stations_per_metre = traffic * np.cos(turn) / np.maximum(1.0 - curvature * offset, 0.02)
    for ahead_distance in (rear, front):
        for left_distance in (-track, track):
            wheel = middle_xy + ahead_distance * forward_xy + left_distance * left_xy
            heights[ahead_distance, left_distance] = _road_height(
                line, wheel.T, station + ahead_distance * stations_per_metre
            )
    rear_height, front_height = (
        0.5 * (heights[ahead_distance, -track] + heights[ahead_distance, track]) for ahead_distance in (rear, front)
    )
    grade = (front_height - rear_height) / (front - rear)
    roll = sum(heights[ahead_distance, track] - heights[ahead_distance, -track] for ahead_distance in (rear, front)) / (
        4.0 * track
    )
    forward = _unit(np.stack([*forward_xy, grade]))
    side = np.stack([*left_xy, roll])
    side = _unit(side - (side * forward).sum(axis=0) * forward)
    upward = np.cross(forward, side, axis=0)
    place = np.stack([*middle_xy, rear_height - grade * rear])
    return np.moveaxis(np.stack([forward, side, upward], axis=1), -1, 0), place.T


def _road_height(line: LaneLine, xy: Float, near_station: Float) -> Float:
    """Return the road's local elevation (K,), m, at plan points (K, 2) within 2 m of stations ``near_station`` (K,)."""
    return line.height(*line.geometry.alignment.project_near(xy, near_station, 2.0))


def _unit(vectors: Float) -> Float:
    """Return vectors (3, K) scaled to unit length."""
    return np.asarray(vectors / np.sqrt((vectors * vectors).sum(axis=0)))
