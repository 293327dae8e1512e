"""Blocks of pulses on small scenes whose truth is known, and at the numerical extremes. Rays by brute force."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import dblquad

from synthroads_addon.core.errors import InputError
from synthroads_addon.core.materials import materials
from synthroads_addon.core.parameters.geometry import RoadGeometry
from synthroads_addon.core.parameters.sampler import sample_road
from synthroads_addon.core.random_streams import stream
from synthroads_addon.core.scanning.devices import scanner_setting
from synthroads_addon.core.scanning.path import FlightPath
from synthroads_addon.core.scanning.scan import Scan, scan_block, scan_pulses, surfaces_of
from synthroads_addon.core.scenario import load_scenario
from synthroads_addon.core.scene_mesh import SceneMesh, empty_scene_mesh

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


@dataclass
class BruteForce:
    """Casts by testing every face: slow, and plainly right."""

    mesh: SceneMesh
    name: str = "brute force"

    def cast(self, origins, directions, maximum_range):
        best, hit = np.full(len(origins), np.inf), np.full(len(origins), -1, dtype=np.int32)
        o, d = origins.astype(float), directions.astype(float)
        for index, (a, b, c) in enumerate(self.mesh.vertices[self.mesh.triangles].astype(float)):
            p = np.cross(d, c - a)
            det = p @ (b - a)
            with np.errstate(divide="ignore", invalid="ignore"):
                s = o - a
                u = (s * p).sum(1) / det
                q = np.cross(s, b - a)
                v = (d * q).sum(1) / det
                t = q @ (c - a) / det
                inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < best) & (t <= maximum_range)
            best, hit = np.where(inside, t, best), np.where(inside, index, hit).astype(np.int32)
        return hit


class Standing(FlightPath):
    """A scanner that hovers over the origin, 60 m above z = 0, heading east."""

    def __init__(self, height: float = 60.0) -> None:
        geometry = RoadGeometry(sample_road(load_scenario("rq31-600m").road, 1))
        platform = load_scenario("rq31-600m", [f"scan.platform.height={height}"]).scan.platform
        super().__init__(geometry, platform)

    def pose(self, strip, time):
        place = np.array([0.0, 0.0, self.platform.height])
        return np.broadcast_to(place, (len(time), 3)).copy(), np.zeros(len(time))


def mesh_of(vertices, triangles, material="asphalt") -> SceneMesh:
    count = len(triangles)
    return SceneMesh(
        vertices=np.asarray(vertices, dtype=np.float32),
        triangles=np.asarray(triangles, dtype=np.int32).reshape(-1, 3),
        class_id=np.ones(count, dtype=np.uint8),
        instance_id=np.full(count, 7, dtype=np.uint32),
        material=np.zeros(count, dtype=np.uint16),
        materials=(material,),
        origin=ORIGIN,
    )


def plane(size: float = 5000.0, tilt_deg: float = 0.0) -> SceneMesh:
    """Return a square through the origin, tilted about the x axis (so across the scan plane's direction)."""
    slope = np.tan(np.deg2rad(tilt_deg))
    corners = [(x, y, y * slope) for x in (-size, size) for y in (-size, size)]
    return mesh_of(corners, [(0, 2, 3), (0, 3, 1)])


def scan_of(mesh: SceneMesh, rays: int = 1, path: FlightPath | None = None, **changes) -> Scan:
    setting = replace(scanner_setting(load_scenario("rq31-600m").scan), range_sigma=0.0, threshold=0.0)
    setting = replace(setting, **changes)
    surfaces = surfaces_of(materials()[name] for name in mesh.materials)
    return Scan(mesh, surfaces, BruteForce(mesh), setting, path or Standing(), rays, seed=3)


def middle_pulses(scan: Scan, count: int = 100):
    """Scan pulses around the nadir of the first line."""
    return scan_pulses(scan, scan.path.strips[0], 500 - count // 2, count, stream(3, "test"))


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


@pytest.mark.parametrize("rays", [7, 19, 37, 61])
@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0, 75.0])
def test_the_range_is_that_of_the_gaussian_footprint(rays: int, tilt: float) -> None:
    """On a tilted plane the mean range is that of the analytic footprint within 1 mm, for every number of rays."""
    divergence = (2e-3, 1e-3)
    scan = scan_of(plane(tilt_deg=tilt), rays, Standing(100.0), divergence=divergence, range_resolution=10.0)
    points = middle_pulses(scan, 2).points
    sigma = np.tan(np.array(divergence) / 2) / 2
    slope = np.tan(np.deg2rad(tilt))
    for point_range, angle_deg in zip(points.range, points.scan_angle_deg, strict=True):
        angle = np.deg2rad(float(angle_deg))

        def footprint(y: float, x: float, angle: float = angle) -> float:
            along = np.cos(angle) - x * np.sin(angle)  # downwards
            side = -(np.sin(angle) + x * np.cos(angle))  # to the north, where the plane rises
            distance = 100.0 * np.sqrt(1 + x * x + y * y) / (along + side * slope)
            weight = np.exp(-0.5 * (x / sigma[0]) ** 2 - 0.5 * (y / sigma[1]) ** 2)
            return distance * weight / (2 * np.pi * sigma[0] * sigma[1])

        reach = 7 * sigma
        expected = dblquad(footprint, -reach[0], reach[0], -reach[1], reach[1], epsabs=1e-9)[0]
        assert point_range == pytest.approx(expected, abs=1e-3)


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
    calm = scan_block(replace(scan, setting=replace(scan.setting, range_sigma=0.0)), strip, 0).points
    first, second, other = (scan_block(scan, strip, block).points for block in (0, 0, 1))
    error = first.range - calm.range
    assert error.std() == pytest.approx(0.01, rel=0.02)
    assert abs(error.mean()) < 1e-4
    np.testing.assert_array_equal(first.range, second.range)
    assert not np.array_equal(other.range[:100], first.range[:100])


def test_intensity_follows_the_laser_equation_and_the_threshold() -> None:
    scan = scan_of(plane())
    points = middle_pulses(scan, 600).points
    reflectivity = scan.surfaces.reflectivity[0]
    expected = reflectivity * np.cos(np.deg2rad(points.incidence_deg)) / points.range**2
    np.testing.assert_allclose(points.intensity, expected, rtol=1e-5)
    limit = float(np.median(points.intensity))
    result = middle_pulses(replace(scan, setting=replace(scan.setting, threshold=limit)), 600)
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
    if divergence == 0.0:
        np.testing.assert_allclose(points.range, 60 / np.cos(np.deg2rad(points.scan_angle_deg)), rtol=1e-6)


def test_ranges_from_zero_to_past_the_maximum() -> None:
    for height, expected in ((2.0, 0), (60.0, 100), (2000.0, 0)):
        scan = scan_of(plane(20_000.0), path=Standing(height))
        assert len(middle_pulses(scan).points) == expected
    # Standing on the surface itself: no range, no point, no NaN.
    flat = scan_of(plane(), path=Standing(2.0), minimum_range=0.0)
    flat.path.platform = SimpleNamespace(height=0.0)
    assert np.isfinite(middle_pulses(flat).points.xyz).all()


def test_incidence_up_to_90_degrees() -> None:
    """A wall along the beam gives nothing, and no NaN; one almost along it gives a faint, finite echo."""
    wall = mesh_of([(0, -50, -50), (0, 50, -50), (0, 0, 50)], [(0, 1, 2)])
    points = middle_pulses(scan_of(wall, 7)).points
    assert np.isfinite(points.intensity).all()
    assert np.isfinite(points.xyz).all()
    grazing = plane(tilt_deg=89.9)
    points = middle_pulses(scan_of(grazing, 1, minimum_range=0.0), 2).points
    assert np.isfinite(points.intensity).all()


def test_dense_fog_leaves_no_point_and_no_nan() -> None:
    scan = replace(scan_of(plane(), 7), attenuation=0.2)
    thick = middle_pulses(replace(scan, setting=scanner_setting(load_scenario("rq31-600m").scan)))
    assert len(thick.points) == 0
    assert thick.below_threshold == 100
    clear = middle_pulses(replace(scan, attenuation=0.0)).points
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
