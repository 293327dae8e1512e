"""Whether the sun reaches points: what stands throws its shadow always, what moves where it is at the time."""

from __future__ import annotations

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh, ScannedScene
from synthroads_addon.scanning.scene.target import Target
from tests.helpers.scenes.scan_scenes import BruteForce, mesh_of

SUN = np.array([0.0, np.sin(np.deg2rad(30.0)), np.cos(np.deg2rad(30.0))])
HEIGHT = 4.0
SHIFT = HEIGHT * np.tan(np.deg2rad(30.0))
"""How far a shadow of something at that height lies before it, m."""


def plate(low: float, high: float, height: float = HEIGHT):
    """Return a square plate from low to high in x and y."""
    corners = [(low, low, height), (high, low, height), (high, high, height), (low, high, height)]
    return mesh_of(np.array(corners, np.float32), [(0, 1, 2), (0, 2, 3)])


def ground(count: int) -> Float:
    """Return places (3, N) on the ground."""
    place = np.random.default_rng(2).uniform(-12.0, 12.0, (3, count))
    place[2] = 0.001
    return place


def shaded(place: Float, middle: Float | float = 0.0) -> np.ndarray:
    """Return which places lie in the shadow of a plate of 2 m around a middle in x."""
    return (np.abs(place[0] - middle) < 1.0) & (np.abs(place[1] + SHIFT) < 1.0)


def test_what_stands_throws_its_shadow() -> None:
    target = Target(ScannedScene(plate(-1.0, 1.0)), BruteForce)
    place = ground(3000)
    free = target.unobstructed(place, SUN, np.zeros(place.shape[1]), [])
    assert np.array_equal(~free, shaded(place))
    assert 5 < (~free).sum() < 60
    assert target.unobstructed(place, SUN, np.zeros(place.shape[1]), [], reach=1.0).all(), "nothing is as near as that"
    assert len(target.unobstructed(place[:, :0], SUN, np.zeros(0), [])) == 0


def test_what_moves_throws_its_shadow_where_it_is() -> None:
    moving = MovingMesh(plate(-1.0, 1.0), LinearMotion(np.array([5.0, 0.0, 0.0]), [0.0, 0.0, 0.0]))
    target = Target(ScannedScene(plate(100.0, 101.0), (moving,)), BruteForce)
    place = ground(2000)
    times = np.linspace(0.0, 2.0, place.shape[1])
    free = target.unobstructed(place, SUN, times, target.motions(0.0, 2.0, 0.1))
    assert np.array_equal(~free, shaded(place, 5.0 * times))
    late = ~free & (times > 1.5)
    assert late.any()
    assert place[0, late].min() > 6.0
