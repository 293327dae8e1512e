"""`Sweep`: the points of a stretch of time, seen from the scanner, with the boxes of the things around it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float, Float32, UInt8
from ...base.classes import ClassScheme
from ..points import PointBlock

LEAST_SEEN = (0.4, 0.6, 0.8)
"""Shares of a thing's visible side at which nuScenes' four levels of visibility change (its table ``visibility``)."""


@dataclass(frozen=True)
class Box:
    """An oriented box of a thing at the time of a sweep, in the map frame less the origin of the sweeps.

    Attributes:
        instance: number of the thing, as the points have it.
        class_id: as the points have it, before the class scheme is applied.
        name: id of the thing in the parameter set; empty without one.
        kind: model of a vehicle, such as ``car``; empty for anything else.
        centre: (3,) m.
        size: (3,) length, width and height along the box's own axes, m: of the whole mesh, hidden or not (amodal).
        rotation: (3, 3) from the box's axes (x forward, y left, z up) to the map's.
        velocity: (3,) of its centre, m/s.
        points: of the sweep that are of this thing.
        seen: share of the side that faces the scanner to which nothing blocks the line of sight, 0 to 1; None if
            nothing of it faces the scanner.
        seen_centre, seen_size: (3,) of the box about the points alone, with the same axes, m; None without points.
            Points of a thing that moves are taken where they were on it when they were measured.
    """

    instance: int
    class_id: int
    name: str
    kind: str
    centre: Float
    size: Float
    rotation: Float
    velocity: Float
    points: int
    seen: float | None
    seen_centre: Float | None = None
    seen_size: Float | None = None

    def corners(self) -> Float:
        """Return the box's corners (8, 3), m."""
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        return self.centre + (signs * self.size) @ self.rotation.T

    @property
    def visibility(self) -> int:
        """Return nuScenes' level of visibility: 1 below 40 % of the side that faces the scanner to 4 from 80 %."""
        return 1 + int(np.searchsorted(LEAST_SEEN, self.seen or 0.0, side="right"))


@dataclass(frozen=True)
class Sweep:
    """Points of a stretch of time of one strip, the scanner's pose in its middle, and the boxes then.

    The frame of a sweep has its origin at the scanner; z is up, and x is where the scanner travels to, in plan (where
    it looks to, if it stands). Points are where they were measured: of things that move they are as smeared as in a
    real sweep.

    Attributes:
        number: from 0, of all strips.
        strip: from 0.
        number_in_strip: from 0.
        begin, end: times, s since the scan's start.
        position: (3,) of the frame's origin in the map frame less the origin of the sweeps, m.
        rotation: (3, 3) from the frame of the sweep to the map's.
        points: in map coordinates.
        xyz: (N, 3) in the frame of the sweep, m.
        remission: (N,) intensity as a share of the brightest that 16 bits hold, 0 to 1.
        class_id: (N,) of the class scheme.
        boxes: of the things around.
    """

    number: int
    strip: int
    number_in_strip: int
    begin: float
    end: float
    position: Float
    rotation: Float
    points: PointBlock
    xyz: Float32
    remission: Float32
    class_id: UInt8
    boxes: tuple[Box, ...]

    @property
    def time(self) -> float:
        """Return the time of the pose and of the boxes, s since the scan's start: the middle of the sweep."""
        return (self.begin + self.end) / 2.0

    def in_frame(self, box: Box) -> tuple[Float, Float]:
        """Return centre (3,), m, and rotation (3, 3) of a box in the frame of the sweep."""
        return self.rotation.T @ (box.centre - self.position), self.rotation.T @ box.rotation


@dataclass(frozen=True)
class SweepPlace:
    """Properties that all sweeps of a scan have in common.

    Attributes:
        scheme: classes of the points' files.
        origin: (3,) map coordinates that the sweeps' map frame begins at, m.
        epsg: map coordinate system; None if unknown.
        title: for people.
        generator: program and version.
        name_of: function from instance numbers to ids in the parameter set, empty where there is none.
    """

    scheme: ClassScheme
    origin: Float
    epsg: int | None = None
    title: str = ""
    generator: str = ""
    name_of: Callable[[int], str] = lambda instance: ""


def quaternion(rotation: Float) -> Float:
    """Return the unit quaternion (4,) w, x, y, z of a rotation matrix (3, 3), w not negative."""
    m = np.asarray(rotation, dtype=np.float64)
    # The largest of the four is worked out by its root, the others by it: nothing is divided by a small number.
    squares = np.array(
        [
            1.0 + m[0, 0] + m[1, 1] + m[2, 2],
            1.0 + m[0, 0] - m[1, 1] - m[2, 2],
            1.0 - m[0, 0] + m[1, 1] - m[2, 2],
            1.0 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    products = np.array(
        [
            [squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], squares[1], m[1, 0] + m[0, 1], m[0, 2] + m[2, 0]],
            [m[0, 2] - m[2, 0], m[1, 0] + m[0, 1], squares[2], m[2, 1] + m[1, 2]],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2], squares[3]],
        ]
    )
    row = products[int(squares.argmax())]
    unit = row / np.linalg.norm(row)
    return np.asarray(unit if unit[0] >= 0.0 else -unit)


def upright(centre: Float, rotation: Float, size: Float) -> tuple[Float, Float, float]:
    """Return centre (3,), size (3,), m, and yaw, rad, of the smallest box that stands upright around an oriented one.

    Its yaw is that of the oriented box's x axis in plan. It is larger than the oriented one where that is tilted.
    """
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    half = np.abs(turn.T @ rotation) @ (np.asarray(size) / 2.0)
    return np.asarray(centre), 2.0 * half, yaw
