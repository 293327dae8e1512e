"""A sensor calibrated on a cloud is the one that measured it: response, noise and spacing, within stated tolerances.

Clouds come from the scanner itself: a level plane, in part of paint, measured by a device whose values are known.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.calibration.expected import ReceiverModel, receiver_of_device
from synthroads_addon.calibration.sensor import estimate_sensor, number_bits
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.selection.classes import RealClass
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials, read_material_table
from synthroads_addon.scanning.devices.device import load_device
from synthroads_addon.scanning.parts.emission import Emission
from synthroads_addon.scanning.parts.reception import Reception
from synthroads_addon.scanning.parts.reflection import Reflection
from synthroads_addon.scanning.parts.run import Run
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from synthroads_addon.scanning.receiving.response import read_power
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scanning.scene.target import Target
from synthroads_addon.scanning.strip_errors import strip_gain
from synthroads_addon.scanning.sway import with_motion
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.clouds.calibration_cloud import stored, write_las
from tests.helpers.scenes.scan_scenes import ORIGIN, BruteForce, mesh_of
from tests.helpers.scenes.scanners import preset

LENGTH, HALF, PAINT = 40.0, 12.0, 3.0
ASPHALT_LABEL, PAINT_LABEL = 40, 60


def striped_plane() -> SceneMesh:
    """Return level asphalt with a wide band of paint along its left side, which is marked by its instance."""
    ends = (-20.0, LENGTH + 20.0)
    corners = [(x, y, 0.0) for y in (-HALF, HALF - PAINT, HALF) for x in ends]
    mesh = mesh_of(corners, [(0, 1, 3), (0, 3, 2), (2, 3, 5), (2, 5, 4)])
    part = np.array([0, 0, 1, 1], dtype=np.uint16)
    label = np.array([ASPHALT_LABEL, PAINT_LABEL], dtype=np.uint32)[part]
    return replace(mesh, material=part, materials=("asphalt", "paint_white"), instance_id=label)


def measured(scenario: str, changes: list[str], reflection: str = "lambert") -> tuple[PointBlock, ScanPlan]:
    """Return a scan of the plane by a scenario's scanner along its middle."""
    scan = load_scenario(scenario, changes).scan
    mesh = striped_plane()
    guide = PolylineGuide(np.array([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]]))
    rows = [materials()[name] for name in mesh.materials]
    plan = ScanPlan(
        target=Target(ScannedScene(mesh, ()), BruteForce),
        emission=Emission(scanner_setting(scan), with_motion(scan.platform.make_path(guide), scan.motion, 5), rings=()),
        reflection=Reflection(surfaces_of(rows, reflection)),  # type: ignore[arg-type]
        run=Run(seed=5),
        reception=Reception(scan.noise, scan.strip_errors),
    )
    stages = BlockScan(plan)
    return concatenate([stages.scan_block(*block).points for block in plan.blocks()]), plan


AIRBORNE = [
    *("scan.pulse_rate_khz=700", "scan.lines_per_second=170", "scan.field_of_view_deg=8", "scan.mirror_clock=free"),
    *("scan.platform.height=800", "scan.platform.lateral_offsets=[-15,15]", "scan.motion.attitude_sigma_deg=0.02"),
    *("scan.noise.range_sigma=0.02", "scan.noise.speckle=0.17", "scan.strip_errors.gain_sigma_db=1.5"),
    *("scan.receiver.threshold_to_noise=6", "scan.receiver.faint_range_sigma=0.08", "scan.receiver.range_walk=0.003"),
]


SWAYING = [
    *("scan.motion.attitude_sigma_deg=0.2", "scan.motion.position_sigma=0.4", "scan.motion.shortest_period=0.05"),
    *("scan.motion.longest_period=20", "scan.motion.period_exponent=0.5"),
]


@pytest.fixture(scope="module")
def airborne(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ScanPlan]:
    """Write a cloud of two strips from the air, as linear numbers."""
    points, plan = measured("airborne-1000m-even", AIRBORNE)
    path = tmp_path_factory.mktemp("airborne") / "cloud.las"
    number = points.intensity / points.intensity.max() * 60_000.0
    return write_las(path, points.xyz, number, points.instance_id, points.gps_time), plan


def calibrated(capsys: pytest.CaptureFixture[str], cloud: Path, folder: Path, *words: str) -> dict[str, Any]:
    """Return the sensor that a command fits to a cloud's asphalt and paint."""
    told = ["--material", f"asphalt={ASPHALT_LABEL}", "--material", f"paint_white={PAINT_LABEL}"]
    files = ["--save-device", str(folder / "device.json"), "--save-recipe", str(folder / "recipe.yaml"), "--formulas"]
    asked = ["calibrate", "--real", str(cloud), "--class-field", "label", *told, *words, *files, "--json"]
    assert main(asked) == 0
    return dict(json.loads(capsys.readouterr().out)["sensor"])


def test_an_airborne_sensor_is_found_again(
    airborne: tuple[Path, ScanPlan], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud, plan = airborne
    words = ("--device", "riegl-vq-780i", "--range", "800", "--hold", "asphalt")
    found = calibrated(capsys, cloud, tmp_path, *words)["estimate"]
    assert found["range_sigma"] == pytest.approx(0.02, rel=0.12)
    power = materials()["asphalt"].reflectivity / 800.0**2 / plan.setting.threshold
    gains = [10.0 * np.log10(strip_gain(plan.reception.strip_errors, plan.run.seed, strip)) for strip in (0, 1)]
    # Brighter strips are ranged better: the mean of both strips' variances.
    brighter = np.sqrt(np.mean(10.0 ** (-2.0 * np.array(gains) / 10.0)))
    # How the noise is divided between its two parts scatters, by 0.67 to 1.06 over eight seeds; the sum hardly does.
    faint = 0.08 / power * brighter
    assert found["faint_range_sigma"] == pytest.approx(faint, rel=0.35)
    assert np.hypot(found["range_sigma"], found["faint_range_sigma"]) == pytest.approx(np.hypot(0.02, faint), rel=0.08)
    assert found["range_walk"] == pytest.approx(0.003, rel=0.3)
    noise = 1.0 / (6.0 * power)
    assert found["speckle"] == pytest.approx(np.hypot(0.17, noise), rel=0.1)
    assert found["gain_step_db"] == pytest.approx(abs(gains[0] - gains[1]), abs=0.15)
    assert found["strips"] == 2
    assert found["pulse_spacing"] == pytest.approx(800.0 * plan.setting.angle_step, rel=0.05)


def test_without_times_pairs_of_points_tell_strips_and_what_parts_them() -> None:
    """How many overlap, the gain's step within 0.2 dB, what is left to single echoes, and how they are ranged by it."""
    points, plan = measured("airborne-1000m-even", [*AIRBORNE, *SWAYING])
    asphalt = points.select(np.flatnonzero(points.instance_id == ASPHALT_LABEL))
    power, none = asphalt.intensity * 800.0**2, np.zeros(len(asphalt))
    road = RealClass("", asphalt.xyz, power, 0, none, none, none.astype(np.uint8))
    found = estimate_sensor(road, power, np.array([800.0]), np.array([0.0]))
    gains = [10.0 * np.log10(strip_gain(plan.reception.strip_errors, plan.run.seed, strip)) for strip in (0, 1)]
    assert found.strips == 2
    assert found.gain_step_db == pytest.approx(abs(gains[0] - gains[1]), abs=0.2)
    noise = 1.0 / (6.0 * materials()["asphalt"].reflectivity / 800.0**2 / plan.setting.threshold)
    assert found.speckle == pytest.approx(np.hypot(0.17, noise), rel=0.15)
    assert found.range_walk == pytest.approx(0.003, rel=0.4)


def test_a_table_for_the_recipe_leaves_the_sensors_noise_to_the_sensor(
    airborne: tuple[Path, ScanPlan], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The plane is even: the fit gives its asphalt all that varies, the recipe's table hardly anything."""
    cloud, _ = airborne
    spreads = []
    for name, more in (("alone", []), ("beside", ["--save-recipe", str(tmp_path / "r.yaml")])):
        files = [
            "--save",
            str(tmp_path / f"{name}.json"),
            "--save-device",
            str(tmp_path / f"{name}-device.json"),
            "--formulas",
            *more,
        ]
        words = ["--class-field", "label", "--material", f"asphalt={ASPHALT_LABEL}", "--device", "riegl-vq-780i"]
        assert main(["calibrate", "--real", str(cloud), *words, "--range", "800", "--quiet", *files]) == 0
        spreads.append(read_material_table(tmp_path / f"{name}.json")["asphalt"].spread_below)
    assert spreads[0] > 0.2
    assert spreads[1] < 0.1


def test_a_delay_of_the_ranges_is_found_again() -> None:
    rng = np.random.default_rng(4)
    late = 0.5 * (rng.exponential(1.0, 60_000) - 1.0) + np.sqrt(0.75) * rng.standard_normal(60_000)
    place, none = np.column_stack([rng.uniform(0, 55, (60_000, 2)), -0.02 * late]), np.zeros(60_000)
    road = RealClass("", place, none + 1.0, 0, none, none, none.astype(np.uint8))
    found = estimate_sensor(road, 10.0 ** rng.normal(0, 0.05, 60_000), np.array([800.0]), np.array([0.0]))
    assert found.range_delay == pytest.approx(0.5, rel=0.1)


def test_the_written_device_and_recipe_scan_as_the_cloud_was_measured(
    airborne: tuple[Path, ScanPlan], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Density within 15 %, range noise of echoes as bright as asphalt within 10 %."""
    cloud, _ = airborne
    words = ("--device", "riegl-vq-780i", "--range", "800", "--hold", "asphalt")
    found = calibrated(capsys, cloud, tmp_path, *words)["estimate"]
    recipe = load_recipe(str(tmp_path / "recipe.yaml"))
    scan = scene_jobs(recipe)[0].scenario.scan
    setting = scanner_setting(scan)
    height, speed = scan.platform.height, scan.platform.speed
    strips = len(scan.platform.lateral_offsets)
    density = strips / (height * setting.angle_step * speed / setting.lines_per_second)
    assert density == pytest.approx(found["density"], rel=0.15)
    device = load_device(str(tmp_path / "device.json"))
    assert device.receiver.faint_range_sigma == pytest.approx(0.08, rel=0.35)
    assert setting.device == device
    speckles = {job.scenario.scan.noise.speckle for job in scene_jobs(recipe)}
    assert len(speckles) == 8
    assert all(abs(value / found["speckle"] - 1.0) < 0.06 for value in speckles)


def test_numbers_that_are_compensated_for_the_range_come_from_a_device_that_compensates_them(
    airborne: tuple[Path, ScanPlan], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A strip that is seen aslant is farther away: its numbers would else be lower than the search had them."""
    points, _ = measured("airborne-1000m-even", AIRBORNE)
    compensated = points.intensity * points.range.astype(np.float64) ** 2
    numbers = stored(compensated, 100.0, 30.0)
    cloud = write_las(tmp_path / "cloud.las", points.xyz, numbers, points.instance_id, points.gps_time)
    words = ("--device", "riegl-vq-780i", "--range", "800", "--hold", "asphalt")
    calibrated(capsys, cloud, tmp_path, *words, "--range-corrected", "--decibels", "30")
    scan = scene_jobs(load_recipe(str(tmp_path / "recipe.yaml")))[0].scenario.scan
    setting, distance = scanner_setting(scan), np.array([800.0, 850.0])
    asphalt = materials()["asphalt"].reflectivity / distance**2
    near, far = read_power(asphalt, distance, None, np.ones(256), setting)[0]
    assert far == pytest.approx(near, rel=1e-3)
    # What fills 30 dB is ten times as bright as a white target here, and no number is rounded by more than 0.01 dB.
    assert near * setting.receiver.full_scale == pytest.approx(materials()["asphalt"].reflectivity, rel=2e-3)
    assert setting.receiver.full_scale == pytest.approx(10.0, rel=0.15)


STANDING = {"kind": "tripod", "stations": [20], "turn_seconds": 0.1, "turn_deg": 0, "height": 1.73}
HEAD = [
    *("scan.device=velodyne-hdl-64e", "scan.pulse_rate_khz=1333.333", "scan.lines_per_second=10"),
    *("scan.noise.range_sigma=0.015", "scan.noise.speckle=0.3", "scan.receiver.gain_sigma_db=0"),
    *("scan.receiver.lost_numbers=0.08", "scan.reflection=oren_nayar", "scan.receiver.compression=0.4"),
    f"scan.platform={json.dumps(STANDING | {'lateral_offsets': [0]})}",
]


def test_a_heads_compression_zeros_noise_and_spacing_are_found_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points, plan = measured("tripod-200m-even", HEAD, "oren_nayar")
    cloud = write_las(tmp_path / "sweep.las", points.xyz, points.intensity * 65_535.0, points.instance_id)
    place = ",".join(str(value) for value in ORIGIN + np.array([20.0, 0.0, 1.73]))
    words = ("--device", "velodyne-hdl-64e", "--device-response", f"--scanner={place}", "--reflection", "oren_nayar")
    found = calibrated(capsys, cloud, tmp_path, *words, "--hold", "asphalt", "--fit", "compression")
    assert found["receiver"]["compression"] == pytest.approx(0.4, rel=0.1)
    assert found["receiver"]["full_scale"] == pytest.approx(6.0, rel=0.25)
    assert found["receiver"]["lost_numbers"] == pytest.approx(0.08, abs=0.02)
    assert found["receiver"]["bits"] == 8
    estimate = found["estimate"]
    assert estimate["azimuth_step"] == pytest.approx(plan.setting.angle_step, rel=0.02)
    assert estimate["range_sigma"] == pytest.approx(0.015, rel=0.15)
    assert estimate["speckle"] == pytest.approx(0.3, rel=0.2)
    assert scanner_setting(scene_jobs(load_recipe(str(tmp_path / "recipe.yaml")))[0].scenario.scan)


def test_a_model_of_the_devices_response_leads_numbers_back_to_power() -> None:
    model = receiver_of_device(preset("velodyne-hdl-64e"), 0.0)
    assert model.range_corrected
    assert model.compression == 0.3
    assert model.pedestal == pytest.approx(4.0 * 0.2 / 120.0**2)
    values = np.array([10.0, 2000.0, 60_000.0])
    np.testing.assert_allclose(model.to_linear(model.to_stored(values)), values)
    # The pedestal's share of what is compensated for the range grows with its square.
    assert model.at_range(np.array([0.2]), np.array([10.0]))[0] == pytest.approx(0.2 - model.pedestal * 100.0)
    logarithmic = replace(preset("velodyne-hdl-64e"), receiver=preset("velodyne-hdl-64e").receiver.model_copy())
    assert receiver_of_device(logarithmic, 0.0) == model
    assert ReceiverModel().at_range(np.array([1.0]), np.array([2.0]))[0] == 0.25
    hazy = ReceiverModel(attenuation=0.01, range_corrected=True)
    assert hazy.at_range(np.array([1.0]), np.array([100.0]))[0] == pytest.approx(np.exp(-1.0))


@pytest.mark.parametrize(("bits", "found"), [(6, 6), (8, 8), (12, 12), (16, None)])
def test_bits_of_numbers(bits: int, found: int | None) -> None:
    steps = 2**bits - 1
    numbers = np.rint(np.random.default_rng(1).random(50_000) * steps) / steps * 65_535.0
    assert number_bits(np.rint(numbers)) == found


def test_without_times_two_strips_are_told_by_the_two_peaks_of_their_brightness() -> None:
    rng = np.random.default_rng(3)
    place = np.column_stack([rng.uniform(0, 40, (20_000, 2)), rng.normal(0, 0.02, 20_000)])
    level = rng.normal(0, 0.7, 20_000) + np.where(rng.random(20_000) < 0.5, 1.5, -1.5)
    power, none = 10.0 ** (level / 10.0), np.zeros(20_000)
    road = RealClass("", place, power, 0, none, none, none.astype(np.uint8))
    found = estimate_sensor(road, power, np.array([800.0]), np.array([0.0]))
    assert found.gain_step_db == pytest.approx(3.0, rel=0.1)
    assert found.speckle == pytest.approx(0.7 * np.log(10.0) / 10.0, rel=0.2)
    assert found.range_sigma == pytest.approx(0.02, rel=0.05)


def test_too_little_pavement_is_refused() -> None:
    few, none = np.random.default_rng(1).random((300, 3)), np.zeros(300)
    road = RealClass("", few, none + 1.0, 0, none, none, none.astype(np.uint8))
    with pytest.raises(InputError, match=r"squares of 1\.5 m with 16 points"):
        estimate_sensor(road, none + 1.0, np.array([800.0]), np.array([0.0]))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--save-device", "d.json"], "needs a cloud"),
        (["--device-response", "--device", "velodyne-hdl-64e", "--decibels", "30"], "can't be given with"),
        (["--device-response"], "--device"),
    ],
)
def test_what_contradicts_itself_is_refused(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "--material", "asphalt", *words]) == 2
    assert message in capsys.readouterr().err


def test_a_recipe_is_yaml_with_a_note(airborne: tuple[Path, ScanPlan], tmp_path: Path) -> None:
    """It loads as any other and names device and table by their files."""
    cloud, _ = airborne
    table = tmp_path / "table.json"
    words = ["--device", "riegl-vq-780i", "--range", "800", "--save", str(table)]
    files = ["--save-device", str(tmp_path / "d.json"), "--save-recipe", str(tmp_path / "r.yaml"), "--formulas"]
    label = ["--class-field", "label", "--material", f"asphalt={ASPHALT_LABEL}", "--quiet"]
    assert main(["calibrate", "--real", str(cloud), *label, *words, *files]) == 0
    data = yaml.safe_load((tmp_path / "r.yaml").read_text(encoding="utf-8"))
    assert data["set"]["materials_table"] == str(table)
    assert data["set"]["scan.device"] == str(tmp_path / "d.json")
