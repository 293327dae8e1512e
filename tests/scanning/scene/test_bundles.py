"""Bundles rule out no ray that comes near a moving body, whatever rays they are of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from synthroads_addon.scanning.knots import Track
from synthroads_addon.scanning.scene.bundles import RAYS, Bundles
from tests.helpers.scenes.scan_scenes import upright

Float = NDArray[np.float64]
CENTRE, RADIUS = np.array([0.5, -0.2, 1.0]), 3.0


def turning(place: Float, velocity: Float) -> Track:
    """Return the track of a body that drives on and turns about the vertical for 2 s."""

    def pose(time: Float) -> tuple[Float, Float, NDArray[np.bool_]]:
        return upright(time), place + time[:, None] * velocity, np.ones(len(time), dtype=bool)

    return Track.between(pose, 0.0, 2.0, 0.01)


def lines(count: int, speed: float) -> Bundles:
    """Return rays of a scanner 60 m above ground that sweeps lines across its way; all of them twice."""
    once = np.arange(count // 2) / (count // 2)
    angle = 1.2 * (2.0 * np.mod(once * 37.0, 1.0) - 1.0)
    down = np.stack([0.02 * np.ones_like(angle), np.sin(angle), -np.cos(angle)])
    down /= np.linalg.norm(down, axis=0)
    origin = np.stack([speed * 2.0 * once, 0.0 * once, 60.0 + 0.0 * once])
    origin, down = np.tile(origin, (1, 2)), np.tile(down, (1, 2))
    return Bundles.gather(origin, down, np.tile(2.0 * once, 2), np.full(2 * len(once), 400.0))


def anyhow(count: int, seed: int) -> Bundles:
    """Return rays from anywhere to anywhere, at any time."""
    source = np.random.default_rng(seed)
    towards = source.normal(size=(3, count))
    towards /= np.linalg.norm(towards, axis=0)
    origins, times = source.uniform(-50.0, 50.0, (3, count)), source.uniform(0.0, 2.0, count)
    return Bundles.gather(origins, towards, times, source.uniform(1.0, 80.0, count))


def narrow(seed: int) -> Bundles:
    """Return bundles of rays that look about the same way from about the same place at about the same time."""
    source = np.random.default_rng(seed)
    count = 40
    origin, axis = source.uniform(-30.0, 30.0, (3, count, 1)), source.normal(size=(3, count, 1))
    wide, apart, late, far = 10.0 ** source.uniform((-4, -2, -4, 0), (0, 1, 0, 2), (count, 4)).T[:, :, None]
    towards = axis / np.linalg.norm(axis, axis=0) + wide * source.normal(size=(3, count, RAYS))
    towards /= np.linalg.norm(towards, axis=0)
    origins = origin + apart * source.normal(size=(3, count, RAYS))
    times = np.clip(source.uniform(0.0, 2.0, (count, 1)) + late * source.normal(size=(count, RAYS)), 0.0, 2.0)
    reach = np.broadcast_to(far, (count, RAYS))
    return Bundles.gather(origins.reshape(3, -1), towards.reshape(3, -1), times.ravel(), reach.ravel())


def by_each(rays: Bundles, track: Track) -> NDArray[np.intp]:
    """Return the rays near the body, each looked at by itself."""
    rotation, place, _ = track.at(rays.times)
    towards = np.einsum("ijn,j->in", rotation.reshape(3, 3, -1), CENTRE) + place - rays.origins
    along = np.clip((towards * rays.directions).sum(axis=0), 0.0, rays.reach)
    return np.flatnonzero(((towards - along * rays.directions) ** 2).sum(axis=0) <= RADIUS**2)


@given(
    place=st.tuples(*[st.floats(-60.0, 60.0)] * 2),
    velocity=st.tuples(*[st.floats(-40.0, 40.0)] * 2),
    speed=st.floats(0.0, 60.0),
)
def test_a_scanner_s_lines_meet_what_each_ray_meets(
    place: tuple[float, float], velocity: tuple[float, float], speed: float
) -> None:
    track = turning(np.array([*place, 0.0]), np.array([*velocity, 0.0]))
    rays = lines(20_000, speed)
    np.testing.assert_array_equal(rays.rays_near(track, CENTRE, RADIUS), by_each(rays, track))


@given(seed=st.integers(0, 10_000), fast=st.floats(-60.0, 60.0))
@settings(max_examples=300)
def test_narrow_bundles_meet_what_each_ray_meets(seed: int, fast: float) -> None:
    track, rays = turning(np.zeros(3), np.array([fast, 0.0, 0.0])), narrow(seed)
    np.testing.assert_array_equal(rays.rays_near(track, CENTRE, RADIUS), by_each(rays, track))


@given(seed=st.integers(0, 1000), count=st.integers(1, 3 * RAYS))
def test_rays_from_anywhere_meet_what_each_ray_meets(seed: int, count: int) -> None:
    track, rays = turning(np.zeros(3), np.array([10.0, 0.0, 0.0])), anyhow(count, seed)
    np.testing.assert_array_equal(rays.rays_near(track, CENTRE, RADIUS), by_each(rays, track))


def test_most_bundles_of_a_scanner_s_lines_are_ruled_out() -> None:
    rays, track = lines(200_000, 8.0), turning(np.array([10.0, 12.0, 0.0]), np.array([-20.0, 0.0, 0.0]))
    near = rays.rays_near(track, CENTRE, RADIUS)
    looked_at = len(rays._bundles_near(track, track.way_of(CENTRE), RADIUS)) * RAYS
    assert len(near) > 500
    assert looked_at < 10 * len(near) < 10_000


def test_no_rays_are_near_nothing() -> None:
    none = np.empty((3, 0))
    rays = Bundles.gather(none, none, np.empty(0), np.empty(0))
    assert len(rays.rays_near(turning(np.zeros(3), np.zeros(3)), CENTRE, RADIUS)) == 0


@pytest.mark.parametrize("way", [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0)])
def test_a_way_is_that_of_its_point(way: tuple[float, float, float]) -> None:
    track = turning(np.array([3.0, 4.0, 0.0]), np.array(way))
    time = np.linspace(0.0, 2.0, 777)
    rotation, place, _ = track.at(time)
    expected = np.einsum("ijn,j->in", rotation.reshape(3, 3, -1), CENTRE) + place
    np.testing.assert_allclose(track.interpolate(track.way_of(CENTRE), time), expected, atol=1e-12)
