"""Sweeps of a car and a sign before a scanner that drives a bend, made without a scan."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from synthroads_addon.base.classes import class_id, class_scheme
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.cloud.sweeps.sweep import Box, Sweep, SweepPlace
from tests.helpers.clouds.random_points import make_points

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
CAR, SIGN = 70_001, 12
SIZES = {CAR: np.array([4.3, 1.8, 1.5]), SIGN: np.array([0.1, 0.9, 0.9])}
DURATION = 0.1


def place() -> SweepPlace:
    """Return what the sweeps have in common."""
    return SweepPlace(class_scheme("17"), ORIGIN, 25832, "a bend", "SynthRoads", lambda number: f"thing-{number}")


def sweeps(count: int = 4) -> list[Sweep]:
    """Return sweeps of 60 points each, of which 10 are of the car and 5 of the sign."""
    return [_sweep(number) for number in range(count)]


def _sweep(number: int) -> Sweep:
    yaw = 0.3 + 0.05 * number
    rotation = Rotation.from_euler("z", yaw).as_matrix()
    position = np.array([100.0 + 2.0 * number, 50.0 + 0.3 * number, 2.0])
    boxes = (
        _box(CAR, "vehicle", "car", [15.0 + number, 2.0, -1.2], 0.2, 0.03, rotation, position),
        _box(SIGN, "road_sign", "", [25.0 - 2.0 * number, -4.0, 1.0], 1.4, 0.0, rotation, position),
    )
    xyz, points = _points(number, boxes, rotation, position)
    remission = np.linspace(0.0, 1.0, len(xyz), dtype=np.float32)
    begin = number * DURATION
    return Sweep(
        number,
        0,
        number,
        begin,
        begin + DURATION,
        position,
        rotation,
        points,
        xyz,
        remission,
        points.class_id,
        boxes,
    )


def _box(instance, name, kind, at, yaw, pitch, rotation, position) -> Box:
    turn = rotation @ Rotation.from_euler("ZY", [yaw, pitch]).as_matrix()
    centre, size = position + rotation @ np.array(at), SIZES[instance]
    velocity = turn[:, 0] * (20.0 if instance == CAR else 0.0)
    points = 10 if instance == CAR else 5
    values = (centre, size, turn, velocity, points, 0.75, centre, size * 0.5)
    return Box(instance, class_id(name), f"thing-{instance}", kind, *values)


def _points(number, boxes, rotation, position) -> tuple[np.ndarray, PointBlock]:
    rng = np.random.default_rng(number)
    points = make_points(60, number)
    xyz = rng.uniform(-40.0, 40.0, (60, 3))
    instances = rng.integers(0, 9, 60).astype(np.uint32)
    classes = rng.integers(0, 17, 60).astype(np.uint8)
    rows = {CAR: slice(0, 10), SIGN: slice(10, 15)}
    for box in boxes:
        inside = rng.uniform(-0.49, 0.49, (box.points, 3)) * box.size
        part = rows[box.instance]
        xyz[part] = (box.centre + inside @ box.rotation.T - position) @ rotation
        instances[part], classes[part] = box.instance, box.class_id
    values = {"xyz": xyz @ rotation.T + position + ORIGIN, "instance_id": instances, "class_id": classes}
    return xyz.astype(np.float32), points.with_arrays(values)
