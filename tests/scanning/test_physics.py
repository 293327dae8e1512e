"""Ranges without bias, returns of known scenes, motion and noise: blocks of pulses against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.knots import Track
from synthroads_addon.scanning.noise import Noise
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh
from synthroads_addon.scanning.trace import trace
from synthroads_addon.scanning.weather.conditions import Fog
from tests.helpers.scenes.scan_scenes import (
    ORIGIN,
    Standing,
    altered,
    beam_rays,
    echoes_and_pulses,
    mesh_of,
    middle_pulses,
    plane,
    scan_block,
    scan_of,
    scan_pulses,
    upright,
)


def gaussian_mean(scan: ScanPlan, angle: float, slope: tuple[float, float], height: float) -> float:
    """Return the mean range over a Gaussian footprint on the plane z = a x + b y - height, by 2D Gauss-Hermite nodes.

    The beam leaves the origin, ``angle`` right of the nadir while heading along x.
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    sigma = np.tan(np.array(scan.setting.divergence) / 2.0) / 2.0
    x, y = np.meshgrid(nodes * sigma[0], nodes * sigma[1], indexing="ij")
    weight = np.outer(weights, weights) / weights.sum() ** 2
    # Scan plane: down and right (-y); across it: forward (x). The in-plane axis is the direction's derivative.
    down, right, forward = np.cos(angle) - x * np.sin(angle), np.sin(angle) + x * np.cos(angle), y
    distance = height * np.sqrt(1.0 + x * x + y * y) / (down + slope[0] * forward - slope[1] * right)
    return float((weight * distance).sum())


@pytest.mark.parametrize("rays", [7, 19, 37, 61])
@pytest.mark.parametrize("divergence", [0.5e-3, 2e-3])
@pytest.mark.parametrize("height", [10.0, 100.0, 300.0])
def test_mean_over_all_returns_is_that_of_the_footprint(rays: int, divergence: float, height: float) -> None:
    """Planes tilted 0 to 75 degrees either way, with the device's own resolution: a pulse may have several returns."""
    several = 0
    for tilt in (0.0, 30.0, 60.0, 75.0):
        for along in (False, True):
            steep = np.tan(np.deg2rad(tilt))
            slope = (steep, 0.0) if along else (0.0, steep)
            scan = scan_of(
                plane(slope=slope), rays, Standing(height), divergence=(divergence, divergence), minimum_range=0.0
            )
            scan = altered(scan, setting=replace(scan.setting, maximum_range=5e4))
            echoes, pulses = echoes_and_pulses(scan, 499, 2)
            several += len(echoes.pulse) > 2
            for pulse in range(2):
                mine = echoes.pulse == pulse
                mean = float((echoes.range[mine] * echoes.weight[mine]).sum() / echoes.weight[mine].sum())
                expected = gaussian_mean(scan, float(pulses.scan_angle[pulse]), slope, height)
                assert mean == pytest.approx(expected, abs=1e-3)
    if divergence == 2e-3 and height == 300.0 and rays == 7:
        assert several  # else the case of several returns was never seen


def test_a_tilted_plane_converges_with_rays_per_pulse() -> None:
    """One ray misses the mean of a slanted footprint by the variance; seven have it."""
    slope, errors = (0.0, np.tan(np.deg2rad(70.0))), {}
    for rays in (1, 7, 19):
        scan = scan_of(plane(slope=slope), rays, Standing(100.0), divergence=(5e-3, 5e-3), range_resolution=9.0)
        echoes, pulses = echoes_and_pulses(scan, 500, 1)
        errors[rays] = abs(float(echoes.range[0]) - gaussian_mean(scan, float(pulses.scan_angle[0]), slope, 100.0))
    assert errors[1] > 1e-3
    assert errors[7] < 1e-5
    assert errors[19] < 1e-6


# --- footprint ------------------------------------------------------------------------------------------------------


def footprint(scan: ScanPlan) -> tuple[float, float]:
    """Return the widths at 1/e^2 on the ground, in the scan plane and across it, from the rays' own second moments."""
    _, pulses = echoes_and_pulses(scan, 500, 1)
    rays = beam_rays(scan, pulses)
    reach = -rays.origin[2] / rays.direction[2]
    ground = (rays.origin + reach * rays.direction)[:, :, 0]
    middle = (ground * rays.share[:, 0]).sum(axis=1, keepdims=True)
    sigma = np.sqrt(((ground - middle) ** 2 * rays.share[:, 0]).sum(axis=1))
    return 4.0 * sigma[1], 4.0 * sigma[0]


def test_footprint_of_the_minivux_at_100_m() -> None:
    """1.6 x 0.5 mrad: 160 x 50 mm, the four-sigma widths of the Gaussian beam."""
    scan = scan_of(plane(), 19, Standing(100.0))
    assert footprint(scan) == pytest.approx((0.160, 0.050), rel=1e-3)
    assert footprint(altered(scan, beam="cylindrical")) == pytest.approx((0.160, 0.050), rel=1e-3)


def test_a_cone_widens_behind_a_step_and_a_cylinder_does_not() -> None:
    """A grating 50 m up is hit by the central ray; the ground below sees the footprint of the beam's model."""
    bar = [(-0.1, -0.1, 50), (0.1, -0.1, 50), (0.1, 0.1, 50), (-0.1, 0.1, 50)]
    ground = [(-500, -500, 0), (500, -500, 0), (500, 500, 0), (-500, 500, 0)]
    mesh = mesh_of(bar + ground, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    cone = scan_of(mesh, 19, Standing(100.0), divergence=(10e-3, 10e-3))
    assert footprint(cone)[0] == pytest.approx(1.0, rel=1e-2)
    assert footprint(altered(cone, beam="cylindrical"))[0] == pytest.approx(0.5, rel=1e-2)


# --- returns --------------------------------------------------------------------------------------------------------


def test_a_pole_before_a_wall() -> None:
    """A pole of 10 cm, 20 m before a wall, scanned sideways: the beam of 0.25 m splits."""
    pole = [(-0.05, -30, 55), (0.05, -30, 55), (0.05, -30, 65), (-0.05, -30, 65)]
    back = [(-50, -50, 0), (50, -50, 0), (50, -50, 200), (-50, -50, 200)]
    mesh = mesh_of(pole + back, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    scan = scan_of(mesh, 61, divergence=(8e-3, 8e-3))
    points = scan_pulses(scan, scan.path.strips[0], 999, 1).points  # the last pulse of a line looks right, almost level
    assert points.number_of_returns.tolist() == [2, 2]
    np.testing.assert_allclose(points.range, [30.0, 50.0], atol=0.01)
    assert points.return_number.tolist() == [1, 2]


def leaf_scan(transmission: float, layers: int = 1, rays: int = 7, **changes) -> ScanPlan:
    """Return a scan of leaf layers 2 m apart, from 4 m up, above asphalt."""
    levels = [0.0, *(4.0 + 2.0 * i for i in range(layers))]
    corners = [(x, y, z) for z in levels for x, y in ((-90, -90), (90, -90), (90, 90), (-90, 90))]
    faces = [(4 * i + a, 4 * i + b, 4 * i + c) for i in range(len(levels)) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    mesh = mesh_of(corners, faces)
    mesh = replace(mesh, material=np.repeat([0, 1], [2, 2 * layers]).astype(np.uint16), materials=("asphalt", "leaves"))
    scan = scan_of(mesh, rays, **changes)
    even = materials()["leaves"].model_copy(update={"transmission": transmission, "gap_size": 0.0})
    rows = [materials()["asphalt"], even]
    return altered(scan, surfaces=surfaces_of(rows))


def test_a_leaf_layer_above_the_ground() -> None:
    """Every pulse sees the leaf and, through it, the ground: with the shares that the leaf takes and lets through."""
    scan = leaf_scan(0.3)
    points = middle_pulses(scan, 50).points
    assert set(points.number_of_returns) == {2}
    leaf, ground = points.select(points.return_number == 1), points.select(points.return_number == 2)
    np.testing.assert_allclose(leaf.xyz[:, 2] - ORIGIN[2], 4.0, atol=2e-3)
    np.testing.assert_allclose(ground.xyz[:, 2] - ORIGIN[2], 0.0, atol=2e-3)
    bright = scan.reflection.surfaces.reflectivity
    cosine = np.cos(np.deg2rad(leaf.incidence_deg))
    np.testing.assert_allclose(leaf.intensity, 0.7 * bright[1] * cosine / leaf.range**2, rtol=1e-4)
    np.testing.assert_allclose(ground.intensity, 0.3 * bright[0] * cosine / ground.range**2, rtol=1e-4)
    opaque = middle_pulses(leaf_scan(0.0), 50).points
    assert set(opaque.number_of_returns) == {1}


def test_never_more_returns_than_the_device_records() -> None:
    scan = leaf_scan(0.8, layers=7)
    maximum = scan.setting.device.maximum_returns
    points = middle_pulses(scan, 50).points
    assert points.number_of_returns.max() == maximum == 5
    assert points.return_number.max() == maximum
    for time in np.unique(points.gps_time):
        mine = points.return_number[points.gps_time == time]
        assert mine.tolist() == list(range(1, len(mine) + 1))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12),
    st.sampled_from([1, 7, 19]),
    st.floats(0.0, 30.0),
)
def test_shares_never_exceed_what_was_emitted(transmissions: list[float], rays: int, minimum: float) -> None:
    """Layers of any transparency, one behind the other: along each ray, and over the pulse, shares sum to at most 1."""
    count = len(transmissions)
    corners = [(x, y, -5.0 * i) for i in range(count) for x, y in ((-90, -90), (90, -90), (0, 150))]
    mesh = mesh_of(corners, np.arange(3 * count).reshape(-1, 3))
    mesh = replace(mesh, material=np.arange(count, dtype=np.uint16), materials=("leaves",) * count)
    scan = scan_of(mesh, rays)
    leaf = materials()["leaves"]
    surfaces = surfaces_of(leaf.model_copy(update={"transmission": value}) for value in transmissions)
    _, pulses = echoes_and_pulses(scan, 499, 2)
    emitted = beam_rays(scan, pulses)
    traced = trace(scan.target, surfaces, emitted, [], minimum, 1e4)
    first = np.where(np.isfinite(traced.first.distance), traced.first.share, 0.0)
    assert min(first.min(), traced.behind.share.min(initial=0.0)) >= 0.0
    assert (first <= emitted.share).all()
    taken = first.sum(axis=0) + np.bincount(traced.pulse, traced.behind.share, minlength=2)
    assert (taken <= 1.0 + 1e-12).all()
    if minimum == 0.0 and transmissions[0] == 0.0:
        assert taken == pytest.approx(1.0)


def test_weather_thins_far_and_dark_points_as_the_threshold_says() -> None:
    """Asphalt to one side, paint to the other: what is recorded ends where the laser equation meets the threshold."""
    corners = [(x, y, 0) for y in (-500, 0, 500) for x in (-500, 500)]
    mesh = mesh_of(corners, [(0, 1, 3), (0, 3, 2), (2, 3, 5), (2, 5, 4)])
    names = ("asphalt", "concrete")
    mesh = replace(mesh, material=np.array([0, 0, 1, 1], dtype=np.uint16), materials=names)
    widths = {}
    for visibility in (23_000.0, 1_000.0, 300.0):
        extinction = Fog(visibility=visibility).attenuation(905.0)
        scan = altered(scan_of(mesh, threshold=0.2 / 113.0**2), attenuation=extinction)
        points = scan_pulses(scan, scan.path.strips[0], 0, 1000).points
        for side, name in ((-1.0, "asphalt"), (1.0, "concrete")):
            y = points.xyz[:, 1] - ORIGIN[1]
            mine = np.abs(y[np.sign(y) == side])
            distance = np.hypot(60.0, grid := np.linspace(0.0, 499.0, 200_000))
            bright = materials()[name].reflectivity * 60.0 / distance**3 * np.exp(-extinction * distance)
            reached = grid[bright >= scan.setting.threshold]
            assert len(mine) == (0 if not len(reached) else np.count_nonzero(ground_points() <= reached.max()))
            widths[visibility, name] = len(mine)
    assert widths[23_000.0, "concrete"] > widths[23_000.0, "asphalt"] > widths[1_000.0, "asphalt"] > 0
    assert widths[1_000.0, "concrete"] > widths[300.0, "concrete"]


def ground_points() -> np.ndarray:
    """Return the distances from the nadir, on one side, of a line's points on flat ground 60 m below."""
    return 60.0 * np.tan(np.deg2rad((np.arange(500) + 0.5) * 0.18))


# --- motion ---------------------------------------------------------------------------------------------------------


def box(class_id: int, instance: int = 7) -> SceneMesh:
    """Return a box of 4 x 2 x 1.5 m that stands on the ground and has no bottom."""
    mesh = mesh_of(
        [(x, y, z) for x in (-2.0, 2.0) for y in (-1.0, 1.0) for z in (0.0, 1.5)],
        [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (1, 5, 7), (1, 7, 3)],
    )
    return replace(mesh, class_id=np.full(10, class_id, np.uint8), instance_id=np.full(10, instance, np.uint32))


@pytest.mark.parametrize("rays", [1, 7])
def test_a_moving_box_unwarped_by_its_points_times_is_the_box(rays: int) -> None:
    """A box drives at 30 m/s below a scanner that flies at 8: its points, brought back by their times, lie on it."""
    velocity = np.array([-30.0, 0.5, 0.0])
    moving = MovingMesh(box(14), LinearMotion(velocity, place=(3.0, 0.0, 0.0)))
    scan = scan_of(plane(), rays, Standing(60.0, speed=8.0), moving=[moving])
    points = scan_pulses(scan, scan.path.strips[0], 0, 30_000).points
    mine = points.select(points.class_id == 14)
    assert len(mine) > 100
    own = mine.xyz - ORIGIN - (velocity * mine.gps_time[:, None] + (3.0, 0.0, 0.0))
    outside = np.abs(own - (0.0, 0.0, 0.75)) - (2.0, 1.0, 0.75)
    if rays == 1:
        assert np.abs(outside.max(axis=1)).max() < 1e-3
        assert not (points.select(points.class_id == 1).xyz[:, 2] - ORIGIN[2] > 1e-6).any()
    else:  # a return at an edge is the mean of several faces
        assert np.median(np.abs(outside.max(axis=1))) < 1e-3
    warped = np.abs(mine.xyz - ORIGIN - (3.0, 0.0, 0.75)) - (2.0, 1.0, 0.75)
    assert np.abs(warped.max(axis=1)).max() > 0.5  # motion distortion is there to be undone


@pytest.mark.parametrize("driven", [True, False])
def test_nothing_drives_through_the_scanner_s_own_vehicle(driven: bool) -> None:
    """One box catches up with a scanner 1 m above the road in its lane, another one in the lane beside it."""
    lanes = {1: 0.0, 2: 3.5}
    moving = [
        MovingMesh(box(14, lane), LinearMotion((28.0, 0.0, 0.0), place=(-7.0, y, 0.0))) for lane, y in lanes.items()
    ]
    scan = altered(scan_of(plane(), path=Standing(1.0, 20.0), moving=moving, minimum_range=0.1), on_vehicle=driven)
    points = scan_pulses(scan, scan.path.strips[0], 0, 150_000).points
    seen = {lane: points.gps_time[points.instance_id == lane] for lane in lanes}
    if not driven:
        assert len(seen[1]) > 20_000  # all around, from inside
        return
    assert len(seen[1]) == 0
    assert len(seen[2]) > 1000
    # It is beside the scanner while it gains 5 to 9 m, at 8 m/s.
    assert (seen[2].min(), seen[2].max()) == pytest.approx((5.0 / 8.0, 9.0 / 8.0), abs=0.02)


class Parked:
    """A body that stands turned about z."""

    def __init__(self, angle: float, place: np.ndarray) -> None:
        (self.rotation,), self.place = upright(np.array([angle])), place

    def pose(self, time):
        count = len(time)
        return np.tile(self.rotation, (count, 1, 1)), np.tile(self.place, (count, 1)), np.ones(count, dtype=bool)


def test_the_scanner_s_vehicle_takes_up_a_box_in_the_other_one_s_frame() -> None:
    """Whichever way that is turned: half a box of 4 x 2 x 1.5 m, and 2.5 x 1 x 3 m for the scanner's vehicle."""
    source = np.random.default_rng(5)
    room = np.array([4.5, 2.0, 3.75])
    for own in source.uniform(-1.3, 1.3, (300, 3)) * room:
        body = Parked(source.uniform(0.0, 2.0 * np.pi), source.uniform(-50.0, 50.0, 3))
        scanner = body.rotation @ (own + (0.0, 0.0, 0.75)) + body.place
        driven = Track.between(Parked(1.0, scanner).pose, 0.0, 0.1, 0.01)
        target = scan_of(plane(), moving=[MovingMesh(box(14), body)]).target
        (track,) = target.motions(0.0, 0.1, 0.01, driven)
        assert (track.present == (np.abs(own) > room).any()).all()


# --- noise ----------------------------------------------------------------------------------------------------------


def test_dropouts_lose_their_share_and_returns_stay_numbered() -> None:
    scan = leaf_scan(0.5)
    all_points = middle_pulses(scan, 400).points
    some = middle_pulses(altered(scan, noise=Noise(dropout=0.25)), 400).points
    assert len(some) / len(all_points) == pytest.approx(0.75, abs=0.06)
    kept = np.isin(some.gps_time, all_points.gps_time)
    assert kept.all()
    for time in np.unique(some.gps_time):
        mine = some.number_of_returns[some.gps_time == time]
        assert set(mine) == {len(mine)}
    assert len(middle_pulses(altered(scan, noise=Noise(dropout=1.0)), 400).points) == 0


def test_range_bias_and_pointing_errors_move_the_point_and_not_the_truth() -> None:
    scan = scan_of(plane())
    calm = middle_pulses(scan, 400).points
    biased = middle_pulses(altered(scan, noise=Noise(range_bias=0.05)), 400).points
    np.testing.assert_allclose(biased.range - calm.range, 0.05, atol=1e-12)
    np.testing.assert_array_equal(biased.true_range, calm.range)
    shaken = scan_block(altered(scan, noise=Noise(angle_sigma_mrad=1.0)), scan.path.strips[0], 0).points
    quiet = scan_block(scan, scan.path.strips[0], 0).points
    np.testing.assert_array_equal(shaken.true_xyz, quiet.xyz)
    off = (shaken.xyz - quiet.xyz) / quiet.range[:, None]
    middle = np.abs(quiet.scan_angle_deg) < 5.0
    assert off[middle, 0].std() == pytest.approx(1e-3, rel=0.02)
    assert off[middle, 1].std() == pytest.approx(1e-3, rel=0.02)


def test_platform_errors_have_their_size_and_the_truth_is_kept() -> None:
    scan = scan_of(plane(), path=Standing(60.0, speed=8.0))
    noise = Noise(position_sigma=0.03, correlation_time=0.002)
    shaken = scan_pulses(altered(scan, noise=noise), scan.path.strips[0], 0, 200_000).points
    calm = scan_pulses(scan, scan.path.strips[0], 0, 200_000).points
    np.testing.assert_array_equal(shaken.true_xyz, calm.xyz)
    # 2 s are 1000 correlation times: the spread is known to 1 / sqrt(1000).
    assert (shaken.xyz - calm.xyz).std(axis=0) == pytest.approx(np.full(3, 0.03), rel=0.1)
    on_ground = calm.true_xyz[:, 2] - ORIGIN[2]
    assert np.abs(on_ground).max() < 1e-4
