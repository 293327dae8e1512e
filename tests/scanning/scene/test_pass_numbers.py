"""A vehicle that comes in again is another instance."""

from __future__ import annotations

import numpy as np

from synthroads_addon.road.instances import PassNumbers
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh, ScannedScene, VehiclePasses
from synthroads_addon.scanning.scene.target import Target
from tests.helpers.scenes.scan_scenes import BruteForce, mesh_of

WAY = VehiclePasses(start=60.0, speed=20.0, lane_length=100.0, length=4.0, entry=5.0, period=10.0)
"""It leaves after 2 s, and comes in at 5 s, 15 s, ..."""


class ComesAgain(LinearMotion):
    def passes(self, time: np.ndarray) -> np.ndarray:
        return WAY.passes(time)


def test_passes_are_counted_from_one_entry_to_the_next() -> None:
    time = np.array([-3.0, 0.0, 2.0, 4.9, 5.0, 14.9, 15.0, 95.1])
    assert WAY.passes(time).tolist() == [0, 0, 0, 0, 1, 1, 2, 10]
    there = WAY.at(np.array([1.0, 3.0, 6.0]))[1]
    assert there.tolist() == [True, False, True]


def test_points_of_a_later_pass_have_another_number() -> None:
    mesh = mesh_of(np.eye(3), [(0, 1, 2)])
    numbers = (PassNumbers(100, 5), PassNumbers(101, 5), None)
    moving = tuple(MovingMesh(mesh, ComesAgain((1.0, 0.0, 0.0)), again) for again in numbers)
    target = Target(ScannedScene(mesh, moving), BruteForce)
    faces, times = np.array([0, 1, 1, 1, 2, 3, -1]), np.array([16.0, 0.0, 6.0, 16.0, 16.0, 16.0, 16.0])
    assert target.instances(faces, times).tolist() == [7, 7, 100, 105, 106, 7, 0]
