"""Images of boards over a plain: what moves, rolling shutters, blur and distortion, each by its law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.cameras.choice import CameraChoice
from synthroads_addon.scanning.cameras.exposures import Exposure, RigPoses, exposures_along
from synthroads_addon.scanning.cameras.rig import CameraRig, MountedCamera, load_rig
from synthroads_addon.scanning.cameras.sensor import encode_8_bit, linear_colours, sensed
from synthroads_addon.scanning.cameras.shooting import Image, Shooter
from synthroads_addon.scanning.cameras.sky import Surroundings
from synthroads_addon.scanning.colour.colour import LayerValues, SeenPoints
from synthroads_addon.scanning.colour.light import SunAndSky
from synthroads_addon.scanning.noise import Noise
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh
from synthroads_addon.scanning.strip_errors import StripErrors
from synthroads_addon.scanning.weather.conditions import Fog
from tests.helpers.scenes.scan_scenes import Standing, mesh_of, plane, scan_of

HEIGHT, FOCAL, SIDE = 50.0, 200.0, 120
"""Height of the camera, m; focal length, px; width and height of images, px."""
PIXEL = HEIGHT / FOCAL
"""Width of a pixel on the ground, m."""
DOWN = {"name": "down", "width": SIDE, "height": SIDE, "pixel_size_um": 10.0, "focal_length_mm": 2.0}
DOWN |= {"yaw_deg": 90.0, "pitch_deg": -90.0}  # its right is ahead, and its rows run along the flight


class Halves:
    """Source of colours: white where x is below 0, else black."""

    calls = None
    report = None

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        white = np.where(points.position[:, :1] < 0.0, 65_535, 0).astype(np.uint16)
        return LayerValues({"rgb": np.repeat(white, 3, axis=1)}, np.zeros(len(points), np.uint8))


def board(half: float = 5.0, at: float = 0.0):
    """Return a level square with the instance 7 at height 0, its middle at x = ``at``."""
    corners = [(at + x, y, 0.0) for x in (-half, half) for y in (-half, half)]
    return mesh_of(corners, [(0, 2, 3), (0, 3, 1)])


def shot(
    plan: ScanPlan,
    time: float = 0.0,
    source: object = None,
    camera: dict | None = None,
    surroundings: Surroundings | None = None,
    **choice,
) -> Image:
    """Return the image of a camera that looks down, at a time."""
    settings = CameraChoice.from_dict({"samples": 1, "noise": 0.0} | choice)
    rig = CameraRig.from_dict({"title": "t", "source": "s", "cameras": [DOWN | (camera or {})]})
    (mounted,) = settings.mounted(rig)
    poses = RigPoses(plan.path, np.eye(3), Noise(), StripErrors(), settings, 1)
    return Shooter(plan, settings, poses, source, surroundings).shoot(mounted, Exposure(0, plan.path.strips[0], time))


def middle_column(image: Image) -> float:
    """Return the mean column (px) of the pixels that show a board."""
    return float((np.nonzero(image.instance_id == 7)[1] + 0.5).mean())


def test_a_board_is_where_a_pinhole_sees_it() -> None:
    image = shot(scan_of(board(), path=Standing(HEIGHT)))
    rows, columns = np.nonzero(image.instance_id == 7)
    assert middle_column(image) == pytest.approx(SIDE / 2)
    assert np.ptp(columns) + 1 == np.ptp(rows) + 1 == round(10.0 / PIXEL)
    # Along the ray, not along the axis.
    aside = np.hypot(rows + 0.5 - SIDE / 2, columns + 0.5 - SIDE / 2) / FOCAL
    assert np.abs(image.depth[rows, columns] - HEIGHT * np.sqrt(1 + aside**2)).max() < 1e-4
    assert np.allclose(image.normal[rows, columns], [0, 0, 1])
    empty = image.instance_id == 0
    assert (image.class_id[empty] == UNLABELLED).all()
    assert not image.depth[empty].any()
    assert image.rgb is None


def test_what_moves_is_where_it_is_at_the_time_of_the_image() -> None:
    speed = 12.0
    moving = MovingMesh(replace(board(), origin=np.zeros(3)), LinearMotion((speed, 0.0, 0.0)))
    plan = scan_of(board(0.2, at=-400.0), path=Standing(HEIGHT), moving=[moving])
    for time in (0.0, 0.25, 0.5):
        assert middle_column(shot(plan, time)) == pytest.approx(SIDE / 2 + speed * time / PIXEL, abs=0.5)


@pytest.mark.parametrize("speed", [0.0, 40.0])
def test_a_rolling_shutter_slants_what_a_moving_camera_sees(speed: float) -> None:
    readout = 0.1
    plan = scan_of(board(), path=Standing(HEIGHT, speed))
    image = shot(plan, 0.0, camera={"readout_ms": readout * 1e3}, rolling_shutter=True)
    rows = np.flatnonzero((image.instance_id == 7).any(axis=1))
    edge = np.array([np.flatnonzero(image.instance_id[row] == 7)[0] for row in rows])
    # Row r is exposed at T ((r + 0.5) / H - 0.5): by then the camera has flown that far, and the board goes back.
    law = -speed * readout / SIDE / PIXEL
    assert np.polyfit(rows, edge, 1)[0] == pytest.approx(law, abs=0.02)
    still = shot(plan, 0.0, camera={"readout_ms": readout * 1e3})
    assert len({np.flatnonzero(still.instance_id[row] == 7)[0] for row in rows}) == 1


@pytest.mark.parametrize("blur", [True, False])
def test_an_edge_is_blurred_by_the_way_that_the_camera_goes(blur: bool) -> None:
    exposure, speed = 0.05, 60.0
    plan = scan_of(plane(), path=Standing(HEIGHT, speed))
    image = shot(plan, 0.0, Halves(), exposure_ms=exposure * 1e3, motion_blur=blur, samples=64)
    light = linear_colours((image.rgb[:, :, 0].astype(np.uint16)) * 257).mean(axis=0)
    # A box of the way's width: the light falls evenly over it, and by a pixel's own width.
    mean = np.sum((np.arange(SIDE - 1) + 1.0) * -np.diff(light))
    width = np.sqrt(12.0 * np.sum((np.arange(SIDE - 1) + 1.0 - mean) ** 2 * -np.diff(light)))
    assert mean == pytest.approx(SIDE / 2, abs=0.2)
    if blur:
        assert width == pytest.approx(speed * exposure / PIXEL, rel=0.06)  # 12 px
    else:
        assert width < 1.0


def test_distortion_bends_an_edge_as_its_formula_says() -> None:
    radial, tangential = [-0.3, 0.1], [0.004, -0.003]
    image = shot(scan_of(board(8.0), path=Standing(HEIGHT)), camera={"radial": radial, "tangential": tangential})
    bent = []
    for row in np.flatnonzero((image.instance_id == 7).any(axis=1))[3:-3]:
        edge = float(np.flatnonzero(image.instance_id[row] == 7)[0])
        # On the board's edge x is -8 / 50 in the plane at distance 1: find the y that is seen in this row.
        y = np.linspace(-0.3, 0.3, 20_001)
        x = np.full_like(y, -8.0 / HEIGHT)
        r2 = x * x + y * y
        factor = 1 + radial[0] * r2 + radial[1] * r2**2
        u = x * factor + 2 * tangential[0] * x * y + tangential[1] * (r2 + 2 * x * x)
        v = y * factor + tangential[0] * (r2 + 2 * y * y) + 2 * tangential[1] * x * y
        place = np.argmin(np.abs(v * FOCAL + SIDE / 2 - (row + 0.5)))
        bent.append(edge - (u[place] * FOCAL + SIDE / 2))
    # A column's middle lies on the board from the edge on: what is seen of it begins up to half a pixel to either side.
    assert np.abs(bent).max() <= 0.5 + 1 / 3
    straight = shot(scan_of(board(8.0), path=Standing(HEIGHT)))
    assert np.abs(image.depth - straight.depth).max() > 0.05


def test_images_are_the_same_by_any_number_of_threads() -> None:
    plan = scan_of(plane(60.0), path=Standing(HEIGHT, 20.0))
    options = {"exposure_ms": 5.0, "motion_blur": True, "samples": 5, "noise": 1.0}
    first, second = (
        shot(replace(plan, run=replace(plan.run, threads=threads)), 0.3, Halves(), **options) for threads in (1, 4)
    )
    assert np.array_equal(first.rgb, second.rgb)
    assert np.array_equal(first.depth, second.depth)


def test_noise_is_that_of_photons_and_of_reading() -> None:
    rig = CameraRig.from_dict(
        {"title": "t", "source": "s", "cameras": [DOWN | {"full_well": 8000.0, "read_noise": 12.0}]}
    )
    light = np.full((200_000, 3), 0.25, np.float32)
    read = sensed(light, rig.cameras[0], 1.0, 0.0, np.random.default_rng(1))
    assert read.std() == pytest.approx(np.sqrt(0.25 * 8000 + 12.0**2) / 8000, rel=0.01)
    assert np.array_equal(sensed(light, rig.cameras[0], 0.0, 1.0, np.random.default_rng(1)), 2 * light)
    assert encode_8_bit(np.array([0.0, 0.2122308, 1.0, 7.0])).tolist() == [0, 127, 255, 255]


def test_triggers_by_distance_and_time() -> None:
    path = Standing(HEIGHT, 8.0)  # for 75 s
    by_distance = exposures_along(path, CameraChoice.from_dict({"spacing": 12.0}))
    by_time = exposures_along(path, CameraChoice.from_dict({"trigger": "time", "interval": 2.5}))
    assert np.allclose(np.diff([exposure.time for exposure in by_distance]), 1.5)
    assert len(by_distance) == 51
    assert len(by_time) == 31
    assert len(exposures_along(Standing(HEIGHT, 0.0), CameraChoice())) == 1


def test_errors_of_mounting_are_those_that_are_told() -> None:
    choice = CameraChoice.from_dict({"boresight_sigma_deg": 0.3, "lever_arm_sigma": 0.05})
    rig = CameraRig.from_dict({"title": "t", "source": "s", "cameras": [DOWN, DOWN | {"name": "b"}]})
    poses = RigPoses(Standing(HEIGHT), np.eye(3), Noise(), StripErrors(), choice, 4)
    cameras: list[MountedCamera] = choice.mounted(rig)
    assert len({str(row["boresight_deg"]) for row in poses.error_report(cameras)}) == 2
    exposure = Exposure(0, poses.path.strips[0], 1.0)
    for camera, told in zip(cameras, poses.error_report(cameras), strict=True):
        true, measured = poses.true_pose(camera, exposure), poses.measured_pose(camera, exposure)
        shift = true.rotation.T @ (measured.position - true.position)
        assert np.abs(shift - told["lever_arm"]).max() < 1e-6
        turn = true.rotation.T @ measured.rotation
        small = np.rad2deg([turn[2, 1], turn[0, 2], turn[1, 0]])
        assert np.abs(small - told["boresight_deg"]).max() < 5e-3


@pytest.mark.parametrize("visibility", [100.0, 400.0])
def test_fog_veils_pictures_by_the_distance_of_each_pixel_and_leaves_the_truth(visibility: float) -> None:
    """Koschmieder's law: of the difference between white and black a share exp(-extinction x distance) is left."""
    plan, extinction = scan_of(board(), path=Standing(HEIGHT)), Fog(visibility=visibility).extinction(550.0)
    fog, none = (Surroundings(SunAndSky(), 0.0, value) for value in (extinction, 0.0))
    foggy, clear = (shot(plan, 0.0, Halves(), surroundings=place, auto_exposure=False) for place in (fog, none))
    for name in ("depth", "normal", "class_id", "instance_id"):
        assert np.array_equal(getattr(foggy, name), getattr(clear, name))
    seen = clear.depth > 0.0
    before, after = (linear_colours(image.rgb[seen].astype(np.uint16) * 257) for image in (clear, foggy))
    left = np.exp(-extinction * clear.depth[seen])[:, None]
    assert np.abs(after - (left * before + (1.0 - left) * fog.air)).max() < 0.005
    assert np.ptp(before) > 0.99
    assert np.ptp(after) == pytest.approx(np.exp(-extinction * HEIGHT), abs=0.02)


def test_a_rolling_shutter_that_no_camera_has_is_refused() -> None:
    """Else the setting would change nothing, without a word."""
    with pytest.raises(InputError, match="readout_ms in a rig file of your own"):
        CameraChoice(rolling_shutter=True).mounted(load_rig("dji-p1"))
