"""Ghost echoes by multipath: they lie where the mirror image of what they show is, as bright as the law says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.multipath import (
    FILM_SLOPE,
    WATER,
    Mirrors,
    Multipath,
    mirrored_share,
    mirrors_of,
    seen_share,
)
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.scenes.scan_scenes import ORIGIN, Standing, altered, mesh_of, scan_block, scan_of

WALL = 12.0
"""Left of the scanner, m: a wall, as high as this."""
GROUND, STEEL = 0, 1


def corner() -> SceneMesh:
    """Return level ground of asphalt up to a wall of steel."""
    far = 400.0
    ground = [(-far, -far, 0), (far, -far, 0), (far, WALL, 0), (-far, WALL, 0)]
    wall = [(-far, WALL, 0), (far, WALL, 0), (far, WALL, WALL), (-far, WALL, WALL)]
    mesh = mesh_of(ground + wall, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    material = np.array([GROUND, GROUND, STEEL, STEEL], dtype=np.uint16)
    return replace(mesh, material=material, materials=("asphalt", "galvanised_steel"))


def plan_of(ground: tuple[float, float], wall: tuple[float, float], **changes) -> ScanPlan:
    """Return a scan of the corner, whose two materials mirror by reflectance and slope."""
    mirrors = Mirrors(*(np.array(pair) for pair in zip(ground, wall, strict=True)))
    plan = scan_of(corner(), 1, Standing(3.0), field_of_view=2.0 * np.pi, **changes)
    layers = plan.layers.measured | {"material"}
    return altered(plan, multipath=Multipath(mirrors, 1.0), attenuation=0.002, measured=layers)


def scanned(plan: ScanPlan) -> tuple[PointBlock, PointBlock]:
    """Return the ghosts, and the points of the same pulses on their mirrors."""
    points = scan_block(plan, plan.path.strips[0], 0).points
    ghost = points.class_id == UNLABELLED
    rows = np.flatnonzero(ghost)
    return points.select(rows), points.select(rows - 1)


def test_a_wall_of_steel_shows_the_ground_behind_it() -> None:
    ghosts, mirrors = scanned(plan_of((0.0, 0.3), (0.5, 0.0)))
    place = ghosts.xyz - ORIGIN
    assert len(ghosts) > 1000
    np.testing.assert_allclose(place[:, 2], 0.0, atol=1e-5)
    assert (place[:, 1] > WALL).all()
    assert (mirrors.material == STEEL).all()
    assert (ghosts.return_number == 2).all()


def test_wet_ground_shows_the_wall_below_it() -> None:
    ghosts, mirrors = scanned(plan_of((0.02, 0.0), (0.0, 0.05)))
    place = ghosts.xyz - ORIGIN
    assert len(ghosts) > 1000
    np.testing.assert_allclose(place[:, 1], WALL, atol=1e-5)
    assert (place[:, 2] < 0.0).all()
    assert (mirrors.material == GROUND).all()


def test_a_ghost_is_as_bright_as_mirror_image_range_and_blur_say() -> None:
    slope, reflectance = 0.003, 0.4
    plan = plan_of((0.0, 0.3), (reflectance, slope))
    ghosts, mirrors = scanned(plan)
    assert np.ptp(ghosts.range) > 10.0
    cosine = np.cos(np.deg2rad(mirrors.incidence_deg.astype(float)))
    fresnel = reflectance + (1.0 - reflectance) * (1.0 - cosine) ** 5
    beyond = ghosts.range - mirrors.range
    blur = 4.0 * slope * beyond / ghosts.range / plan.setting.beam_angle
    # On the ground, seen from the image of the scanner: its height over the whole way.
    lit = materials()["asphalt"].reflectivity * 3.0 / ghosts.range
    expected = fresnel**2 / (1.0 + blur**2) * lit / ghosts.range**2 * np.exp(-0.002 * ghosts.range)
    np.testing.assert_allclose(ghosts.intensity, expected, rtol=2e-5)


def test_strength_is_a_factor_and_nothing_else_changes() -> None:
    plan = plan_of((0.0, 0.3), (0.4, 0.003))
    assert plan.reflection.multipath is not None
    strong = altered(plan, multipath=replace(plan.reflection.multipath, strength=3.0))
    one, three = scanned(plan)[0], scanned(strong)[0]
    np.testing.assert_allclose(three.intensity, 3.0 * one.intensity, rtol=1e-6)
    strip = plan.path.strips[0]
    without = scan_block(altered(plan, multipath=None), strip, 0).points
    points = scan_block(plan, strip, 0).points
    first = points.select(points.return_number == 1)
    # A ghost nearer to its mirror than the range resolution is one echo with it.
    apart = (first.number_of_returns == 2) | (np.abs(first.xyz[:, 1] - ORIGIN[1]) < WALL - 1.0)
    np.testing.assert_array_equal(first.xyz[apart], without.xyz[apart])
    assert apart.mean() > 0.5


def test_ghosts_are_detected_by_the_receivers_chance() -> None:
    """Chi-square of the share that is detected, over eight groups of the signal to noise ratio."""
    calm = plan_of((0.0, 0.3), (0.4, 0.003))
    ghosts, _ = scanned(calm)
    threshold, ratio = float(np.median(ghosts.intensity)), 3.0
    setting = replace(calm.setting, threshold=threshold, receiver=Receiver(threshold_to_noise=ratio))
    found, _ = scanned(altered(calm, setting=setting))
    chance = stats.norm.cdf(ratio * (ghosts.intensity / threshold - 1.0))
    seen = np.isin(ghosts.gps_time, found.gps_time)
    unsure = (chance > 0.02) & (chance < 0.98)
    seen, chance = seen[unsure], chance[unsure]
    group = np.minimum((stats.rankdata(chance) / len(chance) * 8).astype(int), 7)
    excess, spread = (np.bincount(group, values) for values in (seen - chance, chance * (1.0 - chance)))
    assert spread.min() > 5.0
    assert stats.chi2.sf(np.sum(excess**2 / spread), len(spread)) > 0.001


def test_what_mirrors() -> None:
    rows = [materials()[name] for name in ("asphalt", "asphalt", "galvanised_steel", "car_paint", "glass")]
    mirrors = mirrors_of(rows, [0.0, 0.5, 0.0, 0.0, 0.0])
    steel = 0.9 * materials()["galvanised_steel"].reflectivity + 0.1 * 0.04
    np.testing.assert_allclose(mirrors.reflectance, [0.0, 0.5 * WATER, steel, 0.04, 0.04])
    assert mirrors.slope[1] == FILM_SLOPE


@pytest.mark.parametrize(("cosine", "share"), [(1.0, 0.04), (0.5, 0.04 + 0.96 / 32.0), (0.0, 1.0)])
def test_schlick(cosine: float, share: float) -> None:
    assert mirrored_share(np.array([0.04]), np.array([cosine])) == pytest.approx(share)
    assert mirrored_share(np.array([0.0]), np.array([cosine])) == 0.0


def test_blur_takes_more_the_farther_the_image_lies_behind_the_mirror() -> None:
    shares = seen_share(np.full(4, 0.05), np.full(4, 10.0), np.array([0.0, 0.05, 0.5, 5.0]), 3e-3)
    assert shares[0] == 1.0
    assert (np.diff(shares) < 0.0).all()
