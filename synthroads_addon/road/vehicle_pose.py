"""How a vehicle stands on the road: on its axles' wheels, looking along its lane."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Float
from .lane_lines import LaneLine
from .things.vehicles import Chassis


def wheel_pose(line: LaneLine, chassis: Chassis, station: Float) -> tuple[Float, Float]:
    """Return rotations (K, 3, 3) and local places (K, 3) of a vehicle with its middle at stations (K,) of its lane.

    Its frame has its origin on the road below its middle, x forward, y left, z up. It stands on the road with its
    axles' wheels, so that grade and crossfall pitch and roll it.
    """
    alignment, traffic = line.geometry.alignment, line.carriageway.traffic
    position, axis, bend = alignment.frame(station)
    offset = line.offset(station)
    middle = np.stack([position[:, 0] - offset * np.sin(axis), position[:, 1] + offset * np.cos(axis)])
    turn = line.turn(station, chassis.wheel_base / 2.0)
    heading = axis + turn + (0.0 if traffic > 0 else np.pi)
    ahead = np.stack([np.cos(heading), np.sin(heading)])
    left = np.stack([-ahead[1], ahead[0]])
    front, rear, track = chassis
    heights = {}
    per_metre = traffic * np.cos(turn) / np.maximum(1.0 - bend * offset, 0.02)
    for along in (rear, front):
        for beside in (-track, track):
            wheel = middle + along * ahead + beside * left
            heights[along, beside] = _height(line, wheel.T, station + along * per_metre)
    behind, before = (0.5 * (heights[along, -track] + heights[along, track]) for along in (rear, front))
    rise = (before - behind) / (front - rear)
    roll = sum(heights[along, track] - heights[along, -track] for along in (rear, front)) / (4.0 * track)
    forward = _unit(np.stack([*ahead, rise]))
    side = np.stack([*left, roll])
    side = _unit(side - (side * forward).sum(axis=0) * forward)
    up = np.cross(forward, side, axis=0)
    place = np.stack([*middle, behind - rise * rear])
    return np.moveaxis(np.stack([forward, side, up], axis=1), -1, 0), place.T


def _height(line: LaneLine, plan: Float, near: Float) -> Float:
    """Return the road's height (K,) at places in plan (K, 2) whose stations are about those given."""
    return line.height(*line.geometry.alignment.project_near(plan, near, 2.0))


def _unit(vectors: Float) -> Float:
    """Return unit vectors; those are (3, K)."""
    return np.asarray(vectors / np.sqrt((vectors * vectors).sum(axis=0)))
