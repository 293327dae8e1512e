"""A calibrated sensor as files: a device, and a recipe that scans roads with it.

The device is the calibration's own one with what the cloud says in place of what its file said: the range's noise, how
numbers are made of the power, the pulse rate that gives the points' spacing. The recipe draws each fitted value from a
range about it, as a cloud of one survey says little about the next one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.files import write_file
from ..base.schema import canonical_json
from ..materials.surfaces import brightness_of, surfaces_of
from ..materials.table import Material
from ..scanning.devices.device import Device, ScannerSetting
from .expected import FULL_SCALE
from .fit import fitted_wavelength
from .job import Calibration, CalibrationJob, class_views
from .sensor import SensorEstimate, estimate_sensor

SPREAD = 0.15
"""Recipes draw fitted values from a range of this share to either side."""
SPEED = 60.0
"""Speed of an aircraft, m/s, where times don't say it."""
AIRBORNE = 200.0
"""Scanners farther away than this, m, fly in an aircraft, nearer ones on a UAV or stand."""
_LEAST_STEP_DB = 0.5
_STEPS = (1.0 / 3.0, 4.0 / 3.0)
"""Range of the gain's step, as shares of the fitted one: other roads lie elsewhere in the overlap of the strips."""
_LEAST_SPREAD, _MOST_NOISE = 0.02, 0.95
"""Spread that a material keeps when the sensor explains all of it, and share of the variance that is taken off."""
USUAL: dict[str, dict[str, tuple[float, float]]] = {
    "airborne": {
        "scan.motion.position_sigma": (0.2, 0.8),
        "scan.motion.attitude_sigma_deg": (0.2, 0.4),
        "scan.motion.heading_sigma_deg": (1.0, 3.0),
        "scan.strip_errors.boresight_sigma_deg": (0.0005, 0.002),
        "scan.strip_errors.drift_sigma": (0.005, 0.02),
    },
    "uav": {
        "scan.motion.position_sigma": (0.05, 0.3),
        "scan.motion.attitude_sigma_deg": (0.5, 2.0),
        "scan.motion.heading_sigma_deg": (0.5, 3.0),
        "scan.strip_errors.boresight_sigma_deg": (0.002, 0.01),
        "scan.strip_errors.lever_arm_sigma": (0.005, 0.02),
        "scan.strip_errors.drift_sigma": (0.01, 0.05),
    },
}
"""Ranges that the shipped recipes draw from for what no cloud is asked for: how it sways, and how strips disagree."""
_SWAY = {
    "airborne": {"shortest_period": 0.05, "longest_period": 20.0, "period_exponent": 0.5},
    "uav": {"shortest_period": 0.5, "longest_period": 10.0, "period_exponent": 1.0},
}
_DIGITS = 4


@dataclass(frozen=True)
class FittedSensor:
    """A sensor that was fitted to a cloud.

    Attributes:
        estimate: what the cloud says.
        device: the base device with the fitted values.
        scan: settings of a scan with it, path in the scenario -> value.
        drawn: fitted values that a recipe draws from a range about them, likewise.
        usual: what the cloud doesn't say, or says of its own road alone, and a recipe draws from wider ranges.
        scenario: built-in one that a recipe begins with.
        materials: the fitted ones by name, whose spread is what the sensor doesn't explain.
    """

    estimate: SensorEstimate
    device: Device
    scan: dict[str, Any]
    drawn: dict[str, float]
    usual: dict[str, tuple[float, float]]
    scenario: str
    materials: dict[str, Material]

    def to_dict(self) -> dict[str, Any]:
        """Return the estimates and the settings that follow from them as JSON data."""
        return {"estimate": self.estimate.to_dict(), "receiver": self.device.receiver.to_dict(), "scan": self.scan}


def fit_sensor(result: Calibration) -> FittedSensor:
    """Return the sensor that explains the first class of a calibration, which must be pavement.

    Raises:
        InputError: there is no cloud or no device, or too little pavement.
    """
    job, first = result.job, result.compared[0]
    if first.real is None:
        raise InputError("--save-device", None, "needs a cloud that the sensor is fitted to")
    setting, real = job.setting, first.real
    distance, incidence = _views_of_points(job, result)
    receiver = job.receiver
    linear = receiver.to_linear(real.intensity)
    if receiver.range_corrected:
        linear = linear + result.gain * receiver.pedestal * distance**2
    else:
        linear = (linear + result.gain * receiver.pedestal) * distance**2
    scanner = None if job.scanner is None else np.array(job.scanner)
    estimate = estimate_sensor(real, linear, distance, incidence, scanner)
    device = _fitted_device(result, setting, estimate)
    scan, drawn = _receiver_settings(estimate, device)
    usual: dict[str, tuple[float, float]] = {}
    if scanner is None:
        scenario, spacing, device = _moving(estimate, device, setting)
        usual = dict(USUAL[spacing["scan.platform"]["kind"]])
        if (step := estimate.gain_step_db) > 0.0:
            usual["scan.strip_errors.gain_step_db"] = _short(step * _STEPS[0]), _short(step * _STEPS[1])
    else:
        scenario, spacing = _standing(estimate, device, setting)
    return FittedSensor(estimate, device, scan | spacing, drawn, usual, scenario, _surfaces_alone(result, estimate))


def _surfaces_alone(result: Calibration, estimate: SensorEstimate) -> dict[str, Material]:
    """Return a calibration's materials, with what speckle and the gain of strips spread taken off their own spread.

    The fit gives a material all that its class varies by. A scan that adds the sensor's part would vary by it twice.
    """
    gain = estimate.gain_step_db * np.log(10.0) / 10.0
    noise = estimate.speckle**2 + 0.5 * gain**2 * (1.0 - 1.0 / estimate.strips)
    rows = {}
    for entry in result.compared:
        row, real, update = entry.after, entry.real, {}
        if real is None:
            continue
        varying = float(np.log(np.maximum(result.job.receiver.to_linear(real.intensity), 1e-300)).var())
        share = min(noise / max(varying, 1e-12), 1.0)
        for name in ("spread_below", "spread_above"):
            fitted = getattr(row, name)
            update[name] = round(min(max(fitted * np.sqrt(1.0 - share), _LEAST_SPREAD), fitted), 4)
        if "wavelength" in result.job.parts:
            update["spread_wavelength"] = fitted_wavelength(real.place, real.intensity, min(share, _MOST_NOISE))
        rows[entry.target.material] = row.model_copy(update=update)
    return rows


def _views_of_points(job: CalibrationJob, result: Calibration) -> tuple[Float, Float]:
    """Return ranges, m, and incidence angles, rad, of the first class's points, or the usual ones (1,)."""
    views = class_views(job, result.compared[0].real)
    real = result.compared[0].real
    assert real is not None
    if len(views.distance) == len(real.intensity):
        return views.distance, views.incidence
    return np.array([np.median(views.distance)]), np.array([np.median(views.incidence)])


def _fitted_device(result: Calibration, setting: ScannerSetting, estimate: SensorEstimate) -> Device:
    """Return the calibration's device with the fitted noise and response."""
    job, device = result.job, setting.device
    data = device.to_dict()
    receiver = dict(data.get("receiver") or {})
    receiver["faint_range_sigma"] = _short(estimate.faint_range_sigma * _over_threshold(result, setting, estimate))
    receiver["range_walk"] = _short(estimate.range_walk)
    receiver["range_delay"] = _short(estimate.range_delay)
    if estimate.bits is not None:
        receiver["bits"] = estimate.bits
    model = job.receiver
    if model.range_corrected and model.decibels is None and job.real is not None:
        receiver |= {"response": "range_compensated", "full_scale": _short(FULL_SCALE / result.gain)}
        receiver["compression"] = _short(model.compression)
        receiver["lost_numbers"] = _short(estimate.zeros)
    if estimate.laser_gain_db is not None and device.channels > 1:
        receiver["gain_sigma_db"] = _short(min(estimate.laser_gain_db, 10.0))
    cloud = "" if job.real is None else job.real.name
    source = f"Response, noise and pulse rate fitted by synthroads calibrate to {cloud}"
    changes = {"receiver": receiver, "range_sigma": _short(estimate.range_sigma)}
    changes |= {"title": f"{device.title}, fitted", "source": f"{source}; all else: {device.source}"}
    return Device.from_dict(data | changes)


def _over_threshold(result: Calibration, setting: ScannerSetting, estimate: SensorEstimate) -> float:
    """Return the usual power of the pavement's echoes over the detection threshold, at least 1."""
    if estimate.distance is None:
        return 1.0
    surfaces = surfaces_of([result.compared[0].after], result.job.reflection, spread=False)
    brightness = float(brightness_of(surfaces, np.zeros(1, np.intp), np.array([np.cos(estimate.incidence)]))[0])
    loss = float(np.exp(-result.job.attenuation * estimate.distance))
    return max(brightness * loss / estimate.distance**2 / setting.threshold, 1.0)


def _receiver_settings(estimate: SensorEstimate, device: Device) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the settings of a scan that follow from the noise, and those that are drawn about their value."""
    scan: dict[str, Any] = {"scan.mirror_clock": "free"}
    drawn = {
        "scan.noise.speckle": estimate.speckle,
        "scan.noise.range_sigma": estimate.range_sigma,
        "scan.receiver.faint_range_sigma": device.receiver.faint_range_sigma or 0.0,
        "scan.receiver.range_walk": estimate.range_walk,
        "scan.receiver.range_delay": estimate.range_delay,
    }
    if device.receiver.compression:
        drawn["scan.receiver.compression"] = min(device.receiver.compression, 1.0 / (1.0 + SPREAD))
    return scan, {name: _short(value) for name, value in drawn.items() if value > 1e-6}


def _moving(estimate: SensorEstimate, device: Device, setting: ScannerSetting) -> tuple[str, dict[str, Any], Device]:
    """Return scenario, settings and device of a scanner that flies over the road as densely as the cloud."""
    strips = min(max(estimate.strips, 2 if estimate.gain_step_db > _LEAST_STEP_DB else 1), 8)
    distance = estimate.distance or AIRBORNE
    height = float(distance * np.cos(estimate.incidence))
    step = estimate.pulse_spacing or float(np.sqrt(strips / estimate.density))
    line = strips / (estimate.density * step)
    slowest, fastest = device.lines_per_second
    lines = float(np.clip(SPEED / line, slowest, fastest))
    speed = lines * line
    rate = distance * device.pattern.sweep(setting.field_of_view) * lines / step
    usual = device.modes[0]
    # The detection threshold stays: by it the noise of faint echoes was told.
    reach = min(float(np.sqrt(0.2 / setting.threshold)), 0.999 * device.unambiguous_range(rate))
    mode = usual.to_dict() | {"pulse_rate_khz": _short(rate / 1e3), "maximum_range": _short(reach)}
    finest = min(device.finest_angle_deg, float(np.rad2deg(step / distance)) * 0.9)
    fitted = Device.from_dict(device.to_dict() | {"modes": [mode], "finest_angle_deg": _short(finest)})
    kind = "airborne" if distance > AIRBORNE else "uav"
    offsets = [_short(0.05 * height * place) for place in np.linspace(-1.0, 1.0, strips)] if strips > 1 else [0.0]
    platform = {"kind": kind, "height": _short(height), "speed": _short(speed), "lateral_offsets": offsets}
    settings: dict[str, Any] = {"scan.lines_per_second": _short(lines), "scan.platform": platform}
    settings["scan.pulse_rate_khz"] = mode["pulse_rate_khz"]
    settings["scan.motion"] = _SWAY[kind]
    settings["road.environment.wet"] = 0
    return "airborne-1000m", settings, fitted


def _standing(estimate: SensorEstimate, device: Device, setting: ScannerSetting) -> tuple[str, dict[str, Any]]:
    """Return scenario and settings of a head that turns once on the road, as finely as the cloud's."""
    slowest, fastest = device.lines_per_second
    lines = setting.lines_per_second
    if estimate.azimuth_step is not None:
        turn = 2.0 * np.pi * device.pattern.beams / setting.pulse_rate
        lines = float(np.clip(estimate.azimuth_step / turn, slowest, fastest))
    platform = {"kind": "tripod", "stations": [60.0], "turn_seconds": _short(1.0 / lines), "turn_deg": 0.0}
    settings = {"scan.lines_per_second": _short(lines), "scan.platform": platform | {"height": 1.73}}
    return "tripod-200m", settings | {"scan.reflection": "oren_nayar"}


def save_device(sensor: FittedSensor, path: Path, overwrite: bool = False) -> None:
    """Write the fitted device to a file.

    Raises:
        OutputError: it is there already, or it can't be written.
    """
    write_file(path, canonical_json(sensor.device.to_dict()).encode(), "--save-device", overwrite)


def save_recipe(sensor: FittedSensor, path: Path, device: Path, table: Path | None, overwrite: bool = False) -> None:
    """Write a recipe of eight roads that are scanned with a fitted device.

    Args:
        sensor: the fitted one.
        path: of the recipe.
        device: file of the device.
        table: file of the fitted materials; None for the shipped ones.
        overwrite: replace a file that is there.

    Raises:
        OutputError: it is there already, or it can't be written.
    """
    data = {
        "type": "Recipe",
        "version": "1.0",
        "title": f"Roads scanned with {sensor.device.title}",
        "seed": 1,
        "scenario": sensor.scenario,
        "set": {
            "scan.device": str(device),
            "fidelity": "draft",
            "outputs": ["parameters", "cloud", "centerline"],
            "road.length": 200,
            **({} if table is None else {"materials_table": str(table)}),
            **sensor.scan,
        },
        "draw": {
            name: {"minimum": _short(value * (1.0 - SPREAD)), "maximum": _short(value * (1.0 + SPREAD))}
            for name, value in sensor.drawn.items()
        }
        | {name: {"minimum": low, "maximum": high} for name, (low, high) in sensor.usual.items()},
        "groups": [{"name": "roads", "scenes": 8, "split": {"train": 6, "validation": 1, "test": 1}}],
    }
    text = "# Written by synthroads calibrate; groups and roads are an example to be changed.\n"
    write_file(path, (text + yaml.safe_dump(data, sort_keys=False)).encode(), "--save-recipe", overwrite)


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
