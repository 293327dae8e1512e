"""Settings refined by simulated scans are those of the scanner that measured the cloud, where formulas begin elsewhere.

The cloud comes from the scanner itself, over level pavement in the shape of two lanes, by settings that are known; the
search begins a third to a half away from them.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.base.changes import apply_values
from synthroads_addon.base.errors import InputError
from synthroads_addon.calibration import refine
from synthroads_addon.calibration.pulse_lines import pulse_step
from synthroads_addon.calibration.refine import Refined, Setting, refine_settings, select_points
from synthroads_addon.calibration.sensor import SensorEstimate
from synthroads_addon.calibration.sensor_files import _MovingSensor
from synthroads_addon.calibration.simulation import LevelPavement, simulate_pavement
from synthroads_addon.cloud.selection.classes import RealClass
from synthroads_addon.materials.table import materials
from synthroads_addon.scenario.scan import ScanScenario, scanner_setting
from synthroads_addon.scenario.scenario import load_scenario

LANES = ((-5.0, -1.5), (1.5, 5.0))
SPREAD = "spread"
FIXED = {
    "scan.pulse_rate_khz": 700.0,
    "scan.field_of_view_deg": 10.0,
    "scan.mirror_clock": "free",
    "scan.platform": {"kind": "airborne", "height": 750.0, "speed": 58.0, "lateral_offsets": [-30.0, 30.0]},
    "scan.motion": {
        "shortest_period": 0.2,
        "period_exponent": 0.8,
        "attitude_sigma_deg": 0.3,
        "heading_sigma_deg": 2.0,
    },
    "scan.strip_errors.drift_sigma": 0.002,
    "scan.receiver.faint_range_sigma": 0.05,
    "scan.lines_per_second": 180.0,
}
TRUTH = {
    "scan.noise.range_sigma": 0.025,
    "scan.receiver.range_delay": 0.5,
    "scan.noise.speckle": 0.15,
    "scan.noise.speckle_normal": 1.0,
    "scan.strip_errors.gain_step_db": 1.6,
    SPREAD: 0.12,
}
BEGIN = (
    Setting("scan.noise.range_sigma", 0.038, 0.001, 0.2),
    Setting("scan.receiver.range_delay", 0.2, 0.0, 0.9, False, 0.3),
    Setting("scan.noise.speckle", 0.19, 0.01, 0.6),
    Setting("scan.noise.speckle_normal", 0.5, 0.0, 1.0, False, 0.5),
    Setting("scan.strip_errors.gain_step_db", 1.1, 0.0, 6.0, False, 0.5),
    Setting(SPREAD, 0.075, 0.005, 0.5),
)
TOLERANCE = {
    "scan.noise.range_sigma": 0.002,
    "scan.receiver.range_delay": 0.12,
    "scan.noise.speckle": 0.02,
    "scan.strip_errors.gain_step_db": 0.25,
    SPREAD: 0.04,
}


def scan(values: Mapping[str, float], seed: int, length: float = 36.0) -> RealClass:
    """Return pavement as the scanner sees it with some settings."""
    given = {path: value for path, value in values.items() if path.startswith("scan.")}
    data = apply_values(load_scenario("airborne-1000m-even").to_dict(), FIXED | given)
    scenario = ScanScenario.from_dict(data["scan"])
    material = materials()["asphalt"].model_copy(
        update={"spread_below": values[SPREAD], "spread_above": values[SPREAD], "spread_wavelength": 1.0}
    )
    return simulate_pavement(
        scenario, scanner_setting(scenario), LevelPavement(length, 36.0, material), "asphalt", seed
    )


def road() -> RealClass:
    """Return two lanes of what a scanner of known settings measures."""
    found = scan(TRUTH, 77, 150.0)
    lanes = np.zeros(len(found.place), dtype=bool)
    for low, high in LANES:
        lanes |= (found.place[:, 1] > low) & (found.place[:, 1] < high)
    moved = replace(found, place=found.place + np.array([1000.0, 500.0, 30.0]))
    return replace(select_points(moved, lanes), beside=moved.place[~lanes, :2])


@pytest.fixture(scope="module")
def refined() -> Refined:
    """Return the settings that the search finds."""
    return refine_settings(road(), BEGIN, scan)


@pytest.mark.slow
@pytest.mark.parametrize("path", TOLERANCE)
def test_settings_are_found_again(refined: Refined, path: str) -> None:
    """Noise of ranges and its delay, noise of the brightness, step between strips, texture; its shape isn't told."""
    begin = next(setting.begin for setting in BEGIN if setting.path == path)
    assert abs(begin - TRUTH[path]) > TOLERANCE[path]
    assert refined.values[path] == pytest.approx(TRUTH[path], abs=TOLERANCE[path])


@pytest.mark.parametrize("lines", [140.0, 180.0, 220.0])
def test_lines_tell_how_far_pulses_lie_apart(lines: float) -> None:
    """Within 5 %, of two swaying strips without times; points at random tell nothing."""
    found = scan(TRUTH | {"scan.lines_per_second": lines}, 3, 60.0)
    data = apply_values(load_scenario("airborne-1000m-even").to_dict(), FIXED | {"scan.lines_per_second": lines})
    step = 750.0 * scanner_setting(ScanScenario.from_dict(data["scan"])).angle_step
    assert pulse_step(found.place, 20.0, 2) == pytest.approx(step, rel=0.05)
    random = np.random.default_rng(1).uniform(0.0, 60.0, (len(found.place), 2))
    assert pulse_step(random, 20.0, 2) is None


def test_lines_of_a_dense_cloud_take_little_memory() -> None:
    """1,500 points per square metre, as of a vehicle's scanner: blocks are smaller, and tell the same."""
    rng, step = np.random.default_rng(1), 1.0 / np.sqrt(1500.0)
    along, line = np.meshgrid(np.arange(0.0, 30.0, step), np.arange(0.0, 30.0, step))
    along = along + rng.uniform(0.0, step, (len(line), 1))
    place = np.column_stack([along.ravel(), line.ravel()]) + rng.normal(0.0, 0.02 * step, (line.size, 2))
    tracemalloc.start()
    found = pulse_step(place, 1500.0, 1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == pytest.approx(step, rel=0.05)
    assert peak < 400e6


@pytest.mark.slow
def test_statistics_come_nearer(refined: Refined) -> None:
    apart = [
        sum(abs(part[name] - refined.real[name]) for name in refined.real) for part in (refined.before, refined.after)
    ]
    assert apart[1] < 0.4 * apart[0]
    assert refined.to_dict()["values"].keys() == TRUTH.keys()


def test_windows_have_the_shape_of_the_pavement() -> None:
    """A scan of a whole square is cut to the lanes: no farther out than a third of the points' usual distance."""
    window = refine._windows(road())[0]
    place = scan(TRUTH, 5).place[:, :2]
    cut = place[window.holds(place)]
    across = np.sort(cut[:, 1])
    gap = np.diff(across).max()
    assert gap == pytest.approx(LANES[1][0] - LANES[0][1], abs=0.25)


def test_a_settings_place_in_the_search_keeps_its_limits() -> None:
    setting = Setting("x", 2.0, 1.0, 3.0)
    assert setting.value(0.0) == 2.0
    assert setting.value(10.0) == 3.0
    assert Setting("y", 0.5, 0.0, 1.0, False, 0.2).value(-1.0) == pytest.approx(0.3)


def aircraft() -> _MovingSensor:
    """Return a scanner that flies 800 m above asphalt, of which 20 points/m2 are known and no more."""
    none = SensorEstimate(1, 0.02, 0.02, 0.003, 0.5, 0.15, 1.5, None, None, 0.0, 20.0, 2, 800.0, 0.0, None)
    scenario = ScanScenario.from_dict(apply_values(load_scenario("airborne-1000m-even").to_dict(), FIXED)["scan"])
    setting = scanner_setting(scenario)
    return _MovingSensor(none, setting.device, setting, materials()["asphalt"], "asphalt", 0.0, True)


def test_an_aircrafts_lines_are_straight_and_parallel_at_uneven_distances() -> None:
    """Real ones are parallel within 0.1 deg, their distances differ by a quarter, and single points hardly leave them.

    A search that may bend lines and scatter points instead finds the same medians, but not the same clouds.
    """
    sensor = aircraft()
    begin = {setting.path: setting.begin for setting in sensor.settings()}
    assert not {"scan.motion.heading_sigma_deg", "scan.noise.angle_sigma_mrad"} & set(begin)
    assert {"scan.motion.heading_sigma_deg", "scan.noise.angle_sigma_mrad"} < set(sensor.usual)
    found = sensor.simulate(begin, 4)
    assert found.time is not None
    order = np.argsort(found.time)
    place, time = found.place[order, :2], found.time[order]
    lines = np.split(place, np.flatnonzero(np.diff(time) > 1e-3) + 1)
    fits = [(*np.polyfit(line[:, 1], line[:, 0], 1), line) for line in lines if np.ptp(line[:, 1]) > 20.0]
    assert len(fits) > 100
    off = np.concatenate([line[:, 0] - slope * line[:, 1] - at for slope, at, line in fits])
    assert off.std() < 0.015
    slopes, places = np.array([fit[:2] for fit in fits]).T
    gap = np.abs(np.diff(places))
    same = gap < 1.0
    assert np.rad2deg(np.diff(slopes)[same].std()) < 0.1
    assert 0.15 < gap[same].std() / gap[same].mean() < 0.4


def test_a_pavement_that_nobody_sees_is_refused() -> None:
    data = apply_values(load_scenario("airborne-1000m-even").to_dict(), FIXED)
    scenario = ScanScenario.from_dict(data["scan"])
    dark = materials()["asphalt"].model_copy(update={"base_color": (0.0, 0.0, 0.0), "specular": 0.0})
    with pytest.raises(InputError, match="no pavement that the fitted scanner would see"):
        simulate_pavement(scenario, scanner_setting(scenario), LevelPavement(10.0, 10.0, dark), "asphalt", 1)


def test_simulated_pavement_has_the_relief_that_the_scan_asks_for() -> None:
    """Noise of ranges that are fitted would else hold the surface's own roughness, which a scan adds once more."""
    still = {"scan.noise.range_sigma": 1e-4, "scan.receiver.faint_range_sigma": 0.0, "scan.receiver.range_walk": 0.0}
    plane, rough = (
        scan(TRUTH | still | {"scan.relief": strength, "scan.strip_errors.drift_sigma": 0.0}, 1, 12.0)
        for strength in (0.0, 4.0)
    )
    assert np.ptp(rough.place[:, 2]) > 3.0 * np.ptp(plane.place[:, 2])


def test_pavement_that_fills_no_patch_is_told() -> None:
    road = scan(TRUTH, 1)
    with pytest.raises(InputError, match="--real"):
        refine_settings(select_points(road, np.arange(4)), BEGIN, scan)
    with pytest.raises(InputError, match="no window of pavement"):
        refine_settings(road, BEGIN, lambda _, seed: select_points(scan(TRUTH, seed), np.arange(4)))
