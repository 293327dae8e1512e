"""Heads beside what is published of them: points, reach, precision and numbers, each measured in scans of a wall."""

from functools import lru_cache

import numpy as np
import pytest

from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import Material
from synthroads_addon.scanning.devices.shots import shot_count
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.scan import BlockScan
from tests.helpers.scenes.scan_scenes import Standing, altered, mesh_of, scan_of
from tests.helpers.scenes.scanners import preset

OUSTER, PUCK = "ouster-os1-64", "velodyne-vlp-32c"
WIDE, TURNS = 4.0, 3
"""Half the azimuth, deg, within which points count, and turns of the head."""


class Turning(Standing):
    """A head that stands at the middle of the walls, its strip as long as some turns."""

    def __init__(self, seconds: float) -> None:
        super().__init__(0.0)
        self.strips = (Strip(0, 0.0, seconds),)


def target_of(reflectance: float, retroreflection: float = 0.0) -> Material:
    """Return a matt material of a reflectance."""
    return Material(
        base_color=(reflectance,) * 3, roughness=1.0, metallic=1.0, specular=0.0, retroreflection=retroreflection
    )


def walls(distance: float):
    """Return four walls around the origin, floor and ceiling: a box."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 3, 7), (2, 7, 6)]
    faces += [(0, 2, 6), (0, 6, 4), (1, 3, 7), (1, 7, 5)]
    return mesh_of(np.array(corners) * distance, faces)


@lru_cache(maxsize=32)
def scanned(name: str, distance: float, reflectance: float, retroreflection: float = 0.0):
    """Return a head's points of walls, the pulses that were fired at the wall in front, and the scanner's setting.

    Of the points, those of the wall in front within `WIDE` of its middle, to the sides and in height.
    """
    setting = preset(name, lines_per_second=10.0)
    plan = altered(
        scan_of(walls(distance), 1, Turning(TURNS / 10.0)),
        setting=setting,
        surfaces=surfaces_of([target_of(reflectance, retroreflection)]),
        measured=frozenset({"scanner", "channel"}),
    )
    strip = plan.path.strips[0]
    scan, counts = BlockScan(plan), shot_count(setting, strip.duration)
    poses = scan.emitter.poses_between(strip, 0.0, strip.duration)
    pulses = scan.emitter.emit(strip, poses, None, 0, counts)
    width = np.tan(np.deg2rad(WIDE))
    x, y, z = pulses.direction
    fired = int(np.count_nonzero((x > 0.0) & (np.abs(y) < width * x) & (np.abs(z) < width * x)))
    points = scan.scan_pulses(strip, 0, counts).points
    away = points.xyz - points.scanner
    front = (np.abs(away[:, 1:]) < width * away[:, :1]).all(axis=1)
    return points, np.flatnonzero(front), fired, setting


def detected_share(name: str, distance: float, reflectance: float) -> float:
    """Return the share of the pulses at a wall that come back."""
    _, front, fired, _ = scanned(name, distance, reflectance)
    assert fired > 300
    return len(front) / fired


def errors_of_range(points, front, distance):
    """Return the errors (N,) of the ranges of points on the wall in front, m."""
    away = points.xyz[front] - points.scanner[front]
    return points.range[front] - distance * np.linalg.norm(away, axis=1) / away[:, 0]


def rings_of(points):
    """Return mean elevation, deg, and number of points of each laser, from the lowest to the highest."""
    away = points.xyz - points.scanner
    elevation = np.rad2deg(np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1])))
    laser = points.array("channel")
    count = np.bincount(laser)
    mean = np.bincount(laser, elevation) / count
    order = np.argsort(mean)
    return mean[order], count[order]


def test_ouster_has_1024_points_to_each_of_64_rings_and_turn_at_its_published_rate() -> None:
    setting = preset(OUSTER, lines_per_second=20.0)
    assert setting.pulse_rate == pytest.approx(1_310_720.0)
    points, _, _, _ = scanned(OUSTER, 10.0, 0.5)
    elevation, count = rings_of(points)
    # 2048 to the turn at 10 turns/s, which is 1024 at 20.
    assert len(elevation) == 64
    assert set(count) == {2048 * TURNS}
    np.testing.assert_allclose([elevation[0], elevation[-1]], [-16.6, 16.6], atol=0.002)


def test_puck_has_the_rings_of_its_manual_and_600_000_points_a_second() -> None:
    points, _, _, setting = scanned(PUCK, 10.0, 0.5)
    assert setting.pulse_rate == pytest.approx(600_000.0, rel=0.05)
    elevation, count = rings_of(points)
    assert len(elevation) == 32
    # A sequence every 55.296 us: 0.2 deg at 10 turns/s.
    np.testing.assert_allclose(count / TURNS, 0.1 / 55.296e-6, rtol=1e-3)
    assert 360.0 * TURNS / count[0] == pytest.approx(0.2, abs=0.002)
    np.testing.assert_allclose([elevation[0], elevation[-1]], [-25.0, 15.0], atol=0.002)
    middle = elevation[(elevation > -2.4) & (elevation < 1.7)]
    np.testing.assert_allclose(np.diff(middle), 1 / 3, atol=0.002)


@pytest.mark.parametrize(("reflectance", "reach"), [(0.1, 40.0), (0.8, 120.0)])
def test_ouster_sees_half_of_a_target_within_a_tenth_of_its_published_reach(reflectance: float, reach: float) -> None:
    assert detected_share(OUSTER, 0.9 * reach, reflectance) > 0.6
    assert detected_share(OUSTER, 1.1 * reach, reflectance) < 0.4


def test_puck_sees_a_bright_target_up_to_its_published_reach_and_nothing_beyond() -> None:
    assert detected_share(PUCK, 180.0, 0.8) > 0.8
    assert detected_share(PUCK, 199.0, 1.0) > 0.8
    assert detected_share(PUCK, 201.0, 1.0) == 0.0


@pytest.mark.parametrize(("signal", "published", "within"), [(250.0, 0.015, 0.1), (100.0, 0.03, 0.4), (12.0, 0.1, 0.1)])
def test_ouster_repeats_ranges_as_published_by_signal(signal: float, published: float, within: float) -> None:
    # Of an echo that is so many times as strong as the receiver's noise. No law that falls to 1.5 cm and grows to
    # 10 cm with the inverse signal has 3 cm between them: it gives 1.9.
    distance, ratio = 15.0, preset(OUSTER).receiver.threshold_to_noise
    reflectance = signal / ratio * preset(OUSTER).threshold * distance**2
    points, front, _, _ = scanned(OUSTER, distance, reflectance)
    assert np.std(errors_of_range(points, front, distance)) == pytest.approx(published, rel=within)


def test_puck_is_as_accurate_as_published() -> None:
    for reflectance in (0.1, 0.8):
        points, front, _, _ = scanned(PUCK, 25.0, reflectance)
        error = errors_of_range(points, front, 25.0)
        assert np.sqrt(np.mean(error**2)) < 0.03
        assert abs(np.mean(error)) < 0.003


def test_numbers_of_ouster_fall_with_the_square_of_the_range_as_photons_do() -> None:
    level = {}
    for distance, reflectance in ((5.0, 0.8), (10.0, 0.8), (20.0, 0.8), (10.0, 0.2)):
        points, front, _, _ = scanned(OUSTER, distance, reflectance)
        level[distance, reflectance] = np.mean(points.intensity[front]) * distance**2 / reflectance
    np.testing.assert_allclose(list(level.values()), level[5.0, 0.8], rtol=0.02)


@pytest.mark.parametrize("distance", [10.0, 30.0])
def test_numbers_of_puck_are_percent_whatever_the_range(distance: float) -> None:
    for reflectance in (0.1, 0.5, 1.0):
        points, front, _, _ = scanned(PUCK, distance, reflectance)
        assert np.mean(points.intensity[front]) * 255.0 == pytest.approx(100.0 * reflectance, abs=1.5)


def test_retro_reflectors_have_the_numbers_above_those_of_diffuse_ones_on_puck() -> None:
    points, front, _, _ = scanned(PUCK, 20.0, 0.5, 100.0)
    assert np.all(points.intensity[front] * 255.0 > 100.5)
