"""A single sweep is known by its rings, wherever its head stands, and nothing else is taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from ml.sweeps import MOST_RINGS, find_sweep, ringed_share
from synthroads_addon.base.arrays import Float

HEAD = np.array([12.0, -7.0, 1.9])


def cast(elevations: Float, azimuths: Float, *, half_width: float = 9.0) -> Float:
    """Return where beams (N,) in rad from `HEAD` meet a street: flat ground, and a wall on each side along x."""
    directions = np.column_stack(
        [np.cos(elevations) * np.cos(azimuths), np.cos(elevations) * np.sin(azimuths), np.sin(elevations)]
    )
    with np.errstate(divide="ignore"):
        to_ground = np.where(directions[:, 2] < 0.0, -HEAD[2] / directions[:, 2], np.inf)
        to_walls = half_width / np.abs(directions[:, 1])
    distance = np.minimum(to_ground, to_walls)
    reached = distance < 90.0
    return HEAD + directions[reached] * distance[reached, None]


def sweep(rings: int, columns: int, noise: float, rng: np.random.Generator) -> Float:
    """Return the points of one turn of a head with this many lasers, with noise in m."""
    elevation, azimuth = np.meshgrid(
        np.radians(np.linspace(-24.0, 8.0, rings)), np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    )
    points = cast(elevation.ravel(), azimuth.ravel())
    return points + rng.normal(0.0, noise, points.shape)


@pytest.mark.parametrize("rings", [16, 32, 64, 128])
@pytest.mark.parametrize("shift", [(-12.0, 7.0, -1.9), (0.0, 0.0, 0.0), (5321.0, 78123.0, 240.0)])
def test_a_sweep_is_known_wherever_its_head_stands(rings: int, shift: tuple[float, float, float]) -> None:
    points = np.round(sweep(rings, 1800, 0.005, np.random.default_rng(rings)) + shift, 3)
    found = find_sweep(points)
    assert found is not None
    assert np.abs(found.origin - (HEAD + shift)).max() < 1.0
    assert rings / 2 < found.rings < 2 * rings


def test_a_long_street_does_not_make_a_sweep_a_drive() -> None:
    """The extent along is twenty times that across, by which it was once taken for a drive."""
    points = sweep(64, 1800, 0.005, np.random.default_rng(1))
    assert np.ptp(points[:, 0]) > 5.0 * np.ptp(points[:, 1])
    assert find_sweep(points) is not None


def test_points_of_a_drive_are_no_sweep() -> None:
    """A head that moved on by 20 m while it turned ten times."""
    rng = np.random.default_rng(2)
    turns = [sweep(32, 900, 0.005, rng) + [2.0 * turn, 0.0, 0.0] for turn in range(10)]
    assert find_sweep(np.concatenate(turns)) is None


def test_a_tripods_raster_is_no_sweep() -> None:
    elevations = np.radians(np.arange(-40.0, 40.0, 0.06))
    assert len(elevations) > 2 * MOST_RINGS
    elevation, azimuth = np.meshgrid(elevations, np.radians(np.arange(0.0, 360.0, 0.6)))
    assert find_sweep(cast(elevation.ravel(), azimuth.ravel())) is None


def test_places_at_random_and_strips_are_no_sweep() -> None:
    rng = np.random.default_rng(3)
    plane = np.column_stack([rng.uniform(-40.0, 40.0, (60_000, 2)), rng.normal(0.0, 0.02, 60_000)])
    assert find_sweep(plane) is None
    along, across = np.meshgrid(np.arange(0.0, 300.0, 0.25), np.arange(-11.0, 11.0, 0.25))
    lines = np.column_stack([along.ravel(), across.ravel(), np.zeros(along.size)])
    assert find_sweep(lines) is None
    assert find_sweep(plane[:100]) is None


def test_elevations_at_random_have_the_share_of_the_law() -> None:
    """The widest tenth of exponentially distributed gaps holds 0.1 (1 + ln 10) of their sum."""
    rng = np.random.default_rng(4)
    elevation, azimuth = rng.uniform(-0.4, 0.1, 200_000), rng.uniform(0.0, 2.0 * np.pi, 200_000)
    distance = rng.uniform(5.0, 60.0, 200_000)
    points = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)]) * distance[:, None]
    assert ringed_share(points, np.zeros(3)) == pytest.approx(0.1 * (1.0 + np.log(10.0)), abs=0.01)
