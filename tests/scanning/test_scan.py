"""Blocks of pulses on small scenes whose truth is known, and at the numerical extremes. Rays by brute force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.noise import Noise, mean_log_factor, speckle_factors
from synthroads_addon.scanning.receiver import Receiver
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.scene.mesh import empty_scene_mesh
from tests.helpers.scenes.scan_scenes import (
    ORIGIN,
    Standing,
    altered,
    mesh_of,
    middle_pulses,
    plane,
    scan_block,
    scan_of,
    scan_pulses,
)


def test_flat_ground_is_hit_where_the_beam_points() -> None:
    points = middle_pulses(scan_of(plane()), 400).points
    assert len(points) == 400
    np.testing.assert_allclose(points.xyz[:, 2] - ORIGIN[2], 0.0, atol=1e-9)
    np.testing.assert_allclose(points.range, 60 / np.cos(np.deg2rad(points.scan_angle_deg)), rtol=1e-6)
    np.testing.assert_allclose(points.incidence_deg, np.abs(points.scan_angle_deg), atol=1e-3)
    # Heading east, a positive scan angle looks to the right: south.
    np.testing.assert_array_equal(np.sign(points.xyz[:, 1] - ORIGIN[1]), -np.sign(points.scan_angle_deg))
    spacing = np.abs(np.diff(points.xyz[:, 1]))[199]
    assert spacing == pytest.approx(60 * np.deg2rad(0.18), rel=1e-3)
    assert set(points.instance_id) == {7}


def test_a_plane_within_the_resolution_is_one_return() -> None:
    points = middle_pulses(scan_of(plane(), 19), 200).points
    assert len(points) == 200
    assert set(points.number_of_returns) == {1}


def test_a_step_edge_is_two_returns_at_the_right_ranges() -> None:
    """A roof 10 m above the ground, its edge below the beam's middle."""
    roof = [(-50, -50, 10), (50, -50, 10), (50, 0, 10), (-50, 0, 10)]
    ground = [(-500, -500, 0), (500, -500, 0), (500, 500, 0), (-500, 500, 0)]
    mesh = mesh_of(roof + ground, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    points = middle_pulses(scan_of(mesh, 19, divergence=(10e-3, 10e-3)), 2).points
    assert points.number_of_returns.tolist() == [2, 2, 2, 2]
    assert points.return_number.tolist() == [1, 2, 1, 2]
    np.testing.assert_allclose(points.range, [50, 60, 50, 60], atol=0.01)
    np.testing.assert_array_equal(points.gps_time[::2], points.gps_time[1::2])


def test_noise_has_the_stated_sigma_and_its_own_stream() -> None:
    scan = scan_of(plane(), range_sigma=0.01)
    strip = scan.path.strips[0]
    calm = scan_block(altered(scan, setting=replace(scan.setting, range_sigma=0.0)), strip, 0).points
    first, second, other = (scan_block(scan, strip, block).points for block in (0, 0, 1))
    error = first.range - calm.range
    assert error.std() == pytest.approx(0.01, rel=0.02)
    assert abs(error.mean()) < 1e-4
    np.testing.assert_array_equal(first.range, second.range)
    assert not np.array_equal(other.range[:100], first.range[:100])


def test_speckle_is_gamma_distributed_with_its_own_stream() -> None:
    """A chi-square test of twenty equal shares; ranges and everything else are as without."""
    scan = scan_of(plane(), 7, range_sigma=0.01)
    speckled = altered(scan, noise=Noise(speckle=0.25))
    strip = scan.path.strips[0]
    calm, points = (scan_block(plan, strip, 0).points for plan in (scan, speckled))
    np.testing.assert_array_equal(points.xyz, calm.xyz)
    factor = points.intensity / calm.intensity
    counts = np.bincount((stats.gamma.cdf(factor, 16.0, scale=1.0 / 16.0) * 20).astype(int), minlength=20)
    assert len(factor) > 5000
    assert stats.chisquare(counts).pvalue > 0.001
    assert factor.mean() == pytest.approx(1.0, abs=0.01)
    again = scan_block(speckled, strip, 0).points
    np.testing.assert_array_equal(again.intensity, points.intensity)


@pytest.mark.parametrize("normal", [0.5, 1.0])
def test_a_part_of_the_intensitys_noise_is_normal(normal: float) -> None:
    """Mean and deviation as said; skewness in decibels between a gamma distribution's and three times that."""
    sigma = 0.2
    factor = speckle_factors(np.random.default_rng(1), 200_000, sigma, normal).astype(np.float64)
    assert factor.mean() == pytest.approx(1.0, abs=0.003)
    assert factor.std() == pytest.approx(sigma, rel=0.01)
    assert stats.skew(np.log(factor)) < -1.4 * sigma
    assert mean_log_factor(sigma, normal) == pytest.approx(np.log(factor).mean(), abs=0.002)
    if normal == 1.0:
        counts = np.bincount((stats.norm.cdf(factor, 1.0, sigma) * 20).astype(int), minlength=20)
        assert stats.chisquare(counts).pvalue > 0.001


def test_normal_noise_leaves_walking_ranges_without_a_bias() -> None:
    plan = altered(scan_of(plane(), range_sigma=1e-9), noise=Noise(speckle=0.3, speckle_normal=1.0))
    strip = plan.path.strips[0]
    walking = replace(plan.setting, receiver=Receiver(range_walk=0.02))
    calm, points = (scan_block(p, strip, 0).points for p in (plan, altered(plan, setting=walking)))
    shift = points.range - calm.range
    assert shift.std() > 0.02
    assert abs(shift.mean()) < 4.0 * shift.std() / np.sqrt(len(shift))


def test_pointing_errors_are_normal_along_both_axes() -> None:
    """A chi-square test of twenty equal shares of where points lie beside their beams."""
    scan = altered(scan_of(plane()), noise=Noise(angle_sigma_mrad=2.0))
    strip = scan.path.strips[0]
    errors = BlockScan(scan).emitter.draw_errors(strip, 8000, 0).angle
    assert errors is not None
    for axis in errors:
        counts = np.bincount((stats.norm.cdf(axis / 2e-3) * 20).astype(int), minlength=20)
        assert stats.chisquare(counts).pvalue > 0.001
    assert abs(np.corrcoef(errors)[0, 1]) < 0.05
    points, calm = (scan_pulses(plan, strip, 450, 100).points for plan in (scan, altered(scan, noise=Noise())))
    off = np.linalg.norm(points.xyz - calm.xyz, axis=1) / calm.range
    assert np.sqrt(np.mean(off**2)) == pytest.approx(2e-3 * np.sqrt(2.0), rel=0.2)


def test_dropouts_are_as_many_as_said_in_every_part_of_the_scan() -> None:
    """A chi-square test of the returns that are lost, over ten groups of the scan angle."""
    scan = scan_of(plane())
    strip, share = scan.path.strips[0], 0.2
    calm, left = (scan_block(plan, strip, 0).points for plan in (scan, altered(scan, noise=Noise(dropout=share))))
    lost = ~np.isin(calm.gps_time, left.gps_time)
    group = (stats.rankdata(calm.scan_angle_deg, method="ordinal").astype(int) - 1) * 10 // len(calm)
    found, total = np.bincount(group, lost), np.bincount(group)
    assert stats.chi2.sf(np.sum((found - share * total) ** 2 / (share * (1.0 - share) * total)), 10) > 0.001


def test_speckle_decides_which_faint_echoes_are_detected() -> None:
    """Half of the pulses are lost at the threshold: a gamma variable exceeds 0.979 of its mean in half of all cases."""
    scan = scan_of(plane())
    usual = middle_pulses(scan, 4).points.intensity[0]
    at_threshold = altered(scan, setting=replace(scan.setting, threshold=0.979 * usual), noise=Noise(speckle=0.25))
    found = [
        len(scan_pulses(at_threshold, scan.path.strips[0], 1000 * line + 495, 10, line).points) for line in range(200)
    ]
    assert sum(found) / 2000 == pytest.approx(0.5, abs=0.05)


def test_intensity_follows_the_laser_equation_and_the_threshold() -> None:
    scan = scan_of(plane())
    points = middle_pulses(scan, 600).points
    reflectivity = scan.reflection.surfaces.reflectivity[0]
    expected = reflectivity * np.cos(np.deg2rad(points.incidence_deg)) / points.range**2
    np.testing.assert_allclose(points.intensity, expected, rtol=1e-5)
    limit = float(np.median(points.intensity))
    result = middle_pulses(altered(scan, setting=replace(scan.setting, threshold=limit)), 600)
    assert result.points.intensity.min() >= limit
    assert len(result.points) + result.below_threshold == 600


# --- extremes -------------------------------------------------------------------------------------------------------


def test_no_scene_one_face_and_faces_without_area() -> None:
    assert len(middle_pulses(scan_of(empty_scene_mesh(ORIGIN))).points) == 0
    one = mesh_of([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [(0, 1, 2)])
    assert 0 < len(middle_pulses(scan_of(one)).points) <= 100
    degenerate = mesh_of([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [(0, 1, 2), (0, 0, 1), (0, 1, 1), (2, 2, 2)])
    same = middle_pulses(scan_of(degenerate)).points
    np.testing.assert_array_equal(same.xyz, middle_pulses(scan_of(one)).points.xyz)


def test_zero_hits_is_an_empty_block_with_every_attribute() -> None:
    far = mesh_of([(900, 900, 0), (901, 900, 0), (900, 901, 0)], [(0, 1, 2)])
    result = middle_pulses(scan_of(far, 7))
    assert len(result.points) == 0
    assert result.points.xyz.shape == (0, 3)
    assert result.pulses == 100


@pytest.mark.parametrize("divergence", [0.0, 0.1])
@pytest.mark.parametrize("rays", [1, 61])
def test_divergence_from_0_to_100_mrad(divergence: float, rays: int) -> None:
    with np.errstate(invalid="raise", divide="raise"):
        points = middle_pulses(scan_of(plane(), rays, divergence=(divergence, divergence)), 20).points
    assert np.isfinite(points.xyz).all()
    excess = points.range * np.cos(np.deg2rad(points.scan_angle_deg)) / 60.0 - 1.0
    # The rays' mean range: <r^2> / 2 = (w / 60 m)^2 / 4 longer than the axis, w = 60 m tan(D / 2).
    expected = np.tan(divergence / 2.0) ** 2 / 4.0 if rays > 1 else 0.0
    np.testing.assert_allclose(excess, expected, rtol=0.03, atol=1e-6)


def test_ranges_from_zero_to_past_the_maximum() -> None:
    for height, expected in ((2.0, 0), (60.0, 100), (3000.0, 0)):
        scan = scan_of(plane(20_000.0), path=Standing(height))
        assert scan.setting.maximum_range < 3000.0
        assert len(middle_pulses(scan).points) == expected
    # Standing on the surface itself: no range, no point, no NaN.
    flat = scan_of(plane(), path=Standing(0.0), minimum_range=0.0)
    assert np.isfinite(middle_pulses(flat).points.xyz).all()


def test_incidence_up_to_90_degrees() -> None:
    """A wall along the beam gives nothing, and no NaN; one almost along it gives a faint, finite echo."""
    wall = mesh_of([(0, -50, -50), (0, 50, -50), (0, 0, 50)], [(0, 1, 2)])
    points = middle_pulses(scan_of(wall, 7)).points
    assert np.isfinite(points.intensity).all()
    assert np.isfinite(points.xyz).all()
    grazing = plane(slope=(0.0, 573.0))
    points = middle_pulses(scan_of(grazing, 1, minimum_range=0.0), 2).points
    assert np.isfinite(points.intensity).all()


def test_dense_fog_leaves_no_point_and_no_nan() -> None:
    scan = altered(scan_of(plane(), 7), attenuation=0.2)
    thick = middle_pulses(altered(scan, setting=replace(scan.setting, threshold=0.2 / 113.0**2)))
    assert len(thick.points) == 0
    assert thick.below_threshold == 100
    clear = middle_pulses(altered(scan, attenuation=0.0)).points
    faint = middle_pulses(scan).points
    np.testing.assert_allclose(faint.intensity / clear.intensity, np.exp(-0.2 * clear.range), rtol=1e-4)


def test_nan_in_a_mesh_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="vertices"):
        mesh_of([(0, 0, np.nan), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])


def test_map_coordinates_keep_their_millimetres() -> None:
    """At 5.6e6 m the absolute error stays below a micrometre: only the local part is ever float32."""
    near = middle_pulses(scan_of(plane())).points.xyz - ORIGIN
    mesh = replace(plane(), origin=np.zeros(3))
    local = middle_pulses(scan_of(mesh)).points.xyz
    assert np.abs(near - local).max() < 2e-9
