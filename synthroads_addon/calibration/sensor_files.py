"""A calibrated sensor as files: a device, and a recipe that scans roads with it.

The device is the calibration's own one with what the cloud says in place of what its file said: the range's noise, how
numbers are made of the power, the pulse rate that gives the points' spacing. The recipe draws each fitted value from a
range about it. Of a scanner that moves, what formulas say (`sensor`) is where the search for settings begins whose
simulated scans have the cloud's statistics (`refine`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.changes import apply_values
from ..base.errors import InputError
from ..base.files import write_file
from ..base.machine import linear_algebra_on_one_thread
from ..base.schema import canonical_json
from ..cloud.selection.classes import RealClass
from ..materials.surfaces import brightness_of, surfaces_of
from ..materials.table import Material
from ..road.section import ASPHALTS, CONCRETES
from ..road.surroundings import MaterialVariation
from ..scanning.devices.device import Device, ScannerSetting, setting_of
from ..scenario.scan import ScanScenario
from ..scenario.scenario import load_scenario
from .expected import FULL_SCALE
from .fit import fitted_wavelength
from .job import Calibration, CalibrationJob, class_views
from .refine import Refined, Setting, refine_settings, window_edge
from .sensor import SensorEstimate, estimate_sensor
from .simulation import LevelPavement, simulate_pavement

SPREAD, SPREAD_OF_STRIPS = 0.05, 0.15
"""Recipes draw fitted values from a range of this share to either side; what differs from strip to strip from another.
Chosen: devices of a kind differ by less than strips of a survey."""
SPEED = 60.0
"""Speed of an aircraft, m/s, where times don't say it. Chosen: as survey aircraft fly."""
AIRBORNE = 200.0
"""Scanners farther away than this, m, fly in an aircraft, nearer ones on a UAV or stand. Chosen: UAVs fly below 120 m
in most countries."""
_LEAST_STEP_DB = 0.5
"""Step of the gain from which on there are two strips at least, dB. Chosen: more than one strip's estimate leaves by
chance."""
_LEAST_SPREAD, _MOST_NOISE = 0.02, 0.95
"""Spread that a material keeps when the sensor explains all of it, and share of the variance that is taken off. Chosen:
no pavement is quite even."""
USUAL: dict[str, dict[str, tuple[float, float]]] = {
    "airborne": {
        "scan.motion.position_sigma": (0.2, 0.8),
        "scan.motion.attitude_sigma_deg": (0.1, 0.3),
        "scan.motion.heading_sigma_deg": (0.05, 0.15),
        "scan.noise.angle_sigma_mrad": (0.01, 0.015),
        "scan.strip_errors.boresight_sigma_deg": (0.0001, 0.0003),
        "scan.strip_errors.drift_sigma": (0.001, 0.003),
    },
    "uav": {
        "scan.motion.position_sigma": (0.05, 0.3),
        "scan.motion.attitude_sigma_deg": (0.5, 2.0),
        "scan.motion.heading_sigma_deg": (0.5, 3.0),
        "scan.noise.angle_sigma_mrad": (0.02, 0.2),
        "scan.strip_errors.boresight_sigma_deg": (0.002, 0.01),
        "scan.strip_errors.lever_arm_sigma": (0.005, 0.02),
        "scan.strip_errors.drift_sigma": (0.01, 0.05),
    },
}
"""Ranges of how platforms sway and how strips disagree, in which searches begin at the middle; a recipe draws from them
what isn't fitted. Those of aircraft are of four airborne scans of roads, whose strips are adjusted to each other, and
whose lines are straight within 3 mm, parallel within 0.1 deg, and at distances that differ by a quarter."""
_SWAY = {
    "airborne": {"shortest_period": 0.02, "longest_period": 20.0, "period_exponent": 0.65},
    "uav": {"shortest_period": 0.5, "longest_period": 10.0, "period_exponent": 1.0},
}
"""Periods and exponent of the sway by platform: an aircraft shakes fast, a UAV swings."""
_RATIO, _DENSITY, _TEXTURE, _ASLANT = "spacing ratio", "density", "texture", "aslant"
"""Names of the values that are fitted besides settings of the scenario: pulses' spacing over lines', points, the
materials' spread, and the angle at which the second strip sees the road, deg."""
_FROM_ABOVE, _USUAL_ASLANT = -3.0, 18.0
"""Angles at which one strip sees the road, and at which the search for the other one's begins, deg. Chosen: strips of a
survey overlap so that what one has below it the next has at its side."""
_USUAL_RATIO, _USUAL_NORMAL = 1.2, 0.7
"""Spacing of pulses over that of lines, and share of speckle that is normal, with which the search begins. Chosen: as
surveys are planned; between both kinds."""
_PERIOD = "scan.motion.shortest_period"
"""Path of the sway's shortest period in a scenario."""
_FITTED_SWAY = {
    "airborne": {"scan.motion.attitude_sigma_deg": (1e-3, 10.0)},
    "uav": {
        "scan.motion.attitude_sigma_deg": (1e-3, 10.0),
        "scan.motion.heading_sigma_deg": (1e-3, 10.0),
        _PERIOD: (0.02, 5.0),
        "scan.noise.angle_sigma_mrad": (1e-4, 20.0),
    },
}
"""Limits of what is fitted of the sway and the mirror's angles. Statistics of patches hardly tell apart what moves
single pulses and what moves lines: of aircraft, whose lines are straight, only how strongly they tremble is fitted."""
_OF_STRIPS = tuple(f"scan.strip_errors.{name}" for name in ("gain_step_db", "drift_sigma"))
"""Settings that differ from strip to strip."""
_SHARES = ("scan.noise.speckle_normal", "scan.receiver.range_delay", "scan.receiver.compression")
"""Settings that are shares, of 1 at most."""
_VIEW_MARGIN = 1.1
"""Tangent of the narrowed field of view over that of the pavement's edge. Chosen: the edge is scanned from both
sides."""
_AT_THE_EDGE = 4.0
"""The road lies so far from the edge of the field of view at least, deg: aircraft sway. Chosen: more than their roll in
calm air."""
_FREE = {"scan.mirror_clock": "free"}
"""Settings of every simulated scan: whose mirror keeps no time with the pulses."""
_KNOWN = 1.1
"""Factor within which the spacing stays that times or lines tell. Chosen: about what these estimates are off."""
_MOST_STRIPS = 8
"""Strips that are simulated at most. Chosen: bounds the work."""
_MOST_SPREAD = 1.0
"""Largest spread that the search gives a material. Chosen: a factor of e."""
_POWER = {"scan.receiver.response": "power", "scan.receiver.bits": None}
"""Simulated scans give the received power, as what they are compared with is led back to it."""
_DIGITS = 4
"""Digits of numbers in files. Chosen: more than any is known to."""
_MOST_BITS, _MOST_FULL_SCALE = 16, 1e4
"""Limits of a receiver's numbers."""


@dataclass(frozen=True)
class FittedSensor:
    """A sensor that was fitted to a cloud.

    Attributes:
        estimate: what the cloud says by formulas.
        refined: how its settings were refined by simulated scans; None if they weren't.
        device: the base device with the fitted values.
        scan: settings of a scan with it, path in the scenario -> value.
        drawn: fitted values that a recipe draws from a range about them, likewise.
        usual: what the cloud doesn't say, and a recipe draws from the shipped ones' ranges.
        scenario: built-in one that a recipe begins with.
        materials: the fitted ones by name, whose spread is what the sensor doesn't explain.
    """

    estimate: SensorEstimate
    refined: Refined | None
    device: Device
    scan: dict[str, Any]
    drawn: dict[str, float]
    usual: dict[str, tuple[float, float]]
    scenario: str
    materials: dict[str, Material]

    def to_dict(self) -> dict[str, Any]:
        """Return the estimates and the settings that follow from them as JSON data."""
        refined = None if self.refined is None else self.refined.to_dict()
        settings = {"receiver": self.device.receiver.to_dict(), "scan": self.scan, "drawn": self.drawn}
        return {"estimate": self.estimate.to_dict(), "refined": refined, **settings}


@linear_algebra_on_one_thread(scipy=True)
def fit_sensor(result: Calibration, by_simulation: bool = True) -> FittedSensor:
    """Return the sensor that explains the first class of a calibration, which must be pavement.

    Args:
        result: of the calibration.
        by_simulation: whether the settings of a scanner that moves are refined by simulated scans.

    Raises:
        InputError: there is no cloud or no device, or too little pavement.
    """
    job, pavement = result.job, result.compared[0]
    if pavement.real is None:
        raise InputError("--save-device", None, "needs a cloud that the sensor is fitted to")
    distance, incidence = _views_of_points(job, result)
    linear = _linear_brightness(result, pavement.real.intensity, distance)
    scanner = None if job.scanner is None else np.array(job.scanner)
    estimate = estimate_sensor(pavement.real, linear, distance, incidence, scanner)
    device = _fitted_device(result, job.setting, estimate)
    surfaces = _surfaces_alone(result, estimate)
    if scanner is not None:
        drawn_values = _drawn_values(_noise_of(estimate, device))
        scenario, spacing = _standing(estimate, device, job.setting)
        return FittedSensor(estimate, None, device, _FREE | spacing, drawn_values, {}, scenario, surfaces)
    # What isn't corrected by the device is by each point's range, where that is known.
    corrected = job.receiver.range_corrected or len(distance) > 1
    name = pavement.target.material
    moving = _MovingSensor(estimate, device, job.setting, surfaces[name], name, job.attenuation, corrected)
    road = replace(pavement.real, intensity=linear) if by_simulation else None
    return _fit_moving(moving, surfaces, road)


def _linear_brightness(result: Calibration, intensity: Float, distance: Float) -> Float:
    """Return real intensities (N,) in proportion to the light times the squared range.

    Args:
        result: of the calibration.
        intensity: (N,) as stored.
        distance: (N,) or (1,) ranges, m.
    """
    receiver = result.job.receiver
    linear, pedestal = receiver.to_linear(intensity), result.gain * receiver.pedestal
    return linear + pedestal * distance**2 if receiver.range_corrected else (linear + pedestal) * distance**2


def _fit_moving(moving: _MovingSensor, surfaces: dict[str, Material], road: RealClass | None) -> FittedSensor:
    """Return the fitted sensor of a scanner that moves.

    Args:
        moving: the scanner, with what formulas say of it.
        surfaces: materials by name.
        road: real pavement, by which simulated scans refine the settings; None to leave these as they begin.
    """
    begin, estimate = moving.settings(), moving.estimate
    refined = None if road is None else refine_settings(road, begin, moving.simulate)
    values = {setting.path: setting.begin for setting in begin} if refined is None else refined.values
    spacing, device = moving.scanner(values)
    # Without simulated scans the others are what a search would begin with, and no estimates.
    estimated_paths = (*_noise_of(estimate, device), _OF_STRIPS[0]) if refined is None else values
    drawn_values = _drawn_values(
        {path: value for path, value in values.items() if path.startswith("scan.") and path in estimated_paths}
    )
    usual = {path: limits for path, limits in moving.usual.items() if path not in drawn_values}
    below, above = (round(spread, 4) for spread in moving.spreads(values))
    material = surfaces[moving.name].model_copy(update={"spread_below": below, "spread_above": above})
    # The materials' brightness was fitted for this air.
    air = {"scan.attenuation": moving.attenuation}
    scan = _FREE | spacing | _same_surface(moving.name) | air
    surfaces = surfaces | {moving.name: material}
    return FittedSensor(estimate, refined, device, scan, drawn_values, usual, "airborne-1000m-even", surfaces)


def _same_surface(material: str) -> dict[str, Any]:
    """Return settings of roads whose pavement is of one material as the table has it: of one kind, age and wear."""
    concrete = material in CONCRETES
    kinds = {"road.pavement.concretes" if concrete else "road.pavement.asphalts": [material]}
    usual = MaterialVariation()
    names = ("asphalt_age", "asphalt_brightness", "concrete_brightness", "paint_wear")
    values = ((name, getattr(usual, name)) for name in names)
    material_limits = {f"road.materials.{name}": {"minimum": value, "maximum": value} for name, value in values}
    limits = {"road.environment.wet": 0, "road.pavement.concrete": float(concrete), "road.pavement.renewed": 0.0}
    return limits | (kinds if material in (*ASPHALTS, *CONCRETES) else {}) | material_limits


@dataclass(frozen=True)
class _MovingSensor:
    """A scanner that flies over the road as densely as the cloud is.

    Attributes:
        estimate: what the cloud says by formulas.
        device: with the noise and response that these say.
        setting: of the calibration's device.
        material: of the pavement, with the spread that the sensor doesn't explain.
        name: of the material in the table.
        attenuation: of the air, 1/m of range.
        range_corrected: whether the real brightness has no fall-off with the range.
    """

    estimate: SensorEstimate
    device: Device
    setting: ScannerSetting
    material: Material
    name: str
    attenuation: float
    range_corrected: bool

    @property
    def distance(self) -> float:
        """Return the usual range, m."""
        return self.estimate.distance or AIRBORNE

    @property
    def kind(self) -> str:
        """Return the platform's kind, by the usual range."""
        return "airborne" if self.distance > AIRBORNE else "uav"

    @property
    def usual(self) -> dict[str, tuple[float, float]]:
        """Return the ranges of `USUAL` for this kind of platform."""
        return USUAL[self.kind]

    @property
    def strips(self) -> int:
        """Return the number of strips that overlap, as it is simulated."""
        fewest = 2 if self.estimate.gain_step_db > _LEAST_STEP_DB else 1
        return min(max(self.estimate.strips, fewest), _MOST_STRIPS)

    def settings(self) -> list[Setting]:
        """Return the settings that are refined, with the values that formulas give and the usual ones begin with."""
        estimate = self.estimate
        ratio, factor = _USUAL_RATIO, 3.0
        if estimate.pulse_spacing is not None:
            ratio, factor = estimate.pulse_spacing**2 * estimate.density / self.strips, _KNOWN
        noise = _noise_of(estimate, self.device)
        middle = {path: float(np.sqrt(minimum * maximum)) for path, (minimum, maximum) in self.usual.items()}
        rows = [
            Setting(_RATIO, ratio, ratio / factor, ratio * factor),
            Setting(_DENSITY, 1.0, 0.5, 2.0),
            Setting(_TEXTURE, 1.0, 0.1, 10.0),
        ]
        middle |= {_PERIOD: _SWAY[self.kind]["shortest_period"]}
        rows += [Setting(path, middle[path], *limits) for path, limits in _FITTED_SWAY[self.kind].items()]
        for name, maximum in (("noise.range_sigma", 1.0), ("receiver.faint_range_sigma", 10.0), ("noise.speckle", 1.0)):
            rows.append(Setting(f"scan.{name}", max(noise[f"scan.{name}"], 1e-4), 1e-4, maximum))
        rows.append(Setting("scan.noise.speckle_normal", _USUAL_NORMAL, 0.0, 1.0, False, 0.5))
        rows.append(Setting("scan.receiver.range_delay", noise["scan.receiver.range_delay"], 0.0, 0.9, False, 0.3))
        rows.append(Setting("scan.receiver.range_walk", noise["scan.receiver.range_walk"], 0.0, 0.1, False, 0.003))
        if self.strips > 1:
            step, drift = _OF_STRIPS
            half_view = 0.5 * np.rad2deg(self.setting.field_of_view) - _AT_THE_EDGE
            aslant = min(_USUAL_ASLANT, half_view)
            rows.append(Setting(_ASLANT, aslant, 0.0, max(half_view, 0.0), False, 6.0))
            rows += [
                Setting(step, self._unseen_step(aslant), 0.0, 10.0, False, 0.5),
                Setting(drift, middle[drift], 1e-4, 1.0),
            ]
        return rows

    def _unseen_step(self, aslant: float) -> float:
        """Return the part, dB, of the gain's step between strips that their angles don't explain.

        Args:
            aslant: angle at which the second strip sees the road, deg; the first one sees it at `_FROM_ABOVE`.
        """
        # The brightness goes with the cosine, by Lambert's law; without a correction for the range, which grows with
        # 1 / cosine, with its cube.
        power = 10.0 if self.range_corrected else 30.0
        level_above, level_aslant = (power * np.log10(np.cos(np.deg2rad(angle))) for angle in (_FROM_ABOVE, aslant))
        return max(self.estimate.gain_step_db - float(level_above - level_aslant), 0.0)

    def spreads(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Return the material's spreads below and above its median, with values of `settings`."""
        below, above = self.material.spread_below, self.material.spread_above
        return min(below * values[_TEXTURE], _MOST_SPREAD), min(above * values[_TEXTURE], _MOST_SPREAD)

    def scanner(self, values: Mapping[str, float]) -> tuple[dict[str, Any], Device]:
        """Return settings of a scenario, by path, and the device, for a scanner with values of `settings`.

        Lines and pulse rate are those that give the density and the ratio of spacings at the usual range.
        """
        estimate, device, distance, strips = self.estimate, self.device, self.distance, self.strips
        height = float(distance * np.cos(estimate.incidence))
        density = estimate.density * values[_DENSITY]
        step = float(np.sqrt(values[_RATIO] * strips / density))
        line = strips / (density * step)
        slowest, fastest = device.lines_per_second
        lines = float(np.clip(SPEED / line, slowest, fastest))
        rate = distance * device.pattern.sweep(self.setting.field_of_view) * lines / step
        # The detection threshold stays: by it the noise of faint echoes was told.
        maximum_range = min(float(np.sqrt(0.2 / self.setting.threshold)), 0.999 * device.unambiguous_range(rate))
        mode = device.modes[0].to_dict() | {
            "pulse_rate_khz": _short(rate / 1e3),
            "maximum_range": _short(maximum_range),
        }
        finest_angle = min(device.finest_angle_deg, float(np.rad2deg(step / distance)) * 0.9)
        noise = {"faint_range_sigma": values["scan.receiver.faint_range_sigma"]}
        noise |= {name: values[f"scan.receiver.{name}"] for name in ("range_walk", "range_delay")}
        data = device.to_dict()
        receiver = dict(data["receiver"]) | {name: _short(value) for name, value in noise.items()}
        data |= {"modes": [mode], "finest_angle_deg": _short(finest_angle), "receiver": receiver}
        data["range_sigma"] = _short(values["scan.noise.range_sigma"])
        angles = np.deg2rad(np.linspace(_FROM_ABOVE, values[_ASLANT], strips)) if strips > 1 else np.zeros(1)
        offsets = [_short(height * float(np.tan(angle))) for angle in angles]
        platform = {"kind": self.kind, "height": _short(height), "speed": _short(lines * line)}
        settings: dict[str, Any] = {"scan.lines_per_second": _short(lines)}
        settings["scan.platform"] = platform | {"lateral_offsets": offsets}
        settings["scan.pulse_rate_khz"] = mode["pulse_rate_khz"]
        settings["scan.motion"] = _SWAY[self.kind]
        return settings, Device.from_dict(data)

    def simulate(self, values: Mapping[str, float], seed: int) -> RealClass:
        """Return a scan of level pavement with values of `settings`."""
        spacing, device = self.scanner(values)
        edge = window_edge(self.estimate.density)
        middle = {path: float(np.sqrt(minimum * maximum)) for path, (minimum, maximum) in self.usual.items()}
        scan_values = {path: value for path, value in values.items() if path.startswith("scan.")}
        changes = _FREE | spacing | middle | scan_values | _POWER | {"scan.attenuation": self.attenuation}
        data = apply_values(load_scenario("airborne-1000m-even").to_dict(), changes)
        scan = ScanScenario.from_dict(data["scan"])
        spread_below, spread_above = self.spreads(values)
        pavement = LevelPavement(
            edge, edge, self.material.model_copy(update={"spread_below": spread_below, "spread_above": spread_above})
        )
        setting = self._narrowed(device, scan, spacing["scan.platform"], edge)
        points = simulate_pavement(scan, setting, pavement, self.name, seed)
        return replace(points, intensity=points.intensity * points.distance**2) if self.range_corrected else points

    def _narrowed(self, device: Device, scan: ScanScenario, platform: Mapping[str, Any], edge: float) -> ScannerSetting:
        """Return the scanner's setting, its field of view narrowed to the pavement where the optics allow that.

        Args:
            device: the scanner's.
            scan: settings of the scan.
            platform: kind, height and offsets.
            edge: of the pavement, m.
        """
        setting = setting_of(device, scan, scan.noise.range_sigma)
        if device.pattern.fixed_view:
            return setting
        side_reach = max(map(abs, platform["lateral_offsets"])) + edge / 2.0
        view = 2.0 * np.arctan(_VIEW_MARGIN * side_reach / platform["height"])
        view += 6.0 * np.deg2rad(scan.motion.attitude_sigma_deg)
        if view >= setting.field_of_view:
            return setting
        return setting_of(
            device, scan.model_copy(update={"field_of_view_deg": float(np.rad2deg(view))}), scan.noise.range_sigma
        )


def _surfaces_alone(result: Calibration, estimate: SensorEstimate) -> dict[str, Material]:
    """Return a calibration's materials, with what speckle and the gain of strips spread taken off their own spread.

    The fit gives a material all that its class varies by. A scan that adds the sensor's part would vary by it twice.
    """
    gain = estimate.gain_step_db * np.log(10.0) / 10.0
    noise = estimate.speckle**2 + 0.5 * gain**2 * (1.0 - 1.0 / estimate.strips)
    rows: dict[str, Material] = {}
    for entry in result.compared:
        row, real, update = entry.after, entry.real, {}
        if real is None:
            continue
        log_variance = float(np.log(np.maximum(result.job.receiver.to_linear(real.intensity), 1e-300)).var())
        share = min(noise / max(log_variance, 1e-12), 1.0)
        for name in ("spread_below", "spread_above"):
            fitted_spread = getattr(row, name)
            update[name] = round(min(max(fitted_spread * np.sqrt(1.0 - share), _LEAST_SPREAD), fitted_spread), 4)
        if "wavelength" in result.job.parts:
            update["spread_wavelength"] = fitted_wavelength(real.place, real.intensity, min(share, _MOST_NOISE))
        rows[entry.target.material] = row.model_copy(update=update)
    return rows


def _views_of_points(job: CalibrationJob, result: Calibration) -> tuple[Float, Float]:
    """Return ranges, m, and incidence angles, rad, of the first class's points (N,), or one usual view (1,)."""
    views = class_views(job, result.compared[0].real)
    real = result.compared[0].real
    assert real is not None
    if len(views.distance) == len(real.intensity):
        return views.distance, views.incidence
    return np.array([np.median(views.distance)]), np.array([np.median(views.incidence)])


def _fitted_device(result: Calibration, setting: ScannerSetting, estimate: SensorEstimate) -> Device:
    """Return the calibration's device with the fitted noise and response.

    Args:
        result: of the calibration.
        setting: of its device.
        estimate: of the sensor.
    """
    job, device = result.job, setting.device
    data = device.to_dict()
    receiver = dict(data.get("receiver") or {})
    receiver["faint_range_sigma"] = _short(estimate.faint_range_sigma * _over_threshold(result, setting, estimate))
    receiver["range_walk"] = _short(estimate.range_walk)
    receiver["range_delay"] = _short(estimate.range_delay)
    if estimate.bits is not None:
        receiver["bits"] = estimate.bits
    model = job.receiver
    if model.range_corrected and job.real is not None:
        brightest = float(model.to_linear(np.array(FULL_SCALE))) / result.gain
        receiver |= {"response": "range_compensated", "full_scale": min(_short(brightest), _MOST_FULL_SCALE)}
        if model.decibels is None:
            receiver["compression"] = _short(model.compression)
            receiver["lost_numbers"] = _short(estimate.zeros)
        else:
            # Numbers in proportion need all bits to be as fine as steps of decibels are.
            receiver["bits"] = _MOST_BITS
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


def _noise_of(estimate: SensorEstimate, device: Device) -> dict[str, float]:
    """Return the scan's settings of noise, by their paths in a scenario, as the formulas of `sensor` estimate them.

    A compression is left so far below 1 that the range a recipe draws it from stays below 1.

    Args:
        estimate: of the sensor.
        device: with the fitted response.
    """
    noise = {
        "scan.noise.speckle": estimate.speckle,
        "scan.noise.range_sigma": estimate.range_sigma,
        "scan.receiver.faint_range_sigma": device.receiver.faint_range_sigma or 0.0,
        "scan.receiver.range_walk": estimate.range_walk,
        "scan.receiver.range_delay": estimate.range_delay,
    }
    if device.receiver.compression:
        noise["scan.receiver.compression"] = min(device.receiver.compression, 1.0 / (1.0 + SPREAD))
    return noise


def _drawn_values(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that a recipe draws about, rounded, by path: all that aren't nearly 0."""
    return {path: _short(value) for path, value in values.items() if value > 1e-6}


def _standing(estimate: SensorEstimate, device: Device, setting: ScannerSetting) -> tuple[str, dict[str, Any]]:
    """Return scenario and settings of a head that stands on the road and turns once, as finely as the cloud's.

    Args:
        estimate: of the sensor.
        device: with the fitted response.
        setting: of the calibration's device.
    """
    slowest, fastest = device.lines_per_second
    lines = setting.lines_per_second
    if estimate.azimuth_step is not None:
        turn = 2.0 * np.pi * device.pattern.beams / setting.pulse_rate
        lines = float(np.clip(estimate.azimuth_step / turn, slowest, fastest))
    platform = {"kind": "tripod", "stations": [60.0], "turn_seconds": _short(1.0 / lines), "turn_deg": 0.0}
    settings = {"scan.lines_per_second": _short(lines), "scan.platform": platform | {"height": 1.73}}
    return "tripod-200m-even", settings | {"scan.reflection": "oren_nayar"}


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
        "draw": {name: _about(name, value) for name, value in sensor.drawn.items()}
        | {name: {"minimum": minimum, "maximum": maximum} for name, (minimum, maximum) in sensor.usual.items()},
        "groups": [{"name": "roads", "scenes": 8, "split": {"train": 6, "validation": 1, "test": 1}}],
    }
    text = "# Written by synthroads calibrate; groups and roads are an example to be changed.\n"
    import yaml

    write_file(path, (text + yaml.safe_dump(data, sort_keys=False)).encode(), "--save-recipe", overwrite)


def _about(path: str, value: float) -> dict[str, float]:
    """Return the range from which a recipe draws a setting, about its fitted value.

    Args:
        path: of the setting in a scenario.
        value: the fitted one.
    """
    share = SPREAD_OF_STRIPS if path in _OF_STRIPS else SPREAD
    maximum = value * (1.0 + share)
    return {
        "minimum": _short(value * (1.0 - share)),
        "maximum": _short(min(maximum, 1.0) if path in _SHARES else maximum),
    }


def _short(value: float) -> float:
    """Return a number rounded to `_DIGITS` significant digits."""
    return float(f"{value:.{_DIGITS}g}")
