"""When the vehicles of a lane are where: each drives through, leaves at the lane's end, and comes in again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Bool, Float
from ...road.things.vehicles import VEHICLE_GAP

OVERHANG = 0.25
"""A vehicle is there while no more of it than this (m) sticks out of its lane: in a curve its lane is shorter than the
centreline by which it was placed."""


@dataclass(frozen=True)
class VehiclePasses:
    """The way of one vehicle: once from where it is at the time 0, then from the lane's beginning again and again.

    Attributes:
        start: distance of its middle from the lane's beginning, in the direction of traffic, at the time 0, m.
        speed: m/s, > 0.
        whole: length of the lane, m.
        length: of the vehicle, m.
        entry: when its middle comes in for the first time, s; after it has left.
        period: s from one entry to the next, at least ``whole / speed``.
    """

    start: float
    speed: float
    whole: float
    length: float
    entry: float
    period: float

    @property
    def leave(self) -> float:
        """Return when its middle reaches the lane's end, s."""
        return max(0.0, (self.whole - self.start) / self.speed)

    def at(self, time: Float) -> tuple[Float, Bool]:
        """Return the distances (K,) of its middle, m, and whether (K,) it is there, at times (K,).

        Where it waits to come in again it is at the lane's end.
        """
        since = np.mod(time - self.entry, self.period)
        again = np.where(time < self.entry, self.whole, np.minimum(since * self.speed, self.whole))
        distance = np.where(time <= self.leave, self.start + self.speed * time, again)
        half = self.length / 2.0 - OVERHANG
        return distance, (distance >= half) & (distance <= self.whole - half)

    def from_elsewhere(self, start: float) -> VehiclePasses:
        """Return the same for a vehicle that is elsewhere at the time 0; it comes in as much later as it leaves."""
        moved = replace(self, start=start)
        return replace(moved, entry=self.entry + max(0.0, moved.leave - self.leave))


def lane_passes(
    start: Sequence[float], speed: Sequence[float], length: Sequence[float], whole: float
) -> list[VehiclePasses]:
    """Return the passes of all vehicles of one lane, in their order.

    They come in again in the order in which they leave, each as soon as it may: not before it has left, and so far
    behind the one before it that it keeps `VEHICLE_GAP` up to the lane's end, as nobody overtakes in a lane. The fast
    ones hence wait for the slow ones. All have one period, so that this holds for ever.

    Args:
        start: (N,) distances of their middles from the lane's beginning, in the direction of traffic, at time 0, m.
        speed: (N,) m/s, > 0.
        length: (N,) m.
        whole: length of the lane, m.
    """
    order = sorted(range(len(start)), key=lambda i: -start[i])
    leave = [max(0.0, (whole - x) / v) for x, v in zip(start, speed, strict=True)]

    def behind(ahead: int, entry: float, follower: int) -> float:
        """Return when the follower may come in behind one whose middle came in at ``entry``."""
        gap = (length[ahead] + length[follower]) / 2.0 + VEHICLE_GAP
        at_end = whole / speed[ahead] - (whole - gap) / speed[follower]
        return entry + max(gap / speed[ahead], at_end)

    entry = [0.0] * len(start)
    ahead, came_in = order[-1], -start[order[-1]] / speed[order[-1]]
    for number in order:
        entry[number] = came_in = max(leave[number], behind(ahead, came_in, number))
        ahead = number
    once = behind(order[-1], came_in, order[0]) - entry[order[0]]
    period = max(once, *(whole / v for v in speed))
    rows = zip(start, speed, length, entry, strict=True)
    return [VehiclePasses(x, v, whole, size, when, period) for x, v, size, when in rows]
