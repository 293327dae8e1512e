"""Motions in a scene: vehicles along their lanes, where each leaves and comes in again, other things straight on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Bool, Float, Int
from ...base.errors import InputError
from ...road.alignment import finite_array
from ...road.geometry import RoadGeometry
from ...road.instances import PassNumbers
from ...road.lane_lines import LaneLine, wheel_pose
from ...road.lanes import lane_of
from ...road.surroundings import Vehicle
from ...road.things.vehicles import CHASSIS, VEHICLE_GAP, VEHICLE_TYPES
from .mesh import SceneMesh

Pose = tuple[Float, Float, Bool]
OVERHANG = 0.25
"""A vehicle is there while no more of it than this (m) sticks out of its lane: in a curve its lane is shorter than the
centreline by which it was placed."""


class BodyMotion(Protocol):
    """Interface of a rigid body's motion: its pose, and whether it is there, at any time."""

    def pose(self, time: Float) -> Pose:
        """Return rotation (K, 3, 3), translation (K, 3) and whether (K,) the body is there, at times (K,), s.

        Both map the body frame to the local one: ``local = rotation @ body + translation``. Exact at any time,
        finite even where the body isn't there; the same from any thread.
        """

    def passes(self, time: Float) -> Int:
        """Return how many times (K,) the body has left and come in again before times (K,), s."""


@dataclass(frozen=True)
class MovingMesh:
    """A rigid body that moves: its mesh, its motion, and its instance numbers on later passes.

    Attributes:
        mesh: its triangles in the body frame; ``origin`` has no meaning there and is 0.
        motion: of the body frame.
        again: instance numbers of its triangles when it has come in again; as in the mesh if None.
    """

    mesh: SceneMesh
    motion: BodyMotion
    again: PassNumbers | None = None


@dataclass(frozen=True)
class ScannedScene:
    """Scene to be scanned: a static mesh and moving bodies, all with the same tuple of materials.

    Attributes:
        static: what stands, in the local frame.
        moving: what moves; at the time 0 it is where the scene shows it.
        unmatched: patterns of the class mapping that nothing in the scene matched, e.g. ``materials: Lack*``.
        warnings: what isn't scanned as the scene declares it, and what was assumed, as sentences.
    """

    static: SceneMesh
    moving: tuple[MovingMesh, ...] = ()
    unmatched: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


class LinearMotion:
    """Constant-velocity motion without rotation; the body frame keeps parallel to the local frame.

    Args:
        velocity: (3,) m/s.
        place: (3,) local place of the body frame's origin at the time 0, m.
    """

    def __init__(self, velocity: ArrayLike, place: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self.velocity = finite_array("velocity", velocity).reshape(3)
        self.place = finite_array("place", place).reshape(3)

    def pose(self, time: Float) -> Pose:
        """Return identity rotations (K, 3, 3), positions (K, 3), m, and presence (K,), all true, at times (K,), s."""
        time = np.asarray(time, dtype=np.float64)
        rotation = np.broadcast_to(np.eye(3), (len(time), 3, 3))
        return rotation, self.place + time[:, None] * self.velocity, np.ones(len(time), dtype=bool)

    def passes(self, time: Float) -> Int:
        """Return zeros (K,): the body never comes in again."""
        return np.zeros(len(time), dtype=np.int64)


@dataclass(frozen=True)
class ShiftedMotion:
    """A motion expressed in a local frame with another origin; see `BodyMotion`.

    Attributes:
        motion: in the road's local frame.
        origin: (3,) where the frame begins in the road's, m.
    """

    motion: BodyMotion
    origin: Float

    def pose(self, time: Float) -> Pose:
        """Return rotations (K, 3, 3), positions (K, 3) in this frame, m, and presence (K,), at times (K,), s."""
        rotation, place, present = self.motion.pose(time)
        return rotation, place - self.origin, present

    def passes(self, time: Float) -> Int:
        """Return how many times (K,) the body has left and come in again before times (K,), s."""
        return self.motion.passes(time)


class LaneMotion:
    """Motion of a vehicle along its lane at its speed, beginning anew where the lane ends.

    Its middle keeps to the lane's centre, at its speed along that line in plan. It looks along the line (where lanes
    widen or narrow, along the chord between its axles' places) and stands on the road with its axles' wheels, so that
    grade and crossfall pitch and roll it as the model's nodes do. At its lane's end, which is the road's or where the
    lane becomes too narrow to drive on, it leaves and comes in again where the lane begins: see `lane_passes`. While a
    part of it would stick out there it is not there at all.

    The body frame has its origin on the road below the vehicle's middle, x forward, y left, z up.

    Args:
        geometry: the road.
        vehicle: the vehicle; with a speed of 0 it stands.
        speed_factor: share of its speed that it drives at, >= 0.
        origin: (3,) the local frame's origin in the road's local coordinates; they are the same unless only a stretch
            of the road was built.
        line: of its lane, if there is one already.
        way: when it is where, at a factor of 1; as if it were alone in its lane, if None.
    """

    def __init__(
        self,
        geometry: RoadGeometry,
        vehicle: Vehicle,
        speed_factor: float = 1.0,
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        line: LaneLine | None = None,
        way: VehiclePasses | None = None,
    ) -> None:
        self.vehicle = vehicle
        self.line = line or lane_of(geometry, vehicle)
        self.speed_factor = checked_factor(speed_factor)
        self._alignment = self.line.geometry.alignment
        self._traffic = self.line.carriageway.traffic
        self._chassis = CHASSIS[vehicle.model]
        self._origin = finite_array("origin", origin)
        self._low, self._high = self.line.distance(np.array(self.line.range_at(vehicle.station))).tolist()
        self._way = way or (_passes_in_lane([vehicle], self.line)[0] if vehicle.speed > 0.0 else None)

    @property
    def stands(self) -> bool:
        """Return whether the vehicle stands still all the time."""
        return self._way is None or self.speed_factor == 0.0

    def station(self, time: Float) -> Float:
        """Return the main road's stations (K,), m, beside the vehicle's middle at times (K,), s."""
        return self.line.main_station(self._place(np.asarray(time, dtype=np.float64))[0])

    def pose(self, time: Float) -> Pose:
        """Return rotations (K, 3, 3), positions (K, 3), m, and presence (K,), of a vehicle at times (K,), s."""
        station, present = self._place(np.asarray(time, dtype=np.float64))
        rotation, place = wheel_pose(self.line, self._chassis, station)
        return rotation, place - self._origin, present

    def passes(self, time: Float) -> Int:
        """Return how many times (K,) the vehicle has left and come in again before times (K,), s."""
        if self._way is None or self.speed_factor == 0.0:
            return np.zeros(len(time), dtype=np.int64)
        return self._way.passes(np.asarray(time, dtype=np.float64) * self.speed_factor)

    def from_elsewhere(self, place: Float) -> LaneMotion:
        """Return the motion of the same vehicle if at time 0 it were beside a place (3,) of the local frame, m."""
        plan = (place + self._origin)[None, :2]
        station = float(np.clip(self._alignment.project(plan)[0][0], 0.0, self._alignment.length))
        vehicle = self.vehicle.model_copy(update={"station": station})
        motion = LaneMotion(self.line.geometry, vehicle, self.speed_factor, origin=self._origin, line=self.line)
        if self._way is not None and motion._way is not None and (motion._low, motion._high) == (self._low, self._high):
            motion._way = self._way.from_elsewhere(motion._way.start)
        return motion

    def _place(self, time: Float) -> tuple[Float, Bool]:
        """Return the vehicle's stations (K,), m, and whether (K,) it is on the road, at times (K,), s."""
        if self._way is None or self.speed_factor == 0.0:
            return np.full(time.shape, self.vehicle.station), np.ones(time.shape, dtype=bool)
        distance, present = self._way.at(time * self.speed_factor)
        station = self.line.station(self._low + distance if self._traffic > 0 else self._high - distance)
        # The way there and back through distances leaves a nanometre: at the time 0 it is where it was put.
        return np.where(time == 0.0, self.vehicle.station, station), present


def lane_motions(
    geometry: RoadGeometry, speed_factor: float = 1.0, origin: ArrayLike = (0.0, 0.0, 0.0)
) -> dict[str, LaneMotion]:
    """Return the motions of a road's vehicles by id; those that stand, because their speed is 0, are left out.

    Args:
        geometry: the road.
        speed_factor: share of their speeds that they drive at, >= 0; with 0 all stand.
        origin: see `LaneMotion`.

    Raises:
        InputError: the factor is negative or not a number.
    """
    if checked_factor(speed_factor) == 0.0:
        return {}
    lines: dict[tuple[str, int], LaneLine] = {}
    groups: dict[tuple[str, int, tuple[float, float]], dict[str, Vehicle]] = {}
    for name, vehicle in geometry.parameters.of_type(Vehicle).items():
        lane = (vehicle.carriageway, vehicle.lane)
        if lane not in lines:
            lines[lane] = lane_of(geometry, vehicle)
        if vehicle.speed > 0.0:
            groups.setdefault((*lane, lines[lane].range_at(vehicle.station)), {})[name] = vehicle
    motions: dict[str, LaneMotion] = {}
    for (road, number, _), vehicles in groups.items():
        line = lines[road, number]
        for (name, vehicle), way in zip(vehicles.items(), _passes_in_lane(list(vehicles.values()), line), strict=True):
            motions[name] = LaneMotion(geometry, vehicle, speed_factor, origin=origin, line=line, way=way)
    return motions


def checked_factor(speed_factor: float) -> float:
    """Return a factor of speeds as a float; raise `InputError` unless it is a finite number >= 0."""
    if not (np.isfinite(speed_factor) and speed_factor >= 0.0):
        raise InputError("speed_factor", speed_factor, "must be 0 or more")
    return float(speed_factor)


def _passes_in_lane(vehicles: list[Vehicle], line: LaneLine) -> list[VehiclePasses]:
    """Return the passes of vehicles that share one open range of a lane, in their order."""
    lane_begin, lane_end = line.distance(np.array(line.range_at(vehicles[0].station))).tolist()
    middle = line.distance(np.array([vehicle.station for vehicle in vehicles]))
    start = middle - lane_begin if line.carriageway.traffic > 0 else lane_end - middle
    lengths = [VEHICLE_TYPES[vehicle.model].length for vehicle in vehicles]
    return lane_passes(start.tolist(), [vehicle.speed for vehicle in vehicles], lengths, lane_end - lane_begin)


@dataclass(frozen=True)
class VehiclePasses:
    """Passes of one vehicle along its lane: from where it is at time 0, then again and again from the beginning.

    Attributes:
        start: distance of its middle from the lane's beginning, in the direction of traffic, at the time 0, m.
        speed: m/s, > 0.
        lane_length: m.
        length: of the vehicle, m.
        entry: when its middle comes in for the first time, s; after it has left.
        period: s from one entry to the next, at least ``lane_length / speed``.
    """

    start: float
    speed: float
    lane_length: float
    length: float
    entry: float
    period: float

    @property
    def leave(self) -> float:
        """Return the time, s, at which the vehicle's middle first reaches the lane's end."""
        return max(0.0, (self.lane_length - self.start) / self.speed)

    def at(self, time: Float) -> tuple[Float, Bool]:
        """Return the vehicle's distances (K,) along the lane, m, and whether (K,) it is there, at times (K,), s.

        While it waits to come in again its distance is that of the lane's end.
        """
        time_since_entry = np.mod(time - self.entry, self.period)
        distance_again = np.where(
            time < self.entry, self.lane_length, np.minimum(time_since_entry * self.speed, self.lane_length)
        )
        distance = np.where(time <= self.leave, self.start + self.speed * time, distance_again)
        inset = self.length / 2.0 - OVERHANG
        return distance, (distance >= inset) & (distance <= self.lane_length - inset)

    def passes(self, time: Float) -> Int:
        """Return the number (K,) of the pass that the vehicle is on at times (K,), s; 0 is that at time 0."""
        pass_number = 1 + np.floor_divide(time - self.entry, self.period)
        return np.where(time <= self.leave, 0, np.maximum(pass_number, 0)).astype(np.int64)

    def from_elsewhere(self, start: float) -> VehiclePasses:
        """Return the passes of the vehicle if it were at ``start`` (m) at time 0, delayed as its leaving is."""
        passes = replace(self, start=start)
        return replace(passes, entry=self.entry + max(0.0, passes.leave - self.leave))


def lane_passes(
    start: Sequence[float], speed: Sequence[float], length: Sequence[float], lane_length: float
) -> list[VehiclePasses]:
    """Return the passes of all vehicles of one lane, in their order, timed so that none overtakes another.

    They come in again in the order in which they leave, each as soon as it may: not before it has left, and so far
    behind the one before it that it keeps `VEHICLE_GAP` up to the lane's end, as nobody overtakes in a lane. The fast
    ones hence wait for the slow ones. All have one period, so that this holds for ever.

    Args:
        start: (N,) distances of their middles from the lane's beginning, in the direction of traffic, at time 0, m.
        speed: (N,) m/s, > 0.
        length: (N,) m.
        lane_length: length of the lane, m.
    """
    order = sorted(range(len(start)), key=lambda i: -start[i])  # the one that leaves first comes first
    leave_time = [max(0.0, (lane_length - x) / v) for x, v in zip(start, speed, strict=True)]

    def entry_behind(leader: int, leader_entry: float, follower: int) -> float:
        """Return the time, s, at which the follower may come in behind one whose middle came in at ``leader_entry``."""
        gap = (length[leader] + length[follower]) / 2.0 + VEHICLE_GAP
        # Of a faster follower the gap shrinks up to the lane's end, of a slower one it is least at the beginning.
        least_delay = lane_length / speed[leader] - (lane_length - gap) / speed[follower]
        return leader_entry + max(gap / speed[leader], least_delay)

    entry = [0.0] * len(start)
    # At time 0 the last one of the lane is on its way: its middle came in before that.
    leader, entry_time = order[-1], -start[order[-1]] / speed[order[-1]]
    for number in order:
        entry[number] = entry_time = max(leave_time[number], entry_behind(leader, entry_time, number))
        leader = number
    # The first one may come in for the second time behind the last one.
    period = entry_behind(order[-1], entry_time, order[0]) - entry[order[0]]
    period = max(period, *(lane_length / v for v in speed))
    rows = zip(start, speed, length, entry, strict=True)
    return [VehiclePasses(x, v, lane_length, size, entry_time, period) for x, v, size, entry_time in rows]
